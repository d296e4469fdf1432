"""A verdict on a claim of the paper, by one rule for the results and for the values in theory."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby

from posture.analysis.results import Result
from posture.reproduce.claims.rules import Judgement, Outcome
from posture.reproduce.claims.seed_means import (
    Condition,
    Means,
    label,
    listing,
    mean_of,
    sample,
    seed_means,
    span,
    theory_means,
)
from posture.reproduce.quantities import Quantity, Theory, Variable

Read = Callable[[Quantity], Means]
"""From a quantity to its means by condition."""
Judge = Callable[[Read], Judgement]

THEORY: Mapping[Theory, str] = {"least": "least torque", "reward": "optimum of the trained reward"}
"""The two optima in theory, in words."""
NO_RESULTS = "no results"
IN_FIGURE = "in a figure only"
PHASE_IN_THEORY = " In theory the correlation is judged, which changes in the opposite direction."


def in_hz(freq: float) -> str:
    """A frequency [Hz] in words, "none" for nan."""
    return "none" if math.isnan(freq) else f"{freq:.3f} Hz"


@dataclass(frozen=True)
class Transitions:
    """Frequency [Hz] at which the modes of the linear stander switch; nan where they do not.

    least: in the motion of least torque. reward: in the optimum of the trained reward. sinusoid: in the sinusoid of least
    torque.
    """

    least: float = math.nan
    reward: float = math.nan
    sinusoid: float = math.nan

    def __str__(self) -> str:
        names = {"least torque": self.least, "optimum of the trained reward": self.reward}
        names["least-torque sinusoid"] = self.sinusoid
        return ", ".join(f"{in_hz(hz)} ({name})" for name, hz in names.items())


@dataclass(frozen=True)
class Verdict:
    """A claim of the paper with its outcome.

    published: the paper's numbers. finding: the result in a few words. measured: the same with numbers, means over seeds
    with 95 % bootstrap intervals. theory: the same in the linear stander. rule: how the claim was judged. comment: what
    theory says about a claim that is not reproduced in full.
    """

    key: str
    experiment: str
    claim: str
    published: str
    finding: str
    measured: str
    theory: str
    verdict: Outcome
    rule: str
    comment: str


@dataclass(frozen=True)
class Claim:
    """A claim of the paper, and the rule that judges it. note: added to the comment where it is not reproduced in full."""

    key: str
    experiment: str
    claim: str
    published: str
    rule: str
    note: str = ""

    def verdict(self, outcome: Outcome, finding: str, measured: str, theory: str, comment: str) -> Verdict:
        """The verdict; with a comment only where the claim is not reproduced in full."""
        comment = " ".join(filter(None, [comment, self.note])) if outcome in (Outcome.PARTLY, Outcome.NOT) else ""
        texts = (self.published, finding, measured, theory)
        return Verdict(self.key, self.experiment, self.claim, *texts, outcome, self.rule, comment)

    def not_measured(self, theory: str = "") -> Verdict:
        """The verdict where there are no results."""
        return self.verdict(Outcome.NOT_MEASURED, NO_RESULTS, NO_RESULTS, theory, "")


def judged(
    claim: Claim,
    results: Sequence[Result],
    by: Sequence[Variable],
    judge: Judge,
    *quantities: Quantity,
    at_all: bool = False,
    in_theory: Judge | None = None,
    theories: Sequence[Theory] = tuple(THEORY),
) -> Verdict:
    """The verdict of `judge` on `claim` from `results`, whose conditions differ in the variables `by`.

    The `quantities` are reported, `at_all` conditions or at both ends. `theories` are judged as well: by `in_theory` where
    the judge of the results does not apply to them.
    """
    if not results:
        return claim.not_measured()
    read = cache(lambda quantity: seed_means(results, by, quantity.measured))
    ours = judge(read)
    write = listing if at_all else span
    measured = [f"{quantity.name} {write(read(quantity), by, quantity.spec)}" for quantity in quantities]
    texts, outcomes = [], {}
    for theory in theories:
        judgement, values = _in_theory(theory, results, by, in_theory or judge, quantities)
        if judgement.outcome is not Outcome.NOT_MEASURED:
            outcomes[THEORY[theory]] = judgement.outcome
            texts.append(f"{THEORY[theory]}: {'; '.join([judgement.finding, *values])}")
    comment = _comment(outcomes) or ("" if claim.note else "The linear stander has no value to compare with.")
    numbers = "; ".join([ours.finding, *measured, sample(results, by)])
    return claim.verdict(ours.outcome, ours.finding, numbers, ". ".join(texts), comment)


def _in_theory(
    theory: Theory, results: Sequence[Result], by: Sequence[Variable], judge: Judge, quantities: Sequence[Quantity]
) -> tuple[Judgement, list[str]]:
    """The judgement on one theory, and its values of `quantities` in words."""
    read = cache(lambda quantity: theory_means(results, by, quantity.in_theory(theory)))
    values = [f"{quantity.name} {span(read(quantity), by, quantity.spec)}" for quantity in quantities if read(quantity)]
    return judge(read), values


def _comment(outcomes: Mapping[str, Outcome]) -> str:
    """The theory's explanation of a claim that is not reproduced in full; empty without a value in theory."""
    shows = [name for name, outcome in outcomes.items() if outcome is Outcome.REPRODUCED]
    lacks = [f"{name}: {outcome}" for name, outcome in outcomes.items() if outcome is not Outcome.REPRODUCED]
    if shows and lacks:
        return f"In theory one optimum shows it ({shows[0]}), the other does not in full ({lacks[0]})."
    if shows:
        return f"Theory shows it ({', '.join(shows)}). Why the trained policies do not, or only in part, was not tested."
    return f"Theory does not show it in full either ({', '.join(lacks)})." if lacks else ""


def by_seed(values: Mapping[int, float]) -> str:
    """Frequencies [Hz] of each seed, "none" for a seed without one, and their mean with its interval."""
    text = ", ".join(f"seed {seed} {'none' if math.isnan(hz) else f'{hz:.3f}'}" for seed, hz in values.items())
    return f"{text}; mean {mean_of(list(values.values())).text('.3f')} Hz"


def modes_in_words(modes: Mapping[Condition, str], by: Sequence[Variable]) -> str:
    """Modes ("in" or "anti") in words: "in-phase at 0.15 Hz to 0.6 Hz, anti-phase at 0.75 Hz to 1.5 Hz"."""
    parts = []
    for mode, group in groupby(modes.items(), key=lambda item: item[1]):
        names = [label(by, condition) for condition, _ in group]
        parts.append(f"{mode}-phase at {names[0]}" + (f" to {names[-1]}" if len(names) > 1 else ""))
    return ", ".join(parts)


def values_in_words(values: Mapping[Condition, float], by: Sequence[Variable], spec: str) -> str:
    """Published values in words: "1632 at gamma 0, 499 at gamma 5"."""
    return ", ".join(f"{value:{spec}} at {label(by, condition)}" for condition, value in values.items())
