"""Indices of motions whose phase, amplitude, noise, drift, energy and cost are known by hand; falls."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from envs.body.joints import ANKLES, HIPS
from posture.analysis.coordination import (
    circular_mean_sd,
    cop_percentiles,
    correlation,
    cycle_amplitude,
    cycle_components,
    cycle_phases,
    cycles,
    energy,
    mode,
    relative_phase_paper,
    sign_change_frequency,
    torque_cost,
)
from posture.analysis.results import Result, as_row
from posture.analysis.trajectory import Trajectory
from tests.posture.analysis.trials import DT, STEPS, TIME, angle_difference, measured, trial, wave

frequencies = st.floats(0.05, 1.5)
phases = st.floats(-3.1, 3.1)
# Periods of a whole number of samples of which a whole number fits into 100 s and into 90 s: hand arithmetic is exact.
periods = st.sampled_from([40, 50, 60, 120, 300, 600])
seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=30, deadline=None)

COORDINATION = ("hip_ankle_r", "relative_phase_paper_rad", "relative_phase_deg", "phase_mean_deg", "phase_sd_deg")


def row(trajectory: Trajectory, **changes: float) -> Result:
    return measured(trajectory, **changes)[0]


def mean_phase(hip: np.ndarray, ankle: np.ndarray, freq: float) -> float:
    return circular_mean_sd(cycle_phases(hip, ankle, TIME, freq, cycles(TIME, freq, 10.0), still=0.0))[0]


# --- correlation and mode


@few
@given(periods, phases, st.floats(-5, 5), st.floats(0.1, 10), st.floats(0.0, 0.5), seeds)
def test_correlation_is_the_cosine_of_the_phase(period, phase, offset, scale, noise, seed):
    """Unit sinusoids have the variance 1/2. White noise of variance s^2 on both: r = cos(phase) / (1 + 2 s^2), within five
    standard errors of 6000 samples."""
    drawn = noise * np.random.default_rng(seed).normal(size=(2, STEPS))
    a, b = wave(1 / (period * DT), phase) + drawn[0], wave(1 / (period * DT)) + drawn[1]
    expected = pytest.approx(math.cos(phase) / (1 + 2 * noise**2), abs=10 * noise / math.sqrt(STEPS) + 1e-9)
    assert correlation(a, b) == expected
    assert correlation(scale * a + offset, b) == expected
    assert -correlation(-a, b) == expected


def test_correlation_by_hand():
    # Deviations (-1, 0, 1) and (-4/3, 5/3, -1/3): product 1, squares 2 and 42/9; 1 / sqrt(28/3) = 0.32733.
    assert correlation(np.array([1.0, 2, 3]), np.array([1.0, 4, 2])) == pytest.approx(0.3273268)
    assert math.isnan(correlation(np.full(STEPS, 0.1), wave(0.5)))


@pytest.mark.parametrize(
    ("r", "name"), [(0.2, "in-phase"), (-0.2, "anti-phase"), (0.0, "undefined"), (math.nan, "undefined")]
)
def test_mode_is_the_sign(r, name):
    assert mode(r) == name


# --- cycles


@pytest.mark.parametrize(
    ("freq", "transient", "count", "first", "end"),
    [
        (0.5, 10.0, 45, 600, 6000),  # 120 samples a cycle; 90 s hold 45
        (0.15, 10.0, 13, 600, 5800),  # 400 samples; 90 s hold 13.5, and the last 200 samples belong to no cycle
        (0.011, 10.0, 0, None, None),  # 90.9 s a cycle
        (0.5, 200.0, 0, None, None),  # longer than the trial
        (math.nan, 10.0, 0, None, None),  # a ramp
    ],
)
def test_cycles_by_hand(freq, transient, count, first, end):
    parts = cycles(TIME, freq, transient)
    assert len(parts) == count
    if parts:
        assert (parts[0].start, parts[-1].stop) == (first, end)


@given(frequencies)
def test_cycles_follow_each_other_and_last_a_period(freq):
    parts = cycles(TIME, freq, 10.0)
    assert len(parts) in (math.floor(90 * freq), math.floor((90 + DT) * freq))
    assert all(a.stop == b.start for a, b in zip(parts, parts[1:], strict=False))
    assert all(abs((p.stop - p.start) * DT - 1 / freq) < 1.01 * DT for p in parts)


# --- relative phase


@few
@given(frequencies, phases)
def test_paper_phase_is_half_the_usual_one(freq, phase):
    parts = cycles(TIME, freq, 10.0)
    found = relative_phase_paper(wave(freq, phase) - 3, 2 * wave(freq) + 1, TIME, freq, parts)
    # Each of the two maxima is read to the nearest sample: at most one sample between them.
    assert found == pytest.approx(abs(phase) / 2, abs=1.01 * DT * freq * math.pi)


@pytest.mark.parametrize("lag", [0, 3, -3, 17, 30])
def test_paper_phase_by_hand(lag):
    """|t0 - t1| f pi of a lag of k samples in a period of 60: pi k / 60, also where the maxima straddle a cycle's edge."""
    hip, ankle = wave(1.0, 2 * math.pi * lag / 60), wave(1.0)
    found = relative_phase_paper(hip, ankle, TIME, 1.0, cycles(TIME, 1.0, 10.0))
    assert found == pytest.approx(math.pi * abs(lag) / 60)


def test_paper_phase_is_averaged_over_cycles():
    # 1 Hz, two cycles of 60 samples, maxima 6 and 12 samples apart: (6 + 12) / 2 / 60 of a period, times pi.
    hip, ankle = np.zeros(120), np.zeros(120)
    ankle[[20, 80]] = 1
    hip[[26, 68]] = 1
    found = relative_phase_paper(hip, ankle, TIME[:120], 1.0, [slice(0, 60), slice(60, 120)])
    assert found == pytest.approx(9 / 60 * math.pi)


@few
@given(frequencies, phases, st.floats(0.1, 10), st.floats(-5, 5))
def test_component_recovers_amplitude_and_phase(freq, phase, amplitude, offset):
    parts = cycles(TIME, freq, 10.0)
    found = cycle_components(amplitude * wave(freq, phase) + offset, TIME, freq, parts)
    np.testing.assert_allclose(found, np.full(len(parts), amplitude * np.exp(1j * phase)), rtol=1e-7)


@few
@given(frequencies, phases)
def test_phase_is_positive_where_the_hip_leads(freq, phase):
    hip, ankle = wave(freq, phase), wave(freq)
    for a, b, expected in [(hip, ankle, phase), (ankle, hip, -phase), (-hip, ankle, phase + math.pi)]:
        mean, sd = circular_mean_sd(cycle_phases(a, b, TIME, freq, cycles(TIME, freq, 10.0), still=0.0))
        assert angle_difference(mean, math.degrees(expected)) < 1e-5 and sd < 1e-3


@few
@given(periods, phases, st.floats(0.0, 0.3), seeds)
def test_noise_does_not_bias_the_phase(period, phase, noise, seed):
    """Fitted over M samples, the phase of a unit sinusoid has the standard error s sqrt(2 / M); there are two of them."""
    freq, drawn = 1 / (period * DT), noise * np.random.default_rng(seed).normal(size=(2, STEPS))
    found = mean_phase(wave(freq, phase) + drawn[0], wave(freq) + drawn[1], freq)
    error = math.degrees(noise * math.sqrt(4 / (len(cycles(TIME, freq, 10.0)) * period)))
    assert angle_difference(found, math.degrees(phase)) < 6 * error + 1e-6


@few
@given(periods, phases, st.floats(-0.02, 0.02), st.floats(0.5, 2.0))
def test_drift_hardly_changes_phase_and_amplitude(period, phase, drift, amplitude):
    """A drift of d a second moves a cycle's Fourier component by d T / pi at most, T its period, and its peak-to-peak value
    by d T at most."""
    freq = 1 / (period * DT)
    hip = amplitude * wave(freq, phase) + drift * TIME
    shift = abs(drift) / freq / math.pi / amplitude
    limit = math.degrees(math.asin(min(1.0, 1.05 * shift))) + 1e-4
    assert angle_difference(mean_phase(hip, wave(freq), freq), math.degrees(phase)) < limit
    allowed = abs(drift) / freq / 2 + amplitude * (1 - math.cos(math.pi / period)) + 1e-9
    assert abs(cycle_amplitude(hip, cycles(TIME, freq, 10.0)) - amplitude) <= allowed


def test_harmonics_do_not_move_the_phase():
    # 0.5 Hz has 120 samples a cycle, over which the harmonics are orthogonal to the fundamental.
    hip = wave(0.5, 0.7) + 0.4 * wave(1.0, 0.3) + 0.2 * wave(1.5, 2.0)
    assert mean_phase(hip, wave(0.5), 0.5) == pytest.approx(math.degrees(0.7), abs=1e-8)


def test_phase_of_a_still_joint_is_undefined():
    # Peak-to-peak 0.2: above a threshold of 0.19, below one of 0.21, whichever joint it is.
    parts = cycles(TIME, 0.5, 10.0)
    small, large = 0.1 * wave(0.5), wave(0.5)
    for a, b in [(small, large), (large, small)]:
        assert np.isfinite(cycle_phases(a, b, TIME, 0.5, parts, still=0.19)).all()
        assert np.isnan(cycle_phases(a, b, TIME, 0.5, parts, still=0.21)).all()


@few
@given(periods, phases, st.data())
def test_cycles_without_motion_are_left_out_of_the_phase(period, phase, data):
    freq = 1 / (period * DT)
    parts = cycles(TIME, freq, 10.0)
    still = data.draw(st.sets(st.integers(0, len(parts) - 1), max_size=len(parts)))
    hip = wave(freq, phase)
    for i in still:
        hip[parts[i]] = 0.3
    found = cycle_phases(hip, wave(freq), TIME, freq, parts, still=0.5)
    assert set(np.flatnonzero(np.isnan(found))) == still
    mean, _ = circular_mean_sd(found)
    assert math.isnan(mean) if len(still) == len(parts) else angle_difference(mean, math.degrees(phase)) < 1e-6


@pytest.mark.parametrize(
    ("angles", "mean", "sd"),
    [
        # 10 deg on either side of 180: R = cos(10 deg) = 0.9848078, sd = sqrt(-2 ln R) = 0.174979 rad = 10.0256 deg.
        ([170.0, -170.0, math.nan], 180.0, 10.0256),
        ([-100.0, -80.0], -90.0, 10.0256),
        ([40.0], 40.0, math.nan),
        ([math.nan], math.nan, math.nan),
    ],
)
def test_circular_mean_and_deviation_by_hand(angles, mean, sd):
    found = circular_mean_sd(np.array(angles))
    assert math.isnan(mean) if math.isnan(found[0]) else angle_difference(found[0], mean) < 1e-9
    assert not found[0] < -180 and not found[0] > 180
    assert found[1] == pytest.approx(sd, abs=1e-4, nan_ok=True)


# --- amplitude, energy, cost, centre of pressure


def test_amplitude_is_half_the_peak_to_peak_averaged_over_cycles():
    # Peak-to-peak 2 and 6 in the two cycles: (2 + 6) / 2 / 2 = 2. Over the whole it would be 8 / 2 = 4.
    signal = np.array([0.0, 2, 1, 8, 2, 3, 99])
    assert cycle_amplitude(signal, [slice(0, 3), slice(3, 6)]) == 2
    assert math.isnan(cycle_amplitude(signal, []))


def test_energy_counts_both_signs():
    # 2 steps of 0.5 s: |10 x 2| + |-3 x 4| = 32 W, then |1 x -1| + |0 x 9| = 1 W; 33 x 0.5 = 16.5 J.
    assert energy(np.array([[10.0, -3], [1, 0]]), np.array([[2.0, 4], [-1, 9]]), 0.5) == 16.5
    # tau = 20 cos, omega = 3 cos at 0.5 Hz over 100 s: |tau omega| has the mean 60 / 2, so 3000 J.
    assert energy(20 * wave(0.5)[:, None], 3 * wave(0.5)[:, None], DT) == pytest.approx(3000)


def test_cost_sums_joints_and_averages_time():
    # Limit 50: 4 x (25/50)^2 = 1, then 4 x 0 = 0; mean 0.5.
    assert torque_cost(np.array([[25.0, -25, 25, -25], [0, 0, 0, 0]]), 50.0) == 0.5


def test_percentiles_leave_out_steps_without_load():
    # 0, 1 .. 100 mm: the p-th percentile is p mm.
    cop = np.append(np.arange(101) * 1e-3, [math.nan] * 50)
    np.testing.assert_allclose(cop_percentiles(cop), [0.005, 0.025, 0.05, 0.075, 0.095])
    assert np.isnan(cop_percentiles(np.full(4, math.nan))).all()


# --- frequency of a sign change


@pytest.mark.parametrize(
    ("freq", "r", "expected"),
    [
        # From 0.6 at 0.6 Hz to -0.2 at 0.8 Hz: zero after 0.6 / 0.8 of the way. The order does not matter.
        ([0.8, 0.4, 0.6], [-0.2, 0.9, 0.6], 0.75),
        ([1, 2, 3, 4], [1, -1, 1, -1], 1.5),  # the first of several
        ([1, 2, 4], [1, 0, -1], 2),
        ([1, 2.5, 3], [1, math.nan, -1], 2),  # a fall widens the bracket
    ],
)
def test_sign_change_by_hand(freq, r, expected):
    assert sign_change_frequency(freq, r) == pytest.approx(expected)


@given(st.floats(0.1, 1.4), st.floats(0.1, 5), st.sampled_from([-1, 1]))
def test_sign_change_of_a_straight_line(zero, slope, sign):
    f = np.linspace(0.05, 1.5, 20)
    assert sign_change_frequency(f, sign * slope * (zero - f)) == pytest.approx(zero)


@pytest.mark.parametrize("r", [[], [1.0], [0.5, 0.2], [-0.5, -0.2], [1, 0, 1], [math.nan] * 2, [0.0, 0.0]])
def test_no_sign_change(r):
    assert sign_change_frequency(list(range(len(r))), r) is None


def test_sign_change_refuses_arrays_of_different_length():
    with pytest.raises(ValueError, match="both must be"):
        sign_change_frequency([1, 2], [1, 2, 3])


# --- the result of one world


@pytest.mark.parametrize(("phase", "name"), [(0.0, "in-phase"), (math.pi, "anti-phase"), (2.0, "anti-phase")])
@pytest.mark.parametrize("freq", [0.15, 0.75, 1.47])  # 15, 75 and 147 cycles in 100 s; 0.15 and 1.47 not in 90 s
def test_coordination_of_a_trial(freq, phase, name):
    found = row(trial(freq, phase))
    assert (found.mode, found.valid, found.fell) == (name, True, False)
    assert found.cycles == math.floor(90 * freq + 1e-9)
    assert found.hip_ankle_r == pytest.approx(math.cos(phase), abs=1e-3)
    resolution = 1.01 * DT * freq * math.pi
    assert found.relative_phase_paper_rad == pytest.approx(phase / 2, abs=resolution)
    assert found.relative_phase_deg == pytest.approx(math.degrees(phase), abs=math.degrees(2 * resolution))
    assert angle_difference(found.phase_mean_deg, math.degrees(phase)) < 1e-5
    assert found.phase_sd_deg < 1e-3
    # Peak-to-peak 2 x 3 deg and 2 x 1.5 deg.
    assert (found.hip_range_deg, found.ankle_range_deg) == pytest.approx((6, 3), rel=2e-3)


def test_tracking_of_a_trial():
    # The head moves 0.08 m where the target moves 0.1 m, about the same middle: the error is 0.02 |cos|, mean
    # 0.02 x 2/pi, rms 0.02 / sqrt(2). |cos| > 1/2 for 2/3 of the time. Mean speed of a sinusoid: 4 A f.
    head = 0.1 - 0.08 * wave(0.5)[:, None]
    speed = 0.08 * math.pi * np.sin(math.pi * TIME)[:, None]
    found = row(trial(0.5, head_x=head, head_vx=speed), tolerance_m=0.0100001)
    assert found.target_head_r == pytest.approx(1)
    assert found.head_amplitude_m == pytest.approx(0.08)
    assert found.head_speed_mps == pytest.approx(4 * 0.08 * 0.5, rel=1e-3)
    assert found.tracking_error_mean_mm == pytest.approx(20 * 2 / math.pi, rel=1e-3)
    assert found.tracking_error_rms_mm == pytest.approx(20 / math.sqrt(2))
    assert found.beyond_tolerance_share == pytest.approx(2 / 3, abs=2 / 120)  # to a sample at each edge


def test_correlation_of_a_late_and_of_a_still_head():
    assert row(trial(0.5, head_x=0.1 - 0.1 * wave(0.5, -0.3)[:, None])).target_head_r == pytest.approx(math.cos(0.3))
    still = row(trial(0.5, head_x=np.full((STEPS, 1), 0.1)))
    assert math.isnan(still.target_head_r) and still.head_amplitude_m == 0.0


def test_effort_of_a_trial():
    # Hips 50 Nm, ankles 20 Nm, limit 100 Nm: 2 x 0.25 + 2 x 0.04 = 0.58. Hips at 1 rad/s, ankles at -2 rad/s:
    # 2 x 50 + 2 x 40 = 180 W for 100 s. The torques never change, so their range is 0.
    torque = np.broadcast_to([50.0, 20, 50, 20], (STEPS, 1, 4))
    velocity = np.broadcast_to([1.0, -2, 1, -2], (STEPS, 1, 4))
    found = row(trial(0.5, joint_torque=torque, joint_velocity=velocity))
    assert (found.cost, found.energy_j) == pytest.approx((0.58, 18000))
    assert found.hip_torque_range_nm == found.ankle_torque_range_nm == 0


def test_torque_ranges_are_those_of_the_mean_of_left_and_right():
    # Left hip 40 cos, right hip 20 cos: mean 30 cos, range 60. Ankles 10 cos and -4 cos: mean 3 cos, range 6.
    found = row(trial(0.5, joint_torque=(wave(0.5)[:, None] * [40.0, 10, 20, -4])[:, None]))
    assert (found.hip_torque_range_nm, found.ankle_torque_range_nm) == pytest.approx((60, 6))


def test_balance_of_a_trial():
    # After 10 s the pressure lies at 1 cm for half of the time and at 5 cm for the rest. In the middle a
    # foot is not flat for 36 s of the 90 s and neither carries load for 22.5 s. The feet slid 3 cm at first.
    cop = np.where(TIME < 55, 0.01, 0.05)
    cop[TIME < 10] = -9.0
    cop[(TIME >= 43.75) & (TIME < 66.25)] = math.nan
    flat = (TIME < 37) | (TIME >= 73)
    slid = np.where(TIME < 5, 0.03, 0.0)
    found = row(trial(0.5, cop_x=cop[:, None], foot_flat=flat[:, None], foot_displacement=slid[:, None]))
    assert found.cop_p05_m == found.cop_p25_m == pytest.approx(0.01)
    assert found.cop_p75_m == found.cop_p95_m == pytest.approx(0.05)
    assert (found.foot_not_flat_share, found.foot_displacement_max_m) == pytest.approx((0.4, 0.03))


def test_only_whole_trial_indices_include_the_transient():
    calm = trial(0.5)
    wild = np.where(TIME < 10, 1.0, 0.0)
    noisy = trial(
        0.5,
        head_x=calm.head_x + wild[:, None],
        head_vx=wild[:, None],
        joint_angle=calm.joint_angle + wild[:, None, None] * [1, 1, -1, -1] * [1, -1, -1, 1],
        joint_torque=np.broadcast_to(wild[:, None, None], (STEPS, 1, 4)),
        joint_velocity=np.ones((STEPS, 1, 4)),
    )
    before, after = as_row(row(calm)), as_row(row(noisy))
    whole = {"hip_ankle_r", "mode", "target_head_r", "head_speed_mps", "energy_j"}
    assert {name for name in before if before[name] == pytest.approx(after[name], nan_ok=True)} == set(before) - whole
    # 1 m/s for 10 of 100 s; 4 joints x 1 Nm x 1 rad/s for 10 s.
    assert (after["head_speed_mps"], after["energy_j"]) == pytest.approx((0.1, 40))


@pytest.mark.parametrize("joints", [[HIPS], [ANKLES], [HIPS, ANKLES]])
@pytest.mark.parametrize("peak_to_peak", [0.0, 0.4])
def test_a_joint_that_hardly_moves_has_no_mode(joints, peak_to_peak):
    angle = trial(0.5).joint_angle.copy()
    for joint in joints:
        angle[..., joint] = 0.3 + math.radians(peak_to_peak) / 2 * wave(0.5)[:, None, None]
    found = row(trial(0.5, joint_angle=angle), still_joint_deg=0.5)
    assert (found.mode, found.valid) == ("undefined", True)
    assert all(math.isnan(getattr(found, name)) for name in COORDINATION)
    assert found.target_head_r == pytest.approx(1)
    moving = row(trial(0.5, joint_angle=angle), still_joint_deg=0.3)
    assert moving.mode == ("in-phase" if peak_to_peak else "undefined")


def numbers(result: Result) -> dict[str, Any]:
    """The indices, without conditions and without what other functions fill in."""
    given = {"freq_hz", "hip_k_nm_per_rad", "ankle_k_nm_per_rad", "load_kg", "valid", "fell", "fall_time_s", "mode"}
    return {name: value for name, value in as_row(result).items() if name not in given | {"cost_ratio"}}


def test_a_fall_makes_all_indices_undefined():
    # The second world falls at step 738, 738 / 60 = 12.3 s.
    fallen, standing = measured(trial([0.3, 0.6], fall_step=np.array([738, -1])))
    assert (fallen.fell, fallen.valid, fallen.mode) == (True, False, "undefined")
    assert fallen.fall_time_s == pytest.approx(12.3) and math.isnan(standing.fall_time_s)
    assert (fallen.freq_hz, fallen.hip_k_nm_per_rad, fallen.ankle_k_nm_per_rad, fallen.load_kg) == (0.3, 125, 25, 0)
    assert len(numbers(fallen)) == 25 and all(map(math.isnan, numbers(fallen).values()))
    assert standing.valid and all(map(math.isfinite, numbers(standing).values()))
    assert row(trial(0.3, fall_step=np.array([0]))).fell  # at the first step, too


def test_a_simulation_that_diverged_is_not_valid():
    head = trial(0.5).head_x.copy()
    head[-1] = math.nan
    found = row(trial(0.5, head_x=head))
    assert (found.valid, found.fell, found.mode) == (False, False, "undefined")
    assert math.isnan(found.cost)


def test_a_slow_target_with_less_than_two_cycles():
    # 0.015 Hz: 66.7 s a cycle. One fits into 90 s: a mean but no deviation; none fits into 60 s.
    one = row(trial(0.015, 0.5))
    assert one.cycles == 1
    assert one.phase_mean_deg == pytest.approx(math.degrees(0.5)) and math.isnan(one.phase_sd_deg)
    assert one.head_amplitude_m == pytest.approx(0.1, rel=1e-3)
    none = row(trial(0.015, 0.5), transient_s=40.0)
    assert (none.cycles, none.mode) == (0, "in-phase")
    assert all(math.isnan(getattr(none, name)) for name in (*COORDINATION[1:], "head_amplitude_m"))
    assert math.isfinite(none.tracking_error_rms_mm)


def test_a_ramp_has_a_correlation_but_no_cycles():
    found = row(replace(trial(0.5), freq=np.array([math.nan])))
    assert (found.cycles, found.mode, found.valid) == (0, "in-phase", True)
    assert math.isnan(found.head_amplitude_m)


def test_a_transient_longer_than_the_trial_is_refused():
    with pytest.raises(ValueError, match="transient_s is 100 s"):
        row(trial(0.5), transient_s=100.0)
