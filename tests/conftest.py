"""Shared fixtures: configurations composed from conf/, and one small simulation that several tests look at."""

import functools
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import pytest
import torch
from hypothesis import settings
from pydantic import BaseModel

from envs.body.segments import Segments, read_segments
from envs.config import EnvConfig
from posture.cli import jobs
from posture.config.eval import EvalConfig
from posture.config.train import TrainConfig

Schema = TypeVar("Schema", bound=BaseModel)

# Tests are tiny: one thread each for torch, here and in the processes that tests start, is faster than several.
torch.set_num_threads(1)
os.environ.setdefault("OMP_NUM_THREADS", "1")

# A shell starts background jobs with SIGINT ignored; the processes that tests interrupt would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Generated inputs: few for each commit, many with `HYPOTHESIS_PROFILE=thorough`.
settings.register_profile("quick", max_examples=20, deadline=None)
settings.register_profile("thorough", max_examples=500, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))


@functools.cache
def composed(command: str, schema: type[Schema], overrides: tuple[str, ...]) -> Schema:
    """The checked configuration of a command with these overrides. Configurations are immutable, so tests share them."""
    return jobs.compose(command, schema, *overrides)


def compose(*overrides: str) -> TrainConfig:
    """The checked training configuration that these overrides give."""
    return composed("train", TrainConfig, overrides)


def compose_eval(*overrides: str) -> EvalConfig:
    """The checked evaluation configuration that these overrides give."""
    return composed("eval", EvalConfig, overrides)


@pytest.fixture(scope="session")
def env_config() -> Callable[..., EnvConfig]:
    """A function from Hydra overrides to the environment's configuration, by default with four worlds."""
    return lambda *overrides: compose("env.num_envs=4", "agent.algorithm.num_mini_batches=1", *overrides).env


@pytest.fixture(scope="session")
def config(env_config: Callable[..., EnvConfig]) -> EnvConfig:
    """The default environment's configuration, with four worlds."""
    return env_config()


@pytest.fixture(scope="session")
def body(config: EnvConfig) -> Segments:
    """The default body as the theory reads it from the simulation."""
    return read_segments(config)


@pytest.fixture(autouse=True)
def _seeded() -> None:
    torch.manual_seed(0)


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The working directory is a folder of this test alone: commands write to runs/ there."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="session")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run of two tiny iterations, made once; tests damage copies of it."""
    from tests.commands import TINY, call, runs

    folder = tmp_path_factory.mktemp("sound")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        call(patch, "train", *TINY, "evaluate=false")
        return folder / runs()[0]
