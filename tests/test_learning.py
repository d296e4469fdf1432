"""That the default learner learns: minutes, so only with `make test-slow`."""

import statistics

import pytest
import torch

from envs.head_tracking import HeadTrackingEnv
from posture.learner import Learner
from tests.conftest import compose


@pytest.mark.slow
def test_episodes_become_longer(tmp_path):
    """Within 25 iterations the head stays on target at least three times as long as that of an untrained policy."""
    config = compose()
    torch.manual_seed(config.seed)
    env = HeadTrackingEnv(config.env, config.seed, "cpu")
    learner = Learner(env, config.agent, tmp_path, "cpu")
    learner.train(1)
    untrained = statistics.mean(learner.logger.lenbuffer)
    learner.train(25)
    assert statistics.mean(learner.logger.lenbuffer) > 3 * untrained
