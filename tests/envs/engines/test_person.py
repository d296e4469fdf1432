"""A person's body in the three engines, against MuJoCo's C solver driven by hand."""

import numpy as np
import pytest

from envs.body.anthropometry import anatomy
from envs.engines.mujoco_c import MujocoCSimulation
from envs.engines.newton_mujoco import NewtonMujocoSimulation
from envs.engines.sagittal import SagittalSimulation
from tests.envs.engines.test_mujoco_c import set_out
from tests.envs.engines.test_sagittal import C_AGREES, NEWTON_AGREES, OUTPUTS, STEPS, both_sides, deviation, placed, seen
from tests.mujoco_c import MujocoC


@pytest.fixture(scope="module", params=["female", "male"])
def config(env_config, request):
    height = {"female": 1.62, "male": 1.84}[request.param]
    return env_config("env/body=anthropometric", f"env.body.sex={request.param}", f"env.body.height={height}")


@pytest.fixture(scope="module", params=["in the air", "on the ground"])
def reference(config, request):
    """A start, torques of hip and ankle [Nm] of each step, and the outputs of the solver driven by hand."""
    shoulder = anatomy(config.body).shoulder
    if request.param == "in the air":
        start = [0.0, shoulder + 1.0, 0.2, -0.1, 0.1], [0.5, 1.0, 2.0, -1.0, 3.0]
    else:  # pressed a little into the ground: at a bare touch rounding would decide whether there is a contact
        start = [0.0, shoulder - 5e-4, 0.0, 0.0, 0.0], [0.0] * 5
    start = tuple(np.float32(values).astype(float) for values in start)
    torques = np.float32(np.random.default_rng(2).uniform(-1, 1, (STEPS, 2)) * [30, 16])
    solver, history = MujocoC(config), []
    solver.place(*start)
    for hip, ankle in torques:
        solver.step([hip, ankle] * 2, config.solver.substeps)
        history.append(solver.read())
    exact = {key: np.stack([outputs[key] for outputs in history]) for key in OUTPUTS}
    assert bool(exact["sole_force"].any()) == (request.param == "on the ground")
    assert np.ptp(exact["joint_angle"], axis=0).min() > 0.04
    return start, torques, exact


@pytest.mark.parametrize("engine", [SagittalSimulation, NewtonMujocoSimulation, MujocoCSimulation])
def test_every_engine_moves_the_same_person(config, reference, engine):
    """Twice as much as for the paper's body, of half the mass, in force and torque."""
    (q, qd), torques, exact = reference
    sim = set_out(config, q, qd) if engine is MujocoCSimulation else placed(engine(config, 1, "cpu"), q, qd)
    history = []
    for pair in torques:
        sim.step(both_sides(pair)[None])
        history.append({name: value[0] for name, value in seen(sim).items()})
    found = deviation({key: np.stack([outputs[key] for outputs in history]) for key in OUTPUTS}, exact)
    allowed = NEWTON_AGREES if engine is NewtonMujocoSimulation else C_AGREES
    assert not {key: value for key, value in found.items() if value > 2 * allowed[key]}


def test_every_engine_starts_upright_on_the_ground(config):
    for engine in (SagittalSimulation, NewtonMujocoSimulation, MujocoCSimulation):
        sim = engine(config, 1, "cpu")
        assert float(sim.body_pose[0, 0, 2]) == pytest.approx(anatomy(config.body).shoulder, abs=1e-6)
        assert not bool(sim.joint_angle.any()) and not bool(sim.body_velocity.any())
        for _ in range(30):  # half a second, in which the springs hold it nearly upright
            sim.step(both_sides([[0.0, 0.0]]))
        assert float(sim.sole_force[0, ..., 2].sum()) == pytest.approx(config.body.mass * 9.81, rel=0.02)
        assert float(sim.body_pose[0, 2::2, 2].max()) < anatomy(config.body).ankle
