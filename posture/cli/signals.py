"""SIGINT (Ctrl-C), SIGTERM and SIGHUP (a closed terminal): a training finishes its iteration and saves, everything else ends
immediately.

The exit code is 130, 143 or 129.
"""

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from types import FrameType

from posture import operating_system

POOL_S = 2.0
"""Longest wait for a pool whose processes are ended [s]."""
NUMBERS = operating_system.STOP_SIGNALS
_pending = 0
_hung_up = False
_deferring = False


class Stopped(SystemExit):
    """A signal ended the process. As a SystemExit it sets the exit code, 128 + the signal, and prints no traceback."""

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        self.number = number


@contextlib.contextmanager
def handled() -> Iterator[None]:
    """In this context each of these signals raises `Stopped`, unless this process was started with the signal ignored."""
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread may install handlers
        return
    before = {number: signal.getsignal(number) for number in NUMBERS}
    own = {number: handler for number, handler in before.items() if handler not in (signal.SIG_IGN, None)}
    for number in own:
        signal.signal(number, _handle)
    try:
        yield
    finally:
        for number, handler in own.items():
            # A closed terminal sends SIGHUP again while the process ends.
            repeats = _hung_up and number not in (signal.SIGINT, signal.SIGTERM)
            signal.signal(number, signal.SIG_IGN if repeats else handler)


@contextlib.contextmanager
def deferred() -> Iterator[None]:
    """In this context the first signal is only noted in `pending`, for work to end cleanly; the end of the context, or a
    second signal, raises `Stopped`."""
    global _pending, _deferring
    with handled():
        _pending, _deferring = 0, True
        try:
            yield
            if _pending:
                raise Stopped(_pending)
        finally:
            _pending, _deferring = 0, False


def raise_stopped(error: BaseException) -> None:
    """Raise the `Stopped` that led to `error`, if one did: a library that a signal interrupts may fail as it cleans up."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, Stopped):
            raise cause from None
        cause = cause.__context__


def pending() -> int:
    """Number of the signal that was received within `deferred`, or 0."""
    return _pending


@contextlib.contextmanager
def blocked() -> Iterator[None]:
    """In this context the signals are held back until its end. Processes started in it never receive them."""
    with operating_system.block_signals(NUMBERS):
        yield


def _end_pools() -> None:
    """End the processes of every pool, which would first finish the work they have.

    A thread of the pool then marks the waiting work as failed. Wait for it: `Stopped` cancels that work, and in Python 3.11
    the thread ends with a traceback if it meets cancelled work (python/cpython#107219).
    """
    children = multiprocessing.active_children()
    for process in children:
        process.terminate()
    for thread in threading.enumerate() if children else []:
        if type(thread).__module__ == "concurrent.futures.process" and thread.is_alive():
            thread.join(POOL_S)


def _handle(number: int, frame: FrameType | None) -> None:
    global _pending, _hung_up
    if number not in (signal.SIGINT, signal.SIGTERM):
        # A closed terminal sends SIGHUP more than once, from the kernel and the shell; a session that ends, after SIGTERM.
        if _hung_up or _pending:
            return
        _hung_up = True
    if not _deferring:
        _end_pools()
    if not _deferring or _pending:
        raise Stopped(number)
    _pending = number
    with contextlib.suppress(OSError):  # not print, which the signal may have interrupted
        os.write(2, b"\nwill stop once this iteration is saved; a second signal stops at once\n")
