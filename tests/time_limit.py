"""A test that may hang ends by itself."""

import contextlib
import signal


@contextlib.contextmanager
def at_most(seconds):
    """Raise TimeoutError in the body of this `with` after so many seconds."""

    def expire(*_):
        raise TimeoutError(f"not done within {seconds} s")

    before = signal.signal(signal.SIGALRM, expire)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
