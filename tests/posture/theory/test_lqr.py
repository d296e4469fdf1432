"""The model-based controller: its gain, its reference and its plan."""

import numpy as np
import pytest

from posture.theory.lqr import gain, plan, reference
from posture.theory.nonlinear import exact_stander
from posture.theory.optimum import bound
from posture.theory.program import InfeasibleError
from tests.conftest import compose_eval

LQR = compose_eval().lqr
DT = LQR.env.control_dt


def simulate(stander, state, torque, steps):
    """(hip, ankle, their velocities) after a control step of constant torque: explicit steps of M q'' = 2 tau - D q' - K q,
    independent of the matrix exponential in the code."""
    q, v = state[:2].copy(), state[2:].copy()
    for _ in range(steps):
        v += DT / steps * np.linalg.solve(stander.mass, 2 * torque - stander.damping @ v - stander.stiffness @ q)
        q += DT / steps * v
    return np.concatenate([q, v])


def test_upright_is_unstable_and_stable_with_feedback(stander):
    """Eigenvalues of the sampled linear stander: one outside the unit circle without feedback, all inside with it."""
    g = gain(stander, DT, LQR)
    free = np.stack([simulate(stander, state, np.zeros(2), 500) for state in np.eye(4)], axis=1)
    held = np.stack([simulate(stander, state, -g @ state, 500) for state in np.eye(4)], axis=1)
    assert abs(np.linalg.eigvals(free)).max() > 1.0
    assert abs(np.linalg.eigvals(held)).max() < 1.0


def test_gain_is_optimal(stander):
    """No nearby gain has a lower quadratic cost: the sum over 400 steps from four random starts."""
    step = np.stack([simulate(stander, state, np.zeros(2), 50) for state in np.eye(4)], axis=1)
    push = np.stack([simulate(stander, np.zeros(4), torque, 50) for torque in np.eye(2)], axis=1)
    starts = (np.random.default_rng(0).normal(size=(4, 4)) * [0.01, 0.01, 0.1, 0.1]).T
    scale = 1 / np.array([[LQR.angle], [LQR.angle], [LQR.velocity], [LQR.velocity]])

    def cost(candidate):
        total, state = 0.0, starts
        for _ in range(400):
            torque = -candidate @ state
            total += np.sum((scale * state) ** 2) + np.sum((torque / LQR.torque) ** 2)
            state = step @ state + push @ torque
        return total

    g = gain(stander, DT, LQR)
    for direction in np.eye(8).reshape(8, 2, 4):
        for size in (-0.1, 0.1):
            assert cost(g * (1 + size * direction)) > cost(g)


def test_reference_starts_upright_and_becomes_the_motion(stander):
    motion = bound(stander, 0.5, 0.1, 0.025)
    time = np.linspace(0.0, 6.0, 6001)
    angle, velocity, torque = reference(motion, time, 3.0)
    assert angle[0].tolist() == [0.0, 0.0] and velocity[0].tolist() == [0.0, 0.0]
    late = time >= 3.0
    assert angle[late] == pytest.approx(motion.angle(time[late]), abs=1e-12)
    assert torque[late] == pytest.approx(motion.torque(time[late]), abs=1e-9)
    assert np.gradient(angle, time, axis=0)[1:-1] == pytest.approx(velocity[1:-1], abs=1e-4)
    acceleration = np.gradient(velocity, time, axis=0)
    moment = acceleration @ stander.mass.T + velocity @ stander.damping.T + angle @ stander.stiffness.T + stander.offset
    assert torque[5:-5] == pytest.approx(moment[5:-5] / 2, abs=0.05)


def test_the_plan_keeps_its_margins(body, config):
    exact = exact_stander(body, config)
    motion = plan(exact, 0.9, 0.1, 0.025, LQR)
    time = motion.cycle()
    target = 0.1 * (1 - np.cos(2 * np.pi * 0.9 * time))
    assert abs(motion.head(time) - target).max() < 0.025 - LQR.tolerance_margin + 1e-4
    heel, toe = exact.heel_x + LQR.foot_margin, exact.toe_x - LQR.foot_margin
    assert heel - 1e-4 < motion.cop(time).min() and motion.cop(time).max() < toe + 1e-4
    with pytest.raises(InfeasibleError):
        plan(exact, 0.5, 2.0, 0.025, LQR)
