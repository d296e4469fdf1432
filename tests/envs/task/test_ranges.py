"""Bodies, targets and tolerances that are drawn for each episode."""

import re

import numpy as np
import pytest
import torch
from scipy.stats import qmc

from envs.config import RANGE_KEYS
from envs.engines.factory import simulate
from envs.engines.interface import SUBJECT
from envs.task import bodies
from envs.task.head_tracking import HeadTrackingEnv
from posture.config.errors import ConfigError

RANGES = {
    "hip_k": (25.0, 200.0),
    "ankle_k": (0.0, 75.0),
    "load": (0.0, 8.0),
    "amplitude": (0.04, 0.12),
    "joint_damping": (0.5, 2.0),
    "friction": (0.6, 1.2),
    "tolerance": (0.01, 0.03),
}
OVERRIDES = [f"env.{RANGE_KEYS[name]}=[{low},{high}]" for name, (low, high) in RANGES.items()]
BODY = "env.observations.policy=[body,head,hip_ankle_angle]"


@pytest.fixture(scope="module")
def varied(env_config):
    return env_config(*OVERRIDES, BODY, "env.num_envs=16", "env.episode_steps=[2,6]", "env.freq=[0.1,1.5]")


def drawn(env):
    """What each world has now, by name; (N,)."""
    own = {"freq": env.episodes.freq, "amplitude": env.episodes.amplitude, "tolerance": env.episodes.tolerance}
    return {name: values.clone() for name, values in (own | {name: getattr(env.sim, name) for name in SUBJECT}).items()}


def actions(steps, worlds=16):
    return 0.3 * torch.randn(steps, worlds, 2, generator=torch.Generator().manual_seed(0))


def test_a_range_is_short_for_its_key_in_ranges(env_config):
    config = env_config("env.hip_k=[25,200]", "env.reward.tolerance=[0.01,0.03]")
    assert config.ranges.given == {"hip_k": (25.0, 200.0), "tolerance": (0.01, 0.03)}
    assert (config.hip_k, config.reward.tolerance) == (112.5, 0.02)
    assert env_config("env.ranges.hip_k=[25,200]").hip_k == 125.0


def test_every_episode_draws_within_the_ranges(varied):
    env = HeadTrackingEnv(varied, 1, "cpu")
    seen = []
    for action in actions(100):
        env.step(action)
        seen.append(drawn(env))
    for name, (low, high) in (RANGES | {"freq": (0.1, 1.5)}).items():
        values = torch.stack([each[name] for each in seen]).double()
        assert low <= values.min() + 1e-6 and values.max() - 1e-6 <= high
        assert values.min() < low + 0.2 * (high - low) and values.max() > high - 0.2 * (high - low)
        assert all(len(values[:, world].unique()) > 3 for world in range(16)), name
    # World i of 16 draws from the i-th sixteenth of the feasible frequencies.
    freq = torch.stack([each["freq"] for each in seen])
    width = 1.4 / 16
    assert ((freq - 0.1) / width).floor().clamp(0, 15).eq(torch.arange(16)).float().mean() > 0.99


def test_draws_are_independent_of_the_number_of_processes(varied):
    whole = HeadTrackingEnv(varied, 1, "cpu")
    halves = [HeadTrackingEnv(varied, 1, "cpu", (part, 2)) for part in range(2)]
    for _ in range(20):
        ends = torch.rand(16) < 0.5
        whole._reset(ends)
        for part, half in enumerate(halves):
            half._reset(ends[part::2])
            for name, values in drawn(half).items():
                assert torch.equal(values, drawn(whole)[name][part::2])
    other = HeadTrackingEnv(varied, 2, "cpu")
    assert not torch.equal(drawn(other)["hip_k"], drawn(HeadTrackingEnv(varied, 1, "cpu"))["hip_k"])


def test_the_table_fills_the_ranges_more_evenly_than_independent_draws(varied):
    assert bodies.table(varied, 1)[0].shape == (16_384, 8)
    rows, _, share = bodies.table(varied, 1, count=1024)
    assert share == 0.0
    unit = (rows - rows.min(0)) / np.ptp(rows, axis=0)
    independent = [qmc.discrepancy(np.random.default_rng(seed).random(unit.shape)) for seed in range(5)]
    assert qmc.discrepancy(unit) < 0.5 * min(independent)


def test_a_logarithmic_range_has_as_many_draws_in_each_octave(env_config):
    config = env_config("env.hip_k=[25,200]", "env.load=[0,8]", "env.freq=[0.1,1.5]", "env.log_ranges=[hip_k]")
    rows = dict(zip(bodies.COLUMNS, bodies.table(config, 1, count=1024)[0].T, strict=True))
    octaves = np.histogram(rows["hip_k"], [25, 50, 100, 200.001])[0]
    assert (np.abs(octaves - 1024 / 3) < 4).all()
    assert abs(rows["load"].mean() - 4.0) < 0.02


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["env.log_ranges=[hip_k]"], "log_ranges: hip_k has no range; allowed are none"),
        (["env.log_ranges=[knee_k]", "env.load=[0,8]"], "log_ranges: knee_k has no range; allowed are load"),
        (["env.log_ranges=[load]", "env.load=[0,8]"], "log_ranges: load has a range from 0, which has no logarithm"),
        (["env.log_ranges=[hip_k,hip_k]", "env.hip_k=[25,200]"], "log_ranges: hip_k appears 2 times"),
    ],
)
def test_only_a_positive_range_can_be_logarithmic(env_config, overrides, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        env_config(*overrides)


def test_a_key_without_a_range_keeps_its_value(env_config):
    config = env_config("env.hip_k=[25,200]", "env.load=3", "env.freq=0.5")
    env = HeadTrackingEnv(config, 1, "cpu")
    found = drawn(env)
    assert len(found["hip_k"].unique()) == 4
    expected = {"freq": 0.5, "load": 3.0, "ankle_k": 25.0, "amplitude": 0.1, "friction": 1.0, "joint_damping": 1.0}
    for name, value in expected.items():
        assert (found[name] == value).all()


@pytest.mark.parametrize("physics", ["sagittal", "mujoco", "mujoco_c"])
def test_the_physics_is_that_of_the_drawn_bodies(env_config, physics):
    """Each world moves as an engine that was built for its body alone. Inverse weights of loads are interpolated, and MuJoCo
    C has them in double precision."""
    config = env_config(*OVERRIDES, f"env.physics={physics}", "env.episode_steps=100", "env.freq=0.5")
    env = HeadTrackingEnv(config, 1, "cpu")
    env.reset_all()
    found = drawn(env)
    torques = 20 * torch.randn(15, 4, 4, generator=torch.Generator().manual_seed(0))
    torques[..., 2:] = torques[..., :2]
    for torque in torques:
        env.sim.step(torque)
    for world in range(3):
        own = {name: float(found[name][world]) for name in SUBJECT}
        sim = simulate(config.model_copy(update=own), 1, "cpu")
        for torque in torques:
            sim.step(torque[world : world + 1])
        torch.testing.assert_close(env.sim.joint_angle[world], sim.joint_angle[0], rtol=1e-3, atol=2e-5)
        torch.testing.assert_close(env.sim.sole_force[world], sim.sole_force[0], rtol=1e-2, atol=2.0)
    assert (env.sim.joint_angle[0] - env.sim.joint_angle[1]).abs().max() > 1e-3


def test_the_body_is_observed(varied):
    env = HeadTrackingEnv(varied, 1, "cpu")
    names = ("hip_k", "ankle_k", "load", "joint_damping", "friction", "amplitude", "tolerance")
    for action in actions(10):
        observed = env.step(action)[0]["policy"]
        for column, name in enumerate(names):
            torch.testing.assert_close(observed[:, column], drawn(env)[name].float(), rtol=0, atol=0)


def test_reward_and_target_are_of_the_drawn_values(env_config):
    """The target's path and the cost outside the tolerance, by hand."""
    keys = [
        "env.amplitude=[0.04,0.12]",
        "env.reward.tolerance=[0.01,0.03]",
        "env.freq=0.5",
        "env.episode_steps=200",
        "env.termination.head_tolerance=null",
    ]
    env = HeadTrackingEnv(env_config(*keys), 1, "cpu")
    amplitude, tolerance = env.episodes.amplitude.clone(), env.episodes.tolerance.clone()
    for _ in range(20):
        state = env.state_dict()
        reward = env.step(torch.zeros(4, 2))[1]
    time = env.config.control_dt * 20
    expected = amplitude * (1 - np.cos(2 * np.pi * 0.5 * time))
    torch.testing.assert_close(env.state.target_x, expected.float())
    distance = (env.state.target_x - env.state.head_x).abs()
    env.load_state_dict(state)
    env.episodes.tolerance.fill_(1.0)
    free = env.step(torch.zeros(4, 2))[1]
    lost = env.config.reward.scale * env.config.reward.tolerance_weight * (distance - tolerance).clamp(min=0)
    torch.testing.assert_close(free - reward, lost, rtol=1e-4, atol=1e-5)
    assert (lost > 0).any()


def test_a_saved_state_continues_exactly(varied):
    env, other = HeadTrackingEnv(varied, 1, "cpu"), HeadTrackingEnv(varied, 1, "cpu")
    for action in actions(20):
        env.step(action)
    other.load_state_dict(env.state_dict())
    for action in actions(40):
        expected, found = env.step(action), other.step(action)
        assert torch.equal(expected[0]["policy"], found[0]["policy"]) and torch.equal(expected[1], found[1])
    assert all(torch.equal(values, drawn(other)[name]) for name, values in drawn(env).items())


def test_what_is_not_feasible_is_not_drawn(varied):
    def soft(config, rows):
        return np.where(rows[:, bodies.COLUMNS.index("hip_k")] < 60.0, 0.01, np.nan)

    env = HeadTrackingEnv(varied, 1, "cpu", least_costs=soft)
    assert env.infeasible_share == pytest.approx(0.8, abs=0.01)
    for action in actions(50):
        env.step(action)
        assert env.sim.hip_k.max() < 60.0
    with pytest.raises(ValueError, match=r"env\.ranges: the limits of torque and foot allow hardly any"):
        HeadTrackingEnv(varied, 1, "cpu", least_costs=lambda config, rows: np.full(len(rows), np.nan))


@pytest.mark.parametrize(("exponent", "most", "factor"), [(0.0, 20, 1), (0.5, 20, 2), (1.0, 20, 4), (1.0, 3, 3)])
def test_effort_counts_relative_to_the_least_cost(env_config, exponent, most, factor):
    """A body of a quarter of the reference's cost, by hand: effort counts 4 ** exponent times, or `most`."""
    keys = [
        "env.hip_k=[25,200]",
        f"env.reward.effort_exponent={exponent}",
        "env.freq=0.5",
        "env.reward.effort_reference=0.04",
        f"env.reward.effort_scale_max={most}",
    ]
    env = HeadTrackingEnv(env_config(*keys), 1, "cpu", least_costs=lambda config, rows: np.full(len(rows), 0.01))
    plain = HeadTrackingEnv(env_config(*keys), 1, "cpu")
    idle = HeadTrackingEnv(env_config(*keys, "env.energy_weight=0"), 1, "cpu")
    action = torch.full((4, 2), 0.1)
    with_scale, without, free = (each.step(action)[1] for each in (env, plain, idle))
    torch.testing.assert_close(with_scale - free, factor * (without - free), rtol=1e-3, atol=1e-6)
    assert (without < free).all()


def test_ranges_beside_a_ramp_are_feasible_at_its_highest_frequency(env_config):
    config = env_config("env.hip_k=[25,200]", "env.ramp={start:0.1,rate:0.1,duration:5}")
    assert set(bodies.table(config, 1, count=8)[0][:, 0]) == {0.6}
    env = HeadTrackingEnv(config, 1, "cpu", least_costs=lambda config, rows: np.full(len(rows), 0.01))
    assert (env.episodes.freq == 0.1).all() and len(env.sim.hip_k.unique()) == 4
