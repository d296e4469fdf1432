"""The paper's claim on the target's amplitude, made in its text only."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from posture.analysis.results import Result
from posture.config.reproduce import ClaimRules, ReportConfig
from posture.reproduce.claims.rules import Judgement, Outcome, graded
from posture.reproduce.claims.seed_means import Condition, Means, conditions, where
from posture.reproduce.claims.verdict import Claim, Verdict, judged
from posture.reproduce.quantities import AMPLITUDE, FREQ, HIP_ANKLE_R


def amplitude_claim(results: Sequence[Result], freqs: Sequence[float], report: ReportConfig) -> Verdict:
    """The amplitude at the frequencies of paper Table 3, `freqs` [Hz]."""
    amplitudes = report.grid.amplitudes_m
    grid = [(*a, *f) for a, f in product(conditions(amplitudes), conditions(freqs))]
    return judged(
        Claim(
            "amplitude",
            "Amplitude",
            "The target's amplitude changes coordination less clearly than its frequency does.",
            "in the text only",
            f"Amplitudes of {amplitudes[0]:g} to {amplitudes[-1]:g} m differ by a factor of "
            f"{amplitudes[-1] / amplitudes[0]:.2g}, frequencies of {min(freqs):g} to {max(freqs):g} Hz by a factor of "
            f"{max(freqs) / min(freqs):.2g}; both are compared over the smaller factor. Change with amplitude: highest "
            "minus lowest mean correlation at a frequency, averaged over the frequencies. Change with frequency: the same "
            "at an amplitude, over each range of frequencies that spans this factor, averaged over ranges and amplitudes. "
            f"Reproduced: the first is at most {report.claims.amplitude_share:.0%} of the second; partly: it is less. "
            "Judged if all conditions have results in which most seeds did not fall.",
        ),
        where(where(results, AMPLITUDE, amplitudes), FREQ, freqs),
        (AMPLITUDE, FREQ),
        lambda read: _smaller_change(read(HIP_ANKLE_R), grid, report.claims),
        theories=("least",),
    )


def _smaller_change(means: Means, grid: Sequence[Condition], rules: ClaimRules) -> Judgement:
    """Whether the mean correlation changes less with amplitude than with frequency; conditions are (amplitude, frequency).

    Not measured if one has no value; the numbers are then those of the frequencies at which every amplitude has one.
    """
    unknown = [c for c in grid if c not in means or not means[c].is_known]
    if not unknown:
        return _compared(means, grid, rules)
    finding = f"no value, or that of a few seeds only, in {len(unknown)} of {len(grid)} conditions"
    rest = [c for c in grid if c[1] not in {freq for _, freq in unknown}]
    if (count := len({freq for _, freq in rest})) >= rules.min_conditions:
        finding += f"; at the {count} frequencies with a value of every amplitude, {_compared(means, rest, rules).finding}"
    return Judgement(Outcome.NOT_MEASURED, finding)


def _compared(means: Means, grid: Sequence[Condition], rules: ClaimRules) -> Judgement:
    """The same where every condition has a value."""
    amplitudes, freqs = (sorted({c[i] for c in grid}) for i in (0, 1))
    factor = amplitudes[-1] / amplitudes[0]
    near = 1 + 1e-9  # 1.5 Hz is twice 0.75 Hz
    ranges = [[g for g in freqs if f <= g <= factor * f * near] for f in freqs if factor * f <= freqs[-1] * near]
    if not ranges:
        return Judgement(Outcome.NOT_MEASURED, f"no two frequencies differ by the factor of {factor:.2g}")
    with_amplitude = _change([[means[a, f].mean for a in amplitudes] for f in freqs])
    over_factor, over_all = (
        _change([[means[a, f].mean for f in some] for a in amplitudes for some in groups]) for groups in (ranges, [freqs])
    )
    finding = (
        f"the correlation changes by {with_amplitude:.2f} with amplitude ({amplitudes[0]:g} to {amplitudes[-1]:g} m), by "
        f"{over_factor:.2f} with frequency over the same factor of {factor:.2g}, by {over_all:.2f} over all frequencies "
        f"({freqs[0]:g} to {freqs[-1]:g} Hz)"
    )
    return graded(with_amplitude <= rules.amplitude_share * over_factor, with_amplitude < over_factor, finding)


def _change(groups: Sequence[Sequence[float]]) -> float:
    """Largest minus smallest value of a group, averaged over the groups."""
    return float(np.mean([np.ptp(group) for group in groups]))
