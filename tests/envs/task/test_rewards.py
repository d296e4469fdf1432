"""Reward terms, their sum and their schedules against hand arithmetic."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from envs.config import Schedule
from envs.task import rewards
from envs.task.head_tracking import HeadTrackingEnv


@pytest.fixture(params=[np.array, torch.tensor], ids=["numpy", "torch"])
def row(request):
    """A function from one world's values to the array of a reward function: every term is for numpy and for torch."""
    return lambda *values: request.param([values])


def test_closeness_by_hand(row):
    # 1 / (1 + 5 x 0.2^2) = 1 / 1.2
    assert rewards.closeness(row(0.0, 0.2), 5.0)[0].tolist() == pytest.approx([1.0, 1 / 1.2])


@pytest.mark.parametrize(("unit", "expected"), [("joule", -0.664), ("normalised", -0.00664), ("authors_code", -0.04)])
def test_energy_by_hand(row, unit, expected):
    # |10 x 2| + |-5 x 4| = 40 W for 0.0166 s, of torques up to 100 Nm; |0.1 x 0.1 x 2| + |-0.05 x 0.1 x 4| = 0.02 + 0.02
    found = rewards.energy(row(10.0, -5.0), row(2.0, 4.0), unit, 100.0, 0.0166)
    assert found.tolist() == pytest.approx([expected])


def test_torque_by_hand(row):
    assert rewards.torque_squared(row(3.0, -4.0)).tolist() == [-25.0]


def test_distance_beyond_the_tolerance_by_hand(row):
    assert rewards.beyond(row(0.02, -0.03, 0.035), 0.025)[0].tolist() == pytest.approx([0.0, 0.005, 0.01])


def test_joint_limit_by_hand(row):
    # Half of the last 2 % of one joint, all of it of another.
    assert rewards.joint_limit(row(0.5, 0.99, -1.0, 0.98)).tolist() == pytest.approx([1.5], abs=1e-4)


@pytest.mark.parametrize(("steps", "expected"), [(0, 11.0), (50, math.sqrt(44.0)), (100, 4.0), (1000, 4.0)])
def test_a_schedule_is_geometric_and_then_constant(steps, expected):
    schedule = Schedule(start=11.0, end=4.0, until=0.25)
    progress = torch.tensor(steps, dtype=torch.float64) / 400
    assert float(rewards.weight_at(progress, schedule)) == pytest.approx(expected)
    assert rewards.weight(schedule) == 4.0
    assert rewards.weight(7.0) == rewards.weight_at(progress, 7.0) == 7.0


def total(config, head_error, foot, action, velocity, ended=False):
    """The environment's reward of one world in a given situation, outside a training, without stepping it."""
    env = HeadTrackingEnv.__new__(HeadTrackingEnv)
    env.config, env.training_steps, env.num_envs = config, None, 1
    env.state = SimpleNamespace(
        target_x=torch.tensor([head_error]),
        head_x=torch.zeros(1),
        foot_displacement=torch.tensor([[foot, foot]]),
        action=torch.tensor([action]),
        joint_velocity=torch.tensor([velocity]),
        joint_force=torch.tensor([[30.0, -20.0, 40.0, -10.0]]),
        joint_angle=torch.zeros(1, 4),
        tolerance=torch.tensor([config.reward.tolerance]),
    )
    env._limit_centre, env._limit_half = torch.zeros(4), torch.ones(4)
    return float(env._reward(torch.tensor([ended])))


SITUATION = {"head_error": 0.02, "foot": 0.05, "action": (0.1, 0.2, 0.1, 0.2), "velocity": (1.0, -0.5, 1.0, -0.5)}


def test_paper_reward_by_hand(env_config):
    """Eq. 6-10 in SI: 1/(1 + 0.05^2) + 1/(1 + 0.02^2) - 20 x (4 x 10 W x 0.0166 s) - 20 x 2 x (10^2 + 20^2)."""
    expected = 1 / 1.0025 + 1 / 1.0004 - 20 * 40 * 0.0166 - 20 * 1000
    assert total(env_config("env=paper"), **SITUATION) == pytest.approx(expected, rel=1e-6)


def test_paper_fall_is_worth_minus_one(env_config):
    assert total(env_config("env=paper"), **SITUATION, ended=True) == -1.0


def test_authors_reward_by_hand(env_config):
    """4/(1 + 4 x 0.05^2) + 5/(1 + 5 x 0.02^2) + 2 - 20 x 0.04 - 20 x 0.1, all x 0.01."""
    expected = 0.01 * (4 / 1.01 + 5 / 1.002 + 2 - 20 * 0.04 - 20 * 0.1)
    assert total(env_config("env=authors_code"), **SITUATION) == pytest.approx(expected, rel=1e-5)
    assert total(env_config("env=authors_code"), **SITUATION, ended=True) == pytest.approx(expected, rel=1e-5)


def test_authors_reward_as_it_was_run_by_hand(env_config):
    """The head errors of four worlds like this one add up to 0.08 m, 5 / (1 + 5 x 0.08^2). The torques of hip, ankle and hip
    meet the velocities of ankle, hip and ankle, 0.1 x (0.1 x 0.5 + 0.2 x 1 + 0.1 x 0.5), and that of the other ankle meets a
    hip's moment, 0.2 x 0.01 x 30."""
    expected = 0.01 * (4 / 1.01 + 5 / 1.032 + 2 - 20 * (0.03 + 0.06) - 20 * 0.1)
    assert total(env_config("env=authors_code_as_run"), **SITUATION) == pytest.approx(expected, rel=1e-5)


def test_default_counts_each_millimetre_beyond_the_tolerance(env_config):
    """3 mm and 7 mm outside 25 mm differ by 4, apart from the closeness to the target, all x 0.03."""
    config = env_config("env.reward.target_weight=0")
    near, far = (total(config, **SITUATION | {"head_error": error}) for error in (-0.028, 0.032))
    assert near - far == pytest.approx(4 * 0.03, rel=1e-4)
    assert total(config, **SITUATION) == total(config, **SITUATION | {"head_error": 0.0249})


def test_default_early_end_is_worth_less_than_a_step_at_three_tenths_of_the_torque_limit(env_config):
    """With S = 2 at the end of the training, a step pays 2 - 20 sum a^2 and an early end -6: a step is better up to
    sum a^2 = 0.4, which is |a| = 0.316 on all four joints."""
    config, on_target = env_config(), {"head_error": 0.0, "foot": 0.0, "velocity": (0.0,) * 4}
    ended = total(config, **on_target, action=(0.0,) * 4, ended=True)
    assert ended == pytest.approx(0.03 * -6.0)
    assert total(config, **on_target, action=(0.31,) * 4) > ended > total(config, **on_target, action=(0.32,) * 4)


def test_energy_weight_scales_both_costs(env_config):
    base, doubled = (total(env_config(f"env.energy_weight={w}"), **SITUATION) for w in (20, 40))
    none = total(env_config("env.energy_weight=0"), **SITUATION)
    assert none - doubled == pytest.approx(2 * (none - base), rel=1e-5)
