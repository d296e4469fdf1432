"""Human postural mode alternation: the learner and the analysis. Body and task are in `envs`, beside this package."""

import importlib.util
import os
import sys
from pathlib import Path

# rsl-rl imports GitPython, which prints an error at import if git is not installed.
os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")


def _load_envs() -> None:
    """Import `envs` from beside this package, even if another package `envs` is on the path.

    With `python -m` the working directory comes first on the path, and a user may have another `envs` there.
    """
    own = Path(__file__).resolve().parent.parent / "envs" / "__init__.py"
    if loaded := sys.modules.get("envs"):
        if loaded.__file__ is None or Path(loaded.__file__).resolve() != own:
            raise ImportError(f"posture has its own package envs, but another one is already imported: {loaded}")
        return
    spec = importlib.util.spec_from_file_location("envs", own)
    assert spec is not None and spec.loader is not None
    sys.modules["envs"] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)


_load_envs()
