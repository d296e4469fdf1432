"""The default learner learns, and shares a training under torchrun."""

import statistics
import subprocess
import sys

import pytest
import torch

from envs.task.head_tracking import HeadTrackingEnv
from posture.learning.learner import Learner
from tests.conftest import compose

pytestmark = pytest.mark.slow


def test_episodes_become_longer(tmp_path):
    """After 25 iterations an episode is at least three times as long as with an untrained policy.

    As in every training the environment knows its length: without it the weights of the reward would have their final values
    from the start, with which a beginner learns slowly.
    """
    config = compose()
    torch.manual_seed(config.seed)
    env = HeadTrackingEnv(config.env, config.seed, "cpu", training_steps=config.training_steps)
    learner = Learner(env, config.agent, tmp_path, "cpu")
    learner.train(1)
    untrained = statistics.mean(learner.logger.lenbuffer)
    learner.train(25)
    assert statistics.mean(learner.logger.lenbuffer) > 3 * untrained


def test_torchrun_shares_a_training(tmp_path):
    """Only the first process writes a run, and its state is that of both processes."""
    tiny = "env.num_envs=8 max_iterations=2 agent.num_steps_per_env=4 agent.algorithm.num_mini_batches=2 evaluate=false"
    command = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", "-m", "posture.train", *tiny.split()]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    (run,) = (tmp_path / "runs").iterdir()
    assert f"runs/{run.name}" in done.stdout
    assert len(torch.load(run / "resume.pt", weights_only=True)["processes"]) == 2
