"""Figures of one evaluation: one function for each figure, drawn without pyplot, so that no window or figure stays open.

`rows` are the results of the trial (`coordination.measure_trajectory`). `published` is paper Table 3; pass None where the
conditions are not those of that table, and nothing published is drawn. A world that fell is marked with
the time of its fall; its indices are not drawn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from posture.analysis.results import NO_LEAST, Result, Value
from posture.analysis.trajectory import Array, Trajectory
from posture.config.published import Table3
from posture.drawing.style import (
    ANKLE_COLOUR,
    BLUE,
    FALL_COLOUR,
    GREY,
    HEAD_COLOUR,
    HIP_COLOUR,
    MODE_COLOUR,
    ORANGE,
    RED,
    styled,
)

SHOWN_CYCLES = 3  # at the end of the trial, in figures over time
COLUMNS = 5  # of panels
OVER_TIME = ("head_target", "joint_angles", "angle_plots")
AGAINST_FREQUENCY = ("coordination", "ranges", "tracking", "cop")
FILES = tuple(f"{name}.png" for name in (*OVER_TIME, *AGAINST_FREQUENCY))
"""Files that `draw_all` may write."""


def draw_all(
    trajectory: Trajectory,
    rows: Sequence[Result],
    published: Table3 | None,
    folder: str | Path,
    foot_span: tuple[float, float],
) -> list[Path]:
    """Draw every figure as a PNG into `folder` and return their paths.

    `foot_span` is the (heel, toe) end of ground contact in the foot frame [m]. Figures against frequency are left out
    where no world has a fixed frequency (a ramp).
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with styled():
        figures = [fig_head_target(trajectory, rows), fig_joint_angles(trajectory, rows), fig_angle_plots(trajectory, rows)]
        drawn = dict(zip(OVER_TIME, figures, strict=True))
        if np.isfinite(trajectory.freq).any():
            figures = [fig_coordination(rows, published), fig_ranges(rows), fig_tracking(rows, published)]
            drawn |= zip(AGAINST_FREQUENCY, [*figures, fig_cop(rows, foot_span)], strict=True)
        for name, fig in drawn.items():
            fig.savefig(folder / f"{name}.png")
    return [folder / f"{name}.png" for name in drawn]


def fig_head_target(trajectory: Trajectory, rows: Sequence[Result]) -> Figure:
    """Head and target position [m] over the last cycles [s], one panel for each world."""
    signals = {
        "target": (trajectory.target_x, {"color": ORANGE, "lw": 2.5}),
        "head": (trajectory.head_x, {"color": HEAD_COLOUR, "lw": 1.0}),
    }
    return _panels_over_time(trajectory, rows, signals, "position x [m]")


def fig_joint_angles(trajectory: Trajectory, rows: Sequence[Result]) -> Figure:
    """Hip and ankle angle [deg], mean of left and right, over the last cycles [s], one panel for each world."""
    signals = {
        "hip (flexion negative)": (np.degrees(trajectory.hip), {"color": HIP_COLOUR}),
        "ankle (forward lean negative)": (np.degrees(trajectory.ankle), {"color": ANKLE_COLOUR, "ls": "--"}),
    }
    return _panels_over_time(trajectory, rows, signals, "angle [deg]")


def fig_angle_plots(trajectory: Trajectory, rows: Sequence[Result]) -> Figure:
    """Hip against ankle angle [deg] over the last cycles, one panel for each world, coloured by mode."""
    hip, ankle = np.degrees(trajectory.hip), np.degrees(trajectory.ankle)
    windows = [_window(trajectory, row, w) for w, row in enumerate(rows)]
    fig = _figure(*_grid_size(len(rows)))
    panels = _grid(fig, len(rows))
    for w, (row, ax) in enumerate(zip(rows, panels, strict=True)):
        colour = MODE_COLOUR[row.mode] if row.valid else FALL_COLOUR
        ax.plot(ankle[windows[w], w], hip[windows[w], w], color=colour, lw=1.0)
        _title(ax, rows, w)
    _share_limits(panels, rows, [ankle[s, w] for w, s in enumerate(windows)], "x")
    _share_limits(panels, rows, [hip[s, w] for w, s in enumerate(windows)], "y")
    fig.supxlabel("ankle angle [deg], forward lean negative", fontsize=9)
    fig.supylabel("hip angle [deg], flexion negative", fontsize=9)
    present = {row.mode for row in rows if row.valid}
    keys = [Patch(color=colour, label=name) for name, colour in MODE_COLOUR.items() if name in present]
    if keys:
        fig.legend(handles=keys, loc="outside upper center", ncols=len(keys))
    return fig


def fig_coordination(rows: Sequence[Result], published: Table3 | None) -> Figure:
    """Hip-ankle correlation and relative phase [deg] against frequency [Hz], over the published modes."""
    fig = _figure(6.5, 5.5)
    upper, lower = fig.subplots(2, 1, sharex=True)
    _line(upper, rows, lambda row: row.hip_ankle_r, color=GREY, lw=1, zorder=1)
    for name, colour in MODE_COLOUR.items():
        of_mode = [row for row in rows if row.valid and row.mode == name]
        if of_mode:
            f, r = _values(of_mode, lambda row: row.hip_ankle_r)
            # A world without a mode is an open circle at zero, so that it stays visible.
            fill = "none" if name == "undefined" else colour
            upper.plot(f, np.nan_to_num(r), "o", color=colour, mfc=fill, label=f"ours, {name}")
    _theory(upper, rows, lambda row: row.least.hip_ankle_r, color="black", label="torque-optimal")
    upper.axhline(0, color="black", lw=0.8)
    upper.set(ylim=(-1.08, 1.08), ylabel="hip-ankle correlation r")
    _line(
        lower,
        rows,
        lambda row: row.relative_phase_deg,
        marker="s",
        color="black",
        label="by maxima (paper's, doubled)",
    )
    f, mean = _values(rows, lambda row: row.phase_mean_deg)
    _, sd = _values(rows, lambda row: row.phase_sd_deg)
    lower.errorbar(f, np.abs(mean), sd, fmt="^", color=ORANGE, capsize=3, label="|circular mean| ± sd over cycles")
    lower.set(
        ylim=(-8, 195),
        yticks=range(0, 181, 45),
        ylabel="relative phase [deg]",
        xlabel="target frequency [Hz]",
    )
    for ax in (upper, lower):
        _shade_published_modes(ax, published)
    _mark_falls((upper, lower), rows)
    handles, labels = upper.get_legend_handles_labels()
    more, names = lower.get_legend_handles_labels()
    unique = dict(zip(labels + names, handles + more, strict=True))
    fig.legend(unique.values(), unique.keys(), loc="outside upper center", ncols=3)
    return fig


def fig_cop(rows: Sequence[Result], foot_span: tuple[float, float]) -> Figure:
    """Centre of pressure [mm] in the foot frame against frequency [Hz], as boxes.

    Lines at the (heel, toe) end of ground contact, `foot_span` [m], which no centre of pressure can pass.
    """
    drawn = [row for row in rows if row.valid and math.isfinite(row.freq_hz) and math.isfinite(row.cop_p50_m)]
    boxes = [
        {
            "whislo": 1e3 * row.cop_p05_m,
            "q1": 1e3 * row.cop_p25_m,
            "med": 1e3 * row.cop_p50_m,
            "q3": 1e3 * row.cop_p75_m,
            "whishi": 1e3 * row.cop_p95_m,
        }
        for row in drawn
    ]
    fig = _figure(6.5, 3.8)
    ax = fig.subplots()
    if boxes:
        ax.bxp(
            boxes,
            positions=[row.freq_hz for row in drawn],
            widths=0.5 * _spacing(rows),
            showfliers=False,
            manage_ticks=False,
            patch_artist=True,
            boxprops={"facecolor": "#CFE3F1", "edgecolor": BLUE},
            medianprops={"color": "black"},
        )
    for end, name, offset in zip(foot_span, ("heel", "toe"), (-1, 1), strict=True):
        ax.axhline(1e3 * end, color="black", ls="--", lw=1)
        ax.annotate(
            f"{name} contact ends, {1e3 * end:.0f} mm",
            (0.01, 1e3 * end),
            xycoords=("axes fraction", "data"),
            xytext=(0, 4 * offset),
            textcoords="offset points",
            va="bottom" if offset > 0 else "top",
            fontsize=8,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
        )
    ax.margins(y=0.12)
    ax.set(xlabel="target frequency [Hz]", ylabel="centre of pressure x [mm]")
    fig.suptitle("box: quartiles and median; whiskers: 5th and 95th percentile", fontsize=9)
    _mark_falls([ax], rows)
    return fig


def fig_ranges(rows: Sequence[Result]) -> Figure:
    """Peak-to-peak joint angle [deg] and torque [Nm per joint] against frequency [Hz]."""
    fig = _figure(6.5, 5.5)
    upper, lower = fig.subplots(2, 1, sharex=True)
    hip, ankle = {"color": HIP_COLOUR}, {"color": ANKLE_COLOUR}
    _line(upper, rows, lambda row: row.hip_range_deg, marker="o", label="hip", **hip)
    _line(upper, rows, lambda row: row.ankle_range_deg, marker="s", ls="--", label="ankle", **ankle)
    _theory(upper, rows, lambda row: row.least.hip_range_deg, label="hip, torque-optimal", **hip)
    _theory(upper, rows, lambda row: row.least.ankle_range_deg, label="ankle, torque-optimal", **ankle)
    _line(lower, rows, lambda row: row.hip_torque_range_nm, marker="o", **hip)
    _line(lower, rows, lambda row: row.ankle_torque_range_nm, marker="s", ls="--", **ankle)
    _theory(lower, rows, lambda row: row.least.hip_torque_range_nm, **hip)
    _theory(lower, rows, lambda row: row.least.ankle_torque_range_nm, **ankle)
    upper.set_ylim(bottom=0)
    lower.set_ylim(bottom=0)
    _mark_falls((upper, lower), rows)
    upper.set_ylabel("angle, peak-to-peak [deg]")
    lower.set(ylabel="torque, peak-to-peak\n[Nm per joint]", xlabel="target frequency [Hz]")
    fig.legend(*upper.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return fig


def _theory(ax: Axes, rows: Sequence[Result], get: Value, **style: Any) -> None:
    """A value of the torque-optimal stander as a thin dotted line; nothing where a row has none."""
    if all(row.least is not NO_LEAST for row in rows):
        _line(ax, rows, get, ls=":", lw=1.5, **style)


def fig_tracking(rows: Sequence[Result], published: Table3 | None) -> Figure:
    """Target-head correlation, head amplitude [m] and mean speed [m/s] against frequency [Hz]; Table 3."""
    panels: list[tuple[Value, Callable[[Table3], Sequence[float]], str]] = [
        (lambda row: row.target_head_r, lambda table: table.target_head_r, "target-head\ncorrelation r"),
        (lambda row: row.head_amplitude_m, lambda table: table.head_amplitude_m, "head amplitude [m]\n(half peak-to-peak)"),
        (lambda row: row.head_speed_mps, lambda table: table.head_speed_mps, "mean head\nspeed [m/s]"),
    ]
    fig = _figure(6.5, 6.5)
    axes = fig.subplots(3, 1, sharex=True)
    for ax, (get, theirs, label) in zip(axes, panels, strict=True):
        if published is not None:
            ax.plot(published.freq_hz, theirs(published), "s", mfc="none", color=RED, label="paper Table 3")
        _line(ax, rows, get, marker="o", ms=4, color="black", label="ours")
        ax.set_ylabel(label)
    _mark_falls(axes, rows)
    axes[-1].set_xlabel("target frequency [Hz]")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return fig


def _figure(width: float, height: float) -> Figure:
    """An empty figure of width x height inches."""
    return Figure(figsize=(width, height), layout="constrained")


def _grid_size(count: int) -> tuple[float, float]:
    """Width and height [inch] of a grid of `count` panels."""
    return max(2.3 * min(count, COLUMNS), 4.5), 1.9 * math.ceil(count / COLUMNS) + 0.9


def _grid(fig: Figure, count: int) -> list[Axes]:
    """`count` panels, row by row; places left over stay empty."""
    columns = min(count, COLUMNS)
    grid = fig.subplots(math.ceil(count / columns), columns, squeeze=False).ravel()
    for ax in grid[count:]:
        ax.set_axis_off()
    return list(grid[:count])


def _panels_over_time(
    trajectory: Trajectory,
    rows: Sequence[Result],
    signals: Mapping[str, tuple[Array, Mapping[str, Any]]],
    ylabel: str,
) -> Figure:
    """Signals (T, W) with their line styles over the last cycles, one panel for each world, with the same y axis."""
    windows = [_window(trajectory, row, w) for w, row in enumerate(rows)]
    fig = _figure(*_grid_size(len(rows)))
    panels = _grid(fig, len(rows))
    for w, ax in enumerate(panels):
        for name, (signal, style) in signals.items():
            ax.plot(trajectory.time[windows[w]], signal[windows[w], w], label=name, **style)
        ax.margins(x=0)
        _title(ax, rows, w)
    values = [np.stack([signal[s, w] for signal, _ in signals.values()]) for w, s in enumerate(windows)]
    _share_limits(panels, rows, values, "y")
    fig.supxlabel("time [s]", fontsize=9)
    fig.supylabel(ylabel, fontsize=9)
    fig.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(signals))
    return fig


def _window(trajectory: Trajectory, row: Result, w: int) -> slice:
    """Steps of the last SHOWN_CYCLES before the trial's end or the fall; all of them for a ramp."""
    fall = int(trajectory.fall_step[w])
    end = fall + 1 if fall >= 0 else len(trajectory.time)
    steps = SHOWN_CYCLES / (row.freq_hz * trajectory.control_dt)
    return slice(max(end - round(steps), 0) if math.isfinite(steps) else 0, end)


def _world_label(rows: Sequence[Result], w: int) -> str:
    """Frequency of the world, and its stiffness and load where they differ between worlds."""
    row = rows[w]
    label = f"{row.freq_hz:g} Hz" if math.isfinite(row.freq_hz) else "ramp"
    conditions: list[tuple[Value, str]] = [
        (lambda row: row.hip_k_nm_per_rad, "hip {:g} Nm/rad"),
        (lambda row: row.ankle_k_nm_per_rad, "ankle {:g} Nm/rad"),
        (lambda row: row.load_kg, "load {:g} kg"),
    ]
    for get, text in conditions:
        if len({get(row) for row in rows}) > 1:
            label += ", " + text.format(get(row))
    return label


def _title(ax: Axes, rows: Sequence[Result], w: int) -> None:
    """The title of a world's panel: its conditions and, where it is not valid, why."""
    if rows[w].valid:
        ax.set_title(_world_label(rows, w))
    else:
        ax.set_title(f"{_world_label(rows, w)}\n{rows[w].outcome}", color=FALL_COLOUR)


def _mark_falls(axes: Sequence[Axes], rows: Sequence[Result]) -> None:
    """Mark each world that is not valid: a line at its frequency through all panels, and above it why."""
    for row in rows:
        if row.valid or not math.isfinite(row.freq_hz):
            continue
        for ax in axes:
            ax.axvline(row.freq_hz, color=FALL_COLOUR, ls=":", zorder=0)
        top = {"rotation": 90, "ha": "center", "va": "bottom", "transform": axes[0].get_xaxis_transform()}
        axes[0].text(row.freq_hz, 1.02, row.outcome, color=FALL_COLOUR, fontsize=8, **top)


def _share_limits(panels: Sequence[Axes], rows: Sequence[Result], values: Sequence[Array], axis: str) -> None:
    """Give all panels the limits of the valid worlds, so that a fall does not compress the others."""
    held = [v for v, row in zip(values, rows, strict=True) if row.valid] or list(values)
    finite = np.concatenate([np.ravel(v) for v in held])
    finite = finite[np.isfinite(finite)]
    if not len(finite):
        return
    low, high = float(finite.min()), float(finite.max())
    margin = 0.08 * (high - low) or 1.0
    for ax in panels:
        ax.set(**{f"{axis}lim": (low - margin, high + margin)})


def _values(rows: Sequence[Result], get: Value) -> tuple[Array, Array]:
    """Frequency [Hz] and one value of the rows, along rising frequency; nan where undefined."""
    pairs = sorted(((row.freq_hz, get(row)) for row in rows), key=lambda pair: pair[0])
    table = np.array(pairs, dtype=np.float64).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def _line(ax: Axes, rows: Sequence[Result], get: Value, **style: Any) -> None:
    """A value against frequency; the points are joined only where no frequency comes twice."""
    f, values = _values(rows, get)
    if len(set(f)) < len(f):
        style = {"marker": "o", **style, "ls": "none"}
    ax.plot(f, values, **style)


def _spacing(rows: Sequence[Result]) -> float:
    """Smallest distance between two frequencies [Hz]; a tenth of the frequency where there is only one."""
    f = np.unique([row.freq_hz for row in rows if math.isfinite(row.freq_hz)])
    return float(np.diff(f).min()) if len(f) > 1 else float(f[0]) / 10


def _shade_published_modes(ax: Axes, published: Table3 | None) -> None:
    """Shade the frequencies at which paper Table 3 shows each mode, and hatch the bracket between them."""
    if published is None:
        return
    modes = list(zip(published.freq_hz, published.mode, strict=True))
    span = {name: [freq for freq, mode in modes if mode == name] for name in ("in", "anti")}
    for name, found in span.items():
        if found:
            colour = MODE_COLOUR[f"{name}-phase"]
            ax.axvspan(min(found), max(found), color=colour, alpha=0.1, lw=0, label=f"paper, {name}-phase")
    if span["in"] and span["anti"]:
        bracket = max(span["in"]), min(span["anti"])
        ax.axvspan(*bracket, facecolor="none", edgecolor="#BBBBBB", hatch="///", lw=0, label="paper, switch between")
