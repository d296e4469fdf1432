"""Run folders: their names, and how runs and checkpoints are found.

config.yaml       resolved configuration, from which evaluation rebuilds the environment
provenance.yaml   command, versions, git commit and time of each start
model_<n>.pt      policy, value function and optimiser after n iterations (rsl-rl's format)
resume.pt         the rest of the state that an exact resume needs, as of the newest model
events.out.*      TensorBoard
evaluation/       output of posture.eval
best.pt           the best of the evaluated policies, and best.yaml its figures (posture/evaluation/best.py)
films/            films of checkpoints
"""

import contextlib
import datetime
import errno
import os
import re
import stat
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from posture.config import torchrun
from posture.config.errors import ConfigError
from posture.config.reading import read
from posture.config.train import TrainConfig
from posture.storage import yaml_files
from posture.storage.migration import upgrade

RUNS = Path("runs")
BEST = ("best.pt", "best.yaml")
FILES = ("config.yaml", "provenance.yaml", "resume.pt", ".lock", *BEST)
"""Files that a training writes into its folder, beside those that are numbered."""
PRETRAINED = Path(__file__).resolve().parent.parent / "pretrained"
"""Run folders shipped with the package, each with one policy (posture/reproduce/ship.py)."""


def folder_for(parent: str, resume: str | None) -> str:
    """Folder for a run that starts: that of the run it resumes, or a new one under `parent`.

    A new folder is named after the time and the process, so that runs started in the same second have different folders. Of
    the processes that torchrun starts only the first writes; the others get `parent`, in which they write nothing.
    """
    if resume is not None:
        return str(find_run(resume))
    if torchrun.rank() > 0:
        return parent
    name = f"{datetime.datetime.now():%Y-%m-%d_%H-%M-%S}_{os.getpid()}"
    taken = sum(1 for path in Path(parent).glob(f"{name}*"))
    return str(Path(parent) / (f"{name}_{taken + 1}" if taken else name))


def is_run(folder: Path) -> bool:
    """Whether `folder` holds a run."""
    return (folder / "config.yaml").is_file()


def runs_in(folder: Path) -> list[Path]:
    """The runs of a sweep folder in the order of their job numbers; of a run folder, itself."""
    if is_run(folder):
        return [folder]
    jobs = [path for path in folder.iterdir() if path.is_dir() and is_run(path)]
    number = {path: path.name.partition("_")[0] for path in jobs}
    return sorted(jobs, key=lambda path: (int(number[path]) if number[path].isdigit() else 0, path.name))


def find_run(name: str) -> Path:
    """The run folder called `name`: a path, or `latest` for the newest under runs/. Raises ConfigError."""
    if name == "latest":
        runs = [run for top in RUNS.glob("*") if top.is_dir() for run in runs_in(top) if newest_model(run)]
        if not runs:
            raise ConfigError(f"latest: no run with a checkpoint under {RUNS}/; train one with python -m posture.train")
        return max(runs, key=lambda run: newest_model(run).stat().st_mtime)  # type: ignore[union-attr]
    folder = Path(name)
    if not is_run(folder):
        raise ConfigError(f"{name}: not a run folder (it has no config.yaml); give one, or latest")
    return folder


SELECT_SEVERAL = "a checkpoint, a run folder, a sweep folder, latest, or pretrained"
SELECT_OWN = "a checkpoint or a run of your own, or latest"


def find_checkpoints(
    name: str | Sequence[str], wanted: Callable[[Path], bool] | None = None, allowed: str = SELECT_SEVERAL
) -> list[Path]:
    """Checkpoint files that `ckpt=name` selects: a file, the newest of a run folder, of each run of a sweep or of the latest
    run, or a shipped one; or those of a list of such names. `wanted` selects among the runs of a sweep. Raises
    ConfigError if there is none; it says what is `allowed`."""
    if not isinstance(name, str):
        return [model for one in name for model in find_checkpoints(one, wanted, allowed)]
    path = Path(name)
    if name == "latest":
        runs = [find_run(name)]
    elif name == "pretrained" or name.startswith("pretrained/"):
        return [_pretrained(name.removeprefix("pretrained").lstrip("/") or "default")]
    elif path.is_file():
        if not is_run(path.parent):
            raise ConfigError(
                f"{name}: has no config.yaml beside it, so its environment is unknown; posture.import_checkpoint makes a "
                "run of a checkpoint of rsl-rl's own runner"
            )
        return [path]
    elif path.is_dir():
        all_runs = runs_in(path)
        if not all_runs:
            raise ConfigError(f"{name}: neither a run folder (with config.yaml) nor a sweep of such folders")
        runs = [run for run in all_runs if wanted is None or wanted(run)]
        if not runs:
            raise ConfigError(f"{name}: no run in it is finished and of the current code; train them again")
    else:
        raise ConfigError(f"{name}: no such file or folder; allowed are {allowed}")
    found = [newest_model(run) for run in runs]
    if not any(found):
        raise ConfigError(f"{name}: no checkpoint (model_<n>.pt) in it yet")
    for run, model in zip(runs, found, strict=True):
        if model is None:
            print(f"skipped: {run} has no checkpoint yet")
    return [model for model in found if model is not None]


def find_checkpoint(name: str) -> Path:
    """The only checkpoint file that `ckpt=name` selects. Raises ConfigError if there are several, or none."""
    return _only(name, find_checkpoints(name), "ckpt")


def find_init(name: str) -> Path:
    """The checkpoint file that `init=name` selects. Raises ConfigError if there are several or none, or if it is shipped."""
    model = _only(name, find_checkpoints(name, allowed=SELECT_OWN), "init")
    if is_shipped(model):
        raise ConfigError(
            f"init: {name} comes without the value function that a training goes on from; allowed are {SELECT_OWN}"
        )
    return model


def _only(name: str, models: Sequence[Path], key: str) -> Path:
    if len(models) > 1:
        raise ConfigError(f"{key}: {name} holds {len(models)} policies; allowed is one, for example {models[0]}")
    return models[0]


def _pretrained(name: str) -> Path:
    model = newest_model(PRETRAINED / name) if re.fullmatch(r"[\w.-]+", name) else None
    if model is None:
        known = sorted(path.name for path in PRETRAINED.iterdir() if is_run(path)) if PRETRAINED.is_dir() else []
        raise ConfigError(f"pretrained/{name}: no such policy; there are {', '.join(known)}")
    return model


def is_shipped(model: Path) -> bool:
    """Whether a checkpoint is shipped with the package."""
    return PRETRAINED in model.resolve().parents


def newest_model(run: Path) -> Path | None:
    """The checkpoint of `run` with the most iterations, or None."""
    return max(models(run), key=iteration_of, default=None)


def models(run: Path) -> list[Path]:
    """The numbered checkpoints of `run`."""
    return [path for path in run.glob("model_*.pt") if re.fullmatch(r"model_\d+\.pt", path.name)]


def iterations_of_newest(run: Path) -> int:
    """Iterations after which the newest checkpoint of `run` was saved; 0 if there is none."""
    model = newest_model(run)
    return 0 if model is None else iteration_of(model)


def iteration_of(model: Path) -> int:
    """Iterations after which a checkpoint was saved, from its file name."""
    return int(model.stem.removeprefix("model_"))


def read_config(run: Path) -> TrainConfig:
    """The configuration of a run, upgraded and checked. Nothing in the file is executed. Raises ConfigError."""
    path = run / "config.yaml"
    values = yaml_files.read(path)
    if not isinstance(values, dict):
        raise ConfigError(f"{path}: not a configuration; allowed is one that posture.train wrote")
    yaml_files.refuse_instructions(values, path)
    return read(TrainConfig, upgrade(values, path), str(path))


def writable(folder: Path, *files: str) -> Path:
    """`folder`. Raises ConfigError if it can be neither written to nor created, or one of `files` in it cannot be written.

    Creates nothing; the first file that is written does.
    """
    try:
        existing = next(place for place in (folder, *folder.absolute().parents) if place.exists() or place.is_symlink())
        if not existing.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        with tempfile.TemporaryFile(dir=existing):
            pass
    except OSError as error:
        raise ConfigError(f"cannot write to the folder {folder}: {error.strerror}") from None
    for path in (folder / name for name in files):
        try:
            mode = path.lstat().st_mode
            if stat.S_ISDIR(mode):
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            if not stat.S_ISREG(mode) and not stat.S_ISLNK(mode):
                raise OSError(errno.EINVAL, "A pipe or a device has this name")
        except FileNotFoundError:
            pass
        except OSError as error:  # also a name that is too long
            raise ConfigError(f"cannot write the file {path}: {error.strerror}") from None
    return folder


@contextlib.contextmanager
def removed_if_empty(*folders: Path) -> Iterator[None]:
    """At the end of this context remove those of `folders`, and of the folders that they are in, that were created in it and
    are empty."""
    missing = [path for folder in folders for path in (folder, *folder.parents) if not path.exists()]
    try:
        yield
    finally:
        for path in missing:
            with contextlib.suppress(OSError):
                path.rmdir()
