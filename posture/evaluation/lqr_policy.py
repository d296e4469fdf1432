"""The model-based controller of `posture.theory.lqr` as a policy that acts in the simulation."""

from collections.abc import Sequence

import numpy as np
import torch
from tensordict import TensorDict

from envs.body.joints import ANKLES, HIPS
from envs.body.rotation import pitch
from envs.task.episodes import FOOT_BODIES
from envs.task.head_tracking import HeadTrackingEnv
from posture.config.eval import LqrConfig
from posture.theory.lqr import gain, reference
from posture.theory.motion import PeriodicMotion


def flat_foot_state(env: HeadTrackingEnv) -> tuple[torch.Tensor, torch.Tensor]:
    """The joints as the linear stander has them, whose feet are flat: the angle of the ankle is that of the leg.

    In the simulation the feet tilt a little in the soft ground. Returns angles [rad] and velocities [rad/s] of (hip, ankle),
    shape (N, 4), and the torques of one joint [Nm], shape (N, 2), that make good what spring and damper of the tilted ankle
    give less.
    """
    sim = env.sim
    hip, ankle, hip_rate, ankle_rate = (
        values[:, kind].mean(-1) for values in (sim.joint_angle, sim.joint_velocity) for kind in (HIPS, ANKLES)
    )
    tilt = pitch(sim.body_pose[:, FOOT_BODIES, 3:]).mean(-1)
    tilt_rate = sim.body_velocity[:, FOOT_BODIES, 4].mean(-1)
    correction = sim.ankle_k * tilt + env.config.joint_damping * tilt_rate
    state = torch.stack((hip, ankle - tilt, hip_rate, ankle_rate - tilt_rate), dim=-1)
    return state, torch.stack((torch.zeros_like(correction), correction), dim=-1)


class LqrController:
    """A policy for `rollout` that reads the state of `env` itself and returns normalised torques. Shape (N, 2)."""

    def __init__(self, env: HeadTrackingEnv, motions: Sequence[PeriodicMotion], config: LqrConfig, duration: float) -> None:
        """`motions`[i] is the motion of world i, for `duration` [s] from the start of its episode."""
        if len(motions) != env.num_envs:
            raise ValueError(f"{len(motions)} motions for {env.num_envs} worlds")
        dt = env.config.control_dt
        time = dt * np.arange(round(duration / dt) + 1, dtype=np.float64)
        states, torques = [], []
        for motion in motions:
            angle, velocity, _ = reference(motion, time, config.fade_in)
            states.append(np.hstack([angle, velocity]))
            torques.append(reference(motion, time + dt / 2, config.fade_in)[2])
        self._env = env
        self._state, self._torque = (
            torch.tensor(np.stack(x), dtype=torch.float32, device=env.sim.device) for x in (states, torques)
        )
        gains = [gain(motion.stander, dt, config) for motion in motions]
        self._gain = torch.tensor(np.stack(gains), dtype=torch.float32, device=env.sim.device)
        self._worlds = torch.arange(env.num_envs, device=env.sim.device)

    def __call__(self, _observation: TensorDict) -> torch.Tensor:
        """Action of every world at the present moment of its episode."""
        step = self._env.episode_length_buf.clamp(max=self._state.shape[1] - 1)
        state, correction = flat_foot_state(self._env)
        deviation = state - self._state[self._worlds, step]
        torque = self._torque[self._worlds, step] + correction - (self._gain @ deviation[..., None])[..., 0]
        return torque / self._env.config.torque_limit
