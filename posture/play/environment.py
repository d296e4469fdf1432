"""The head-tracking environment with one stander whose target and body can be changed while it moves, and be pushed."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from typing import Any

import mujoco
import numpy as np
import torch

from envs.body.joints import ANKLES, BODIES, HIPS, JOINTS
from envs.body.load import TrunkOfModel
from envs.body.mjcf import mjcf
from envs.config import EnvConfig, Person
from envs.task.head_tracking import HeadTrackingEnv

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
        self._pusher = Pusher(config)

    def apply(self, settings: Settings) -> None:
        """Use stiffness, load and target of `settings` from the next step on."""
        self.episodes.retarget(*(torch.full((1,), value).double() for value in (settings.freq, settings.amplitude)))
        self.episodes.tolerance.fill_(settings.tolerance)
        for name in ("hip_k", "ankle_k", "load"):
            value = torch.full((1,), getattr(settings, name))
            if not torch.equal(value, getattr(self.sim, name)):
                self.sim.set_subject(**{name: value})

    @property
    def phase(self) -> float:
        """Phase of the target [rad], 0 at its rear end, in [0, 2 pi)."""
        return float(self.episodes.phase) % (2 * math.pi)

    def push(self, impulse: float) -> None:
        """Apply a forward `impulse` [Ns] to the centre of mass of head, arms and trunk."""
        self._pusher.push(self, impulse)

    @property
    def foot_drift(self) -> float:
        """How far forward the feet have moved since the start [m]."""
        return float((self.state.foot_pose[..., :3] - self.episodes.foot_start)[0, :, 0].mean())


class Pusher:
    """Applies an impulse to the trunk (HAT) of the only stander in the sagittal engine.

    The engine takes joint torques and ground forces only. A force F over a control step dt changes the generalised
    velocities by M^-1 J' F dt, which is added before the step. The mass matrix M and the Jacobian J of the HAT's centre of
    mass are MuJoCo's, for the MJCF that the engine is built from.
    """

    def __init__(self, config: EnvConfig) -> None:
        self._model = mujoco.MjModel.from_xml_string(mjcf(config.body))
        self._dofs = [self._model.joint(name).dofadr[0] for name in JOINTS]
        self._hat = self._model.body(BODIES[0]).id
        self._trunk = TrunkOfModel(self._model, config)
        self._model.dof_armature[self._dofs] = config.joint_armature

    def push(self, env: HeadTrackingEnv, impulse: float) -> None:
        """Change the velocities of `env` by those that `impulse` [Ns] along x at the HAT's centre of mass causes."""
        model = self._model
        self._trunk.carry(float(env.sim.load[0]))
        data = mujoco.MjData(model)
        x, y, z, w = env.state.hat_pose[0, 3:].tolist()
        data.qpos[:7] = [*env.state.hat_pose[0, :3].tolist(), w, x, y, z]
        for i, name in enumerate(JOINTS):
            data.joint(name).qpos = float(env.sim.joint_angle[0, i])
        mujoco.mj_forward(model, data)
        jacobian, change = np.zeros((3, model.nv)), np.zeros((1, model.nv))
        mujoco.mj_jacBodyCom(model, data, jacobian, None, self._hat)
        mujoco.mj_solveM(model, data, change, impulse * jacobian[:1])
        hip, ankle = (float(change[0, self._dofs[kind]].mean()) for kind in (HIPS, ANKLES))
        pitch = float(change[0, 4])
        # The engine's coordinates: x and z of the HAT's frame, and the pitch of each segment in the world.
        planar = [float(change[0, 0]), float(change[0, 2]), pitch, pitch + hip, pitch + hip + ankle]
        state = env.sim.state_dict()
        state["qd"] += torch.tensor([planar])
        env.sim.load_state_dict(state)
