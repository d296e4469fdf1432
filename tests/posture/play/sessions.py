"""Shared by the tests of the page: its configuration, and sessions whose theory is computed immediately."""

from concurrent.futures import Future

from posture.config.play import PlayConfig
from posture.play.policies import policy_choices
from posture.play.session import Session
from tests.conftest import composed

DT = 0.0166


def compose_play(*overrides):
    """The checked configuration that these overrides give, with the shipped policy of Exp. 1 where they name none."""
    return composed("play", PlayConfig, ("ckpt=pretrained", *overrides))


class InlineWorker:
    """A `TheoryWorker` that computes in the calling thread."""

    def submit(self, function, *arguments):
        future = Future()
        try:
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future


READ = {}


def policies(config):
    """The policies that the page offers. Reading the shipped ones takes a third of a second, so that it is done once."""
    key = config.ckpt, config.lqr.model_dump_json()
    if key not in READ:
        READ[key] = policy_choices(config.ckpt, config.lqr)
    return READ[key]


def new_session(body, *overrides):
    """A session with these overrides."""
    config = compose_play(*overrides)
    return Session(config, policies(config), body, InlineWorker())


def advance(session, seconds):
    """Step for `seconds`; the states."""
    states = []
    for _ in range(round(seconds / session.dt)):
        session.step()
        states.append(session.state)
    return states
