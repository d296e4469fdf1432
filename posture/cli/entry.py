"""The one way from a command line to a task: Hydra composes, we check, bad input ends in one line and exit code 2.

Of a sweep every job is checked before the first begins; one that fails does not stop the others, and the end names it.
"""

import contextlib
import importlib
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn, TypeVar

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException
from pydantic import BaseModel

from posture.cli import jobs, signals, sweep
from posture.cli.ranges import expand_ranges
from posture.config.errors import ConfigError, RunError
from posture.config.published import CONF
from posture.config.reading import read

Config = TypeVar("Config", bound=BaseModel)


def run(name: str, kind: type[Config], task: Callable[[Config, Path], None]) -> None:
    """Compose conf/`name`.yaml with the command line's overrides, check it as `kind`, and call `task(config, folder)` for
    each job, where `folder` is the job's own. Exits with 2 on bad input, with 1 where a job failed at run time, and with 130
    or 143 where SIGINT or SIGTERM stopped it."""
    with signals.handled():
        _run(name, kind, task)


def _run(name: str, kind: type[Config], task: Callable[[Config, Path], None]) -> None:
    # Hydra would print errors of a task its own way and exit with 1; they are ours to report.
    os.environ["HYDRA_FULL_ERROR"] = "1"
    # Not that of __main__, which the processes of a parallel sweep could not import.
    if task.__module__ == "__main__":
        spec = sys.modules["__main__"].__spec__
        assert spec is not None  # started by python -m
        task = getattr(importlib.import_module(spec.name), task.__name__)
    try:
        command = jobs.check(name, kind, _expanded(sys.argv[1:]))
        sys.argv[1:] = command.argv
        start = hydra.main(version_base="1.3", config_path=str(CONF), config_name=name)
        if command.launcher is None:
            start(lambda composed: _alone(kind, task, composed))()
            return
        quiet = command.launcher != "basic"
        standing = sweep.Standing(command.jobs)
        announced = {} if quiet else {os.path.abspath(job.folder): i for i, job in enumerate(command.jobs, 1)}

        def job(composed: DictConfig) -> None:
            folder = Path(HydraConfig.get().runtime.output_dir)
            if str(folder) in announced:
                print(f"== job {announced[str(folder)]} of {len(announced)}, {folder.name}", flush=True)
            sweep.guarded(lambda: task(read(kind, jobs.plain(composed)), folder), folder, quiet)
            if announced:
                print(f"sweep: {standing.line()}", flush=True)

        with sweep.told(standing, "sweep") if quiet else contextlib.nullcontext():
            _sweep(start(job))
    except (ConfigError, HydraException, OmegaConfBaseException) as error:
        _refuse(error)
    if not sweep.sum_up(command.jobs, standing.before):
        sys.exit(1)


def in_sweep() -> bool:
    """Whether the present job is one of a sweep."""
    return bool(HydraConfig.get().mode == RunMode.MULTIRUN)


def experiment() -> str | None:
    """The experiment of conf/experiment/ that the present job belongs to, if any."""
    return HydraConfig.get().runtime.choices.get("experiment")


def overridden_keys() -> set[str]:
    """Keys that the present job's command line sets."""
    return {override.split("=", 1)[0].lstrip("+~") for override in HydraConfig.get().overrides.task}


def one_line(error: Exception) -> str:
    """An error's message without line breaks and without what Hydra and OmegaConf add for their own developers."""
    cause = error.__cause__
    if isinstance(cause, ConfigError):  # raised while a folder's name was resolved
        return str(cause)
    if isinstance(cause, (ConfigAttributeError, ConfigKeyError)) and cause.parent_node is not None:
        return f"{cause.full_key}: no such key; allowed there are {', '.join(map(str, cause.parent_node))}"
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    text = re.sub(
        r"\n\s*(full_key|object_type|Config search path|To append to your config|See https).*", "", str(error), flags=re.S
    )
    return " ".join(text.split())


def _sweep(start: Callable[[], None]) -> None:
    """Run a sweep. Where its launcher breaks (a process was killed, a cluster's job ran out of time), say so.

    What is done, the jobs' folders tell.
    """
    try:
        start()
    except (ConfigError, HydraException, OmegaConfBaseException):
        raise
    except Exception as error:
        print(f"error: the launcher stopped: {type(error).__name__}: {one_line(error)}", file=sys.stderr)


def _alone(kind: type[Config], task: Callable[[Config, Path], None], composed: DictConfig) -> None:
    try:
        task(read(kind, jobs.plain(composed)), Path(HydraConfig.get().runtime.output_dir))
    except ConfigError as error:
        _refuse(error)  # here, since Hydra would add lines of its own
    except (FloatingPointError, RunError, OSError) as error:
        print(f"error: {one_line(error)}", file=sys.stderr)
        sys.exit(1)


def _refuse(error: Exception) -> NoReturn:
    print(f"error: {one_line(error)}", file=sys.stderr)
    sys.exit(2)


def _expanded(argv: list[str]) -> list[str]:
    try:
        return expand_ranges(argv)
    except ValueError as error:
        raise ConfigError(str(error)) from None
