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


def typical_size(deviation: Array) -> Array:
    """Median over P pushes of the size of `deviation` (P, L), at each of the L samples after a push. (L,), in its unit.

    The median, since the phase of a joint that happens to be near its mean and slow may be anything.
    """
    return np.asarray(np.median(np.abs(deviation), axis=0))


def relaxation_time(size: Array, dt: float) -> float:
    """Time [s] from the greatest deviation until it stays below 1/e of that, both counted from where it comes to rest.

    size: (L,) of the deviation, samples `dt` [s] apart from the end of a push on. It rests where it is on average in the
    last quarter, which need not be at zero, since a push may move the feet. Of a decay exp(-t / tau) it is tau, to one
    sample; of an oscillation that decays, the time of its last excursion. nan where it does not stay below, where nothing
    deviates, and where a value is not finite. Source: field practice, relaxation time of critical slowing down.
    """
    excess = size - size[-len(size) // 4 :].mean()
    if not np.isfinite(excess).all() or not excess.max() > 0:
        return math.nan
    above = np.flatnonzero(excess >= excess.max() / math.e)
    return math.nan if above[-1] == len(size) - 1 else float((above[-1] + 1 - excess.argmax()) * dt)
