"""The least-torque motions against brute force, against each other, and against the constraints."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st

from envs.task import rewards
from posture.analysis.coordination import torque_cost
from posture.theory.motion import PeriodicMotion, joint_arrays, motion_indices
from posture.theory.optimum import bound, cheapest_sinusoid, sinusoid
from posture.theory.program import InfeasibleError, Program
from posture.theory.reward_optimum import RewardTerms, reward_optimum, reward_terms

AMPLITUDE, TOLERANCE = 0.1, 0.025
FINE = 5000


def cost(motion, samples=FINE):
    return torque_cost(joint_arrays(motion, samples)[0], motion.stander.torque_limit)


def miss(motion):
    """Distance of the head from the target over a fine cycle [m]."""
    time = motion.cycle(FINE)
    return np.abs(motion.head(time) - AMPLITUDE * (1 - np.cos(2 * math.pi * motion.freq * time)))


def with_long_feet(stander):
    """The same body on very long feet."""
    return replace(stander, heel_x=-10.0, toe_x=10.0)


# -- closed form -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("damping", [(2.0, 2.0), (5.0, 30.0)])
@pytest.mark.parametrize("freq", [0.15, 0.68, 1.5])
def test_closed_form_against_brute_force(stander, freq, damping):
    """Time-domain torques of M q'' + D q' + K q + o, squared and averaged over a cycle, minimised numerically over what
    the head leaves free: offset, cosine and sine of the hip; the ankle follows from the head."""
    stander = replace(stander, damping=np.diag(damping))
    time = np.arange(400) / (400 * freq)
    w = 2 * math.pi * freq
    basis = np.stack([np.ones_like(time), np.cos(w * time), np.sin(w * time)])
    rate = w * np.stack([np.zeros_like(time), -np.sin(w * time), np.cos(w * time)])
    bend = -(w**2) * np.stack([np.zeros_like(time), basis[1], basis[2]])
    head = np.array([AMPLITUDE, -0.075, 0.0])

    def both(hip):
        return np.stack([hip, (head - stander.head[0] * hip) / stander.head[1]])

    def torques(hip):
        q = both(hip)
        moment = stander.mass @ q @ bend + stander.damping @ q @ rate + stander.stiffness @ q @ basis
        return (moment + stander.offset[:, None]) / 2

    found = scipy.optimize.minimize(lambda hip: np.mean(2 * np.sum(torques(hip) ** 2, axis=0)), np.zeros(3), tol=1e-12)
    motion = sinusoid(stander, freq, 0.075, AMPLITUDE)
    assert cost(motion) == pytest.approx(found.fun / stander.torque_limit**2, rel=1e-6)
    expected = (both(found.x) @ basis).T
    assert motion.angle(time) == pytest.approx(expected, abs=1e-5)
    assert motion.head(time) == pytest.approx(head @ basis, abs=1e-12)


@settings(max_examples=30, deadline=None)
@given(freq=st.floats(0.05, 1.5), amplitude=st.floats(0.01, 0.2), offset=st.floats(0.0, 0.2), angle=st.floats(0, 6.28))
def test_no_other_sinusoid_with_this_head_costs_less(stander, freq, amplitude, offset, angle):
    """Anything added that leaves the head where it is, in any phase, costs more. The shape of the wave is the same for
    every amplitude and offset."""
    motion = sinusoid(stander, freq, amplitude, offset)
    idle = np.array([stander.head[1], -stander.head[0]])
    for size in (1e-3, -1e-3):
        other = motion.coefficients + size * np.stack([idle, idle * np.exp(1j * angle)])
        assert cost(PeriodicMotion(stander, freq, other), 64) > cost(motion, 64)
    unit = sinusoid(stander, freq, 1.0, 0.0).coefficients[1]
    assert motion.coefficients[1] == pytest.approx(amplitude * unit)


# -- constrained optimum ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("freq", [0.15, 0.6, 0.75, 1.5])
def test_bound_costs_less_than_the_sinusoid_and_keeps_the_limits(stander, freq):
    motion = bound(stander, freq, AMPLITUDE, TOLERANCE)
    assert cost(motion) < 0.99 * cost(cheapest_sinusoid(stander, freq, AMPLITUDE, TOLERANCE))
    assert miss(motion).max() < TOLERANCE + 5e-5
    time = motion.cycle(FINE)
    assert stander.heel_x - 1e-4 < motion.cop(time).min() and motion.cop(time).max() < stander.toe_x + 1e-4
    assert np.abs(motion.torque(time)).max() < stander.torque_limit


@pytest.mark.parametrize("freq", [0.3, 1.2])
def test_bound_is_the_sinusoid_where_nothing_else_is_allowed(stander, freq):
    """One harmonic, hardly any tolerance, very long feet; for a body that needs torque to stand upright."""
    wide = replace(with_long_feet(stander), offset=np.array([4.0, -10.0]))
    program = Program(wide, freq, AMPLITUDE, 1e-6, harmonics=1)
    expected = sinusoid(wide, freq, AMPLITUDE, AMPLITUDE)
    motion = program.motion(program.least_torque())
    assert cost(motion) == pytest.approx(cost(expected), rel=1e-4)
    assert motion.coefficients == pytest.approx(expected.coefficients, abs=1e-4)


@pytest.mark.parametrize("freq", [0.15, 0.45, 0.9])
def test_bound_hardly_changes_with_twice_the_harmonics(stander, freq):
    fine = Program(stander, freq, AMPLITUDE, TOLERANCE, harmonics=24, samples=192)
    ratio = cost(bound(stander, freq, AMPLITUDE, TOLERANCE)) / cost(fine.motion(fine.least_torque()))
    assert 0.9995 < ratio < 1.001


def test_bound_against_another_solver(stander):
    """Two harmonics, the same sampled limits written out in time, minimised by scipy's SLSQP."""
    freq, n, samples = 0.5, 2, 24
    time = np.arange(samples) / (samples * freq)
    target = AMPLITUDE * (1 - np.cos(2 * math.pi * freq * time))

    def motion(x):
        q = x.reshape(-1, 2)
        return PeriodicMotion(stander, freq, q[: n + 1] + 1j * np.vstack([np.zeros((1, 2)), q[n + 1 :]]))

    def room(x):
        m = motion(x)
        off, cop = m.head(time) - target, m.cop(time)
        return np.concatenate([TOLERANCE - off, TOLERANCE + off, stander.toe_x - cop, cop - stander.heel_x])

    found = scipy.optimize.minimize(
        lambda x: 1e2 * np.mean(2 * np.sum((motion(x).torque(time) / 100) ** 2, axis=1)),
        np.zeros(2 * (2 * n + 1)),
        method="SLSQP",
        constraints={"type": "ineq", "fun": room},
        options={"maxiter": 500, "ftol": 1e-9},
    )
    assert found.success
    program = Program(stander, freq, AMPLITUDE, TOLERANCE, harmonics=n, samples=samples)
    assert cost(program.motion(program.least_torque())) == pytest.approx(found.fun / 1e2, rel=1e-3)


def test_a_shorter_foot_or_weaker_joints_bind_and_cost_more(stander):
    free = bound(stander, 0.6, AMPLITUDE, TOLERANCE)
    short = replace(stander, toe_x=motion_indices(free, 100.0).cop_max_m - 0.03)
    held = bound(short, 0.6, AMPLITUDE, TOLERANCE)
    assert motion_indices(held, 100.0).cop_max_m == pytest.approx(short.toe_x, abs=1e-4)
    assert cost(held) > 1.01 * cost(free)
    weak = replace(stander, torque_limit=0.9 * np.abs(free.torque(free.cycle())).max())
    held = bound(weak, 0.6, AMPLITUDE, TOLERANCE)
    assert np.abs(held.torque(held.cycle())).max() == pytest.approx(weak.torque_limit, rel=2e-3)


@settings(max_examples=8, deadline=None)
@given(freq=st.floats(0.1, 1.5), smaller=st.floats(0.005, 0.02), wider=st.floats(0.03, 0.06))
def test_wider_limits_never_cost_more(stander, freq, smaller, wider):
    """Along the tolerance, and along the length of the foot."""
    costs = [cost(bound(stander, freq, AMPLITUDE, tolerance), 500) for tolerance in (smaller, TOLERANCE, wider)]
    assert costs[0] >= costs[1] * (1 - 1e-4) and costs[1] >= costs[2] * (1 - 1e-4)
    assert cost(bound(with_long_feet(stander), freq, AMPLITUDE, smaller), 500) <= costs[0] * (1 + 1e-4)


@pytest.mark.parametrize("change", [{"toe_x": 0.003, "heel_x": 0.001, "torque_limit": 30.0}, {"torque_limit": 2.0}])
def test_a_motion_that_cannot_be_made_is_named_in_one_line(stander, change):
    with pytest.raises(
        InfeasibleError, match=r"^head motion of 0.1 m within 0.025 m at 0.6 Hz: cannot be met .* Nm a joint$"
    ):
        bound(replace(stander, **change), 0.6, AMPLITUDE, TOLERANCE)


# -- indices -----------------------------------------------------------------------------------------------------------


def test_indices_of_a_sinusoid_by_hand(stander):
    """q = (a cos, b sin) with an offset: ranges 2 |amplitude|, no correlation, a quarter turn of phase."""
    motion = PeriodicMotion(stander, 0.5, np.array([[0.3, -0.1], [0.2, -0.05j]]))  # Re(-i b e^iwt) = b sin
    found = motion_indices(motion, 100.0)
    assert found.hip_range_deg == pytest.approx(math.degrees(0.4)) and found.ankle_range_deg == pytest.approx(
        math.degrees(0.1)
    )
    assert found.hip_ankle_r == pytest.approx(0.0, abs=1e-9)
    assert found.phase_mean_deg == pytest.approx(90.0)
    w = 2 * math.pi * 0.5
    head = 0.2 * stander.head[0] * np.cos(w * motion.cycle()) + 0.05 * stander.head[1] * np.sin(w * motion.cycle())
    assert found.target_head_r == pytest.approx(np.corrcoef(head, -np.cos(w * motion.cycle()))[0, 1])
    assert found.head_speed_mps == pytest.approx(4 * found.head_amplitude_m * 0.5, rel=1e-4)
    amplitudes = (stander.stiffness - w**2 * stander.mass + 1j * w * stander.damping) @ motion.coefficients[1] / 2
    still = (stander.stiffness @ motion.coefficients[0].real + stander.offset) / 2
    assert found.cost == pytest.approx(2 * (still @ still + np.vdot(amplitudes, amplitudes).real / 2) / 100**2)
    # Energy by the trapezoid rule over 50 cycles of |tau omega|.
    time = np.linspace(0, 2.0, 20001)
    power = np.abs(motion.torque(time) * motion.velocity(time)).sum(axis=1)
    assert found.energy_j == pytest.approx(50 * 2 * np.trapezoid(power, time), rel=1e-4)

    oblique = PeriodicMotion(stander, 0.5, np.array([[0, 0], [0.2, 0.1 + 0.1j]]))  # cos(45 deg)
    assert motion_indices(oblique, 100.0).hip_ankle_r == pytest.approx(math.sqrt(0.5))
    still = motion_indices(PeriodicMotion(stander, 0.5, np.array([[0.1, 0.0], [0.1, 0.0]], dtype=complex)), 100.0)
    assert math.isnan(still.hip_ankle_r) and math.isnan(still.phase_mean_deg)


# -- the configured reward ---------------------------------------------------------------------------------------------


def reward(motion, config):
    """The part of a control step's mean reward that depends on the motion, as in envs/task/head_tracking.py;
    positive."""
    time = motion.cycle(960)
    terms = config.reward
    torque, velocity = joint_arrays(motion, 960)
    off = motion.head(time) - AMPLITUDE * (1 - np.cos(2 * math.pi * motion.freq * time))
    energy = -0.1 * abs(torque / config.torque_limit * velocity).sum(axis=1)
    if terms.as_run:
        hip, ankle = velocity[:, 0], velocity[:, 1]
        force = torque[:, 0] - config.hip_k * motion.angle(time)[:, 0] - config.joint_damping * hip
        hip_torque, ankle_torque = (torque / config.torque_limit)[:, :2].T
        energy = -(0.2 * abs(hip_torque * ankle) + 0.1 * abs(ankle_torque * hip) + 0.01 * abs(ankle_torque * force))
    effort = rewards.torque_squared(torque / config.torque_limit)
    gain = rewards.weight(config.energy_weight) * (energy + effort)
    if terms.as_run:
        return float(gain.mean())
    return float((gain + rewards.weight(terms.target_weight) * rewards.closeness(off, terms.target_sharpness)).mean())


@pytest.mark.parametrize("env", ["authors_code", "authors_code_as_run"])
@pytest.mark.parametrize("freq", [0.3, 0.72, 1.2])
def test_no_allowed_step_improves_the_reward_optimum(stander, env_config, freq, env):
    """Random steps towards other allowed motions lower the reward, within the accuracy of the iteration. The limits are
    convex, so all motions between two allowed ones are allowed."""
    config = env_config(f"env={env}")
    best = reward_optimum(stander, freq, config, TOLERANCE)
    assert miss(best).max() < TOLERANCE + 1e-4
    top = reward(best, config)
    start = bound(stander, freq, AMPLITUDE, TOLERANCE)
    assert top > reward(start, config) + 1e-4
    rng = np.random.default_rng(0)
    program = Program(stander, freq, AMPLITUDE, TOLERANCE)
    for _ in range(20):
        rows = program.torque.reshape(-1, program.torque.shape[-1])
        anywhere = program.motion(program.least_squares(rows, rng.normal(0, 0.3, len(rows))))
        for share in (0.01, 0.1):
            between = (1 - share) * best.coefficients + share * anywhere.coefficients
            assert reward(PeriodicMotion(stander, freq, between), config) < top + 1e-3 * abs(top)


@pytest.mark.parametrize("unit", ["normalised", "authors", "si"])
def test_reward_terms_read_the_configuration(env_config, stander, unit):
    """Hand arithmetic: in SI units a squared torque is 100^2 times the normalised one, and |tau omega| dt is
    100 x 0.0166 |a omega|; normalised, |a omega| counts dt, in the authors' code a tenth. gamma is 20."""
    authors = ["env.reward.energy_unit=authors_code"]
    si = ["env.reward.torque_unit=newton_metre", "env.reward.energy_unit=joule"]
    units = {"normalised": [], "authors": authors, "si": si}
    config = env_config("env.reward.target_sharpness=7", *units[unit])
    terms = RewardTerms.of(config)
    effort = 1e4 if unit == "si" else 1.0
    assert terms.energy == pytest.approx({"normalised": 0.0166, "authors": 0.1, "si": 1.66 / 1e4}[unit])
    final = config.reward.target_weight.end
    assert terms.target == pytest.approx(final / (20.0 * effort)) and terms.sharpness == 7.0
    motion = cheapest_sinusoid(stander, 0.9, AMPLITUDE, TOLERANCE)
    energy, torque = reward_terms(motion, config)
    assert torque == pytest.approx(-effort * cost(motion))
    spent = motion_indices(motion, 100.0).energy_j
    assert energy == pytest.approx(
        -spent / 100.0 * {"normalised": 0.0166 / 100, "authors": 0.1 / 100, "si": 0.0166}[unit], rel=1e-3
    )


def test_a_reward_without_weight_on_torques_prefers_no_motion(stander, config):
    free = config.model_copy(update={"energy_weight": 0.0})
    with pytest.raises(ValueError, match="energy_weight is 0"):
        reward_optimum(stander, 0.5, free, TOLERANCE)
