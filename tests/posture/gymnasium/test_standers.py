"""The registered environments against Gymnasium's checkers and its SyncVectorEnv, and against `HeadTrackingEnv`."""

import math
import sys
import warnings

import gymnasium
import hydra
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.utils.env_match import check_environments_match
from hydra.core.global_hydra import GlobalHydra

from envs.task.head_tracking import HeadTrackingEnv
from posture.config.published import CONF
from posture.gymnasium import ID
from posture.gymnasium.configuration import configure

SHORT = {"freq": 0.5, "episode_steps": 12}
"""Episodes that end by time-out, and under strong actions before."""


def random_actions(steps, worlds, size):
    return size * np.random.default_rng(0).standard_normal((steps, worlds, 2)).astype(np.float32)


def first_seed(seed):
    """The seed of the episodes after reset(seed=...)."""
    return int(np.random.default_rng(seed).integers(2**63))


# -- Gymnasium's conventions -------------------------------------------------------------------------------------------


def test_gymnasiums_checker():
    env = gymnasium.make(ID, render_mode="rgb_array")
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        check_env(env.unwrapped)
    assert [str(each.message) for each in warned if "infinity" not in str(each.message)] == []


def test_the_checker_of_stable_baselines3():
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(gymnasium.make(ID).unwrapped)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_as_gymnasiums_own_vector_environment(mode):
    """Observations, rewards, ends and infos are those of SyncVectorEnv, in which Gymnasium steps single standers."""
    ours = gymnasium.make_vec(ID, 3, autoreset_mode=mode, **SHORT)
    theirs = gymnasium.make_vec(ID, 3, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **SHORT)
    assert ours.metadata == theirs.metadata
    assert (ours.observation_space, ours.action_space) == (theirs.observation_space, theirs.action_space)
    assert data_equivalence(ours.reset(seed=1), theirs.reset(seed=1))
    ended = np.zeros(2, dtype=int)
    for actions in random_actions(60, 3, 0.3):
        answer, expected = ours.step(actions), theirs.step(actions)
        assert data_equivalence(answer, expected)
        ended += answer[2].sum(), answer[3].sum()
    assert (ended >= 3).all()


def test_statistics_of_episodes():
    """Gymnasium's wrapper counts the control steps of an episode in both modes."""
    for mode in ("NextStep", "SameStep"):
        wrapped = gymnasium.wrappers.vector.RecordEpisodeStatistics(gymnasium.make_vec(ID, 2, autoreset_mode=mode, **SHORT))
        wrapped.reset(seed=1)
        for _ in range(30):
            wrapped.step(np.zeros((2, 2)))
        assert list(wrapped.length_queue)[:2] == [12, 12]


# -- the task ----------------------------------------------------------------------------------------------------------


def test_as_head_tracking_env():
    """The vector environment is `HeadTrackingEnv`, bit for bit: episodes, their targets and their rewards."""
    env = gymnasium.make_vec(ID, 8, autoreset_mode="SameStep", episode_steps=[10, 30])
    seen, _ = env.reset(seed=5)
    bare = HeadTrackingEnv(configure(8, "fixed_reward", None, {"episode_steps": [10, 30]}).env, first_seed(5), "cpu")
    assert np.array_equal(seen, torch.cat([*bare.get_observations().values()], -1).numpy())
    ends = 0
    for actions in random_actions(60, 8, 0.3):
        seen, reward, terminated, truncated, info = env.step(actions)
        observation, expected, done, extras = bare.step(torch.from_numpy(actions))
        assert np.array_equal(seen, torch.cat([*observation.values()], -1).numpy())
        assert np.array_equal(reward.astype(np.float32), expected.numpy())
        assert np.array_equal(truncated, extras["time_outs"].numpy())
        assert np.array_equal(terminated, (done & ~extras["time_outs"]).numpy())
        assert np.allclose(info["target_freq"], bare.state.target_freq)
        ends += done.sum()
    assert ends > 8


def test_observation_before_the_reset():
    """final_obs is of the world where its episode ended; the observation beside it is of a stander at rest."""
    env = gymnasium.make_vec(ID, 1, autoreset_mode="SameStep", **SHORT)
    alone = gymnasium.make(ID, freq=0.5)
    start, _ = env.reset()
    alone.reset()
    for step in range(12):
        seen, _, _, truncated, info = env.step(np.array([[0.01, 0.0]]))
        expected, *_ = alone.step(np.array([0.01, 0.0], dtype=np.float32))
        assert bool(truncated[0]) == (step == 11)
    assert np.array_equal(seen, start)
    assert np.array_equal(info["final_obs"][0], expected)
    assert abs(info["final_info"]["tracking_error"][0]) > 0.0


def test_terminated_or_truncated():
    env = gymnasium.make(ID, freq=0.001, episode_steps=3)
    still, broken = np.zeros(2, dtype=np.float32), np.full(2, np.nan, dtype=np.float32)
    env.reset()
    assert [env.step(still)[2:4] for _ in range(3)] == [(False, False), (False, False), (False, True)]
    env.reset()
    *_, terminated, truncated, info = env.step(broken)
    assert (terminated, truncated, info["diverged"]) == (True, False, True)


def test_reward_of_a_training():
    """Standing on target is worth 0.03 x 11; with the schedule of env=head_tracking this falls to 0.03 x 2 in 40 % of
    `training_steps`, and without them it is 0.03 x 2."""
    still = np.zeros(2, dtype=np.float32)

    def rewards(**keys):
        env = gymnasium.make(ID, freq=0.001, **keys)
        env.reset()
        return [env.step(still)[1] for _ in range(5)]

    assert rewards() == pytest.approx(5 * [0.33], abs=1e-3)
    assert rewards(env="head_tracking") == pytest.approx(5 * [0.06], abs=1e-3)
    falling = [0.33 * (2 / 11) ** share for share in (0.25, 0.5, 0.75, 1.0, 1.0)]
    assert rewards(env="head_tracking", training_steps=10) == pytest.approx(falling, abs=1e-3)


def test_size_and_names_of_the_observation():
    env = gymnasium.make(ID, observations={"policy": ["head", "target"], "target_motion": []})
    assert env.observation_space.shape == (3,)
    past = gymnasium.make(ID, observations={"policy": ["head", "target"], "target_motion": []}, sensing={"history": 2})
    assert past.observation_space.shape == (9,)


# -- seeds -------------------------------------------------------------------------------------------------------------


def test_seeds():
    """Equal seeds give equal episodes, over several of them; without a seed the next episode is another one."""
    a, b = (gymnasium.make(ID, episode_steps=[5, 20]) for _ in range(2))
    check_environments_match(a, b, 60, seed=3)

    def freqs(env, *seeds):
        return [env.reset(seed=seed)[1]["target_freq"] for seed in seeds]

    assert freqs(a, 1, None, None) == freqs(b, 1, None, None)
    assert len(set(freqs(a, 1, None, 2, None))) == 4
    fresh = [gymnasium.make(ID).reset()[1]["target_freq"] for _ in range(2)]
    assert fresh[0] != fresh[1]


def test_seeds_of_the_vector_environment():
    """Each world draws from its own part of the range (`freq_draw=stratified`)."""
    a, b = (gymnasium.make_vec(ID, 10) for _ in range(2))
    freqs = [env.reset(seed=seed)[1]["target_freq"] for env, seed in ((a, 1), (b, 1), (b, None), (a, None), (a, 2))]
    assert np.array_equal(freqs[0], freqs[1]) and np.array_equal(freqs[2], freqs[3])
    assert not (freqs[0] == freqs[2]).any() and not (freqs[0] == freqs[4]).any()
    edges = np.linspace(0.015, 1.5, 11)
    assert (edges[:-1] <= freqs[0]).all() and (freqs[0] <= edges[1:]).all()


# -- arguments ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"freq": -1}, "env.freq = -1: must be greater than or equal to 0.001"),
        ({"freq": "fast"}, r"env.freq = fast: allowed is a number, or a range \[low, high\]"),
        ({"hipk": 50}, "env.hipk: no such key"),
        ({"reward": {"stay": 1}}, "env.reward.stay: no such key"),
        (
            {"env": "papers"},
            "env/papers.* authors_code authors_code_as_run fixed_reward head_tracking human many_bodies paper",
        ),
        ({"env": "paper,authors_code"}, "env = 'paper,authors_code': allowed is the name of a file of conf/env"),
        ({"env": {"freq": 1}}, "env = {'freq': 1}: allowed is the name of a file of conf/env"),
        ({"training_steps": 0}, "training_steps = 0: must be greater than or equal to 1"),
        ({"training_steps": 10}, "training_steps: has no effect where no weight is a schedule"),
        ({"num_envs": 5}, "make_vec takes num_envs"),
        ({"freq": 1.0, "freq_draw": "uniform"}, "freq_draw: has no effect with one freq"),
        ({"freq": 1.0, "ramp": {"start": 0.1, "rate": 0.01, "duration": 10}}, "freq: has no effect beside ramp"),
        ({"reward": {"tolerance_weight": 0, "tolerance": 0.05}}, "reward.tolerance: has no effect with reward.tolerance_w"),
        ({"observations": {"policy": [], "target_motion": []}}, "env.observations: all groups are empty"),
        ({"body": {"mass": 5, "height": 1.7, "sex": "male"}}, "env.body: mass = 5: must be greater than or equal to 20"),
        ({"body": {"mass": 70}}, "env.body: height: missing"),
        ({"body": 70}, "env.body"),
        ({"render_mode": "ansi"}, "render_mode = ansi: allowed is rgb_array or None"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*render_mode.*")
def test_bad_values_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message) as refused:
        gymnasium.make(ID, **arguments)
    assert "\n" not in str(refused.value)


def test_bad_values_of_make_vec():
    with pytest.raises(ValueError, match="autoreset_mode = Disabled: allowed is NextStep or SameStep"):
        gymnasium.make_vec(ID, 2, autoreset_mode="Disabled")
    with pytest.raises(ValueError, match=r"autoreset_mode = \[\]: allowed is NextStep or SameStep"):
        gymnasium.make_vec(ID, 2, autoreset_mode=[])
    with pytest.raises(ValueError, match="env.num_envs = 0: must be greater than or equal to 1"):
        gymnasium.make_vec(ID, 0)
    with pytest.raises(ValueError, match="reshape"):
        gymnasium.make_vec(ID, 2).step(np.zeros(3))


def test_values_reach_the_task():
    """Keys replace values in a group of keys one by one; numbers of NumPy count as numbers."""
    keys = {"hip_k": np.float32(50), "freq": (0.3, 1.2), "reward": {"alive": {"start": 3, "end": 1, "until": 0.5}}}
    config = configure(2, "authors_code", 7, keys)
    plain = configure(1, "authors_code", None, {})
    assert (config.env.hip_k, config.env.freq, config.env.reward.alive.start) == (50.0, (0.3, 1.2), 3.0)
    assert config.env.reward.stay_weight == plain.env.reward.stay_weight == 4.0
    assert (config.env.num_envs, config.training_steps, plain.training_steps) == (2, 7, None)


def test_a_body_comes_with_joints_scaled_to_it():
    """Twice the mass of the paper's body at its height: twice the stiffness. What is given is not scaled."""
    body = {"mass": 80.3, "height": 1.57, "sex": "female"}
    config = configure(1, "fixed_reward", None, {"body": body, "ankle_k": 30})
    assert config.env.body.model_dump() == body
    assert (config.env.hip_k, config.env.ankle_k, config.env.torque_limit) == (250.0, 30.0, 200.0)


def test_in_a_program_that_uses_hydra():
    with hydra.initialize_config_dir(str(CONF), version_base="1.3"):
        mine = GlobalHydra.instance().hydra
        assert gymnasium.make(ID, freq=1.0).reset()[1]["target_freq"] == 1.0
        assert GlobalHydra.instance().hydra is mine
        assert hydra.compose("gymnasium").env.num_envs == 1


def test_by_name_alone(monkeypatch):
    """One string names the package to import and the environment."""
    monkeypatch.delitem(gymnasium.registry, ID)
    monkeypatch.delitem(sys.modules, "posture.gymnasium")
    assert gymnasium.make(f"posture.gymnasium:{ID}", freq=1.0).spec.id == ID


# -- pictures ----------------------------------------------------------------------------------------------------------


def test_picture():
    """Of a stander whose target has moved, other than at the start; of many, one each."""
    env = gymnasium.make_vec(ID, 2, render_mode="rgb_array", freq=1.0)
    env.reset()
    start = env.render()
    assert len(start) == 2
    assert start[0].shape == (720, 288, 3) and start[0].dtype == np.uint8
    assert np.array_equal(start[0], start[1])
    for _ in range(15):
        env.step(np.zeros((2, 2)))
    assert not np.array_equal(env.render()[0], start[0])
    assert math.isclose(env.metadata["render_fps"], 1 / 0.0166)
    assert gymnasium.make(ID).unwrapped.render() is None


def test_fixed_reward_is_that_with_which_the_default_training_begins():
    fixed, default = (configure(1, env, None, {}).env for env in ("fixed_reward", "head_tracking"))
    begins = {name: getattr(weight, "start", weight) for name, weight in default.reward}
    assert not fixed.schedules and dict(fixed.reward) == begins


def test_senses_of_people_are_all_that_is_observed():
    """18 values of four moments; the exact ones, which a critic may have, are not among them."""
    env = gymnasium.make(ID, env="human", **SHORT)
    seen, _ = env.reset(seed=1)
    assert env.observation_space.shape == seen.shape == (4 * 18,)
    groups = env.unwrapped._worlds.get_observations()
    assert np.array_equal(seen, torch.cat([groups["policy"], groups["target_motion"]], dim=-1)[0])
