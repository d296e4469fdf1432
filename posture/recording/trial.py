"""From a file to the indices of one recording, with the least-torque motion beside it."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from envs.body.segments import Segments
from envs.config import EnvConfig, Ramp
from posture.analysis.results import MotionIndices, Row, as_row
from posture.analysis.statistics import Interval
from posture.analysis.trajectory import Array
from posture.config.analyse import AnalyseConfig
from posture.config.errors import ConfigError
from posture.config.published import read_published
from posture.recording.columns import Recording, read_recording
from posture.recording.frequency import share_of_sinusoid, sinusoid_frequency
from posture.recording.indices import CYCLE_VALUES, Cycles, Indices, measure
from posture.recording.ramp import RampCourse, course_and_transitions, follow
from posture.recording.signals import prepare
from posture.recording.table import refuse
from posture.theory.motion import PeriodicMotion, motion_indices
from posture.theory.optimum import bound, sinusoid
from posture.theory.program import InfeasibleError
from posture.theory.stander import linearise
from posture.theory.transition import hip_ankle_correlation

SHARE_OF_A_SINUSOID = 0.5
"""Where the sinusoid of the estimated frequency explains less of the variance, there may be no such frequency."""
NO_MOTION = MotionIndices()


@dataclass(frozen=True)
class Trial:
    """What is known of one recording.

    freq_from: what the frequency was taken from: freq, target, head, ankle, hip, or ramp. explained: share of that signal's
    variance that a sinusoid of this frequency explains; with freq, of the first of these signals that moves. least: the
    motion of least torque with the same frequency and head amplitude; nan where none was asked for, or none is possible.
    """

    path: Path
    subject: str
    freq_from: str
    explained: float
    indices: Indices
    cycles: Cycles
    least: MotionIndices = NO_MOTION

    def as_row(self, with_theory: bool) -> Row:
        """As in metrics.csv: indices, then mean and interval over cycles, then theory."""
        row: Row = {"recording": str(self.path), "subject": self.subject, "freq_from": self.freq_from}
        row |= as_row(self.indices)
        intervals = self.cycles.intervals()
        for name in CYCLE_VALUES:
            mean, low, high = intervals.get(name, Interval(math.nan, math.nan, math.nan))
            row |= {f"{name}_cycle_mean": mean, f"{name}_cycle_low": low, f"{name}_cycle_high": high}
        return row | ({f"least_{name}": value for name, value in as_row(self.least).items()} if with_theory else {})

    def cycle_rows(self) -> list[Row]:
        """As in cycles.csv: one row for each cycle."""
        nothing = np.full(len(self.cycles.start), math.nan)
        columns = {name: self.cycles.values.get(name, nothing) for name in ("phase_deg", *CYCLE_VALUES)}
        return [
            {"recording": str(self.path), "subject": self.subject, "cycle": i + 1, "start_s": float(start)}
            | {name: float(values[i]) for name, values in columns.items()}
            for i, start in enumerate(self.cycles.start)
        ]


@dataclass(frozen=True, eq=False)
class Analysed:
    """A trial with its signals, for figures. course: of a ramp. motion: of least torque."""

    trial: Trial
    recording: Recording
    course: RampCourse | None = None
    motion: PeriodicMotion | None = None


def analyse(path: Path, config: AnalyseConfig, body: Segments | None = None) -> Analysed:
    """Analyse the recording in a file as `config` says; `body` is needed for the prediction only. Raises ConfigError, in one
    line that names the file."""
    recording = prepare(read_recording(path, config), config)
    evaluation = config.evaluation
    freq_t: Array | None = None
    if config.ramp is None:
        freq, freq_from, explained = _frequency(recording, config)
        _check_filters(path, config, freq)
    else:
        freq, freq_from, explained = math.nan, "ramp", math.nan
        freq_t = follow(recording, config.ramp if isinstance(config.ramp, Ramp) else None)
    try:
        indices, cycles = measure(
            recording,
            freq,
            transient_s=evaluation.transient,
            tolerance_m=evaluation.tolerance,
            still_joint_deg=evaluation.still_joint_deg,
            torque_limit=config.env.torque_limit,
        )
    except ValueError as error:
        raise refuse(path, str(error)) from None
    course = None
    if freq_t is not None:
        window = config.window or read_published().experiment_4a.window_steps * config.env.control_dt
        still = math.radians(evaluation.still_joint_deg)
        course, ramp, change = course_and_transitions(recording, freq_t, window, still)
        indices = replace(indices, ramp=ramp, change=change)
    motion = None if body is None or freq_t is not None else least_motion(body, config, freq, indices.head_amplitude_m)
    least = NO_MOTION if motion is None else motion_indices(motion, indices.duration_s)
    trial = Trial(path, subject_of(path, config.subject), freq_from, explained, indices, cycles, least)
    return Analysed(trial, recording, course, motion)


def _frequency(recording: Recording, config: AnalyseConfig) -> tuple[float, str, float]:
    """The frequency [Hz], what it was taken from, and the share of the variance that its sinusoid explains."""
    signals = {"target": recording.target, "head": recording.head, "ankle": recording.ankle, "hip": recording.hip}
    for name, signal in signals.items():
        if signal is not None:
            freq, explained = sinusoid_frequency(recording.time, signal)
            if freq > 0 and config.freq is not None:
                return config.freq, "freq", share_of_sinusoid(recording.time, signal, config.freq)
            if freq > 0:
                return freq, name, explained
    if config.freq is not None:
        return config.freq, "freq", math.nan
    raise refuse(recording.path, "no signal moves for a whole cycle, from which the frequency could be told; freq= gives it")


def _check_filters(path: Path, config: AnalyseConfig, freq: float) -> None:
    """Raise ConfigError where a filter takes away the motion at the frequency of the target [Hz]."""
    low, high = config.low_pass, config.high_pass
    for key, cutoff, is_kept in (
        ("low_pass", low, low is None or low > freq),
        ("high_pass", high, high is None or high < freq),
    ):
        if not is_kept:
            raise refuse(path, f"{key}={cutoff:g} Hz takes away its motion at {freq:.3g} Hz")


def least_motion(body: Segments, config: AnalyseConfig, freq: float, head_amplitude: float) -> PeriodicMotion | None:
    """The least-torque motion of the body in `config.env` whose head moves with `head_amplitude` [m] at `freq` [Hz]; None
    where the limits of foot and torque allow none.

    Its head may be `prediction_tolerance` off a sinusoid, and the cheapest motion stays that much behind it, so the sinusoid
    has that much more than the recorded amplitude. Where no head was recorded, the amplitude is `env.amplitude`.
    """
    tolerance = config.prediction_tolerance
    amplitude = config.env.amplitude if math.isnan(head_amplitude) else head_amplitude
    try:
        return bound(linearise(body, config.env), freq, amplitude + tolerance, tolerance)
    except InfeasibleError:
        return None


def least_correlation(body: Segments, env: EnvConfig) -> Callable[[Array], Array]:
    """The hip-ankle correlation, at frequencies (N,) [Hz], of the least-torque motion whose head moves as a sinusoid; it
    does not depend on the amplitude. The limits of foot and torque are left out."""
    stander = linearise(body, env)

    def correlations(freq: Array) -> Array:
        return np.array([hip_ankle_correlation(sinusoid(stander, float(f), 1.0, 0.0)) for f in freq])

    return correlations


def subject_of(path: Path, pattern: str | None) -> str:
    """The subject's name: what the regular expression finds in the path, or else the file's name without its ending. Raises
    ConfigError where it finds nothing."""
    if pattern is None:
        return path.stem
    match = re.search(pattern, path.as_posix())
    found = match and (match[1] if match.re.groups else match[0])
    if not found:
        raise ConfigError(f"{path}: subject={pattern} finds nothing in it")
    return str(found)
