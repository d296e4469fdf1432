"""The record of a roll-out against the environment."""

import numpy as np
import pytest
import torch

from envs.task.head_tracking import HeadTrackingEnv
from posture.evaluation.rollout import rollout
from posture.evaluation.trial import AS_TRAINED, trial_config
from tests.conftest import compose

RUN = compose("env.num_envs=64")
EVALUATION = RUN.evaluation.model_copy(update={"freq": (0.2, 1.0, 1.5), "duration": 1.5, "transient": 0.1})


@pytest.fixture(scope="module")
def env():
    return HeadTrackingEnv(trial_config(RUN.env, EVALUATION, AS_TRAINED, "cpu"), 0, "cpu")


def record(env, policy, duration=EVALUATION.duration):
    return rollout(env, policy, torch.tensor(EVALUATION.freq), duration)


def lean(_observation):
    """Full hip extension and ankle push: a fall in under a second."""
    return torch.tensor([[1.0, -1.0]]).repeat(3, 1)


def balance(env):
    """A stiff posture controller that stands for a while without following the target."""

    def act(_observation):
        angle, velocity = env.sim.joint_angle, env.sim.joint_velocity
        torque = -300.0 * angle[:, :2] - 30.0 * velocity[:, :2]
        return torque / env.config.torque_limit

    return act


def test_only_a_fall_ends_a_trial():
    config = trial_config(RUN.env, EVALUATION, AS_TRAINED, "cpu")
    assert config.termination.head_tolerance is None and config.termination.foot_motion is None
    assert config.termination.fall_height == RUN.env.termination.fall_height
    assert config.num_envs == 3 and config.episode_steps * config.control_dt > EVALUATION.duration


def test_targets_times_and_conditions(env):
    trial = record(env, balance(env))
    steps = round(EVALUATION.duration / env.config.control_dt)
    assert trial.time == pytest.approx(env.config.control_dt * np.arange(1, steps + 1))
    assert trial.freq == pytest.approx(EVALUATION.freq)
    expected = 0.1 * (1 - np.cos(2 * np.pi * trial.time[:, None] * np.array(EVALUATION.freq)))  # paper Eq. 5
    assert trial.target_x == pytest.approx(expected, abs=1e-5)
    assert trial.fall_step.tolist() == [-1, -1, -1]
    assert trial.hip_k.tolist() == [125.0] * 3 and trial.load.tolist() == [0.0] * 3
    assert trial.torque_limit == 100.0 and trial.control_dt == env.config.control_dt


def test_a_standing_body_rests_on_its_soles(env):
    trial = record(env, balance(env))
    assert trial.foot_flat[20:].mean() > 0.99
    heel, toe = env.sim.geometry.heel_x, env.sim.geometry.toe_x
    inside = trial.cop_x[20:]
    # On flat feet the centre of pressure stays between heel and toe, except for the millimetre by which they roll.
    assert np.nanmin(inside) > heel - 1e-3 and np.nanmax(inside) < toe + 1e-3
    assert abs(np.median(inside) - 0.002) < 0.02  # under the centre of mass, 2 mm ahead of the ankle
    assert trial.foot_displacement.max() < 0.01


def test_joint_order_and_torques(env):
    def act(_observation):
        return torch.tensor([[0.05, -0.1]]).repeat(3, 1)

    trial = record(env, act, duration=0.1)
    assert trial.joint_torque[0, 0].tolist() == pytest.approx([5.0, -10.0, 5.0, -10.0])
    assert trial.hip[-1] == pytest.approx(env.sim.joint_angle[:, 0].numpy(), abs=1e-6)
    assert trial.ankle[-1] == pytest.approx(env.sim.joint_angle[:, 1].numpy(), abs=1e-6)


def test_after_a_fall_the_record_is_nan(env):
    trial = record(env, lean)
    assert (trial.fall_step > 0).all()
    for world, fall in enumerate(trial.fall_step):
        assert np.isfinite(trial.head_x[:fall, world]).all() and np.isnan(trial.head_x[fall:, world]).all()
        assert trial.torso_height[fall - 1, world] >= env.config.termination.fall_height
        assert np.isnan(trial.joint_torque[fall:, world]).all() and not trial.foot_flat[fall:, world].any()


def test_the_same_policy_gives_the_same_record(env):
    first, second = record(env, balance(env)), record(env, balance(env))
    assert np.array_equal(first.joint_angle, second.joint_angle)
    assert np.array_equal(first.cop_x, second.cop_x, equal_nan=True)
