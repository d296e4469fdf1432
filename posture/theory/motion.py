"""A periodic motion of the linear stander as Fourier series, and its coordination, effort and balance indices."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from envs.body.joints import ANKLE, HIP
from posture.analysis.coordination import correlation, energy, mode, torque_cost
from posture.analysis.results import MotionIndices
from posture.analysis.trajectory import Array
from posture.theory.stander import JOINTS_OF_A_KIND, Stander

CYCLE_SAMPLES = 1000
"""Instants of a cycle at which indices are read; a joint range is then short by less than 0.01 %."""


@dataclass(frozen=True, eq=False)
class PeriodicMotion:
    """q(t) = Re sum_k coefficients[k] exp(2 pi i k freq t) of `stander`, with the torques that this takes.

    coefficients: joint angles (hip, ankle) [rad], complex, shape (n + 1, 2); the constant term is real. freq [Hz]. At time 0
    the target A (1 - cos 2 pi freq t) is at its rear end, x = 0. All methods take times (T,) [s], any, and give arrays of
    (T, 2) in the order (hip, ankle), or (T,).
    """

    stander: Stander
    freq: float
    coefficients: NDArray[np.complex128]

    def angle(self, time: Array) -> Array:
        """Joint angles [rad], hip flexion and forward lean negative. (T, 2)."""
        return self._series(self.coefficients, time)

    def velocity(self, time: Array) -> Array:
        """Joint velocities [rad/s]. (T, 2)."""
        return self._series(1j * self._omega[:, None] * self.coefficients, time)

    def acceleration(self, time: Array) -> Array:
        """Joint accelerations [rad/s2]. (T, 2)."""
        return self._series(-(self._omega[:, None] ** 2) * self.coefficients, time)

    def torque(self, time: Array) -> Array:
        """Actuator torque of one joint, springs and dampers not included [Nm]. (T, 2)."""
        response = self.stander.torque_response(self._omega)
        amplitudes = np.einsum("kij,kj->ki", response, self.coefficients)
        return self.stander.torque_offset + self._series(amplitudes, time)

    def head(self, time: Array) -> Array:
        """Head along x, 0 upright [m]. (T,)."""
        return self._series((self.coefficients @ self.stander.head)[:, None], time)[:, 0]

    def cop(self, time: Array) -> Array:
        """Centre of pressure along x in the foot's frame [m]. (T,)."""
        amplitudes = np.sum(self.stander.cop_response(self._omega) * self.coefficients, axis=1)
        return self.stander.cop_offset + self._series(amplitudes[:, None], time)[:, 0]

    def cycle(self, samples: int = CYCLE_SAMPLES) -> Array:
        """Evenly spaced instants of one cycle from time 0 [s]. (samples,)."""
        return np.arange(samples) / (samples * self.freq)

    @property
    def _omega(self) -> Array:
        return 2 * math.pi * self.freq * np.arange(len(self.coefficients), dtype=np.float64)

    def _series(self, amplitudes: NDArray[np.complex128], time: Array) -> Array:
        waves = np.exp(1j * np.multiply.outer(np.asarray(time, dtype=np.float64), self._omega))
        return np.asarray((waves @ amplitudes).real)


def joint_arrays(motion: PeriodicMotion, samples: int = CYCLE_SAMPLES) -> tuple[Array, Array]:
    """Torque [Nm] and velocity [rad/s] of all four joints over one cycle, (samples, 4), order of `JOINTS`."""
    time = motion.cycle(samples)
    return (
        np.tile(motion.torque(time), JOINTS_OF_A_KIND),
        np.tile(motion.velocity(time), JOINTS_OF_A_KIND),
    )


def motion_indices(motion: PeriodicMotion, duration: float) -> MotionIndices:
    """Indices of a motion, its energy over `duration` [s]."""
    time = motion.cycle()
    angle, torque, cop, head = motion.angle(time), motion.torque(time), motion.cop(time), motion.head(time)
    hip, ankle = angle[:, HIP], angle[:, ANKLE]
    joint_torque, joint_velocity = joint_arrays(motion)
    r = correlation(hip, ankle)
    fundamental = motion.coefficients[1] if len(motion.coefficients) > 1 else np.zeros(2)
    difference = fundamental[HIP] * np.conj(fundamental[ANKLE])
    return MotionIndices(
        mode=mode(r),
        hip_ankle_r=r,
        phase_mean_deg=math.degrees(np.angle(difference)) if difference else math.nan,
        target_head_r=correlation(-np.cos(2 * math.pi * motion.freq * time), head),
        head_amplitude_m=float(np.ptp(head)) / 2,
        head_speed_mps=float(np.abs(np.diff(head, append=head[:1])).sum() * motion.freq),
        energy_j=energy(joint_torque, joint_velocity, duration / len(time)),
        cost=torque_cost(joint_torque, motion.stander.torque_limit),
        hip_range_deg=float(np.degrees(np.ptp(hip))),
        ankle_range_deg=float(np.degrees(np.ptp(ankle))),
        hip_torque_range_nm=float(np.ptp(torque[:, HIP])),
        ankle_torque_range_nm=float(np.ptp(torque[:, ANKLE])),
        hip_torque_max_nm=float(abs(torque[:, HIP]).max()),
        ankle_torque_max_nm=float(abs(torque[:, ANKLE]).max()),
        cop_min_m=float(cop.min()),
        cop_max_m=float(cop.max()),
    )
