"""The environment: what it senses, when an episode ends, what it returns, and that its worlds are each their own."""

import math
from fractions import Fraction

import pytest
import torch

from envs.task import terminations
from envs.task.head_tracking import HeadTrackingEnv
from envs.task.observations import TERMS


@pytest.fixture(params=["sagittal", "mujoco", "mujoco_c"])
def env_config(request, env_config):
    """A test with an environment is for all engines, unless it is marked `ONE_ENGINE`."""
    return lambda *overrides: env_config(f"env.physics={request.param}", *overrides)


ONE_ENGINE = pytest.mark.parametrize("env_config", ["sagittal"], indirect=True)
"""What a test looks at does not depend on the engine."""
ONE_AMPLITUDE = "env.ranges.amplitude=null"
"""A training on fast targets would draw amplitudes."""


def environment(env_config, *overrides, seed=1):
    return HeadTrackingEnv(env_config(*overrides), seed, "cpu")


def still(env):
    return torch.zeros(env.num_envs, 2)


def test_terminations_by_hand():
    assert terminations.fallen(torch.tensor([0.99, 1.0, 1.3]), 1.0).tolist() == [True, False, False]
    feet = torch.tensor([[0.0, 0.1], [0.09, 0.09]])
    assert terminations.foot_moved(feet, 0.1).tolist() == [True, False]
    assert terminations.head_off_target(torch.tensor([0.0, -0.025, 0.024]), 0.025).tolist() == [False, True, False]


def test_starts_standing_with_the_head_at_zero(env_config):
    env = environment(env_config)
    assert env.state.head_x.tolist() == pytest.approx([0.0] * 4, abs=1e-6)
    assert env.state.target_x.tolist() == [0.0] * 4
    assert env.state.head_vx.tolist() == [0.0] * 4
    assert env.state.foot_displacement.abs().max() == 0.0


def test_head_velocity_is_the_slope_of_its_position(env_config):
    loose = ("env.termination.head_tolerance=null", "env.termination.foot_motion=null")
    # A tenth of a second at a tenth of the usual step: the integrator itself is of first order.
    env = environment(env_config, *loose, "env.control_dt=0.0005")
    places, speeds = [], []
    for i in range(300):
        env.step(torch.tensor([[-0.3 * math.sin(i / 120), 0.2 * math.sin(i / 80)]] * 4))
        places.append(env.state.head_x.double())
        speeds.append(env.state.head_vx.double())
    places, speeds = torch.stack(places), torch.stack(speeds)
    slope = (places[2:] - places[:-2]) / (2 * env.config.control_dt)
    assert speeds.abs().max() > 0.2
    assert (slope - speeds[1:-1]).abs().max() < 0.01 * speeds.abs().max()


def test_one_command_moves_left_and_right_alike(env_config):
    env = environment(env_config, "env.termination.head_tolerance=null")
    for _ in range(10):
        env.step(torch.tensor([[0.1, -0.2]] * 4))
    assert torch.allclose(env.sim.joint_angle[:, :2], env.sim.joint_angle[:, 2:], atol=1e-5)
    assert env.state.action[0].tolist() == pytest.approx([0.1, -0.2, 0.1, -0.2])


def test_actions_are_clipped_to_the_torque_limit(env_config):
    wild, limit = (environment(env_config) for _ in range(2))
    wild.step(torch.tensor([[7.0, -3.0]] * 4))
    limit.step(torch.tensor([[1.0, -1.0]] * 4))
    assert torch.equal(wild.sim.joint_velocity, limit.sim.joint_velocity)
    assert wild.state.action.abs().max() == 1.0


def test_head_off_target_ends_the_episode_and_starts_a_new_one(env_config):
    """At 1.5 Hz a passive stander is 35 mm off after the time at which A (1 - cos) = 35 mm: 92 ms, the sixth step."""
    env = environment(env_config, "env.freq=1.5", ONE_AMPLITUDE)
    due = math.ceil(math.acos(1 - 0.35) / (2 * math.pi * 1.5) / env.config.control_dt)
    assert due == 6
    for step in range(1, due + 1):
        _, reward, done, extras = env.step(still(env))
        assert bool(done.all()) == (step == due)
    assert not bool(extras["time_outs"].any())
    assert reward.tolist() == pytest.approx([env.config.reward.scale * -6.0] * 4, rel=1e-3)
    assert env.episode_length_buf.tolist() == [0] * 4 and env.episodes.episode.tolist() == [1] * 4
    assert env.state.target_x.tolist() == [0.0] * 4 and env.state.action.abs().max() == 0.0


def test_a_fall_ends_the_episode_where_nothing_else_does(env_config):
    env = environment(env_config, "env=paper", "env.num_envs=4")
    for _ in range(300):
        _, reward, done, _ = env.step(torch.tensor([[-1.0, 1.0]] * 4))
        if bool(done.any()):
            break
        assert float(env.state.hat_pose[:, 2].min()) >= 1.0
    assert bool(done.all()) and reward.tolist() == [-1.0] * 4


def test_a_foot_that_moved_ends_the_episode(env_config):
    """Pushed to either side, the stander's feet slip on smooth ground, as far as is allowed before it has fallen."""
    loose = ("env.friction=0.05", "env.termination.head_tolerance=null", "env.freq=0.015")
    env, endless = environment(env_config, *loose), environment(env_config, *loose, "env.termination.foot_motion=null")
    push, limit = torch.tensor([800.0, -800.0, 0.0, 0.0]), env.config.termination.foot_motion
    for each in (env, endless):
        each.sim.push.copy_(push)
    for _ in range(30):
        _, reward, done, extras = env.step(still(env))
        _, _, fell, _ = endless.step(still(endless))
        moved = endless.state.foot_displacement.amax(-1) >= limit
        assert torch.equal(done, moved) and not fell.any()
        if moved.any():
            break
    assert moved.tolist() == [True, True, False, False] and not bool(extras["time_outs"].any())
    assert reward[:2].tolist() == pytest.approx([env.config.reward.scale * -6.0] * 2, rel=1e-3) and reward[2:].min() > 0
    assert env.state.foot_displacement.eq(0).all(-1).tolist() == [True, True, False, False]


def test_time_out_is_not_an_early_end(env_config):
    env = environment(env_config, "env.episode_steps=3", "env.freq=0.015")
    for step in range(1, 4):
        _, reward, done, extras = env.step(still(env))
        assert bool(done.all()) == bool(extras["time_outs"].all()) == (step == 3)
    assert float(reward.min()) > 0.0


def test_episodes_last_as_long_as_was_drawn(env_config):
    """Each world times out after its own drawn number of steps, the next episode after another."""
    env = environment(env_config, "env.episode_steps=[3,9]", "env.freq=0.015")
    ages, lengths = torch.zeros(4, dtype=torch.long), [[] for _ in range(4)]
    for _ in range(60):
        _, _, done, extras = env.step(still(env))
        ages += 1
        assert torch.equal(done, extras["time_outs"])
        for world in done.nonzero()[:, 0].tolist():
            lengths[world].append(int(ages[world]))
            ages[world] = 0
    drawn = [length for world in lengths for length in world]
    assert min(drawn) >= 3 and max(drawn) <= 9 and len(set(drawn)) > 3


@pytest.mark.parametrize(
    "target", ["env.freq=1.2", "env.freq=[0.6,1.2]", "env.ramp={start: 0.9, rate: -0.000007, duration: 90000}"]
)
def test_target_is_exact_at_any_time(env_config, target):
    """After 100, 10,000 and 100,000 s, against the phase in exact arithmetic: 0.03 um of 0.2 m, single precision."""
    loose = ("env.episode_steps=10000000", "env.termination.head_tolerance=null")
    env = environment(env_config, target, ONE_AMPLITUDE, *loose)
    ramp = env.config.ramp
    for step in (round(time / env.config.control_dt) for time in (100, 10_000, 100_000)):
        env.episode_length_buf.fill_(step - 1)
        env.step(still(env))
        now = step * Fraction(env.config.control_dt)
        for freq, x, vx in zip(
            env.episodes.freq.tolist(), env.state.target_x.tolist(), env.state.target_vx.tolist(), strict=True
        ):
            cycles, speed = Fraction(freq) * now, freq
            if ramp is not None:
                risen = min(now, Fraction(ramp.duration))
                cycles += Fraction(ramp.rate) * (risen * now - risen**2 / 2)
                speed += ramp.rate * float(risen)
            angle = 2 * math.pi * float(cycles % 1)
            assert x == pytest.approx(0.1 * (1 - math.cos(angle)), rel=0, abs=3e-8)
            assert vx == pytest.approx(0.2 * math.pi * speed * math.sin(angle), rel=0, abs=1e-7)


@ONE_ENGINE
def test_configured_frequencies_are_kept_in_double_precision(env_config):
    env = environment(env_config, "env.freq=0.6")
    assert env.episodes.freq.tolist() == [0.6] * 4
    env.follow(torch.tensor([0.1, 0.3, 0.7, 1.1], dtype=torch.float64))
    env.reset_all()
    assert env.episodes.freq.tolist() == [0.1, 0.3, 0.7, 1.1]


def test_observation_groups(env_config):
    groups = ",".join(f"{name}:[{name}]" for name in TERMS)
    env = environment(env_config, f"++env.observations={{{groups},policy:[{','.join(TERMS)}]}}")
    env.step(torch.tensor([[-0.1, 0.05]] * 4))
    groups = env.get_observations()
    assert {name: groups[name].shape for name in TERMS} == {name: (4, len(term.components)) for name, term in TERMS.items()}
    assert torch.equal(groups["policy"], torch.cat([groups[name] for name in TERMS], -1))
    assert torch.allclose(groups["hip_ankle_angle"], groups["joint_angle"][:, :2], atol=1e-6)
    assert torch.equal(groups["torso_motion"][:, 2], groups["torso_angular_velocity"][:, 1])
    assert torch.equal(groups["last_command"], torch.tensor([[-0.1, 0.05]] * 4))
    assert torch.allclose(groups["feet_place"], groups["foot_position"][:, [0, 2]], atol=1e-6)
    assert groups["target_error"][:, 0].tolist() == pytest.approx((env.state.target_x - env.state.head_x).tolist())
    assert groups["torso_height"][0, 0] == pytest.approx(1.286, abs=0.01)
    assert groups["torso_orientation"][0].tolist() == pytest.approx([0.0, 0.0, 1.0], abs=1e-3)


@ONE_ENGINE
def test_frequency_and_history_of_the_target(env_config):
    """0.03 x (1 - cos 2 pi t) of a 1 Hz target now, minus the same before 6, 12, ... 48 steps, and 0 before the start."""
    env = environment(
        env_config,
        "env.freq=1.0",
        "env.amplitude=0.03",
        ONE_AMPLITUDE,
        "env.reward.tolerance_weight=0",
        "env.observations.target_motion=[target_frequency,target_history]",
        "env.termination.head_tolerance=null",
    )

    def position(step):
        return 0.03 * (1 - math.cos(2 * math.pi * max(step, 0) * 0.0166))

    for step in range(1, 61):
        motion = env.step(still(env))[0]["target_motion"]
        if step in (1, 6, 20, 60):
            assert motion.shape == (4, 9) and motion[:, 0].tolist() == [1.0] * 4
            expected = [position(step) - position(step - back) for back in range(6, 49, 6)]
            assert motion[0, 1:].tolist() == pytest.approx(expected, abs=1e-7)
    assert env.reset_all()["target_motion"][:, 1:].eq(0).all()
    env.step(still(env))
    motion = env.step(still(env))[0]["target_motion"]
    assert motion[0, 1:].tolist() == pytest.approx([position(2)] * 8, abs=1e-7)


@ONE_ENGINE
def test_a_group_without_terms_is_empty(env_config):
    observations = environment(env_config, "env.observations.target_motion=[]").get_observations()
    assert observations["target_motion"].shape == (4, 0)


@ONE_ENGINE
def test_the_authors_observation_has_47_values(env_config):
    env = environment(env_config, "env=authors_code", "env.num_envs=4")
    assert sum(group.shape[1] for group in env.get_observations().values()) == 47
    assert len(env.config.observed["policy"]) == 47


def test_foot_wrench_by_hand(env_config):
    """Standing: each foot carries half the weight, and its moment about the foot frame is minus lever times force."""
    env = environment(env_config, "env.observations.policy=[foot_wrench]", "env.termination.head_tolerance=null")
    for _ in range(20):
        observation, *_ = env.step(still(env))
    wrench = observation["policy"][0].view(2, 6)
    force, place = env.sim.sole_force[0], env.sim.sole_position[0]
    assert wrench[:, 2].tolist() == pytest.approx([40.154 * 9.81 / 2] * 2, rel=0.01)
    about_y = [sum(float(-place[foot, end, 0] * force[foot, end, 2]) for end in (0, 1)) for foot in (0, 1)]
    assert wrench[:, 4].tolist() == pytest.approx(about_y, abs=0.3)  # the feet are flat, the friction small


def test_pitch_is_the_sum_of_joint_angles_on_flat_feet(env_config):
    """Foot, leg and HAT are a chain about parallel axes: torso pitch + hip + ankle = foot pitch, here about 0."""
    env = environment(env_config, "env.observations.policy=[torso_pitch]", "env.termination.head_tolerance=null")
    for _ in range(6):
        observation, *_ = env.step(torch.tensor([[-0.1, 0.05]] * 4))
    hip, ankle = env.sim.joint_angle[0, :2].tolist()
    assert abs(hip) > 0.005
    assert float(observation["policy"][0]) == pytest.approx(-(hip + ankle), abs=2e-3)


def test_world_of_many_equals_world_of_few(env_config):
    """World i moves and is reset alike whatever the number of worlds, given equal actions."""
    uniform = "env.freq_draw=uniform"
    many, few = environment(env_config, "env.num_envs=16", uniform), environment(env_config, "env.num_envs=4", uniform)
    generator = torch.Generator().manual_seed(0)
    for _ in range(40):
        actions = 0.3 * torch.randn(16, 2, generator=generator)
        seen, reward, done, _ = many.step(actions)
        seen_few, reward_few, done_few, _ = few.step(actions[:4])
        assert torch.equal(reward[:4], reward_few) and torch.equal(done[:4], done_few)
    assert int(few.episodes.episode.sum()) > 0
    for name in seen.keys():  # noqa: SIM118 - a TensorDict iterates over its rows
        assert torch.equal(seen[name][:4], seen_few[name]), name


def test_state_can_be_taken_and_put_back(env_config):
    history = "env.observations.target_motion=[target_history]"
    env, other = environment(env_config, history), environment(env_config, history, seed=1)
    generator = torch.Generator().manual_seed(0)
    actions = 0.2 * torch.randn(40, 4, 2, generator=generator)
    for action in actions[:20]:
        env.step(action)
    kept = env.state_dict()
    expected = [env.step(action)[:2] for action in actions[20:]]
    other.load_state_dict(kept)
    for action, (observation, reward) in zip(actions[20:], expected, strict=True):
        found = other.step(action)
        assert torch.equal(found[1], reward) and torch.equal(found[0]["target_motion"], observation["target_motion"])


def rewards_of_a_schedule(env_config, training_steps, resume=None):
    """Rewards of four steps in which the weight `alive`, all else being 0, goes from 8 to 2 over half of the training."""
    alone = ("env.reward.stay_weight=0", "env.reward.target_weight=0", "env.freq=0.015")
    config = env_config("env.reward.alive={start: 8.0, end: 2.0, until: 0.5}", *alone)
    env = HeadTrackingEnv(config, 1, "cpu", training_steps=training_steps)
    if resume is not None:
        env.load_state_dict(resume)
    return [float(env.step(still(env))[1][0]) / config.reward.scale for _ in range(4)], env.state_dict()


@ONE_ENGINE
def test_schedules_are_a_share_of_the_training(env_config):
    assert rewards_of_a_schedule(env_config, 4)[0] == pytest.approx([4.0, 2.0, 2.0, 2.0], abs=1e-3)
    assert rewards_of_a_schedule(env_config, 8)[0] == pytest.approx([8 * 4 ** (-k / 4) for k in (1, 2, 3, 4)], abs=1e-3)
    assert rewards_of_a_schedule(env_config, None)[0] == pytest.approx([2.0] * 4, abs=1e-3)


@ONE_ENGINE
def test_a_resumed_training_keeps_the_length_it_began_with(env_config):
    _, halfway = rewards_of_a_schedule(env_config, 16)
    continued, _ = rewards_of_a_schedule(env_config, 1000, resume=halfway)
    assert continued == pytest.approx([8 * 4 ** (-k / 8) for k in (5, 6, 7, 8)], abs=1e-3)


def test_warm_up_moves_nothing(env_config):
    env, cold = environment(env_config), environment(env_config)
    env.warm_up()
    action = torch.tensor([[0.1, -0.1]] * 4)
    for _ in range(5):
        assert torch.equal(env.step(action)[1], cold.step(action)[1])
