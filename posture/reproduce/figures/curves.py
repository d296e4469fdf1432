"""The paper's figures against a condition, redrawn from several seeds: a function a figure, which fills the one it is given.

`rows` are those of one experiment (see seed_curves.py), `paper` the content of conf/paper.yaml. Columns `least_*` are those
of the torque-optimal stander, `reward_*` those of the optimum of the reward trained; where the rows have none, nothing of
it is drawn.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from posture.analysis.results import Row
from posture.drawing.style import ANKLE_COLOUR, BLUE, GREEN, GREY, HIP_COLOUR, MODE_COLOUR, ORANGE, PURPLE, RED
from posture.reproduce.figures.seed_curves import (
    LEAST,
    REWARD,
    REWARD_LABEL,
    correlation_axis,
    draw_seeds,
    draw_theory,
    legend,
    mark_falls,
    phase_axis,
    published,
    shade_modes,
)

Paper = Mapping[str, Any]

FREQ, HIP_K, LOAD, GAMMA = "freq_hz", "hip_k_nm_per_rad", "load_kg", "energy_weight"
FREQ_LABEL, HIP_K_LABEL = "target frequency [Hz]", "hip stiffness [Nm/rad per joint]"
LOAD_LABEL, GAMMA_LABEL = "load on the trunk [kg]", "weight of effort, gamma"
PUBLISHED = {"ls": "none", "marker": "D", "ms": 5, "color": RED, "mfc": "white", "mew": 1.2, "zorder": 3}
# Of several lines in one panel: colour, marker and line style.
GROUP_STYLES: tuple[tuple[str, str, Any], ...] = (
    (BLUE, "o", "-"),
    (ORANGE, "s", "--"),
    (GREEN, "^", "-."),
    (PURPLE, "v", (0, (6, 1, 1, 1, 1, 1))),
    (GREY, "D", "-"),
    (RED, "P", "--"),
)


def coordination(fig: Figure, rows: Sequence[Row], paper: Paper) -> None:
    """Fig. 5 (Exp. 1): hip-ankle correlation and relative phase [deg] against frequency [Hz], over the published modes."""
    axes = fig.subplots(2, 1, sharex=True)
    _correlation_and_phase(axes, rows, FREQ)
    for ax in axes:
        _shade(ax, paper, "table_3", "freq_hz")
    _finish(fig, axes, rows, FREQ, FREQ_LABEL)


def ranges(fig: Figure, rows: Sequence[Row], paper: Paper) -> None:
    """Fig. 6 (Exp. 1): peak-to-peak joint angles [deg] and torques [Nm per joint] against frequency [Hz]."""
    axes = fig.subplots(2, 1, sharex=True)
    _joints(axes[0], rows, FREQ, "range_deg", "angle, peak-to-peak\n[deg]")
    _joints(axes[1], rows, FREQ, "torque_range_nm", "torque, peak-to-peak\n[Nm per joint]")
    _finish(fig, axes, rows, FREQ, FREQ_LABEL)


def pressure(fig: Figure, rows: Sequence[Row], paper: Paper, foot_span: tuple[float, float]) -> None:
    """Fig. 7 (Exp. 1): the centre of pressure [mm] in the foot frame against frequency [Hz].

    The median, 5th and 95th percentile in time of each seed and their means, between the (heel, toe) ends of ground contact
    `foot_span` [m]; theory is the least and the largest value of a cycle.
    """
    ax = fig.subplots()
    for share, colour, style in ((95, BLUE, "--"), (50, "black", "-"), (5, ORANGE, "--")):
        name = "median in time" if share == 50 else f"{share}th percentile in time"
        draw_seeds(ax, rows, FREQ, f"cop_p{share:02d}_m", factor=1e3, label=name, color=colour, ls=style)
    for column in ("least_cop_max_m", "least_cop_min_m"):
        draw_theory(ax, rows, FREQ, column, factor=1e3)
    for end, name, va in zip(foot_span, ("heel", "toe"), ("top", "bottom"), strict=True):
        ax.axhline(1e3 * end, color=GREY, lw=2)
        place = {"transform": ax.get_yaxis_transform(), "ha": "center", "va": va}
        ax.text(0.5, 1e3 * end + (3 if va == "bottom" else -3), f"{name}: contact ends at {1e3 * end:.0f} mm", **place)
    low, high = (1e3 * end for end in foot_span)
    ax.set(ylabel="centre of pressure [mm]", ylim=(low - 0.15 * (high - low), high + 0.12 * (high - low)))
    _finish(fig, [ax], rows, FREQ, FREQ_LABEL)


def effort(fig: Figure, rows: Sequence[Row], paper: Paper) -> None:
    """Fig. 8 (Exp. 2): correlation, relative phase [deg], energy [J] and tracking against gamma, beside paper Table 4."""
    axes = fig.subplots(2, 2, sharex=True).ravel()
    _correlation_and_phase(axes[:2], rows, GAMMA)
    for ax, column, label in ((axes[2], "energy_j", "energy of a trial [J]"), (axes[3], "target_head_r", "target-head r")):
        draw_seeds(ax, rows, GAMMA, column, label="mean of the seeds")
        table = published(paper, "table_4", "gamma", column)
        if table:
            ax.plot(*table, **PUBLISHED, label="paper Table 4")
        ax.set_ylabel(label)
    draw_theory(axes[2], rows, GAMMA, "least_energy_j")
    draw_theory(axes[2], rows, GAMMA, "reward_energy_j", **REWARD, label=REWARD_LABEL)
    axes[2].set_yscale("log")
    for ax in axes:
        _shade(ax, paper, "table_4", "gamma")
    axes[2].set_xlabel(GAMMA_LABEL)
    _finish(fig, axes, rows, GAMMA, GAMMA_LABEL)


def stiffness(fig: Figure, rows: Sequence[Row], paper: Paper) -> None:
    """Fig. 9 (Exp. 3): correlation, relative phase and joint ranges [deg] against hip stiffness, over the paper's modes.

    `rows` are those of one frequency.
    """
    axes = fig.subplots(3, 1, sharex=True)
    _correlation_and_phase(axes[:2], rows, HIP_K)
    _joints(axes[2], rows, HIP_K, "range_deg", "angle, peak-to-peak\n[deg]")
    for ax in axes:
        _shade(ax, paper, "experiment_3", "hip_k_nm_per_rad")
    _finish(fig, axes, rows, HIP_K, HIP_K_LABEL)


def load(fig: Figure, rows: Sequence[Row], paper: Paper) -> None:
    """Fig. 12 (Exp. 4b): correlation and relative phase [deg] against load [kg]; the paper's modes are known at its ends."""
    axes = fig.subplots(2, 1, sharex=True)
    _correlation_and_phase(axes, rows, LOAD)
    ends = published(paper, "experiment_4b", "load_kg", "mode_at_ends")
    for at, mode in zip(*ends, strict=True) if ends else ():
        for ax in axes:
            ax.axvline(at, color=MODE_COLOUR[f"{mode}-phase"], lw=9, alpha=0.25, zorder=0, label=f"paper: {mode}-phase")
    _finish(fig, axes, rows, LOAD, LOAD_LABEL)


def tracking(fig: Figure, rows: Sequence[Row], paper: Paper) -> None:
    """Table 3 (Exp. 1): target-head correlation, head amplitude [m] and mean speed [m/s] against frequency [Hz]."""
    axes = fig.subplots(3, 1, sharex=True)
    for ax, (column, label) in zip(
        axes,
        {
            "target_head_r": "target-head r",
            "head_amplitude_m": "head amplitude\n[m]",
            "head_speed_mps": "mean head speed\n[m/s]",
        }.items(),
        strict=True,
    ):
        draw_seeds(ax, rows, FREQ, column, label="mean of the seeds")
        table = published(paper, "table_3", "freq_hz", column)
        if table:
            ax.plot(*table, **PUBLISHED, label="paper Table 3")
        draw_theory(ax, rows, FREQ, f"least_{column}")
        ax.set_ylabel(label)
    _finish(fig, axes, rows, FREQ, FREQ_LABEL)


def amplitude(fig: Figure, rows: Sequence[Row], paper: Paper) -> None:
    """The paper's remark on amplitude: correlation against frequency [Hz], a line an amplitude of the target [m]."""
    ax = fig.subplots()
    groups = {f"amplitude {value:g} m": _only(rows, "amplitude_m", value) for value in sorted(_values(rows, "amplitude_m"))}
    _grouped(ax, groups, "hip_ankle_r")
    for i, group in enumerate(groups.values()):
        draw_theory(ax, group, FREQ, "least_hip_ankle_r", color=GROUP_STYLES[i % len(GROUP_STYLES)][0])
    correlation_axis(ax)
    _shade(ax, paper, "table_3", "freq_hz")
    ax.set_xlabel(FREQ_LABEL)
    legend(fig, [ax], 2)


def engines(fig: Figure, rows: Sequence[Row], paper: Paper) -> None:
    """The policies of Exp. 1 in each physics engine: correlation and cost over least cost against frequency [Hz]."""
    axes = fig.subplots(2, 1, sharex=True)
    groups = {f"env.physics={name}": _only(rows, "physics", name) for name in _values(rows, "physics")}
    _grouped(axes[0], groups, "hip_ankle_r")
    _grouped(axes[1], groups, "cost_ratio")
    draw_theory(axes[0], rows, FREQ, "least_hip_ankle_r")
    correlation_axis(axes[0])
    axes[1].axhline(1, color="black", **LEAST)
    axes[1].set(ylabel="cost / least cost", xlabel=FREQ_LABEL)
    _shade(axes[0], paper, "table_3", "freq_hz")
    legend(fig, axes, 2)


def _correlation_and_phase(axes: Sequence[Axes], rows: Sequence[Row], x: str) -> None:
    """Correlation into the first axes, relative phase (by the maxima, the paper's doubled) into the second, with theory."""
    draw_seeds(axes[0], rows, x, "hip_ankle_r", label="mean of the seeds")
    draw_theory(axes[0], rows, x, "least_hip_ankle_r")
    draw_theory(axes[0], rows, x, "reward_hip_ankle_r", **REWARD, label=REWARD_LABEL)
    draw_seeds(axes[1], rows, x, "relative_phase_deg", label="mean of the seeds")
    draw_theory(axes[1], rows, x, "least_phase_mean_deg", absolute=True)
    correlation_axis(axes[0])
    phase_axis(axes[1])


def _joints(ax: Axes, rows: Sequence[Row], x: str, column: str, label: str) -> None:
    """A column of hip and of ankle, with theory."""
    for joint, colour, marker in (("hip", HIP_COLOUR, "o"), ("ankle", ANKLE_COLOUR, "s")):
        draw_seeds(ax, rows, x, f"{joint}_{column}", label=joint, color=colour, marker=marker)
        draw_theory(ax, rows, x, f"least_{joint}_{column}", color=colour)
    ax.set(ylabel=label)
    ax.set_ylim(bottom=0)


def _grouped(ax: Axes, groups: Mapping[str, Sequence[Row]], column: str) -> None:
    """A column against frequency, a colour and a marker each group; falls in the group's colour."""
    level = 0
    for i, (name, group) in enumerate(groups.items()):
        colour, marker, line = GROUP_STYLES[i % len(GROUP_STYLES)]
        draw_seeds(ax, group, FREQ, column, label=name, color=colour, marker=marker, ls=line)
        mark_falls(ax, group, FREQ, level=level, colour=colour)
        level += not all(row["valid"] for row in group)


def _values(rows: Sequence[Row], column: str) -> list[Any]:
    """Distinct values of a column, in the order in which they come."""
    return list(dict.fromkeys(row[column] for row in rows))


def _only(rows: Sequence[Row], column: str, value: Any) -> list[Row]:
    return [row for row in rows if row[column] == value]


def _shade(ax: Axes, paper: Paper, table: str, column: str) -> None:
    """The modes that the paper shows along `column` of one of its tables."""
    found = published(paper, table, column, "mode")
    if found:
        shade_modes(ax, *found)


def _finish(fig: Figure, axes: Sequence[Axes], rows: Sequence[Row], x: str, label: str) -> None:
    """Falls, the label of the shared x axis, and one legend."""
    for ax in axes:
        mark_falls(ax, rows, x)
    axes[-1].set_xlabel(label)
    legend(fig, axes, 2)
