"""Which code a run was trained with: a digest of the physics and the task."""

import ast
import hashlib
from functools import cache
from pathlib import Path

ENVS = Path(__file__).resolve().parent.parent / "envs"


@cache
def envs_version() -> str:
    """Twelve hexadecimal digits of a digest of the package `envs`, its body file included.

    Comments, docstrings and layout do not count: what does not change the code does not make a trained policy old. The
    digits belong to one minor version of Python, whose syntax tree they are computed from.
    """
    digest = hashlib.sha256()
    for path in sorted(ENVS.rglob("*")):
        if path.suffix == ".py":
            content = ast.dump(_bare(ast.parse(path.read_bytes()))).encode()
        elif path.suffix == ".xml":
            content = path.read_bytes()
        else:
            continue
        digest.update(path.relative_to(ENVS).as_posix().encode() + b"\0" + content + b"\0")
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
