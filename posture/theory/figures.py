"""The map of the stander's postural modes, hip stiffness by frequency, and the transition by other parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from envs.body.joints import ANKLE, HIP
from envs.body.segments import Segments
from posture.config.published import read_published
from posture.config.theory import TheoryConfig
from posture.drawing.style import GREY, MODE_COLOUR, styled
from posture.theory.motion import PeriodicMotion
from posture.theory.optimum import cheapest_sinusoid
from posture.theory.stander import linearise
from posture.theory.tables import ModeMapRow, TheoryTables, Transitions, varied
from posture.theory.transition import sinusoid_transition

GRID = (71, 60)
"""Points of the map along stiffness and frequency."""
_MODES = LinearSegmentedColormap.from_list("modes", [MODE_COLOUR["anti-phase"], "white", MODE_COLOUR["in-phase"]])
_LEAST = {"marker": "o", "ms": 4, "color": "black", "lw": 1.2, "label": "least cost under constraints"}
_SINUSOID = {"ls": "--", "color": "black", "lw": 1.2, "label": "sinusoid, closed form"}


def draw_map(body: Segments, config: TheoryConfig, tables: TheoryTables, path: Path) -> None:
    """Draw the map and write it to `path`; `tables` are those of `all_tables`.

    Left: how the least-torque sinusoid shares the motion between ankle and hip, over the plane of Fig. 13 continued to the
    highest frequency of Exp. 1, with the transition frequencies [Hz], at which the ankle does not move. Right: the
    transition against each other parameter.
    """
    with styled():
        fig = Figure(figsize=(9.0, 5.2), layout="constrained")
        FigureCanvasAgg(fig)
        left, right = fig.subfigures(1, 2, width_ratios=(1.45, 1.0))
        plane = left.subplots()
        _draw_plane(plane, body, config, tables.figure_13.rows)
        left.legend(*plane.get_legend_handles_labels(), loc="outside upper center", ncols=2)
        axes = right.subplots(3, 1, sharey=True)
        panels: list[tuple[str, Callable[[Transitions], float], str]] = [
            ("ankle_k", lambda row: row.ankle_k_nm_per_rad, "ankle stiffness [Nm/rad per joint]"),
            ("load", lambda row: row.load_kg, "load [kg]"),
            ("tolerance", lambda row: 1e3 * row.tolerance_m, "head tolerance [mm]"),
        ]
        for ax, (name, get, label) in zip(axes, panels, strict=True):
            rows = [row.transitions for row in tables.around.rows if row.varied == name]
            ax.plot([get(row) for row in rows], [row.sinusoid_transition_hz for row in rows], **_SINUSOID)
            ax.plot([get(row) for row in rows], [row.least_transition_hz for row in rows], **_LEAST)
            ax.set(xlabel=label, ylabel="f* [Hz]")
        right.suptitle(f"hip {config.env.hip_k:g} Nm/rad, one parameter varied", fontsize=9)
        fig.savefig(path)


def _draw_plane(ax: Axes, body: Segments, config: TheoryConfig, rows: Sequence[ModeMapRow]) -> None:
    figure, env = config.figure_13, config.env
    stiffness = np.linspace(min(figure.hip_k), max(figure.hip_k), GRID[0])
    freq = np.linspace(figure.freq[0], max(figure.freq[1], *config.evaluation.freq), GRID[1])
    standers = [linearise(body, varied(env, hip_k=float(k))) for k in stiffness]
    share = [[_ankle_over_hip(cheapest_sinusoid(stander, float(f), 1.0, 0.0)) for stander in standers] for f in freq]
    mesh = ax.pcolormesh(stiffness, freq, share, cmap=_MODES, vmin=-0.5, vmax=0.5, shading="gouraud", rasterized=True)
    ax.figure.colorbar(mesh, ax=ax, extend="both", label="ankle over hip angle: positive in-phase, negative anti-phase")
    ax.plot(stiffness, [_or_nan(sinusoid_transition(stander, config.search)) for stander in standers], **_SINUSOID)
    heaviest = max(config.experiment_4b.load)
    laden = [linearise(body, varied(env, hip_k=float(k), load=heaviest)) for k in stiffness]
    style = {**_SINUSOID, "color": GREY, "label": f"sinusoid, load {heaviest:g} kg"}
    ax.plot(stiffness, [_or_nan(sinusoid_transition(stander, config.search)) for stander in laden], **style)
    found = [row.transitions for row in rows]
    ax.plot([row.hip_k_nm_per_rad for row in found], [row.least_transition_hz for row in found], **_LEAST)
    published = read_published()
    if env.body is None:
        ax.plot(
            published.table_3.condition.hip_k,
            published.experiment_4a.transition_hz,
            "*",
            ms=11,
            color="gold",
            mec="black",
            ls="none",
            label="paper, Exp. 4a (load 0)",
        )
    corner = (min(figure.hip_k), figure.freq[0])
    width, height = max(figure.hip_k) - min(figure.hip_k), figure.freq[1] - figure.freq[0]
    ax.add_patch(Rectangle(corner, width, height, fill=False, ls=":", label="plane of paper Fig. 13"))
    ax.grid(False)
    ax.set(xlabel="hip stiffness [Nm/rad per joint]", ylabel="frequency [Hz]", ylim=(freq[0], freq[-1]))
    ax.set_title(f"ankle {env.ankle_k:g} Nm/rad, load {env.load:g} kg")


def _ankle_over_hip(motion: PeriodicMotion) -> float:
    """The part of the ankle's first harmonic in phase with the hip's, over the hip's [-]."""
    hip, ankle = motion.coefficients[1, HIP], motion.coefficients[1, ANKLE]
    return float((ankle * np.conj(hip)).real / abs(hip) ** 2)


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value
