"""Feet under a swinging body: how they creep in MuJoCo's contacts, and that they stay with the bias acceleration."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from envs.engines import mujoco_c
from envs.engines.contact_bias import bias_share, sole_contact, stiffness_and_damping
from envs.task.head_tracking import HeadTrackingEnv
from posture.evaluation.lqr_policy import LqrController
from posture.theory.optimum import bound
from posture.theory.stander import linearise
from tests.conftest import compose_eval
from tests.envs.engines.test_sagittal import modified

FREQ, SECONDS = 1.5, 12.0
LQR = compose_eval().lqr


def creep(body, solref=None, **solver):
    """Speed at which the left foot creeps forward [mm/s] while the model-based controller swings at 1.5 Hz.

    Contacts of MuJoCo's C engine with the time constant and damping ratio `solref`, if given. From two times at the same
    phase of the target, the later one at the end.
    """
    only_falls = LQR.env.termination.model_copy(update={"foot_motion": None, "head_tolerance": None})
    changes = {"physics": "mujoco_c", "num_envs": 1, "freq": FREQ, "episode_steps": 100_000, "termination": only_falls}
    env_config = modified(LQR.env.model_copy(update=changes), **solver)
    env = HeadTrackingEnv(env_config, 0, "cpu")
    for model in env.sim._models:
        if solref is not None:
            model.geom_solref[:] = solref
    motion = bound(linearise(body, env_config), FREQ, env_config.amplitude, 0.025 - LQR.tolerance_margin)
    policy = LqrController(env, [motion], LQR, SECONDS)
    place = []
    for _ in range(round(SECONDS / env_config.control_dt)):
        env.step(policy(env.get_observations()))
        place.append(float(env.state.foot_pose[0, 0, 0]))
    cycles = round(4.0 * FREQ)
    before = -1 - round(cycles / FREQ / env_config.control_dt)
    return 1e3 * (place[-1] - place[before]) / (cycles / FREQ)


def test_creep_in_mujoco_goes_with_one_over_the_damping_less_half_a_step(body):
    """The derivation's (1/B - h/2) J'v, with B from the time constant: stiffer contacts creep less, towards none."""
    step = LQR.env.control_dt / 16
    times = np.array([0.02, 0.01, 0.005])
    speeds = np.array([creep(body, (time, 1.0), contact_bias=False, substeps=16) for time in times])
    expected = 0.95 * times / 2 - step / 2
    assert speeds / speeds[0] == pytest.approx(expected / expected[0], abs=0.03)
    assert speeds[0] > 0.5 and speeds[-1] < 0.2


@pytest.mark.parametrize("substeps", [2, 8])
def test_feet_stay_with_the_bias_acceleration(body, substeps):
    """As in the limit of stiff contacts: less than a thirtieth of the creep without it."""
    assert abs(creep(body, contact_bias=True, substeps=substeps)) < 0.02 < 0.4 < creep(body, contact_bias=False)


def test_share_by_hand(config):
    """humanoid.xml has MuJoCo's default softness, time constant 0.02 s and dmax 0.95: B = 2 / (0.95 x 0.02 s) = 105.26 / s.
    In steps of 8.3 ms the share is 1 - 105.26 x 0.0083 / 2 = 0.5632."""
    model, _ = mujoco_c.build(config)
    assert bias_share(config, model) == pytest.approx(0.5632, abs=1e-4)
    assert bias_share(modified(config, substeps=16), model) == pytest.approx(1 - 105.263 * 0.0166 / 32, abs=1e-4)
    assert bias_share(modified(config, contact_bias=False), model) == 0.0
    solref, solimp, friction = sole_contact(model)
    assert stiffness_and_damping(solref, solimp, 0.0083) == pytest.approx((2770.08, 105.263), rel=1e-5)
    assert stiffness_and_damping(np.array([-900.0, -60.0]), solimp, 0.0083) == pytest.approx((900 / 0.95**2, 60 / 0.95))
    assert friction == config.friction


def test_creep_depends_on_the_root_of_the_tree_but_for_the_bias_acceleration():
    """A foot under a swinging pole. Mechanics does not depend on the coordinates; the creep in MuJoCo's contacts does."""
    creep_of_foot = runpy.run_path(str(Path(__file__).parents[3] / "benchmarks" / "contact_creep.py"))["creep"]
    pole, foot, corrected = (creep_of_foot(*case, 0.004) for case in (("pole", False), ("foot", False), ("pole", True)))
    assert pole - foot > 10.0
    assert corrected == pytest.approx(foot, abs=0.02)
