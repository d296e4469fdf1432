"""The policies that the page offers: trained networks, and a model-based controller."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import torch

from envs.body.segments import Segments
from envs.config import EnvConfig, Person
from posture.config.body import with_body
from posture.config.errors import ConfigError
from posture.config.eval import LqrConfig
from posture.config.play import SETTINGS
from posture.config.reading import read
from posture.config.train import TrainConfig
from posture.learning.networks import load_policy
from posture.play.environment import PlayEnv, Settings, play_config
from posture.play.lqr import ReplanningLqr
from posture.play.theory_worker import TheoryWorker
from posture.storage import checkpoint, run_dir
from posture.storage.run_dir import PRETRAINED

LQR = "lqr"


class Controller(Protocol):
    """Computes the normalised torques of hip and ankle."""

    message: str
    """A message for the user about the controller's state; empty if none."""

    def act(self, env: PlayEnv, settings: Settings) -> torch.Tensor:
        """The action for the next control step, (1, 2)."""

    def reset(self) -> None:
        """Start again, for a stander that is upright and at rest."""


@dataclass(frozen=True)
class PolicyChoice:
    """A policy that can be chosen. name: shown in the list. env: the environment it was made for, as used on the page.
    model, run: its checkpoint and the configuration of that run; None for the model-based controller."""

    name: str
    env: EnvConfig
    model: Path | None = None
    run: TrainConfig | None = None

    def env_with(self, body: Person | None) -> EnvConfig:
        """The environment with another body and joints scaled to it. Raises ConfigError if such joints are not allowed."""
        try:
            return read(EnvConfig, with_body(self.env, body))
        except ConfigError as error:
            raise ConfigError(f"joints scaled to this body: {error}") from None

    def not_trained_on(self, settings: Settings) -> list[str]:
        """Those of the settings that the policy did not meet in its training; none for the model-based controller."""
        if self.run is None:
            return []
        env = self.run.env
        met: dict[str, tuple[float, ...]] = {
            name: (getattr(env, name),) for name in ("hip_k", "ankle_k", "load", "amplitude")
        }
        met["tolerance"] = (env.head_tolerance,) if env.head_tolerance else ()
        met["freq"] = (
            (env.ramp.start, env.ramp.end) if env.ramp else env.freq if isinstance(env.freq, tuple) else (env.freq,)
        )
        met |= {name: bounds for name, bounds in env.ranges.given.items() if name in SETTINGS}
        margin = 1e-6  # sliders round
        return ["body"] * (settings.body != env.body) + [
            name
            for name, values in met.items()
            if values and not min(values) - margin <= getattr(settings, name) <= max(values) + margin
        ]

    def load(self, lqr: LqrConfig, worker: TheoryWorker, body: Segments) -> Controller:
        """The controller. Raises ConfigError if the checkpoint does not hold the policy of its run."""
        if self.model is None or self.run is None:
            return ReplanningLqr(lqr, worker, body)
        return TrainedPolicy(self.model, self.run)


class TrainedPolicy:
    """The deterministic policy of a checkpoint, a `Controller`."""

    message = ""

    def __init__(self, model: Path, run: TrainConfig) -> None:
        self._policy = load_policy(checkpoint.load(model, "cpu"), run, model, "cpu")

    def act(self, env: PlayEnv, settings: Settings) -> torch.Tensor:
        """See `Controller`."""
        return self._policy(env.get_observations())

    def reset(self) -> None:
        """See `Controller`."""
        self._policy.reset()


def policy_choices(ckpt: str, lqr: LqrConfig) -> list[PolicyChoice]:
    """The policies that `ckpt` names, then the shipped ones, then the model-based controller. Raises ConfigError."""
    controller = PolicyChoice(LQR, play_config(lqr.env))
    first = [controller] if ckpt == LQR else [_trained(model) for model in run_dir.find_checkpoints(ckpt)]
    for choice in first:
        if choice.model is not None and choice.run is not None:
            TrainedPolicy(choice.model, choice.run)  # reports a file that cannot be used before the page opens
    shipped = [path for path in PRETRAINED.iterdir() if run_dir.is_run(path)] if PRETRAINED.is_dir() else []
    shipped.sort(key=lambda path: (path.name != "default", path.name.split("-")[0], _number(path.name)))
    models = [model for model in map(run_dir.newest_model, shipped) if model is not None]
    unique: dict[str, PolicyChoice] = {}
    for choice in [*first, *map(_trained, models), controller]:
        unique.setdefault(choice.name, choice)
    return list(unique.values())


def _trained(model: Path) -> PolicyChoice:
    run = run_dir.read_config(model.parent)
    name = f"pretrained/{model.parent.name}" if run_dir.is_shipped(model) else f"{model.parent.name}/{model.stem}"
    try:
        return PolicyChoice(name, play_config(run.env), model, run)
    except ValueError as error:
        raise ConfigError(f"{model}: not usable on the page ({' '.join(str(error).split())})") from None


def _number(name: str) -> float:
    value = name.rpartition("-")[2]
    return float(value) if value.replace(".", "", 1).isdigit() else 0.0
