"""Provenance of a result: command, commit, library versions, and digests of the source code that determines it.

A digest changes with the code of the packages that take part, except for code that does not affect results: comments,
docstrings, layout, type annotations, messages of errors, printed text, and the range checks of envs/config.py and
posture/config/. Digests of different minor versions of Python differ, since they are computed from its syntax tree.
"""

import ast
import contextlib
import datetime
import hashlib
import importlib.metadata
import os
import platform
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from posture.config.errors import ConfigError
from posture.config.train import TrainConfig
from posture.storage import yaml_files
from posture.storage.migration import VERSION

ROOT = Path(__file__).resolve().parents[2]
TRAINING = ("envs/task", "envs/body", "envs/engines", "posture/learning")
"""Packages that determine the result of a training. With `env.ranges` the least costs of posture/theory do, too."""
ANALYSIS = ("posture/analysis", "posture/dynamics", "posture/evaluation", "posture/map", "posture/theory")
"""Packages that determine the results of an evaluation and of the theory."""
PRESENTATION = ("__main__.py", "figure.py", "figures.py", "progress.py", "table.py", "tables.py")
"""Files of these packages that only show results."""
LIBRARIES = ("newton", "warp-lang", "mujoco", "mujoco-warp", "rsl-rl-lib", "torch", "numpy", "scipy", "clarabel")
"""Libraries whose version decides a result."""
STARTS = ("command", "started", "git_commit", "training_code", "python", "platform", "versions")
"""What provenance.yaml has of each start."""


def write_config(run: Path, config: TrainConfig, begun_from: Path | None = None, resumed: bool = False) -> None:
    """Save the resolved configuration in the folder `run`, and this start in its provenance.yaml.

    begun_from: the checkpoint whose weights this start took, if any. resumed: the start goes on from earlier ones, which are
    kept; without it they saved nothing, and are dropped. Raises ConfigError if provenance.yaml is not a list of starts.
    """
    yaml_files.write_yaml(run / "config.yaml", {"version": VERSION, **config.model_dump(mode="json")})
    start: dict[str, Any] = {
        "command": [Path(sys.argv[0]).name, *sys.argv[1:]],
        "started": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "git_commit": _git_commit(),
        "training_code": training_code(),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "versions": {"posture": importlib.metadata.version("posture"), **library_versions()},
    }
    if begun_from is not None:
        start["begun_from"] = {
            "checkpoint": str(begun_from.absolute()),
            "sha256": hashlib.sha256(begun_from.read_bytes()).hexdigest(),
        }
    earlier = starts(run)
    yaml_files.write_yaml(run / "provenance.yaml", [*earlier, start] if resumed else [start])


def starts(run: Path) -> list[Any]:
    """The starts of a run so far, from its provenance.yaml, if any. Raises ConfigError unless that is a list."""
    path = run / "provenance.yaml"
    starts = yaml_files.read(path) if path.exists() else []
    if not isinstance(starts, list):
        raise ConfigError(f"{path}: not a list of the run's starts; move the file away to begin a new one")
    return starts


def whole_starts(run: Path) -> list[Any]:
    """The same, each with all that `write_config` records. Raises ConfigError if there is none, or one lacks a part."""
    path, found = run / "provenance.yaml", starts(run)
    if not found:
        raise ConfigError(f"{path}: does not say which code made this run; without the run's folder it is trained again")
    for i, start in enumerate(found, 1):
        missing = [key for key in STARTS if not isinstance(start, dict) or key not in start]
        if missing or not isinstance(start["versions"], dict) or not isinstance(start["command"], list):
            what = f"has no {', '.join(missing)}" if missing else "has versions or a command that cannot be read"
            raise ConfigError(f"{path}: start {i} {what}; without the run's folder it is trained again")
    return found


def other_code(run: Path) -> list[str]:
    """`name before, not now` for the training code and each library with which `run` was started in another version."""
    now = {"training code": training_code(), **library_versions()}
    different: dict[str, str | None] = {}
    for start in starts(run):
        with contextlib.suppress(KeyError, TypeError):  # a start of an earlier version of posture may lack a part
            before = {"training code": start["training_code"], **start["versions"]}
            different |= {key: before.get(key) for key in now if before.get(key) != now[key]}
    return [f"{key} {before}, not {now[key]}" for key, before in different.items()]


@cache
def library_versions() -> dict[str, str]:
    """Installed versions of the libraries that decide a result."""
    return {name: importlib.metadata.version(name) for name in LIBRARIES}


@cache
def training_code() -> str:
    """Digest of the code that determines the result of a training, twelve hexadecimal digits."""
    return _digest(source_files(TRAINING))


@cache
def analysis_code() -> str:
    """Digest of the code that determines the result of an evaluation, twelve hexadecimal digits."""
    return _digest(source_files(ANALYSIS))


def digests(folder: Path, names: Sequence[str]) -> dict[str, dict[str, str]]:
    """SHA-256 of files in `folder`, which detect damage, as the entry of a record. Raises OSError if one is missing."""
    return {"sha256": {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in names}}


def digests_of_existing(folder: Path, names: Sequence[str]) -> dict[str, dict[str, str]]:
    """The same of those of the files that exist."""
    return digests(folder, [name for name in names if (folder / name).exists()])


def source_files(packages: Sequence[str]) -> list[Path]:
    """Source files and body models of `packages`, without those that only show results."""
    kinds = (".py", ".xml", ".yaml")
    found = [path for package in packages for path in (ROOT / package).rglob("*") if path.suffix in kinds]
    return sorted(path for path in found if path.name not in PRESENTATION)


def _digest(paths: Sequence[Path]) -> str:
    digest = hashlib.sha256()
    for path in paths:
        content = path.read_bytes()
        if path.suffix == ".py":
            content = ast.dump(_Reduce().visit(ast.parse(content))).encode()
        digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + content + b"\0")
    return digest.hexdigest()[:12]


class _Reduce(ast.NodeTransformer):
    """Removes the parts of a syntax tree that do not affect a result."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:  # noqa: N802 - ast's name
        """Remove docstrings and printing."""
        value = node.value
        printed = isinstance(value, ast.Call) and isinstance(value.func, ast.Name) and value.func.id == "print"
        return None if printed or isinstance(value, ast.Constant) else self.generic_visit(node)

    def visit_Raise(self, node: ast.Raise) -> ast.AST:  # noqa: N802
        """Keep the type of an error, not its message."""
        return ast.Raise(exc=node.exc.func if isinstance(node.exc, ast.Call) else node.exc)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:  # noqa: N802
        """Remove the annotation of a variable."""
        node.annotation = ast.Constant(None)
        return self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:  # noqa: N802
        """Remove the annotations of a function, except of Warp's, which are compiled by their types."""
        if not _is_warp(node):
            node.returns = None
            for argument in ast.walk(node.args):
                if isinstance(argument, ast.arg):
                    argument.annotation = None
        return self.generic_visit(node)

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:  # noqa: N802
        """Keep Warp's structures as they are, since their annotations are their content."""
        return node if _is_warp(node) else self.generic_visit(node)


def _is_warp(node: ast.FunctionDef | ast.ClassDef) -> bool:
    """Whether a decorator such as `@wp.kernel` makes this Warp's language."""
    return any(isinstance(part, ast.Name) and part.id == "wp" for line in node.decorator_list for part in ast.walk(line))


def _git_commit() -> str | None:
    """Commit of the checkout that this code runs from, with -dirty if it has changes; None outside a checkout.

    Of no other repository: not of one around an installed or unpacked copy, nor of one that GIT_DIR names.
    """
    git = ["git", f"--git-dir={ROOT / '.git'}", f"--work-tree={ROOT}"]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}

    def output(*command: str) -> str:
        done = subprocess.run(
            [*git, *command], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=10, check=True
        )
        return done.stdout.strip()

    try:
        # An unpacked copy may lie at the top of another repository; its files are then not tracked there.
        output("ls-files", "--error-unmatch", Path(__file__).resolve().relative_to(ROOT).as_posix())
        return output("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (OSError, subprocess.SubprocessError):
        return None
