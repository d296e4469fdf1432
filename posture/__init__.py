"""Human postural mode alternation: the learner and the analyst. The body and its task are in `envs`."""

import os
from importlib.metadata import PackageNotFoundError, version

# rsl-rl imports GitPython, which fails at import where git is not installed unless told to be quiet.
os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")

try:
    __version__ = version("posture")
except PackageNotFoundError:  # run from a checkout that was not installed
    __version__ = "0+unknown"
