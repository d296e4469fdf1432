"""Means over seeds by condition, and how they are written: results in, numbers and phrases out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from posture.analysis.results import Result
from posture.analysis.statistics import bootstrap_mean
from posture.reproduce.quantities import Getter, Variable

Condition = tuple[float, ...]
"""A value of each variable that distinguishes the conditions of an experiment."""


class SeedMean(NamedTuple):
    """A mean over seeds with its 95 % bootstrap interval, in the unit of its values; nan where there are too few.

    n: number of values. trials: number of trials, those without a value (a fall, an undefined index) included.
    """

    mean: float
    low: float
    high: float
    n: int
    trials: int

    @property
    def is_known(self) -> bool:
        """Whether at least half of the trials have a value, so that it is not the mean of a few survivors."""
        return self.n > 0 and 2 * self.n >= self.trials

    def text(self, spec: str) -> str:
        """As "0.59 (0.50 to 0.71)", numbers in the format `spec`; without an interval if it has none; "-" for no value."""
        if not self.n:
            return "-"
        mean = f"{self.mean:{spec}}"
        return mean if math.isnan(self.low) else f"{mean} ({self.low:{spec}} to {self.high:{spec}})"


Means = Mapping[Condition, SeedMean]


def mean_of(values: Sequence[float]) -> SeedMean:
    """The mean of one value for each seed, nan for a seed without one."""
    known = [value for value in values if math.isfinite(value)]
    return SeedMean(*bootstrap_mean(known), n=len(known), trials=len(values))


def seed_means(results: Sequence[Result], by: Sequence[Variable], value: Getter) -> dict[Condition, SeedMean]:
    """Mean of `value` over the seeds of each condition, in rising order. Trials that are not valid have no value."""
    return {
        condition: mean_of([value(result) if result.valid else math.nan for result in group])
        for condition, group in group_by(results, by).items()
    }


def theory_means(results: Sequence[Result], by: Sequence[Variable], value: Getter | None) -> dict[Condition, SeedMean]:
    """The same for a value in theory, which all trials of a condition share, valid or not; only where it is finite."""
    means = {}
    for condition, group in group_by(results, by).items() if value else ():
        known = [number for result in group if value and math.isfinite(number := value(result))]
        if known:
            means[condition] = SeedMean(float(np.median(known)), math.nan, math.nan, n=len(known), trials=len(known))
    return means


def where(results: Sequence[Result], variable: Variable, values: Sequence[float]) -> list[Result]:
    """The results at one of the `values` of a variable."""
    wanted = {_rounded(value) for value in values}
    return [result for result in results if _rounded(variable.value(result)) in wanted]


def conditions(values: Sequence[float]) -> list[Condition]:
    """The conditions of a sweep of one variable, as `seed_means` has them."""
    return [(_rounded(value),) for value in values]


def steps(low: float, high: float, step: float) -> list[float]:
    """`low`, `low` + `step`, ... `high`, as `conditions` has them."""
    return [_rounded(low + i * step) for i in range(round((high - low) / step) + 1)]


def group_by(results: Sequence[Result], by: Sequence[Variable]) -> dict[Condition, list[Result]]:
    """Results by condition, in rising order."""
    groups: dict[Condition, list[Result]] = {}
    for result in results:
        groups.setdefault(tuple(_rounded(variable.value(result)) for variable in by), []).append(result)
    return dict(sorted(groups.items()))


def label(by: Sequence[Variable], condition: Condition) -> str:
    """A condition in words: "0.15 Hz", "25 Nm/rad and 0.5 Hz"."""
    return " and ".join(variable.text.format(value) for variable, value in zip(by, condition, strict=True))


def labels(by: Sequence[Variable], some: Sequence[Condition]) -> str:
    """Several conditions in words."""
    return ", ".join(label(by, condition) for condition in some)


def listing(means: Means, by: Sequence[Variable], spec: str) -> str:
    """Every mean with its interval: "0.59 (0.50 to 0.71) at 0.15 Hz, 0.81 at 0.3 Hz"."""
    return ", ".join(f"{mean.text(spec)} at {label(by, condition)}" for condition, mean in means.items())


def span(means: Means, by: Sequence[Variable], spec: str) -> str:
    """The first and the last mean with their intervals, and the lowest and highest if they lie between."""
    known = {condition: mean for condition, mean in means.items() if mean.n}
    if not known:
        return "no value"
    first, last = next(iter(known)), next(reversed(known))
    text = listing({condition: known[condition] for condition in (first, last)}, by, spec)
    for name, pick in (("lowest", min), ("highest", max)):
        condition = pick(known, key=lambda condition: known[condition].mean)
        if known[condition].mean not in (known[first].mean, known[last].mean):
            text += f", {name} {listing({condition: known[condition]}, by, spec)}"
    return text


def sample(results: Sequence[Result], by: Sequence[Variable]) -> str:
    """Number of seeds, and which trials fell or failed: "3 seeds; 1 of 30 trials fell: 1.5 Hz (seed 3)"."""
    text = plural(len({result.origin.seed for result in results}), "seed")
    counts = {len(group) for group in group_by(results, by).values()}
    if len(counts) > 1:
        text += f" ({min(counts)} to {max(counts)} for a condition)"
    fell = [result for result in results if not result.valid and result.fell]
    failed = [result for result in results if not result.valid and not result.fell]
    text += f"; {len(fell)} of {len(results)} trials fell: {_named(fell, by)}" if fell else "; no falls"
    if failed:
        text += f"; {len(failed)} of {len(results)} trials gave no finite result: {_named(failed, by)}"
    return text


def plural(count: int, noun: str) -> str:
    """As "1 seed", "3 seeds"."""
    return f"{count} {noun}{'s' * (count != 1)}"


def _named(results: Sequence[Result], by: Sequence[Variable]) -> str:
    parts = []
    for condition, group in group_by(results, by).items():
        seeds = sorted({result.origin.seed for result in group})
        names = f"seed{'s' * (len(seeds) != 1)} {', '.join(map(str, seeds))}"
        parts.append(f"{label(by, condition)} ({names})" if condition else names)
    return ", ".join(parts)


def _rounded(value: float) -> float:
    """So that 0.1 + 0.2 and 0.3 are the same condition."""
    return round(float(value), 6)
