"""A verdict on a claim of the paper, and how it comes about: one rule for our results and for theory's values alike."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from typing import Any

from posture.analysis.results import Row
from posture.reproduce.claims.rules import Judgement, Means, Outcome
from posture.reproduce.claims.seed_means import Condition, label, listing, mean_of, sample, seed_means, span, theory_means

Results = Mapping[str, Sequence[Row]]
"""By experiment, a row a seed and condition."""
Paper = Mapping[str, Any]
"""The content of conf/paper.yaml."""
Transitions = Mapping[str, float]
"""By theory (least, reward, sinusoid), the frequency at which its modes switch [Hz]; nan where they do not."""
Read = Callable[[str], Means]
"""From the name of a column to its means by condition."""
Judge = Callable[[Read], Judgement]
Shown = tuple[str, str, str]
"""A column that is reported, the format of its numbers, and what it is called."""

THEORY = {"least": "least torque", "reward": "optimum of the trained reward"}
"""Prefix of theory's columns, and what they are."""
NO_RESULTS = "no results"
IN_FIGURE = "in a figure only"
PARTS_RULE = " The whole is reproduced where both parts are, partly where one is or both are partly."
PHASE_IN_THEORY = " Theory is judged by its correlation, which goes the other way."


@dataclass(frozen=True)
class Verdict:
    """A claim and what became of it.

    published: the paper's numbers. finding: ours in a few words. measured: that and the numbers, means over seeds with 95 %
    bootstrap intervals where there are two seeds or more. theory: what the linear stander says. rule: how it was judged.
    comment: where it is not reproduced in full, what theory has to say about that.
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
    """What is claimed, and by which rule it will be judged. note: what to know where it is not reproduced in full."""

    key: str
    experiment: str
    claim: str
    published: str
    rule: str
    note: str = ""

    def verdict(self, outcome: Outcome, finding: str, measured: str, theory: str, comment: str) -> Verdict:
        """The verdict; the comment only where there is something to explain."""
        comment = " ".join(filter(None, [comment, self.note])) if outcome in ("partly", "not") else ""
        said = (self.published, finding, measured, theory)
        return Verdict(self.key, self.experiment, self.claim, *said, outcome, self.rule, comment)


def judged(
    claim: Claim,
    rows: Sequence[Row],
    by: Sequence[str],
    judge: Judge,
    *shown: Shown,
    whole: bool = False,
    in_theory: Judge | None = None,
    sources: Sequence[str] = tuple(THEORY),
) -> Verdict:
    """The verdict on `claim` by `judge`, from `rows` with conditions told apart by the columns `by`.

    The columns `shown` are reported: at every condition if `whole`, else at both ends. `sources` are the theories that are
    asked, by `in_theory` where the question must be put differently to them.
    """
    if not rows:
        return claim.verdict("not measured", NO_RESULTS, NO_RESULTS, "", "")
    read = _reader(seed_means, rows, by, "")
    ours = judge(read)
    numbers = [_numbers(read(column), by, spec, name, whole) for column, spec, name in shown]
    said, outcomes = [], {}
    for source in sources:
        read = _reader(theory_means, rows, by, f"{source}_")
        found = (in_theory or judge)(read)
        if found.outcome != "not measured":
            outcomes[THEORY[source]] = found.outcome
            values = [_numbers(read(column), by, spec, name, False) for column, spec, name in shown if read(column)]
            said.append(f"{THEORY[source]}: {'; '.join([found.finding, *values])}")
    measured = "; ".join([ours.finding, *numbers, sample(rows, by)])
    comment = _comment(outcomes) or ("" if claim.note else "The linear stander has no value to compare with.")
    return claim.verdict(ours.outcome, ours.finding, measured, ". ".join(said), comment)


def _reader(means: Callable[..., Means], rows: Sequence[Row], by: Sequence[str], prefix: str) -> Read:
    """Reads columns that begin with `prefix`, each once: intervals take their time."""
    return cache(lambda column: means(rows, by, f"{prefix}{column}"))


def _numbers(means: Means, by: Sequence[str], spec: str, name: str, whole: bool) -> str:
    return f"{name} {listing(means, by, spec) if whole else span(means, by, spec)}"


def _comment(outcomes: Mapping[str, Outcome]) -> str:
    """What theory says of a claim that our results do not bear out in full; nothing without its values."""
    shows = [name for name, outcome in outcomes.items() if outcome == "reproduced"]
    lacks = [f"{name}: {outcome}" for name, outcome in outcomes.items() if outcome != "reproduced"]
    if shows and lacks:
        return f"Theory shows it for one optimum ({shows[0]}), not in full for the other ({lacks[0]})."
    if shows:
        return f"Theory shows it ({', '.join(shows)}); why the trained policies do not, or not wholly, was not tested."
    if lacks:
        return f"Theory does not show it in full either ({', '.join(lacks)})."
    return ""


def predicted(transitions: Transitions) -> str:
    """Theory's switch frequencies in words."""
    names = THEORY | {"sinusoid": "least-torque sinusoid"}
    told = [
        f"{'none' if math.isnan(transitions[name]) else f'{transitions[name]:.3f} Hz'} ({what})"
        for name, what in names.items()
        if name in transitions
    ]
    return ", ".join(told)


def by_seed(values: Mapping[float, float]) -> str:
    """Frequencies [Hz] by seed and their mean with its interval; "none" for a seed without one."""
    text = ", ".join(f"seed {seed:g} {'none' if math.isnan(hz) else f'{hz:.3f}'}" for seed, hz in values.items())
    return f"{text}; mean {mean_of(list(values.values())).text('.3f')} Hz"


def modes_said(modes: Mapping[Condition, str], by: Sequence[str]) -> str:
    """Modes ("in" or "anti") in words: "in-phase at 0.15 Hz to 0.6 Hz, anti-phase at 0.75 Hz to 1.5 Hz"."""
    parts = []
    for mode, group in groupby(modes.items(), key=lambda item: item[1]):
        names = [label(by, condition) for condition, _ in group]
        parts.append(f"{mode}-phase at {names[0]}" + (f" to {names[-1]}" if len(names) > 1 else ""))
    return ", ".join(parts)


def values_said(values: Mapping[Condition, float], by: Sequence[str], spec: str) -> str:
    """Published values by condition in words: "1632 at gamma 0, 499 at gamma 5"."""
    return ", ".join(f"{value:{spec}} at {label(by, condition)}" for condition, value in values.items())
