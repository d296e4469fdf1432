"""The paper's figures of quantities against a condition, redrawn from several seeds: each function fills a given figure.

The means over seeds are drawn with the torque-optimal stander and the optimum of the trained reward, where they have values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from posture.analysis.results import Result
from posture.config.published import Published
from posture.drawing.style import ANKLE_COLOUR, BLUE, GREEN, GREY, HIP_COLOUR, MODE_COLOUR, ORANGE, PURPLE, RED
from posture.reproduce.claims.seed_means import group_by
from posture.reproduce.experiments import RECIPES
from posture.reproduce.figures.seed_curves import (
    LEAST,
    MEAN_LABEL,
    REWARD,
    REWARD_LABEL,
    correlation_axis,
    draw_seeds,
    draw_theory,
    legend,
    mark_falls,
    phase_axis,
    shade_modes,
)
from posture.reproduce.quantities import (
    AMPLITUDE,
    ANKLE_RANGE,
    ANKLE_TORQUE,
    COST_RATIO,
    ENERGY,
    ENERGY_WEIGHT,
    FREQ,
    HEAD_AMPLITUDE,
    HEAD_SPEED,
    HIP_ANKLE_R,
    HIP_K,
    HIP_RANGE,
    HIP_TORQUE,
    LOAD,
    RELATIVE_PHASE,
    TARGET_HEAD_R,
    Quantity,
    Variable,
)
from posture.reproduce.reproduction import Recipe

Results = Sequence[Result]
PUBLISHED = {"ls": "none", "marker": "D", "ms": 5, "color": RED, "mfc": "white", "mew": 1.2, "zorder": 3}
# Colour, marker and line style of several lines in one panel.
GROUP_STYLES: tuple[tuple[str, str, Any], ...] = (
    (BLUE, "o", "-"),
    (ORANGE, "s", "--"),
    (GREEN, "^", (0, (12, 2))),
    (PURPLE, "v", (0, (6, 1, 1, 1, 1, 1))),
    (GREY, "D", "-"),
    (RED, "P", "--"),
)


def coordination(fig: Figure, results: Results, paper: Published) -> None:
    """Fig. 5 (Exp. 1): hip-ankle correlation and relative phase [deg] against frequency [Hz], over the published modes."""
    axes = fig.subplots(2, 1, sharex=True)
    _correlation_and_phase(axes, results, FREQ)
    _finish(fig, axes, results, FREQ, (paper.table_3.freq_hz, paper.table_3.mode))


def recipes(fig: Figure, own: Sequence[Recipe], results: Results, paper: Published) -> None:
    """Correlation against frequency [Hz] of our policies, `results`, or of several ways to train, `own`, ours among them."""
    ax = fig.subplots()
    groups: dict[str, Results] = {RECIPES[recipe.name]: recipe.frequency for recipe in own} or {MEAN_LABEL: results}
    _grouped(ax, groups, HIP_ANKLE_R)
    draw_theory(ax, results, FREQ, HIP_ANKLE_R.least)
    for (colour, _, _), group in zip(GROUP_STYLES, groups.values(), strict=False):
        draw_theory(ax, group, FREQ, HIP_ANKLE_R.reward, **REWARD, label=REWARD_LABEL, color=colour)
    correlation_axis(ax)
    shade_modes(ax, paper.table_3.freq_hz, paper.table_3.mode)
    ax.set_xlabel(FREQ.axis)
    legend(fig, [ax], 2)


def ranges(fig: Figure, results: Results, _paper: Published) -> None:
    """Fig. 6 (Exp. 1): peak-to-peak joint angles [deg] and torques [Nm per joint] against frequency [Hz]."""
    axes = fig.subplots(2, 1, sharex=True)
    _joints(axes[0], results, FREQ, HIP_RANGE, ANKLE_RANGE, "angle, peak-to-peak\n[deg]")
    _joints(axes[1], results, FREQ, HIP_TORQUE, ANKLE_TORQUE, "torque, peak-to-peak\n[Nm per joint]")
    _finish(fig, axes, results, FREQ)


def pressure(fig: Figure, results: Results, foot_span: tuple[float, float]) -> None:
    """Fig. 7 (Exp. 1): the centre of pressure [mm] in the foot frame against frequency [Hz].

    Median, 5th and 95th percentile in time, between the (heel, toe) ends of ground contact, `foot_span` [m]. In theory: the
    extremes of a cycle.
    """
    ax = fig.subplots()
    mm = {"factor": 1e3}
    draw_seeds(ax, results, FREQ, lambda r: r.cop_p95_m, label="95th percentile in time", color=BLUE, ls="--", **mm)
    draw_seeds(ax, results, FREQ, lambda r: r.cop_p50_m, label="median in time", **mm)
    draw_seeds(ax, results, FREQ, lambda r: r.cop_p05_m, label="5th percentile in time", color=ORANGE, ls="--", **mm)
    draw_theory(ax, results, FREQ, lambda r: r.least.cop_max_m, **mm)
    draw_theory(ax, results, FREQ, lambda r: r.least.cop_min_m, **mm)
    low, high = (1e3 * end for end in foot_span)
    for end, name, va, offset in ((low, "heel", "top", -3), (high, "toe", "bottom", 3)):
        ax.axhline(end, color=GREY, lw=2)
        place = {"transform": ax.get_yaxis_transform(), "ha": "center", "va": va}
        ax.text(0.5, end + offset, f"{name}: contact ends at {end:.0f} mm", **place)
    ax.set(ylabel="centre of pressure [mm]", ylim=(low - 0.15 * (high - low), high + 0.12 * (high - low)))
    _finish(fig, [ax], results, FREQ)


def effort(fig: Figure, results: Results, paper: Published) -> None:
    """Fig. 8 (Exp. 2): correlation, relative phase [deg], energy [J] and tracking against gamma, beside paper Table 4."""
    axes = fig.subplots(2, 2, sharex=True).ravel()
    table = paper.table_4
    _correlation_and_phase(axes[:2], results, ENERGY_WEIGHT)
    for ax, quantity, published in ((axes[2], ENERGY, table.energy_j), (axes[3], TARGET_HEAD_R, table.target_head_r)):
        draw_seeds(ax, results, ENERGY_WEIGHT, quantity.measured)
        ax.plot(table.gamma, published, **PUBLISHED, label="paper Table 4")
    draw_theory(axes[2], results, ENERGY_WEIGHT, ENERGY.least)
    draw_theory(axes[2], results, ENERGY_WEIGHT, ENERGY.reward, **REWARD, label=REWARD_LABEL)
    axes[2].set(yscale="log", ylabel="energy of a trial [J]", xlabel=ENERGY_WEIGHT.axis)
    axes[3].set_ylabel("target-head r")
    _finish(fig, axes, results, ENERGY_WEIGHT, (table.gamma, table.mode))


def stiffness(fig: Figure, results: Results, paper: Published) -> None:
    """Fig. 9 (Exp. 3): correlation, relative phase and joint ranges [deg] against hip stiffness, over the published modes.

    `results` are those at one frequency.
    """
    axes = fig.subplots(3, 1, sharex=True)
    _correlation_and_phase(axes[:2], results, HIP_K)
    _joints(axes[2], results, HIP_K, HIP_RANGE, ANKLE_RANGE, "angle, peak-to-peak\n[deg]")
    _finish(fig, axes, results, HIP_K, (paper.experiment_3.hip_k_nm_per_rad, paper.experiment_3.mode))


def load(fig: Figure, results: Results, paper: Published) -> None:
    """Fig. 12 (Exp. 4b): correlation and relative phase [deg] against load [kg]; the paper gives the modes at its ends."""
    axes = fig.subplots(2, 1, sharex=True)
    _correlation_and_phase(axes, results, LOAD)
    for at, mode in zip(paper.experiment_4b.load_kg, paper.experiment_4b.mode_at_ends, strict=True):
        for ax in axes:
            ax.axvline(at, color=MODE_COLOUR[f"{mode}-phase"], lw=9, alpha=0.25, zorder=0, label=f"paper: {mode}-phase")
    _finish(fig, axes, results, LOAD)


def tracking(fig: Figure, results: Results, paper: Published) -> None:
    """Table 3 (Exp. 1): target-head correlation, head amplitude [m] and mean speed [m/s] against frequency [Hz]."""
    axes, table = fig.subplots(3, 1, sharex=True), paper.table_3
    panels = (
        (TARGET_HEAD_R, table.target_head_r, "target-head r"),
        (HEAD_AMPLITUDE, table.head_amplitude_m, "head amplitude\n[m]"),
        (HEAD_SPEED, table.head_speed_mps, "mean head speed\n[m/s]"),
    )
    for ax, (quantity, published, label) in zip(axes, panels, strict=True):
        draw_seeds(ax, results, FREQ, quantity.measured)
        ax.plot(table.freq_hz, published, **PUBLISHED, label="paper Table 3")
        draw_theory(ax, results, FREQ, quantity.least)
        ax.set_ylabel(label)
    _finish(fig, axes, results, FREQ)


def amplitude(fig: Figure, results: Results, paper: Published) -> None:
    """Correlation against frequency [Hz], with a line for each amplitude of the target [m]."""
    ax = fig.subplots()
    groups = {f"amplitude {value:g} m": group for (value,), group in group_by(results, (AMPLITUDE,)).items()}
    _grouped(ax, groups, HIP_ANKLE_R)
    for (colour, _, _), group in zip(GROUP_STYLES, groups.values(), strict=False):
        draw_theory(ax, group, FREQ, HIP_ANKLE_R.least, color=colour)
    correlation_axis(ax)
    shade_modes(ax, paper.table_3.freq_hz, paper.table_3.mode)
    ax.set_xlabel(FREQ.axis)
    legend(fig, [ax], 2)


def engines(fig: Figure, results: Results, paper: Published) -> None:
    """The policies of Exp. 1 in each physics engine: correlation and cost over least cost against frequency [Hz]."""
    axes = fig.subplots(2, 1, sharex=True)
    names = dict.fromkeys(result.origin.physics for result in results)
    groups = {f"env.physics={name}": [result for result in results if result.origin.physics == name] for name in names}
    _grouped(axes[0], groups, HIP_ANKLE_R)
    _grouped(axes[1], groups, COST_RATIO)
    draw_theory(axes[0], results, FREQ, HIP_ANKLE_R.least)
    correlation_axis(axes[0])
    axes[1].axhline(1, color="black", **LEAST)
    axes[1].set(ylabel="cost / least cost", xlabel=FREQ.axis)
    shade_modes(axes[0], paper.table_3.freq_hz, paper.table_3.mode)
    legend(fig, axes, 2)


def _correlation_and_phase(axes: Sequence[Axes], results: Results, x: Variable) -> None:
    """Correlation in the first axes, relative phase (from the maxima, twice the paper's) in the second, with theory."""
    draw_seeds(axes[0], results, x, HIP_ANKLE_R.measured)
    draw_theory(axes[0], results, x, HIP_ANKLE_R.least)
    draw_theory(axes[0], results, x, HIP_ANKLE_R.reward, **REWARD, label=REWARD_LABEL)
    draw_seeds(axes[1], results, x, RELATIVE_PHASE.measured)
    draw_theory(axes[1], results, x, lambda r: abs(r.least.phase_mean_deg))
    correlation_axis(axes[0])
    phase_axis(axes[1])


def _joints(ax: Axes, results: Results, x: Variable, hip: Quantity, ankle: Quantity, label: str) -> None:
    """A quantity of hip and ankle, with theory."""
    for name, quantity, colour, marker in (("hip", hip, HIP_COLOUR, "o"), ("ankle", ankle, ANKLE_COLOUR, "s")):
        draw_seeds(ax, results, x, quantity.measured, label=name, color=colour, marker=marker)
        draw_theory(ax, results, x, quantity.least, color=colour)
    ax.set_ylabel(label)
    ax.set_ylim(bottom=0)


def _grouped(ax: Axes, groups: Mapping[str, Results], quantity: Quantity) -> None:
    """A quantity against frequency, with a colour and a marker for each group; falls in the group's colour."""
    level = 0
    for i, (name, group) in enumerate(groups.items()):
        colour, marker, line = GROUP_STYLES[i % len(GROUP_STYLES)]
        draw_seeds(ax, group, FREQ, quantity.measured, label=name, color=colour, marker=marker, ls=line)
        mark_falls(ax, group, FREQ, level=level, colour=colour)
        level += not all(result.valid for result in group)


def _finish(
    fig: Figure,
    axes: Sequence[Axes],
    results: Results,
    x: Variable,
    modes: tuple[Sequence[float], Sequence[str]] | None = None,
) -> None:
    """Published modes, falls, the label of the shared x axis, and one legend."""
    for ax in axes:
        if modes:
            shade_modes(ax, *modes)
        mark_falls(ax, results, x)
    axes[-1].set_xlabel(x.axis)
    legend(fig, axes, 2)
