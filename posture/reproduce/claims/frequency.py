"""The paper's claims on Exp. 1: one policy at ten target frequencies."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from posture.analysis.coordination import sign_change_frequency
from posture.analysis.results import Result
from posture.config.published import Published
from posture.config.reproduce import ClaimRules
from posture.reproduce.claims.rules import (
    EACH_RULE,
    PARTS_RULE,
    Judgement,
    combined,
    graded,
    incomplete,
    part,
    pattern,
    pattern_rule,
    trend,
    trend_rule,
)
from posture.reproduce.claims.seed_means import Condition, Means, SeedMean, conditions, sample, where
from posture.reproduce.claims.verdict import (
    IN_FIGURE,
    PHASE_IN_THEORY,
    Claim,
    Judge,
    Transitions,
    Verdict,
    by_seed,
    judged,
    modes_in_words,
    values_in_words,
)
from posture.reproduce.quantities import (
    ANKLE_RANGE,
    COP_SPREAD,
    FREQ,
    HIP_ANKLE_R,
    HIP_RANGE,
    HIP_TORQUE,
    RELATIVE_PHASE,
    TARGET_HEAD_R,
    Quantity,
)

BY = (FREQ,)


def frequency_claims(
    results: Sequence[Result], paper: Published, transitions: Transitions, rules: ClaimRules
) -> list[Verdict]:
    """Exp. 1. All `results` show where the modes switch; those at the ten frequencies of paper Table 3 show all else."""
    table, high = paper.table_3, f"{rules.high_freq_hz:g} Hz"
    ten = conditions(table.freq_hz)
    own = where(results, FREQ, table.freq_hz)
    modes = dict(zip(ten, table.mode, strict=True))
    published_r = {c: r for c, r in zip(ten, table.target_head_r, strict=True) if c[0] >= rules.high_freq_hz}

    def rising(*parts: tuple[Quantity, str]) -> Judge:
        return lambda read: combined(*(trend(read(quantity), ten, 1, what, rules) for quantity, what in parts))

    return [
        judged(
            Claim(
                "frequency_modes",
                "Exp. 1",
                "Ankle and hip move in phase when the target is slow and in anti-phase when it is fast.",
                modes_in_words(modes, BY),
                pattern_rule(rules),
            ),
            own,
            BY,
            lambda read: pattern(read(HIP_ANKLE_R), modes, BY, rules),
            HIP_ANKLE_R,
            at_all=True,
        ),
        _switch(results, modes, transitions, paper.experiment_4a.transition_hz, rules),
        judged(
            Claim(
                "frequency_phase",
                "Exp. 1",
                "The relative phase of hip and ankle grows with the target's frequency.",
                IN_FIGURE,
                trend_rule("relative phase against frequency", rules) + PHASE_IN_THEORY,
            ),
            own,
            BY,
            lambda read: trend(read(RELATIVE_PHASE), ten, 1, "relative phase", rules),
            RELATIVE_PHASE,
            in_theory=lambda read: trend(read(HIP_ANKLE_R), ten, -1, "correlation", rules),
        ),
        judged(
            Claim(
                "frequency_hip",
                "Exp. 1",
                "The hip moves further and its torque gets larger as the frequency grows.",
                "in figures only",
                trend_rule("the ranges of the hip's angle and torque against frequency", rules) + PARTS_RULE,
            ),
            own,
            BY,
            rising((HIP_RANGE, "hip angle"), (HIP_TORQUE, "hip torque")),
            HIP_RANGE,
            HIP_TORQUE,
        ),
        judged(
            Claim(
                "frequency_ankle",
                "Exp. 1",
                "The ankle's range stays similar at all frequencies, and at high ones far below the hip's.",
                IN_FIGURE,
                "Similar: the difference between the ankle's smallest and largest range is at most "
                f"{rules.ankle_change_share:.0%} of that of the hip. Far below: at every frequency from {high} upwards the "
                f"ankle's range is at most {rules.ankle_range_share:.0%} of the hip's. Reproduced: both; partly: one. "
                f"{EACH_RULE}",
            ),
            own,
            BY,
            lambda read: _ankle(read(ANKLE_RANGE), read(HIP_RANGE), ten, rules),
            ANKLE_RANGE,
            HIP_RANGE,
        ),
        judged(
            Claim(
                "frequency_tracking",
                "Exp. 1",
                f"The head follows the target less closely above {high}.",
                values_in_words(published_r, BY, ".4f"),
                f"Reproduced: at every frequency above {high} the target-head correlation is below that at all other "
                "frequencies by more than the scatter of the seeds: their intervals do not overlap or, with one seed, the "
                f"values differ by at least {rules.min_tracking_difference:g}. Partly: below that at {high} alone. "
                f"{EACH_RULE}",
                "The least-torque motion keeps the head within the tolerance at every frequency at which it exists, so "
                "neither the body nor the task requires a dip. The highest frequency, 1.50 Hz, was just outside those that "
                "the authors trained on.",
            ),
            own,
            BY,
            lambda read: _dip(read(TARGET_HEAD_R), ten, rules),
            TARGET_HEAD_R,
        ),
        judged(
            Claim(
                "frequency_cop",
                "Exp. 1",
                "The centre of pressure spreads further over the foot as the frequency grows.",
                IN_FIGURE,
                trend_rule("the spread of the centre of pressure (5th to 95th percentile) against frequency", rules)
                + " In theory the spread is that between the extremes.",
            ),
            own,
            BY,
            rising((COP_SPREAD, "spread")),
            COP_SPREAD,
        ),
    ]


def _switch(
    results: Sequence[Result], modes: Mapping[Condition, str], transitions: Transitions, ramp_hz: float, rules: ClaimRules
) -> Verdict:
    low = max(c[0] for c, mode in modes.items() if mode == "in")
    high = min(c[0] for c, mode in modes.items() if mode == "anti")
    bracket = f"{low:.2f} to {high:.2f} Hz"
    claim = Claim(
        "frequency_switch",
        "Exp. 1",
        "There is one frequency at which the modes switch.",
        f"between {low:.2f} and {high:.2f} Hz; {ramp_hz:g} Hz in a ramp",
        "A seed's switch is the frequency at which its correlation, interpolated linearly between frequencies, changes from "
        "in-phase to anti-phase, if it does so once and never changes back. Reproduced: every seed switches within "
        f"{bracket}. Partly: at least {rules.seeds_share:.0%} of them do. A seed without such a switch counts against it.",
    )
    if not results:
        return claim.not_measured(str(transitions))
    found = switches(results)
    inside = [low <= hz <= high for hz in found.values()]
    finding = f"{sum(inside)} of {len(inside)} seeds within {bracket}"
    outcome, _ = graded(all(inside), bool(np.mean(inside) >= rules.seeds_share), finding)
    others = [f"seed {seed} {n}" for seed, signs in _signs(results).items() if (n := _changes(signs)) != 1]
    changes = f"; changes of sign: {', '.join(others)}" if others else ""
    measured = f"{finding}: {by_seed(found)}{changes}; {sample(results, BY)}"
    comment = f"In theory the switch is at {transitions}; the paper's is between {bracket.replace(' to ', ' and ')}."
    return claim.verdict(outcome, finding, measured, str(transitions), comment)


def switches(results: Sequence[Result]) -> dict[int, float]:
    """By seed, the frequency [Hz] at which the hip-ankle correlation changes from positive to negative.

    nan if it does not, if it changes sign more than once, or if it changes the other way.
    """
    found = {}
    for seed, signs in _signs(results).items():
        own = [result for result in results if result.origin.seed == seed and result.valid]
        hz = sign_change_frequency([result.freq_hz for result in own], [result.hip_ankle_r for result in own])
        found[seed] = hz if hz is not None and signs[0] and _changes(signs) == 1 else math.nan
    return found


def _signs(results: Sequence[Result]) -> dict[int, list[bool]]:
    """By seed, whether the correlation is positive, along rising frequency; without falls, nan and 0."""
    found: dict[int, list[bool]] = {seed: [] for seed in sorted({result.origin.seed for result in results})}
    for result in sorted(results, key=lambda result: result.freq_hz):
        if result.valid and abs(result.hip_ankle_r) > 0:
            found[result.origin.seed].append(result.hip_ankle_r > 0)
    return found


def _changes(signs: Sequence[bool]) -> int:
    return sum(a != b for a, b in pairwise(signs))


def _ankle(ankle: Means, hip: Means, ten: Sequence[Condition], rules: ClaimRules) -> Judgement:
    if judgement := incomplete(ankle, ten, BY) or incomplete(hip, ten, BY):
        return judgement
    ankle_change, hip_change = (np.ptp([means[c].mean for c in ten]) for means in (ankle, hip))
    share = max(ankle[c].mean / hip[c].mean for c in ten if c[0] >= rules.high_freq_hz)
    return combined(
        part(
            bool(ankle_change <= rules.ankle_change_share * hip_change),
            f"the ankle's range changes by {ankle_change:.1f} deg, the hip's by {hip_change:.1f} deg",
        ),
        part(
            share <= rules.ankle_range_share,
            f"the ankle's is at most {share:.0%} of the hip's from {rules.high_freq_hz:g} Hz upwards",
        ),
    )


def _dip(means: Means, ten: Sequence[Condition], rules: ClaimRules) -> Judgement:
    if judgement := incomplete(means, ten, BY):
        return judgement
    start = rules.high_freq_hz
    above, others = ([means[c] for c in ten if (c[0] > start) is high] for high in (True, False))
    edge = means[(start,)]
    finding = (
        f"above {start:g} Hz at most {max(mean.mean for mean in above):.4f}, at {start:g} Hz {edge.mean:.4f}, "
        f"below it at least {min(mean.mean for mean in others):.4f}"
    )

    def below(low: SeedMean, high: SeedMean) -> bool:
        """Whether `low` is less by more than the scatter of the seeds."""
        if math.isfinite(low.high) and math.isfinite(high.low):
            return low.high < high.low
        return low.mean + rules.min_tracking_difference <= high.mean

    return graded(all(below(a, b) for a in above for b in others), all(below(a, edge) for a in above), finding)
