"""The model-based controller: the torque-optimal motion fed forward, with linear-quadratic feedback around it.

The least-cost motion (`posture.theory.nonlinear.exact_bound`) is planned beforehand for the frequency of each world and
faded in from standing. The torque of a joint is

    tau = tau_ref(t + dt/2) - G (z - z_ref(t)),   z = (hip, ankle, their velocities),

where tau_ref is the torque that the exact stander needs for the reference, and G the gain that minimises the sum over
control steps of z' Q z + tau' R tau for the linear stander with torques held constant over a step. Q and R are diagonal, one
over the squares of deviations that count as equally large (Bryson's rule); these are in conf/lqr.yaml.

The angle of the ankle is that of the leg against the vertical: in the soft ground the feet tilt a little
(`posture.evaluation.lqr_policy.flat_foot_state`).
"""

from dataclasses import replace

import numpy as np
import scipy.linalg

from posture.analysis.trajectory import Array
from posture.config.eval import LqrConfig
from posture.theory.motion import PeriodicMotion
from posture.theory.nonlinear import ExactMotion, ExactStander, exact_bound
from posture.theory.stander import Stander


def gain(stander: Stander, dt: float, config: LqrConfig) -> Array:
    """Feedback gain G: torque of one joint [Nm] over deviation of (hip, ankle) [rad] and velocities [rad/s]. (2, 4)."""
    a, b, _ = stander.step(dt)
    q = np.diag([config.angle**-2] * 2 + [config.velocity**-2] * 2)
    r = np.eye(2) * config.torque**-2
    p = scipy.linalg.solve_discrete_are(a, b, q, r)
    return np.asarray(np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a))


def plan(stander: ExactStander, freq: float, amplitude: float, tolerance: float, config: LqrConfig) -> ExactMotion:
    """The least-cost motion that leaves the configured margins of foot and tolerance [m] to feedback."""
    shorter = replace(stander, heel_x=stander.heel_x + config.foot_margin, toe_x=stander.toe_x - config.foot_margin)
    return exact_bound(shorter, freq, amplitude, tolerance - config.tolerance_margin)


def reference(motion: PeriodicMotion, time: Array, fade_in: float) -> tuple[Array, Array, Array]:
    """Angle [rad], velocity [rad/s] and torque of one joint [Nm] of `motion`, faded in from upright over `fade_in` [s].

    time: (T,) [s]. Shapes (T, 2). The fade is the quintic with zero velocity and acceleration at both ends, and the torque
    is what the motion's stander needs for the faded motion.
    """
    x = np.clip(time / fade_in, 0.0, 1.0)[:, None]
    share = x**3 * (10 - 15 * x + 6 * x**2)
    slope = 30 * x**2 * (1 - x) ** 2 / fade_in
    curve = 60 * x * (1 - x) * (1 - 2 * x) / fade_in**2
    q, v, a = motion.angle(time), motion.velocity(time), motion.acceleration(time)
    angle, velocity = share * q, slope * q + share * v
    acceleration = curve * q + 2 * slope * v + share * a
    return angle, velocity, motion.stander.torque(angle, velocity, acceleration)
