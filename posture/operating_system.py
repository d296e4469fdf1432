"""Differences between POSIX systems and Windows; everything else in the project runs on both."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import IO

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM) if sys.platform == "win32" else (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that ask a process to stop. SIGHUP: its terminal was closed or its connection dropped."""


@contextlib.contextmanager
def block_signals(signals: tuple[signal.Signals, ...]) -> Iterator[None]:
    """Hold `signals` back until the block ends; processes started inside it never receive them.

    Windows cannot hold signals back: there they arrive as usual.
    """
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def yield_processor() -> None:
    """Let another process that is ready run on this processor; a system call, and so also a memory barrier."""
    if sys.platform == "win32":
        time.sleep(0)
    else:
        os.sched_yield()


def process_is_alive(pid: int) -> bool:
    """Whether a process with this id exists. A child that has ended counts until it has been waited for."""
    if sys.platform == "win32":  # there os.kill(pid, 0) would end the process
        raise NotImplementedError("processes cannot share a training on Windows")
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # it belongs to another user
        return True
    return True


def lower_priority(steps: int) -> None:
    """Lower this process's priority by `steps` of niceness; no effect on Windows."""
    if sys.platform != "win32":
        os.nice(steps)


def start_in_background(
    line: Sequence[str], messages: IO[bytes], environment: Mapping[str, str]
) -> "subprocess.Popen[bytes]":
    """Start a command of the lowest priority without input and output, except for its errors, which go to `messages`.

    Ctrl-C on the terminal does not reach it.
    """
    nowhere = subprocess.DEVNULL
    if sys.platform == "win32":
        flags = subprocess.IDLE_PRIORITY_CLASS | subprocess.CREATE_NEW_PROCESS_GROUP
        return subprocess.Popen(
            line, stdin=nowhere, stdout=nowhere, stderr=messages, env=dict(environment), creationflags=flags
        )
    # Not in a session of its own: Linux compares priorities within a session only (sched_autogroup).
    process = subprocess.Popen(line, stdin=nowhere, stdout=nowhere, stderr=messages, env=dict(environment), process_group=0)
    with contextlib.suppress(ProcessLookupError):
        os.setpriority(os.PRIO_PROCESS, process.pid, 19)
    return process
