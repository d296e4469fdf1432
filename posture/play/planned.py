"""The model-based controller of `posture.theory.lqr` for a target and a body that change while it acts.

The reference is the least-cost motion, q(t) = Re sum_k c_k exp(i k phi(t)), with the target's own phase phi. Its
coefficients are planned anew as the sliders move, in another process. Those in use follow the plan by
c'' = w^2 (plan - c) - 2 w c', from c = 0, which is upright: so angles and velocities stay continuous, and the feedforward
torque is that of the motion as it is, faded as it may be.
"""

from __future__ import annotations

import numpy as np
import torch

from envs.body.joints import ANKLES, HIPS
from envs.body.segments import Segments
from envs.config import EnvConfig
from posture.analysis.trajectory import Array
from posture.config.eval import LqrConfig
from posture.play.knobs import Knobs
from posture.play.steered import SteeredEnv
from posture.play.theory import Asked, Coefficients, Office
from posture.theory import lqr
from posture.theory.program import HARMONICS, InfeasibleError
from posture.theory.stander import JOINTS_OF_A_KIND, linearise

SETTLED = 5.8
"""w times the time after which the coefficients have come within 2 % of the plan."""
REPLAN_HZ = 0.02
"""The plan is renewed when the frequency has moved as far as this."""


def plan(body: Segments, env: EnvConfig, freq: float, tolerance: float, config: LqrConfig) -> Coefficients:
    """The coefficients of `posture.theory.lqr.plan`. Raises InfeasibleError."""
    return lqr.plan(linearise(body, env), freq, env.amplitude, tolerance, config).coefficients


class Planned:
    """A `posture.play.pilot.Pilot`."""

    def __init__(self, config: LqrConfig, office: Office, body: Segments) -> None:
        self.note = ""
        self._config, self._asked, self._body = config, Asked(office, plan), body
        self._subject: tuple[float, ...] = ()
        self._now, self._rate, self._curve = (np.zeros((HARMONICS + 1, 2), dtype=np.complex128) for _ in range(3))
        self._plan = self._now

    def act(self, env: SteeredEnv, knobs: Knobs) -> torch.Tensor:
        """See `Pilot`."""
        self._know(env, knobs)
        self._approach(env.config.control_dt)
        angle, velocity = env.sim.joint_angle[0], env.sim.joint_velocity[0]
        now = np.array([float(x[kind].mean()) for x in (angle, velocity) for kind in (HIPS, ANKLES)])
        crept = env.crept
        deviation = now - np.concatenate(self._reference(env.phase, knobs.freq)[:2])
        deviation[:2] += crept * self._lean_angle
        ahead = env.phase + np.pi * knobs.freq * env.config.control_dt
        torque = self._torque(*self._reference(ahead, knobs.freq)) - crept * self._lean_torque - self._gain @ deviation
        return torch.tensor(torque / env.config.torque_limit, dtype=torch.float32)[None]

    def _know(self, env: SteeredEnv, knobs: Knobs) -> None:
        """The plant, its feedback, and the newest plan for it."""
        config = knobs.env(env.config)
        if self._subject != knobs.subject:
            self._subject = knobs.subject
            self._plant = linearise(self._body, config)
            self._gain = lqr.gain(self._plant, config.control_dt, self._config)
            self._lean_angle, self._lean_torque = lqr.lean(self._plant)
        freq = REPLAN_HZ * max(1, round(knobs.freq / REPLAN_HZ))
        self.note = ""
        if not self._asked.about((knobs.subject, freq), self._body, config, freq, knobs.tolerance, self._config):
            self.note = "planning its motion"
        if isinstance(self._asked.answer, InfeasibleError):
            self.note = f"no plan, it keeps the last one: {self._asked.answer}"
        elif isinstance(self._asked.answer, Exception):
            raise self._asked.answer
        elif self._asked.answer is not None:
            self._plan = self._asked.answer

    def _approach(self, dt: float) -> None:
        w = SETTLED / self._config.fade_in
        self._curve = w**2 * (self._plan - self._now) - 2 * w * self._rate
        self._rate = self._rate + dt * self._curve
        self._now = self._now + dt * self._rate

    def _reference(self, phase: float, freq: float) -> tuple[Array, Array, Array]:
        """Angles [rad], velocities and accelerations of (hip, ankle) at `phase` [rad], (2,) each."""
        order = np.arange(len(self._now))
        wave, turn = np.exp(1j * order * phase), 2j * np.pi * freq * order[:, None]
        angle = self._now
        velocity = self._rate + turn * self._now
        acceleration = self._curve + 2 * turn * self._rate + turn**2 * self._now
        return tuple((wave @ part).real for part in (angle, velocity, acceleration))

    def _torque(self, angle: Array, velocity: Array, acceleration: Array) -> Array:
        """Of one joint (hip, ankle) [Nm], what the linear stander needs for this motion. (2,)."""
        plant = self._plant
        moment = plant.mass @ acceleration + plant.damping @ velocity + plant.stiffness @ angle + plant.offset
        return np.asarray(moment / JOINTS_OF_A_KIND)
