"""Which package may import which, read from the source: `posture` builds on `envs`, never the reverse."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MAX_LINES = 400

# The body and its task know neither the learner nor its configuration, only the interface `rsl_rl.env`.
ENVS_MAY_NOT = ("posture", "hydra", "omegaconf", "rsl_rl.runners", "rsl_rl.algorithms")

# The analyst works on arrays: results can be read and drawn where no simulator is installed.
ANALYSTS = ("confidence", "coordination", "figures", "ramp", "table", "trajectory")
# Of the report, these read the model or the theory of the body.
REPORT_WITH_BODY = ("document", "results", "tables")
ANALYSTS_MAY_NOT = ("torch", "warp", "newton")


def _imports(source: str, package: str) -> set[str]:
    """Dotted names that the source of a module in `package` imports, anywhere in it.

    `from a.b import c` counts as a.b and as a.b.c, since c may be a module.
    """
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".")[: len(package.split(".")) + 1 - node.level] if node.level else []
            module = ".".join([*parents, *filter(None, [node.module])])
            names.add(module)
            names.update(f"{module}.{alias.name}" for alias in node.names)
    return names


def _forbidden(names: set[str], forbidden: tuple[str, ...]) -> list[str]:
    return sorted(name for name in names if any(f"{name}.".startswith(f"{f}.") for f in forbidden))


def _sources(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def _violations(path: Path, forbidden: tuple[str, ...]) -> list[str]:
    package = ".".join(path.relative_to(ROOT).parent.parts)
    return _forbidden(_imports(path.read_text(encoding="utf-8"), package), forbidden)


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("import posture", ["posture"]),
        ("import hydra.core as h", ["hydra.core"]),
        ("from rsl_rl import runners", ["rsl_rl.runners"]),
        ("from rsl_rl.algorithms import PPO", ["rsl_rl.algorithms", "rsl_rl.algorithms.PPO"]),
        ("def f():\n    import omegaconf", ["omegaconf"]),
        ("from rsl_rl.env import VecEnv", []),
        ("from . import body", []),
        ("from .body import posture", []),
        ("import posture_tools", []),
    ],
)
def test_the_check_finds_what_it_should(line: str, found: list[str]) -> None:
    assert _forbidden(_imports(line, "envs"), ENVS_MAY_NOT) == found


@pytest.mark.parametrize("path", _sources("envs"), ids=lambda path: path.stem)
def test_envs_does_not_know_the_learner(path: Path) -> None:
    assert _violations(path, ENVS_MAY_NOT) == []


@pytest.mark.parametrize("module", ANALYSTS)
def test_analysis_needs_no_simulator(module: str) -> None:
    assert _violations(ROOT / "posture" / f"{module}.py", ANALYSTS_MAY_NOT) == []


@pytest.mark.parametrize("path", _sources("posture/report"), ids=lambda path: path.stem)
def test_the_report_needs_no_simulator(path: Path) -> None:
    assert path.stem in REPORT_WITH_BODY or _violations(path, ANALYSTS_MAY_NOT) == []


def test_files_stay_short() -> None:
    lengths = {
        str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines())
        for package in ("posture", "envs")
        for path in _sources(package)
    }
    assert {"posture/__init__.py", "envs/__init__.py"} <= lengths.keys()
    assert {name: length for name, length in lengths.items() if length > MAX_LINES} == {}
