"""`gymnasium.make_vec("posture/HeadTracking-v0", num_envs=...)`: many standers, all stepped at once."""

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from posture.gymnasium.configuration import configure
from posture.gymnasium.picture import RENDER_MODES, Frame, check_render_mode
from posture.gymnasium.worlds import Array, Mask, Worlds

MODES = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)


class StanderVectorEnv(VectorEnv[Array, Array, NDArray[Any]]):
    """N standers. Observations, rewards and infos are those of Gymnasium's SyncVectorEnv with N `StanderEnv`."""

    metadata = {"render_modes": RENDER_MODES}

    def __init__(
        self,
        num_envs: int = 1,
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        env: str = "fixed_reward",
        training_steps: int | None = None,
        **keys: Any,
    ) -> None:
        """As `StanderEnv`. `autoreset_mode`: NextStep, in which an ended world ignores its next action and begins an episode
        in that step, or SameStep, in which it begins at once, and infos["final_obs"] has its last observation."""
        mode = next((mode for mode in MODES if autoreset_mode in (mode, mode.value)), None)
        if mode is None:
            raise ValueError(f"autoreset_mode = {autoreset_mode}: allowed is {' or '.join(mode.value for mode in MODES)}")
        self.render_mode = check_render_mode(render_mode)
        self._worlds = Worlds(configure(num_envs, env, training_steps, keys))
        self._worlds.reseed_from(self.np_random)
        self._mode = mode
        self.num_envs = self._worlds.num_envs
        self.metadata = {
            **self.metadata,
            "render_fps": 1.0 / self._worlds.config.control_dt,
            "autoreset_mode": self._mode,
        }
        self.single_observation_space = self._worlds.observation_space
        self.single_action_space = self._worlds.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._over = np.zeros(self.num_envs, dtype=np.bool_)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin a new episode in every world. `options` are not used."""
        super().reset(seed=seed)
        if seed is not None:
            self._worlds.reseed_from(self.np_random)
        self._worlds.begin()
        self._over = np.zeros(self.num_envs, dtype=np.bool_)
        return self._worlds.observe(), self._info()

    def step(self, actions: Array) -> tuple[Array, NDArray[np.float64], Mask, Mask, dict[str, Any]]:
        """One control step of every world."""
        reward, terminated, truncated = self._worlds.advance(actions)
        final: dict[str, Any] = {}
        if self._mode is AutoresetMode.NEXT_STEP:
            begin = self._over
            reward[begin], terminated[begin], truncated[begin] = 0.0, False, False
            self._over = terminated | truncated
        else:
            begin = terminated | truncated
            if begin.any():
                last = np.full(self.num_envs, None, dtype=object)
                observation = self._worlds.observe()
                for world in np.flatnonzero(begin):
                    last[world] = observation[world]
                final = {"final_obs": last, "final_info": self._info(begin), "_final_obs": begin, "_final_info": begin}
        if begin.any():
            self._worlds.begin(begin)
        return self._worlds.observe(), reward, terminated, truncated, {**final, **self._info()}

    def render(self) -> tuple[Frame, ...] | None:
        """Each stander from the side, (height, width, 3) uint8; None without a render mode."""
        if self.render_mode is None:
            return None
        return tuple(self._worlds.picture(world) for world in range(self.num_envs))

    def _info(self, mask: Mask | None = None) -> dict[str, Any]:
        """Infos of the worlds of `mask`, None: all; each beside its mask, as Gymnasium has them."""
        mask = np.ones(self.num_envs, dtype=np.bool_) if mask is None else mask
        infos: dict[str, Any] = {}
        for name, values in self._worlds.info().items():
            infos |= {name: np.where(mask, values, values.dtype.type(0)), f"_{name}": mask.copy()}
        return infos
