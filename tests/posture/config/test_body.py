"""Joints scaled with the body: by hand, and by the similarity of motions that the rule is derived from."""

import pytest

from envs.body.segments import read_segments
from envs.config import Person
from posture.analysis.coordination import torque_cost
from posture.cli import jobs
from posture.config.body import EXPONENTS, factor, for_body, with_body
from posture.config.errors import ConfigError
from posture.config.eval import BodyChanges
from posture.config.theory import TheoryConfig
from posture.evaluation.trial import AS_TRAINED, comparable_table_3, trial_config
from posture.theory.motion import joint_arrays
from posture.theory.optimum import bound
from posture.theory.stander import linearise
from posture.theory.transition import bound_transition
from tests.conftest import compose

HEAVY = Person(mass=80.3, height=1.57, sex="male")  # twice the paper's 40.15 kg at its 1.57 m
TALL = Person(mass=40.15, height=6.28 / 3, sex="male")  # 4/3 of its height


def test_factors_by_hand():
    assert [factor(key, HEAVY) for key in ("hip_k", "joint_damping", "joint_armature", "fall_height")] == [2, 2, 2, 1]
    expected = {"ankle_k": 4 / 3, "torque_limit": 4 / 3, "joint_damping": (4 / 3) ** 1.5, "joint_armature": 16 / 9}
    assert {key: factor(key, TALL) for key in expected} == pytest.approx(expected)
    assert factor("fall_height", TALL) == pytest.approx(4 / 3)
    assert for_body("hip_k", [25.0, 200.0], HEAVY) == [50.0, 400.0] and for_body("hip_k", 125.0, None) == 125.0


def test_configuration_of_a_person():
    chosen = ("env/body=anthropometric", "env.body.mass=80.3", "env.body.height=1.57")
    env = compose(*chosen, "env.ankle_k=40").env
    assert env.body == HEAVY
    assert (env.hip_k, env.ankle_k, env.torque_limit, env.joint_damping, env.joint_armature) == (250, 40, 200, 2, 0.1)
    many = compose(*chosen, "env=many_bodies", "agent=universal").env
    assert many.ranges.hip_k == (50, 400) and many.ranges.joint_damping == (1, 4) and many.ranges.load == (0, 8)
    assert compose("env/body=paper").env == compose().env and compose().env.body is None


@pytest.mark.parametrize("env", ["authors_code", "authors_code_as_run", "fixed_reward", "many_bodies", "paper"])
def test_every_task_takes_a_body(env):
    assert compose(f"env={env}", "env/body=anthropometric", "env.body.sex=female").env.body.sex == "female"


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["env.body.mass=19"], "env.body.mass = 19: must be greater than or equal to 20"),
        (["env.body.mass=201"], "env.body.mass = 201: must be less than or equal to 200"),
        (["env.body.height=180"], "env.body.height = 180: must be less than or equal to 2.3"),
        (["env.body.sex=other"], "env.body.sex = 'other': must be 'female' or 'male'"),
        (["env.body.height=1.6", "env.termination.fall_height=1.25"], "env.termination.fall_height: 1.25 m is too near"),
        (["env.body.mass=heavy"], "env.body.mass = 'heavy'"),
        (["env.body=null", "env.termination.fall_height=1.21"], "env.termination.fall_height: 1.21 m is too near"),
    ],
)
def test_bodies_that_are_refused(overrides, message):
    with pytest.raises(ConfigError, match=message):
        compose("env/body=anthropometric", *overrides)


def test_similar_bodies_move_alike():
    """A woman of 54 kg and 1.50 m and one of 90 kg and 1.80 m are similar, and so are their joints. With amplitude and
    tolerance in the ratio of their heights, and frequencies in that of 1 / sqrt(height), they need the same share of their
    torque limits, and switch modes at similar frequencies."""
    found = []
    for mass, height in ((54, 1.5), (90, 1.8)):
        env = jobs.compose(
            "theory", TheoryConfig, "env/body=anthropometric", f"env.body.mass={mass}", f"env.body.height={height}",
            "env.body.sex=female",
        ).env  # fmt: skip
        stander, task = linearise(read_segments(env), env), (height / 15, height / 60)
        costs = [torque_cost(joint_arrays(bound(stander, f / height**0.5, *task))[0], env.torque_limit) for f in (0.4, 1.5)]
        switch = bound_transition(stander, *task, (0.02, 2.0))
        found.append([*costs, switch * height**0.5])
    assert found[0] == pytest.approx(found[1], rel=1e-4)


def test_an_evaluation_in_another_body_scales_the_joints_of_the_run():
    run = compose("env.hip_k=60")
    changes = AS_TRAINED.model_copy(update={"body": BodyChanges(**HEAVY.model_dump()), "ankle_k": 30.0})
    env = trial_config(run.env, run.evaluation, changes, "cpu")
    assert (env.body, env.hip_k, env.ankle_k, env.torque_limit, env.joint_damping) == (HEAVY, 120, 30, 200, 2)
    assert env.termination.fall_height == 1.0
    # From one person to another, of whom a part is changed.
    lighter = AS_TRAINED.model_copy(update={"body": BodyChanges(mass=40.15, height=None, sex=None)})
    other = trial_config(env, run.evaluation, lighter, "cpu")
    assert (other.body.mass, other.body.sex, other.hip_k, other.torque_limit) == (40.15, "male", 60, 100)


def test_a_part_of_a_body_is_not_enough_where_there_was_none():
    run, changes = compose(), AS_TRAINED.model_copy(update={"body": BodyChanges(mass=70, height=None, sex=None)})
    with pytest.raises(ConfigError, match=r"^env\.body\.height: missing; the policy was trained with the paper's body"):
        trial_config(run.env, run.evaluation, changes, "cpu")


def test_the_papers_table_is_not_compared_with_other_bodies():
    env = compose("env.energy_weight=20").env
    assert comparable_table_3(env) is not None
    assert comparable_table_3(env.model_copy(update={"body": HEAVY})) is None


def test_another_body_and_back():
    env = compose().env
    there = env.model_validate(with_body(env, TALL))
    assert there.body == TALL and (there.hip_k, there.termination.fall_height) == pytest.approx((500 / 3, 4 / 3))
    back = env.model_validate(with_body(there, None))
    for key in EXPONENTS:
        own, again = (getattr(one.termination if key == "fall_height" else one, key) for one in (env, back))
        assert again == pytest.approx(own, rel=1e-12), key
    assert back.body is None
