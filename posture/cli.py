"""The one way from a command line to a task: Hydra composes, we check, bad input ends in one line and exit code 2.

Every job of a sweep is composed and checked before the first begins, so that a slip in the last of eight values does not
surface after seven trainings.
"""

import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import hydra
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException
from pydantic import BaseModel

from posture import run_dir
from posture.config import ConfigError, check_device, read
from posture.sweep import expand_ranges, override_slug

CONF = Path(__file__).resolve().parent.parent / "conf"
Config = TypeVar("Config", bound=BaseModel)


def run(name: str, kind: type[Config], task: Callable[[Config, Path], None]) -> None:
    """Compose conf/`name`.yaml with the command line's overrides, check it as `kind`, and call `task(config, folder)` for
    each job, where `folder` is the job's own. Exits with 2 on bad input."""
    # Hydra would print errors of a task its own way and exit with 1; they are ours to report.
    os.environ["HYDRA_FULL_ERROR"] = "1"
    OmegaConf.register_new_resolver("posture.run_folder", run_dir.folder_for, use_cache=True, replace=True)
    OmegaConf.register_new_resolver("posture.slug", override_slug, replace=True)

    def job(composed: DictConfig) -> None:
        try:
            config = read(kind, plain(composed))
            task(config, Path(HydraConfig.get().runtime.output_dir))
        except ConfigError as error:
            _refuse(error)  # here, since Hydra would add lines of its own

    try:
        sys.argv[1:] = _expanded(sys.argv[1:])
        sys.argv[1:] = _check_jobs(name, kind, sys.argv[1:])
        hydra.main(version_base="1.3", config_path=str(CONF), config_name=name)(job)()
    except (ConfigError, HydraException, OmegaConfBaseException) as error:
        _refuse(error)


def plain(composed: DictConfig) -> dict[str, Any]:
    """The composed configuration, without Hydra's own part, as plain values."""
    values = OmegaConf.to_container(composed, resolve=True)
    assert isinstance(values, dict)
    return {str(key): value for key, value in values.items() if key != "hydra"}


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
    text = re.sub(
        r"\n\s*(full_key|object_type|Config search path|To append to your config|See https).*", "", str(error), flags=re.S
    )
    return re.sub(r"\s*\n\s*", " ", text).strip()


def _refuse(error: Exception) -> NoReturn:
    print(f"error: {one_line(error)}", file=sys.stderr)
    sys.exit(2)


def _expanded(argv: list[str]) -> list[str]:
    try:
        return expand_ranges(argv)
    except ValueError as error:
        raise ConfigError(str(error)) from None


def _check_jobs(name: str, kind: type[BaseModel], argv: list[str]) -> list[str]:
    """Check every job; the arguments with which Hydra is to be called."""
    flags = {argument.split("=", 1)[0] for argument in argv if argument.startswith("-")}
    if flags - {"-m", "--multirun"}:
        return argv  # --help, --cfg and the like run no job
    overrides = [argument for argument in argv if not argument.startswith("-")]
    parsed = OverridesParser.create().parse_overrides(overrides)
    fixed: list[str] = []
    with hydra.initialize_config_dir(str(CONF), version_base="1.3"):
        if flags:
            jobs = [list(job) for batch in BasicSweeper.split_arguments(parsed, None) for job in batch]
            fixed = [o.get_key_element().lstrip("+~") for o in parsed if not o.is_sweep_override()]
        else:
            jobs = [overrides]
        for job in jobs:
            try:
                composed = hydra.compose(name, job)
            except ValueError as error:  # what Hydra raises for a group that is given no name
                raise ConfigError(str(error)) from None
            config = read(kind, plain(composed))
            check_device(getattr(config, "device", "cpu"))
            if flags and getattr(config, "resume", None) is not None:
                raise ConfigError("resume goes on with one run: not together with -m")
    # A job's folder is named by what is swept, not by what all jobs share.
    names = [key for key in fixed if not key.startswith("hydra")]
    return [*argv, f"hydra.job.config.override_dirname.exclude_keys=[{','.join(names)}]"] if flags else argv
