"""Where a run lives, and how its files are found, written and read safely; checkpoints are in posture/checkpoint.py.

A run folder explains itself:

    config.yaml       the resolved configuration: evaluation rebuilds the environment from it
    provenance.yaml   command, versions, git commit and start time, of the start and of each time it was resumed
    model_<n>.pt      policy, value function and optimiser after n iterations (rsl-rl's own format)
    resume.pt         what else an exact resume needs, as of the newest model
    events.out.*      TensorBoard
    evaluation/       what posture.eval wrote
"""

import datetime
import importlib.metadata
import os
import platform
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from posture import plain_yaml
from posture.atomic import replacing
from posture.checkpoint import load as load
from posture.checkpoint import save as save
from posture.code_version import envs_version
from posture.config import ConfigError, TrainConfig, read

RUNS = Path("runs")
PRETRAINED = Path(__file__).resolve().parent / "pretrained"
"""Run folders that come with the package, reduced to their policies: posture/ship.py."""
PACKAGES = ("posture", "newton", "warp-lang", "mujoco", "mujoco-warp", "rsl-rl-lib", "torch", "hydra-core", "numpy")


def folder_for(parent: str, resume: str | None) -> str:
    """Folder of the run that is about to start: that of the run it resumes, or a new name under `parent`.

    The name is the time and the process, so that two runs started in the same second do not share a folder. Of the processes
    that torchrun starts the first alone writes; the others get a folder that nobody looks at.
    """
    if resume is not None:
        return str(find_run(resume))
    if os.environ.get("RANK", "0") != "0":
        return tempfile.mkdtemp(prefix="posture-")
    name = f"{datetime.datetime.now():%Y-%m-%d_%H-%M-%S}_{os.getpid()}"
    taken = sum(1 for path in Path(parent).glob(f"{name}*"))
    return str(Path(parent) / (f"{name}_{taken + 1}" if taken else name))


def is_run(folder: Path) -> bool:
    """Whether `folder` holds a run."""
    return (folder / "config.yaml").is_file()


def runs_in(folder: Path) -> list[Path]:
    """The runs of a sweep folder, in the order of their job numbers; a run folder is its own only run."""
    if is_run(folder):
        return [folder]
    jobs = [path for path in folder.iterdir() if path.is_dir() and is_run(path)]
    return sorted(
        jobs, key=lambda path: (int(path.name.split("_")[0]) if path.name.split("_")[0].isdigit() else 0, path.name)
    )


def find_run(name: str) -> Path:
    """The run folder that `name` means: a path, or `latest` for the newest under runs/. Raises ConfigError."""
    if name == "latest":
        runs = [run for top in RUNS.glob("*") if top.is_dir() for run in runs_in(top) if newest_model(run)]
        if not runs:
            raise ConfigError(f"latest: no run with a checkpoint under {RUNS}/; train one with python -m posture.train")
        return max(runs, key=lambda run: newest_model(run).stat().st_mtime)  # type: ignore[union-attr]
    folder = Path(name)
    if not is_run(folder):
        raise ConfigError(f"{name}: not a run folder (it has no config.yaml); give one, or latest")
    return folder


def find_checkpoints(name: str, wanted: Callable[[Path], bool] | None = None) -> list[Path]:
    """Checkpoint files that `ckpt=name` means: a file, the newest of a run folder, of each run of a sweep, of the latest
    run, or one that comes with the package. Of a sweep those alone that are `wanted`. Raises ConfigError."""
    path = Path(name)
    if name == "latest":
        runs = [find_run(name)]
    elif name == "pretrained" or name.startswith("pretrained/"):
        return [_pretrained(name.removeprefix("pretrained").lstrip("/") or "default")]
    elif path.is_file():
        if not is_run(path.parent):
            raise ConfigError(f"{name}: there is no config.yaml beside it, so its environment is not known")
        return [path]
    elif path.is_dir():
        runs = [run for run in runs_in(path) if wanted is None or wanted(run)]
        if not runs:
            raise ConfigError(f"{name}: neither a run folder (with config.yaml) nor a sweep of such folders")
    else:
        raise ConfigError(
            f"{name}: no such file or folder; allowed are a checkpoint, a run folder, a sweep folder, latest, or pretrained"
        )
    found = [newest_model(run) for run in runs]
    if not any(found):
        raise ConfigError(f"{name}: no checkpoint (model_<n>.pt) in it yet")
    for run, model in zip(runs, found, strict=True):
        if model is None:
            print(f"left out: {run} has no checkpoint yet")
    return [model for model in found if model is not None]


def _pretrained(name: str) -> Path:
    model = newest_model(PRETRAINED / name) if re.fullmatch(r"[\w.-]+", name) else None
    if model is None:
        known = sorted(path.name for path in PRETRAINED.iterdir() if is_run(path)) if PRETRAINED.is_dir() else []
        raise ConfigError(f"pretrained/{name}: no such policy; there are {', '.join(known)}")
    return model


def is_shipped(model: Path) -> bool:
    """Whether a checkpoint is one of those that come with the package."""
    return PRETRAINED in model.parents


def newest_model(run: Path) -> Path | None:
    """The checkpoint of `run` with the most iterations, or None."""
    models = [path for path in run.glob("model_*.pt") if re.fullmatch(r"model_\d+\.pt", path.name)]
    return max(models, key=iteration_of, default=None)


def iteration_of(model: Path) -> int:
    """Number of iterations after which a checkpoint was saved, from its name."""
    return int(model.stem.removeprefix("model_"))


def iterations_done(run: Path) -> int:
    """Number of iterations after which `run` can go on. Raises ConfigError where its files do not let it."""
    # Only now: the learner's networks take a second to import, and few commands need them.
    from posture.policy import check_state, check_training

    config, state = read_config(run), run / "resume.pt"
    done = check_state(load(state, "cpu"), config, state)
    model = run / f"model_{done}.pt"
    check_training(load(model, "cpu"), config, model)
    _provenance(run)
    return done


def training_seconds(run: Path) -> float:
    """What the iterations of `run` took [s], over all its starts. Raises ConfigError where its resume.pt is damaged."""
    state = run / "resume.pt"
    try:
        return float(load(state, "cpu")["processes"][0]["logger"]["tot_time"])
    except (KeyError, IndexError, TypeError, ValueError):
        raise ConfigError(f"{state}: does not say how long the training took") from None


def read_config(run: Path) -> TrainConfig:
    """The run's own configuration, checked anew; nothing in it is acted on, only taken as values. Raises ConfigError."""
    path = run / "config.yaml"
    values = plain_yaml.read(path)
    if not isinstance(values, dict):
        raise ConfigError(f"{path}: not a configuration; allowed is one as posture.train writes it")
    plain_yaml.refuse_instructions(values, path)
    return read(TrainConfig, values, str(path))


def write_config(run: Path, config: TrainConfig) -> None:
    """Keep the resolved configuration, and add the versions, commit and command of this start to its provenance."""
    write_yaml(run / "config.yaml", config.model_dump(mode="json"))
    starts = _provenance(run)
    starts.append(
        {
            "command": [Path(sys.argv[0]).name, *sys.argv[1:]],
            "started": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
            "git_commit": _git_commit(),
            "envs_version": envs_version(),
            "python": platform.python_version(),
            "platform": platform.platform(),
            "versions": versions(),
        }
    )
    write_yaml(run / "provenance.yaml", starts)


def versions() -> dict[str, str]:
    """Installed versions of the packages that results depend on."""
    return {name: importlib.metadata.version(name) for name in PACKAGES}


def write_yaml(path: Path, values: Any) -> None:
    """Write plain values as YAML, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(yaml.safe_dump(values, sort_keys=False, allow_unicode=True), encoding="utf-8")


def read_yaml(path: Path) -> Any:
    """What `write_yaml` wrote; None where there is no such file or it cannot be read."""
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError, yaml.YAMLError):
        return None


def writable(folder: Path) -> Path:
    """`folder`, made if need be. Raises ConfigError where nothing can be written to it, before anything was computed."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ConfigError(f"cannot write to the folder {folder}: {error.strerror}") from None
    return folder


def _provenance(run: Path) -> list[Any]:
    path = run / "provenance.yaml"
    starts = plain_yaml.read(path) if path.exists() else []
    if not isinstance(starts, list):
        raise ConfigError(f"{path}: not a list of the run's starts; move it away, and a new one begins")
    return starts


def _git_commit() -> str | None:
    """Commit of the checkout this code runs from, with -dirty if it has changes; None outside a checkout."""
    try:
        told = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--abbrev=40"],
            cwd=Path(__file__).parent,
            capture_output=True,
            text=True,
            timeout=10,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return told.stdout.strip()
