"""The transition in a recording whose target becomes faster or slower: by the running correlation, and as a change point."""

from __future__ import annotations

import importlib.util
import math
from dataclasses import dataclass

import numpy as np

from envs.config import Ramp
from posture.analysis.ramp import RampTransition, ramp_frequency, ramp_transition, window_correlation
from posture.analysis.results import RampTransitions
from posture.analysis.trajectory import Array
from posture.config.errors import ConfigError
from posture.recording.columns import Recording
from posture.recording.frequency import momentary_frequency
from posture.recording.indices import ChangePoint, hilbert_phases
from posture.recording.table import refuse

MOST_HZ = 80.0
"""Sampling rate above which the correlation runs over every second, third, .. sample: it needs time and memory for each
window."""
CHANGE_HZ = 10.0
"""Samples a second of the relative phase in which the change point is looked for."""


@dataclass(frozen=True, eq=False)
class RampCourse:
    """What happens in a ramp, N samples each: time [s], momentary frequency of the target [Hz], correlation of hip and
    ankle in a centred window, and their relative phase [deg] by the Hilbert transform, nan where undefined."""

    time: Array
    freq: Array
    r: Array
    phase: Array


def check_installed() -> None:
    """Raise ConfigError if ruptures is missing."""
    if importlib.util.find_spec("ruptures") is None:
        raise ConfigError("ramp needs ruptures, which is not installed: python -m pip install ruptures")


def follow(recording: Recording, ramp: Ramp | None) -> Array:
    """Momentary frequency of the target [Hz] at each sample, (T,): that of `ramp`, or estimated from target or head. Raises
    ConfigError where it cannot be."""
    if ramp is not None:
        return ramp_frequency(recording.time, ramp.start, ramp.rate, ramp.duration)
    signal = recording.head if recording.target is None else recording.target
    if signal is None:
        raise refuse(recording.path, "has neither target nor head, from which ramp=estimate could tell the frequency")
    freq = momentary_frequency(recording.time, signal)
    if np.isnan(freq).any():
        raise refuse(recording.path, "its target or head makes fewer than three strokes, too few for a frequency")
    return freq


def course_and_transitions(
    recording: Recording, freq: Array, window_s: float, still: float
) -> tuple[RampCourse, RampTransitions, ChangePoint]:
    """The course of a ramp, and the frequency of its transition, by a centred and a trailing window of `window_s` [s] and
    as a change point.

    `freq` (T,) [Hz] as from `follow`. A joint that moves less than `still` [rad] in a window, or about a sample, has no
    coordination there. Where the frequency falls, the transition is the last change from anti-phase to in-phase.
    """
    rate = (len(recording.time) - 1) / (recording.time[-1] - recording.time[0])
    every = max(1, math.ceil(rate / MOST_HZ))
    time, hip, ankle, thinned = (values[::every] for values in (recording.time, recording.hip, recording.ankle, freq))
    window = max(2, round(window_s * rate / every))
    way = 1.0 if freq[-1] >= freq[0] else -1.0
    found: dict[str, RampTransition] = {}
    running = {}
    for name, centred in (("centred", True), ("trailing", False)):
        running[name] = window_correlation(hip, ankle, window, centred=centred, still_rad=still)
        found[name] = ramp_transition(way * thinned, way * running[name])
    band = max(float(freq.min()) / 2, 1 / (recording.time[-1] - recording.time[0])), 2 * float(freq.max())
    phase = hilbert_phases(recording.hip, recording.ankle, recording.time, band, 0.5 / float(freq.max()), still)
    transitions = RampTransitions(
        transition_centred_hz=_frequency(found["centred"], way),
        crossings_centred=found["centred"].crossings,
        transition_trailing_hz=_frequency(found["trailing"], way),
        crossings_trailing=found["trailing"].crossings,
    )
    course = RampCourse(time, thinned, running["centred"], phase[::every])
    return course, transitions, change_point(recording.time, freq, phase)


def _frequency(transition: RampTransition, way: float) -> float:
    return math.nan if transition.freq_hz is None else way * transition.freq_hz


def change_point(time: Array, freq: Array, phase: Array) -> ChangePoint:
    """Where the relative phase `phase` (T,) [deg] changes from one mode to the other, at `time` (T,) [s] and `freq` (T,)
    [Hz].

    Its direction (cos, sin) is divided into two stretches such that the squared distances from the mean of each are least,
    exactly, by ruptures (Truong, Oudre and Vayatis 2020). It counts where one stretch is in-phase on average and the other
    in anti-phase: from in-phase to anti-phase if the frequency rises, the other way round if it falls.
    """
    import ruptures

    every = max(1, round((len(time) - 1) / (time[-1] - time[0]) / CHANGE_HZ))
    known = np.flatnonzero(np.isfinite(phase))[::every]
    if len(known) < 4:
        return ChangePoint()
    angle = np.radians(phase[known])
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    split = int(ruptures.KernelCPD(kernel="linear", min_size=2).fit(direction).predict(n_bkps=1)[0])
    before, after = (float(part[:, 0].mean()) for part in (direction[:split], direction[split:]))
    if not (before > 0 > after if freq[-1] >= freq[0] else before < 0 < after):
        return ChangePoint()
    at = (known[split - 1] + known[split]) // 2
    return ChangePoint(float(freq[at]), float(time[at]))
