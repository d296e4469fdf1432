"""SIGINT (Ctrl-C) and SIGTERM: a training ends its iteration and saves, all else ends at once; exit code 130 or 143."""

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from types import FrameType

from posture import operating_system

NUMBERS = (signal.SIGINT, signal.SIGTERM)
_asked = 0
_deferring = False


class Stopped(SystemExit):
    """A signal ended the work. As a SystemExit it gives the process its exit code, 128 + the signal, without a traceback."""

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)


@contextlib.contextmanager
def handled() -> Iterator[None]:
    """Within it either signal raises `Stopped`, unless this process was started to ignore it."""
    if threading.current_thread() is not threading.main_thread():
        yield  # Python lets the main thread alone install handlers
        return
    before = {number: signal.getsignal(number) for number in NUMBERS}
    own = {number: handler for number, handler in before.items() if handler not in (signal.SIG_IGN, None)}
    for number in own:
        signal.signal(number, _handle)
    try:
        yield
    finally:
        for number, handler in own.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def deferred() -> Iterator[None]:
    """Within it the first signal only makes `asked` true, for the work to see when it can end; a second raises `Stopped`."""
    global _asked, _deferring
    with handled():
        _asked, _deferring = 0, True
        try:
            yield
        finally:
            _asked, _deferring = 0, False


def asked() -> int:
    """Number of the signal that asked the work within `deferred` to end, or 0."""
    return _asked


@contextlib.contextmanager
def blocked() -> Iterator[None]:
    """Within it neither signal is delivered, but afterwards; processes started in it never get one."""
    with operating_system.block_signals(NUMBERS):
        yield


def _handle(number: int, frame: FrameType | None) -> None:
    global _asked
    if not _deferring or _asked:
        raise Stopped(number)
    _asked = number
    # Not print: the signal may have come in the middle of one.
    os.write(2, b"\nwill end after this iteration and save; a second signal ends at once\n")
