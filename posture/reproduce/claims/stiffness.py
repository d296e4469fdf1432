"""The paper's claims on hip stiffness: Exp. 3 at one frequency, and Fig. 13, the map of stiffness and frequency."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from posture.analysis.results import Result
from posture.config.published import Experiment3, Published
from posture.config.reproduce import ClaimRules, ReportConfig
from posture.reproduce.claims.rules import (
    Judgement,
    graded,
    measured_rule,
    mode_of,
    pattern,
    pattern_rule,
    too_few,
    trend,
    trend_rule,
)
from posture.reproduce.claims.seed_means import Condition, Means, conditions, steps, where
from posture.reproduce.claims.verdict import IN_FIGURE, PHASE_IN_THEORY, Claim, Verdict, judged, modes_in_words
from posture.reproduce.quantities import FREQ, HIP_ANKLE_R, HIP_K, HIP_RANGE, RELATIVE_PHASE

BY = (HIP_K,)
MAP = (HIP_K, FREQ)


def stiffness_claims(results: Sequence[Result], published: Experiment3, rules: ClaimRules) -> list[Verdict]:
    """Exp. 3, from `results` that may be at other frequencies, too."""
    own = where(results, FREQ, [published.freq_hz])
    modes = dict(zip(conditions(published.hip_k_nm_per_rad), published.mode, strict=True))
    return [
        judged(
            Claim(
                "stiffness_modes",
                "Exp. 3",
                "With soft hips the motion is anti-phase, with stiff hips in-phase.",
                modes_in_words(modes, BY),
                pattern_rule(rules),
            ),
            own,
            BY,
            lambda read: pattern(read(HIP_ANKLE_R), modes, BY, rules),
            HIP_ANKLE_R,
            at_all=True,
        ),
        judged(
            Claim(
                "stiffness_phase",
                "Exp. 3",
                "The relative phase falls as the hips get stiffer.",
                IN_FIGURE,
                trend_rule("relative phase against stiffness", rules) + PHASE_IN_THEORY,
            ),
            own,
            BY,
            lambda read: trend(read(RELATIVE_PHASE), list(modes), -1, "relative phase", rules),
            RELATIVE_PHASE,
            in_theory=lambda read: trend(read(HIP_ANKLE_R), list(modes), 1, "correlation", rules),
        ),
        judged(
            Claim(
                "stiffness_motion",
                "Exp. 3",
                "Soft hips move further.",
                IN_FIGURE,
                trend_rule("the range of the hip's angle against stiffness", rules),
            ),
            own,
            BY,
            lambda read: trend(read(HIP_RANGE), list(modes), -1, "hip angle", rules),
            HIP_RANGE,
        ),
    ]


def map_claims(results: Sequence[Result], paper: Published, report: ReportConfig) -> list[Verdict]:
    """Fig. 13."""
    soft, stiff = report.claims.soft_hip_k, report.claims.stiff_hip_k
    return [
        _one_mode(
            "map_stiff", f"With stiff hips (above {stiff:g} Nm/rad) the motion is in-phase", "in", results, paper, report
        ),
        _one_mode(
            "map_soft", f"With soft hips (below {soft:g} Nm/rad) the motion is anti-phase", "anti", results, paper, report
        ),
        _between(results, paper, report),
    ]


def map_grid(paper: Published, report: ReportConfig) -> list[Condition]:
    """The conditions of paper Fig. 13: hip stiffness [Nm/rad] and frequency [Hz]."""
    freqs = steps(*paper.figure_13.freq_range_hz, report.grid.map_step_hz)
    return [(hip_k, freq) for hip_k in paper.figure_13.hip_k_nm_per_rad for freq in freqs]


def map_modes(paper: Published, report: ReportConfig) -> dict[Condition, str]:
    """The mode in those conditions of paper Fig. 13 for which the paper names one."""
    soft, stiff = report.claims.soft_hip_k, report.claims.stiff_hip_k
    return {c: "in" if c[0] > stiff else "anti" for c in map_grid(paper, report) if not soft <= c[0] <= stiff}


def _one_mode(key: str, claim: str, mode: str, results: Sequence[Result], paper: Published, report: ReportConfig) -> Verdict:
    """Where the map has one mode at all frequencies."""
    modes = {c: name for c, name in map_modes(paper, report).items() if name == mode}
    hip_k, freqs = (sorted({c[i] for c in modes}) for i in (0, 1))
    published = f"{mode}-phase at {_list(hip_k)} Nm/rad, {freqs[0]:g} to {freqs[-1]:g} Hz"
    return judged(
        Claim(key, "Fig. 13", f"{claim} at every frequency.", published, pattern_rule(report.claims)),
        where(results, HIP_K, hip_k),
        MAP,
        lambda read: pattern(read(HIP_ANKLE_R), modes, MAP, report.claims),
        HIP_ANKLE_R,
        theories=("least",),
    )


def _between(results: Sequence[Result], paper: Published, report: ReportConfig) -> Verdict:
    """Where the map's mode depends on the frequency, at the stiffnesses that are anti-phase in Exp. 3."""
    published = paper.experiment_3
    soft, stiff = report.claims.soft_hip_k, report.claims.stiff_hip_k
    ends = zip(published.hip_k_nm_per_rad, published.mode, strict=True)
    hip_k = [k for k, mode in ends if soft <= k <= stiff and mode == "anti"]
    grid = [c for c in map_grid(paper, report) if c[0] in hip_k]
    at = f"{published.freq_hz:g} Hz"
    return judged(
        Claim(
            "map_between",
            "Fig. 13",
            "Between these, the mode depends on the frequency: in-phase when slow, anti-phase when fast.",
            f"{soft:g} to {stiff:g} Nm/rad; in Exp. 3, {_list(hip_k)} Nm/rad are anti-phase at {at}",
            f"Of the stiffnesses from {soft:g} to {stiff:g} Nm/rad, those that are anti-phase at {at} in Exp. 3: "
            f"{_list(hip_k)}. Reproduced: at each of them all in-phase frequencies, by the sign of the mean correlation, "
            "are below all anti-phase ones. Partly: at one of them, or the in-phase frequencies are lower on average. "
            f"{measured_rule(report.claims)}",
        ),
        where(results, HIP_K, hip_k),
        MAP,
        lambda read: _slow_in_phase(read(HIP_ANKLE_R), grid, report.claims),
        HIP_ANKLE_R,
        theories=("least",),
    )


def _slow_in_phase(means: Means, grid: Sequence[Condition], rules: ClaimRules) -> Judgement:
    if judgement := too_few(means, grid, rules):
        return judgement
    texts, separate, lower = [], 0, 0
    for hip_k in sorted({c[0] for c in grid}):
        modes = {c[1]: mode_of(means[c]) for c in grid if c[0] == hip_k and c in means}
        slow, fast = ([freq for freq, mode in modes.items() if mode == name] for name in ("in-phase", "anti-phase"))
        if slow and fast and max(slow) < min(fast):
            separate += 1
            texts.append(f"at {hip_k:g} Nm/rad in-phase up to {max(slow):g} Hz, anti-phase from {min(fast):g} Hz")
            continue
        text = f"at {hip_k:g} Nm/rad in-phase at {len(slow)}, anti-phase at {len(fast)} of {len(modes)} frequencies"
        if slow and fast and np.mean(slow) < np.mean(fast):
            lower += 1
            text += ", the in-phase ones lower on average"
        texts.append(text)
    return graded(separate == len(texts), separate + lower > 0, ", ".join(texts))


def _list(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)
