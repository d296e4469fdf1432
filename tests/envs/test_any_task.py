"""Physics, reward and controller stay finite at the ends of every range that is allowed, in any combination."""

import copy
import math

import pytest
import torch
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from envs.config import EnvConfig, Person
from envs.task.head_tracking import HeadTrackingEnv
from posture.config.errors import ConfigError
from posture.config.eval import LqrConfig
from posture.config.reading import read
from posture.theory.lqr import gain
from posture.theory.stander import linearise
from tests.posture.cli.test_any_input import WHOLE, leaves

STEPS = 40
UNTOUCHED = {"num_envs", "constraint_rows", "contacts", "episode_steps"}
"""The number of worlds, rows and steps has no influence on whether a step is finite."""


def ends(kind):
    """The path of every number of a configuration, with each end of its range."""
    schema = kind.model_json_schema()
    for path, leaf in leaves(schema, schema["$defs"]):
        if leaf.get("type") in ("number", "integer") and path[-1] not in UNTOUCHED:
            yield path, leaf["minimum"] if "minimum" in leaf else math.nextafter(leaf["exclusiveMinimum"], math.inf)
            yield path, leaf["maximum"]


def with_changes(values, changes):
    """A copy of `values` with other values at some paths; a record that is missing on the way is made."""
    changed = copy.deepcopy(values)
    for path, value in changes:
        record = changed
        for part in path[:-1]:
            if not isinstance(record[part], dict):
                record[part] = {}
            record = record[part]
        record[path[-1]] = value
    return changed


def allowed(kind, values, changes):
    """The configuration with these changes, or None where they are refused together."""
    try:
        return read(kind, with_changes(values, changes))
    except ConfigError:
        return None


def whole(path, end):
    """A change with all that belongs together: both coordinates of a place, and all measures of a body."""
    if path == ("load_at",):
        return path, (end, end)
    if path[0] == "body":
        return ("body",), Person(**{"mass": 70, "height": 1.7, "sex": "male"} | {path[1]: end})
    return path, end


def schedule(weight):
    return {"start": weight, "end": weight, "until": 0.75}


TASK = with_changes(
    WHOLE["train"]["env"],
    [
        (("num_envs",), 8),
        (("energy_weight",), schedule(20.0)),
        (("reward", "alive"), schedule(1.0)),
        (("reward", "effort_exponent"), schedule(0.5)),
    ],
)
"""The default task with a schedule wherever one is possible."""
ENDS = [
    whole(path, end)
    for path, end in ends(EnvConfig)
    if path[0] not in ("ramp", "ranges") and path[:2] != ("sensing", "noise")  # which the default task has not
]
ALONE = [(path, end) for path, end in ENDS if allowed(EnvConfig, TASK, [(path, end)])]


def test_changes_are_made_where_they_belong():
    values = {"a": 1, "b": {"c": 2, "d": 3}, "e": None}
    changes = [(("a",), 10), (("b", "c"), 20), (("e", "f"), 30)]
    assert with_changes(values, changes) == {"a": 10, "b": {"c": 20, "d": 3}, "e": {"f": 30}}
    assert values == {"a": 1, "b": {"c": 2, "d": 3}, "e": None}


def test_only_ends_that_contradict_another_key_are_refused_alone():
    weights = [("energy_weight",), *(("reward", name) for name in ("stay_weight", "target_weight", "alive", "ended"))]
    other_sign = {(weight, 1e4 if weight[-1] == "ended" else -1e4) for weight in weights}
    schedules = {((*weight, side), end) for weight, end in other_sign for side in ("start", "end")}
    schedules |= {(("reward", "effort_exponent", side), end) for side in ("start", "end") for end in (-1e4, 1e4)}
    others = {
        ("amplitude", 0.001),
        ("control_dt", 0.1),
        ("termination.head_tolerance", 2),
        ("reward.tolerance", 2),
        ("solver.substeps", 1),
        ("termination.fall_height", 2),
        ("body", Person(mass=70, height=1.0, sex="male")),  # its shoulders are lower than the default's fall_height
    }
    expected = schedules | {(tuple(name.split(".")), end) for name, end in others}
    assert set(ENDS) - set(ALONE) == expected and len(expected) == 21
    assert len(ALONE) >= 70


def check_task(config):
    env = HeadTrackingEnv(config, 0, "cpu", training_steps=STEPS)
    diverged, check_ended = [], env._ended

    def ended():
        diverged.append(bool(env.sim.diverged.any()))  # before the reset
        return check_ended()

    env._ended = ended
    # Standing still must not diverge. Under random torques a step may, but all inputs of learning stay finite.
    for step in range(STEPS):
        action = torch.zeros(8, 2) if step < STEPS // 2 else torch.empty(8, 2).uniform_(-1.5, 1.5)
        observation, reward, _, extras = env.step(action)
        assert reward.isfinite().all() and observation["policy"].isfinite().all()
        assert all(value.isfinite() for value in extras["log"].values())
    assert len(diverged) == STEPS and not any(diverged[: STEPS // 2])


@pytest.mark.parametrize(("path", "end"), ALONE, ids=lambda x: ".".join(map(str, x)) if isinstance(x, tuple) else str(x))
def test_each_end_alone(path, end):
    check_task(allowed(EnvConfig, TASK, [(path, end)]))


def any_ends(candidates, max_size):
    return st.lists(st.sampled_from(candidates), max_size=max_size, unique_by=lambda change: change[0])


def check_any_task(changes):
    config = allowed(EnvConfig, TASK, changes)
    assume(config is not None)  # hypothesis draws until `max_examples` combinations are allowed
    check_task(config)


@given(any_ends(ALONE, 8))
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.filter_too_much])
def test_combinations_of_ends(changes):
    check_any_task(changes)


@pytest.mark.slow
@given(any_ends(ALONE, 8))
@settings(max_examples=1000, deadline=None, suppress_health_check=[HealthCheck.filter_too_much])
def test_a_thousand_combinations_of_ends(changes):
    check_any_task(changes)


LQR = WHOLE["eval"]["lqr"]
LQR_ENDS = [(path, end) for path, end in ends(LqrConfig) if path[0] != "env"]
BODY = [(("env", *path), end) for path, end in ENDS if path[0] in ("hip_k", "ankle_k", "load", "torque_limit", "control_dt")]


@given(any_ends(LQR_ENDS + BODY, 5))
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.filter_too_much])
def test_the_controller_has_a_finite_gain(body, changes):
    config = allowed(LqrConfig, LQR, changes)
    assume(config is not None)
    assert torch.tensor(gain(linearise(body, config.env), config.env.control_dt, config)).isfinite().all()
