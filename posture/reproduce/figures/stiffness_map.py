"""Paper Fig. 13: the hip-ankle correlation over the plane of hip stiffness and target frequency."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from posture.analysis.results import Result
from posture.analysis.trajectory import Array
from posture.config.published import Published
from posture.drawing.style import FALL_COLOUR, MODE_COLOUR
from posture.reproduce.claims.seed_means import group_by, seed_means, theory_means
from posture.reproduce.quantities import FREQ, HIP_ANKLE_R, HIP_K

MODES = LinearSegmentedColormap.from_list("modes", [MODE_COLOUR["anti-phase"], "white", MODE_COLOUR["in-phase"]])
_OURS = {"color": "black", "lw": 2.0}
_THEORY = {"color": "black", "lw": 1.5, "ls": "--"}


def stiffness_map(fig: Figure, results: Sequence[Result], paper: Published) -> None:
    """Fig. 13: mean over seeds of the correlation, with its zero contour and that of the torque-optimal stander.

    The modes of the paper's Exp. 3 are drawn along the upper edge. Each seed is a dot in its cell, in the colour of its own
    correlation; a cell in which one fell is hatched.
    """
    ax = fig.subplots()
    mesh = draw_cells(ax, results)
    fig.colorbar(mesh, ax=ax, label="hip-ankle correlation: in-phase +, anti-phase -")
    keys: list[Any] = [
        Line2D([], [], **_OURS, label="zero, mean of the seeds"),
        Line2D([], [], **_THEORY, label="zero, torque-optimal"),
        Line2D([], [], ls="none", marker="o", ms=5, mfc="none", color="black", label="a seed"),
        Patch(facecolor="none", edgecolor=FALL_COLOUR, hatch="///", label="a seed fell"),
    ]
    published = paper.experiment_3
    style: dict[str, Any] = {"ls": "none", "marker": "v", "ms": 8}
    for at, mode in zip(published.hip_k_nm_per_rad, published.mode, strict=True):
        style["color"] = MODE_COLOUR[f"{mode}-phase"]
        ax.plot([at], [1.035], transform=ax.get_xaxis_transform(), clip_on=False, **style)
    for mode in dict.fromkeys(published.mode):
        style["color"] = MODE_COLOUR[f"{mode}-phase"]
        keys.append(Line2D([], [], label=f"paper at {published.freq_hz:g} Hz: {mode}-phase", **style))
    fig.legend(handles=keys, loc="outside upper center", ncols=2)


def draw_cells(ax: Axes, results: Sequence[Result]) -> QuadMesh:
    """The map without its legend, a cell for each condition; falls are not averaged."""
    by = (HIP_K, FREQ)
    groups = group_by(results, by)
    hip_k, freq = (np.unique([condition[i] for condition in groups]) for i in (0, 1))
    width, height = _spacing(hip_k), _spacing(freq)
    for (k, f), group in groups.items():
        known = [result.hip_ankle_r for result in group if result.valid]
        # Side by side about the middle of the cell.
        across = k + 0.22 * width * (np.arange(len(known)) - (len(known) - 1) / 2)
        colours = {"c": known, "cmap": MODES, "vmin": -1, "vmax": 1}
        if known:
            ax.scatter(across, np.full(len(known), f), s=22, edgecolors="black", linewidths=0.6, zorder=3, **colours)
        if len(known) < len(group):
            style = {"facecolor": "none", "edgecolor": FALL_COLOUR, "hatch": "///", "lw": 0}
            ax.add_patch(Rectangle((k - width / 2, f - height / 2), width, height, **style, zorder=2))
    ours, theory = (
        np.array([[means[k, f].mean if (k, f) in means else math.nan for k in hip_k] for f in freq])
        for means in (seed_means(results, by, HIP_ANKLE_R.measured), theory_means(results, by, HIP_ANKLE_R.least))
    )
    edges = [np.append(at - step / 2, at[-1] + step / 2) for at, step in ((hip_k, width), (freq, height))]
    mesh = ax.pcolormesh(*edges, np.ma.masked_invalid(ours), cmap=MODES, vmin=-1, vmax=1)
    for values, style in ((ours, _OURS), (theory, _THEORY)):
        finite = values[np.isfinite(values)]
        if min(values.shape) > 1 and len(finite) and finite.min() < 0 < finite.max():
            # The arguments of a contour are in the plural.
            plural = {"colors": style["color"], "linewidths": style["lw"], "linestyles": style.get("ls", "-")}
            ax.contour(hip_k, freq, np.ma.masked_invalid(values), levels=[0], zorder=4, **plural)
    ax.grid(False)
    ax.set(xlabel=HIP_K.axis, ylabel=FREQ.axis, xticks=hip_k)
    ax.set(xlim=(edges[0][0], edges[0][-1]), ylim=(edges[1][0], edges[1][-1]))
    return mesh


def _spacing(values: Array) -> float:
    """Smallest distance between two values; for a single one, a tenth of it."""
    return float(np.diff(values).min()) if len(values) > 1 else float(values[0]) / 10
