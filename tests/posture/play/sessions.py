"""Shared by the tests of the page: its configuration, and sessions whose theory is computed at once."""

from concurrent.futures import Future

import hydra

from posture.cli.jobs import CONF, plain
from posture.config.play import PlayConfig
from posture.config.reading import read
from posture.play.policies import policy_choices
from posture.play.session import Session

DT = 0.0166


def compose_play(*overrides):
    """The checked configuration that these overrides give."""
    with hydra.initialize_config_dir(str(CONF), version_base="1.3"):
        return read(PlayConfig, plain(hydra.compose("play", list(overrides))))


class InlineWorker:
    """A `TheoryWorker` that computes in the calling thread."""

    def submit(self, function, *arguments):
        future = Future()
        try:
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future


def new_session(body, *overrides):
    """A session with these overrides."""
    config = compose_play(*overrides)
    return Session(config, policy_choices(config.ckpt, config.lqr), body, InlineWorker())


def advance(session, seconds):
    """Step for `seconds`; the states."""
    states = []
    for _ in range(round(seconds / session.dt)):
        session.step()
        states.append(session.state)
    return states
