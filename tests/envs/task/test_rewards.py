"""Reward terms, their sum and their schedules against hand arithmetic."""

import math

import pytest
import torch

from envs.config import Schedule
from envs.task import rewards
from envs.task.head_tracking import HeadTrackingEnv


def t(*values):
    return torch.tensor(values, dtype=torch.float32)


def test_closeness_by_hand():
    # 1 / (1 + 5 x 0.2^2) = 1 / 1.2
    assert rewards.closeness(t(0.0, 0.2), 5.0).tolist() == pytest.approx([1.0, 1 / 1.2])


def test_energy_in_joules_by_hand():
    # |10 x 2| + |-5 x 4| = 40 W for 0.0166 s
    assert rewards.energy_joule(t(10.0, -5.0)[None], t(2.0, 4.0)[None], 0.0166).tolist() == pytest.approx([-0.664])


def test_energy_of_the_authors_code_by_hand():
    # |0.1 x 0.1 x 2| + |-0.05 x 0.1 x 4| = 0.02 + 0.02
    assert rewards.energy_scaled(t(0.1, -0.05)[None], t(2.0, 4.0)[None]).tolist() == pytest.approx([-0.04])


def test_each_reading_of_the_energy_by_hand():
    # 40 W as above, of torques up to 100 Nm, for 0.0166 s
    torque, velocity = t(10.0, -5.0)[None], t(2.0, 4.0)[None]
    readings = {"joule": -0.664, "normalised": -0.00664, "authors_code": -0.04}
    for unit, expected in readings.items():
        assert rewards.energy(torque, velocity, unit, 100.0, 0.0166).tolist() == pytest.approx([expected])


def test_one_reading_of_the_energy_is_16_6_times_the_other():
    """100 Nm x 0.0166 s against 0.1: what the reference says of Eq. 9 beside a normalised Eq. 10 (there the other way round:
    in joules it is divided by 100^2 with the torques, 1e-4 x 1.66 / 0.1)."""
    action, velocity = torch.rand(5, 4), torch.randn(5, 4)
    joule = rewards.energy_joule(100 * action, velocity, 0.0166)
    assert (joule / rewards.energy_scaled(action, velocity)).tolist() == pytest.approx([16.6] * 5, rel=1e-5)


def test_torque_by_hand():
    assert rewards.torque_squared(t(3.0, -4.0)[None]).tolist() == [-25.0]


def test_joint_limit_by_hand():
    # Half of the last 2 % of one joint, all of it of another.
    assert rewards.joint_limit(t(0.5, 0.99, -1.0, 0.98)[None]).tolist() == pytest.approx([1.5], abs=1e-4)


@pytest.mark.parametrize("steps, expected", [(0, 11.0), (50, math.sqrt(44.0)), (100, 4.0), (1000, 4.0)])
def test_a_schedule_is_geometric_and_then_holds(steps, expected):
    assert rewards.weight(Schedule(start=11.0, end=4.0, steps=100), steps) == pytest.approx(expected)
    assert rewards.weight(7.0, steps) == 7.0


def joined(config, head_error, foot, action, velocity, ended=False):
    """The environment's reward of one world in a given situation, without stepping it."""
    env = HeadTrackingEnv.__new__(HeadTrackingEnv)
    env.config, env.steps = config, 0
    env.target_x, env.head_x = t(head_error), t(0.0)
    env.foot_displacement = t(foot, foot)[None]
    env.action = t(*action)[None]
    env.sim = type("Sim", (), {"joint_velocity": t(*velocity)[None], "joint_angle": torch.zeros(1, 4)})()
    env._limit_centre, env._limit_half = torch.zeros(4), torch.ones(4)
    return float(env._reward(torch.tensor([ended])))


SITUATION = {"head_error": 0.02, "foot": 0.05, "action": (0.1, 0.2, 0.1, 0.2), "velocity": (1.0, -0.5, 1.0, -0.5)}


def test_paper_reward_by_hand(env_config):
    """Eq. 6-10 in SI: 1/(1 + 0.05^2) + 1/(1 + 0.02^2) - 20 x (4 x 10 W x 0.0166 s) - 20 x 2 x (10^2 + 20^2)."""
    expected = 1 / 1.0025 + 1 / 1.0004 - 20 * 40 * 0.0166 - 20 * 1000
    assert joined(env_config("env=paper"), **SITUATION) == pytest.approx(expected, rel=1e-6)


def test_paper_fall_is_worth_minus_one(env_config):
    assert joined(env_config("env=paper"), **SITUATION, ended=True) == -1.0


def test_authors_reward_by_hand(env_config):
    """4/(1 + 4 x 0.05^2) + 5/(1 + 5 x 0.02^2) + 2 - 20 x 0.04 - 20 x 0.1, all x 0.01."""
    expected = 0.01 * (4 / 1.01 + 5 / 1.002 + 2 - 20 * 0.04 - 20 * 0.1)
    assert joined(env_config("env=authors_code"), **SITUATION) == pytest.approx(expected, rel=1e-5)
    assert joined(env_config("env=authors_code"), **SITUATION, ended=True) == pytest.approx(expected, rel=1e-5)


def test_default_early_end_is_worth_less_than_a_step_at_two_fifths_of_the_torque_limit(env_config):
    """With S = 3 at the end of the schedule, living pays 3 - 20 sum a^2 and ending -9: worth it up to sum a^2 = 0.6, which
    is |a| = 0.387 on all four joints."""
    config = env_config()
    late = {
        name: getattr(config.reward, name).end if isinstance(getattr(config.reward, name), Schedule) else None
        for name in ("stay_weight", "target_weight", "ended")
    }
    final = config.model_copy(update={"reward": config.reward.model_copy(update=late)})
    on_target = {"head_error": 0.0, "foot": 0.0, "velocity": (0.0,) * 4}
    ended = joined(final, **on_target, action=(0.0,) * 4, ended=True)
    assert ended == pytest.approx(0.03 * -9.0)
    assert joined(final, **on_target, action=(0.38,) * 4) > ended > joined(final, **on_target, action=(0.39,) * 4)


def test_energy_weight_scales_both_costs(env_config):
    base, doubled = (joined(env_config(f"env.energy_weight={w}"), **SITUATION) for w in (20, 40))
    none = joined(env_config("env.energy_weight=0"), **SITUATION)
    assert none - doubled == pytest.approx(2 * (none - base), rel=1e-5)
