"""The model-based controller of `posture.theory.lqr` for a target and a body that change while it acts.

The reference is the least-cost motion q(t) = Re sum_k c_k exp(i k phi(t)), where phi is the target's phase. Its
coefficients c are re-planned in another process when the settings change. The coefficients in use follow the plan by
c'' = w^2 (plan - c) - 2 w c', starting from c = 0 (upright), so angles and velocities stay continuous. The feedforward
torque is that of the motion in use.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from envs.body.segments import Segments
from envs.config import EnvConfig
from posture.analysis.trajectory import Array
from posture.config.eval import LqrConfig
from posture.evaluation.lqr_policy import flat_foot_state
from posture.play.environment import PlayEnv, Settings
from posture.play.theory_worker import Coefficients, TheoryRequest, TheoryWorker
from posture.theory import lqr
from posture.theory.nonlinear import exact_stander
from posture.theory.program import HARMONICS, InfeasibleError

SETTLING = 5.8
"""w times the time after which the coefficients are within 2 % of the plan."""
FREQ_GRID_HZ = 0.02
"""The motion is planned at multiples of this frequency."""


def plan(body: Segments, env: EnvConfig, freq: float, tolerance: float, config: LqrConfig) -> Coefficients:
    """The coefficients of `posture.theory.lqr.plan`. Raises InfeasibleError."""
    return lqr.plan(exact_stander(body, env), freq, env.amplitude, tolerance, config).coefficients


class ReplanningLqr:
    """Linear-quadratic feedback about a reference that is re-planned; a `posture.play.policies.Controller`."""

    def __init__(self, config: LqrConfig, worker: TheoryWorker, body: Segments) -> None:
        self.message = ""
        self._config, self._request, self._body = config, TheoryRequest(worker, plan), body
        self._planned_for: tuple[Any, ...] = ()
        self.reset()

    def reset(self) -> None:
        """See `Controller`."""
        self._position, self._rate, self._acceleration = (
            np.zeros((HARMONICS + 1, 2), dtype=np.complex128) for _ in range(3)
        )  # of the coefficients in use
        self._plan = self._position

    def act(self, env: PlayEnv, settings: Settings) -> torch.Tensor:
        """See `Controller`."""
        self._update_plan(env, settings)
        self._approach_plan(env.config.control_dt)
        measured, correction = (values[0].double().numpy() for values in flat_foot_state(env))
        deviation = measured - np.concatenate(self._reference(env.phase, settings.freq)[:2])
        mid_step = env.phase + np.pi * settings.freq * env.config.control_dt
        torque = self._stander.torque(*self._reference(mid_step, settings.freq)) + correction - self._gain @ deviation
        return torch.tensor(torque / env.config.torque_limit, dtype=torch.float32)[None]

    def _update_plan(self, env: PlayEnv, settings: Settings) -> None:
        """Update the stander, the feedback gain and the newest available plan."""
        config = settings.apply_to(env.config)
        if self._planned_for != settings.without_freq:
            self._planned_for = settings.without_freq
            self._stander = exact_stander(self._body, config)
            self._gain = lqr.gain(self._stander, config.control_dt, self._config)
        freq = FREQ_GRID_HZ * max(1, round(settings.freq / FREQ_GRID_HZ))
        arguments = self._body, config, freq, settings.tolerance, self._config
        ready = self._request.ready((settings.without_freq, freq), *arguments)
        result = self._request.result
        self.message = "" if ready else "planning the motion"
        if isinstance(result, InfeasibleError):
            self.message = f"no feasible motion, the last plan is kept: {result}"
        elif isinstance(result, Exception):
            raise result
        elif result is not None:
            self._plan = result

    def _approach_plan(self, dt: float) -> None:
        w = SETTLING / self._config.fade_in
        self._acceleration = w**2 * (self._plan - self._position) - 2 * w * self._rate
        self._rate = self._rate + dt * self._acceleration
        self._position = self._position + dt * self._rate

    def _reference(self, phase: float, freq: float) -> tuple[Array, Array, Array]:
        """Angles [rad], velocities and accelerations of (hip, ankle) at `phase` [rad], (2,) each."""
        order = np.arange(len(self._position))
        wave, factor = np.exp(1j * order * phase), 2j * np.pi * freq * order[:, None]
        velocity = self._rate + factor * self._position
        acceleration = self._acceleration + 2 * factor * self._rate + factor**2 * self._position
        return tuple((wave @ part).real for part in (self._position, velocity, acceleration))
