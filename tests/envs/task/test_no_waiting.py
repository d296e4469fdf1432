"""On a GPU a step makes the host wait for nothing: no operation of it, here on a CPU, needs a tensor's value on the host."""

from contextlib import contextmanager

import pytest
import torch
import warp as wp
from torch.utils._python_dispatch import TorchDispatchMode

from envs.task.head_tracking import HeadTrackingEnv
from envs.task.observations import TERMS
from posture.learning.learner import Learner
from tests.conftest import compose

READS = {"_local_scalar_dense", "nonzero", "masked_select", "equal", "unique_dim", "_unique2", "repeat_interleave"}
"""Operations whose result or shape the host has to know."""


class NoWaiting(TorchDispatchMode):
    """Refuses every operation for which the host would read from the device or copy to it."""

    def __torch_dispatch__(self, function, types, arguments=(), keywords=None):
        name = function.overloadpacket.__name__
        if name in READS:
            raise AssertionError(f"the host waits for {name}")
        if name == "lift_fresh":
            raise AssertionError("a tensor is made of numbers of the host")
        if name in ("index", "index_put", "index_put_"):
            masks = [index for index in arguments[1] if index is not None and index.dtype == torch.bool]
            assert not masks or (name == "index_put_" and arguments[2].dim() == 0), "the host counts the values of a mask"
        return function(*arguments, **(keywords or {}))


@contextmanager
def no_waiting():
    """In this context what reads a value without an operation of torch is refused too."""

    def read(*_, **__):
        raise AssertionError("a tensor is read on the host")

    with pytest.MonkeyPatch.context() as patch, NoWaiting():
        for kind, names in ((torch.Tensor, ("cpu", "numpy", "tolist", "item", "__bool__")), (wp.array, ("numpy", "list"))):
            for name in names:
                patch.setattr(kind, name, read)
        yield


READING = {
    "item": lambda x: torch.ops.aten._local_scalar_dense(x[0]),
    "bool": lambda x: bool(x.any()),
    "tolist": lambda x: x.tolist(),
    "nonzero": lambda x: x.nonzero(),
    "a mask": lambda x: x[x > 0],
    "masked_select": lambda x: x.masked_select(x > 0),
    "a list of indices": lambda x: x[[0, 2]],
    "a new tensor": lambda x: x + torch.tensor([1.0, 2.0, 3.0]),
}


@pytest.mark.parametrize("name", READING)
def test_reading_a_value_is_noticed(name):
    x = torch.ones(3)
    with pytest.raises(AssertionError, match="host|mask"), no_waiting():
        READING[name](x)


@pytest.mark.parametrize("physics", ["sagittal", "mujoco"])
@pytest.mark.parametrize("training_steps", [None, 1000])
def test_a_step_with_resets_reads_nothing(env_config, physics, training_steps):
    """200 steps, with worlds that are reset in each of them."""
    terms = f"env.observations.policy=[{','.join(TERMS)}]"
    config = env_config(f"env.physics={physics}", "env.num_envs=16", "env.episode_steps=[1,3]", "env.freq=[0.1,1.5]", terms)
    env = HeadTrackingEnv(config, 1, "cpu", training_steps=training_steps)
    env.warm_up()
    actions = 0.3 * torch.randn(200, 16, 2, generator=torch.Generator().manual_seed(0))
    ended = []
    with no_waiting():
        for action in actions.unbind():
            ended.append(env.step(action)[2])
    assert torch.stack(ended).any(-1).all()
    assert env.episodes.episode.min() >= 66


def test_a_roll_out_with_its_log_reads_nothing(tmp_path):
    """What rsl-rl does in each step of an iteration: act, step, store and log."""
    config = compose("env.num_envs=16", "env.episode_steps=[1,3]", "processes=1", "agent.algorithm.num_mini_batches=4")
    env = HeadTrackingEnv(config.env, 1, "cpu", training_steps=100)
    learner = Learner(env, config.agent, tmp_path, "cpu")
    env.warm_up()
    observation = env.get_observations()
    with torch.inference_mode(), no_waiting():
        for _ in range(config.agent.num_steps_per_env):
            observation, reward, done, extras = env.step(learner.alg.act(observation))
            learner.alg.process_env_step(observation, reward, done, extras)
            learner.logger.process_env_step(reward, done, extras)
    assert env.episodes.episode.min() >= 10
