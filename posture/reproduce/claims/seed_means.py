"""Means over seeds by condition, and how to say them: rows in, numbers and short phrases out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from posture.analysis.results import Row
from posture.analysis.statistics import bootstrap_mean

Condition = tuple[Any, ...]
"""The values of the columns that tell one condition from another."""

_LABELS = {
    "freq_hz": "{:g} Hz",
    "energy_weight": "gamma {:g}",
    "hip_k_nm_per_rad": "{:g} Nm/rad",
    "load_kg": "{:g} kg",
    "amplitude_m": "{:g} m",
}


class SeedMean(NamedTuple):
    """A mean over seeds with its 95 % bootstrap interval, in the column's unit; nan where there are too few values.

    n: values that were averaged. trials: all rows of the condition, falls and undefined indices among them.
    """

    mean: float
    low: float
    high: float
    n: int
    trials: int

    def text(self, spec: str) -> str:
        """As "0.59 (0.50 to 0.71)", numbers by `spec`; without interval where there is none, a dash without a value."""
        if not self.n:
            return "-"
        mean = f"{self.mean:{spec}}"
        return mean if math.isnan(self.low) else f"{mean} ({self.low:{spec}} to {self.high:{spec}})"


def seed_means(rows: Sequence[Row], by: Sequence[str], column: str) -> dict[Condition, SeedMean]:
    """Mean of `column` over the seeds of each condition, in the rising order of the conditions.

    A condition is the tuple of the values of columns `by`. A row that is not valid (a fall), or has no such value, is left
    out of the mean but counts among the trials.
    """
    means = {}
    for condition, group in _grouped(rows, by).items():
        means[condition] = mean_of([_value(row, column) if row["valid"] else math.nan for row in group])
    return means


def mean_of(values: Sequence[float]) -> SeedMean:
    """The mean of a value of each seed, nan where it has none."""
    found = [value for value in values if math.isfinite(value)]
    return SeedMean(*bootstrap_mean(found), n=len(found), trials=len(values))


def theory_means(rows: Sequence[Row], by: Sequence[str], column: str) -> dict[Condition, SeedMean]:
    """The same of a column of theory, which every row of a condition shares, fallen or not; only where it has a value."""
    means = {}
    for condition, group in _grouped(rows, by).items():
        values = [value for row in group if math.isfinite(value := _value(row, column))]
        if values:
            means[condition] = SeedMean(float(np.median(values)), math.nan, math.nan, n=len(values), trials=len(values))
    return means


def where(rows: Sequence[Row], column: str, values: Sequence[float | str]) -> list[Row]:
    """The rows whose `column` is one of `values`."""
    wanted = {_key(value) for value in values}
    return [row for row in rows if _key(row[column]) in wanted]


def conditions(values: Sequence[float]) -> list[Condition]:
    """The conditions of a sweep of one column, as the keys of `seed_means` have them."""
    return [(_key(value),) for value in values]


def label(by: Sequence[str], condition: Condition) -> str:
    """A condition in words: "0.15 Hz", "25 Nm/rad and 0.5 Hz"."""
    return " and ".join(_LABELS.get(name, "{}").format(value) for name, value in zip(by, condition, strict=True))


def listing(means: Mapping[Condition, SeedMean], by: Sequence[str], spec: str) -> str:
    """Every mean with its interval: "0.59 (0.50 to 0.71) at 0.15 Hz, 0.81 at 0.3 Hz"."""
    return ", ".join(f"{mean.text(spec)} at {label(by, condition)}" for condition, mean in means.items())


def span(means: Mapping[Condition, SeedMean], by: Sequence[str], spec: str) -> str:
    """The first and the last mean with their intervals, and the least or largest where it lies between them."""
    known = {condition: mean for condition, mean in means.items() if mean.n}
    if not known:
        return "no value"
    least, largest = (pick(known, key=lambda condition: known[condition].mean) for pick in (min, max))
    first, *_, last = known if len(known) > 1 else [*known, *known]
    text = listing({condition: known[condition] for condition in (first, last)}, by, spec)
    for name, condition in (("least", least), ("largest", largest)):
        if known[condition].mean not in (known[first].mean, known[last].mean):
            text += f", {name} {listing({condition: known[condition]}, by, spec)}"
    return text


def sample(rows: Sequence[Row], by: Sequence[str]) -> str:
    """How many seeds, and which trials fell or failed: "3 seeds; 1 of 30 trials fell: 1.5 Hz (seed 3)"."""
    seeds = {row["seed"] for row in rows}
    text = f"{len(seeds)} seed{'s' if len(seeds) != 1 else ''}"
    counts = {len(group) for group in _grouped(rows, by).values()}
    if len(counts) > 1:
        text += f" ({min(counts)} to {max(counts)} a condition)"
    fallen = [row for row in rows if not row["valid"] and row["fell"]]
    failed = [row for row in rows if not row["valid"] and not row["fell"]]
    text += f"; {_named(fallen, by, 'fell', len(rows))}" if fallen else "; no falls"
    return text + (f"; {_named(failed, by, 'gave no finite result', len(rows))}" if failed else "")


def _named(rows: Sequence[Row], by: Sequence[str], fate: str, trials: int) -> str:
    where = []
    for condition, group in _grouped(rows, by).items():
        seeds = sorted({row["seed"] for row in group})
        names = f"seed{'s' if len(seeds) != 1 else ''} {', '.join(f'{seed:g}' for seed in seeds)}"
        where.append(f"{label(by, condition)} ({names})" if condition else names)
    return f"{len(rows)} of {trials} trials {fate}: {', '.join(where)}"


def _grouped(rows: Sequence[Row], by: Sequence[str]) -> dict[Condition, list[Row]]:
    groups: dict[Condition, list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(_key(row[name]) for name in by), []).append(row)
    return dict(sorted(groups.items()))


def _key(value: Any) -> Any:
    """0.1 + 0.2 and 0.3 are the same condition."""
    return round(float(value), 6) if isinstance(value, int | float) else value


def _value(row: Row, column: str) -> float:
    return float(row.get(column, math.nan))
