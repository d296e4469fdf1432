"""One process at a time in a folder: a lock that ends with the process that holds it, however that ends."""

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from posture.config.errors import ConfigError

NAME = ".lock"
_held: set[Path] = set()


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Within it no other process has the lock of `folder`, which is made if need be. Raises ConfigError where one has it.

    Within itself it does nothing. Of the processes that torchrun starts the first alone takes the lock.
    """
    folder.mkdir(parents=True, exist_ok=True)
    place = folder.resolve()
    if place in _held or os.environ.get("RANK", "0") != "0":
        yield
        return
    with (folder / NAME).open("ab") as file:  # never removed: who waits for an old file would not see a new one
        if not _take(file.fileno()):
            raise ConfigError(f"{folder}: another process is at work in it; wait for it, or stop it")
        _held.add(place)
        try:
            yield
        finally:
            _held.discard(place)


def is_busy(folder: Path) -> bool:
    """Whether another process has the lock of `folder`."""
    try:
        with (folder / NAME).open("rb") as file:
            return folder.resolve() not in _held and not _take(file.fileno())
    except OSError:
        return False


def _take(file: int) -> bool:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True  # a file system without locks: then it goes without
    return True
