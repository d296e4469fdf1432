"""A step can be captured in a CUDA graph: its operations, recorded once and repeated without its Python code, are the step.

Here on a CPU, with a recording of our own in place of the graph; tests/gpu has the graph itself.
"""

import pytest
import torch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_map

from envs.engines.launch import Launch
from envs.task.head_tracking import LOG, HeadTrackingEnv
from envs.task.observations import TERMS

STEPS = 200
LAUNCH = Launch.__call__


class Recording(TorchDispatchMode):
    """Records operations of torch in order; `launch` does so with those of Warp."""

    def __init__(self):
        super().__init__()
        self.operations = []

    def __torch_dispatch__(self, function, types, arguments=(), keywords=None):
        result = function(*arguments, **(keywords or {}))
        self.operations.append((function, arguments, keywords or {}, result))
        return result

    def launch(self, launch):
        LAUNCH(launch)
        self.operations.append((LAUNCH, (launch,), {}, None))


def repeat(operations, results):
    """Run recorded operations again, on the results of the new run; returns the new values of `results`."""
    new = {}

    def current(value):
        return new.get(id(value), value)

    for function, arguments, keywords, result in operations:
        again = function(*tree_map(current, arguments), **tree_map(current, keywords))
        if isinstance(result, torch.Tensor):
            new[id(result)] = again
    return [current(result) for result in results]


@pytest.mark.parametrize("training_steps", [None, STEPS])
def test_a_recorded_step_repeated_is_the_step(env_config, monkeypatch, training_steps):
    """With resets, draws, a ramp of every weight's schedule, worlds that diverge, and every observation."""
    terms = f"env.observations.policy=[{','.join(TERMS)}]"
    config = env_config("env.num_envs=16", "env.episode_steps=[1,30]", "env.freq=[0.1,1.5]", terms)
    recorded, stepped = (HeadTrackingEnv(config, 1, "cpu", training_steps=training_steps) for _ in range(2))
    recorded.warm_up()
    recording = Recording()
    before = recorded.state_dict()
    with monkeypatch.context() as patch, recording:
        patch.setattr(Launch, "__call__", lambda launch: recording.launch(launch))
        results = recorded._rest_of_step()
    recorded.load_state_dict(before)
    assert len(recording.operations) > 50

    generator = torch.Generator().manual_seed(0)
    for step in range(STEPS):
        action = torch.randn(16, 2, generator=generator)
        action[step % 16] = float("nan")
        command = action.clamp(-1.0, 1.0)
        recorded.state.action.copy_(torch.cat((command, command), -1))
        *groups, reward, done, time_out, log = repeat(recording.operations, results)
        observation, expected_reward, expected_done, extras = stepped.step(action)
        for name, group in zip(config.observations, groups, strict=True):
            torch.testing.assert_close(group, observation[name], rtol=0, atol=0)
        torch.testing.assert_close(reward, expected_reward, rtol=0, atol=0)
        assert torch.equal(done, expected_done) and torch.equal(time_out, extras["time_outs"])
        torch.testing.assert_close(log, torch.stack([extras["log"][name] for name in LOG]), rtol=0, atol=0)
    assert stepped.episodes.episode.min() >= 10 and int(recorded.steps) == STEPS


def test_a_step_with_state_in_python_is_noticed():
    """The recording would differ where Python code holds a part of the state."""
    count = 0
    x = torch.zeros(1)
    recording = Recording()
    with recording:
        count += 1
        result = x + count
    count += 1
    assert repeat(recording.operations, [result])[0] != x + count
