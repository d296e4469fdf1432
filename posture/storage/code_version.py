"""Which code a run was trained with, and which code measured it: digests of source files.

Comments, docstrings and layout do not count: what does not change the code does not make a trained policy old. The digits
belong to one minor version of Python, whose syntax tree they are computed from.
"""

import ast
import hashlib
from collections.abc import Iterable
from functools import cache
from pathlib import Path

POSTURE = Path(__file__).resolve().parents[1]
ENVS = POSTURE.parent / "envs"
ANALYSIS = (
    "analysis/coordination",
    "analysis/ramp",
    "analysis/results",
    "analysis/trajectory",
    "evaluation/rollout",
    "evaluation/trial",
    "theory/motion",
    "theory/optimum",
    "theory/prediction",
    "theory/program",
    "theory/stander",
)
"""Modules of `posture` that take part in what an evaluation measures and what theory puts beside it."""


@cache
def envs_version() -> str:
    """Twelve hexadecimal digits for the package `envs`, the physics and the task, its body file included."""
    return _digest(path for path in sorted(ENVS.rglob("*")) if path.suffix in (".py", ".xml"))


@cache
def analysis_version() -> str:
    """Twelve hexadecimal digits for the modules that measure."""
    return _digest(POSTURE / f"{name}.py" for name in ANALYSIS)


def _digest(paths: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for path in paths:
        content = path.read_bytes()
        if path.suffix == ".py":
            content = ast.dump(_bare(ast.parse(content))).encode()
        digest.update(path.name.encode() + b"\0" + content + b"\0")
    return digest.hexdigest()[:12]


def _bare(tree: ast.Module) -> ast.Module:
    """The tree without docstrings and other strings that stand alone."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [part for part in body if not _is_string(part)]  # type: ignore[attr-defined]
    return tree


def _is_string(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
