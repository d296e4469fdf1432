"""A number that is not finite stops a training in that iteration, in one line that names it, and is never saved."""

import multiprocessing

import pytest
import torch

from envs.task.head_tracking import HeadTrackingEnv
from posture import train
from posture.learning import parallel
from posture.learning.ppo import PPO
from posture.learning.resume import iterations_done
from posture.storage import checkpoint, run_dir
from tests.commands import TINY, call, runs
from tests.time_limit import at_most

STEPS = 4
"""Steps of an iteration in TINY."""


def corrupt_environment(monkeypatch, term, value):
    """From the second iteration on one world gives `value` as its reward or in its observation."""
    step, calls = HeadTrackingEnv.step, []

    def corrupted(self, actions):
        observation, reward, done, extras = step(self, actions)
        calls.append(1)
        if len(calls) > STEPS:
            (reward if term == "reward" else observation["policy"])[0] = value
        return observation, reward, done, extras

    monkeypatch.setattr(HeadTrackingEnv, "step", corrupted)


def corrupt_loss(monkeypatch, name):
    """The second update returns a loss that is not a number."""
    update, calls = PPO.update, []

    def corrupted(self):
        calls.append(1)
        return update(self) | ({name: float("nan")} if len(calls) == 2 else {})

    monkeypatch.setattr(PPO, "update", corrupted)


def error_of_training(monkeypatch, capture, *overrides):
    """The line on stderr of a training that fails."""
    with at_most(180), pytest.raises(SystemExit) as stop:
        call(monkeypatch, "train", *TINY, "max_iterations=4", "evaluate=false", *overrides)
    assert stop.value.code == 1
    (line,) = [line for line in capture.readouterr().err.strip().splitlines() if not line.startswith("Warp CUDA warning")]
    return line


@pytest.mark.parametrize(
    ("term", "value"), [("reward", torch.nan), ("reward", torch.inf), ("observation", torch.inf), ("surrogate", None)]
)
def test_number_is_named_and_not_saved(tmp_path, monkeypatch, capsys, term, value):
    monkeypatch.chdir(tmp_path)
    if value is None:
        corrupt_loss(monkeypatch, term)
    else:
        corrupt_environment(monkeypatch, term, value)
    line = error_of_training(monkeypatch, capsys)
    assert line.startswith("error: iteration 2: training stopped") and term in line
    newest = run_dir.newest_model(runs()[0])
    assert newest.name == "model_1.pt" and iterations_done(runs()[0]) == 1
    weights = checkpoint.load(newest, "cpu")["actor_state_dict"].values()
    assert all(torch.isfinite(weight).all() for weight in weights)


learn = train._learn


def learn_with_nan_in_the_second_process(*arguments):
    with pytest.MonkeyPatch.context() as patch:
        if parallel.rank() == 1:
            corrupt_environment(patch, "reward", torch.nan)
        learn(*arguments)


def test_number_of_one_process_stops_all(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(train, "_learn", learn_with_nan_in_the_second_process)
    line = error_of_training(monkeypatch, capfd, "processes=2")
    assert line == "error: iteration 2: training stopped, since these are not finite numbers: reward"
    assert run_dir.newest_model(runs()[0]).name == "model_1.pt" and not multiprocessing.active_children()
