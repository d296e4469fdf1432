"""The exact two-link stander: feet flat and still, left and right moving as one, angles of any size. And its least cost.

Coordinates, signs and symbols are those of `posture.theory.stander`; R(theta) (x, z) = (x cos + z sin, -x sin + z cos) turns
a point forward by theta. Nothing is left out but what the feet could do: they neither tilt, slip nor lift.

**Motion.** With phi = theta_hat - theta_leg, the kinetic energy [J] is theta'.M(phi) theta' / 2. Only the coupling of the
two links depends on phi: it is c(phi) = m_hat h.R(phi) c_hat = c_0 cos(phi) + c_1 sin(phi) [kg m2], c_0 = m_hat h.c_hat and
c_1 = m_hat (h.x c_hat.z - h.z c_hat.x). Lagrange's equations, with the slope c' = dc/dphi, give the
moments along the pitches

    Q = M(phi) theta'' + c' (theta_hat'^2, -theta_leg'^2) - g (u sin(theta) + w cos(theta))   [Nm],
    2 tau = T' Q + 2 (a q'' + d q' + k q).

**Head.** x = (R(theta_leg) h + R(theta_hat) d).x, less its value upright.

**Centre of pressure.** Q_leg + Q_hat is the rate L' of the angular momentum about the ankle, less the moment of the weight
of leg and HAT. Leg and HAT stand x = w cos(theta) + u sin(theta) ahead of and z = u cos(theta) - w sin(theta) above the
ankle, times mass and but for constants [kg m, each]. So

    m x''_com = sum(z theta'' - x theta'^2),   m z''_com = -sum(x theta'' + z theta'^2),
    p = a + [g m_feet (c_foot.x - a) - Q_leg - Q_hat - H m x''_com] / (m g + m z''_com).

**Least cost.** The outputs are not linear in the Fourier coefficients. The convex program of the outputs linearised about
the last motion is solved again and again, first about upright, until the cost stays: Gauss-Newton steps of sequential
quadratic programming. The slopes are those of the exact outputs. A motion that stays therefore keeps the exact limits, and
no small change that keeps them costs less. The slopes are taken by the complex step, f'(x) = Im f(x + i e) / e, which needs
no difference of close numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envs.body.segments import Segments
from envs.config import EnvConfig
from posture.analysis.trajectory import Array
from posture.theory.motion import PeriodicMotion
from posture.theory.program import Program, UndecidedError
from posture.theory.reward_optimum import best_for_reward
from posture.theory.stander import JOINTS_OF_A_KIND, PITCH, Stander, linearise, mass_and_moments

MAX_ITERATIONS = 30
"""Largest number of convex programs; usually 4 or 5 are needed."""
FULL_STEPS = 8
"""Iterations after which the steps are halved: bends of more than half a radian may otherwise go back and forth."""
CONVERGED = 1e-4
"""The relative change of the cost in one iteration that ends them."""


@dataclass(frozen=True, eq=False)
class ExactStander(Stander):
    """The linear stander with what its exact equations need besides.

    body: its segments. springs: of both joints of a kind (hip, ankle) [Nm/rad], (2,). armature: of both [kg m2].
    mass_pitch [kg m2] (2, 2), w, u [kg m] (2,): see `mass_and_moments`. weight: of the whole body [N].
    """

    body: Segments
    springs: Array
    armature: float
    mass_pitch: Array
    w: Array
    u: Array
    weight: float

    def outputs(self, motion: NDArray[Any]) -> NDArray[Any]:
        """Torques of one hip and one ankle [Nm], head and centre of pressure [m]: (..., 4).

        motion: angles [rad], velocities [rad/s] and accelerations [rad/s2], each (hip, ankle): (..., 6), real or complex.
        """
        q, dq, ddq = motion[..., :2], motion[..., 2:4], motion[..., 4:]
        theta, rate, bend = q @ PITCH.T, dq @ PITCH.T, ddq @ PITCH.T
        sin, cos, g = np.sin(theta), np.cos(theta), self.body.gravity
        # The coupling c of the links and its slope.
        phi, hip = -q[..., :1], self.body.hip
        even, odd = self.mass_pitch[0, 1], hip[0] * self.u[1] - hip[1] * self.w[1]
        coupling, slope = even * np.cos(phi) + odd * np.sin(phi), odd * np.cos(phi) - even * np.sin(phi)
        x, z = self.w * cos + self.u * sin, self.u * cos - self.w * sin
        moment = np.diag(self.mass_pitch) * bend + coupling * bend[..., ::-1] - g * x
        moment = moment + slope * rate[..., ::-1] ** 2 * [1.0, -1.0]
        passive = self.springs * q + dq @ self.damping + self.armature * ddq
        torque = (moment @ PITCH + passive) / JOINTS_OF_A_KIND
        links = np.stack([hip, self.body.head])
        head = (links[:, 0] * (cos - 1.0) + links[:, 1] * sin).sum(axis=-1)
        forward, up = (z * bend - x * rate**2).sum(axis=-1), -(x * bend + z * rate**2).sum(axis=-1)
        turning = g * self.body.foot_mass * self.body.foot_com[0] - moment.sum(axis=-1) - self.body.ankle_height * forward
        cop = self.body.ankle_x + turning / (self.weight + up)
        return np.concatenate([torque, head[..., None], cop[..., None]], axis=-1)

    def torque(self, angle: Array, velocity: Array, acceleration: Array) -> Array:
        """See `Stander.torque`."""
        return self.outputs(np.concatenate([angle, velocity, acceleration], axis=-1))[..., :2]


def exact_stander(body: Segments, config: EnvConfig) -> ExactStander:
    """The stander of `linearise`, exact."""
    mass_pitch, w, u = mass_and_moments(body, config)
    return ExactStander(
        **vars(linearise(body, config)),
        body=body,
        springs=JOINTS_OF_A_KIND * np.array([config.hip_k, config.ankle_k]),
        armature=JOINTS_OF_A_KIND * config.joint_armature,
        mass_pitch=mass_pitch,
        w=w,
        u=u,
        weight=body.gravity * (body.leg_mass + body.hat_mass + config.load + body.foot_mass),
    )


@dataclass(frozen=True, eq=False)
class ExactMotion(PeriodicMotion):
    """A periodic motion with the torques, head and centre of pressure of the exact equations."""

    stander: ExactStander

    def torque(self, time: Array) -> Array:
        """Actuator torque of one joint, springs and dampers not included [Nm]. (T, 2)."""
        return self._outputs(time)[:, :2]

    def head(self, time: Array) -> Array:
        """Head along x, 0 upright [m]. (T,)."""
        return self._outputs(time)[:, 2]

    def cop(self, time: Array) -> Array:
        """Centre of pressure along x in the foot's frame [m]. (T,)."""
        return self._outputs(time)[:, 3]

    def _outputs(self, time: Array) -> Array:
        motion = np.concatenate([self.angle(time), self.velocity(time), self.acceleration(time)], axis=1)
        return self.stander.outputs(motion)


class ExactProgram(Program):
    """`Program` with the outputs of the exact stander linearised about a motion; about upright until `linearise_about`."""

    stander: ExactStander

    def __init__(self, stander: ExactStander, freq: float, amplitude: float, tolerance: float, **size: int) -> None:
        super().__init__(stander, freq, amplitude, tolerance, **size)
        rate = 2j * math.pi * freq * np.arange(self._waves.shape[1])
        # Angle, velocity and acceleration over the unknowns, (S, 6, v).
        self._basis = np.concatenate([self._rows(np.multiply.outer(rate**order, np.eye(2))) for order in range(3)], axis=1)
        self._path = self.target

    def linearise_about(self, unknowns: Array) -> None:
        """Set the attributes to the slopes of the exact outputs about these unknowns (v,), and the limits with them.

        torque_offset is then (S, 2), and target is that of head z.
        """
        point = self._basis @ unknowns
        value = self.stander.outputs(point)
        step = 1e-30
        slope = self.stander.outputs(point + 1j * step * np.eye(6)[:, None]).imag / step  # (6, S, 4)
        rows = np.einsum("isj,siv->sjv", slope, self._basis)
        offset = value - rows @ unknowns
        self.torque, self.torque_offset = (part[:, :2] / self.stander.torque_limit for part in (rows, offset))
        self.head, self.target = rows[:, 2], self._path - offset[:, 2]
        self._keep_limits(rows[:, 3], offset[:, 3])

    def least_torque(self) -> Array:
        """The unknowns (v,) of a least mean of squared torques within the limits, which no small change lowers.

        Raises InfeasibleError where the limits of a linearised program cannot be kept.
        """
        unknowns, before = super().least_torque(), math.inf
        for iteration in range(MAX_ITERATIONS):
            self.linearise_about(unknowns)
            cost = float(np.mean((self.torque @ unknowns + self.torque_offset) ** 2))
            if abs(cost - before) <= CONVERGED * cost:
                return unknowns
            share = 1.0 if iteration < FULL_STEPS else 0.5
            unknowns, before = unknowns + share * (super().least_torque() - unknowns), cost
        raise UndecidedError(f"{self._task()}: no least cost after {MAX_ITERATIONS} iterations")

    def motion(self, unknowns: Array) -> ExactMotion:
        """The motion that the unknowns (v,) stand for."""
        return ExactMotion(**vars(super().motion(unknowns)))


def exact_bound(stander: ExactStander, freq: float, amplitude: float, tolerance: float) -> ExactMotion:
    """`posture.theory.optimum.bound` of the exact equations: a local optimum, reached from the linear one."""
    program = ExactProgram(stander, freq, amplitude, tolerance)
    return program.motion(program.least_torque())


def exact_reward_optimum(stander: ExactStander, freq: float, config: EnvConfig, tolerance: float) -> PeriodicMotion:
    """`posture.theory.reward_optimum.reward_optimum` of the exact equations."""
    return best_for_reward(ExactProgram(stander, freq, config.amplitude, tolerance), config)
