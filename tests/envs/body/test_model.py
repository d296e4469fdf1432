"""The body model against hand calculation, the paper, and MuJoCo's compiler on the same file."""

import math

import mujoco
import newton
import numpy as np
import pytest

from envs.body.joints import BODIES, JOINTS
from envs.body.mjcf import MJCF
from envs.body.model import build_model, geometry


@pytest.fixture(scope="module")
def model(env_config):
    return build_model(env_config(), num_worlds=2, device="cpu")


@pytest.fixture(scope="module")
def mujoco_model():
    return mujoco.MjModel.from_xml_path(str(MJCF))


def capsule(length, radius):
    return math.pi * radius**2 * length + 4 / 3 * math.pi * radius**3


def test_total_mass_is_that_of_the_paper(model):
    mass = model.body_mass.numpy().reshape(2, -1)
    assert mass.sum(1) == pytest.approx([40.15, 40.15], abs=0.02)  # paper Table 1


def test_segment_masses_by_hand(model):
    # Solids of density 1000 kg/m3, dimensions in metres.
    head, hand = (4 / 3 * math.pi * r**3 for r in (0.09, 0.04))
    upper_arm = capsule(math.dist((0, 0.17, 0.03), (0, 0.21, -0.19)), 0.04)
    lower_arm = capsule(math.dist((0, 0.22, -0.21), (0.01, 0.25, -0.46)), 0.031)
    trunk = capsule(0.14, 0.07) + 2 * capsule(0.12, 0.06) + capsule(0.14, 0.09)
    hat = 1000 * (trunk + head + 2 * (upper_arm + lower_arm + hand))
    leg = 1000 * (capsule(math.hypot(0.34, 0.01), 0.06) + capsule(0.30, 0.049))
    foot = 1000 * 2 * capsule(math.hypot(0.21, 0.02), 0.027)
    assert model.body_mass.numpy()[:5] == pytest.approx([hat, leg, foot, leg, foot], rel=1e-4)
    assert [hat, leg, foot] == pytest.approx([22.877, 7.507, 1.131], abs=1e-3)  # reference values of the authors' model


def test_centre_of_mass_at_rest(model):
    state = model.state()
    newton.eval_fk(model, model.joint_q, model.joint_qd, state)
    mass = model.body_mass.numpy()[:5]
    pose = state.body_q.numpy()[:5]
    com = pose[:, :3] + model.body_com.numpy()[:5]  # at rest all frames are parallel to the world's
    centre = mass @ com / mass.sum()
    ankle_x = pose[BODIES.index("foot_left"), 0]
    assert centre[2] == pytest.approx(0.82, abs=0.01)
    assert centre[0] - ankle_x == pytest.approx(0.002, abs=0.001)
    assert centre[1] == pytest.approx(0.0, abs=1e-6)


def test_newton_importer_agrees_with_mujoco(model, mujoco_model):
    """Masses, centres of mass and inertias, to single precision."""
    for i, name in enumerate(BODIES):
        body = mujoco_model.body(name)
        assert model.body_mass.numpy()[i] == pytest.approx(body.mass[0], rel=1e-5)
        assert model.body_com.numpy()[i] == pytest.approx(body.ipos, abs=1e-6)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, body.iquat)
        turn = turn.reshape(3, 3)
        inertia = turn @ np.diag(body.inertia) @ turn.T
        assert model.body_inertia.numpy()[i] == pytest.approx(inertia, abs=1e-5)


def test_segment_lengths_and_joint_limits(model, mujoco_model):
    shape = geometry(model)
    data = mujoco.MjData(mujoco_model)
    mujoco.mj_forward(mujoco_model, data)
    hip, ankle = (data.joint(name).xanchor for name in ("hip_left", "ankle_left"))
    head = data.geom("head").xpos
    assert head[2] - hip[2] == pytest.approx(0.655, abs=1e-6)
    assert hip[2] - ankle[2] == pytest.approx(0.713, abs=1e-6)
    assert shape.head == pytest.approx([0, 0, 0.19])
    assert (shape.heel_x, shape.toe_x) == pytest.approx((-0.06, 0.13))
    hip_range, ankle_range = (-120, 45), (-50, 50)  # paper Table 1
    expected = np.radians([hip_range, ankle_range, hip_range, ankle_range]).T
    assert shape.joint_limits == pytest.approx(expected, abs=1e-6)


def test_soles_just_touch_the_ground(mujoco_model):
    data = mujoco.MjData(mujoco_model)
    mujoco.mj_forward(mujoco_model, data)
    assert data.ncon == 4 or data.ncon == 0  # touching to rounding
    for side in ("left", "right"):
        sole = data.geom(f"sole_{side}")
        radius = mujoco_model.geom(f"sole_{side}").size[0]
        assert sole.xpos[2] - radius == pytest.approx(0.0, abs=1e-9)


def test_springs_and_dampers_follow_the_configuration(env_config):
    model = build_model(env_config("env.hip_k=70", "env.ankle_k=30", "env.joint_damping=2"), num_worlds=1, device="cpu")
    assert model.joint_stiffness.numpy()[6:] == pytest.approx([70, 30, 70, 30])
    assert model.joint_damping.numpy()[6:] == pytest.approx([2] * 4)
    assert [label.rsplit("/")[-1] for label in model.joint_label] == ["root", *JOINTS]
