"""The linear two-link stander: feet flat and still, left and right moving as one, small angles about upright.

**Coordinates and signs.** q = (hip, ankle) [rad] are the simulator's own joint angles, of the child relative to its parent
about +y, so hip flexion is negative, and so is the ankle when the body leans forward. With the foot held flat the forward
pitches [rad] of leg and HAT in the world are

    theta_leg = -q_ankle,   theta_hat = -q_ankle - q_hip,   or  theta = T q,  T = [[0, -1], [-1, -1]].

**Mass.** A pitch theta moves a point (x, z) by theta (z, -x), so with h the place of the hip relative to the ankle, c_leg
and c_hat the centres of mass relative to ankle and hip (two-vectors in the sagittal plane, upright), masses m and moments of
inertia I about y of both legs together and of the HAT,

    M_theta = [[I_leg + m_leg |c_leg|^2 + m_hat |h|^2,  m_hat h.c_hat], [m_hat h.c_hat,  I_hat + m_hat |c_hat|^2]]  [kg m2].

**Gravity.** Heights z cos(theta) - x sin(theta), to second order, give the potential [J] whose slope is
-g w - g diag(u) theta, with w = (m_leg c_leg.x + m_hat h.x, m_hat c_hat.x) and u the same of z: weights that stand off
their axes pull with a constant moment, and those above them make a negative stiffness.

**Motion.** In joint angles, with springs k, dampers d and armatures a on each of the two joints of a kind, and the actuator
torques tau = (hip, ankle) [Nm] of one joint each,

    2 tau = M q'' + D q' + K q + o,
    M = T' M_theta T + 2 a,   D = 2 d,   K = 2 diag(k) - g T' diag(u) T,   o = -g T' w.

**Head.** To first order the head moves along x by J q from upright, J = (h.z, d.z) T, with d its place relative to the hip.

**Centre of pressure.** The ground's force acts on the sole, H below the ankle, at p ahead of the foot's frame, whose ankle
is at a. Moments about the ankle of everything that moves and of the feet: L' = G - H R_x - (p - a) R_z, where
L' = (1, 1) M_theta theta'' (no armature: an armature turns with its joint and carries no momentum of the whole),
G = g (1, 1)(w + diag(u) theta) + g m_feet (c_foot.x - a), R_x = m x''_com, R_z = m (g + z''_com). To first order, with
p_0 = a + G_0 / (m g) the value upright,

    p = p_0 + [G_1 - L' - H m x''_com - (p_0 - a) m z''_com] / (m g),

which is linear in q and q''. The ends of the sole's contact line bound it; friction, which is not modelled, would need
|x''_com| < mu g. All of this is of the linear model: the squares of the angles are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg

from envs.body.segments import Segments
from envs.config import EnvConfig
from posture.analysis.trajectory import Array

JOINTS_OF_A_KIND = 2

PITCH = np.array([[0.0, -1.0], [-1.0, -1.0]])
"""T: forward pitch of leg and HAT [rad] from (hip, ankle) [rad]."""


@dataclass(frozen=True, eq=False)
class Stander:
    """Linear plant and its outputs; order (hip, ankle) throughout. See the module's docstring for signs and derivation.

    mass [kg m2], damping [Nm s/rad], stiffness with gravity [Nm/rad]: M, D, K of both joints of a kind together, (2, 2).
    offset: o, constant torque of both joints of a kind that holds it upright [Nm], (2,). head: J [m/rad], (2,).
    cop_offset [m], cop_angle [m/rad], cop_acceleration [m s2/rad]: the centre of pressure in the foot's frame is
    cop_offset + cop_angle q + cop_acceleration q'', (2,). heel_x, toe_x: its bounds [m]. torque_limit: of one joint [Nm].
    """

    mass: Array
    damping: Array
    stiffness: Array
    offset: Array
    head: Array
    cop_offset: float
    cop_angle: Array
    cop_acceleration: Array
    heel_x: float
    toe_x: float
    torque_limit: float

    def torque_response(self, omega: Array) -> Any:
        """Torque of one joint over joint angle [Nm/rad] at angular frequencies `omega` (n,) [rad/s]. Complex (n, 2, 2).

        (K - omega^2 M + i omega D) / 2: angles q = Re(Q exp(i omega t)) need tau = Re(response Q exp(i omega t)), besides
        the constant `torque_offset`.
        """
        w = np.asarray(omega, dtype=np.float64)[:, None, None]
        return (self.stiffness - w**2 * self.mass + 1j * w * self.damping) / JOINTS_OF_A_KIND

    def step(self, dt: float) -> tuple[Array, Array, Array]:
        """a (4, 4), b (4, 2), c (4,) of the next state a x + b tau + c, after `dt` [s] in which tau is held.

        x = (hip, ankle [rad], their velocities [rad/s]); tau = (hip, ankle) [Nm], torque of one joint each. The exponential
        of the system gives them exactly.
        """
        inverse, still = np.linalg.inv(self.mass), np.zeros((2, 2))
        drift = np.block([[still, np.eye(2)], [-inverse @ self.stiffness, -inverse @ self.damping]])
        push = np.vstack([still, JOINTS_OF_A_KIND * inverse])
        pull = np.concatenate([np.zeros(2), -inverse @ self.offset])
        exponential = scipy.linalg.expm(dt * np.vstack([np.column_stack([drift, push, pull]), np.zeros((3, 7))]))
        return exponential[:4, :4], exponential[:4, 4:6], exponential[:4, 6]

    def torque(self, angle: Array, velocity: Array, acceleration: Array) -> Array:
        """Torque of one hip and one ankle [Nm] that this motion needs; (hip, ankle) each. (..., 2)."""
        moment = acceleration @ self.mass.T + velocity @ self.damping.T + angle @ self.stiffness.T + self.offset
        return np.asarray(moment / JOINTS_OF_A_KIND)

    @property
    def torque_offset(self) -> Array:
        """Torque of one joint that holds the body upright [Nm], (2,)."""
        return self.offset / JOINTS_OF_A_KIND

    def cop_response(self, omega: Array) -> Array:
        """Centre of pressure over joint angle [m/rad] at angular frequencies `omega` (n,) [rad/s]. Shape (n, 2)."""
        w = np.asarray(omega, dtype=np.float64)[:, None]
        return self.cop_angle - w**2 * self.cop_acceleration


def mass_and_moments(body: Segments, config: EnvConfig) -> tuple[Array, Array, Array]:
    """M_theta [kg m2] (2, 2), w and u [kg m] (2,) of the module's docstring, order (leg, HAT).

    The load is a point mass on the HAT, at its centre of mass or at `config.load_at`.
    """
    hat_mass = body.hat_mass + config.load
    load_at = body.hat_com if config.load_at is None else body.hat_frame + config.load_at
    hat_moment = body.hat_mass * body.hat_com + config.load * load_at
    moved = np.stack([body.leg_mass * body.leg_com + hat_mass * body.hip, hat_moment])
    coupling = float(body.hip @ hat_moment)
    about_ankle = body.leg_inertia + body.leg_mass * body.leg_com @ body.leg_com + hat_mass * body.hip @ body.hip
    about_hip = body.hat_inertia + body.hat_mass * body.hat_com @ body.hat_com + config.load * load_at @ load_at
    return np.array([[about_ankle, coupling], [coupling, about_hip]]), moved[:, 0], moved[:, 1]


def linearise(body: Segments, config: EnvConfig) -> Stander:
    """The linear stander of `body` with the springs, dampers, armature, load and torque limit of `config`."""
    g, ones = body.gravity, np.ones(2)
    mass_pitch, w, u = mass_and_moments(body, config)
    springs = JOINTS_OF_A_KIND * np.array([config.hip_k, config.ankle_k])

    # Centre of pressure: the whole body's weight [N], and its moment about the ankle upright.
    weight = g * (body.leg_mass + body.hat_mass + config.load + body.foot_mass)
    ahead = (g * float(w.sum()) + g * body.foot_mass * float(body.foot_com[0])) / weight
    # m x''_com = u theta'' and m z''_com = -w theta''.
    reaction = -(ones @ mass_pitch) - body.ankle_height * u + ahead * w
    return Stander(
        mass=PITCH.T @ mass_pitch @ PITCH + JOINTS_OF_A_KIND * config.joint_armature * np.eye(2),
        damping=JOINTS_OF_A_KIND * config.joint_damping * np.eye(2),
        stiffness=np.diag(springs) - g * PITCH.T @ np.diag(u) @ PITCH,
        offset=-g * PITCH.T @ w,
        head=np.array([body.hip[1], body.head[1]]) @ PITCH,
        cop_offset=body.ankle_x + ahead,
        cop_angle=g * u @ PITCH / weight,
        cop_acceleration=reaction @ PITCH / weight,
        heel_x=body.heel_x,
        toe_x=body.toe_x,
        torque_limit=config.torque_limit,
    )
