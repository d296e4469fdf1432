"""A time limit for tests that could hang."""

import contextlib
import signal


@contextlib.contextmanager
def at_most(seconds):
    """Context manager that raises TimeoutError after this many seconds."""

    def expire(*_):
        raise TimeoutError(f"not done within {seconds} s")

    before = signal.signal(signal.SIGALRM, expire)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
