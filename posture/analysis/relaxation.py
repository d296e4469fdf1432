"""How fast a motion recovers from pushes: pure functions on arrays.

A pushed motion is compared with its twin, the same without the pushes, so that what is periodic in both drops out.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from posture.analysis.trajectory import Array


class Joints(NamedTuple):
    """Angles [rad] and velocities [rad/s] of hip and ankle, (T, ...) each."""

    hip: Array
    ankle: Array
    hip_velocity: Array
    ankle_velocity: Array


def phase_deviation(pushed: Joints, twin: Joints, freq: float) -> Array:
    """Relative phase hip - ankle of a pushed motion minus that of its twin [deg], -180 .. 180. Shape (T, ...).

    The phase of a joint is that of its point in the plane of angle, from the mean of the twin's, and velocity over 2 pi f,
    with f = `freq` [Hz]: angle = A cos(phase), velocity = -2 pi f A sin(phase). It is known at every moment, unlike that of
    a cycle. Source: field practice.
    """
    omega = 2 * math.pi * freq

    def relative(joints: Joints) -> Array:
        hip, ankle = joints.hip - twin.hip.mean(axis=0), joints.ankle - twin.ankle.mean(axis=0)
        return np.asarray(np.arctan2(-joints.hip_velocity / omega, hip) - np.arctan2(-joints.ankle_velocity / omega, ankle))

    return np.asarray(np.degrees(np.angle(np.exp(1j * (relative(pushed) - relative(twin))))))


def angle_deviation(pushed: Joints, twin: Joints) -> Array:
    """Distance of a pushed motion from its twin in the plane of hip and ankle angle [deg]. Shape (T, ...)."""
    return np.asarray(np.degrees(np.hypot(pushed.hip - twin.hip, pushed.ankle - twin.ankle)))


def relaxation_time(deviation: Array, dt: float) -> float:
    """Time [s] from the greatest root mean square of `deviation` (P, L) over P pushes until it stays below 1/e of it.

    The L samples are `dt` [s] apart and begin at the end of each push. Of a decay exp(-t / tau) it is tau, to one sample; of
    an oscillation that decays, that of its last excursion. nan where it does not stay below, where nothing deviates, and
    where a value is not finite. Source: field practice, relaxation time of critical slowing down.
    """
    size = np.sqrt(np.mean(np.square(deviation), axis=0))
    if not np.isfinite(size).all() or not size.max() > 0:
        return math.nan
    above = np.flatnonzero(size >= size.max() / math.e)
    return math.nan if above[-1] == len(size) - 1 else float((above[-1] + 1 - size.argmax()) * dt)
