"""The rules by which a claim of the paper is judged: means over seeds in, an outcome and what it rests on out.

The same rules are applied to theory's values, so that one can see whether a claim follows from economy.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from scipy.stats import rankdata

from posture.analysis.coordination import correlation, mode
from posture.reproduce.claims.seed_means import Condition, SeedMean, label

Outcome = Literal["reproduced", "partly", "not", "not measured"]
Means = Mapping[Condition, SeedMean]

MODE_SHARE = 0.75
"""Of the conditions, for "partly"; and more than a stander would get that keeps the mode that prevails in the paper."""
MEASURED_SHARE = 0.75
"""Of the paper's conditions. With less, an unfinished sweep would be judged by its easy end."""
RHO_REPRODUCED = 0.8
"""Spearman's rho of a clear trend. Chance alone gives it with p = 0.011, 0.007, 0.004 in 8, 9, 10 conditions, one-sided."""
RHO_PARTLY = 0.4
"""Of a tendency: p = 0.16, 0.15, 0.12."""
SEED_SHARE = 0.5
"""Of the seeds, which must show what is judged seed by seed for "partly"."""
LEAST_CONDITIONS = 3
"""Two always lie on a trend."""

LEAST_DIFFERENCE = 0.001
"""In the target-head correlation, where no interval says how far chance goes: about a third of what paper Table 3 has
between 1.20 and 1.35 Hz."""

JUDGED_WHERE = f"Judged where at least {MEASURED_SHARE:.0%} of the paper's conditions have results."
PATTERN_RULE = (
    "The mode of a condition is the sign of the mean correlation over the seeds; where most seeds fell or have no mode, it "
    f"counts as different. Reproduced: the paper's mode in all conditions; partly: in at least {MODE_SHARE:.0%} of those "
    f"measured, and in more than one mode throughout would give. {JUDGED_WHERE}"
)
EACH_RULE = "Judged where each of the paper's frequencies has results; not reproduced where most seeds fell at one of them."


def trend_rule(what: str, needed: float = RHO_REPRODUCED) -> str:
    """The rule of `trend` in words."""
    return (
        f"Spearman's rho of {what}, means over the seeds that stood. In the paper's direction, reproduced: {needed:.2g} or "
        f"more; partly: {RHO_PARTLY:g} or more. {JUDGED_WHERE}"
    )


class Judgement(NamedTuple):
    """An outcome, and in words what it rests on."""

    outcome: Outcome
    finding: str


def part(holds: bool, finding: str) -> Judgement:
    """A claim that holds or does not."""
    return Judgement("reproduced" if holds else "not", finding)


def combined(*parts: Judgement) -> Judgement:
    """A claim of several parts. Reproduced: every part; partly: half of them, one that is met partly counts half."""
    finding = "; ".join(p.finding for p in parts)
    outcomes = [p.outcome for p in parts]
    if "not measured" in outcomes:
        return Judgement("not measured", finding)
    score = float(np.mean([{"reproduced": 1.0, "partly": 0.5, "not": 0.0}[o] for o in outcomes]))
    return Judgement("reproduced" if score == 1 else "partly" if score >= 0.5 else "not", finding)


def unfinished(means: Means, conditions: Sequence[Condition]) -> Judgement | None:
    """The judgement where there are too few results for any: not measured, or, where nobody stood in them, not."""
    measured = [c for c in conditions if c in means]
    needed = max(MEASURED_SHARE * len(conditions), min(LEAST_CONDITIONS, len(conditions)))
    if len(measured) < needed:
        return Judgement("not measured", f"results in {len(measured)} of {len(conditions)} conditions")
    stood = sum(means[c].n > 0 for c in measured)
    if stood < needed:
        return Judgement("not", f"a value in only {stood} of {len(measured)} conditions")
    return None


def incomplete(means: Means, conditions: Sequence[Condition], by: Sequence[str]) -> Judgement | None:
    """What a claim about each of `conditions` gets where one has no results, or where most trials have no value."""
    if missing := [label(by, c) for c in conditions if c not in means]:
        return Judgement("not measured", f"no results at {', '.join(missing)}")
    if lacking := [label(by, c) for c in conditions if not known(means[c])]:
        return Judgement("not", f"most seeds have no value at {', '.join(lacking)}")
    return None


def known(mean: SeedMean) -> bool:
    """Whether at least half of the trials have a value, so that it is not a mean of few survivors."""
    return mean.n > 0 and 2 * mean.n >= mean.trials


def shown_mode(mean: SeedMean) -> str:
    """The mode of a mean correlation, "no mode" where most of its trials have none."""
    return mode(mean.mean) if known(mean) and mean.mean else "no mode"


def pattern(means: Means, expected: Mapping[Condition, str], by: Sequence[str]) -> Judgement:
    """Mean correlations against the `expected` mode ("in" or "anti") of each condition. See PATTERN_RULE."""
    measured = [c for c in expected if c in means]
    if not measured or len(measured) < MEASURED_SHARE * len(expected):
        return Judgement("not measured", f"results in {len(measured)} of {len(expected)} conditions")
    shown = {c: shown_mode(means[c]) for c in measured}
    differ = [f"{label(by, c)} ({shown[c]})" for c in measured if shown[c] != f"{expected[c]}-phase"]
    agree = len(measured) - len(differ)
    finding = f"the paper's mode in {agree} of {len(measured)} conditions"
    if differ:
        finding += f", not at {', '.join(differ)}"
    if missing := [label(by, c) for c in expected if c not in means]:
        finding += f", no value at {', '.join(missing)}"
    if agree == len(expected):
        return Judgement("reproduced", finding)
    needed = MODE_SHARE * len(measured)
    if len(set(expected.values())) > 1:
        needed = max(needed, max(Counter(expected[c] for c in measured).values()) + 1)
    return Judgement("partly" if agree >= needed else "not", finding)


def trend(
    means: Means, conditions: Sequence[Condition], direction: Literal[1, -1], what: str, needed: float = RHO_REPRODUCED
) -> Judgement:
    """Whether the means of `what` rise (1) or fall (-1) along the one number of `conditions`. See `trend_rule`."""
    if lacking := unfinished(means, conditions):
        return Judgement(lacking.outcome, f"{what}: {lacking.finding}")
    there = [c for c in conditions if c in means and means[c].n]
    rho = spearman([c[0] for c in there], [means[c].mean for c in there])
    if math.isnan(rho):
        return Judgement("not", f"{what} does not change")
    outcome: Outcome = "reproduced" if direction * rho >= needed else "partly" if direction * rho >= RHO_PARTLY else "not"
    return Judgement(outcome, f"{what}: rho = {rho:+.2f}")


def spearman(a: Sequence[float], b: Sequence[float]) -> float:
    """Spearman's rank correlation [-]; nan where one is constant."""
    return correlation(rankdata(a), rankdata(b))


def clearly_below(low: SeedMean, high: SeedMean) -> bool:
    """Whether `low` is less by more than the seeds scatter: intervals apart, or LEAST_DIFFERENCE where there are none."""
    if math.isfinite(low.high) and math.isfinite(high.low):
        return low.high < high.low
    return low.mean + LEAST_DIFFERENCE <= high.mean


def contrast(means: Means, grid: Sequence[Condition]) -> Judgement:
    """Whether the mean correlation differs less with the first number of the conditions, the amplitude, than with the
    second, the frequency, where that grows by the same factor. Every condition of `grid` has to have a value."""
    lacking = [c for c in grid if c not in means or not known(means[c])]
    if not lacking:
        return _compared(means, grid)
    finding = f"no value, or one of a few seeds that stood, in {len(lacking)} of {len(grid)} conditions"
    lost = {c[1] for c in lacking}
    rest = [c for c in grid if c[1] not in lost]
    if len(left := {c[1] for c in rest}) >= LEAST_CONDITIONS:
        finding += f"; over the {len(left)} frequencies that have all amplitudes {_compared(means, rest).finding}"
    return Judgement("not measured", finding)


def _compared(means: Means, grid: Sequence[Condition]) -> Judgement:
    """`contrast` where every condition has a value."""
    amplitudes, freqs = (sorted({c[i] for c in grid}) for i in (0, 1))
    factor = amplitudes[-1] / amplitudes[0]
    near = 1 + 1e-9  # 1.5 Hz is twice 0.75 Hz
    ranges = [[g for g in freqs if f <= g <= factor * f * near] for f in freqs if factor * f <= freqs[-1] * near]
    if not ranges:
        return Judgement("not measured", f"no two frequencies differ by the factor of {factor:.2g}")
    between = _spread([[means[a, f].mean for a in amplitudes] for f in freqs])
    over_factor, over_all = (
        _spread([[means[a, f].mean for f in some] for a in amplitudes for some in groups]) for groups in (ranges, [freqs])
    )
    finding = (
        f"the correlation differs by {between:.2f} between amplitudes ({amplitudes[0]:g} to {amplitudes[-1]:g} m), by "
        f"{over_factor:.2f} between frequencies over the same factor of {factor:.2g}, by {over_all:.2f} over all of them "
        f"({freqs[0]:g} to {freqs[-1]:g} Hz)"
    )
    if between <= over_factor / 2:
        return Judgement("reproduced", finding)
    return Judgement("partly" if between < over_factor else "not", finding)


def _spread(groups: Sequence[Sequence[float]]) -> float:
    """Largest less smallest value of a group, averaged over the groups."""
    return float(np.mean([max(group) - min(group) for group in groups]))
