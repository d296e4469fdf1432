"""Motions of the linear stander that cost least: mean over time of the sum over the four joints of a^2, a = tau / limit.

**Closed form** (`sinusoid`). The head is to move as X - B cos(omega t). One amplitude is given, the head's; two are free,
the joints'. With n = (J_ankle, -J_hip), which leaves the head where it is, and p = J / |J|^2, which moves it by one,

    Q = -B p + s n,   T = Z Q,   Z = (K - omega^2 M + i omega D) / 2.

|T|^2 is least where T has nothing left along Z n, so s = B (Z n)^H Z p / |Z n|^2. The constant part follows from the same
with omega = 0, X for -B and the torques that hold the body upright added. The two do not mix, since the mean of the squares
over a cycle is |tau_0|^2 + |T|^2 / 2. So correlation, phase and ratio of the joints depend neither on B nor on X.

**The bound** (`bound`). Any periodic motion within the tolerance, inside the foot and the torque limit:
`posture.theory.program`.
It is the least cost that the linear model allows; the terms of second order in the angles, which the simulator has, are left
out.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from posture.theory.motion import PeriodicMotion
from posture.theory.program import Program
from posture.theory.stander import Stander


def sinusoid(stander: Stander, freq: float, amplitude: float, offset: float) -> PeriodicMotion:
    """The least-cost motion at `freq` [Hz] whose head moves as offset - amplitude cos(omega t) [m].

    Foot and torque limits are ignored; `PeriodicMotion.cop` and `PeriodicMotion.torque` give what the motion needs.
    """
    J = stander.head
    needed, idle = J / (J @ J), np.array([J[1], -J[0]])
    constant, wave = stander.torque_response(np.array([0.0, 2 * math.pi * freq]))

    def least(response: NDArray[np.complex128], head: float, torque: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Joint angles (2,) that move the head by `head` with the least |response q + torque|."""
        fixed, free = response @ (head * needed) + torque, response @ idle
        return head * needed - idle * (np.vdot(free, fixed) / np.vdot(free, free))

    return PeriodicMotion(
        stander,
        freq,
        np.array([least(constant, offset, stander.torque_offset), least(wave, -amplitude, np.zeros(2))]),
    )


def cheapest_sinusoid(stander: Stander, freq: float, amplitude: float, tolerance: float) -> PeriodicMotion:
    """`sinusoid` about the middle of the target's path with the smallest amplitude that stays within the tolerance [m]."""
    return sinusoid(stander, freq, amplitude - tolerance, amplitude)


def bound(stander: Stander, freq: float, amplitude: float, tolerance: float) -> PeriodicMotion:
    """The least-cost periodic motion at `freq` [Hz] whose head stays within `tolerance` of amplitude (1 - cos(omega t)) [m],
    with the centre of pressure inside the foot and the torques within their limit.

    Raises InfeasibleError where there is none.
    """
    program = Program(stander, freq, amplitude, tolerance)
    return program.motion(program.least_torque())
