"""Configurations and run folders are read without the libraries that take seconds to import."""

import subprocess
import sys
from pathlib import Path

POSTURE = Path(__file__).parents[3] / "posture"
SLOW = {"torch", "warp", "newton", "mujoco"}


def test_config_and_storage_import_no_physics_or_torch():
    files = [path for package in ("config", "storage") for path in sorted((POSTURE / package).glob("*.py"))]
    modules = [f"posture.{path.parent.name}.{path.stem}" for path in files if path.stem != "__init__"]
    assert len(modules) > 10
    code = f"import sys, {', '.join(modules)}; print(*({SLOW} & sys.modules.keys()))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == ""
