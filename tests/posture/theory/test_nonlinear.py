"""The exact two-link stander against MuJoCo's C solver, against the linear theory, and its optima against another solver."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import scipy.optimize

from envs.body.segments import read_segments
from posture.theory.nonlinear import (
    ExactMotion,
    ExactProgram,
    exact_bound,
    exact_reward_optimum,
    exact_stander,
)
from posture.theory.optimum import bound
from posture.theory.program import Program
from posture.theory.reward_optimum import best_for_reward
from tests.posture.theory.test_optimum import AMPLITUDE, TOLERANCE, cost, miss, reward
from tests.posture.theory.test_stander import ANKLE_X, Held


@pytest.fixture(scope="module")
def exact(config, body):
    """A function from a hip's stiffness [Nm/rad] to the exact stander, otherwise of the default configuration."""
    return lambda hip_k: exact_stander(body, config.model_copy(update={"hip_k": float(hip_k)}))


def along(motion, samples):
    """Times (T,) [s], angles, velocities, accelerations (T, 2)."""
    time = motion.cycle(samples)
    return time, motion.angle(time), motion.velocity(time), motion.acceleration(time)


# -- mechanics -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("forward", [0.0, 0.05])
def test_large_motion_as_in_mujoco(env_config, forward):
    """Inverse dynamics of the free body whose feet stay, where bend and lean reach 60 and 35 degrees: torques, head, and
    where the ground must push. Also with the trunk's mass well ahead of the hip."""
    config = env_config("env.load=1.5")
    held, body = Held(config), read_segments(config)
    held.model.body("hat").ipos[0] += forward
    stander = exact_stander(replace(body, hat_com=body.hat_com + [forward, 0.0]), config)
    motion = ExactMotion(stander, 0.7, np.array([[-0.4, -0.1], [-0.5 + 0.2j, 0.3 - 0.2j], [0.1j, -0.1]]))
    time, angles, velocities, accelerations = along(motion, 9)
    assert np.degrees(np.abs(angles).max(axis=0)) == pytest.approx([60, 35], abs=8)

    def state(angle, velocity, acceleration):
        """Velocity and acceleration of the whole body. The freedom to move changes with the pose."""
        step = 1e-3
        turn = (held.freedom(*(angle + step * velocity)) - held.freedom(*(angle - step * velocity))) / (2 * step)
        freedom = held.freedom(*angle)
        return freedom, freedom @ velocity, freedom @ acceleration + turn @ velocity

    torques, heads, pressed = motion.torque(time), motion.head(time), motion.cop(time)
    held.place(0.0, 0.0)
    upright = held.data.geom("head").xpos[0]
    for i, sample in enumerate(zip(angles, velocities, accelerations, strict=True)):
        freedom, held.data.qvel[:], held.data.qacc[:] = state(*sample)
        mujoco.mj_inverse(held.model, held.data)
        assert 2 * torques[i] == pytest.approx(freedom.T @ held.data.qfrc_inverse, abs=1e-5 * np.abs(torques).max())
        assert heads[i] == pytest.approx(held.data.geom("head").xpos[0] - upright, abs=1e-7)
        force, axes = held.data.qfrc_inverse[:3], np.zeros(9)
        mujoco.mju_quat2Mat(axes, held.data.qpos[3:7])
        moment = (axes.reshape(3, 3) @ held.data.qfrc_inverse[3:6])[1]
        x, z = held.data.qpos[[0, 2]]
        assert pressed[i] == pytest.approx(x - (moment + z * force[0]) / force[2] - ANKLE_X, abs=1e-5)


def test_slopes_upright_are_the_linear_stander(exact):
    """The program linearised about upright is the linear one, although the two are derived apart."""
    program, linear = (kind(exact(60), 0.9, AMPLITUDE, TOLERANCE) for kind in (ExactProgram, Program))
    program.linearise_about(np.zeros(program.head.shape[1]))
    assert program.torque == pytest.approx(linear.torque, abs=1e-12)
    assert program.torque_offset == pytest.approx(np.tile(linear.torque_offset, (len(program.head), 1)), abs=1e-12)
    assert program.head == pytest.approx(linear.head, abs=1e-12)
    assert program.target == pytest.approx(linear.target, abs=1e-12)
    assert program._limit.toarray() == pytest.approx(linear._limit.toarray(), abs=1e-9)
    assert program._bound == pytest.approx(linear._bound, abs=1e-9)


# -- optima ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("hip_k", "freq"), [(25, 0.3), (25, 1.5), (75, 0.36), (200, 0.9)])
def test_the_exact_limits_are_kept(exact, hip_k, freq):
    """With the softest hips, where the motion of the linear bound misses the target by a centimetre more; near a transition;
    and where the foot ends."""
    stander = exact(hip_k)
    motion = exact_bound(stander, freq, AMPLITUDE, TOLERANCE)
    assert TOLERANCE - 1e-5 < miss(motion).max() < TOLERANCE + 5e-5
    assert miss(ExactMotion(**vars(bound(stander, freq, AMPLITUDE, TOLERANCE)))).max() > TOLERANCE + 5e-4
    cop = motion.cop(motion.cycle(5000))
    assert stander.heel_x - 1e-4 < cop.min() and cop.max() < stander.toe_x + 1e-4
    assert (cop.max() > stander.toe_x - 1e-4) == (hip_k == 200)
    assert np.abs(motion.torque(motion.cycle())).max() < stander.torque_limit


@pytest.mark.parametrize("freq", [0.15, 1.5])
def test_small_motions_cost_what_the_linear_theory_says(exact, freq):
    """The difference, a third or more for the whole amplitude with soft hips, goes to zero with the amplitude."""
    stander = exact(25)

    def excess(share):
        task = freq, AMPLITUDE * share, TOLERANCE * share
        return cost(exact_bound(stander, *task)) / cost(bound(stander, *task)) - 1

    small, smaller = abs(excess(0.04)), abs(excess(0.02))
    assert excess(1.0) > 0.3
    assert small < 2e-3 and smaller < 0.6 * small + 5e-5


def brute_force(program, objective, start, scale):
    """Least `objective` of the motions of `program` within the exact limits at its samples: by scipy's SLSQP with slopes by
    differences, from the unknowns `start` (v,). scale: size of the objective."""
    stander, time = program.stander, np.arange(len(program.head)) / (len(program.head) * program.freq)
    target = AMPLITUDE * (1 - np.cos(2 * math.pi * program.freq * time))

    def room(x):
        motion = program.motion(x)
        off, cop = motion.head(time) - target, motion.cop(time)
        return 10 * np.concatenate([TOLERANCE - off, TOLERANCE + off, stander.toe_x - cop, cop - stander.heel_x])

    found = scipy.optimize.minimize(
        lambda x: objective(program.motion(x)) / scale,
        start,
        method="SLSQP",
        constraints={"type": "ineq", "fun": room},
        options={"maxiter": 500, "ftol": 1e-8},
    )
    assert room(found.x).min() > -1e-6
    return found.fun * scale


@pytest.mark.parametrize(("hip_k", "freq"), [(25, 0.3), (25, 1.5), (100, 0.5)])
def test_least_cost_against_another_solver(exact, hip_k, freq):
    """Three harmonics, from upright."""
    stander = exact(hip_k)
    program = ExactProgram(stander, freq, AMPLITUDE, TOLERANCE, harmonics=3, samples=24)
    least = cost(program.motion(program.least_torque()), 24)
    upright = np.zeros(program.head.shape[1])
    assert brute_force(program, lambda m: cost(m, 24), upright, least) == pytest.approx(least, rel=1e-3)


@pytest.mark.parametrize(("hip_k", "freq"), [(25, 1.5), (125, 0.7)])
def test_another_solver_does_not_improve_the_reward(exact, env_config, hip_k, freq):
    """From the motion found, and by more than one per cent of what its torques cost. That of least torque is not as good."""
    config = env_config("env.reward.energy_unit=authors_code")
    stander = exact(hip_k)
    program = ExactProgram(stander, freq, AMPLITUDE, TOLERANCE, harmonics=3, samples=24)
    least = program.least_torque()
    best = best_for_reward(program, config)
    top = reward(best, config)
    assert top > reward(program.motion(least), config)
    coefficients = best.coefficients
    start = np.concatenate([coefficients.real.ravel(), coefficients.imag[1:].ravel()])
    better = -brute_force(program, lambda m: -reward(m, config), start, abs(top))
    gamma = config.energy_weight
    assert top <= better + 1e-6 and better - top < 0.01 * gamma * cost(best)
    whole = exact_reward_optimum(stander, freq, config, TOLERANCE)
    assert miss(whole).max() < TOLERANCE + 1e-4 and reward(whole, config) > top - 1e-3 * abs(top)
