"""What the tests of the page share: its configuration, and an office that answers at once."""

from concurrent.futures import Future

from posture.cli import jobs
from posture.config.play import PlayConfig
from posture.play.pilot import candidates
from posture.play.session import Session


def compose_play(*overrides):
    """The checked configuration that these overrides give."""
    return jobs.compose("play", PlayConfig, *overrides)


class Inline:
    """An `Office` that computes in this thread, while it is asked."""

    def submit(self, function, *arguments):
        future = Future()
        try:
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future


def session(body, *overrides):
    """A session with these overrides."""
    config = compose_play(*overrides)
    return Session(config, candidates(config.ckpt, config.lqr), body, Inline())


def walk(session, seconds):
    """Let it go on for so long; the states."""
    seen = []
    for _ in range(round(seconds / session.dt)):
        session.step()
        seen.append(session.state)
    return seen
