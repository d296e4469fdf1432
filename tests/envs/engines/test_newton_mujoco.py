"""The Newton simulation against MuJoCo's C solver on the same file, against theory, and against itself world by world."""

import math

import mujoco
import numpy as np
import pytest
import torch

from envs.config import ConstraintOverflowError
from envs.engines.newton_mujoco import NewtonMujocoSimulation
from tests.mujoco_c import MujocoC

GRAVITY = 9.81


def simulation(config, worlds=1, height=0.0):
    """`worlds` standers, lifted by `height` [m]."""
    sim = NewtonMujocoSimulation(config, worlds, "cpu")
    sim._joint_q[:, 2] += height
    return sim


def torques(*hip_ankle):
    """One row of joint torques for each (hip, ankle), left as right."""
    return torch.tensor([[hip, ankle, hip, ankle] for hip, ankle in hip_ankle], dtype=torch.float32)


def test_agrees_with_mujoco_c(config):
    """Swaying and rocking on the ground under random torques for 0.5 s, both engines agree to single precision.

    They solve the same equations (Euler, same step, same pyramidal cone); MuJoCo Warp computes them in single precision, of
    which some 2e-7 of metres and of velocities of 1 rad/s remain after 60 steps. The start is pressed into the ground by
    0.5 mm, since at a bare touch rounding decides whether there is a contact.
    """
    press = -5e-4
    sim, reference = simulation(config, height=press), MujocoC(config, height=press)
    rng = np.random.default_rng(1)
    for _ in range(30):
        hip, ankle = rng.uniform(-25, 25, 2)
        sim.step(torques((hip, ankle)))
        reference.step([hip, ankle] * 2, config.solver.substeps)
    assert np.ptp(reference.data.qpos[reference.angles]) > 0.05  # it did move
    assert sim.joint_angle[0].numpy() == pytest.approx(reference.data.qpos[reference.angles], abs=5e-6)
    assert sim.body_pose[0, 0, :3].numpy() == pytest.approx(reference.data.qpos[:3], abs=1e-6)
    assert sim.joint_velocity[0].numpy() == pytest.approx(reference.data.qvel[reference.dofs], abs=5e-4)


def test_contact_forces_agree_with_mujoco_c(config):
    sim, reference = simulation(config, height=-5e-4), MujocoC(config, height=-5e-4)
    for _ in range(10):
        sim.step(torques((3.0, -6.0)))
        reference.step([3.0, -6.0] * 2, config.solver.substeps)
    expected = np.zeros((2, 2, 3))
    wrench = np.zeros(6)
    for i in range(reference.data.ncon):
        contact = reference.data.contact[i]
        mujoco.mj_contactForce(reference.model, reference.data, i, wrench)
        force = contact.frame.reshape(3, 3).T @ wrench[:3]
        name = reference.model.geom(contact.geom[1]).name
        foot = reference.data.body(name.replace("sole", "foot"))
        local = foot.xmat.reshape(3, 3).T @ (contact.pos - foot.xpos)
        expected[0 if "left" in name else 1, int(local[0] > 0.035)] += force
    assert sim.sole_force[0].numpy() == pytest.approx(expected, abs=0.05)  # of some 390 N in all


def test_standing_carries_the_weight(config):
    """At rest the ground carries m g, divided between heel and toe by the position of the centre of mass."""
    sim = simulation(config)
    for _ in range(20):
        sim.step(torques((0.0, 0.0)))
    vertical = sim.sole_force[0, :, :, 2]
    mass = float(sim.model.body_mass.numpy().sum())
    assert float(vertical.sum()) == pytest.approx(mass * GRAVITY, rel=0.005)
    assert float(vertical[0].sum()) == pytest.approx(float(vertical[1].sum()), rel=1e-3)
    # Centre of mass 2 mm ahead of the ankle: toe share (0.002 + 0.06) / 0.19 of the weight.
    assert float(vertical[:, 1].sum() / vertical.sum()) == pytest.approx(0.062 / 0.19, abs=0.01)


def test_free_fall(config):
    """Lifted, the body falls by g t (t + dt) / 2, the sum of what semi-implicit Euler adds each step."""
    sim = simulation(config, height=5.0)
    start = sim.body_pose.clone()
    steps = 30
    for _ in range(steps):
        sim.step(torques((0.0, 0.0)))
    dt = config.control_dt / config.solver.substeps
    time = steps * config.control_dt
    assert float(sim._joint_q[0, 2]) == pytest.approx(1.286 + 5.0 - GRAVITY * time * (time + dt) / 2, abs=1e-4)
    assert sim.joint_angle[0].abs().max() < 1e-5
    assert float(sim.sole_force.abs().max()) == 0.0
    assert torch.allclose(sim.body_pose[:, :, :2], start[:, :, :2], atol=1e-5)


def test_springs_pull_back_as_hookes_law_says(config):
    """Bent and still in the air, the joint force is minus stiffness times angle, each joint its own."""
    sim = simulation(config, height=5.0)
    sim.joint_angle[0] = torch.tensor([-0.2, 0.1, -0.2, 0.1])
    sim._solver.step(sim._state, sim._state, sim._control, None, 1e-6)
    sim._read_sensors()
    assert sim.joint_force[0].tolist() == pytest.approx([25.0, -2.5, 25.0, -2.5], rel=1e-3)


def test_energy_does_not_grow(config):
    """Without actuation, springs, damping and ground only take energy; measured by MuJoCo on our trajectory."""
    sim, meter = simulation(config), MujocoC(config)
    sim.joint_angle[0] = torch.tensor([-0.3, -0.1, -0.3, -0.1])
    energies = []
    for _ in range(60):
        sim.step(torques((0.0, 0.0)))
        place = sim._joint_q[0].numpy()
        # Newton: quaternion x y z w, velocity of the centre of mass in the world frame. MuJoCo: w x y z, velocity of the
        # frame's origin, angular velocity in the body's frame.
        meter.data.qpos[:3], meter.data.qpos[3:7] = place[:3], place[[6, 3, 4, 5]]
        meter.data.qpos[meter.angles] = place[7:]
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, meter.data.qpos[3:7])
        turn = turn.reshape(3, 3)
        speed = sim._joint_qd[0].numpy().astype(float)
        lever = turn @ sim.geometry.hat_com
        meter.data.qvel[:3] = speed[:3] - np.cross(speed[3:6], lever)
        meter.data.qvel[3:6] = turn.T @ speed[3:6]
        meter.data.qvel[meter.dofs] = speed[6:]
        energies.append(meter.energy())
    energies = np.array(energies)
    assert energies[0] - energies[-1] > 5.0
    assert np.diff(energies).max() < 0.3  # the compliant ground gives back a little of what it stored


def test_load_is_a_point_mass_at_the_centre_of_mass_of_the_hat(config):
    sim = NewtonMujocoSimulation(config.model_copy(update={"load": 4.0}), 1, "cpu")
    mass = sim.model.body_mass.numpy()
    assert mass[0] == pytest.approx(22.877 + 4.0, abs=1e-3)
    sim.set_subject(load=torch.tensor([2.0]))
    assert sim.model.body_mass.numpy()[0] == pytest.approx(22.877 + 2.0, abs=1e-3)
    assert sim.model.body_inv_mass.numpy()[0] == pytest.approx(1 / 24.877, rel=1e-4)
    for _ in range(20):
        sim.step(torques((0.0, 0.0)))
    assert float(sim.sole_force[0, :, :, 2].sum()) == pytest.approx(42.154 * GRAVITY, rel=0.01)


@pytest.mark.parametrize(("hip_k", "load"), [(125.0, 4.0), (50.0, 0.0)])
def test_a_changed_subject_agrees_with_mujoco_c(config, hip_k, load):
    """Stiffness and load set for each world agree with the C solver given the same numbers."""
    sim = simulation(config, height=-5e-4)
    sim.set_subject(hip_k=torch.tensor([hip_k]), load=torch.tensor([load]))
    reference = MujocoC(config.model_copy(update={"hip_k": hip_k}), height=-5e-4)
    reference.model.body("hat").mass[0] += load
    mujoco.mj_setConst(reference.model, reference.data)
    reference.data.qpos[2] -= 5e-4  # setConst puts the reference pose back
    for i in range(15):
        hip, ankle = 20.0 * math.sin(i), -10.0
        sim.step(torques((hip, ankle)))
        reference.step([hip, ankle] * 2, config.solver.substeps)
    assert sim.joint_angle[0].numpy() == pytest.approx(reference.data.qpos[reference.angles], abs=5e-6)
    assert sim.sole_force[0, :, :, 2].sum() > 0.9 * (40.154 + load) * GRAVITY


def test_dropped_contacts_are_an_error(config):
    """Sixteen rows hold the contacts of two flat feet, but not four joints pressed against their limits as well."""
    tight = config.model_copy(update={"solver": config.solver.model_copy(update={"constraint_rows": 16})})
    sim = simulation(tight, height=-5e-4)
    sim.step(torques((0.0, 0.0)))
    sim.check_capacity()
    sim.joint_angle[0] = torch.tensor([0.9, 0.9, 0.9, 0.9])
    sim._joint_q[0, 2] -= 1.0  # bent, the feet would be off the ground
    sim.step(torques((0.0, 0.0)))
    sim.step(torques((0.0, 0.0)))
    with pytest.raises(ConstraintOverflowError, match="env.solver.constraint_rows"):
        sim.check_capacity()
