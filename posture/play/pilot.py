"""Who moves the stander: a trained policy, or the model-based controller as the sliders move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import torch

from envs.body.segments import Segments
from envs.config import EnvConfig
from posture.config.errors import ConfigError
from posture.config.eval import LqrConfig
from posture.config.train import TrainConfig
from posture.learning.networks import load_policy
from posture.play.knobs import Knobs
from posture.play.planned import Planned
from posture.play.steered import SteeredEnv, steered_config
from posture.play.theory import Office
from posture.storage import checkpoint, run_dir
from posture.storage.run_dir import PRETRAINED

LQR = "lqr"


class Pilot(Protocol):
    """Gives the normalised torques of hip and ankle."""

    note: str
    """What there is to say of it just now; empty: nothing."""

    def act(self, env: SteeredEnv, knobs: Knobs) -> torch.Tensor:
        """The action for the present moment, (1, 2)."""


@dataclass(frozen=True)
class Candidate:
    """A pilot to choose. name: in the list. env: the environment it was made for, as it is played in. model, run: its
    checkpoint and that run's configuration; None of the model-based controller."""

    name: str
    env: EnvConfig
    model: Path | None
    run: TrainConfig | None


class Trained:
    """The deterministic policy of a checkpoint."""

    note = ""

    def __init__(self, candidate: Candidate, env: SteeredEnv) -> None:
        """Raises ConfigError where the checkpoint does not hold the policy of its run."""
        assert candidate.model is not None and candidate.run is not None
        self._policy = load_policy(checkpoint.load(candidate.model, "cpu"), candidate.run, candidate.model, "cpu")

    def act(self, env: SteeredEnv, knobs: Knobs) -> torch.Tensor:
        """See `Pilot`."""
        return self._policy(env.get_observations())


def board(candidate: Candidate, env: SteeredEnv, lqr: LqrConfig, office: Office, body: Segments) -> Pilot:
    """The pilot itself, for `env`. Raises ConfigError."""
    return Planned(lqr, office, body) if candidate.model is None else Trained(candidate, env)


def candidates(ckpt: str, lqr: LqrConfig) -> list[Candidate]:
    """Those that `ckpt` means first, then those that are shipped, and the model-based controller. Raises ConfigError."""
    controller = Candidate(LQR, steered_config(lqr.env), None, None)
    models = [] if ckpt == LQR else run_dir.find_checkpoints(ckpt)
    named = [_candidate(model) for model in models]
    for candidate in named:
        checkpoint.load(candidate.model, "cpu")  # type: ignore[arg-type]  # a damaged file is told of before the page opens
    shipped = sorted(path for path in PRETRAINED.iterdir() if run_dir.is_run(path)) if PRETRAINED.is_dir() else []
    shipped.sort(key=lambda path: (path.name != "default", path.name.split("-")[0], _number(path.name)))
    others = [_candidate(model) for model in map(run_dir.newest_model, shipped) if model is not None and model not in models]
    return _distinct([*([controller] if ckpt == LQR else []), *named, *others, *([] if ckpt == LQR else [controller])])


def _candidate(model: Path) -> Candidate:
    run = run_dir.read_config(model.parent)
    folder = model.parent
    name = f"pretrained/{folder.name}" if run_dir.is_shipped(model) else f"{folder.name}/{model.stem}"
    try:
        env = steered_config(run.env)
    except ValueError as error:
        raise ConfigError(f"{model}: cannot be played with ({' '.join(str(error).split())})") from None
    return Candidate(name, env, model, run)


def _distinct(found: Sequence[Candidate]) -> list[Candidate]:
    return list({candidate.name: candidate for candidate in reversed(found)}.values())[::-1]


def _number(name: str) -> float:
    value = name.rpartition("-")[2]
    return float(value) if value.replace(".", "", 1).isdigit() else 0.0
