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

from posture.coordination import correlation, mode
from posture.report.seed_means import Condition, SeedMean, label

Outcome = Literal["reproduced", "partly", "not", "not measured"]
Means = Mapping[Condition, SeedMean]

MODE_SHARE = 0.75
"""Of the conditions, for "partly"; and more than a stander would get that keeps the mode that prevails in the paper."""
MEASURED_SHARE = 0.75
"""Of the paper's conditions. With less, an unfinished sweep would be judged by its easy end."""
RHO_REPRODUCED = 0.8
"""Spearman's rho of a clear trend: with eight to ten conditions chance alone gives it in one case of a hundred or fewer."""
RHO_PARTLY = 0.4
"""Of a tendency: chance alone gives it in one case of six to eight."""
SEED_SHARE = 0.5
"""Of the seeds, which must show what is judged seed by seed for "partly"."""
LEAST_CONDITIONS = 3
"""Two always lie on a trend."""

JUDGED_WHERE = f"Judged where at least {MEASURED_SHARE:.0%} of the paper's conditions have results."
PATTERN_RULE = (
    "The mode of a condition is the sign of the mean correlation over the seeds; where most seeds fell or have no mode, it "
    f"counts as different. Reproduced: the paper's mode in all conditions; partly: in at least {MODE_SHARE:.0%} of those "
    f"measured, and in more than one mode throughout would give. {JUDGED_WHERE}"
)


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


def shown_mode(mean: SeedMean) -> str:
    """The mode of a mean correlation, "no mode" where most of its trials have none."""
    return mode(mean.mean) if 2 * mean.n >= mean.trials and mean.mean else "no mode"


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
    known = [c for c in conditions if c in means and means[c].n]
    rho = spearman([c[0] for c in known], [means[c].mean for c in known])
    if math.isnan(rho):
        return Judgement("not", f"{what} does not change")
    outcome: Outcome = "reproduced" if direction * rho >= needed else "partly" if direction * rho >= RHO_PARTLY else "not"
    return Judgement(outcome, f"{what}: rho = {rho:+.2f}")


def spearman(a: Sequence[float], b: Sequence[float]) -> float:
    """Spearman's rank correlation [-]; nan where one is constant."""
    return correlation(rankdata(a), rankdata(b))


def contrast(means: Means) -> Judgement:
    """Whether the correlation differs less with the first number of the conditions than with the second.

    A difference is the largest less the smallest mean along the one, averaged over the other. Reproduced: at most half of
    the other; partly: less.
    """
    known = {c: mean.mean for c, mean in means.items() if mean.n}
    spread = [_spread(known, along) for along in (0, 1)]
    if min(spread) < 0:
        return Judgement("not measured", "too few conditions")
    finding = f"the correlation differs by {spread[0]:.2f} between amplitudes and by {spread[1]:.2f} between frequencies"
    if spread[0] <= spread[1] / 2:
        return Judgement("reproduced", finding)
    return Judgement("partly" if spread[0] < spread[1] else "not", finding)


def _spread(known: Mapping[Condition, float], along: int) -> float:
    """Average over the other number of largest less smallest value along this one; -1 where nothing can be compared."""
    groups: dict[float, list[float]] = {}
    for condition, value in known.items():
        groups.setdefault(condition[1 - along], []).append(value)
    spans = [max(group) - min(group) for group in groups.values() if len(group) > 1]
    return float(np.mean(spans)) if spans else -1.0
