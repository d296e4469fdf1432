"""What the trials show: rows of tables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from envs.body.joints import ANKLES, HIPS
from posture.analysis.coordination import (
    circular_mean_sd,
    correlation,
    cycle_phases,
    cycles,
    measure_trajectory,
    sign_change_frequency,
)
from posture.analysis.ramp import ramp_transition, window_correlation
from posture.analysis.relaxation import Joints, angle_deviation, phase_deviation, relaxation_time, typical_size
from posture.analysis.trajectory import Array, Trajectory
from posture.config.dynamics import DynamicsConfig
from posture.dynamics.courses import Step
from posture.dynamics.trials import push_starts


@dataclass(frozen=True)
class StepRow:
    """One step of a staircase: correlation, and relative phase hip - ankle by cycle, circular mean and deviation [deg].

    foot_displacement_m: of the feet from their start, at most [m]. Where they stand is the slowest state of the body.
    """

    course: str
    seed: int
    repeat: int
    rising: bool
    freq_hz: float
    fell: bool
    hip_ankle_r: float
    phase_mean_deg: float
    phase_sd_deg: float
    foot_displacement_m: float


@dataclass(frozen=True)
class SwitchRow:
    """Where the correlation changes its sign on the way up and on the way down [Hz], nan where it does not.

    width_hz: up minus down, positive where each mode lasts beyond the other's switch.
    """

    course: str
    seed: int
    repeat: int
    rising_hz: float
    falling_hz: float
    width_hz: float


@dataclass(frozen=True)
class FluctuationRow:
    """Constant frequency: correlation, and relative phase over all cycles of all repeats [deg]. falls: of `repeats`."""

    seed: int
    freq_hz: float
    repeats: int
    falls: int
    hip_ankle_r: float
    phase_mean_deg: float
    phase_sd_deg: float
    cost: float


@dataclass(frozen=True)
class RelaxationRow:
    """Pushes at one frequency: how far relative phase and joint angles deviate at most, median over the pushes [deg], and
    their relaxation times [s]. falls: of `repeats`."""

    seed: int
    freq_hz: float
    repeats: int
    falls: int
    phase_peak_deg: float
    phase_relaxation_s: float
    angle_peak_deg: float
    angle_relaxation_s: float


def steps_of(trajectory: Trajectory, steps: Sequence[Step], course: str, seed: int, config: DynamicsConfig) -> list[StepRow]:
    """A row for each step of each repeat; the first `skip` cycles of a step are not counted, and nothing after a fall."""
    rows = []
    dt, still = trajectory.control_dt, math.radians(config.evaluation.still_joint_deg)
    for world, fall in enumerate(trajectory.fall_step.tolist()):
        hip, ankle = trajectory.hip[:, world], trajectory.ankle[:, world]
        for step in steps:
            part = slice(step.first + round(config.staircase.skip / step.freq / dt), step.end)
            row = StepRow(course, seed, world, step.rising, step.freq, 0 <= fall < step.end, *4 * (math.nan,))
            if not row.fell:
                time = trajectory.time[part]
                whole = cycles(time, step.freq, 0.0)
                mean, sd = circular_mean_sd(cycle_phases(hip[part], ankle[part], time, step.freq, whole, still))
                moved = float(trajectory.foot_displacement[part, world].max())
                moving = min(np.ptp(hip[part]), np.ptp(ankle[part])) >= still
                r = correlation(hip[part], ankle[part]) if moving else math.nan
                row = replace(row, hip_ankle_r=r, phase_mean_deg=mean, phase_sd_deg=sd, foot_displacement_m=moved)
            rows.append(row)
    return rows


def switches_of_steps(rows: Sequence[StepRow]) -> list[SwitchRow]:
    """Rising and falling switch of each course, seed and repeat."""
    found = []
    for course, seed, repeat in dict.fromkeys((row.course, row.seed, row.repeat) for row in rows):
        own = [row for row in rows if (row.course, row.seed, row.repeat) == (course, seed, repeat)]
        up, down = (
            sign_change_frequency(
                [row.freq_hz for row in own if row.rising == way], [row.hip_ankle_r for row in own if row.rising == way]
            )
            for way in (True, False)
        )
        found.append(_switch(course, seed, repeat, up, down))
    return found


def switches_of_ramp(trajectory: Trajectory, freq: Array, seed: int, config: DynamicsConfig) -> list[SwitchRow]:
    """Rising and falling switch of each repeat of a ramp up and down, whose frequency is `freq` (T,) [Hz].

    The correlation is that of a centred window of `config.ramp.window` cycles at the mean frequency, of the same length in
    all of the trial, so that both ways are treated alike.
    """
    found, half = [], len(freq) // 2
    still = math.radians(config.evaluation.still_joint_deg)
    for world, fall in enumerate(trajectory.fall_step.tolist()):
        up = down = None
        if fall < 0:
            middle = 0.5 * (config.ramp.start + config.ramp.end)
            window = max(2, round(config.ramp.window / middle / trajectory.control_dt))
            r = window_correlation(
                trajectory.hip[:, world], trajectory.ankle[:, world], window, centred=True, still_rad=still
            )
            up = ramp_transition(freq[:half], r[:half]).freq_hz
            # Backwards in time the frequency rises on the way down, too.
            down = ramp_transition(freq[half:][::-1], r[half:][::-1]).freq_hz
        found.append(_switch("ramp", seed, world, up, down))
    return found


def _switch(course: str, seed: int, repeat: int, up: float | None, down: float | None) -> SwitchRow:
    rising, falling = (math.nan if freq is None else freq for freq in (up, down))
    return SwitchRow(course, seed, repeat, rising, falling, rising - falling)


def fluctuations_of(trajectory: Trajectory, seed: int, config: DynamicsConfig) -> list[FluctuationRow]:
    """A row for each frequency, over all repeats."""
    evaluation = config.evaluation
    transient, still = evaluation.transient, math.radians(evaluation.still_joint_deg)
    results = measure_trajectory(
        trajectory,
        transient_s=transient,
        tolerance_m=evaluation.tolerance,
        still_joint_deg=evaluation.still_joint_deg,
    )
    rows = []
    for freq in dict.fromkeys(trajectory.freq.tolist()):
        worlds = np.flatnonzero(trajectory.freq == freq)
        standing = [int(world) for world in worlds if results[world].valid]
        whole = cycles(trajectory.time, freq, transient)
        phases = [
            cycle_phases(trajectory.hip[:, world], trajectory.ankle[:, world], trajectory.time, freq, whole, still)
            for world in standing
        ]
        mean, sd = circular_mean_sd(np.concatenate(phases)) if phases else (math.nan, math.nan)
        r, cost = (
            float(np.mean([getattr(results[world], name) for world in standing])) if standing else math.nan
            for name in ("hip_ankle_r", "cost")
        )
        rows.append(FluctuationRow(seed, freq, len(worlds), len(worlds) - len(standing), r, mean, sd, cost))
    return rows


def relaxations_of(pushed: Trajectory, twin: Trajectory, seed: int, config: DynamicsConfig) -> list[RelaxationRow]:
    """A row for each frequency, over all pushes of all repeats that stand to the end in both trials."""
    push, dt = config.perturbation, pushed.control_dt
    ends = push_starts(push, dt) + round(push.time / dt)
    length = round((push.every - push.time) / dt) - 1
    rows = []
    for freq in dict.fromkeys(pushed.freq.tolist()):
        worlds = np.flatnonzero(pushed.freq == freq)
        standing = worlds[(pushed.fall_step[worlds] < 0) & (twin.fall_step[worlds] < 0)]
        values = [math.nan] * 4
        if len(standing):
            with_push, without = (_joints(trajectory, standing) for trajectory in (pushed, twin))
            moved = min(np.degrees(np.ptp(joint, axis=0)).min() for joint in (without.hip, without.ankle))
            phase, angle = phase_deviation(with_push, without, freq), angle_deviation(with_push, without)
            if moved < config.evaluation.still_joint_deg:
                phase = np.full_like(phase, np.nan)
            values = []
            for deviation in (phase, angle):
                after = np.concatenate([deviation[end : end + length].T for end in ends])
                size = typical_size(after)
                values += [float(size.max()), relaxation_time(size, dt)]
        rows.append(RelaxationRow(seed, freq, len(worlds), len(worlds) - len(standing), *values))
    return rows


def _joints(trajectory: Trajectory, worlds: NDArray[np.int64]) -> Joints:
    hip, ankle = (trajectory.joint_velocity[..., joints].mean(axis=-1)[:, worlds] for joints in (HIPS, ANKLES))
    return Joints(trajectory.hip[:, worlds], trajectory.ankle[:, worlds], hip, ankle)
