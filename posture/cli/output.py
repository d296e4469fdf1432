"""Output that never ends the work: what cannot be written is dropped.

A reader that has closed its pipe (`| head`), a terminal that is gone, a full disk under a redirected log, an output that was
closed from the start (`>&-`): the work goes on to its end, and its results are written. Characters that an output's encoding
lacks are written as `\\xe9`.
"""

import contextlib
import io
import os
import select
import sys
from pathlib import Path
from typing import Any


class _Lossy(io.RawIOBase):
    """A raw stream that writes everything, and on which failed writes count as done."""

    def __init__(self, raw: io.RawIOBase) -> None:
        self._raw = raw

    def write(self, data: Any) -> int:
        left = memoryview(data).cast("B")
        size = len(left)
        with contextlib.suppress(OSError):
            while left:
                written = self._raw.write(left)
                if written is None:  # the pipe is full and does not block
                    select.select([], [self._raw], [])
                else:
                    left = left[written:]
        return size

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._raw.fileno()

    def isatty(self) -> bool:
        return self._raw.isatty()

    def close(self) -> None:
        super().close()
        self._raw.close()


def install() -> None:
    """Make stdout and stderr of this process such outputs, unless a notebook or a test has replaced them."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:  # closed: else the next file to be opened would get its number, and what C libraries print
            os.open(os.devnull, os.O_RDWR)
            os.set_inheritable(number, True)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is not getattr(sys, f"__{name}__"):
            continue
        if stream is None:
            setattr(sys, name, _text(io.FileIO(os.devnull, "w"), "utf-8", True))
            continue
        with contextlib.suppress(OSError):
            stream.flush()
        raw = getattr(stream.buffer, "raw", stream.buffer)  # it has no buffer with PYTHONUNBUFFERED
        setattr(sys, name, _text(raw, stream.encoding, stream.line_buffering or stream.write_through))


def log_file(path: Path) -> io.TextIOWrapper:
    """The file `path`, opened to append lines, as such an output."""
    return _text(io.FileIO(path, "a"), "utf-8", True)


def _text(raw: io.RawIOBase, encoding: str, line_buffering: bool) -> io.TextIOWrapper:
    # Without a BufferedWriter, which would write again what a signal interrupted after it was written.
    return io.TextIOWrapper(_Lossy(raw), encoding, errors="backslashreplace", line_buffering=line_buffering)  # type: ignore[arg-type]
