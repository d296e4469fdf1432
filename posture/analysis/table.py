"""Tables of results, one line for each row: for the terminal and for Markdown. The table of an evaluation.

Where a world's frequency is one of paper Table 3, the published values are shown beside ours; pass None for `published`
where the other conditions are not those of that table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import tabulate

from posture.analysis.results import NO_LEAST, Result
from posture.config.published import Table3

tabulate.MIN_PADDING = 0  # no more than the two spaces between columns, so that a table fits a terminal

T = TypeVar("T")


@dataclass(frozen=True)
class Column(Generic[T]):
    """How one value of a row is shown: heading with its unit, factor into that unit, format; a dash for nan."""

    heading: str
    get: Callable[[T], float | str]
    format: str = ""
    factor: float = 1.0

    def cell(self, row: T) -> str:
        value = self.get(row)
        if isinstance(value, str):
            return value
        return "-" if math.isnan(value) else format(value * self.factor, self.format)


def text_table(rows: Iterable[T], columns: Sequence[Column[T]]) -> str:
    """Fixed-width table for the terminal: headings over their units, a rule, a line for each row; right-aligned."""
    return _layout(rows, columns, "simple")


def markdown_table(rows: Iterable[T], columns: Sequence[Column[T]]) -> str:
    """The same table in Markdown."""
    return _layout(rows, columns, "pipe")


def _layout(rows: Iterable[T], columns: Sequence[Column[T]], layout: str) -> str:
    separator = "\n" if layout == "simple" else " "
    headings = [separator.join(column.heading.rsplit(" ", 1)) for column in columns]
    cells = [[column.cell(row) for column in columns] for row in rows]
    return tabulate.tabulate(cells, headings, layout, stralign="right", disable_numparse=True)


def evaluation_columns(rows: Sequence[Result], published: Table3 | None) -> list[Column[Result]]:
    """The columns of an evaluation's table.

    Stiffness and load are shown where the rows differ in them, and values of the paper where it has one of the frequencies.
    Where the rows have the motion of least cost, its ratio and correlation are shown with the shares of time beyond the
    tolerance and with a foot not flat, since the least cost is a bound only where both are zero.
    """
    beside = published is not None and any(_index(published, row.freq_hz) is not None for row in rows)
    columns: list[Column[Result]] = [Column("f [Hz]", lambda row: "ramp" if math.isnan(row.freq_hz) else row.freq_hz, "g")]
    columns += [column for column in _CONDITIONS if len({column.get(row) for row in rows}) > 1]
    for column, value in _PUBLISHED:
        columns.append(column)
        if published is not None and beside:
            columns.append(Column("paper", _paper_value(published, value), column.format))
    return columns + _MEASURED + (_THEORY if any(row.least is not NO_LEAST for row in rows) else [])


def _index(published: Table3, freq: float) -> int | None:
    """Place of `freq` [Hz] in the table; None if it is not in it."""
    return next((i for i, f in enumerate(published.freq_hz) if math.isclose(f, freq, rel_tol=1e-6)), None)


def _paper_value(published: Table3, value: Callable[[Table3, int], float | str]) -> Callable[[Result], float | str]:
    def get(row: Result) -> float | str:
        i = _index(published, row.freq_hz)
        return math.nan if i is None else value(published, i)

    return get


_CONDITIONS: list[Column[Result]] = [
    Column("hip k [Nm/rad]", lambda row: row.hip_k_nm_per_rad, "g"),
    Column("ankle k [Nm/rad]", lambda row: row.ankle_k_nm_per_rad, "g"),
    Column("load [kg]", lambda row: row.load_kg, "g"),
]
# With the values of the same quantity in the paper.
_PUBLISHED: list[tuple[Column[Result], Callable[[Table3, int], float | str]]] = [
    (Column("mode", lambda row: row.outcome), lambda paper, i: f"{paper.mode[i]}-phase"),
    (Column("target-head r", lambda row: row.target_head_r, ".4f"), lambda paper, i: paper.target_head_r[i]),
    (Column("amplitude [m]", lambda row: row.head_amplitude_m, ".4f"), lambda paper, i: paper.head_amplitude_m[i]),
    (Column("speed [m/s]", lambda row: row.head_speed_mps, ".4f"), lambda paper, i: paper.head_speed_mps[i]),
]
_MEASURED: list[Column[Result]] = [
    Column("hip-ankle r", lambda row: row.hip_ankle_r, ".3f"),
    Column("phase [deg]", lambda row: row.relative_phase_deg, ".0f"),
    Column("energy [J]", lambda row: row.energy_j, ".0f"),
    Column("cost", lambda row: row.cost, ".4f"),
]
_THEORY: list[Column[Result]] = [
    Column("cost/least", lambda row: row.cost_ratio, ".2f"),
    Column("least's r", lambda row: row.least.hip_ankle_r, ".3f"),
    Column("beyond tolerance", lambda row: row.beyond_tolerance_share, ".3f"),
    Column("not flat", lambda row: row.foot_not_flat_share, ".3f"),
]
