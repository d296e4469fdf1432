"""The paper's figures over time and of the body, redrawn from trajectories of one seed: each fills the figure it is given.

Angles follow the joint axes: hip flexion is negative, and the ankle is negative when the body leans forward.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from posture.analysis.coordination import correlation
from posture.analysis.figures import SHOWN_CYCLES
from posture.analysis.ramp import ramp_frequency, window_correlation
from posture.analysis.results import Row
from posture.analysis.trajectory import Trajectory
from posture.drawing.silhouette import draw_phases
from posture.drawing.style import ANKLE_COLOUR, BLUE, FALL_COLOUR, GREY, HEAD_COLOUR, HIP_COLOUR, ORANGE, RED
from posture.reproduce.figures.seed_curves import correlation_axis, legend, published

MODE_TEXT = "hip-ankle correlation {:.2f}"
BODIES = 5  # of a cycle: its four quarters, and its end
BODY_SPACING = 0.56  # [m] between two of them


class World(NamedTuple):
    """A world of a trajectory, and what a panel is headed with."""

    trajectory: Trajectory
    number: int
    title: str


def shown_worlds(trajectory: Trajectory, wanted: Sequence[float]) -> list[World]:
    """The worlds whose frequencies come nearest to those `wanted` [Hz], each once, along rising frequency."""
    nearest = {int(np.nanargmin(np.abs(trajectory.freq - freq))) for freq in wanted}
    order = sorted(nearest, key=lambda w: trajectory.freq[w])
    return [World(trajectory, w, f"{trajectory.freq[w]:g} Hz") for w in order]


def bodies(fig: Figure, trajectory: Trajectory, target_height: float, wanted: Sequence[float]) -> None:
    """Fig. 2: the body at five instants of the last cycle, at the frequencies `wanted` [Hz], a panel each.

    `target_height` [m]. A world that fell shows the last cycle before it.
    """
    worlds = shown_worlds(trajectory, wanted)
    for ax, world in zip(fig.subplots(len(worlds), 1, squeeze=False)[:, 0], worlds, strict=True):
        _, w, title = world
        steps = cycle_steps(trajectory, w)
        foot = trajectory.foot_displacement[steps, w]
        hip, ankle, target = trajectory.hip[steps, w], trajectory.ankle[steps, w], trajectory.target_x[steps, w]
        places = draw_phases(ax, hip, ankle, target, BODY_SPACING, target_height=target_height, foot_x=foot)
        for place, step in zip(places, steps, strict=True):
            label = f"{trajectory.time[step] - trajectory.time[steps[0]]:.2f} s"
            ax.annotate(label, (place, -0.05), xytext=(0, -3), textcoords="offset points", ha="center", va="top")
        whole = slice(0, last_cycles(trajectory, w).stop)
        r = correlation(trajectory.hip[whole, w], trajectory.ankle[whole, w])
        ax.set_title(f"{title}: {MODE_TEXT.format(r)}{_fate(world)}", pad=2)


def cycle_steps(trajectory: Trajectory, w: int) -> list[int]:
    """Steps of the BODIES instants, evenly spaced, of the last whole cycle of the target before the end or the fall.

    Where there is none, the cycle is cut to what there is.
    """
    end = int(trajectory.fall_step[w])
    end = end if end >= 0 else len(trajectory.time) - 1
    period = 1 / float(trajectory.freq[w])
    cycles = max(math.floor((trajectory.time[end] - trajectory.time[0]) / period + 1e-6), 1)
    instants = (cycles - 1 + np.linspace(0, 1, BODIES)) * period / trajectory.control_dt
    return [min(round(float(step)), end) for step in instants]


def head_target(fig: Figure, worlds: Sequence[World]) -> None:
    """Fig. 3: head and target position [m] over the last cycles [s], a panel a world."""
    signals = {
        "target": (lambda trial: trial.target_x, {"color": ORANGE, "lw": 3.0}),
        "head": (lambda trial: trial.head_x, {"color": HEAD_COLOUR, "lw": 1.3}),
    }
    _over_time(fig, worlds, signals, "position x [m]", "target-head r {:.3f}")


def joint_angles(fig: Figure, worlds: Sequence[World]) -> None:
    """Fig. 4, and with the ends of the load Fig. 11: hip and ankle angle [deg] over the last cycles [s], a panel a world."""
    signals = {
        "hip (flexion negative)": (lambda trial: np.degrees(trial.hip), {"color": HIP_COLOUR, "lw": 1.8}),
        "ankle (forward lean negative)": (
            lambda trial: np.degrees(trial.ankle),
            {"color": ANKLE_COLOUR, "lw": 1.8, "ls": "--"},
        ),
    }
    _over_time(fig, worlds, signals, "angle [deg]", MODE_TEXT)


def ramp(
    fig: Figure,
    trajectory: Trajectory,
    rows: Sequence[Row],
    paper: Mapping[str, Any],
    transitions: Mapping[str, float],
    start: float,
    still_rad: float,
) -> None:
    """Fig. 10 (Exp. 4a): hip and ankle angle [deg] and their running correlation against the momentary frequency [Hz].

    The angles and the two lines are those of the one seed of `trajectory`; the marks on the zero line are the transitions of
    every seed, `rows`, beside the paper's and the span of those by theory, `transitions` [Hz]. The ramp begins at `start`
    [Hz]; a joint that moves less than `still_rad` [rad] in the window has no correlation.
    """
    told = paper["experiment_4a"]
    rate, duration, window = told["rate_hz_per_s"], told["duration_s"], int(told["window_steps"])
    upper, lower = axes = fig.subplots(2, 1, sharex=True)
    end = int(trajectory.fall_step[0])
    shown = (trajectory.time <= duration) & (np.arange(len(trajectory.time)) <= (end if end >= 0 else np.inf))
    freq = ramp_frequency(trajectory.time[shown], start, rate, duration)
    hip, ankle = trajectory.hip[shown, 0], trajectory.ankle[shown, 0]
    upper.plot(freq, np.degrees(hip), color=HIP_COLOUR, label="hip angle")
    upper.plot(freq, np.degrees(ankle), color=ANKLE_COLOUR, ls="--", label="ankle angle")
    upper.set_ylabel("angle [deg]")
    top = upper.secondary_xaxis("top", functions=(lambda f: (f - start) / rate, lambda t: start + rate * t))
    top.set_xlabel(f"time [s]{_fate(World(trajectory, 0, ''))}")
    for name, colour, marker in (("centred", BLUE, "o"), ("trailing", ORANGE, "s")):
        r = window_correlation(hip, ankle, window, centred=name == "centred", still_rad=still_rad)
        lower.plot(freq, r, color=colour, label=f"correlation, {name} window")
        at = np.array([row.get(f"transition_{name}_hz", math.nan) for row in rows if row["valid"]], dtype=np.float64)
        style = {"ms": 8, "mfc": "none", "mew": 1.5, "color": colour, "zorder": 4}
        if np.isfinite(at).any():
            lower.plot(at, np.zeros(len(at)), marker, **style, label=f"zero of a seed, {name}")
    correlation_axis(lower)
    theory = [value for value in transitions.values() if math.isfinite(value)]
    for ax in axes:
        ax.axvline(told["transition_hz"], color=RED, lw=1.5, ls="--", label=f"paper: {told['transition_hz']:g} Hz")
        if theory:
            span = f"{min(theory):.2f}-{max(theory):.2f}"
            ax.axvspan(min(theory), max(theory), color=GREY, alpha=0.35, lw=0, label=f"theory: {span} Hz", zorder=0)
    lower.set(xlabel="momentary target frequency [Hz]", xlim=(start, start + rate * duration))
    legend(fig, axes, 2)


def load_worlds(traces: Mapping[str, Trajectory]) -> list[World]:
    """The first worlds of the least and the largest load among the traces load_<kg>; none where there are not two."""
    found = {float(name.removeprefix("load_")): trial for name, trial in traces.items() if name.startswith("load_")}
    ends = (min(found), max(found)) if len(found) > 1 else ()
    return [World(found[load], 0, f"load {load:g} kg, {found[load].freq[0]:g} Hz") for load in ends]


def target_height(paper: Mapping[str, Any]) -> float | None:
    """Height of the target [m], paper Table 1; None where it is not told."""
    found = published(paper, "table_1", "target_height_m")
    return None if found is None else float(found[0])


def _over_time(fig: Figure, worlds: Sequence[World], signals: Mapping[str, Any], label: str, index: str) -> None:
    """Two signals, of a trajectory its (T, W), with their line styles over the last cycles, a panel a world, one y axis.

    Each panel is headed with the correlation of the two, as `index` words it. A fall does not widen the y axis.
    """
    axes = fig.subplots(len(worlds), 1, sharey=True, squeeze=False)[:, 0]
    held = []
    for ax, world in zip(axes, worlds, strict=True):
        trial, w, title = world
        steps, fate = last_cycles(trial, w), _fate(world)
        for name, (signal, style) in signals.items():
            ax.plot(trial.time[steps], signal(trial)[steps, w], label=name, **style)
            held += [] if fate else [signal(trial)[steps, w]]
        ax.margins(x=0)
        whole = slice(0, steps.stop)
        r = correlation(*(signal(trial)[whole, w] for signal, _ in signals.values()))
        ax.set_title(f"{title}: {index.format(r)}{fate}", color=FALL_COLOUR if fate else "black")
    if held:
        low, high = min(map(np.min, held)), max(map(np.max, held))
        axes[0].set_ylim(low - 0.07 * (high - low), high + 0.07 * (high - low))
    axes[-1].set_xlabel("time [s]")
    fig.supylabel(label, fontsize=11)
    legend(fig, axes[:1], len(signals))


def last_cycles(trajectory: Trajectory, w: int) -> slice:
    """Steps of the last SHOWN_CYCLES of world `w` before the trial's end or the fall."""
    fall = int(trajectory.fall_step[w])
    end = fall + 1 if fall >= 0 else len(trajectory.time)
    return slice(max(end - round(SHOWN_CYCLES / (float(trajectory.freq[w]) * trajectory.control_dt)), 0), end)


def _fate(world: World) -> str:
    trial, w, _ = world
    return f", fell at {trial.time[trial.fall_step[w]]:.1f} s" if trial.fall_step[w] >= 0 else ""
