"""What a film shows of one world: its signals at the instants of the frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posture.ramp import window_correlation
from posture.report.silhouette import head_position
from posture.trajectory import Array, Trajectory


@dataclass(frozen=True, eq=False)
class Take:
    """Signals of one world at F frames, all (F,), nan from a fall on. Signs and places as in `Trajectory`.

    r is the hip-ankle correlation in a window centred on the frame, positive in-phase; nan where the window reaches
    beyond the trial, or a joint hardly moves in it.
    """

    time: Array  # [s] since the trial began
    freq: Array  # [Hz] of the target
    target_x: Array  # [m]
    head_x: Array  # [m]
    hip: Array  # [rad]
    ankle: Array  # [rad]
    r: Array  # [-]

    def foot_x(self, frame: int) -> float:
        """How far the foot has moved [m], as the head's place and the two angles of flat feet give it."""
        upright, _ = head_position(self.hip[frame], self.ankle[frame])
        return float(self.head_x[frame]) - upright


def take(trajectory: Trajectory, world: int, freq: Array, instants: Array, window_steps: int, still_rad: float) -> Take:
    """World number `world` of `trajectory` at `instants` (F,) [s], linear between control steps.

    `freq` (F,) [Hz]. The correlation is over `window_steps` control steps; `still_rad` as in `window_correlation`.
    """
    hip, ankle = trajectory.hip[:, world], trajectory.ankle[:, world]
    r = window_correlation(hip, ankle, window_steps, centred=True, still_rad=still_rad)

    def at_frames(signal: Array) -> Array:
        return np.interp(instants, trajectory.time, signal)

    return Take(
        time=instants,
        freq=freq,
        target_x=at_frames(trajectory.target_x[:, world]),
        head_x=at_frames(trajectory.head_x[:, world]),
        hip=at_frames(hip),
        ankle=at_frames(ankle),
        r=at_frames(r),
    )
