"""A quantity against a condition, from the results of several seeds, drawn into given axes; falls are marked."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from posture.analysis.results import Result
from posture.analysis.statistics import bootstrap_mean
from posture.analysis.trajectory import Array
from posture.drawing.style import FALL_COLOUR, MODE_COLOUR, styled
from posture.reproduce.claims.seed_means import group_by
from posture.reproduce.quantities import Getter, Variable

# Larger than in the figures of one evaluation: on a phone they are 360 pixels wide.
REPORT_STYLE = {"font.size": 11, "axes.titlesize": 11, "legend.fontsize": 10}
WIDTH = 6.5  # [inch]

MEAN_LABEL, SEED_LABEL, BAND_LABEL, FALL_LABEL = "mean of the seeds", "a seed", "95 % interval of the mean", "n/N seeds fell"
PAPER_LABEL = "paper"  # labels of published values begin with it
LEAST_LABEL, REWARD_LABEL = "torque-optimal", "optimum of the reward"
LEAST: Mapping[str, Any] = {"ls": ":", "lw": 1.8, "zorder": 2.5}
REWARD: Mapping[str, Any] = {"ls": "-.", "lw": 1.3, "zorder": 2.5}


@contextmanager
def report_figure(height: float, path: Path | None = None) -> Iterator[Figure]:
    """A figure `height` inches high in the report's style, written to `path` at the end if there is one."""
    with styled(**REPORT_STYLE):
        fig = Figure(figsize=(WIDTH, height), layout="constrained")
        FigureCanvasAgg(fig)
        yield fig
        if path is not None:
            fig.savefig(path)


def values_by_condition(results: Sequence[Result], x: Variable, value: Getter) -> tuple[Array, list[Array]]:
    """Rising values of `x`, shape (C,), and for each the finite values of a quantity over the seeds that did not fall."""
    groups = group_by(results, (x,))
    values = [
        np.array([value(r) for r in group if r.valid and math.isfinite(value(r))], np.float64) for group in groups.values()
    ]
    return np.array([condition[0] for condition in groups]), values


def draw_seeds(
    ax: Axes,
    results: Sequence[Result],
    x: Variable,
    value: Getter,
    *,
    factor: float = 1.0,
    label: str = MEAN_LABEL,
    **style: Any,
) -> None:
    """Draw `factor` times a quantity: the mean over seeds as a line, its bootstrap interval as a band, seeds as markers.

    The line is interrupted at a condition without a value; the band needs two seeds. `style` is that of the line; the seeds
    share its `color` and `marker`.
    """
    at, values = values_by_condition(results, x, value)
    if not any(map(len, values)):
        return
    style = {"color": "black", "lw": 1.5, **style}
    marker = style.pop("marker", "o")
    mean, low, high = factor * np.array([bootstrap_mean(known) for known in values]).T
    ax.plot(at, mean, label=label, **style)
    if np.isfinite(low).any():
        ax.fill_between(at, low, high, color=style["color"], alpha=0.18, lw=0, label=BAND_LABEL)
    seeds_at = np.repeat(at, [len(known) for known in values])
    open_marker = {"ms": 4.5, "mfc": "none", "mew": 0.8, "color": style["color"]}
    ax.plot(seeds_at, factor * np.concatenate(values), marker, label=SEED_LABEL, **open_marker)


def draw_theory(
    ax: Axes, results: Sequence[Result], x: Variable, value: Getter | None, *, factor: float = 1.0, **style: Any
) -> None:
    """Draw a quantity in theory, the same for all seeds, as a line; nothing if it has no value."""
    pairs = sorted((x.value(result), value(result)) for result in results) if value else []
    known = {at: number for at, number in pairs if math.isfinite(number)}
    if known:
        ax.plot(
            list(known),
            factor * np.array(list(known.values())),
            **{"color": "black", "label": LEAST_LABEL, **LEAST, **style},
        )


def mark_falls(ax: Axes, results: Sequence[Result], x: Variable, *, level: int = 0, colour: str = FALL_COLOUR) -> None:
    """Mark a condition in which a seed has no valid result with a line, and above it a cross and "fallen/seeds".

    The text is placed `level` lines higher, for several groups of results in one panel.
    """
    for (at,), group in group_by(results, (x,)).items():
        invalid = sum(not result.valid for result in group)
        if not invalid:
            continue
        ax.axvline(at, color=colour, ls=":", lw=0.8, zorder=0.5, label=FALL_LABEL)
        text, offset = f"\N{BALLOT X} {invalid}/{len(group)}", (0, 2 + 12 * level)
        place = {"xycoords": ax.get_xaxis_transform(), "xytext": offset, "textcoords": "offset points", "ha": "center"}
        ax.annotate(text, (at, 1), color=colour, fontsize=9, va="bottom", **place)


def shade_modes(ax: Axes, at: Sequence[float], modes: Sequence[str]) -> None:
    """Shade where the paper reports each mode ("in", "anti") along `at`, and hatch the gaps in which it switches."""
    runs: list[tuple[str, float, float]] = []
    for mode, group in groupby(sorted(zip(at, modes, strict=True)), key=lambda pair: pair[1]):
        values = [value for value, _ in group]
        runs.append((f"{mode}-phase", values[0], values[-1]))
    for name, low, high in runs:
        ax.axvspan(low, high, color=MODE_COLOUR[name], alpha=0.1, lw=0, label=f"paper: {name}", zorder=0)
    for (_, _, low), (_, high, _) in pairwise(runs):
        span = {"facecolor": "none", "edgecolor": "#BBBBBB", "hatch": "///", "lw": 0, "zorder": 0}
        ax.axvspan(low, high, label="paper: switch between", **span)


def correlation_axis(ax: Axes) -> None:
    """The hip-ankle correlation along y: -1 .. 1, a line at 0."""
    ax.axhline(0, color="black", lw=0.8)
    ax.set(ylim=(-1.1, 1.1), yticks=(-1, -0.5, 0, 0.5, 1), ylabel="hip-ankle correlation")


def phase_axis(ax: Axes) -> None:
    """The relative phase [deg] along y: 0 .. 180."""
    ax.set(ylim=(-9, 189), yticks=range(0, 181, 45), ylabel="relative phase [deg]")


def legend(fig: Figure, axes: Sequence[Axes], columns: int) -> None:
    """One legend above all panels, with each label once: those of the panels, those common to all lines, the paper's."""
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
