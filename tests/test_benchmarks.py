"""The benchmarks' Gymnasium environment against our own: the same task, or its speed would say nothing."""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from envs.task.head_tracking import HeadTrackingEnv

pytest.importorskip("gymnasium")
BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))  # its files are scripts, which find one another so
import engines  # noqa: E402
import gym_stander  # noqa: E402

ALL_TERMS = f"env.observations={{policy:[{','.join(gym_stander.TERMS)}]}}"
NEVER_OFF = ("env.termination.head_tolerance=null", "env.termination.foot_motion=null")


def both(env_config, *overrides):
    """Our environment with four worlds, and for each of them Gymnasium's, with its target."""
    config = env_config("env.physics=mujoco", *overrides)
    ours = HeadTrackingEnv(config, 1, "cpu")
    theirs = [gym_stander.StanderEnv(config.model_copy(update={"freq": freq})) for freq in ours.freq.tolist()]
    return ours, theirs


@pytest.mark.parametrize(
    ("noise", "overrides"),
    [(0.15, ("env.freq_draw=uniform",)), (0.05, (ALL_TERMS, *NEVER_OFF, "env.load=2", "env.friction=0.8"))],
    ids=["off target", "falls"],
)
def test_agrees_with_our_environment(env_config, noise, overrides):
    """Equal actions for 100 steps give equal episodes, rewards and observations, up to what single precision leaves.

    MuJoCo Warp computes in single precision, MuJoCo's C engine in double. Of joint velocities of up to 6 rad/s some 1e-4 are
    measured to remain, of all else less; of the reward, which has velocities in it times a hundredth, 3e-6. While a body
    falls, rounding may once in a while decide whether a heel touches, after which the two part: not with these actions.
    """
    ours, theirs = both(env_config, *overrides)
    generator = torch.Generator().manual_seed(0)
    episodes = 0
    for _ in range(100):
        actions = noise * torch.randn(4, 2, generator=generator) + torch.tensor([0.0, 0.05])
        groups, reward, done, _ = ours.step(actions)
        seen = torch.cat([groups[name] for name in ours.config.observations], -1).numpy()
        for world, env in enumerate(theirs):
            observed, gain, ended, timed_out, _ = env.step(actions[world].numpy())
            assert (ended, timed_out) == (bool(done[world]), False)
            assert gain == pytest.approx(float(reward[world]), abs=1e-5)
            if ended:
                episodes += 1
                env.config = env.config.model_copy(update={"freq": float(ours.freq[world])})
                observed, _ = env.reset()
            assert observed == pytest.approx(seen[world], abs=3e-4)
    assert episodes >= 4


def test_time_out_and_schedule(env_config):
    config = env_config("env.episode_steps=3", "env.freq=0.015", "env.reward.stay_weight={start: 5.0, end: 1.0, until: 0.5}")
    env = gym_stander.StanderEnv(config, training_steps=20)
    still = np.zeros(2)
    gains = []
    for step in range(1, 7):
        _, gain, ended, timed_out, _ = env.step(still)
        assert (ended, timed_out) == (False, step % 3 == 0)
        gains.append(gain)
        if timed_out:
            env.reset()
    assert gains[3] < gains[0]  # the value of staying falls on over the episodes


def test_a_pool_is_its_worlds(env_config):
    """Worlds in two processes move like single ones, and each draws its targets from its own part of the range."""
    config = env_config("env.freq=[0.3,1.2]", "env.freq_draw=stratified")
    pool = gym_stander.Pool(config, 3, 2, seed=5)
    alone = [gym_stander.StanderEnv(part) for part in gym_stander.shares(config, 3)]
    first = np.stack([env.reset(seed=5 + world)[0] for world, env in enumerate(alone)])
    assert np.array_equal(pool.observation, first)
    low, high = config.freq
    for world, env in enumerate(alone):
        assert low + world * (high - low) / 3 <= env.freq <= low + (world + 1) * (high - low) / 3
    rng = np.random.default_rng(0)
    finished = 0
    for _ in range(60):
        actions = 0.3 * rng.standard_normal((3, 2))
        seen, gains, ended, timed_out, last = pool.step(actions)
        for world, env in enumerate(alone):
            observed, gain, over, _, _ = env.step(actions[world])
            assert (gain, over) == (gains[world], ended[world])
            if over:
                finished += 1
                assert np.array_equal(last[world], observed)
                observed, _ = env.reset()
            assert np.array_equal(seen[world], observed)
    pool.close()
    assert finished > 3 and not timed_out.any()


def test_unsupported_observations_are_refused(env_config):
    with pytest.raises(ValueError, match="env.observations: foot_wrench not supported here"):
        gym_stander.StanderEnv(env_config("env.observations={policy:[head,foot_wrench]}"))


def row(worlds, rate, memory):
    about = {"engine": "mujoco", "worlds": worlds, "threads": 1, "device": "-", "cores": 1, "contacts_dropped": False}
    return about | {"env_steps_per_s": rate, "physics_steps_per_s": None, "bytes": memory}


def test_rows_by_hand():
    """The median of three repeats, and memory a world by the growth over the fewest worlds, where it is more than noise."""
    assert engines.median([row(1, rate, 5) for rate in (30.0, 10.0, 20.4)])["env_steps_per_s"] == 20
    assert engines.median([row(1, 1.0, 5)])["physics_steps_per_s"] is None
    rows = engines.summary([row(1, 10, 50_000_000), row(11, 90, 50_000_100), row(1001, 900, 150_000_000)])
    assert [each["bytes_per_world"] for each in rows] == [None, None, 100_000]
    assert "(1.00x)" in engines.table(rows)


@pytest.mark.slow
def test_the_commands_write_their_files(tmp_path):
    pytest.importorskip("stable_baselines3")
    few = ["--worlds", "4", "env.physics=mujoco", "agent.algorithm.num_mini_batches=1", "evaluation.duration=12"]
    for script, arguments, files in (
        ("engines.py", ["--worlds", "1", "2", "--seconds", "0.05", "--repeats", "1", "--csv", "one"], ["one"]),
        ("learners.py", ["--budget", "2", "--every", "1", "--csv", "one", "--curves", "two", *few], ["one", "two"]),
    ):
        subprocess.run([sys.executable, BENCHMARKS / script, *arguments], cwd=tmp_path, check=True, timeout=600)
        for file in files:
            rows = list(csv.DictReader((tmp_path / file).open()))
            named = {each.get("engine") or each["learner"] for each in rows}
            assert named == (set(engines.ENGINES) if script == "engines.py" else {"ours", "sb3"})
