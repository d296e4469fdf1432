"""The jobs of a command line, each composed and checked before the first one starts.

A mistake in the last of eight swept values is thus reported immediately, not after seven trainings. The folder of every
job is known in advance, so a sweep can be monitored from its folders, with any Hydra launcher.
"""

import argparse
import contextlib
import hashlib
import itertools
import json
import math
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import IntervalSweep, Override, Quote, QuotedString
from hydra.errors import HydraException, MissingConfigException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import BaseModel

from posture.cli.ranges import expand_ranges
from posture.config.body import for_body
from posture.config.checks import CommandConfig, Output, check_device
from posture.config.errors import ConfigError
from posture.config.published import CONF, without_published
from posture.config.reading import read
from posture.config.train import TrainConfig, amplitudes
from posture.storage import provenance, run_dir

Config = TypeVar("Config", bound=BaseModel)

MAX_DIFFERENCES = 8
"""Differences between two trainings that an error names."""
MAX_JOBS = 10_000
"""Jobs of one sweep; more are taken for a mistake."""
MAX_SLUG_LENGTH = 80
JOB_FILES = ("status.yaml", "error.txt", "log.txt", ".lock")
"""Files in the folder of each job of a sweep (posture/cli/sweep.py)."""


@dataclass(frozen=True)
class Job:
    """One job: its checked configuration, and its folder; that of an evaluation without `out` is the working directory.

    own: the overrides in which it differs from the other jobs of its sweep.
    """

    config: BaseModel
    folder: Path
    own: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name in messages: that of the sweep and its own."""
        return f"{self.folder.parent.name}/{self.folder.name}"


@dataclass(frozen=True)
class Command:
    """A checked command line.

    argv: the arguments for Hydra. config_name: the primary configuration. jobs: empty where only information is shown, as by
    --help. launcher: the Hydra launcher of a sweep; None if this is not a sweep. search: the jobs are examples, those of the
    sweep follow from the results of earlier ones.
    """

    argv: list[str]
    config_name: str
    jobs: list[Job]
    launcher: str | None
    search: bool = False


class _FlagParser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise ConfigError(f"{message}; --help lists the configuration, --hydra-help the flags")


def _flag_parser() -> _FlagParser:
    """Hydra's flags, except --config-path, which would hide our configuration, and --experimental-rerun."""
    parser = _FlagParser(add_help=False, allow_abbrev=False)
    parser.add_argument("overrides", nargs="*")
    parser.add_argument("--run", "-r", action="store_true")
    parser.add_argument("--multirun", "-m", action="store_true")
    parser.add_argument("--config-dir", "-cd")
    parser.add_argument("--config-name", "-cn")
    for flags in (["--help", "-h"], ["--hydra-help"], ["--version"], ["--shell-completion", "-sc"]):
        parser.add_argument(*flags, action="store_true", dest="shows")
    parser.add_argument("--cfg", "-c", choices=["job", "hydra", "all"])
    parser.add_argument("--resolve", action="store_true")
    parser.add_argument("--package", "-p")
    info = ["all", "config", "defaults", "defaults-tree", "plugins", "searchpath"]
    parser.add_argument("--info", "-i", nargs="?", const="all", choices=info)
    return parser


def check(name: str, kind: type[BaseModel], argv: Sequence[str]) -> Command:
    """Compose conf/`name`.yaml with `argv` and check every job as `kind`. Raises ConfigError and Hydra's own errors."""
    with _errors_are_bad_input():
        try:
            os.getcwd()
        except FileNotFoundError:
            raise ConfigError("the working directory has been deleted") from None
        flags = _flag_parser().parse_intermixed_args(list(argv))
        name = flags.config_name or name
        if (flags.cfg or flags.info) and (flags.multirun or flags.run):
            raise ConfigError("--cfg and --info show one configuration: leave out -m and --run")
        if flags.shows or flags.cfg or flags.info:
            return Command(list(argv), name, [], None)
        if flags.resolve or flags.package:
            raise ConfigError("--resolve and --package go together with --cfg")
        overrides = expand_ranges(flags.overrides)
        if flags.config_dir is not None:
            if not Path(flags.config_dir).is_dir():
                raise ConfigError(f"--config-dir: no such folder: {flags.config_dir}")
            overrides.append(f"hydra.searchpath=[{quoted(f'file://{Path(flags.config_dir).absolute()}')}]")
        with hydra.initialize_config_dir(str(CONF), version_base="1.3"):
            parser = OverridesParser.create(GlobalHydra.instance().config_loader())
            parsed = parser.parse_overrides(overrides)
            fixed = [override for override in parsed if not override.is_sweep_override()]
            common = _compose(name, [str(override.input_line) for override in fixed])
            if flags.multirun or common.hydra.mode == RunMode.MULTIRUN:
                return _check_sweep(name, kind, overrides, parsed, common)
            if len(fixed) < len(parsed):
                raise ConfigError("several values for one key make a sweep: add -m, or write a list as [a,b]")
            config = _checked(kind, common)
            _check_effect([config], fixed)
            swept = set(common.hydra.sweeper.get("params") or {}) - {override.key_or_group for override in fixed}
            if swept:
                print(f"one job: the experiment's values of {', '.join(sorted(swept))} need -m", file=sys.stderr)
            folder = str(common.hydra.run.dir)
            if folder:  # without one, an evaluation may be started in a folder that is read-only
                _check_writable(config, Path(folder))
                # Fixed here, because the name of a new folder depends on the time.
                overrides.append(f"hydra.run.dir={quoted(folder)}")
            if isinstance(config, TrainConfig):
                _check_run(config, Path(folder))
            return Command(overrides, name, [Job(config, Path(folder))], None)


def _check_sweep(
    name: str, kind: type[BaseModel], overrides: list[str], parsed: list[Override], common: DictConfig
) -> Command:
    """Check every job of a sweep. `common`: composed from those of the `parsed` overrides that are not swept.

    Of a search with Optuna, whose jobs follow from the results of earlier ones, those at the ends of each range are checked.
    """
    sweeper = common.hydra.runtime.choices["hydra/sweeper"]
    if sweeper not in ("basic", "optuna"):
        raise ConfigError("hydra/sweeper: allowed are basic, Hydra's own, and optuna")
    if sweeper == "optuna" and name != "train":
        raise ConfigError("hydra/sweeper=optuna: allowed is a search among trainings, posture.train")
    swept = {str(key): str(value) for key, value in (common.hydra.sweeper.get("params") or {}).items()}
    if any(override.key_or_group == "out" and override.is_sweep_override() for override in parsed):
        raise ConfigError("out: allowed is one folder; each job of a sweep gets its own in it")
    extra = []
    if not any(override.key_or_group == "hydra.sweep.dir" for override in parsed):
        # Fixed here: a launcher that starts processes would compute a new name in each.
        extra.append(f"hydra.sweep.dir={quoted(common.hydra.sweep.dir)}")
    # A job's folder is named after what is swept, not after what all jobs share.
    named = {*swept, *(o.key_or_group for o in parsed if o.is_sweep_override())}
    shared = [o.key_or_group for o in parsed if o.key_or_group not in named]
    extra.append(f"hydra.job.config.override_dirname.exclude_keys=[{','.join(map(quoted, shared))}]")
    parser = OverridesParser.create(GlobalHydra.instance().config_loader())
    every = parser.parse_overrides([*(f"{key}={value}" for key, value in swept.items()), *overrides, *extra])
    jobs = []
    for number, own in enumerate(_combinations(every) if sweeper == "basic" else _ends(every)):
        composed = _compose(name, [*own, f"hydra.job.num={number}"])
        config = _checked(kind, composed)
        if getattr(config, "resume", None) is not None:
            raise ConfigError("resume continues one run: not together with -m")
        if sweeper == "optuna" and not getattr(config, "evaluate", True):
            raise ConfigError("evaluate=false: a search compares evaluations")
        differs = tuple(override for override in own if override.partition("=")[0].lstrip("+") in named)
        jobs.append(Job(config, Path(composed.hydra.sweep.dir) / composed.hydra.sweep.subdir, differs))
    if sweeper == "basic":
        _check_folders(jobs, Path(common.hydra.sweep.dir))
    _check_effect([job.config for job in jobs], parsed)
    for job in jobs:
        if isinstance(job.config, TrainConfig) and sweeper == "basic":
            refuse_other_training(job.config, job.folder)
    launcher = str(common.hydra.runtime.choices["hydra/launcher"])
    return Command(["--multirun", *overrides, *extra], name, jobs, launcher, sweeper == "optuna")


def _combinations(overrides: Sequence[Override]) -> list[tuple[str, ...]]:
    """The overrides of each job, in the order of Hydra's basic sweeper. The last override of a key counts."""
    values: dict[str, list[str]] = {}
    for override in overrides:
        key = override.get_key_element()
        if not override.is_sweep_override():
            values[key] = [f"{key}={override.get_value_element_as_str()}"]
        elif override.is_discrete_sweep():
            few = itertools.islice(override.sweep_string_iterator(), MAX_JOBS + 1)
            values[key] = [f"{key}={value}" for value in few]
        else:
            raise ConfigError(f"{override.input_line}: an interval has no list of values; write a range or the values")
    if math.prod(map(len, values.values())) > MAX_JOBS:
        raise ConfigError(f"the sweep has more than {MAX_JOBS:,} jobs")
    return list(itertools.product(*values.values()))


def _ends(overrides: Sequence[Override]) -> list[tuple[str, ...]]:
    """Overrides with each swept key at either end of its range or at each of its choices, and the others at their first."""
    values: dict[str, list[str]] = {}
    for override in overrides:
        key, value = override.get_key_element(), override.value()
        if not override.is_sweep_override():
            values[key] = [f"{key}={override.get_value_element_as_str()}"]
        elif isinstance(value, IntervalSweep):
            values[key] = [f"{key}={value.start}", f"{key}={value.end}"]
        else:
            every = list(itertools.islice(override.sweep_string_iterator(), MAX_JOBS))
            ends = every if override.is_choice_sweep() else [every[0], every[-1]]
            values[key] = [f"{key}={end}" for end in ends]
    first = {key: own[0] for key, own in values.items()}
    return [tuple((first | {key: end}).values()) for key, own in values.items() for end in own[len(own) > 1 :]] or [
        tuple(first.values())
    ]


def compose(name: str, kind: type[Config], *overrides: str, values: Mapping[str, Any] | None = None) -> Config:
    """The checked configuration conf/`name`.yaml with `overrides`, then with `values`, for use outside a command, also in a
    program that itself runs under Hydra."""
    running = GlobalHydra.instance().hydra
    GlobalHydra.instance().clear()
    try:
        with hydra.initialize_config_dir(str(CONF), version_base="1.3"):
            return read(kind, _merged(plain(hydra.compose(name, list(overrides))), values or {}))
    finally:
        GlobalHydra.instance().hydra = running


def _merged(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """`values` with `changes`, group by group."""
    groups = {key for key in changes if isinstance(changes[key], Mapping) and isinstance(values.get(key), Mapping)}
    return {**values, **changes, **{key: _merged(values[key], changes[key]) for key in groups}}


def plain(composed: DictConfig) -> dict[str, Any]:
    """A composed configuration as plain values, without Hydra's own part, the published numbers, and `out`, which is
    for the folder of a job only."""
    own = {str(key): composed[key] for key in composed if key not in ("hydra", "out")}
    return without_published(
        {key: OmegaConf.to_container(v, resolve=True) if OmegaConf.is_config(v) else v for key, v in own.items()}
    )


def run_folder(parent: str | None, resume: str | None, out: object) -> str:
    """Folder of a single job: `out`, that of the run it resumes, or a new one. A resolver of conf/.

    Empty for a job that has no folder of its own: without `out` and `parent`.
    """
    if out is not None and resume is None:
        return checked_out(out)
    return "" if parent is None else run_dir.folder_for(parent, resume)


def sweep_folder(parent: str, experiment: str | None, out: object) -> str:
    """Folder of the sweep that is about to start: `out`, that of the experiment, or a new one. A resolver of conf/."""
    if out is not None:
        return checked_out(out)
    return run_dir.folder_for(parent, None) if experiment is None else str(Path(parent) / experiment)


def checked_out(out: object) -> str:
    """The folder that the key `out` names. Raises ConfigError if it cannot be a path."""
    return str(read(Output, {"out": out}).out)


def job_folder(number: int, overrides: str, experiment: str | None, *, _root_: DictConfig) -> str:
    """Name of a job's folder within that of its sweep. A resolver of conf/.

    In an experiment the name of a training ends in a digest of everything that its policy depends on. The same job thus
    finds its earlier results, and another one never overwrites them.
    """
    slug = override_slug(overrides)
    if experiment is None:
        return f"{number}_{slug}"
    values = plain(_root_)
    return f"{slug}_{identity(read(TrainConfig, values))}" if "agent" in values else slug


def override_slug(overrides: str) -> str:
    """Hydra's `override_dirname` as part of a file name: `env.hip_k=25,seed=3` becomes `hip_k-25_seed-3`.

    Only the last part of each key is kept, so different overrides may share a slug: it is a label, not an identifier. A slug
    of more than 80 characters is cut and ends in a hash of the whole.
    """
    words = []
    for override in re.split(r",(?=[^,=]+=)", overrides):  # not at the commas within a list
        key, _, value = override.partition("=")
        words.append("-".join(re.findall(r"[A-Za-z0-9._-]+", f"{re.split('[./]', key)[-1]} {value}")))
    slug = "_".join(filter(None, words)).lstrip(".-")
    if len(slug) > MAX_SLUG_LENGTH:
        digest = hashlib.sha256(overrides.encode()).hexdigest()[:8]
        slug = f"{slug[: MAX_SLUG_LENGTH - 9]}-{digest}"
    return slug or "job"


def identity(config: TrainConfig) -> str:
    """Eight hexadecimal digits that identify a training: its configuration, its code and the libraries."""
    text = json.dumps(
        [_decides_the_policy(config), provenance.training_code(), provenance.library_versions()], sort_keys=True
    )
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def refuse_other_training(config: TrainConfig, folder: Path) -> None:
    """Raise ConfigError if `folder` holds a checkpoint of a training other than `config` with this code and these libraries.

    Equal trainings may differ in the keys that do not decide the policy, see `_decides_the_policy`.
    """
    if run_dir.newest_model(folder) is None and not (folder / "resume.pt").exists():
        return
    saved, own = (_decides_the_policy(one) for one in (run_dir.read_config(folder), config))
    if different := differences(saved, own) + provenance.other_code(folder):
        more = [f"and {len(different) - MAX_DIFFERENCES} more"] * (len(different) > MAX_DIFFERENCES)
        raise ConfigError(
            f"{folder}: holds another training ({'; '.join(different[:MAX_DIFFERENCES] + more)}); resume={folder} continues "
            "it with its own values, out= names another folder"
        )
    if not (folder / "resume.pt").exists() and run_dir.iterations_of_newest(folder) < config.max_iterations:
        raise ConfigError(
            f"{folder}: holds checkpoints without resume.pt, so that their training cannot go on; out= names another folder"
        )


def _decides_the_policy(config: TrainConfig) -> dict[str, Any]:
    """The part of a training's configuration on which its policy depends."""
    keys = {"env", "agent", "seed", "processes", "max_iterations"}
    if config.init is not None:
        keys.add("init")
    if config.patience is not None:  # evaluations decide how long it lasts
        keys |= {"patience", "evaluate_every", "evaluation"}
    values = config.model_dump(mode="json", include=keys)
    values["agent"].pop("logger")
    return values


def differences(saved: Any, own: Any, key: str = "") -> list[str]:
    """`key = saved, not own` for each value that differs."""
    if isinstance(saved, dict) and isinstance(own, dict):
        pairs = [(f"{key}.{name}".lstrip("."), saved.get(name), own.get(name)) for name in {**saved, **own}]
        return [line for name, before, now in pairs for line in differences(before, now, name)]
    return [] if saved == own else [f"{key} = {_brief(saved)}, not {_brief(own)}"]


def _brief(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _check_run(config: TrainConfig, folder: Path) -> None:
    """Raise ConfigError unless `folder` is new, or holds the training that `config` describes or resumes."""
    if config.resume is None:
        refuse_other_training(config, folder)
    elif folder.resolve() != (own := run_dir.find_run(config.resume)).resolve():
        raise ConfigError(f"a resumed run stays in its folder, {own}: leave out hydra.run.dir")


OmegaConf.register_new_resolver("posture.run_folder", run_folder, use_cache=True, replace=True)
OmegaConf.register_new_resolver("posture.sweep_folder", sweep_folder, use_cache=True, replace=True)
OmegaConf.register_new_resolver("posture.job_folder", job_folder, replace=True)
OmegaConf.register_new_resolver("posture.for_body", for_body, replace=True)
OmegaConf.register_new_resolver("posture.amplitudes", amplitudes, replace=True)


def _check_effect(configs: Sequence[BaseModel], overrides: Sequence[Override]) -> None:
    """Raise ConfigError if one of the `overrides` sets a key that has no effect in any of the jobs."""
    unused = [config.without_effect() if isinstance(config, CommandConfig) else {} for config in configs]
    for key in (key for override in overrides for key in _keys(override)):
        whys = [next((why for name, why in own.items() if f"{key}.".startswith(f"{name}.")), None) for own in unused]
        if all(whys):
            raise ConfigError(f"{key}: has no effect {whys[0]}")


def _keys(override: Override) -> list[str]:
    """The keys that an override sets: of a record, each of its own."""

    def below(key: str, value: object) -> list[str]:
        parts = value.items() if isinstance(value, dict) else ()
        return [name for part, inner in parts for name in below(f"{key}.{part}", inner)] or [key]

    return below(override.key_or_group, None if override.is_sweep_override() else override.value())


def _check_folders(jobs: Sequence[Job], sweep: Path) -> None:
    """Raise ConfigError unless every job has its own writable folder within that of the sweep."""
    if not jobs:
        raise ConfigError("the sweep is empty: a range or choice has no value in it")
    seen: set[Path] = set()
    configured: dict[str, Path] = {}
    for job in jobs:
        folder = job.folder.resolve()
        if sweep.resolve() not in folder.parents:
            raise ConfigError(
                f"hydra.sweep.subdir: the job's folder {job.folder} does not lie within that of the sweep, {sweep}"
            )
        if folder in seen:
            raise ConfigError(f"two jobs of the sweep would have the folder {job.folder}: give each value once")
        seen.add(folder)
        other = configured.setdefault(job.config.model_dump_json(), job.folder)
        if other != job.folder:
            raise ConfigError(f"two jobs of the sweep would do the same, {other} and {job.folder}: give each value once")
        _check_writable(job.config, job.folder, *JOB_FILES)


def _check_writable(config: BaseModel, folder: Path, *files: str) -> None:
    """Raise ConfigError unless a job with `config` can write its files, among them `files`, to `folder`."""
    if isinstance(config, TrainConfig):
        files = (*files, *run_dir.FILES, *(path.name for path in folder.glob("model_*.pt")))
        if config.evaluate:
            run_dir.writable(folder / "evaluation")
    run_dir.writable(folder, *files)


@contextlib.contextmanager
def _errors_are_bad_input() -> Iterator[None]:
    """Turn every error into ConfigError: Hydra raises Python's own exceptions for some bad input."""
    try:
        yield
    except MissingConfigException as error:
        if error.missing_cfg_file != "hydra/sweeper/optuna":
            raise
        raise ConfigError(
            "a search needs the package hydra-optuna-sweeper: python -m pip install -c constraints.txt -e '.[search]'"
        ) from None
    except (ConfigError, HydraException, OmegaConfBaseException):
        raise
    except Exception as error:
        raise ConfigError(f"the command line cannot be read: {error}") from None


def _compose(name: str, overrides: Iterable[str]) -> DictConfig:
    return hydra.compose(name, list(overrides), return_hydra_config=True)


def _checked(kind: type[BaseModel], composed: DictConfig) -> BaseModel:
    config = read(kind, plain(composed))
    check_device(getattr(config, "device", "cpu"))
    return config


def quoted(text: object) -> str:
    """A text as the value of an override of Hydra's."""
    return QuotedString(str(text), Quote.single).with_quotes()
