"""The policy that is evaluated, and the published numbers that it is compared with."""

import pytest
import torch

from posture.config.errors import ConfigError
from posture.config.eval import EnvChanges
from posture.evaluation.trial import AS_TRAINED, comparable_table_3, trial_config
from posture.learning.learner import Learner
from posture.learning.networks import load_policy
from tests.conftest import compose


@pytest.fixture(scope="module")
def run():
    return compose("env.num_envs=64", "agent.num_steps_per_env=4")


@pytest.fixture(scope="module")
def env(run):
    from envs.task.head_tracking import HeadTrackingEnv

    return HeadTrackingEnv(run.env, 0, "cpu")


@pytest.mark.parametrize("change", [{}, {"hip_k": 60.0}, {"load": 2.0}, {"amplitude": 0.05}, {"ankle_k": 30.0}])
def test_published_values_are_compared_only_under_their_own_conditions(run, change):
    changes = EnvChanges.model_validate({**AS_TRAINED.model_dump(), **change})
    trial = trial_config(run.env, run.evaluation, changes, "cpu")
    assert (comparable_table_3(trial) is None) == bool(change)
    assert comparable_table_3(trial.model_copy(update={"energy_weight": 5.0})) is None


def test_the_evaluated_policy_is_the_trained_one(run, env, tmp_path):
    """Deterministic output of the loaded network equals the learner's own, normalisation included."""
    learner = Learner(env, run.agent, tmp_path, "cpu")
    learner.train(1)
    observation = env.get_observations()
    expected = learner.get_inference_policy("cpu")(observation)
    content = torch.load(tmp_path / "model_1.pt", weights_only=True)
    policy = load_policy(content, run, tmp_path / "model_1.pt", "cpu")
    with torch.inference_mode():
        assert torch.equal(policy(observation), expected)
    assert expected.abs().max() > 0.0


def test_a_policy_of_another_shape_is_refused(run, env, tmp_path):
    learner = Learner(env, run.agent, tmp_path, "cpu")
    content = learner.alg.save()
    other = compose("env.num_envs=64", "agent.actor.hidden_dims=[32,32]")
    with pytest.raises(ConfigError, match="does not hold this run's policy"):
        load_policy(content, other, tmp_path / "model_1.pt", "cpu")
