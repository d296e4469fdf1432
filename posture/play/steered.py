"""The head-tracking environment with one stander, whose target and body can be changed while it moves."""

import math
from typing import Any

import torch
from tensordict import TensorDict

from envs.config import EnvConfig
from envs.task import target
from envs.task.head_tracking import HeadTrackingEnv
from posture.play.knobs import Knobs

ENDLESS = 10_000_000
"""Control steps of an episode; two days."""


def steered_config(env: EnvConfig) -> EnvConfig:
    """`env` with one world, in the fast engine, that nothing but a fall ends."""
    values = env.model_dump()
    values |= {"num_envs": 1, "physics": "sagittal", "episode_steps": ENDLESS, "ramp": None, "freq": 1.0}
    values["termination"] |= {"foot_motion": None, "head_tolerance": None}
    return EnvConfig.model_validate(values)


class SteeredEnv(HeadTrackingEnv):
    """One stander. The target's phase is the integral of its frequency, so that the target never jumps when that changes.

    phase: of the target [rad], 0 at its rear end, in [0, 2 pi).
    """

    def __init__(self, config: EnvConfig, knobs: Knobs) -> None:
        self.phase = 0.0
        self._now = knobs
        super().__init__(config, 0, "cpu")
        self.turn(knobs)

    def turn(self, knobs: Knobs) -> None:
        """From now on the body and the target are those of `knobs`."""
        self._now = knobs
        sim = self.sim
        for name in ("hip_k", "ankle_k", "load"):
            wanted = torch.full((1,), getattr(knobs, name))
            if not torch.equal(wanted, getattr(sim, name)):
                sim.set_subject(**{name: wanted})

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """See `HeadTrackingEnv`."""
        self.phase = (self.phase + 2 * math.pi * self._now.freq * self.config.control_dt) % (2 * math.pi)
        return super().step(actions)

    @property
    def crept(self) -> float:
        """How far forward the feet have moved since the start [m]."""
        return float((self.state.foot_pose[..., :3] - self._foot_start)[0, :, 0].mean())

    def take_over(self, other: "SteeredEnv") -> None:
        """Go on where `other` is."""
        self.phase = other.phase
        self.load_state_dict(other.state_dict())

    def _target(self) -> tuple[torch.Tensor, torch.Tensor]:
        phase, freq = torch.full((1,), self.phase), torch.full((1,), self._now.freq)
        return target.position(phase, self._now.amplitude), target.velocity(phase, freq, self._now.amplitude)

    def _reset(self, mask: torch.Tensor) -> None:
        self.phase = 0.0
        super()._reset(mask)
