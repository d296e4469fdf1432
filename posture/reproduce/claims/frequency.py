"""The paper's claims on Exp. 1: one policy at ten target frequencies. Rows of results in, verdicts out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from posture.analysis.coordination import sign_change_frequency
from posture.analysis.results import Row
from posture.reproduce.claims.rules import (
    EACH_RULE,
    LEAST_DIFFERENCE,
    PATTERN_RULE,
    SEED_SHARE,
    Judgement,
    Means,
    Outcome,
    clearly_below,
    combined,
    incomplete,
    part,
    pattern,
    trend,
    trend_rule,
)
from posture.reproduce.claims.seed_means import Condition, conditions, sample, where
from posture.reproduce.claims.verdict import (
    IN_FIGURE,
    NO_RESULTS,
    PARTS_RULE,
    PHASE_IN_THEORY,
    Claim,
    Judge,
    Paper,
    Transitions,
    Verdict,
    by_seed,
    judged,
    modes_said,
    predicted,
    values_said,
)

HIGH_HZ = 1.2
"""Where high frequencies begin [Hz]: the paper places the dip of tracking above it."""
FAR_BELOW = 0.5
"""The ankle's range is far below the hip's where it is at most this share of it (assumed: the paper gives no numbers)."""


def frequency_claims(results: Sequence[Row], paper: Paper, transitions: Transitions) -> list[Verdict]:
    """Exp. 1. All `results` say where the modes switch, those at the ten frequencies of paper Table 3 all else."""
    by, table = ("freq_hz",), paper["table_3"]
    ten = conditions(table["freq_hz"])
    rows = [_with_cop(row) for row in where(results, "freq_hz", table["freq_hz"])]
    modes = dict(zip(ten, table["mode"], strict=True))
    published_r = {c: r for c, r in zip(ten, table["target_head_r"], strict=True) if c[0] >= HIGH_HZ}

    def rising(*columns: tuple[str, str]) -> Judge:
        return lambda read: combined(*(trend(read(column), ten, 1, what) for column, what in columns))

    return [
        judged(
            Claim(
                "frequency_modes",
                "Exp. 1",
                "Ankle and hip move in phase when the target is slow and in anti-phase when it is fast.",
                modes_said(modes, by),
                PATTERN_RULE,
            ),
            rows,
            by,
            lambda read: pattern(read("hip_ankle_r"), modes, by),
            ("hip_ankle_r", ".2f", "r"),
            whole=True,
        ),
        _switch(results, modes, transitions, paper["experiment_4a"]["transition_hz"]),
        judged(
            Claim(
                "frequency_phase",
                "Exp. 1",
                "The relative phase of hip and ankle grows with the target's frequency.",
                IN_FIGURE,
                trend_rule("relative phase against frequency") + PHASE_IN_THEORY,
            ),
            rows,
            by,
            lambda read: trend(read("relative_phase_deg"), ten, 1, "relative phase"),
            ("relative_phase_deg", ".0f", "phase [deg]"),
            in_theory=lambda read: trend(read("hip_ankle_r"), ten, -1, "correlation"),
        ),
        judged(
            Claim(
                "frequency_hip",
                "Exp. 1",
                "The hip moves further and its torque gets larger as the frequency grows.",
                "in figures only",
                trend_rule("the range of the hip's angle, and of its torque, against frequency") + PARTS_RULE,
            ),
            rows,
            by,
            rising(("hip_range_deg", "hip angle"), ("hip_torque_range_nm", "hip torque")),
            ("hip_range_deg", ".1f", "hip angle [deg]"),
            ("hip_torque_range_nm", ".1f", "torque [Nm]"),
        ),
        judged(
            Claim(
                "frequency_ankle",
                "Exp. 1",
                "The ankle's range stays similar at all frequencies, and at high ones far below the hip's.",
                IN_FIGURE,
                "Similar: between its least and its largest the ankle's range differs by at most half as much as the hip's. "
                f"Far below: at every frequency from {HIGH_HZ:g} Hz on it is at most {FAR_BELOW:.0%} of the hip's. "
                f"Reproduced: both; partly: one. {EACH_RULE}",
            ),
            rows,
            by,
            lambda read: _ankle(read("ankle_range_deg"), read("hip_range_deg"), ten, by),
            ("ankle_range_deg", ".1f", "ankle angle [deg]"),
            ("hip_range_deg", ".1f", "hip angle [deg]"),
        ),
        judged(
            Claim(
                "frequency_tracking",
                "Exp. 1",
                f"The head follows the target less closely above {HIGH_HZ:g} Hz.",
                values_said(published_r, by, ".4f"),
                f"Reproduced: the target-head correlation is at every frequency above {HIGH_HZ:g} Hz below that at all "
                "others by more than the seeds scatter: their intervals lie apart, or of one seed the values by "
                f"{LEAST_DIFFERENCE:g} or more. Partly: so below that at {HIGH_HZ:g} Hz alone. {EACH_RULE}",
                "The least-torque motion keeps the head within the tolerance at every frequency for which it exists: there "
                "neither body nor task asks for a dip. The highest frequency, 1.50 Hz, was just outside those that the "
                "authors trained on.",
            ),
            rows,
            by,
            lambda read: _dip(read("target_head_r"), ten, by),
            ("target_head_r", ".4f", "r"),
        ),
        judged(
            Claim(
                "frequency_cop",
                "Exp. 1",
                "The centre of pressure spreads further over the foot as the frequency grows.",
                IN_FIGURE,
                trend_rule("the spread of the centre of pressure (5th to 95th percentile) against frequency")
                + " In theory the spread is from end to end.",
            ),
            rows,
            by,
            rising(("cop_spread_m", "spread")),
            ("cop_spread_m", ".3f", "spread [m]"),
        ),
    ]


def _switch(rows: Sequence[Row], modes: Mapping[Condition, str], transitions: Transitions, ramp_hz: float) -> Verdict:
    low = max(c[0] for c, mode in modes.items() if mode == "in")
    high = min(c[0] for c, mode in modes.items() if mode == "anti")
    where = f"{low:.2f} to {high:.2f} Hz"
    claim = Claim(
        "frequency_switch",
        "Exp. 1",
        "There is one frequency at which the modes switch.",
        f"between {low:.2f} and {high:.2f} Hz; {ramp_hz:g} Hz in a ramp",
        "A seed's switch is where its correlation, linear between frequencies, goes from in-phase to anti-phase, if it "
        f"does so once and never the other way. Reproduced: within {where} in every seed; partly: in at least "
        f"{SEED_SHARE:.0%} of them. A seed without such a switch counts against it.",
    )
    theory = predicted(transitions)
    if not rows:
        return claim.verdict("not measured", NO_RESULTS, NO_RESULTS, theory, "")
    found = switches(rows)
    inside = [low <= hz <= high for hz in found.values()]
    outcome: Outcome = "reproduced" if all(inside) else "partly" if np.mean(inside) >= SEED_SHARE else "not"
    finding = f"{sum(inside)} of {len(inside)} seeds within {where}"
    often = [f"seed {seed:g} {n}" for seed, signs in _signs(rows).items() if (n := _changes(signs)) != 1]
    told = f"; changes of sign: {', '.join(often)}" if often else ""
    measured = f"{finding}: {by_seed(found)}{told}; {sample(rows, ('freq_hz',))}"
    comment = f"By theory the switch lies at {theory}; the paper's bracket is {where}."
    return claim.verdict(outcome, finding, measured, theory, comment)


def switches(rows: Sequence[Row]) -> dict[float, float]:
    """By seed, the frequency [Hz] at which the hip-ankle correlation changes sign from positive to negative.

    nan where it does not, or where it changes sign more than once or the other way.
    """
    found = {}
    for seed, signs in _signs(rows).items():
        own = [row for row in rows if row["seed"] == seed and row["valid"]]
        hz = sign_change_frequency([row["freq_hz"] for row in own], [row["hip_ankle_r"] for row in own])
        found[seed] = hz if hz is not None and signs[0] and _changes(signs) == 1 else math.nan
    return found


def _signs(rows: Sequence[Row]) -> dict[float, list[bool]]:
    """By seed, whether the correlation is positive, along rising frequency; without falls, nan and 0."""
    found: dict[float, list[bool]] = {seed: [] for seed in sorted({row["seed"] for row in rows})}
    for row in sorted(rows, key=lambda row: float(row["freq_hz"])):
        if row["valid"] and abs(row["hip_ankle_r"]) > 0:
            found[row["seed"]].append(row["hip_ankle_r"] > 0)
    return found


def _changes(signs: Sequence[bool]) -> int:
    return sum(a != b for a, b in pairwise(signs))


def _ankle(ankle: Means, hip: Means, ten: Sequence[Condition], by: Sequence[str]) -> Judgement:
    if lacking := incomplete(ankle, ten, by) or incomplete(hip, ten, by):
        return lacking
    change = [max(values) - min(values) for values in ([m[c].mean for c in ten] for m in (ankle, hip))]
    high = max(ankle[c].mean / hip[c].mean for c in ten if c[0] >= HIGH_HZ)
    return combined(
        part(change[0] <= change[1] / 2, f"ankle's range differs by {change[0]:.1f}, hip's by {change[1]:.1f} deg"),
        part(high <= FAR_BELOW, f"ankle's is at most {high:.0%} of the hip's from {HIGH_HZ:g} Hz on"),
    )


def _dip(means: Means, ten: Sequence[Condition], by: Sequence[str]) -> Judgement:
    if lacking := incomplete(means, ten, by):
        return lacking
    above, others = ([means[c] for c in ten if (c[0] > HIGH_HZ) is high] for high in (True, False))
    most, least, edge = max(m.mean for m in above), min(m.mean for m in others), means[HIGH_HZ,]
    finding = f"above {HIGH_HZ:g} Hz at most {most:.4f}, at {HIGH_HZ:g} Hz {edge.mean:.4f}, below it at least {least:.4f}"
    if all(clearly_below(a, b) for a in above for b in others):
        return Judgement("reproduced", finding)
    return Judgement("partly" if all(clearly_below(a, edge) for a in above) else "not", finding)


def _with_cop(row: Row) -> Row:
    """The row with the spread of the centre of pressure [m], measured and in theory."""
    spread = {"cop_spread_m": ("cop_p95_m", "cop_p05_m"), "least_cop_spread_m": ("least_cop_max_m", "least_cop_min_m")}
    return {**row, **{name: row.get(a, math.nan) - row.get(b, math.nan) for name, (a, b) in spread.items()}}
