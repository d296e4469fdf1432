"""Paper Fig. 13: the hip-ankle correlation over the plane of hip stiffness and target frequency."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from posture.analysis.results import Row
from posture.analysis.statistics import bootstrap_mean
from posture.analysis.trajectory import Array
from posture.drawing.style import FALL_COLOUR, MODE_COLOUR
from posture.reproduce.figures.seed_curves import published

MODES = LinearSegmentedColormap.from_list("modes", [MODE_COLOUR["anti-phase"], "white", MODE_COLOUR["in-phase"]])
_OURS = {"color": "black", "lw": 2.0}
_THEORY = {"color": "black", "lw": 1.5, "ls": "--"}


def plane(rows: Sequence[Row]) -> tuple[Array, Array, dict[tuple[int, int], list[Row]]]:
    """Distinct hip stiffness (K,) and frequency (F,), both rising, and the rows of each cell (frequency, stiffness)."""
    hip_k = np.unique([float(row["hip_k_nm_per_rad"]) for row in rows])
    freq = np.unique([float(row["freq_hz"]) for row in rows])
    cells: dict[tuple[int, int], list[Row]] = {}
    for row in rows:
        place = int(np.searchsorted(freq, row["freq_hz"])), int(np.searchsorted(hip_k, row["hip_k_nm_per_rad"]))
        cells.setdefault(place, []).append(row)
    return hip_k, freq, cells


def stiffness_map(fig: Figure, rows: Sequence[Row], paper: Mapping[str, Any]) -> None:
    """Fig. 13: mean over seeds of the correlation, a cell a condition, with its zero contour and that of the torque-optimal
    stander; the modes of the paper's Exp. 3 at their frequency, along the upper edge. Each seed is a dot in its cell, in the
    colour of its own correlation; a cell in which one fell is hatched."""
    ax = fig.subplots()
    mesh = draw_plane(ax, rows)
    fig.colorbar(mesh, ax=ax, label="hip-ankle correlation: in-phase +, anti-phase -")
    keys: list[Any] = [
        Line2D([], [], **_OURS, label="zero, mean of the seeds"),
        Line2D([], [], **_THEORY, label="zero, torque-optimal"),
        Line2D([], [], ls="none", marker="o", ms=5, mfc="none", color="black", label="a seed"),
        Patch(facecolor="none", edgecolor=FALL_COLOUR, hatch="///", label="a seed fell"),
    ]
    found = published(paper, "experiment_3", "hip_k_nm_per_rad", "mode")
    if found:
        for at, mode in zip(*found, strict=True):
            style = {"transform": ax.get_xaxis_transform(), "clip_on": False, "color": MODE_COLOUR[f"{mode}-phase"]}
            ax.plot([at], [1.035], "v", ms=8, **style)
        name = f"paper at {paper['experiment_3']['freq_hz']:g} Hz: {{}}"
        for mode in dict.fromkeys(found[1]):
            style = {"ls": "none", "marker": "v", "ms": 8, "color": MODE_COLOUR[f"{mode}-phase"]}
            keys.append(Line2D([], [], label=name.format(f"{mode}-phase"), **style))
    fig.legend(handles=keys, loc="outside upper center", ncols=2)


def draw_plane(ax: Axes, rows: Sequence[Row]) -> QuadMesh:
    """The map itself, without its legend; falls are left out of every mean."""
    hip_k, freq, cells = plane(rows)
    mean, least = np.full((2, len(freq), len(hip_k)), math.nan)
    width, height = _spacing(hip_k), _spacing(freq)
    for (i, j), group in cells.items():
        standing = [row for row in group if row["valid"]]
        mean[i, j] = bootstrap_mean([row["hip_ankle_r"] for row in standing])[0]
        least[i, j] = next((r for row in group if math.isfinite(r := row.get("least_hip_ankle_r", math.nan))), math.nan)
        # Side by side about the middle of the cell.
        across = hip_k[j] + 0.22 * width * (np.arange(len(standing)) - (len(standing) - 1) / 2)
        colours = {"c": [row["hip_ankle_r"] for row in standing], "cmap": MODES, "vmin": -1, "vmax": 1}
        if standing:
            ax.scatter(
                across, np.full(len(standing), freq[i]), s=22, edgecolors="black", linewidths=0.6, zorder=3, **colours
            )
        if len(standing) < len(group):
            corner = (hip_k[j] - width / 2, freq[i] - height / 2)
            style = {"facecolor": "none", "edgecolor": FALL_COLOUR, "hatch": "///", "lw": 0}
            ax.add_patch(Rectangle(corner, width, height, **style, zorder=2))
    edges = [np.append(at - step / 2, at[-1] + step / 2) for at, step in ((hip_k, width), (freq, height))]
    mesh = ax.pcolormesh(*edges, np.ma.masked_invalid(mean), cmap=MODES, vmin=-1, vmax=1)
    for values, style in ((mean, _OURS), (least, _THEORY)):
        known = values[np.isfinite(values)]
        if min(values.shape) > 1 and len(known) and known.min() < 0 < known.max():
            # A contour has its style in the plural.
            plural = {"colors": style["color"], "linewidths": style["lw"], "linestyles": style.get("ls", "-")}
            ax.contour(hip_k, freq, np.ma.masked_invalid(values), levels=[0], zorder=4, **plural)
    ax.grid(False)
    ax.set(xlabel="hip stiffness [Nm/rad per joint]", ylabel="target frequency [Hz]", xticks=hip_k)
    ax.set(xlim=(edges[0][0], edges[0][-1]), ylim=(edges[1][0], edges[1][-1]))
    return mesh


def _spacing(values: Array) -> float:
    """Smallest distance between two values; of a single one, a tenth of it."""
    return float(np.diff(values).min()) if len(values) > 1 else float(values[0]) / 10
