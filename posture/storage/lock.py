"""One process at a time in a folder: a lock that is released when its process ends, in any way.

The lock is that of the file .lock, which is there while it is held, or was left by a process that was killed.
"""

import contextlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from filelock import FileLock, Timeout

from posture.config import torchrun
from posture.config.errors import ConfigError
from posture.storage import run_dir


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of `folder`, which is created if necessary, and removed again if nothing is written into it. Raises
    ConfigError if another process holds the lock.

    A process may take a lock that it already holds. Of the processes that torchrun starts only the first takes it.
    """
    with run_dir.removed_if_empty(folder):
        folder.mkdir(parents=True, exist_ok=True)
        with contextlib.nullcontext() if torchrun.rank() > 0 else _held(folder):
            yield


@contextlib.contextmanager
def _held(folder: Path) -> Iterator[None]:
    lock = _lock(folder.resolve())
    outermost = not lock.is_locked
    try:
        # Not at once: another process holds the lock for a moment while it asks whether the folder is in use.
        acquired = lock.acquire(timeout=0.2, poll_interval=0.02)
    except Timeout:
        raise ConfigError(f"{folder}: another process is using this folder; wait for it, or stop it") from None
    with acquired:
        try:
            yield
        finally:
            if outermost:
                # Before the release: a process that has already opened this file then sees that it has no name any more.
                with contextlib.suppress(OSError):
                    Path(lock.lock_file).unlink()


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
