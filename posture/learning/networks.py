"""The actor and the critic of a run, built from its configuration, and the policy loaded from a checkpoint.

This needs neither the environment nor the physics, so a checkpoint that does not fit is refused before physics is built.
"""

from pathlib import Path
from typing import Any, Literal

import torch
from rsl_rl.models import MLPModel, RNNModel
from tensordict import TensorDict

from envs.body.joints import KINDS
from posture.config.errors import ConfigError
from posture.config.train import TrainConfig
from posture.storage import checkpoint


def network(run: TrainConfig, name: Literal["actor", "critic"]) -> MLPModel:
    """The actor or the critic that `run` trains, with initial weights."""
    sizes = {group: len(values) for group, values in run.env.observed.items()}
    observations = TensorDict({group: torch.zeros(1, size) for group, size in sizes.items()}, batch_size=[1])
    groups = {name: list(getattr(run.agent.obs_groups, name))}
    config = getattr(run.agent, name).model_dump(mode="json", exclude_none=True)
    model = {"MLPModel": MLPModel, "RNNModel": RNNModel}[config.pop("class_name")]
    return model(observations, groups, name, len(KINDS) if name == "actor" else 1, **config)


def load_policy(content: dict[str, Any], run: TrainConfig, model: Path, device: str | torch.device) -> MLPModel:
    """The deterministic policy in the `content` of checkpoint `model`, with averaged weights where it has them
    (`agent.average_from`). Raises ConfigError if it does not fit `run`."""
    return load_network(checkpoint.as_policy(content), run, "actor", model).to(device).eval()


def load_network(content: dict[str, Any], run: TrainConfig, name: Literal["actor", "critic"], model: Path) -> MLPModel:
    """The network `name` of `run` with the weights of a checkpoint. Raises ConfigError unless all fit and are finite."""
    net = network(run, name)
    own, saved = net.state_dict(), content.get(f"{name}_state_dict")
    problem = f"{model}: does not hold this run's {'policy' if name == 'actor' else 'value function'}"
    if not isinstance(saved, dict):
        raise ConfigError(f"{problem} (no {name}_state_dict)")
    if saved.keys() != own.keys():
        wrong = sorted(map(str, saved.keys() ^ own.keys()))
        raise ConfigError(f"{problem} (too much or missing: {', '.join(wrong):.150})")
    for key, value in own.items():
        given = saved[key]
        if not isinstance(given, torch.Tensor) or given.shape != value.shape or given.dtype != value.dtype:
            raise ConfigError(f"{problem} ({key} is {_describe(given)}; allowed is {_describe(value)})")
        if not bool(given.isfinite().all()):
            raise ConfigError(f"{model}: {key} holds weights that are not finite")
    net.load_state_dict(saved)
    return net


def _describe(value: Any) -> str:
    if not isinstance(value, torch.Tensor):
        return type(value).__name__
    return f"{str(value.dtype).removeprefix('torch.')} of shape {tuple(value.shape)}"
