"""The policy that is evaluated, and the published numbers that it is compared with."""

import pytest
import torch

from envs.config import Ramp
from posture.config.errors import ConfigError
from posture.config.eval import EnvChanges
from posture.evaluation.trial import AS_TRAINED, comparable_table_3, evaluate_at, trial_config
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


RAMPED = compose("env.ramp={start:0.1,rate:0.1,duration:5}")


def test_a_policy_trained_on_a_ramp_can_be_evaluated_at_constant_frequencies():
    def followed(ramp):
        changes = AS_TRAINED.model_copy(update={"ramp": ramp})
        trial = trial_config(RAMPED.env, RAMPED.evaluation.model_copy(update={"freq": (0.5,)}), changes, "cpu")
        return trial.ramp

    other = Ramp(start=1.0, rate=-0.1, duration=5.0)
    assert (followed(None), followed(other), followed("none")) == (RAMPED.env.ramp, other, None)


def test_the_longest_trial_is_a_valid_one_and_a_longer_one_is_refused_by_its_own_key(run):
    def trial(duration):
        evaluation = run.evaluation.model_copy(update={"freq": (0.5,), "duration": duration})
        return trial_config(run.env, evaluation, AS_TRAINED, "cpu")

    longest = 4_999_999 * 0.0166  # an episode of twice as many control steps, and one, is the longest allowed
    assert trial(longest).episode_steps == 9_999_999
    with pytest.raises(ConfigError, match=r"^evaluation\.duration = 83010: allowed is at most 83000 s at 1 freq"):
        trial(83010.0)


def test_a_change_that_does_not_fit_the_run_is_refused_by_its_own_key(run):
    slow = run.env.model_copy(update={"control_dt": 0.05, "solver": run.env.solver.model_copy(update={"substeps": 5})})
    changes = AS_TRAINED.model_copy(update={"ramp": Ramp(start=0.0, rate=1.0, duration=9.0)})
    with pytest.raises(ConfigError, match=r"^env\.ramp: a period at 9 Hz"):
        trial_config(slow, run.evaluation, changes, "cpu")


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


def test_evaluate_at_measures_a_policy_and_writes_nothing(tmp_path, monkeypatch, capsys):
    """The shipped policy follows a slow target in phase and a fast one in anti-phase, as the paper's (Table 3)."""
    monkeypatch.chdir(tmp_path)
    rows, trial = evaluate_at([0.3, 1.2], duration=30, load=1)
    assert [row.mode for row in rows] == ["in-phase", "anti-phase"]
    assert [row.load_kg for row in rows] == [1.0, 1.0]
    assert trial.freq.tolist() == [0.3, 1.2] and trial.time[-1] == pytest.approx(30, abs=0.02)
    assert not list(tmp_path.iterdir()) and not capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"freq": []}, "freq"),
        ({"freq": [-1.0]}, "freq"),
        ({"freq": [1.0], "hip": 50}, "hip: no such key"),
        ({"freq": [1.0], "load": -4}, "load = -4"),
        ({"freq": [1.0], "duration": 3}, "evaluation.transient"),
        ({"freq": [1.0], "ckpt": "pretrained/none"}, "no such policy"),
    ],
)
def test_evaluate_at_refuses_what_is_not_allowed(arguments, message):
    with pytest.raises(ConfigError, match=message):
        evaluate_at(**arguments)
