"""The paper's figures over time and of the body, redrawn from trajectories of one seed: each function fills a given figure.

Angles follow the joint axes: hip flexion is negative, and the ankle is negative when the body leans forward.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from posture.analysis.coordination import correlation
from posture.analysis.figures import SHOWN_CYCLES
from posture.analysis.ramp import ramp_frequency, window_correlation
from posture.analysis.results import Result
from posture.analysis.trajectory import Array, Trajectory
from posture.config.published import Experiment4a
from posture.drawing.silhouette import draw_phases
from posture.drawing.style import ANKLE_COLOUR, BLUE, FALL_COLOUR, GREY, HEAD_COLOUR, HIP_COLOUR, ORANGE, RED
from posture.reproduce.claims.ramp import WINDOWS
from posture.reproduce.claims.verdict import Transitions
from posture.reproduce.figures.seed_curves import correlation_axis, legend

MODE_TEXT = "hip-ankle correlation {:.2f}"
BODIES = 5  # in a cycle: its four quarters and its end
BODY_SPACING = 0.56  # [m] between two bodies


Signal = tuple[Callable[[Trajectory], Array], dict[str, Any]]
"""A signal (T, W) of a trajectory, and its line style."""


class World(NamedTuple):
    """A world of a trajectory, and the title of its panel."""

    trajectory: Trajectory
    number: int
    title: str


def shown_worlds(trajectory: Trajectory, wanted: Sequence[float]) -> list[World]:
    """The worlds with the frequencies closest to those `wanted` [Hz], each once, along rising frequency."""
    nearest = {int(np.nanargmin(np.abs(trajectory.freq - freq))) for freq in wanted}
    order = sorted(nearest, key=lambda w: trajectory.freq[w])
    return [World(trajectory, w, f"{trajectory.freq[w]:g} Hz") for w in order]


def bodies(fig: Figure, trajectory: Trajectory, wanted: Sequence[float]) -> None:
    """Fig. 2: the body at five instants of the last cycle before the end or a fall; a panel for each of the frequencies
    `wanted` [Hz]."""
    worlds = shown_worlds(trajectory, wanted)
    for ax, world in zip(fig.subplots(len(worlds), 1, squeeze=False)[:, 0], worlds, strict=True):
        _, w, title = world
        steps = cycle_steps(trajectory, w)
        foot = trajectory.foot_displacement[steps, w]
        hip, ankle, target = trajectory.hip[steps, w], trajectory.ankle[steps, w], trajectory.target_x[steps, w]
        places = draw_phases(ax, hip, ankle, target, BODY_SPACING, foot_x=foot) if steps else ()
        for place, step in zip(places, steps, strict=True):
            label = f"{trajectory.time[step] - trajectory.time[steps[0]]:.2f} s"
            ax.annotate(label, (place, -0.05), xytext=(0, -3), textcoords="offset points", ha="center", va="top")
        ax.set_axis_off()
        r = _correlation(world, trajectory.hip, trajectory.ankle)
        ax.set_title(f"{title}: {MODE_TEXT.format(r)}{_fall(world)}", pad=2)


def cycle_steps(trajectory: Trajectory, w: int) -> list[int]:
    """Steps of BODIES instants, evenly spaced, of the last whole cycle of the target before the end or a fall.

    If there is no whole cycle, they end there. Empty after a fall at the first step, of which nothing is recorded.
    """
    end = recorded_steps(trajectory, w) - 1
    if end < 0:
        return []
    period = 1 / float(trajectory.freq[w])
    cycles = max(math.floor((trajectory.time[end] - trajectory.time[0]) / period + 1e-6), 1)
    instants = (cycles - 1 + np.linspace(0, 1, BODIES)) * period / trajectory.control_dt
    return [min(round(float(step)), end) for step in instants]


def head_target(fig: Figure, worlds: Sequence[World]) -> None:
    """Fig. 3: head and target position [m] over the last cycles [s], a panel for each world."""
    signals: dict[str, Signal] = {
        "target": (lambda trial: trial.target_x, {"color": ORANGE, "lw": 3.0}),
        "head": (lambda trial: trial.head_x, {"color": HEAD_COLOUR, "lw": 1.3}),
    }
    _over_time(fig, worlds, signals, "position x [m]", "target-head r {:.3f}")


def joint_angles(fig: Figure, worlds: Sequence[World]) -> None:
    """Fig. 4, and Fig. 11 with the loads: hip and ankle angle [deg] over the last cycles [s], a panel for each world."""
    signals: dict[str, Signal] = {
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
    results: Sequence[Result],
    published: Experiment4a,
    transitions: Transitions,
    start: float,
    still_rad: float,
) -> None:
    """Fig. 10 (Exp. 4a): hip and ankle angle [deg] and their running correlation against the momentary frequency [Hz].

    The lines are those of one seed, `trajectory`; the marks on the zero line are the transitions of every seed, `results`,
    beside that of the paper and the span of those in theory. The ramp begins at `start` [Hz]; a joint that moves less than
    `still_rad` [rad] in a window has no correlation.
    """
    rate, duration = published.rate_hz_per_s, published.duration_s
    upper, lower = axes = fig.subplots(2, 1, sharex=True)
    shown = (trajectory.time <= duration) & (np.arange(len(trajectory.time)) < recorded_steps(trajectory, 0))
    freq = ramp_frequency(trajectory.time[shown], start, rate, duration)
    hip, ankle = trajectory.hip[shown, 0], trajectory.ankle[shown, 0]
    upper.plot(freq, np.degrees(hip), color=HIP_COLOUR, label="hip angle")
    upper.plot(freq, np.degrees(ankle), color=ANKLE_COLOUR, ls="--", label="ankle angle")
    upper.set_ylabel("angle [deg]")
    top = upper.secondary_xaxis("top", functions=(lambda f: (f - start) / rate, lambda t: start + rate * t))
    top.set_xlabel(f"time [s]{_fall(World(trajectory, 0, ''))}")
    for (name, read), colour, marker in zip(WINDOWS.items(), (BLUE, ORANGE), "os", strict=True):
        r = window_correlation(hip, ankle, published.window_steps, centred=name == "centred", still_rad=still_rad)
        lower.plot(freq, r, color=colour, label=f"correlation, {name} window")
        at = np.array([read(result.ramp)[0] for result in results if result.valid], dtype=np.float64)
        style = {"ms": 8, "mfc": "none", "mew": 1.5, "color": colour, "zorder": 4}
        if np.isfinite(at).any():
            lower.plot(at, np.zeros(len(at)), marker, **style, label=f"zero of a seed, {name}")
    correlation_axis(lower)
    theory = [hz for hz in (transitions.least, transitions.reward, transitions.sinusoid) if math.isfinite(hz)]
    for ax in axes:
        ax.axvline(published.transition_hz, color=RED, lw=1.5, ls="--", label=f"paper: {published.transition_hz:g} Hz")
        if theory:
            label = f"theory: {min(theory):.2f}-{max(theory):.2f} Hz"
            ax.axvspan(min(theory), max(theory), color=GREY, alpha=0.35, lw=0, label=label, zorder=0)
    lower.set(xlabel="momentary target frequency [Hz]", xlim=(start, start + rate * duration))
    legend(fig, axes, 2)


def load_worlds(by_load: Mapping[float, Trajectory]) -> list[World]:
    """The first world at the smallest and at the largest load [kg]; none if there are not two."""
    ends = (min(by_load), max(by_load)) if len(by_load) > 1 else ()
    return [World(by_load[load], 0, f"load {load:g} kg, {by_load[load].freq[0]:g} Hz") for load in ends]


def _over_time(fig: Figure, worlds: Sequence[World], signals: Mapping[str, Signal], label: str, title_text: str) -> None:
    """Two signals over the last cycles, a panel for each world, with one y axis that a fall does not widen.

    Each panel's title has the correlation of the two, in the format `title_text`.
    """
    axes = fig.subplots(len(worlds), 1, sharey=True, squeeze=False)[:, 0]
    held = []
    for ax, world in zip(axes, worlds, strict=True):
        trial, w, title = world
        steps, fall = last_cycles(trial, w), _fall(world)
        for name, (signal, style) in signals.items():
            ax.plot(trial.time[steps], signal(trial)[steps, w], label=name, **style)
            held += [] if fall else [signal(trial)[steps, w]]
        ax.margins(x=0)
        r = _correlation(world, *(signal(trial) for signal, _ in signals.values()))
        ax.set_title(f"{title}: {title_text.format(r)}{fall}", color=FALL_COLOUR if fall else "black")
    if held:
        low, high = min(map(np.min, held)), max(map(np.max, held))
        axes[0].set_ylim(low - 0.07 * (high - low), high + 0.07 * (high - low))
    axes[-1].set_xlabel("time [s]")
    fig.supylabel(label, fontsize=11)
    legend(fig, axes[:1], len(signals))


def last_cycles(trajectory: Trajectory, w: int) -> slice:
    """Steps of the last SHOWN_CYCLES of world `w` before the trial's end or a fall."""
    end = recorded_steps(trajectory, w)
    return slice(max(end - round(SHOWN_CYCLES / (float(trajectory.freq[w]) * trajectory.control_dt)), 0), end)


def recorded_steps(trajectory: Trajectory, w: int) -> int:
    """Number of control steps of world `w` before the trial's end or a fall, from which on its record is nan."""
    fall_step = int(trajectory.fall_step[w])
    return fall_step if fall_step >= 0 else len(trajectory.time)


def _correlation(world: World, a: Array, b: Array) -> float:
    """Of two signals (T, W) before the trial's end or a fall; nan where nothing is recorded."""
    steps = recorded_steps(world.trajectory, world.number)
    return correlation(a[:steps, world.number], b[:steps, world.number]) if steps else math.nan


def _fall(world: World) -> str:
    trial, w, _ = world
    return f", fell at {trial.time[trial.fall_step[w]]:.1f} s" if trial.fall_step[w] >= 0 else ""
