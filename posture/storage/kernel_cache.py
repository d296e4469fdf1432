"""Warp's cache of compiled kernels: a folder that must be writable, also in a container without a home."""

import contextlib
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

from posture.config.errors import ConfigError
from posture.storage import run_dir


@contextlib.contextmanager
def writable() -> Iterator[None]:
    """While the block runs, a temporary folder takes the place of a cache that cannot be written to, as in a home that is
    read-only."""
    cache = _folder()
    with contextlib.ExitStack() as stack:
        try:
            if not cache.is_absolute():
                raise ConfigError("the user has no home")
            run_dir.writable(cache)
        except ConfigError:
            stack.enter_context(_temporary(cache))
        yield


def _folder() -> Path:
    """The folder that Warp will use; a relative path if it is in the home of a user who has none."""
    if named := os.environ.get("WARP_CACHE_PATH"):
        return Path(named).absolute() / version("warp-lang")
    if sys.platform == "win32":
        return Path(os.environ["LOCALAPPDATA"]) / "NVIDIA" / "warp" / "Cache" / version("warp-lang")
    home = os.path.expanduser("~/Library/Caches" if sys.platform == "darwin" else "~/.cache")
    caches = home if sys.platform == "darwin" else os.environ.get("XDG_CACHE_HOME", home)
    return Path(caches) / "warp" / version("warp-lang")


@contextlib.contextmanager
def _temporary(cache: Path) -> Iterator[None]:
    print(f"kernels are compiled at each start, since {cache} cannot be written to; WARP_CACHE_PATH names another folder")
    with tempfile.TemporaryDirectory(prefix="posture-", ignore_cleanup_errors=True) as folder:
        with contextlib.suppress(OSError):
            shutil.copytree(cache, Path(folder) / cache.name)  # the kernels of a container's image
        os.environ["WARP_CACHE_PATH"] = folder  # of this process and of those that it starts
        yield
