"""What a run was made by: its command, versions, commit and code, of each of its starts."""

import datetime
import importlib.metadata
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

from posture.config.errors import ConfigError
from posture.config.train import TrainConfig
from posture.storage import yaml_files
from posture.storage.code_version import envs_version
from posture.storage.migration import VERSION
from posture.storage.yaml_files import write_yaml

PACKAGES = ("posture", "newton", "warp-lang", "mujoco", "mujoco-warp", "rsl-rl-lib", "torch", "hydra-core", "numpy")


def write_config(run: Path, config: TrainConfig) -> None:
    """Keep the resolved configuration, and add the versions, commit and command of this start to its provenance."""
    write_yaml(run / "config.yaml", {"version": VERSION, **config.model_dump(mode="json")})
    so_far = starts(run)
    so_far.append(
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
    write_yaml(run / "provenance.yaml", so_far)


def versions() -> dict[str, str]:
    """Installed versions of the packages that results depend on."""
    return {name: importlib.metadata.version(name) for name in PACKAGES}


def starts(run: Path) -> list[Any]:
    """What provenance.yaml says of the starts so far; empty without one. Raises ConfigError where it is no list."""
    path = run / "provenance.yaml"
    starts = yaml_files.read(path) if path.exists() else []
    if not isinstance(starts, list):
        raise ConfigError(f"{path}: not a list of the run's starts; move it away, and a new one begins")
    return starts


def _git_commit() -> str | None:
    """Commit of the checkout this code runs from, with -dirty if it has changes; None where it is installed."""
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists():
        return None  # not the commit of a repository that the environment happens to lie in
    try:
        told = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--abbrev=40"],
            cwd=root,
            capture_output=True,
            text=True,
            timeout=10,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return told.stdout.strip()
