"""The figure of a map: modes and cost over hip stiffness and frequency, and the transition against the other parameters."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from posture.analysis.results import Result
from posture.drawing.style import MODE_COLOUR, styled
from posture.map.summary import Transition, cells
from posture.map.trials import Trials

LABEL = {
    "hip_k": "hip stiffness [Nm/rad per joint]",
    "ankle_k": "ankle stiffness [Nm/rad per joint]",
    "load": "load [kg]",
    "amplitude": "amplitude of the target [m]",
}
_MODES = LinearSegmentedColormap.from_list("modes", [MODE_COLOUR["anti-phase"], "white", MODE_COLOUR["in-phase"]])
_THEORY = {"color": "black", "lw": 1.2}


def draw(found: Trials, seeds: dict[int, list[Result]], switches: Sequence[Transition], path: Path) -> None:
    """Draw every map, those of several seeds as their mean, and write them to `path`."""
    names = list(dict.fromkeys(row.varied for row in switches))
    with styled():
        fig = Figure(figsize=(3.0 * len(names), 6.6), layout="constrained")
        FigureCanvasAgg(fig)
        axes = fig.subplots(2, len(names), squeeze=False, sharey=True)
        for name, (above, below) in zip(names, axes.T, strict=True):
            rows = [row for row in switches if row.varied == name]
            modes = _cells(above, found, seeds, name, lambda one: one.hip_ankle_r, cmap=_MODES, vmin=-1, vmax=1)
            ratio = _cells(
                below, found, seeds, name, lambda one: one.cost / one.least.exact_cost, cmap="viridis", vmin=1.0, vmax=1.5
            )
            _transitions(above, rows)
            below.set(xlabel=LABEL[name])
        for ax, mesh, label in (
            (axes[0], modes, "hip-ankle correlation: in-phase +, anti-phase -"),
            (axes[1], ratio, "cost over least cost, exact equations"),
        ):
            fig.colorbar(mesh, ax=list(ax), label=label, extend="max" if mesh is ratio else "neither")
            ax[0].set(ylabel="frequency [Hz]")
        fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
        fig.savefig(path)


def _cells(
    ax: Axes,
    found: Trials,
    seeds: dict[int, list[Result]],
    name: str,
    quantity: Callable[[Result], float],
    **style: Any,
) -> Any:
    """A cell for each value and frequency; white where a policy fell or no motion is possible."""
    of = [cells(found, results, name) for results in seeds.values()]
    values, freq = (np.unique(column) for column in zip(*((value, one.freq_hz) for one, value in of[0]), strict=True))
    grid = np.full((len(of), len(freq), len(values)), np.nan)
    for seed, rows in enumerate(of):
        for one, value in rows:
            grid[seed, np.searchsorted(freq, one.freq_hz), np.searchsorted(values, value)] = quantity(one)
    ax.grid(False)
    return ax.pcolormesh(values, freq, np.ma.masked_invalid(grid.mean(0)), shading="nearest", rasterized=True, **style)


def _transitions(ax: Axes, rows: Sequence[Transition]) -> None:
    """Theory's transitions as lines, those of the policies as a point for each seed, with a band between the seeds."""
    values = sorted({row.value for row in rows})
    of = [[row for row in rows if row.value == value] for value in values]
    ax.plot(values, [own[0].least_hz for own in of], ls=":", label="switch of the least cost", **_THEORY)
    ax.plot(values, [own[0].reward_hz for own in of], label="switch of the reward's optimum", **_THEORY)
    lowest, highest = ([extreme([row.policy_hz for row in own]) for own in of] for extreme in (np.min, np.max))
    ax.fill_between(values, lowest, highest, color="black", alpha=0.2, lw=0, label="policies, between the seeds")
    ax.plot(
        [row.value for row in rows], [row.policy_hz for row in rows], "o", ms=4, mfc="white", color="black", label="policy"
    )
