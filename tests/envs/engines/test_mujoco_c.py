"""The engine on MuJoCo's C solver against that solver driven by hand, against the other engines, and against mechanics."""

import math

import mujoco
import numpy as np
import pytest
import torch

from envs.config import ConstraintOverflowError
from envs.engines.factory import simulate
from envs.engines.mujoco_c import MujocoCSimulation
from envs.engines.newton_mujoco import NewtonMujocoSimulation
from envs.engines.sagittal import SagittalSimulation
from posture.config.errors import ConfigError
from tests.conftest import compose, compose_eval
from tests.envs.engines.test_sagittal import (
    C_AGREES,
    FLAT,
    GRAVITY,
    NEWTON_AGREES,
    OUTPUTS,
    STEPS,
    TRIALS,
    Mechanics,
    above,
    both_sides,
    deviation,
    finite,
    modified,
    placed,
    seen,
    turned,
)
from tests.mujoco_c import MujocoC

MASS = 40.154191
"""Of the whole body [kg], from the volumes of the solids in humanoid.xml."""


@pytest.fixture(params=[False, True], ids=["contacts of MuJoCo", "contact bias"])
def either(config, request):
    """The configuration with MuJoCo's own contacts, and with their bias acceleration."""
    return modified(config, contact_bias=request.param)


def set_out(config, q, qd=(0, 0, 0, 0, 0)):
    """Worlds at these planar coordinates and velocities, one a row."""
    rows = np.atleast_2d(np.asarray(q, dtype=np.float32)).astype(float)
    speeds = np.broadcast_to(np.asarray(qd, dtype=np.float32).astype(float), rows.shape)
    sim, reference = MujocoCSimulation(config, len(rows), "cpu"), MujocoC(config)
    for world, data in enumerate(sim._data):
        reference.place(rows[world], speeds[world])
        data.qpos[:], data.qvel[:] = reference.data.qpos, reference.data.qvel
        sim._write_outputs(world)
    sim._write_velocities()
    return sim


def own_config(config, trial):
    return config.model_copy(
        update={key: getattr(trial, key) for key in ("friction", "hip_k", "ankle_k", "load", "load_at")}
    )


def torques(trial, name):
    """Hip and ankle of each control step [Nm], (STEPS, 2), as the trial says."""
    sway = np.random.default_rng([1, *name.encode()]).uniform(-1, 1, (STEPS, 2))
    return np.float32(trial.push + sway * trial.sway)


def steps(sim, pairs):
    """The outputs after each control step under these torques of hip and ankle: {name: (steps, ...)}, of world 0."""
    outputs = []
    for pair in pairs:
        sim.step(both_sides(pair).expand(sim.num_worlds, -1))
        outputs.append({name: value[0] for name, value in seen(sim).items()})
    return {name: np.stack([each[name] for each in outputs]) for name in OUTPUTS}


# -- against the references ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TRIALS)
def test_agrees_with_the_solver_driven_by_hand(either, name):
    """Up to the single precision of the outputs. The reference keeps MuJoCo's own limits of iterations, 100 and 50, so
    that the configured ones are seen to be enough."""
    trial = TRIALS[name]
    own, pairs = own_config(either, trial), torques(trial, name)
    found, reference, history = steps(set_out(own, trial.q, trial.qd), pairs), MujocoC(own), []
    reference.place(np.float32(trial.q).astype(float), np.float32(trial.qd).astype(float))
    for hip, ankle in pairs:
        reference.step([hip, ankle] * 2, either.solver.substeps)
        history.append(reference.read())
    for key in OUTPUTS:
        exact = np.stack([outputs[key] for outputs in history])
        assert found[key] == pytest.approx(exact, rel=1e-6, abs=5e-7), key


def test_agrees_with_the_solver_driven_by_hand_where_left_and_right_differ(either):
    """Twisting and stepping, so that no foot and no axis can be taken for another."""
    sim, reference = MujocoCSimulation(either, 1, "cpu"), MujocoC(either)
    rng, sideways = np.random.default_rng(0), []
    for _ in range(100):
        push = np.float32(rng.uniform(-20, 20, 4) * [1, 0.5, 1, 0.5])
        sim.step(torch.from_numpy(push)[None])
        reference.step(push, either.solver.substeps)
        exact = reference.read()
        for key in OUTPUTS:
            assert seen(sim)[key][0] == pytest.approx(exact[key], rel=1e-6, abs=1e-7), key
        sideways.append(exact["body_velocity"][0, [1, 3, 5]])
    assert np.abs(sideways).max(0).min() > 0.01  # [m/s], [rad/s], [rad/s]: it did leave the sagittal plane


@pytest.mark.parametrize(
    "name", ["flight", "swaying", "over the toe", "landing", "soft hips", "soft ankles", "loaded", "loaded behind"]
)
@pytest.mark.parametrize(("engine", "agrees"), [(SagittalSimulation, C_AGREES), (NewtonMujocoSimulation, NEWTON_AGREES)])
def test_agrees_with_the_other_engines(either, engine, agrees, name):
    trial = TRIALS[name]
    own, pairs = own_config(either, trial), torques(trial, name)
    ours = steps(set_out(own, trial.q, trial.qd), pairs)
    theirs = steps(placed(engine(own, 1, "cpu"), trial.q, trial.qd), pairs)
    found = deviation(theirs, ours)
    assert not {key: value for key, value in found.items() if value > agrees[key] * trial.rounding}


@pytest.mark.parametrize("other", ["sagittal", "mujoco"])
def test_starts_as_the_other_engines_do(config, other):
    ours, theirs = (simulate(config.model_copy(update={"physics": name}), 2, "cpu") for name in ("mujoco_c", other))
    assert isinstance(ours, MujocoCSimulation)
    for name in OUTPUTS:
        a, b = getattr(ours, name), getattr(theirs, name)
        assert a.dtype == b.dtype and torch.allclose(a, b, atol=2e-7, rtol=0), name
    assert ours.geometry.heel_x == theirs.geometry.heel_x and np.array_equal(ours.geometry.head, theirs.geometry.head)


# -- mechanics -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("load", [0.0, 4.0])
def test_standing_carries_the_weight(config, load):
    """With ankles stiff enough to come to rest, the ground carries m g right below the centre of mass; a load adds its."""
    firm = config.model_copy(update={"load": load, "hip_k": 400.0, "ankle_k": 400.0, "joint_damping": 60.0})
    sim, meter = MujocoCSimulation(firm, 1, "cpu"), Mechanics(firm)
    for _ in range(1000):
        sim.step(torch.zeros(1, 4))
    assert float(sim.joint_velocity.abs().max()) < 2e-6
    force, foot = sim.sole_force[0].double().numpy(), sim.body_pose[0, 2].double().numpy()
    assert force[..., 2].sum() == pytest.approx((MASS + load) * GRAVITY, rel=1e-6)
    assert force[0] == pytest.approx(force[1], abs=1e-4)
    place = foot[0] + turned(sim.sole_position[0, 0].double().numpy()[:, [0, 2]].T, 2 * foot[4])[:, 0]
    middle = meter.mass @ meter.places(sim)[:, 0] / meter.mass.sum()
    assert force[0, :, 2] @ place / force[0, :, 2].sum() == pytest.approx(middle, abs=1e-6)


def test_free_fall_by_hand(config):
    """Upright and still, the body falls by g t (t + dt) / 2, the sum of what semi-implicit Euler adds each step."""
    sim = set_out(config, above(5.0, 0, 0, 0))
    for _ in range(30):
        sim.step(torch.zeros(1, 4))
    time, dt = 30 * config.control_dt, config.control_dt / config.solver.substeps
    assert float(sim.body_pose[0, 0, 2]) == pytest.approx(6.286 - GRAVITY * time * (time + dt) / 2, abs=1e-6)
    assert float(sim.body_velocity[0, :, 2].mean()) == pytest.approx(-GRAVITY * time, rel=1e-6)
    assert float(sim.joint_angle.abs().max()) < 1e-6 and not bool(sim.sole_force.any())


def test_joint_force_by_hooke_and_the_damper(config):
    """Bent in the air: minus stiffness times angle, minus damping times speed, plus the torque, each joint its own."""
    one = config.model_copy(update={"solver": config.solver.model_copy(update={"substeps": 1})})
    # Pitches of HAT, leg and foot 0, -0.2, -0.1: hip -0.2 rad, ankle +0.1 rad; their rates 0.5 and -1 rad/s.
    sim = set_out(one, above(2.0, 0.0, -0.2, -0.1), (0, 0, 0, 0.5, -0.5))
    sim.step(torch.tensor([[1.0, 2.0, 3.0, 4.0]]))
    hip, ankle = 125.0 * 0.2 - 0.5, -25.0 * 0.1 + 1.0
    assert sim.joint_force[0].tolist() == pytest.approx([hip + 1.0, ankle + 2.0, hip + 3.0, ankle + 4.0], abs=1e-5)


def test_velocities_are_those_of_the_positions(config):
    """Of each body's centre of mass and attitude, by differences over a step of 10 us."""
    tiny = config.model_copy(update={"control_dt": 1e-5, "solver": config.solver.model_copy(update={"substeps": 1})})
    sim, dt = set_out(tiny, *(TRIALS["flight"].q, TRIALS["flight"].qd)), 1e-5
    places = []
    for _ in range(2):
        sim.step(torch.tensor([[20.0, -5.0, -10.0, 3.0]]))
        data = sim._data[0]  # in double precision, and placed by MuJoCo's kinematics
        places.append((data.xipos[1:].copy(), data.xmat[1:].reshape(-1, 3, 3).copy()))
    (before, attitude), (after, later) = places
    outputs = sim.body_velocity[0].numpy()
    assert outputs[:, :3] == pytest.approx((after - before) / dt, abs=2e-3)
    turn = (later - attitude) / dt @ attitude.transpose(0, 2, 1)  # the cross-product matrix of the angular velocity
    assert outputs[:, 3:] == pytest.approx(np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], -1), abs=2e-3)


# -- robustness ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1e30, math.inf, math.nan])
def test_a_world_that_mujoco_would_reset_has_diverged(config, size, tmp_path, monkeypatch, capfd):
    """It is marked and keeps its state, the other world is unchanged, and after a reset it is like a new one; MuJoCo's own
    warning and log file do not appear."""
    monkeypatch.chdir(tmp_path)
    sim, calm, fresh = (MujocoCSimulation(config, 2, "cpu") for _ in range(3))
    pushes = both_sides(20 * torch.randn(10, 2, 2))
    for push in pushes:
        sim.step(push)
        calm.step(push)
    before = seen(sim)
    sim.step(torch.stack([torch.full((4,), size), pushes[0, 1]]))
    calm.step(pushes[0])
    assert sim.diverged.tolist() == [True, False] and finite(sim)
    for name in OUTPUTS:
        assert np.array_equal(seen(sim)[name][0], before[name][0]), name
        assert torch.equal(getattr(sim, name)[1], getattr(calm, name)[1]), name
    sim.reset(torch.tensor([True, False]))
    assert not bool(sim.diverged.any())
    for push in pushes:
        for each in (sim, calm, fresh):
            each.step(push)
    for name in OUTPUTS:
        assert torch.equal(getattr(sim, name)[0], getattr(fresh, name)[0]), name
        assert torch.equal(getattr(sim, name)[1], getattr(calm, name)[1]), name
    assert not list(tmp_path.iterdir()) and capfd.readouterr().err == ""


def test_speeds_that_mujoco_calls_bad_have_diverged(config):
    sim = set_out(config, [FLAT, FLAT])
    sim._data[1].qvel[0] = 1e11
    sim.step(torch.zeros(2, 4))
    assert sim.diverged.tolist() == [False, True]


def test_dropped_contacts_are_an_error(config):
    """MuJoCo counts them in each world, and a reset clears its counter but not ours."""
    sim = MujocoCSimulation(config, 2, "cpu")
    sim.step(torch.zeros(2, 4))
    sim.check_capacity()
    sim._data[1].warning[mujoco.mjtWarning.mjWARN_CONTACTFULL].number = 1
    sim.step(torch.zeros(2, 4))
    sim.reset(torch.ones(2, dtype=torch.bool))
    with pytest.raises(ConstraintOverflowError, match="in 1 worlds"):
        sim.check_capacity()


# -- bookkeeping -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("device", ["cuda", "cuda:1"])
def test_another_device_than_the_cpu_is_refused(config, device):
    expected = f"^device: env.physics=mujoco_c computes only on the cpu, not on '{device}'$"
    with pytest.raises(ValueError, match=expected):
        MujocoCSimulation(config, 1, device)
    with pytest.raises(ConfigError, match=expected):
        compose("env.physics=mujoco_c", f"device={device}")
    with pytest.raises(ConfigError, match=expected):
        compose_eval("env.physics=mujoco_c", f"device={device}")
