"""Senses: delay, history and noise of observations. True values are read from an environment that senses exactly."""

import math

import pytest
import torch

from envs.task.head_tracking import HeadTrackingEnv

LOOSE = ("env.termination.head_tolerance=null", "env.episode_steps=10000", "env.freq=0.7")
TERMS = "[head, target, last_command]"
OBSERVED = (f"env.observations.policy={TERMS}", f"+env.observations.truth={TERMS}", "env.observations.target_motion=[]")
STEP = 0.0166


def environment(env_config, *overrides, seed=1, part=(0, 1)):
    return HeadTrackingEnv(env_config(*LOOSE, *OBSERVED, "env.sensing.exact=[truth]", *overrides), seed, "cpu", part)


def commands(step, worlds=4):
    return torch.tensor([[0.1 * math.sin(0.3 * step), -0.05 * math.cos(0.2 * step)]] * worlds)


def observations(env, steps):
    """What the policy observed and what was true, from the start on: (steps + 1, N, size) each."""
    found = [env.reset_all(), *(env.step(commands(step, env.num_envs))[0] for step in range(steps))]
    return torch.stack([one["policy"] for one in found]), torch.stack([one["truth"] for one in found])


def test_a_delay_shifts_what_is_sensed_and_not_the_own_commands(env_config):
    sensed, truth = observations(environment(env_config, f"env.sensing.delay={5 * STEP}"), 40)
    assert torch.equal(sensed[5:, :, :3], truth[:-5, :, :3])
    assert torch.equal(sensed[:, :, 3:], truth[:, :, 3:])
    # Until the delay has passed, it senses how it stood.
    assert torch.equal(sensed[:5, :, :3], truth[:1, :, :3].expand(5, -1, -1))
    assert truth[10:, :, 0].abs().min() > 0


def test_history_gives_earlier_moments_beside_the_newest(env_config):
    overrides = (f"env.sensing.delay={2 * STEP}", "env.sensing.history=2", "env.sensing.history_step=3")
    sensed, truth = observations(environment(env_config, *overrides), 40)
    assert sensed.shape[-1] == 3 * truth.shape[-1]
    for moment, part in enumerate(sensed.split(5, dim=-1)):
        late = 3 * moment
        assert torch.equal(part[late + 2 :, :, :3], truth[: 41 - late - 2, :, :3])
        assert torch.equal(part[late:, :, 3:], truth[: 41 - late, :, 3:])


def test_names_of_what_is_observed(env_config):
    config = env_config(*OBSERVED, "env.sensing.history=1", "env.sensing.history_step=4", "env.sensing.exact=[truth]")
    newest = [("head_x", "m"), ("head_vx", "m/s"), ("target_x", "m"), ("hip_last_action", "1"), ("ankle_last_action", "1")]
    assert config.observed["policy"] == newest + [(f"{name}_4_steps_before", unit) for name, unit in newest]
    assert config.observed["truth"] == newest


def test_white_noise_has_its_deviation_and_no_memory(env_config):
    noise = "+env.sensing.noise={head: {white: [0.002, 0.03], drift: 0}}"
    sensed, truth = observations(environment(env_config, noise, "env.num_envs=64"), 400)
    error = (sensed - truth)[..., :3]
    assert error[..., 2].abs().max() == 0
    # 25,664 samples: their standard deviation is known to 0.5 %, a correlation to 0.006.
    assert error[..., 0].std().item() == pytest.approx(0.002, rel=0.02)
    assert error[..., 1].std().item() == pytest.approx(0.03, rel=0.02)
    assert error[..., 0].mean().item() == pytest.approx(0.0, abs=0.002 / 40)
    for one, other in (
        (error[1:, :, 0], error[:-1, :, 0]),
        (error[:, 1:, 0], error[:, :-1, 0]),
        (error[..., 0], error[..., 1]),
    ):
        assert abs(torch.corrcoef(torch.stack((one.flatten(), other.flatten())))[0, 1].item()) < 0.03


def test_a_drift_has_its_deviation_from_the_start_on_and_its_correlation_time(env_config):
    noise = ("+env.sensing.noise={head: {white: 0, drift: 0.004}}", f"env.sensing.drift_time={20 * STEP}")
    sensed, truth = observations(environment(env_config, *noise, "env.num_envs=512"), 200)
    error = (sensed - truth)[..., 0].double()
    # 512 independent worlds: 3 % for the deviation at one time.
    for step in (0, 1, 20, 200):
        assert error[step].std().item() == pytest.approx(0.004, rel=0.12), step
    for lag in (1, 20, 40):
        ratio = (error[lag:] * error[:-lag]).mean() / (error**2).mean()
        assert ratio.item() == pytest.approx(math.exp(-lag / 20), abs=0.05), lag


def test_noise_differs_between_worlds_episodes_and_seeds_and_is_repeated(env_config):
    noise = "+env.sensing.noise={head: {white: 0.002, drift: 0.002}}"

    def errors(seed):
        env = environment(env_config, noise, seed=seed)
        return [(sensed - truth)[..., 0] for sensed, truth in (observations(env, 3), observations(env, 3))]

    first, second = errors(1)
    again = errors(1)
    assert torch.equal(first, again[0]) and torch.equal(second, again[1])
    different = [*first.T, *second.T, *errors(2)[0].T]
    assert len({tuple(one.tolist()) for one in different}) == len(different)


def test_parts_of_an_environment_sense_as_the_whole(env_config):
    noise = ("+env.sensing.noise={head: {white: 0.002, drift: 0.002}}", "env.sensing.delay=0.05", "env.actuation.noise=0.1")
    whole, _ = observations(environment(env_config, *noise), 10)
    parts = [observations(environment(env_config, *noise, part=(i, 2)), 10)[0] for i in range(2)]
    assert torch.equal(whole[:, 0::2], parts[0]) and torch.equal(whole[:, 1::2], parts[1])


def test_a_restored_state_continues_exactly(env_config):
    noise = "+env.sensing.noise={head: {white: 0.002, drift: 0.002}}"
    overrides = (noise, "env.sensing.delay=0.05", "env.actuation={time_constant: 0.05, noise: 0.1}")
    env = environment(env_config, *overrides)
    observations(env, 10)
    state = env.state_dict()
    after = [env.step(commands(step))[0]["policy"] for step in range(10)]
    other = environment(env_config, *overrides, seed=1)
    other.load_state_dict(state)
    assert torch.equal(other.get_observations()["policy"], env_at(env, state))
    assert all(torch.equal(other.step(commands(step))[0]["policy"], one) for step, one in enumerate(after))


def env_at(env, state):
    """What `env` observes in `state`."""
    env.load_state_dict(state)
    return env.get_observations()["policy"]


def test_observing_twice_changes_nothing(env_config):
    env = environment(env_config, "+env.sensing.noise={head: {white: 0.002, drift: 0.002}}")
    first = env.step(commands(0))[0]["policy"]
    assert torch.equal(env.get_observations()["policy"], first)
    env.step(commands(1))
    assert not torch.equal(env.get_observations()["policy"], first)  # and what was returned stays as it was


def test_a_new_episode_remembers_nothing(env_config):
    env = environment(env_config, f"env.sensing.delay={5 * STEP}", "env.episode_steps=20")
    for step in range(20):
        groups, _, done, _ = env.step(commands(step))
    assert done.all()
    assert torch.equal(groups["policy"], groups["truth"])
    assert torch.equal(groups["policy"][:, 3:], torch.zeros(4, 2))


def test_senses_without_delay_noise_and_history_are_exact(env_config):
    """The physics is the same, bit for bit, whatever is sensed."""
    exact, human = (environment(env_config, *overrides) for overrides in ((), ("env.sensing.delay=0.1",)))
    assert exact.config.sensing.is_exact and not human.config.sensing.is_exact
    assert torch.equal(observations(exact, 30)[1], observations(human, 30)[1])


@pytest.mark.parametrize(
    ("override", "message"),
    [
        (
            "+env.sensing.noise={heads: {white: 0, drift: 0}}",
            "noise: unknown heads; allowed are head, last_command, target",
        ),
        (
            "+env.sensing.noise={head: {white: [1, 2, 3], drift: 0}}",
            "head.white: 3 numbers for 2 values: head_x .m., head_vx",
        ),
        ("+env.sensing.noise={head: {white: -1, drift: 0}}", "noise.head.white"),
        ("env.sensing.exact=[missing]", "sensing.exact: no group of observations is called missing; allowed are policy"),
        ("env.sensing.delay=3", "sensing.delay"),
        ("env.sensing.delay=1", "1 s is as long as an episode of 50 control steps"),
    ],
)
def test_bad_input_is_refused_in_one_line(env_config, override, message):
    with pytest.raises(Exception, match=message):
        environment(env_config, override, *(["env.episode_steps=50"] if "delay=1" in override else []))
