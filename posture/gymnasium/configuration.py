"""From the arguments of `gymnasium.make` and `make_vec` to a checked configuration."""

import re
from collections.abc import Mapping
from typing import Any

from hydra.errors import HydraException

from envs.config import Person
from posture.cli import entry, jobs
from posture.config.errors import ConfigError
from posture.config.gymnasium import GymnasiumConfig
from posture.config.reading import read


def configure(num_envs: int, env: str, training_steps: int | None, keys: Mapping[str, Any]) -> GymnasiumConfig:
    """The configuration conf/env/`env`.yaml with the values of `keys`, for `num_envs` worlds.

    Raises ValueError with one line that says what is wrong and what is allowed.
    """
    if "num_envs" in keys:
        raise ValueError("num_envs: gymnasium.make makes one stander; make_vec takes num_envs")
    if not isinstance(env, str) or not re.fullmatch(r"[\w-]+", env):
        raise ValueError(f"env = {env!r:.100}: allowed is the name of a file of conf/env, such as 'head_tracking'")
    values = {"env": {**keys, "num_envs": num_envs}, "training_steps": training_steps}
    try:
        config = jobs.compose("gymnasium", GymnasiumConfig, f"env={env}", *_body(keys.get("body")), values=values)
    except (ConfigError, HydraException) as error:
        raise ValueError(entry.one_line(error)) from None
    for key, reason in config.env.without_effect().items():
        if _is_given(keys, key):
            raise ValueError(f"{key}: has no effect {reason}")
    return config


def _body(body: Any) -> list[str]:
    """Overrides that choose the `body` of a person, so that the joints are scaled to it. Raises ConfigError."""
    if not isinstance(body, Mapping):
        return []
    return ["env/body=anthropometric", *(f"env.body.{key}={value}" for key, value in read(Person, body, "env.body"))]


def _is_given(keys: Mapping[str, Any], dotted: str) -> bool:
    """Whether the nested `keys` hold `dotted`, such as reward.tolerance."""
    first, _, rest = dotted.partition(".")
    if first not in keys or keys[first] is None:
        return False
    return not rest or (isinstance(keys[first], Mapping) and _is_given(keys[first], rest))
