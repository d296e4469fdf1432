"""One world of a trajectory, sampled at the frames of a film, and its running correlation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from posture.analysis.ramp import window_correlation
from posture.analysis.trajectory import Array, Trajectory
from posture.config.errors import RunError


@dataclass(frozen=True, eq=False)
class SampledTrial:
    """A stander at the F frames of a film. Arrays (F,). After a fall it keeps its last pose.

    Angles as in `Trajectory`: hip flexion is negative, and the ankle is negative when the body leans forward.
    """

    time: Array  # [s] of the film, 0 at its first frame
    freq: Array  # momentary frequency of the target [Hz]
    hip: Array  # [rad]
    ankle: Array  # [rad]
    head_x: Array  # [m]
    target_x: Array  # [m]
    foot_x: Array  # [m] how far forward the feet have moved
    r: Array  # running hip-ankle correlation, nan where undefined
    fall: float  # time of the fall [s], inf if none, negative if before the first frame

    def pose(self, i: int) -> tuple[float, float, float, float, float]:
        """Hip, ankle [rad], foot, head and target [m] at frame `i`, as `StanderView.show` takes them."""
        at = (float(signal[i]) for signal in (self.hip, self.ankle, self.foot_x, self.head_x, self.target_x))
        hip, ankle, foot, head, target = at
        return hip, ankle, foot, head, target


def sample(trajectory: Trajectory, world: int, freq: Array | float, r: Array, start: float, time: Array) -> SampledTrial:
    """World `world` at `time` (F,) [s] of a film that starts `start` [s] into the trial, interpolated linearly.

    `freq` [Hz], (F,) or one number; `r` (T,) at the control steps. Raises RunError if it fell at the first step.
    """
    step = int(trajectory.fall_step[world])
    if step == 0:
        raise RunError("the stander fell at the first step: there is nothing to film")
    upright = slice(0, step if step > 0 else None)
    now = start + time

    def at_frames(signal: Array) -> Array:
        return np.interp(now, trajectory.time[upright], signal[upright, world])

    return SampledTrial(
        time=time,
        freq=np.broadcast_to(np.asarray(freq, dtype=np.float64), time.shape),
        hip=at_frames(trajectory.hip),
        ankle=at_frames(trajectory.ankle),
        head_x=at_frames(trajectory.head_x),
        target_x=at_frames(trajectory.target_x),
        foot_x=at_frames(trajectory.foot_displacement),
        r=np.interp(now, trajectory.time, r),
        fall=float(trajectory.time[step]) - start if step > 0 else math.inf,
    )


def running_correlation(trajectory: Trajectory, world: int, steps: int, still_rad: float, *, centred: bool) -> Array:
    """Hip-ankle correlation in a window of `steps`, or of one cycle if the frequency is constant and that is longer.

    Shape (T,). The correlation over part of a cycle differs from that of the cycle. See `window_correlation`.
    """
    freq = float(trajectory.freq[world])
    if math.isfinite(freq):
        steps = max(steps, round(1 / (freq * trajectory.control_dt)))
    hip, ankle = trajectory.hip[:, world], trajectory.ankle[:, world]
    return window_correlation(hip, ankle, steps, centred=centred, still_rad=still_rad)
