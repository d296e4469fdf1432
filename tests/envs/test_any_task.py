"""What the ranges of the configuration allow, the physics, reward and controller stand: its ends, in any combination."""

import copy
import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from envs.config import EnvConfig
from envs.task.head_tracking import HeadTrackingEnv
from posture.config.errors import ConfigError
from posture.config.eval import LqrConfig
from posture.config.reading import read
from posture.theory.lqr import gain
from posture.theory.stander import linearise
from tests.posture.cli.test_any_input import WHOLE, leaves

STEPS = 40
UNTOUCHED = {"num_envs", "constraint_rows", "contacts", "episode_steps", "steps"}
"""How many there are of worlds, rows and steps says nothing about whether a step is finite."""


def ends(kind):
    """Of every number of a configuration its path and the two ends of its range."""
    schema = kind.model_json_schema()
    for path, leaf in leaves(schema, schema["$defs"]):
        if leaf.get("type") in ("number", "integer") and path[-1] not in UNTOUCHED:
            low = leaf["minimum"] if "minimum" in leaf else math.nextafter(leaf["exclusiveMinimum"], math.inf)
            yield path, (low, leaf["maximum"])


def with_changes(values, changes):
    changed = copy.deepcopy(values)
    for path, value in changes:
        record = changed
        for part in path[:-1]:
            record = record[part] = record[part] if isinstance(record[part], dict) else {}
        record[path[-1]] = value
    return changed


TASK = WHOLE["train"]["env"] | {"num_envs": 8}
ENDS = [(path, end) for path, both in ends(EnvConfig) for end in both if path[0] != "ramp"]
tasks = st.lists(st.sampled_from(ENDS), max_size=8)


def check_task(changes):
    try:
        config = read(EnvConfig, with_changes(TASK, changes))
    except ConfigError:
        return  # ends that do not go together, such as a long control step and a fast target
    env = HeadTrackingEnv(config, 0, "cpu")
    diverged, whether_ended = [], env._ended

    def ended():
        diverged.append(bool(env.sim.diverged.any()))  # before the reset, which heals it
        return whether_ended()

    env._ended = ended
    # Standing still must not diverge; under random torques a step may, but even then nothing that is learned from may cease
    # to be finite.
    for step in range(STEPS):
        action = torch.zeros(8, 2) if step < STEPS // 2 else torch.empty(8, 2).uniform_(-1.5, 1.5)
        observation, reward, _, extras = env.step(action)
        assert reward.isfinite().all() and observation["policy"].isfinite().all()
        assert all(value.isfinite() for value in extras["log"].values())
    assert not any(diverged[: STEPS // 2])


@given(tasks)
@settings(max_examples=30, deadline=None)
def test_the_physics_stands_what_is_allowed(changes):
    check_task(changes)


@pytest.mark.slow
@given(tasks)
@settings(max_examples=1000, deadline=None)
def test_the_physics_stands_a_thousand_tasks(changes):
    check_task(changes)


@pytest.mark.parametrize(("path", "end"), ENDS, ids=lambda x: ".".join(x) if isinstance(x, tuple) else f"{x:g}")
def test_each_end_alone(path, end):
    check_task([(path, end)])


LQR = WHOLE["eval"]["lqr"]
LQR_ENDS = [(path, end) for path, both in ends(LqrConfig) for end in both if path[0] != "env"]
BODY = [(("env", *path), end) for path, end in ENDS if path[0] in ("hip_k", "ankle_k", "load", "torque_limit", "control_dt")]


@given(st.lists(st.sampled_from(LQR_ENDS + BODY), max_size=5))
@settings(max_examples=200, deadline=None)
def test_the_controller_has_a_gain_for_what_is_allowed(body, changes):
    try:
        config = read(LqrConfig, with_changes(LQR, changes))
    except ConfigError:
        return
    assert torch.tensor(gain(linearise(body, config.env), config.env.control_dt, config)).isfinite().all()
