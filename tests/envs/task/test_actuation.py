"""From command to torque: the step response of a first-order lag, and noise in proportion to the torque."""

import math

import pytest
import torch

from envs.task.head_tracking import HeadTrackingEnv

LOOSE = ("env.termination={head_tolerance: null, foot_motion: null}", "env.episode_steps=10000", "env.freq=0.7")
STEP = 0.0166


def environment(env_config, *overrides):
    return HeadTrackingEnv(env_config(*LOOSE, *overrides), 1, "cpu")


def test_torque_follows_a_constant_command_exponentially(env_config):
    env = environment(env_config, "env.actuation.time_constant=0.05")
    command = torch.tensor([[0.02, -0.01]] * 4)
    for step in range(1, 8):
        observed = env.step(command)[0]["policy"]
        reached = 1 - math.exp(-step * STEP / 0.05)
        assert env.state.action[0].tolist() == pytest.approx([0.02 * reached, -0.01 * reached] * 2, rel=1e-5)
        # The policy knows what it commanded.
        assert env.state.command[0].tolist() == pytest.approx([0.02, -0.01] * 2)
        assert any(observed[0, i : i + 2].tolist() == pytest.approx([0.02, -0.01]) for i in range(observed.shape[1] - 1))


def test_without_a_lag_the_torque_is_the_command(env_config):
    plain, lag = environment(env_config), environment(env_config, "env.actuation={time_constant: 0, noise: 1e-9}")
    for step in range(10):
        command = torch.tensor([[0.1 * math.sin(step), -0.2]] * 4)
        plain.step(command)
        lag.step(command)
        assert torch.allclose(plain.state.action, lag.state.action, atol=1e-6)
    assert torch.equal(plain.state.action, plain.state.command)


def test_noise_is_a_share_of_the_torque(env_config):
    env = environment(env_config, "env.actuation.noise=0.1", "env.num_envs=2000")
    found = []
    for _ in range(4):
        env.reset_all()
        env.step(torch.tensor([[0.5, -0.1]] * 2000))
        found.append(env.state.action)
    ratio = torch.stack(found) / torch.tensor([0.5, -0.1, 0.5, -0.1])
    # 8000 samples of each kind: 0.8 % for the deviation.
    assert ratio[..., 0].std().item() == pytest.approx(0.1, rel=0.05)
    assert ratio[..., 1].std().item() == pytest.approx(0.1, rel=0.05)
    assert ratio.mean().item() == pytest.approx(1.0, abs=0.005)
    assert torch.equal(ratio[..., :2], ratio[..., 2:])  # left and right have one command, and stay in the plane
    assert abs(torch.corrcoef(ratio[..., :2].reshape(-1, 2).T)[0, 1].item()) < 0.05


def test_torque_stays_within_its_limit(env_config):
    env = environment(env_config, "env.actuation.noise=1")
    for _ in range(5):
        env.step(torch.ones(4, 2))
        assert env.state.action.abs().max() <= 1.0


def test_a_command_that_is_nan_ends_the_episode_and_leaves_no_trace(env_config):
    env = environment(env_config, "env.actuation={time_constant: 0.05, noise: 0.1}")
    command = torch.zeros(4, 2)
    command[1] = torch.nan
    _, reward, done, _ = env.step(command)
    assert done.tolist() == [False, True, False, False] and reward.isfinite().all()
    groups, _, done, _ = env.step(torch.zeros(4, 2))
    assert not done.any() and env.state.action.isfinite().all() and groups["policy"].isfinite().all()
