"""`gymnasium.make("posture/HeadTracking-v0")`: one stander."""

from typing import Any

import gymnasium

from posture.gymnasium.configuration import configure
from posture.gymnasium.picture import RENDER_MODES, Frame, check_render_mode
from posture.gymnasium.worlds import Array, Worlds


class StanderEnv(gymnasium.Env[Array, Array]):
    """One stander that follows its target with the head. Spaces, reward and info: docs/gymnasium.md."""

    metadata = {"render_modes": RENDER_MODES}

    def __init__(
        self, render_mode: str | None = None, env: str = "fixed_reward", training_steps: int | None = None, **keys: Any
    ) -> None:
        """The task of conf/env/`env`.yaml, in which `keys` replace values. `training_steps`: control steps of the training,
        for weights that are scheduled; None: they have their final values. Raises ValueError if a value is not allowed."""
        self.render_mode = check_render_mode(render_mode)
        self._worlds = Worlds(configure(1, env, training_steps, keys))
        self._worlds.reseed_from(self.np_random)
        self.metadata = {**self.metadata, "render_fps": 1.0 / self._worlds.config.control_dt}
        self.observation_space, self.action_space = self._worlds.observation_space, self._worlds.action_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Stand upright and at rest, with a new target. `options` are not used."""
        super().reset(seed=seed)
        if seed is not None:
            self._worlds.reseed_from(self.np_random)
        self._worlds.begin()
        return self._worlds.observe()[0], self._info()

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """One control step."""
        reward, terminated, truncated = self._worlds.advance(action)
        return self._worlds.observe()[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), self._info()

    def render(self) -> Frame | None:
        """The stander from the side, (height, width, 3) uint8; None without a render mode."""
        return None if self.render_mode is None else self._worlds.picture(0)

    def _info(self) -> dict[str, Any]:
        return {name: values[0].item() for name, values in self._worlds.info().items()}
