"""Atomic writing: a file is complete, or it is not there."""

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; move it onto `path` on success, delete it on failure.

    A reader therefore sees the old file or the complete new one, even if this process is killed. Raises OSError with the
    name of `path` if it cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # Its length does not depend on that of `path`, whose name may be as long as the file system allows.
    temporary = path.with_name(f".posture-{uuid.uuid4().hex}.tmp")
    try:
        yield temporary
        # Otherwise a power cut could leave the new name on an incomplete file. Windows needs a writable descriptor.
        with open(temporary, "r+b") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error  # the error of a full disk has no file name
    finally:
        temporary.unlink(missing_ok=True)


def clear(folder: Path) -> None:
    """Remove temporary files that killed processes left in `folder`; no other process may be using it."""
    for path in folder.glob(".posture-*.tmp"):
        path.unlink(missing_ok=True)
