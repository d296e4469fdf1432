"""The linear stander against MuJoCo's C solver on the same MJCF: by finite differences, held and on the ground."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from envs.body.joints import JOINTS
from envs.body.mjcf import mjcf
from envs.body.segments import read_segments
from posture.theory.motion import PeriodicMotion
from posture.theory.optimum import sinusoid
from posture.theory.stander import linearise
from tests.mujoco_c import with_load

ANKLE_X = -0.01
SMALL = 1e-3


@pytest.fixture(scope="module", params=[(), ("env/body=anthropometric", "env.body.sex=female")], ids=["paper", "woman"])
def config(env_config, request):
    return env_config("env.load=1.5", *request.param)


@pytest.fixture(scope="module")
def stander(config):
    return linearise(read_segments(config), config)


class Held:
    """The body in MuJoCo's C solver, in double precision, without contact, its feet flat and still at given joint angles."""

    def __init__(self, config, spec=None):
        model = with_load(config, spec)
        hinges = [model.joint(name).id for name in JOINTS]
        dofs = model.jnt_dofadr[hinges]
        model.jnt_stiffness[hinges] = [config.hip_k, config.ankle_k] * 2
        model.dof_damping[dofs] = config.joint_damping
        model.dof_armature[dofs] = config.joint_armature
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
        mujoco.mj_setConst(model, mujoco.MjData(model))
        self.model, self.data, self.angles = model, mujoco.MjData(model), model.jnt_qposadr[hinges]
        mujoco.mj_kinematics(model, self.data)
        self.ankle_over_ground = self.data.joint("ankle_left").xanchor[
            2
        ]  # of the upright body, whose soles are on the ground

    def place(self, hip, ankle):
        """Pose with these joint angles, feet flat, ankles over x = -0.01 and at their height."""
        data, pitch = self.data, -(hip + ankle)
        data.qpos[:] = 0.0
        data.qpos[3:7] = [math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0]
        data.qpos[self.angles] = [hip, ankle] * 2
        mujoco.mj_kinematics(self.model, data)
        data.qpos[:3] = np.array([ANKLE_X, 0.0, self.ankle_over_ground + data.qpos[2]]) - data.joint("ankle_left").xanchor
        data.qpos[1] = 0.0
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)
        assert data.body("foot_left").xmat.reshape(3, 3) == pytest.approx(np.eye(3), abs=1e-12)
        return data.qpos.copy()

    def freedom(self, hip, ankle):
        """Generalised velocity of the whole body for a unit velocity of hip and of ankle, feet still. (dofs, 2)."""
        columns = []
        for step in np.eye(2) * 1e-6:
            ahead, back = self.place(*([hip, ankle] + step)), self.place(*([hip, ankle] - step))
            velocity = np.zeros(self.model.nv)
            mujoco.mj_differentiatePos(self.model, velocity, 2e-6, back, ahead)
            columns.append(velocity)
        self.place(hip, ankle)
        return np.stack(columns, axis=1)

    def torque(self, angle, velocity=(0.0, 0.0), acceleration=(0.0, 0.0)):
        """Actuator torque of both hips and both ankles together [Nm]: inverse dynamics of the free body, projected on the
        motions that leave the feet still."""
        freedom = self.freedom(*angle)
        self.data.qvel[:], self.data.qacc[:] = freedom @ velocity, freedom @ acceleration
        mujoco.mj_inverse(self.model, self.data)
        return freedom.T @ self.data.qfrc_inverse


def with_centre_of_mass_ahead(config, forward):
    """Both models of a body whose HAT has its centre of mass further forward [m]."""
    held, body = Held(config), read_segments(config)
    held.model.body("hat").ipos[0] += forward
    return held, linearise(replace(body, hat_com=body.hat_com + [forward, 0.0]), config)


def test_mass_matrix(config, stander):
    """The whole body's mass matrix, projected on the motions that leave the feet still."""
    held = Held(config)
    freedom = held.freedom(0.0, 0.0)
    mujoco.mj_crb(held.model, held.data)
    full = np.zeros((held.model.nv, held.model.nv))
    mujoco.mj_fullM(held.model, held.data, full)
    assert stander.mass == pytest.approx(freedom.T @ full @ freedom, rel=1e-5)


@pytest.mark.parametrize("at", [(-0.2, 0.1), (0.0, 0.3)])
def test_load_behind_and_above(config, at):
    """Mass matrix, slope and value of the torque that MuJoCo needs, for a load that is a body of its own there."""
    carrying = config.model_copy(update={"load": 6.0, "load_at": at})
    held, stander = Held(carrying), linearise(read_segments(config), carrying)
    freedom = held.freedom(0.0, 0.0)
    mujoco.mj_crb(held.model, held.data)
    full = np.zeros((held.model.nv, held.model.nv))
    mujoco.mj_fullM(held.model, held.data, full)
    assert stander.mass == pytest.approx(freedom.T @ full @ freedom, rel=1e-5)
    assert stander.offset == pytest.approx(held.torque((0.0, 0.0)), abs=1e-3)
    for joint, step in enumerate(np.eye(2) * SMALL):
        slope = (held.torque(step) - held.torque(-step)) / (2 * SMALL)
        assert stander.stiffness[:, joint] == pytest.approx(slope, rel=1e-4)


@pytest.mark.parametrize("forward", [0.0, 0.05])
def test_stiffness_with_gravity_and_torque_upright(config, forward):
    """Slope and value of the torque that MuJoCo needs to hold a pose, also with the trunk's mass well ahead of the hip."""
    held, stander = with_centre_of_mass_ahead(config, forward)
    assert stander.offset == pytest.approx(held.torque((0.0, 0.0)), abs=1e-3)
    for joint, step in enumerate(np.eye(2) * SMALL):
        slope = (held.torque(step) - held.torque(-step)) / (2 * SMALL)
        assert stander.stiffness[:, joint] == pytest.approx(slope, rel=1e-4)


def test_head(config, stander):
    held = Held(config)

    def head(angle):
        held.place(*angle)
        return held.data.geom("head").xpos[0]

    slopes = [(head(step) - head(-step)) / (2 * SMALL) for step in np.eye(2) * SMALL]
    assert stander.head == pytest.approx(slopes, rel=1e-5)


@pytest.mark.parametrize("forward", [0.0, 0.05])
def test_centre_of_pressure_by_newton_and_euler(config, forward):
    """Where the ground must push on feet that stay still, from MuJoCo's inverse dynamics of a small motion.

    The root's wrench is what the ground gives: force f and moment about the HAT's frame, which put the force at
    x = -(M_y - (z_sole - z_hat) f_x) / f_z + x_hat on the ground's height.
    """
    held, stander = with_centre_of_mass_ahead(config, forward)

    def simulated(angle, acceleration):
        held.torque(angle, acceleration=acceleration)
        force, turn = held.data.qfrc_inverse[:3], np.zeros(9)
        mujoco.mju_quat2Mat(turn, held.data.qpos[3:7])
        moment = (turn.reshape(3, 3) @ held.data.qfrc_inverse[3:6])[1]
        x, z = held.data.qpos[[0, 2]]
        return x - (moment + z * force[0]) / force[2] - ANKLE_X

    assert stander.cop_offset == pytest.approx(simulated(np.zeros(2), np.zeros(2)), abs=1e-6)
    rng = np.random.default_rng(0)
    for angle, acceleration in zip(rng.normal(0, SMALL, (4, 2)), rng.normal(0, 0.05, (4, 2)), strict=True):
        # Half the difference of a motion and its mirror image has no second order.
        odd = (simulated(angle, acceleration) - simulated(-angle, -acceleration)) / 2
        assert abs(odd) > 1e-4
        assert stander.cop_angle @ angle + stander.cop_acceleration @ acceleration == pytest.approx(odd, abs=2e-7)


def test_free_motion_with_the_feet_held(config, stander):
    """Released from a small bend, MuJoCo with its feet held and our equation swing and topple alike for 0.8 s.

    The feet are held by a very large mass and inertia, and by taking gravity off them alone. What the linear equation leaves
    out is of the third order in the angles.
    """
    spec, feet = mujoco.MjSpec.from_string(mjcf(config.body)), ("foot_left", "foot_right")
    for foot in feet:
        spec.body(foot).gravcomp = 1.0
    held = Held(config, spec)
    model, data = held.model, held.data
    for foot in feet:
        model.body(foot).mass, model.body(foot).inertia = 1e9, 1e9
    model.opt.timestep = 1e-4
    mujoco.mj_setConst(model, mujoco.MjData(model))
    start = np.array([-0.02, 0.01])
    data.qpos[:] = held.place(*start)
    data.qvel[:] = 0.0
    inverse, still = np.linalg.inv(stander.mass), np.linalg.solve(stander.stiffness, -stander.offset)
    plant = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stander.stiffness, -inverse @ stander.damping]])
    rates = np.linalg.eigvals(plant)
    assert np.abs(rates.imag).max() > 5.0 and rates.real.max() > 2.0  # one mode swings, one topples
    found, expected = [], []
    for step in range(1, 8001):
        mujoco.mj_step(model, data)
        if step % 200 == 0:
            found.append(data.qpos[held.angles[:2]].copy())
            moved = scipy.linalg.expm(plant * step * model.opt.timestep) @ [*(start - still), 0.0, 0.0]
            expected.append(still + moved[:2])
    assert np.ptp(found, axis=0).min() > 0.015
    assert np.array(found) == pytest.approx(np.array(expected), abs=1e-4)


def test_torques_of_a_motion_are_those_of_the_simulated_body(config, stander):
    """Inverse dynamics of MuJoCo along a small sinusoid needs the torques of the motion."""
    motion, held = sinusoid(stander, 0.8, SMALL, SMALL), Held(config)
    for time in motion.cycle(7):
        angle, velocity, acceleration, torque = (
            signal(np.array([time]))[0] for signal in (motion.angle, motion.velocity, motion.acceleration, motion.torque)
        )
        expected = held.torque(angle, velocity, acceleration)
        assert 2 * torque == pytest.approx(expected, abs=2e-3 * np.abs(torque).max())


@settings(max_examples=25, deadline=None)
@given(
    freq=st.floats(0.05, 2.0),
    values=st.lists(st.floats(-0.2, 0.2), min_size=8, max_size=8),
)
def test_velocity_and_acceleration_are_derivatives(stander, freq, values):
    """By central differences, and the head's motion is that of its Jacobian."""
    coefficients = np.array(values[:4]).reshape(2, 2) + 1j * np.array([[0, 0], values[4:6]])
    motion = PeriodicMotion(stander, freq, coefficients)
    time, step = motion.cycle(9), 1e-5 / freq
    for value, slope in ((motion.angle, motion.velocity), (motion.velocity, motion.acceleration)):
        difference = (value(time + step) - value(time - step)) / (2 * step)
        assert slope(time) == pytest.approx(difference, abs=1e-5 * max(freq, 1.0) ** 2)
    assert motion.head(time) == pytest.approx(motion.angle(time) @ stander.head)
    assert motion.angle(time + 3 / freq) == pytest.approx(motion.angle(time), abs=1e-9)


def test_step_with_held_torques_solves_the_equation_of_motion(stander):
    """Against scipy's solver for M q'' + D q' + K q + o = 2 tau, over ten control steps' time."""
    state, torque, dt = np.array([0.02, -0.03, 0.1, -0.2]), np.array([3.0, -5.0]), 0.166

    def slope(_time, x):
        moment = 2 * torque - stander.damping @ x[2:] - stander.stiffness @ x[:2] - stander.offset
        return np.concatenate([x[2:], np.linalg.solve(stander.mass, moment)])

    expected = scipy.integrate.solve_ivp(slope, (0.0, dt), state, rtol=1e-10, atol=1e-12).y[:, -1]
    a, b, c = stander.step(dt)
    assert a @ state + b @ torque + c == pytest.approx(expected, rel=1e-7)


def test_a_load_counts_once(config):
    """A load adds its mass at the HAT's centre: to the mass matrix by its lever squared about both joints."""
    body = read_segments(config)
    bare, loaded = (linearise(body, config.model_copy(update={"load": load})) for load in (0.0, 3.0))
    hip, com = body.hip, body.hat_com
    added = 3.0 * com @ com, 3.0 * (hip + com) @ (hip + com)
    assert np.diag(loaded.mass - bare.mass) == pytest.approx(added)
