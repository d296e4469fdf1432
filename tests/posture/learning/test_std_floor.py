"""The lower bound of the standard deviation of the actions."""

import pytest
import torch

from envs.task.head_tracking import HeadTrackingEnv
from posture.learning.learner import Learner
from tests.commands import TINY
from tests.conftest import compose


def test_floor_falls_geometrically_in_the_last_part_of_a_training(tmp_path, monkeypatch):
    """From 0.08 to 0.005, a factor of 16, over the second half of four iterations; the policy's noise follows it."""
    config = compose(
        *TINY,
        "max_iterations=4",
        "agent.actor.distribution_cfg={init_std: 0.08, std_range: [0.08, 1.0]}",
        "agent.std_floor={begin: 0.5, end: 0.005}",
    )
    env = HeadTrackingEnv(config.env, config.seed, "cpu", training_steps=config.training_steps)
    learner = Learner(env, config.agent, tmp_path, "cpu")
    actor, noise, update = learner.alg.actor, [], learner.alg.update

    def spy():
        actor.distribution.update(torch.zeros(1, 2))
        noise.append(actor.distribution.std.min().item())
        with torch.no_grad():
            actor.distribution.log_std_param.fill_(-20.0)  # as if learning wanted none
        return update()

    monkeypatch.setattr(learner.alg, "update", spy)
    learner.train(4)
    assert noise == pytest.approx([0.08, 0.08, 0.08, 0.02], rel=1e-3)
    actor.distribution.update(torch.zeros(1, 2))
    assert actor.distribution.std.min().item() == pytest.approx(0.005, rel=1e-3)
