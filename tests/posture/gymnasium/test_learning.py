"""Other libraries' learners learn the task by its Gymnasium interface."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
from posture.gymnasium.stable_baselines3 import StanderVecEnv  # noqa: E402

ROOT = Path(__file__).parents[3]
STEPS = 300
LONGER = 5
"""A training of 500,000 steps makes episodes longer by at least this factor, and their return at least as much larger."""


def test_stable_baselines3_interface():
    """Seeds, ends and last observations are those of the vector environment."""
    standers = StanderVecEnv(3, freq=0.5, episode_steps=10, render_mode="rgb_array")
    standers.seed(4)
    first = standers.reset()
    assert np.array_equal(first, standers.envs.reset(seed=4)[0])
    for _ in range(10):
        seen, reward, done, infos = standers.step(np.full((3, 2), 0.01, dtype=np.float32))
    assert done.all() and np.array_equal(seen, first) and reward.dtype == np.float32
    for info in infos:
        assert info["TimeLimit.truncated"]
        assert info["terminal_observation"].shape == (18,) and not np.array_equal(info["terminal_observation"], first[0])
    for _ in range(3):
        _, _, done, infos = standers.step(np.array([[0.01, 0.0], [np.nan, 0.0], [0.01, 0.0]], dtype=np.float32))
        assert done.tolist() == [False, True, False]
        assert not infos[1]["TimeLimit.truncated"] and infos[0] == {}
    assert np.shape(standers.get_images()) == (3, 720, 288, 3)
    assert standers.env_is_wrapped(StanderVecEnv) == 3 * [False]
    with pytest.raises(NotImplementedError, match="share"):
        standers.set_attr("freq", 1.0)
    standers.close()


def judged(model):
    """Length and return of an episode of `STEPS` at most, on average over 20 frequencies, of the deterministic policy."""
    envs = StanderVecEnv(20)
    envs.seed(7)
    seen, going = envs.reset(), np.ones(20, dtype=bool)
    length, total = np.zeros(20), np.zeros(20)
    for _ in range(STEPS):
        actions, _ = model.predict(model.get_vec_normalize_env().normalize_obs(seen), deterministic=True)
        seen, reward, done, _ = envs.step(actions)
        length, total, going = length + going, total + going * reward, going & ~done
    return length.mean(), total.mean()


@pytest.mark.slow
def test_the_documents_example_learns():
    """The example of docs/gymnasium.md, as it is there."""
    (example,) = re.findall(r"```python\n([^`]*PPO[^`]*)```", (ROOT / "docs" / "gymnasium.md").read_text(encoding="utf-8"))
    before, learn = re.split(r"(?=model\.learn)", example)
    names = {}
    exec(before, names)
    untrained = judged(names["model"])
    exec(learn, names)
    trained = judged(names["model"])
    print(f"untrained {untrained}, trained {trained}")
    assert trained[0] > LONGER * untrained[0]
    assert trained[1] > LONGER * max(untrained[1], 0.0)


@pytest.mark.slow
def test_ppo_in_one_file_learns():
    """examples/ppo.py: from the first hundred episodes to the last."""
    curve = runpy.run_path(str(ROOT / "examples" / "ppo.py"))["train"](500_000, 256, 1)
    (first_return, first_length), (last_return, last_length) = curve[0], curve[-1]
    assert last_length > LONGER * first_length
    assert last_return > LONGER * max(first_return, 0.0)
