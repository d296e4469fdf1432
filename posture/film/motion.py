"""What a film shows: one world of a trajectory at the moments of its frames."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from posture.analysis.ramp import window_correlation
from posture.analysis.trajectory import Array, Trajectory
from posture.config.errors import RunError


@dataclass(frozen=True, eq=False)
class Motion:
    """A stander at the F frames of a film. Arrays (F,). After a fall it keeps its last pose.

    Angles as in `Trajectory`: hip flexion is negative, and the ankle is negative when the body leans forward.
    """

    time: Array  # [s] of the film, 0 at its first frame
    freq: Array  # momentary frequency of the target [Hz]
    hip: Array  # [rad]
    ankle: Array  # [rad]
    head_x: Array  # [m]
    target_x: Array  # [m]
    foot_x: Array  # [m] how far forward the feet have crept
    r: Array  # running hip-ankle correlation, nan where it is not defined
    fall: float  # [s] of the film, inf without one; negative where it was before the first frame


def at_frames(trajectory: Trajectory, world: int, freq: Array | float, r: Array, start: float, time: Array) -> Motion:
    """World `world` at `time` (F,) [s] of a film that begins at `start` [s] of the trial, linear between control steps.

    `freq` [Hz], (F,) or one number; `r` (T,), of the control steps. Raises RunError where it fell at once.
    """
    step = int(trajectory.fall_step[world])
    if step == 0:
        raise RunError("the stander fell at the first step: there is nothing to film")
    whole = slice(0, step if step > 0 else None)
    known, now = trajectory.time[whole], start + time

    def of(signal: Array) -> Array:
        return np.interp(now, known, signal[whole, world])

    return Motion(
        time=time,
        freq=np.broadcast_to(np.asarray(freq, dtype=np.float64), time.shape),
        hip=of(trajectory.hip),
        ankle=of(trajectory.ankle),
        head_x=of(trajectory.head_x),
        target_x=of(trajectory.target_x),
        foot_x=of(trajectory.foot_displacement),
        r=np.interp(now, trajectory.time, r),
        fall=float(trajectory.time[step]) - start if step > 0 else math.inf,
    )


def running_correlation(trajectory: Trajectory, world: int, steps: int, still_rad: float, *, centred: bool) -> Array:
    """Hip-ankle correlation in a window of `steps`, but of a cycle at least where the target has one frequency. (T,).

    A part of a cycle would show how the joints move in that part, not how they are coordinated. See `window_correlation`.
    """
    freq = float(trajectory.freq[world])
    if math.isfinite(freq):
        steps = max(steps, round(1 / (freq * trajectory.control_dt)))
    hip, ankle = trajectory.hip[:, world], trajectory.ankle[:, world]
    return window_correlation(hip, ankle, steps, centred=centred, still_rad=still_rad)
