"""The head-tracking environment with one stander whose target and body can be changed while it moves."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from typing import Any

import torch

from envs.config import EnvConfig, Person
from envs.engines.interface import SUBJECT
from envs.task.head_tracking import SENSED, HeadTrackingEnv

EPISODE_STEPS = 10_000_000
"""Control steps of an episode, about two days: in practice only a fall ends it."""


@dataclass(frozen=True)
class Settings:
    """freq [Hz] of the target; hip_k, ankle_k [Nm/rad per joint]; load [kg]; amplitude [m]; tolerance [m] of the head; body:
    of a person; None: the paper's."""

    freq: float
    hip_k: float
    ankle_k: float
    load: float
    amplitude: float
    tolerance: float
    body: Person | None

    def apply_to(self, config: EnvConfig) -> EnvConfig:
        """`config`, which has their body, with the stiffness, load and amplitude of these settings."""
        return config.model_copy(update={name: getattr(self, name) for name in ("hip_k", "ankle_k", "load", "amplitude")})

    @property
    def without_freq(self) -> tuple[Any, ...]:
        """All settings but the frequency. The least cost as a function of frequency depends on them."""
        return astuple(self)[1:]


def play_config(env: EnvConfig) -> EnvConfig:
    """`env` with one world in the sagittal engine, where only a fall ends an episode."""
    values = env.without_ranges().model_dump()
    values |= {"num_envs": 1, "physics": "sagittal", "episode_steps": EPISODE_STEPS, "ramp": None, "freq": 1.0}
    values["termination"] |= {"foot_motion": None, "head_tolerance": None}
    return EnvConfig.model_validate(values)


class PlayEnv(HeadTrackingEnv):
    """One stander. A change of the target's frequency causes no jump of its phase."""

    def __init__(self, config: EnvConfig, settings: Settings) -> None:
        super().__init__(config, 0, "cpu")
        self.apply(settings)

    def apply(self, settings: Settings) -> None:
        """Use stiffness, load and target of `settings` from the next step on."""
        self.episodes.retarget(*(torch.full((1,), value).double() for value in (settings.freq, settings.amplitude)))
        self.episodes.tolerance.fill_(settings.tolerance)
        for name in ("hip_k", "ankle_k", "load"):
            value = torch.full((1,), getattr(settings, name))
            if not torch.equal(value, getattr(self.sim, name)):
                self.sim.set_subject(**{name: value})

    def continue_from(self, other: PlayEnv) -> None:
        """Take over the motion and the target of `other`, which has the same body and control step.

        The senses go on, too, if both policies have the same ones; otherwise they begin as with a new episode.
        """
        config, state = other.config, other.state_dict()
        for name in SUBJECT:
            del state["simulation"][name]  # stiffness, damping and friction are this environment's own
        if config.actuation.is_ideal:
            state["activation"] = state["action"]  # lagging actuators begin with the present torque
        same_senses = (config.sensing, config.observations) == (self.config.sensing, self.config.observations)
        if not same_senses:
            state |= {name: value for name, value in self.state_dict().items() if name in SENSED}
            state |= {"episode_length_buf": torch.zeros_like(self.episodes.step), "phase_offset": other.episodes.phase}
        self.load_state_dict(state)
        if not same_senses:
            self._observe(torch.ones(1, dtype=torch.bool))

    @property
    def phase(self) -> float:
        """Phase of the target [rad], 0 at its rear end, in [0, 2 pi)."""
        return float(self.episodes.phase) % (2 * math.pi)

    @property
    def foot_drift(self) -> float:
        """How far forward the feet have moved since the start [m]."""
        return float((self.state.foot_pose[..., :3] - self.episodes.foot_start)[0, :, 0].mean())
