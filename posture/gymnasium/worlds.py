"""The worlds of `HeadTrackingEnv` with NumPy arrays in and out, in which each episode is begun by the caller."""

from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray

from envs.body.joints import ANKLES, HIPS, KINDS
from envs.task.head_tracking import HeadTrackingEnv
from posture.config.gymnasium import GymnasiumConfig
from posture.gymnasium.picture import Frame, Picture
from posture.theory.least_costs import least_costs

Array = NDArray[np.float32]
Mask = NDArray[np.bool_]


class Worlds(HeadTrackingEnv):
    """N standers. A world whose episode has ended stays as it is until `begin`.

    observation_space, action_space: of one world. Action (2,): hip and ankle torque over the torque limit. Observation: the
    terms of all groups of `env.observations` but those of `env.sensing.exact`, side by side.
    """

    def __init__(self, config: GymnasiumConfig) -> None:
        super().__init__(config.env, 0, "cpu", training_steps=config.training_steps, least_costs=least_costs)
        self._groups = [name for name in config.env.observations if name not in config.env.sensing.exact]
        size = sum(len(config.env.observed[name]) for name in self._groups)
        self.observation_space = spaces.Box(-np.inf, np.inf, (size,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (len(KINDS),), np.float32)
        self._picture: Picture | None = None

    def reseed_from(self, random: np.random.Generator) -> None:
        """Draw a seed: the episodes from the next one on are those of a new `HeadTrackingEnv` with this seed."""
        self.episodes.reseed(int(random.integers(2**63)))

    def begin(self, mask: Mask | None = None) -> None:
        """Begin an episode in the worlds of `mask` (N,), None: in all."""
        begun = torch.ones(self.num_envs, dtype=torch.bool) if mask is None else torch.from_numpy(mask)
        super()._reset(begun)
        self._observe(begun)

    def advance(self, actions: Any) -> tuple[NDArray[np.float64], Mask, Mask]:
        """One control step: reward (N,), terminated (N,) and truncated (N,), that is, timed out. `actions` (N, 2)."""
        command = np.asarray(actions, dtype=np.float32).reshape(self.num_envs, self.num_actions)
        _, reward, done, extras = self.step(torch.from_numpy(command))
        self.sim.check_capacity()
        truncated = extras["time_outs"]
        return reward.double().numpy(), (done & ~truncated).numpy(), truncated.numpy()

    def observe(self) -> Array:
        """The observation, (N, size)."""
        groups = self.get_observations()
        return torch.cat([groups[name] for name in self._groups], dim=-1).numpy()

    def info(self) -> dict[str, NDArray[Any]]:
        """(N,) each: momentary frequency of the target [Hz], target minus head along x [m], and whether the world has
        diverged."""
        state = self.state
        return {
            "target_freq": state.target_freq.double().numpy(),
            "tracking_error": (state.target_x - state.head_x).double().numpy(),
            "diverged": self.sim.diverged.numpy().copy(),
        }

    def picture(self, world: int) -> Frame:
        """The stander from the side, (height, width, 3) uint8."""
        self._picture = self._picture or Picture(2 * self.config.amplitude, self.config.body)
        state = self.state
        foot_x = (state.foot_pose[..., 0] - self.episodes.foot_start[..., 0]).mean(-1)
        hip, ankle = (state.joint_angle[:, kind].mean(-1) for kind in (HIPS, ANKLES))
        return self._picture.draw(*(float(values[world]) for values in (hip, ankle, foot_x, state.head_x, state.target_x)))

    def _reset(self, mask: torch.Tensor) -> None:
        """Leave it to `begin`."""
