"""The rules by which a claim of the paper is judged: means over seeds in, an outcome and its reason out.

The same rules are applied to the values in theory, which shows whether economy of effort is sufficient for a claim.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Literal, NamedTuple

import numpy as np
from scipy.stats import rankdata

from posture.analysis.coordination import correlation, mode
from posture.config.reproduce import ClaimRules
from posture.reproduce.claims.seed_means import Condition, Means, SeedMean, label, labels
from posture.reproduce.quantities import Variable


class Outcome(StrEnum):
    """The outcome of a claim."""

    REPRODUCED = "reproduced"
    PARTLY = "partly"
    NOT = "not reproduced"
    NOT_MEASURED = "not measured"


class Judgement(NamedTuple):
    """An outcome and, in words, what it is based on."""

    outcome: Outcome
    finding: str


EACH_RULE = (
    "Judged if there are results at each of the paper's frequencies; not reproduced if most seeds fell at one of them."
)
PARTS_RULE = " The claim has two parts: reproduced if both are, partly if one is or both are partly."


def measured_rule(rules: ClaimRules) -> str:
    """How many results a verdict needs, in words."""
    return f"Judged if at least {rules.measured_share:.0%} of the paper's conditions have results."


def pattern_rule(rules: ClaimRules) -> str:
    """The rule of `pattern` in words."""
    return (
        "The mode of a condition is the sign of the mean correlation over the seeds; a condition in which most seeds fell "
        "or have no mode counts as different. Reproduced: the paper's mode in all conditions. Partly: in at least "
        f"{rules.modes_share:.0%} of those measured, and in more than a stander with a single mode would reach. "
        f"{measured_rule(rules)}"
    )


def trend_rule(what: str, rules: ClaimRules, needed: float | None = None) -> str:
    """The rule of `trend` in words."""
    least = rules.rho_reproduced if needed is None else needed
    return (
        f"Spearman's rank correlation (rho) of {what}, of the means over the seeds that stood. In the paper's direction, "
        f"reproduced: at least {least:.2g}; partly: at least {rules.rho_partly:g}. "
        f"{measured_rule(rules)} Not reproduced if, because of falls, fewer have a value."
    )


def graded(reproduced: bool, partly: bool, finding: str) -> Judgement:
    """The judgement from two conditions, the stricter one first."""
    return Judgement(Outcome.REPRODUCED if reproduced else Outcome.PARTLY if partly else Outcome.NOT, finding)


def part(holds: bool, finding: str) -> Judgement:
    """A part of a claim that holds or does not."""
    return graded(holds, False, finding)


def combined(*parts: Judgement) -> Judgement:
    """A claim of several parts. Reproduced: every part. Partly: at least half, where a part that is partly counts half."""
    finding = "; ".join(part.finding for part in parts)
    if any(part.outcome is Outcome.NOT_MEASURED for part in parts):
        return Judgement(Outcome.NOT_MEASURED, finding)
    score = np.mean([{Outcome.REPRODUCED: 1.0, Outcome.PARTLY: 0.5, Outcome.NOT: 0.0}[part.outcome] for part in parts])
    return graded(bool(score == 1), bool(score >= 0.5), finding)


def too_few(means: Means, conditions: Sequence[Condition], rules: ClaimRules) -> Judgement | None:
    """The judgement where too few conditions have results (not measured) or a value (not reproduced); otherwise None."""
    measured = [c for c in conditions if c in means]
    needed = max(rules.measured_share * len(conditions), min(rules.min_conditions, len(conditions)))
    if len(measured) < needed:
        return Judgement(Outcome.NOT_MEASURED, f"results in {len(measured)} of {len(conditions)} conditions")
    known = sum(means[c].n > 0 for c in measured)
    if known < needed:
        return Judgement(Outcome.NOT, f"a value in only {known} of {len(measured)} conditions")
    return None


def incomplete(means: Means, conditions: Sequence[Condition], by: Sequence[Variable]) -> Judgement | None:
    """The judgement on a claim about each of `conditions` where one has no results, or no value of most seeds."""
    if missing := [c for c in conditions if c not in means]:
        return Judgement(Outcome.NOT_MEASURED, f"no results at {labels(by, missing)}")
    if unknown := [c for c in conditions if not means[c].is_known]:
        return Judgement(Outcome.NOT, f"most seeds have no value at {labels(by, unknown)}")
    return None


def mode_of(mean: SeedMean) -> str:
    """The mode of a mean correlation; "no mode" where most of its trials have none."""
    return mode(mean.mean) if mean.is_known and mean.mean else "no mode"


def pattern(means: Means, expected: Mapping[Condition, str], by: Sequence[Variable], rules: ClaimRules) -> Judgement:
    """Compare mean correlations with the mode ("in" or "anti") `expected` in each condition. See `pattern_rule`."""
    measured = [c for c in expected if c in means]
    if not measured or len(measured) < rules.measured_share * len(expected):
        return Judgement(Outcome.NOT_MEASURED, f"results in {len(measured)} of {len(expected)} conditions")
    ours = {c: mode_of(means[c]) for c in measured}
    differ = [f"{label(by, c)} ({ours[c]})" for c in measured if ours[c] != f"{expected[c]}-phase"]
    agree = len(measured) - len(differ)
    finding = f"the paper's mode in {agree} of {len(measured)} conditions"
    if differ:
        finding += f", not at {', '.join(differ)}"
    if missing := [c for c in expected if c not in means]:
        finding += f", no value at {labels(by, missing)}"
    needed = rules.modes_share * len(measured)
    if len(set(expected.values())) > 1:
        needed = max(needed, max(Counter(expected[c] for c in measured).values()) + 1)
    return graded(agree == len(expected), agree >= needed, finding)


def trend(
    means: Means,
    conditions: Sequence[Condition],
    direction: Literal[1, -1],
    what: str,
    rules: ClaimRules,
    needed: float | None = None,
) -> Judgement:
    """Whether the means of `what` rise (1) or fall (-1) along `conditions`. `needed`: rho for "reproduced", if not the usual
    one. See `trend_rule`."""
    if judgement := too_few(means, conditions, rules):
        return Judgement(judgement.outcome, f"{what}: {judgement.finding}")
    known = [c for c in conditions if c in means and means[c].n]
    rho = spearman([c[0] for c in known], [means[c].mean for c in known])
    if math.isnan(rho):
        return Judgement(Outcome.NOT, f"{what} does not change")
    along = direction * rho
    return graded(
        along >= (rules.rho_reproduced if needed is None else needed), along >= rules.rho_partly, f"{what}: rho = {rho:+.2f}"
    )


def spearman(a: Sequence[float], b: Sequence[float]) -> float:
    """Spearman's rank correlation [-], rounded to 1e-9, so that exactly 0.4 is at least 0.4; nan if one is constant."""
    return round(correlation(rankdata(a), rankdata(b)), 9)
