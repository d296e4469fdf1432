"""The averages of the actor's weights, which are the policy."""

import pytest
import torch

from envs.task.head_tracking import HeadTrackingEnv
from posture.config.errors import ConfigError
from posture.learning.learner import Learner
from posture.learning.networks import load_policy
from posture.learning.resume import iterations_done
from posture.storage import checkpoint, provenance
from tests.commands import TINY
from tests.conftest import compose


@pytest.fixture
def learn(tmp_path):
    """A function that trains up to some iteration of four in a folder, continuing what is there; the actor's weights after
    each iteration."""
    config = compose(*TINY, "max_iterations=4", "agent.average_from=0.5")

    def learn(name, iterations):
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        torch.manual_seed(1)
        env = HeadTrackingEnv(config.env, config.seed, "cpu", training_steps=config.training_steps)
        learner, weights = Learner(env, config.agent, folder, "cpu"), []
        if (folder / "resume.pt").exists():
            learner.resume()
        learner.train(iterations, lambda done, _: weights.append(learner.alg.actor.mlp[0].weight.detach().clone()))
        return weights

    return config, learn


def saved(folder, iteration):
    return checkpoint.load(folder / f"model_{iteration}.pt", "cpu")


def test_the_policy_has_the_mean_weights_of_the_last_iterations(learn, tmp_path):
    config, learn = learn
    weights = learn("whole", 4)
    assert not torch.equal(weights[2], weights[3])
    policies = [load_policy(saved(tmp_path / "whole", i), config, tmp_path, "cpu").mlp[0].weight for i in (2, 3, 4)]
    for policy, expected in zip(policies, (weights[1], weights[2], (weights[2] + weights[3]) / 2), strict=True):
        torch.testing.assert_close(policy, expected, rtol=1e-6, atol=1e-8)


def test_a_training_can_begin_with_the_averages(learn, tmp_path):
    config, learn = learn
    learn("whole", 4)
    env = HeadTrackingEnv(config.env, config.seed, "cpu")
    learner = Learner(env, config.agent, tmp_path, "cpu")
    learner.start_from(tmp_path / "whole" / "model_4.pt")
    found = learner.alg.actor.state_dict()
    assert all(torch.equal(value, found[name]) for name, value in saved(tmp_path / "whole", 4)["average_state_dict"].items())


@pytest.mark.parametrize("damage", ["not finite", "missing"])
def test_damaged_averages_are_not_resumed(learn, tmp_path, damage):
    config, learn = learn
    learn("whole", 4)
    provenance.write_config(tmp_path / "whole", config)
    assert iterations_done(tmp_path / "whole") == 4
    content = saved(tmp_path / "whole", 4)
    if damage == "missing":
        del content["average_state_dict"]
    else:
        content["average_state_dict"]["mlp.0.weight"][0, 0] = torch.nan
    checkpoint.save(content, tmp_path / "whole" / "model_4.pt")
    with pytest.raises(ConfigError, match=r"mlp.0.weight holds weights that are not finite|has averaged weights"):
        iterations_done(tmp_path / "whole")


def test_a_resumed_training_has_the_same_averages(learn, tmp_path):
    _, learn = learn
    learn("whole", 4)
    learn("parts", 3)
    learn("parts", 4)
    whole, parts = (saved(tmp_path / name, 4) for name in ("whole", "parts"))
    for part in ("average_state_dict", "actor_state_dict"):
        assert all(torch.equal(value, parts[part][name]) for name, value in whole[part].items())
