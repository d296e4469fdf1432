"""The vector environment for Stable-Baselines3, which has an interface of its own and does not take Gymnasium's."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from posture.gymnasium import ID


class StanderVecEnv(VecEnv):
    """`gymnasium.make_vec` with `num_envs` worlds and `keys`, as SB3 takes it; all worlds are stepped at once."""

    def __init__(self, num_envs: int, **keys: Any) -> None:
        if "autoreset_mode" in keys:
            raise ValueError("autoreset_mode: Stable-Baselines3 needs SameStep; leave it out")
        self.envs = gymnasium.make_vec(ID, num_envs, autoreset_mode=AutoresetMode.SAME_STEP.value, **keys)
        self.render_mode = self.envs.render_mode
        self.metadata = self.envs.metadata
        super().__init__(num_envs, self.envs.single_observation_space, self.envs.single_action_space)

    def reset(self) -> NDArray[np.float32]:
        """Begin an episode in every world; after `seed`, the first one of that seed."""
        observation, _ = self.envs.reset(seed=self._seeds[0])
        self._reset_seeds()
        return observation

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """See `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Observation, reward, done, and infos: of a world whose episode has ended, its last observation."""
        observation, reward, terminated, truncated, info = self.envs.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        done = terminated | truncated
        for world in np.flatnonzero(done):
            last, timed_out = info["final_obs"][world], bool(truncated[world])
            infos[world] = {"terminal_observation": last, "TimeLimit.truncated": timed_out}
        return observation, reward.astype(np.float32), done, infos

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """A frame of each world."""
        frames: Any = self.envs.render()
        return frames or [None] * self.num_envs

    def close(self) -> None:
        """End its use."""
        self.envs.close()

    # Single worlds are not objects: they share their attributes, and have no methods or wrappers of their own.

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The attribute of the vector environment, for each of the worlds."""
        return [getattr(self.envs, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Not possible."""
        raise NotImplementedError(f"{attr_name}: the worlds share their attributes")

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Not possible."""
        raise NotImplementedError(f"{method_name}: the worlds have no methods of their own")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """No world is wrapped."""
        return [False for _ in self._get_indices(indices)]
