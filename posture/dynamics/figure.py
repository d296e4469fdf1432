"""The figure: staircases up and down, the variability of the relative phase, and its recovery from pushes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from posture.drawing.style import BLUE, RED, styled
from posture.dynamics.findings import switch_of_seeds
from posture.dynamics.measures import FluctuationRow, RelaxationRow, StepRow

UP, DOWN = {"color": BLUE, "marker": "^"}, {"color": RED, "marker": "v"}


def draw(
    steps: Sequence[StepRow], fluctuation: Sequence[FluctuationRow], relaxation: Sequence[RelaxationRow], path: Path
) -> None:
    """Draw the results to `path`, a line for each seed; grey lines mark the switches at constant frequencies."""
    courses = list(dict.fromkeys(row.course for row in steps))
    count = len(courses) + 2 * bool(fluctuation) + bool(relaxation)
    with styled():
        fig = Figure(figsize=(3.4 * count, 3.2), layout="constrained")
        FigureCanvasAgg(fig)
        axes = list(fig.subplots(1, count, squeeze=False)[0])
        for ax in axes:
            ax.set(xlabel="frequency of the target [Hz]")
            for switch in switch_of_seeds(fluctuation).values():
                if math.isfinite(switch):
                    ax.axvline(switch, color="0.7", lw=1.0, zorder=0)
        for course in courses:
            _staircase(axes.pop(0), [row for row in steps if row.course == course], course)
        if fluctuation:
            ax = axes.pop(0)
            _by_seed(ax, [(row.seed, row.freq_hz, (row.phase_mean_deg + 90) % 360 - 90) for row in fluctuation])
            ax.set(ylabel="relative phase hip - ankle [deg]", title="constant frequency", yticks=range(-90, 271, 90))
            ax = axes.pop(0)
            _by_seed(ax, [(row.seed, row.freq_hz, row.phase_sd_deg) for row in fluctuation])
            ax.set(ylabel="SD of the relative phase over cycles [deg]", title="fluctuations", ylim=(0, None))
        if relaxation:
            ax = axes.pop(0)
            _by_seed(ax, [(row.seed, row.freq_hz, row.phase_relaxation_s) for row in relaxation])
            ax.set(ylabel="relaxation time of the relative phase [s]", title="recovery from a push", ylim=(0, None))
        fig.savefig(path)


def _staircase(ax: Axes, rows: Sequence[StepRow], course: str) -> None:
    """Correlation of each step, mean over the repeats, up and down."""
    for seed in dict.fromkeys(row.seed for row in rows):
        for rising, label, style in ((True, "up", UP), (False, "down", DOWN)):
            own = [row for row in rows if (row.seed, row.rising) == (seed, rising)]
            freq = sorted({row.freq_hz for row in own})
            mean = [_mean([row.hip_ankle_r for row in own if row.freq_hz == one]) for one in freq]
            ax.plot(freq, mean, ms=3, lw=1.0, label=None if ax.get_legend_handles_labels()[1][1:] else label, **style)
    ax.axhline(0, color="black", lw=0.8)
    ax.set(ylabel="hip-ankle correlation", ylim=(-1.05, 1.05), title=f"staircase: {course.replace('_', ' ')}")
    ax.legend()


def _by_seed(ax: Axes, points: Sequence[tuple[int, float, float]]) -> None:
    for seed in dict.fromkeys(point[0] for point in points):
        ax.plot(*zip(*(point[1:] for point in points if point[0] == seed), strict=True), marker="o", ms=3, lw=1.0)


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return float(np.mean(known)) if known else math.nan
