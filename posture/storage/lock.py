"""One process at a time in a folder: a lock that is released when its process ends, in any way."""

import contextlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from filelock import FileLock, Timeout

from posture.config import torchrun
from posture.config.errors import ConfigError


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of `folder`, which is created if necessary. Raises ConfigError if another process holds it.

    A process may take a lock that it already holds. Of the processes that torchrun starts only the first takes it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if torchrun.rank() > 0:
        yield
        return
    try:
        # Not at once: another process holds the lock for a moment while it asks whether the folder is in use.
        acquired = _lock(folder.resolve()).acquire(timeout=0.2, poll_interval=0.02)
    except Timeout:
        raise ConfigError(f"{folder}: another process is using this folder; wait for it, or stop it") from None
    with acquired:
        yield


def is_held(folder: Path) -> bool:
    """Whether a process, this one or another, holds the lock of `folder`."""
    return _lock(folder.resolve()).is_locked or is_busy(folder)


def is_busy(folder: Path) -> bool:
    """Whether another process holds the lock of `folder`."""
    lock = _lock(folder.resolve())
    if lock.is_locked or not Path(lock.lock_file).exists():
        return False
    try:
        with lock.acquire(blocking=False):
            return False
    except Timeout:
        return True


@cache
def _lock(folder: Path) -> FileLock:
    """The lock of a folder, always the same object, so that it counts how often this process holds it."""
    return FileLock(folder / ".lock", thread_local=False)
