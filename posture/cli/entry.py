"""From a command line to a task: Hydra composes the configuration, and we check it.

Bad input is reported in one line, with exit code 2. Every job of a sweep is checked before the first one starts. A job that
fails does not stop the others; the summary names it.
"""

import contextlib
import importlib
import os
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException, OverrideParseException
from hydra.types import RunMode
from omegaconf import DictConfig
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, ConfigTypeError, OmegaConfBaseException
from pydantic import BaseModel

from envs.config import ConstraintOverflowError, Ramp
from posture.cli import jobs, output, signals, sweep
from posture.config import torchrun
from posture.config.errors import ConfigError, RunError
from posture.config.published import CONF
from posture.config.reading import read
from posture.storage import kernel_cache, run_dir
from posture.storage.lock import locked

Config = TypeVar("Config", bound=BaseModel)

FAILURES = (ConstraintOverflowError, FloatingPointError, RunError, OSError)
"""Failures at run time whose message is enough; others are mistakes in the program, and end in a traceback."""
_BAD_INPUT = (ConfigError, HydraException, OmegaConfBaseException)


def run(
    name: str,
    kind: type[Config],
    task: Callable[[Config, Path], Any],
    check: Callable[[Sequence[Config], bool], None] | None = None,
) -> None:
    """Run a command: `task(config, folder)` for each job of the command line, `folder` being the job's own.

    The configuration is conf/`name`.yaml with the command line's overrides, checked as `kind`. `check(configs, in_sweep)`
    is called once, before the first job: it raises ConfigError where a job could not run here. What `task` returns is for
    the sweeper of a search. Exits with 2 on bad input, with 1 if a job failed at run time, and with 128 + its number if a
    signal stopped it. Output that fails never ends the work.
    """
    output.install()
    # Hydra would otherwise print a task's errors itself and exit with 1.
    os.environ["HYDRA_FULL_ERROR"] = "1"
    # Figures go to files only. A notebook names a backend that its own kernel has and this Python may not.
    os.environ["MPLBACKEND"] = "agg"
    # The processes of a parallel sweep cannot import a function of __main__.
    if task.__module__ == "__main__":
        spec = sys.modules["__main__"].__spec__
        assert spec is not None  # started by python -m
        task = getattr(importlib.import_module(spec.name), task.__name__)
    with signals.handled():
        try:
            command = jobs.check(name, kind, sys.argv[1:])
            sys.argv[1:] = command.argv
            if command.jobs:
                _check_processes(name, command)
                if check is not None:
                    configs = [job.config for job in command.jobs if isinstance(job.config, kind)]
                    check(configs, command.launcher is not None)
            with kernel_cache.writable() if command.jobs else contextlib.nullcontext():
                if command.launcher is None:
                    with run_dir.removed_if_empty(*(job.folder for job in command.jobs)):
                        _start(command, lambda composed: _run_single(kind, task, composed))
                    return
                progress = sweep.SweepProgress([] if command.search else command.jobs)
                _run_sweep(command, kind, task, progress)
            done = sweep.trials(command.jobs[0].folder.parent) if command.search else command.jobs
        except _BAD_INPUT as error:
            _refuse(error)
    if not sweep.print_summary(done, progress.done_before):
        sys.exit(1)


def in_sweep() -> bool:
    """Whether the current job is part of a sweep."""
    return bool(HydraConfig.get().mode == RunMode.MULTIRUN)


def has_folder() -> bool:
    """Whether the current job has a folder of its own: all have but a single evaluation, or a live page, without `out`."""
    return in_sweep() or HydraConfig.get().run.dir != ""


def experiment() -> str | None:
    """The experiment of conf/experiment/ that the current job belongs to, if any."""
    return HydraConfig.get().runtime.choices.get("experiment")


def overridden_keys() -> set[str]:
    """Keys that the current job's command line sets."""
    return {override.split("=", 1)[0].lstrip("+~") for override in HydraConfig.get().overrides.task}


def refuse(key: str, why: str) -> None:
    """Raise ConfigError if a single command sets `key`, which has no effect; in a sweep it may have one in another job."""
    if key in overridden_keys() and not in_sweep():
        raise ConfigError(f"{key}: has no effect {why}")


OPEN = ("sensing.noise", "staircase.courses")
"""Keys whose own keys the user chooses."""


def one_line(error: Exception) -> str:
    """An error's message without line breaks and without the details that Hydra and OmegaConf add for developers."""
    cause = error.__cause__
    if isinstance(cause, (ConfigAttributeError, ConfigKeyError)) and cause.parent_node is not None:
        parent = str(cause.full_key).rpartition(".")[0]
        if parent.endswith(OPEN):
            there = f"there are {', '.join(map(str, cause.parent_node))}; " if cause.parent_node else ""
            return f"{cause.full_key}: no such key; {there}+{cause.full_key}=.. adds it"
        if not cause.parent_node:  # null, a number or a list
            if parent.endswith("env.body"):
                return f"{cause.full_key}: no such key, since the body is the paper's; add env/body=anthropometric"
            record = "{" + ", ".join(f"{key}: .." for key in Ramp.model_fields) + "}"
            value = f"all of it, as in '{parent}={record}'" if parent.endswith(".ramp") else f"a value, as in {parent}=.."
            return f"{cause.full_key}: no such key, since {parent} has none; give {value}"
        return f"{cause.full_key}: no such key; allowed there are {', '.join(map(str, cause.parent_node))}"
    if isinstance(cause, ConfigTypeError) and cause.full_key:
        return f"{cause.full_key}: it has keys of its own, which are given one by one, as in {cause.full_key}.<key>=.."
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    text = re.sub(
        r"\n\s*(full_key|object_type|Config search path|To append to your config|See https).*", "", str(error), flags=re.S
    )
    return " ".join(text.removeprefix("ConfigError raised while resolving interpolation: ").split())


def _run_single(kind: type[Config], task: Callable[[Config, Path], Any], composed: DictConfig) -> None:
    folder = Path(HydraConfig.get().runtime.output_dir)
    try:
        with locked(folder) if has_folder() else contextlib.nullcontext():
            task(read(kind, jobs.plain(composed)), folder)
    except ConfigError as error:
        _refuse(error)  # not further up, because Hydra adds its own lines
    except FAILURES as error:
        signals.raise_stopped(error)
        print(f"error: {one_line(error)}", file=sys.stderr)
        sys.exit(1)


def _run_sweep(
    command: jobs.Command, kind: type[Config], task: Callable[[Config, Path], Any], progress: sweep.SweepProgress
) -> None:
    """Run all jobs. The basic launcher announces each of them; others, which run several at once, report at intervals."""
    parallel = command.launcher != "basic"
    numbers = (
        {}
        if parallel or command.search
        else {os.path.abspath(job.folder): number for number, job in enumerate(command.jobs, 1)}
    )

    def run_job(composed: DictConfig) -> Any:
        output.install()  # a launcher may run jobs in processes of its own
        folder = Path(HydraConfig.get().runtime.output_dir)
        if str(folder) in numbers:
            print(f"== job {numbers[str(folder)]} of {len(numbers)}, {folder.name}", flush=True)
        result = sweep.run_job(lambda: task(read(kind, jobs.plain(composed)), folder), folder, to_log=parallel)
        if numbers:
            print(f"sweep: {progress.line()}", flush=True)
        return result

    with sweep.report_periodically(progress, "sweep") if parallel and not command.search else contextlib.nullcontext():
        try:
            _start(command, run_job)
        except _BAD_INPUT:
            raise
        except Exception as error:  # a process was killed, or a cluster job ran out of time
            signals.raise_stopped(error)
            print(f"error: the launcher stopped: {type(error).__name__}: {one_line(error)}", file=sys.stderr)


def _check_processes(name: str, command: jobs.Command) -> None:
    """Raise ConfigError if this process is one of several that cannot share this command."""
    place = torchrun.place() or torchrun.Place()
    if place.size > 1 and (name != "train" or command.launcher is not None):
        raise ConfigError(
            f"WORLD_SIZE={place.size}: only one training can be shared among processes; start "
            f"{f'posture.{name}' if command.launcher is None else 'a sweep'} without torchrun, or unset WORLD_SIZE"
        )
    if name == "train" and {"RANK", "WORLD_SIZE"} & os.environ.keys() and (problem := torchrun.problem()):
        print(
            f"RANK and WORLD_SIZE have no effect: to share a training among processes, torchrun sets "
            f"{', '.join(torchrun.VARIABLES)} ({problem})",
            file=sys.stderr,
        )


def _start(command: jobs.Command, job: Callable[[DictConfig], Any]) -> None:
    """Let Hydra run the jobs. Raises ConfigError for an error of Hydra or of a launcher before the first of them."""
    began = False
    # Errors that may be those of a job in another process.
    elsewhere = (OSError, RuntimeError) if command.launcher not in (None, "basic") else ()

    def run_here(composed: DictConfig) -> Any:
        nonlocal began
        began = True
        # Paths are relative to the directory in which the command was started, with hydra.job.chdir, too.
        os.chdir(HydraConfig.get().runtime.cwd)
        return job(composed)

    try:
        hydra.main(version_base="1.3", config_path=str(CONF), config_name=command.config_name)(run_here)()
    except Exception as error:
        if began or isinstance(error, (*_BAD_INPUT, *elsewhere)):
            raise
        raise ConfigError(f"Hydra cannot start the command, see its keys hydra.*: {one_line(error)}") from None


def _refuse(error: Exception) -> NoReturn:
    signals.raise_stopped(error)
    line = one_line(error)
    if isinstance(error, OverrideParseException):
        line = f"{str(error.override)!r:.200}: {line}; in a shell, values with braces, brackets or spaces need quotes"
    print(f"error: {line}", file=sys.stderr)
    sys.exit(2)
