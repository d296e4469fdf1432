"""A column of results against a condition, over several seeds, in the axes it is given.

Rows are flat: a row a seed and condition, `valid` false where the person fell. A fall is marked and never averaged in.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from posture.analysis.results import Row
from posture.analysis.statistics import bootstrap_mean
from posture.analysis.trajectory import Array
from posture.drawing.style import FALL_COLOUR, MODE_COLOUR, STYLE

# Larger than in the figures of one evaluation: a page shows these 360 pixels wide on a phone.
REPORT_STYLE = {**STYLE, "font.size": 11, "axes.titlesize": 11, "legend.fontsize": 10}
WIDTH = 6.5  # [inch]

SEED_LABEL, BAND_LABEL, FALL_LABEL = "a seed", "95 % interval of the mean", "n/N seeds fell"
PAPER_LABEL = "paper"  # what the labels of published values begin with
LEAST_LABEL, REWARD_LABEL = "torque-optimal", "optimum of the reward"
LEAST: Mapping[str, Any] = {"ls": ":", "lw": 1.8, "zorder": 2.5}
REWARD: Mapping[str, Any] = {"ls": "-.", "lw": 1.3, "zorder": 2.5}


@contextmanager
def report_figure(height: float, path: Path | None = None) -> Iterator[Figure]:
    """A figure `height` inches high in the report's style, written to `path` at the end where there is one."""
    with matplotlib.rc_context(REPORT_STYLE):
        fig = Figure(figsize=(WIDTH, height), layout="constrained")
        FigureCanvasAgg(fig)
        yield fig
        if path is not None:
            fig.savefig(path)


def by_condition(rows: Sequence[Row], x: str, column: str) -> tuple[Array, list[Array]]:
    """Distinct values of column `x` of all rows, rising, shape (C,), and of each condition the finite values of `column`.

    Falls have no values, and neither has a row without that column.
    """
    found: dict[float, list[float]] = {float(at): [] for at in sorted({row[x] for row in rows})}
    for row in rows:
        value = float(row.get(column, math.nan))
        if row["valid"] and math.isfinite(value):
            found[float(row[x])].append(value)
    return np.array(list(found)), [np.array(values, dtype=np.float64) for values in found.values()]


def draw_seeds(
    ax: Axes, rows: Sequence[Row], x: str, column: str, *, factor: float = 1.0, label: str = "", **style: Any
) -> None:
    """The mean over seeds of `factor` x `column` as a line, its bootstrap interval as a band, each seed as an open marker.

    The line breaks at a condition without a value. The band is where there are two seeds or more. `style` is that of the
    line; `color` and `marker` are the seeds', too.
    """
    at, values = by_condition(rows, x, column)
    if not any(map(len, values)):
        return
    style = {"color": "black", "lw": 1.5, **style}
    marker = style.pop("marker", "o")
    mean, low, high = factor * np.array([bootstrap_mean(found) for found in values]).T
    ax.plot(at, mean, label=label, **style)
    if np.isfinite(low).any():
        ax.fill_between(at, low, high, color=style["color"], alpha=0.18, lw=0, label=BAND_LABEL)
    ax.plot(
        np.repeat(at, [len(found) for found in values]),
        factor * np.concatenate(values),
        marker,
        ms=4.5,
        mfc="none",
        mew=0.8,
        color=style["color"],
        label=SEED_LABEL,
    )


def draw_theory(
    ax: Axes, rows: Sequence[Row], x: str, column: str, *, factor: float = 1.0, absolute: bool = False, **style: Any
) -> None:
    """A column of the theory beside the results, the same for all seeds, as a line; nothing where the rows have none."""
    known = [(float(row[x]), float(row.get(column, math.nan))) for row in rows]
    found = dict(pair for pair in sorted(known) if math.isfinite(pair[1]))
    if found:
        at, values = np.array(list(found.items())).T
        style = {"color": "black", "label": LEAST_LABEL, **LEAST, **style}
        ax.plot(at, factor * (np.abs(values) if absolute else values), **style)


def mark_falls(ax: Axes, rows: Sequence[Row], x: str, *, level: int = 0, colour: str = FALL_COLOUR) -> None:
    """A line where a seed fell (or its simulation did not hold), a cross above it, and "fallen/seeds" beside that.

    The text stands `level` lines further up, where there are several groups of rows in one panel.
    """
    for at, group in groupby(sorted(rows, key=lambda row: float(row[x])), key=lambda row: float(row[x])):
        stood = [bool(row["valid"]) for row in group]
        if all(stood):
            continue
        ax.axvline(at, color=colour, ls=":", lw=0.8, zorder=0.5, label=FALL_LABEL)
        text, offset = f"\N{BALLOT X} {stood.count(False)}/{len(stood)}", (0, 2 + 12 * level)
        place = {"xycoords": ax.get_xaxis_transform(), "xytext": offset, "textcoords": "offset points", "ha": "center"}
        ax.annotate(text, (at, 1), color=colour, fontsize=9, va="bottom", **place)


def shade_modes(ax: Axes, at: Sequence[float], modes: Sequence[str]) -> None:
    """Shade where the paper shows each mode ("in", "anti") along rising `at`, and hatch the brackets of its switches."""
    runs: list[tuple[str, float, float]] = []
    for mode, group in groupby(sorted(zip(at, modes, strict=True)), key=lambda pair: pair[1]):
        values = [value for value, _ in group]
        runs.append((f"{mode}-phase", values[0], values[-1]))
    for name, low, high in runs:
        ax.axvspan(low, high, color=MODE_COLOUR[name], alpha=0.1, lw=0, label=f"paper: {name}", zorder=0)
    for (_, _, low), (_, high, _) in pairwise(runs):
        span = {"facecolor": "none", "edgecolor": "#BBBBBB", "hatch": "///", "lw": 0, "zorder": 0}
        ax.axvspan(low, high, label="paper: switch between", **span)


def published(paper: Mapping[str, Any], table: str, *columns: str) -> list[Any] | None:
    """Columns of a table of conf/paper.yaml; None where one is missing."""
    found = paper.get(table, {})
    return [found[column] for column in columns] if set(columns) <= set(found) else None


def correlation_axis(ax: Axes) -> None:
    """The hip-ankle correlation along y: -1 .. 1, a line at 0."""
    ax.axhline(0, color="black", lw=0.8)
    ax.set(ylim=(-1.1, 1.1), yticks=(-1, -0.5, 0, 0.5, 1), ylabel="hip-ankle correlation")


def phase_axis(ax: Axes) -> None:
    """The relative phase [deg] along y: 0 .. 180."""
    ax.set(ylim=(-9, 189), yticks=range(0, 181, 45), ylabel="relative phase [deg]")


def legend(fig: Figure, axes: Sequence[Axes], columns: int) -> None:
    """One legend above all panels, a label once: first what each panel shows, then in neutral colours what holds for every
    line, then the paper."""
    entries: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    shared = {
        BAND_LABEL: Patch(color="black", alpha=0.18, lw=0),
        SEED_LABEL: Line2D([], [], ls="none", marker="o", ms=4.5, mfc="none", mew=0.8, color="black"),
        LEAST_LABEL: Line2D([], [], color="black", **LEAST),
        REWARD_LABEL: Line2D([], [], color="black", **REWARD),
        FALL_LABEL: Line2D([], [], ls="none", marker="$\N{BALLOT X}$", ms=8, mew=0.3, color=FALL_COLOUR),
    }
    own = [label for label in entries if label not in shared and not label.startswith(PAPER_LABEL)]
    paper = [label for label in entries if label.startswith(PAPER_LABEL)]
    order = [*own, *(label for label in shared if label in entries), *paper]
    if order:
        handles = [shared.get(label, entries[label]) for label in order]
        fig.legend(handles, order, loc="outside upper center", ncols=columns)
