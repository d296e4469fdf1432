"""Modules that a fresh interpreter loads. `lint-imports` checks the imports between packages (see pyproject.toml)."""

import json
import pkgutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]

# These check input or work on arrays and files: bad input is refused before a simulator is imported, and results can be read
# and drawn where none is installed.
LIGHT = [
    "posture.cli",
    "posture.config",
    "posture.storage",
    "posture.analysis",
    "posture.recording",
    "posture.theory",
    "posture.drawing",
    "posture.reproduce",
]
SIMULATORS = ["torch", "warp", "newton", "mujoco"]

# Reads the body's masses and lengths by MuJoCo.
NEEDS_A_SIMULATOR = {"posture.reproduce.collect": "mujoco"}

# Prints, for each module named on the command line that does not import where no simulator is installed, which one it wants.
IMPORT_EACH = f"""
import importlib, importlib.abc, json, sys

class NoSimulator(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name in {SIMULATORS}:
            raise ModuleNotFoundError(name=name)

sys.meta_path.insert(0, NoSimulator())
failed = {{}}
for module in sys.argv[1:]:
    try:
        importlib.import_module(module)
    except ModuleNotFoundError as error:
        failed[module] = error.name
print(json.dumps(failed))
"""


def run(script: str, *arguments: str) -> str:
    """What `script` prints in a fresh interpreter."""
    return subprocess.run(
        [sys.executable, "-c", script, *arguments], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout


def modules(package: str) -> list[str]:
    """The package and all of its modules but the commands."""
    found = pkgutil.walk_packages([str(ROOT / package.replace(".", "/"))], f"{package}.")
    return [package, *(each.name for each in found if not each.name.endswith("__main__"))]


def test_input_and_results_need_no_simulator() -> None:
    failed = json.loads(run(IMPORT_EACH, *(module for package in LIGHT for module in modules(package))))
    assert failed == NEEDS_A_SIMULATOR


def test_the_task_needs_only_the_interface_of_rsl_rl() -> None:
    loaded = run("import sys, envs.task.head_tracking; print(*sys.modules)").split()
    assert "rsl_rl.env" in loaded
    assert not {"rsl_rl.runners", "rsl_rl.algorithms"} & set(loaded)
