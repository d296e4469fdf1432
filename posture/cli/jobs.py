"""The jobs of a command line: each composed and checked before the first begins, with the folder that it will have.

A slip in the last of eight values thus does not surface after seven trainings, and a sweep can be watched and summed up from
its folders alone, whichever of Hydra's launchers runs it.
"""

import contextlib
import errno
import hashlib
import json
import os
import re
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hydra
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import BaseModel

from posture.cli.ranges import override_slug
from posture.config.device import check_device
from posture.config.errors import ConfigError
from posture.config.published import CONF, without_published
from posture.config.reading import read
from posture.config.train import TrainConfig
from posture.storage import run_dir
from posture.storage.code_version import envs_version

DECIDES_THE_POLICY = {"env", "agent", "seed", "processes", "max_iterations"}
"""The keys of a training that its policy depends on."""


@dataclass(frozen=True)
class Job:
    """One job: its checked configuration and its folder. Of a sweep `folder` is known beforehand."""

    config: BaseModel
    folder: Path

    @property
    def name(self) -> str:
        """What it is called in messages: its sweep and itself."""
        return f"{self.folder.parent.name}/{self.folder.name}"


@dataclass(frozen=True)
class Command:
    """A command line that has been checked.

    argv: what Hydra is to be called with. launcher: that of Hydra's which runs the sweep; None where it is no sweep.
    """

    argv: list[str]
    jobs: list[Job]
    launcher: str | None


def check(name: str, kind: type[BaseModel], argv: Sequence[str]) -> Command:
    """Compose conf/`name`.yaml with `argv` and check every job as `kind`. Raises ConfigError and what Hydra raises."""
    flags = {argument.split("=", 1)[0] for argument in argv if argument.startswith("-")}
    if flags - {"-m", "--multirun"}:
        return Command(list(argv), [], None)  # --help, --cfg and the like run no job
    given = [argument for argument in argv if not argument.startswith("-")]
    with _input(), hydra.initialize_config_dir(str(CONF), version_base="1.3"):
        if not flags:
            composed = _composed(name, given)
            config = _checked(kind, composed)
            if not Path(composed.hydra.run.dir).is_dir():  # an evaluation need not write where it is started
                _check_folder(Path(composed.hydra.run.dir))
            return Command(list(argv), [Job(config, Path())], None)
        parser = OverridesParser.create(GlobalHydra.instance().config_loader())
        parsed = parser.parse_overrides(given)
        fixed = [override for override in parsed if not override.is_sweep_override()]
        whole = _composed(name, [_text(override) for override in fixed])
        swept = {str(key): str(value) for key, value in (whole.hydra.sweeper.get("params") or {}).items()}
        more = []
        if not any(_key(override) == "hydra.sweep.dir" for override in parsed):
            # Named once, here: launchers that start processes would each name it anew.
            folder = str(whole.hydra.sweep.dir).replace("\\", "\\\\").replace("'", "\\'")
            more.append(f"hydra.sweep.dir='{folder}'")
        # A job's folder is named by what is swept, not by what all jobs share.
        shared = [_key(o) for o in fixed if _key(o) not in swept and not _key(o).startswith("hydra")]
        more.append(f"hydra.job.config.override_dirname.exclude_keys=[{','.join(shared)}]")
        batches = BasicSweeper.split_arguments(
            parser.parse_overrides([*(f"{key}={value}" for key, value in swept.items()), *given, *more]), None
        )
        jobs = []
        for number, overrides in enumerate(job for batch in batches for job in batch):
            composed = _composed(name, [*overrides, f"hydra.job.num={number}"])
            config = _checked(kind, composed)
            if getattr(config, "resume", None) is not None:
                raise ConfigError("resume goes on with one run: not together with -m")
            jobs.append(Job(config, Path(composed.hydra.sweep.dir) / composed.hydra.sweep.subdir))
        _check_folders(jobs, Path(str(whole.hydra.sweep.dir)))
        return Command([*argv, *more], jobs, str(whole.hydra.runtime.choices["hydra/launcher"]))


def plain(composed: DictConfig) -> dict[str, Any]:
    """The composed configuration, without Hydra's own part and the published numbers, as plain values."""
    own = OmegaConf.masked_copy(composed, [str(key) for key in composed if key != "hydra"])
    values = OmegaConf.to_container(own, resolve=True)
    assert isinstance(values, dict)
    return without_published({str(key): value for key, value in values.items()})


def sweep_folder(parent: str, experiment: str | None) -> str:
    """Folder of the sweep that is about to start: that of the experiment, or a new one. A resolver of conf/."""
    return run_dir.folder_for(parent, None) if experiment is None else str(Path(parent) / experiment)


def job_folder(number: int, overrides: str, experiment: str | None, *, _root_: DictConfig) -> str:
    """Name of a job's folder within its sweep's. A resolver of conf/.

    Of a training in an experiment it ends in a digest of all that its policy depends on, so that the same job finds what it
    did before, and another never overwrites it.
    """
    slug = override_slug(overrides)
    if experiment is None:
        return f"{number}_{slug}"
    values = plain(_root_)
    return f"{slug}_{identity(read(TrainConfig, values))}" if "agent" in values else slug


def identity(config: TrainConfig) -> str:
    """Eight hexadecimal digits that stand for a training: its configuration and the code of the physics and the task."""
    own = config.model_dump(mode="json", include=DECIDES_THE_POLICY)
    text = json.dumps([own, envs_version()], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:8]


OmegaConf.register_new_resolver("posture.run_folder", run_dir.folder_for, use_cache=True, replace=True)
OmegaConf.register_new_resolver("posture.sweep_folder", sweep_folder, use_cache=True, replace=True)
OmegaConf.register_new_resolver("posture.job_folder", job_folder, replace=True)


def _check_folders(jobs: Sequence[Job], sweep: Path) -> None:
    """Raise ConfigError unless every job has a folder of its own within that of the sweep, in which it can write."""
    if not jobs:
        raise ConfigError("the sweep is empty: a range or choice has no value in it")
    seen: set[Path] = set()
    for job in jobs:
        if sweep.resolve() not in job.folder.resolve().parents:
            raise ConfigError(
                f"hydra.sweep.subdir: the job's folder {job.folder} does not lie within that of the sweep, {sweep}"
            )
        if job.folder.resolve() in seen:
            raise ConfigError(f"two jobs of the sweep would have the folder {job.folder}: give each value once")
        seen.add(job.folder.resolve())
        _check_folder(job.folder)


def _check_folder(folder: Path) -> None:
    """Raise ConfigError where `folder` is not there and cannot be made, or where it cannot be written to; makes nothing."""
    try:
        near = next(place for place in (folder, *folder.absolute().parents) if place.exists() or place.is_symlink())
        if not near.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        with tempfile.TemporaryFile(dir=near):
            pass
    except OSError as error:
        raise ConfigError(f"cannot write to the folder {folder}: {error.strerror}") from None


@contextlib.contextmanager
def _input() -> Iterator[None]:
    """Within it whatever Hydra raises is an answer to the user's input: it meets some of that with errors of Python."""
    try:
        yield
    except (ConfigError, HydraException, OmegaConfBaseException):
        raise
    except Exception as error:
        raise ConfigError(f"the command line cannot be read: {error}") from None


def _composed(name: str, overrides: list[str]) -> DictConfig:
    return hydra.compose(name, overrides, return_hydra_config=True)


def _checked(kind: type[BaseModel], composed: DictConfig) -> BaseModel:
    config = read(kind, plain(composed))
    check_device(getattr(config, "device", "cpu"))
    return config


def _key(override: Override) -> str:
    return re.split("@", override.get_key_element().lstrip("+~"))[0]


def _text(override: Override) -> str:
    assert override.input_line is not None
    return override.input_line
