"""The MJCF of a person's body, compiled by MuJoCo and imported by Newton, against the anatomy."""

import mujoco
import numpy as np
import pytest

from envs.body.anthropometry import anatomy, joined
from envs.body.joints import BODIES, FEET
from envs.body.mjcf import MJCF, mjcf
from envs.body.model import build_model, geometry
from envs.body.segments import segments
from envs.config import Person

PERSONS = [Person(mass=73, height=1.741, sex="male"), Person(mass=45, height=1.5, sex="female")]


@pytest.fixture(params=PERSONS, ids=lambda person: person.sex)
def person(request):
    return request.param


@pytest.fixture
def upright(person):
    """MuJoCo's model of the body, and its data as it starts."""
    model = mujoco.MjModel.from_xml_string(mjcf(person))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def tensor(model, body):
    """The inertia of a body about its centre of mass, in its own axes [kg m2]."""
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body(body).iquat)
    turn = turn.reshape(3, 3)
    return turn @ np.diag(model.body(body).inertia) @ turn.T


def test_without_a_person_it_is_the_papers_file():
    assert mjcf(None) == MJCF.read_text()


def test_measures_of_the_upright_body(person, upright):
    """Soles on the ground, the top of the head at the stature, joints above the ankle at the heights of the anatomy."""
    (model, data), body = upright, anatomy(person)
    for foot in FEET:
        sole = foot.replace("foot", "sole")
        ends = data.geom(sole).xpos + np.outer([-1, 1], data.geom(sole).xmat.reshape(3, 3)[:, 2]) * model.geom(sole).size[1]
        assert ends[:, 2] - model.geom(sole).size[0] == pytest.approx([0.0, 0.0], abs=1e-9)
        assert sorted(ends[:, 0]) == pytest.approx(body.sole, abs=1e-9)
    head, (radius, half, _) = data.geom("head").xpos, model.geom("head").size
    assert head == pytest.approx([0.0, 0.0, body.head], abs=1e-9)
    assert head[2] + half + radius == pytest.approx(person.height, abs=1e-9)
    for side, sign in (("left", 1), ("right", -1)):
        hip, ankle = (data.joint(f"{kind}_{side}").xanchor for kind in ("hip", "ankle"))
        assert hip == pytest.approx([0.0, sign * body.hip_width, body.hip], abs=1e-9)
        assert ankle == pytest.approx([0.0, sign * body.ankle_width, body.ankle], abs=1e-9)
    assert model.jnt_range[1:] == pytest.approx(np.radians([[-120, 45], [-50, 50]] * 2))  # paper Table 1


def test_masses_and_inertias_are_those_of_the_anatomy(person, upright):
    (model, data), body = upright, anatomy(person)
    assert model.body_mass.sum() == pytest.approx(person.mass, rel=1e-9)
    for name, rigid in (("hat", body.hat), ("leg_left", body.leg), ("foot_left", body.foot)):
        assert data.body(name).xipos == pytest.approx(rigid.com, abs=1e-9), name
        assert tensor(model, name) == pytest.approx(rigid.inertia, abs=1e-9), name
    mirror = np.array([1.0, -1.0, 1.0])
    for left, right in (("leg_left", "leg_right"), ("foot_left", "foot_right")):
        assert data.body(right).xipos == pytest.approx(mirror * data.body(left).xipos, abs=1e-9)
        assert tensor(model, right) == pytest.approx(tensor(model, left) * np.outer(mirror, mirror), abs=1e-9)
    whole = joined(body.hat, *2 * [body.leg], *2 * [body.foot])
    assert data.subtree_com[1][[0, 2]] == pytest.approx(whole.com[[0, 2]], abs=1e-9)


def test_newton_reads_the_same_body(env_config, person, upright):
    config = env_config().model_copy(update={"body": person})
    model, (compiled, _) = build_model(config, num_worlds=1, device="cpu"), upright
    for i, name in enumerate(BODIES):
        assert model.body_mass.numpy()[i] == pytest.approx(compiled.body(name).mass[0], rel=1e-6)
        assert model.body_com.numpy()[i] == pytest.approx(compiled.body(name).ipos, abs=1e-6)
        assert model.body_inertia.numpy()[i] == pytest.approx(tensor(compiled, name), abs=1e-6)
    body, planar, shape = anatomy(person), segments(model), geometry(model)
    assert planar.hat_mass + planar.leg_mass + planar.foot_mass == pytest.approx(person.mass, rel=1e-6)
    assert (planar.hip[1], planar.ankle_height) == pytest.approx((body.hip - body.ankle, body.ankle), abs=1e-6)
    assert planar.hat_com == pytest.approx([0.0, body.hat.com[2] - body.hip], abs=1e-6)
    assert planar.head == pytest.approx([0.0, body.head - body.hip], abs=1e-6)
    assert (planar.ankle_x, shape.heel_x, shape.toe_x) == pytest.approx((0.0, *body.sole), abs=1e-6)


def test_solids_fill_about_the_mass(upright):
    """Their radii follow the mass: with a density of 1000 kg/m3 they weigh about as much as the body."""
    model, _ = upright
    volume = 0.0
    for i in range(model.ngeom):
        radius, half, _ = model.geom_size[i]
        if model.geom(i).name.startswith(("sole", "ground")):
            continue
        sphere = model.geom_type[i] == mujoco.mjtGeom.mjGEOM_SPHERE
        volume += 4 / 3 * np.pi * radius**3 + (0.0 if sphere else np.pi * radius**2 * 2 * half)
    assert 1000 * volume / model.body_mass.sum() == pytest.approx(1.0, abs=0.05)
