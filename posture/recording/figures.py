"""Figures of recordings: one of each recording, and one of a group. Drawn without pyplot, so that no window opens.

Angles are drawn in the signs of the simulated body: hip flexion and dorsiflexion negative.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from envs.body.joints import ANKLE, HIP
from posture.analysis.trajectory import Array
from posture.drawing.style import ANKLE_COLOUR, GREY, HEAD_COLOUR, HIP_COLOUR, MODE_COLOUR, ORANGE, styled
from posture.recording.group import ALL, GroupRow
from posture.recording.trial import Analysed, Trial

SHOWN_CYCLES = 3
"""At the end of a trial, in figures over time."""
BINS = 24
"""Of a rose."""
MOST_POINTS = 2000
"""Samples of a line; more cannot be seen."""


def png(figure: Figure) -> bytes:
    """A figure as a PNG file."""
    picture = io.BytesIO()
    with styled():
        figure.savefig(picture, format="png")
    return picture.getvalue()


def recording_figure(analysed: Analysed) -> Figure:
    """The figure of one recording."""
    with styled():
        return _ramp_figure(analysed) if analysed.course is not None else _cycles_figure(analysed)


def _cycles_figure(analysed: Analysed) -> Figure:
    """Angles, head and target over the last cycles; hip against ankle with the least-torque motion; the relative phase of
    each cycle, with its mean."""
    trial, recording = analysed.trial, analysed.recording
    fig = Figure(figsize=(10.0, 5.6))
    grid = fig.add_gridspec(2, 3, left=0.07, right=0.98, bottom=0.09, top=0.87, wspace=0.33, hspace=0.42)
    over_time, loop = fig.add_subplot(grid[0, :2]), fig.add_subplot(grid[0, 2])
    head, phases = fig.add_subplot(grid[1, 0]), fig.add_subplot(grid[1, 1:])
    shown = _last_cycles(recording.time, trial.indices.freq_hz)
    time, hip, ankle = recording.time[shown], np.degrees(recording.hip[shown]), np.degrees(recording.ankle[shown])
    over_time.plot(time, hip, color=HIP_COLOUR, label="hip")
    over_time.plot(time, ankle, color=ANKLE_COLOUR, ls="--", label="ankle")
    over_time.set(xlabel="time [s]", ylabel="angle [deg]")
    over_time.set_title("flexion and dorsiflexion negative", loc="left")
    _legend_above(over_time)
    loop.plot(ankle, hip, color=MODE_COLOUR[trial.indices.mode], lw=1.0, label="recording")
    if analysed.motion is not None:
        angle = np.degrees(analysed.motion.angle(analysed.motion.cycle(200)))
        about = angle - angle.mean(axis=0) + [np.nanmean(hip), np.nanmean(ankle)]
        loop.plot(about[:, ANKLE], about[:, HIP], color="black", ls=":", label="least torque")
        loop.legend(loc="best")
    loop.set(xlabel="ankle [deg]", ylabel="hip [deg]", title=f"r = {trial.indices.hip_ankle_r:.2f}, {trial.indices.mode}")
    if recording.head is None:
        head.set_axis_off()
        head.set_title("no head recorded")
    else:
        if recording.target is not None:
            head.plot(time, recording.target[shown], color=ORANGE, lw=2.5, label="target")
        head.plot(time, recording.head[shown], color=HEAD_COLOUR, lw=1.0, label="head")
        head.set(xlabel="time [s]", ylabel="position x [m]")
        _legend_above(head)
    angles = trial.cycles.values.get("phase_deg", np.empty(0))
    begin = 0.0 if abs(trial.indices.phase_mean_deg) > 90 else -180.0  # of the circle, so that it does not open at the mean
    phases.plot(trial.cycles.start, _within(angles, begin), "o", ms=3, color=GREY, label="each cycle")
    for value, style, label in (
        (trial.indices.phase_mean_deg, "-", "circular mean"),
        (trial.indices.hilbert_mean_deg, ":", "Hilbert"),
    ):
        if math.isfinite(value):
            phases.axhline(_within(value, begin), color="black", ls=style, lw=1.0, label=label)
    phases.set(xlabel="start of the cycle [s]", ylabel="hip - ankle phase [deg]", ylim=(begin - 10, begin + 370))
    phases.set_yticks(begin + np.arange(0, 361, 90))
    _legend_above(phases)
    fig.suptitle(f"{trial.path.name}: {trial.indices.freq_hz:.3g} Hz, {trial.indices.cycles} cycles", fontsize=10)
    return fig


def _ramp_figure(analysed: Analysed) -> Figure:
    """Angles over time; the running correlation and the relative phase against the target's momentary frequency, with the
    transitions."""
    trial, recording, course = analysed.trial, analysed.recording, analysed.course
    assert course is not None
    fig = Figure(figsize=(7.5, 7.0))
    upper, middle, lower = fig.subplots(3, 1)
    fig.subplots_adjust(left=0.11, right=0.97, bottom=0.08, top=0.93, hspace=0.42)
    shown = slice(None, None, max(1, len(recording.time) // MOST_POINTS))
    upper.plot(recording.time[shown], np.degrees(recording.hip[shown]), color=HIP_COLOUR, lw=0.8, label="hip")
    upper.plot(recording.time[shown], np.degrees(recording.ankle[shown]), color=ANKLE_COLOUR, lw=0.8, label="ankle")
    upper.set(xlabel="time [s]", ylabel="angle [deg]")
    upper.legend(loc="upper left", ncols=2)
    middle.plot(course.freq, course.r, color="black", lw=1.0)
    middle.axhline(0, color=GREY, lw=0.8)
    middle.set(ylabel="running hip-ankle r", ylim=(-1.08, 1.08))
    lower.plot(course.freq, np.abs(course.phase), ".", ms=2, color=GREY)
    lower.set(
        xlabel="frequency of the target [Hz]", ylabel="|relative phase| [deg]", ylim=(-8, 188), yticks=range(0, 181, 45)
    )
    ramp, change = trial.indices.ramp, trial.indices.change
    for ax, value, style, label in (
        (middle, ramp.transition_centred_hz, "-", "centred window"),
        (middle, ramp.transition_trailing_hz, "--", "trailing window"),
        (lower, change.change_point_hz, "-", "change point"),
    ):
        if math.isfinite(value):
            ax.axvline(value, color=MODE_COLOUR["anti-phase"], ls=style, lw=1.2, label=f"{label}, {value:.2f} Hz")
            ax.legend(loc="best")
    fig.suptitle(trial.path.name, fontsize=9)
    return fig


def group_figure(
    trials: Sequence[Trial], rows: Sequence[GroupRow], theory: Callable[[Array], Array] | None = None
) -> Figure:
    """The figure of a group: a rose of the relative phases of all cycles, by the mode of their recordings; correlation and
    relative phase of each subject and of all, with 95 % intervals, against frequency.

    `theory`: the hip-ankle correlation of the motion of least torque at frequencies (N,) [Hz], a dotted line.
    """
    with styled():
        fig = Figure(figsize=(10.5, 3.9))
        grid = fig.add_gridspec(1, 3, left=0.04, right=0.98, bottom=0.14, top=0.84, wspace=0.3)
        rose = fig.add_subplot(grid[0], projection="polar")
        correlations, phases = fig.add_subplot(grid[1]), fig.add_subplot(grid[2])
        modes = [mode for mode in MODE_COLOUR if any(trial.indices.mode == mode for trial in trials)]
        nothing: Array = np.empty(0)
        _rose(
            rose,
            [
                (
                    np.concatenate(
                        [one.cycles.values.get("phase_deg", nothing) for one in trials if one.indices.mode == mode]
                    ),
                    MODE_COLOUR[mode],
                )
                for mode in modes
            ],
        )
        together = [row for row in rows if row.subject == ALL and math.isfinite(row.freq_hz)]
        for row in together:
            _arrow(rose, row.phase_mean_deg, row.phase_resultant)
        rose.set_title("hip - ankle phase of all cycles", pad=14)
        subjects = list(dict.fromkeys(row.subject for row in rows if row.subject != ALL))
        for subject in subjects:
            own = [row for row in rows if row.subject == subject and math.isfinite(row.freq_hz)]
            style: dict[str, Any] = {"color": GREY, "lw": 0.7, "marker": "o", "ms": 3}
            correlations.plot([row.freq_hz for row in own], [row.r_mean for row in own], **style)
            phases.plot([row.freq_hz for row in own], [_unsigned(row.phase_mean_deg) for row in own], **style)
        freq = np.array([row.freq_hz for row in together])
        if theory is not None and len(freq):
            fine = np.linspace(freq.min(), freq.max(), 400) if len(freq) > 1 else freq
            correlations.plot(fine, theory(fine), color="black", ls=":", label="least torque")
        _means(correlations, freq, [(row.r_mean, row.r_low, row.r_high) for row in together])
        _means(phases, freq, [(_unsigned(row.phase_mean_deg), *_width(row)) for row in together])
        correlations.axhline(0, color="black", lw=0.8)
        correlations.set(xlabel="frequency [Hz]", ylabel="hip-ankle correlation r", ylim=(-1.08, 1.08))
        phases.set(xlabel="frequency [Hz]", ylabel="|relative phase| [deg]", ylim=(-8, 188), yticks=range(0, 181, 45))
        if len(freq):
            correlations.legend(loc="best")
        fig.suptitle(f"{len(subjects)} subjects, {len(trials)} recordings", fontsize=9)
        return fig


def _legend_above(ax: Axes) -> None:
    """A legend over the right end of the axes."""
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 0.99), ncols=3, borderaxespad=0.0, columnspacing=1.0, handlelength=1.5)


def _within(angle_deg: Any, begin: float) -> Any:
    """Angles [deg] on the circle that begins at `begin`."""
    return (angle_deg - begin) % 360 + begin


def _last_cycles(time: Array, freq: float) -> slice:
    """Samples of the last cycles, thinned to what can be seen."""
    begin = int(np.searchsorted(time, time[-1] - SHOWN_CYCLES / freq))
    return slice(begin, None, max(1, (len(time) - begin) // MOST_POINTS))


def _rose(ax: Axes, groups: Sequence[tuple[Array, str]]) -> None:
    """Histograms of angles [deg] around a circle, 0 to the right; areas are proportional to counts. The highest bar has the
    radius 1."""
    edges = np.linspace(-math.pi, math.pi, BINS + 1)
    counts = [np.histogram(np.radians(angles[np.isfinite(angles)]), edges)[0] for angles, _ in groups]
    most = max((int(own.max()) for own in counts), default=0) or 1
    for own, (_, colour) in zip(counts, groups, strict=True):
        ax.bar(edges[:-1], np.sqrt(own / most), width=2 * math.pi / BINS, align="edge", color=colour, alpha=0.6, lw=0)
    ax.set(ylim=(0, 1.05), yticks=[], xticks=np.radians(range(0, 360, 45)))
    ax.tick_params(labelsize=7, pad=-2)


def _arrow(ax: Axes, mean_deg: float, length: float) -> None:
    """The mean resultant of a rose."""
    if math.isfinite(mean_deg):
        ax.annotate("", (math.radians(mean_deg), length), (0, 0), arrowprops={"arrowstyle": "->", "lw": 1.5})


def _unsigned(phase_deg: float) -> float:
    return abs((phase_deg + 180) % 360 - 180)


def _width(row: GroupRow) -> tuple[float, float]:
    """The ends of an interval about the unsigned phase."""
    half = (row.phase_high_deg - row.phase_low_deg) / 2
    return _unsigned(row.phase_mean_deg) - half, _unsigned(row.phase_mean_deg) + half


def _means(ax: Axes, freq: Array, values: Sequence[tuple[float, float, float]]) -> None:
    """Means with their intervals, where there are any."""
    if not values:
        return
    mean, low, high = np.array(values).T
    error = np.nan_to_num(np.abs(np.stack([mean - low, high - mean])))
    ax.errorbar(freq, mean, error, fmt="s-", ms=5, color="black", capsize=3, label="mean of subjects, 95 %")
