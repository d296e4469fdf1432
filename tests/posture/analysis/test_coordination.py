"""Indices of sinusoids whose phase, amplitude, energy and cost are known by hand; the marks of a fall."""

import csv
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
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
    measure_trajectory,
    mode,
    relative_phase_paper,
    sign_change_frequency,
    torque_cost,
)
from posture.analysis.results import Result, as_row, write_csv
from posture.analysis.trajectory import Trajectory

DT = 1 / 60
STEPS = 6000  # 100 s
TIME = np.arange(STEPS) * DT
SETTINGS = {"transient_s": 10.0, "tolerance_m": 0.025, "still_joint_deg": 0.5}

frequencies = st.floats(0.05, 1.5)
phases = st.floats(-3.1, 3.1)


def wave(freq: float, phase: float = 0.0, time: np.ndarray = TIME) -> np.ndarray:
    return np.cos(2 * math.pi * freq * time + phase)


def trial(freq: float | list[float], phase: float | list[float] = 0.0, **changes: Any) -> Trajectory:
    """A world a frequency [Hz]: hip 6 and ankle 3 deg peak-to-peak, the hip `phase` [rad] ahead."""
    f = np.atleast_1d(np.asarray(freq, dtype=float))
    shape = (STEPS, len(f))
    hip = math.radians(3) * wave(f, np.asarray(phase), TIME[:, None]) - 0.1
    ankle = math.radians(1.5) * wave(f, 0.0, TIME[:, None]) - 0.05
    target = 0.1 - 0.1 * wave(f, 0.0, TIME[:, None])
    fields: dict[str, Any] = {
        "time": TIME,
        "freq": f,
        "hip_k": np.full(len(f), 125.0),
        "ankle_k": np.full(len(f), 25.0),
        "load": np.zeros(len(f)),
        "target_x": target,
        "head_x": target,
        "head_vx": np.zeros(shape),
        "joint_angle": np.stack([hip, ankle, hip, ankle], axis=-1),
        "joint_velocity": np.zeros((*shape, 4)),
        "joint_torque": np.zeros((*shape, 4)),
        "cop_x": np.zeros(shape),
        "torso_height": np.full(shape, 1.29),
        "foot_displacement": np.zeros(shape),
        "foot_flat": np.ones(shape, dtype=bool),
        "fall_step": np.full(len(f), -1),
        "torque_limit": 100.0,
        "control_dt": DT,
    }
    return Trajectory(**{**fields, **changes})


def row(trajectory: Trajectory, **settings: float) -> Result:
    return measure_trajectory(trajectory, **{**SETTINGS, **settings})[0]


def difference(a: float, b: float) -> float:
    """Distance of two angles [deg], the shorter way round."""
    return abs((a - b + 180) % 360 - 180)


# --- correlation and mode


@given(phases, st.floats(-5, 5), st.floats(0.1, 10))
def test_correlation_is_the_cosine_of_the_phase(phase: float, offset: float, scale: float) -> None:
    # Over whole cycles the mean of cos(x + phase) cos(x) is cos(phase) / 2, and of cos^2 it is 1/2.
    a, b = wave(0.5, phase), wave(0.5)
    assert correlation(a, b) == pytest.approx(math.cos(phase), abs=1e-9)
    assert correlation(scale * a + offset, b) == pytest.approx(math.cos(phase), abs=1e-9)
    assert correlation(-a, b) == pytest.approx(-math.cos(phase), abs=1e-9)


def test_correlation_by_hand() -> None:
    # Deviations (-1, 0, 1) and (-4/3, 5/3, -1/3): product 1, squares 2 and 42/9; 1 / sqrt(28/3) = 0.32733.
    assert correlation(np.array([1.0, 2, 3]), np.array([1.0, 4, 2])) == pytest.approx(0.3273268)


def test_correlation_with_a_constant_is_undefined() -> None:
    assert math.isnan(correlation(np.full(STEPS, 0.1), wave(0.5)))


@pytest.mark.parametrize(
    ("r", "name"),
    [(0.2, "in-phase"), (-0.2, "anti-phase"), (0.0, "undefined"), (math.nan, "undefined")],
)
def test_mode_is_the_sign(r: float, name: str) -> None:
    assert mode(r) == name


# --- cycles


def test_cycles_of_a_period_that_divides_the_trial() -> None:
    # 0.5 Hz: 120 samples a cycle; 90 s after the transient hold 45.
    parts = cycles(TIME, 0.5, 10.0)
    assert (len(parts), parts[0], parts[-1]) == (45, slice(600, 720), slice(5880, 6000))


def test_the_last_part_of_a_cycle_is_dropped() -> None:
    # 0.15 Hz: 400 samples a cycle; 90 s hold 13.5, so the last 200 samples belong to none.
    parts = cycles(TIME, 0.15, 10.0)
    assert (len(parts), parts[0].start, parts[-1].stop) == (13, 600, 5800)


@given(frequencies)
def test_cycles_follow_each_other_and_last_a_period(freq: float) -> None:
    parts = cycles(TIME, freq, 10.0)
    assert len(parts) in (math.floor(90 * freq), math.floor((90 + DT) * freq))
    assert all(a.stop == b.start for a, b in zip(parts, parts[1:], strict=False))
    assert all(abs((p.stop - p.start) * DT - 1 / freq) < 1.01 * DT for p in parts)


def test_a_ramp_or_a_slow_target_has_no_cycle() -> None:
    assert cycles(TIME, math.nan, 10.0) == []
    assert cycles(TIME, 0.011, 10.0) == []  # 90.9 s a cycle, 90 s left
    assert cycles(TIME, 0.5, 200.0) == []


# --- relative phase


@given(frequencies, phases)
def test_paper_phase_is_half_the_usual_one(freq: float, phase: float) -> None:
    parts = cycles(TIME, freq, 10.0)
    found = relative_phase_paper(wave(freq, phase) - 3, 2 * wave(freq) + 1, TIME, freq, parts)
    # Each of the two maxima is read to the nearest sample: at most a sample between them.
    assert found == pytest.approx(abs(phase) / 2, abs=1.01 * DT * freq * math.pi)


def test_paper_phase_across_the_edge_of_a_cycle() -> None:
    # 1 Hz, cycle of 60 samples. Ankle maximum at sample 0; the hip leads by 3 samples, so its maximum falls
    # on sample 57 of each cycle: not 57/60 but 3/60 of a period, times pi.
    parts = cycles(TIME, 1.0, 10.0)
    hip, ankle = wave(1.0, 2 * math.pi * 3 / 60), wave(1.0)
    assert relative_phase_paper(hip, ankle, TIME, 1.0, parts) == pytest.approx(math.pi * 3 / 60)


def test_paper_phase_is_averaged_over_cycles() -> None:
    # 1 Hz, two cycles of 60 samples, maxima 6 and 12 samples apart: (6 + 12) / 2 / 60 of a period, times pi.
    hip, ankle = np.zeros(120), np.zeros(120)
    ankle[[20, 80]] = 1
    hip[[26, 68]] = 1
    found = relative_phase_paper(hip, ankle, TIME[:120], 1.0, [slice(0, 60), slice(60, 120)])
    assert found == pytest.approx(9 / 60 * math.pi)


# --- per-cycle Fourier component


@given(frequencies, phases, st.floats(0.1, 10), st.floats(-5, 5))
def test_component_recovers_amplitude_and_phase(freq: float, phase: float, amplitude: float, offset: float) -> None:
    parts = cycles(TIME, freq, 10.0)
    found = cycle_components(amplitude * wave(freq, phase) + offset, TIME, freq, parts)
    assert len(found) == len(parts)
    np.testing.assert_allclose(found, amplitude * np.exp(1j * phase), rtol=1e-7)


@given(frequencies, phases, st.floats(0.1, 10), st.floats(-5, 5))
def test_signed_phase_is_recovered(freq: float, phase: float, scale: float, offset: float) -> None:
    parts = cycles(TIME, freq, 10.0)
    hip, ankle = wave(freq, phase), wave(freq)
    for a, b, expected in [
        (hip, ankle, phase),  # positive where the hip leads
        (ankle, hip, -phase),
        (scale * hip + offset, ankle, phase),
        (-hip, ankle, phase + math.pi),
    ]:
        mean, sd = circular_mean_sd(cycle_phases(a, b, TIME, freq, parts, still=0.0))
        assert difference(mean, math.degrees(expected)) < 1e-5
        assert sd < 1e-3


def test_harmonics_do_not_move_the_phase() -> None:
    # 0.5 Hz has 120 samples a cycle, over which the harmonics are orthogonal to the fundamental.
    parts = cycles(TIME, 0.5, 10.0)
    hip = wave(0.5, 0.7) + 0.4 * wave(1.0, 0.3) + 0.2 * wave(1.5, 2.0)
    found = cycle_phases(hip, wave(0.5), TIME, 0.5, parts, still=0.0)
    np.testing.assert_allclose(found, math.degrees(0.7), atol=1e-8)


def test_phase_of_a_still_joint_is_undefined() -> None:
    # Peak-to-peak 0.2: above a threshold of 0.19, below one of 0.21, whichever joint it is.
    parts = cycles(TIME, 0.5, 10.0)
    small, large = 0.1 * wave(0.5), wave(0.5)
    for a, b in [(small, large), (large, small)]:
        assert np.isfinite(cycle_phases(a, b, TIME, 0.5, parts, still=0.19)).all()
        assert np.isnan(cycle_phases(a, b, TIME, 0.5, parts, still=0.21)).all()


def test_circular_mean_across_the_half_turn() -> None:
    # 170 and -170 deg lie 10 deg either side of 180: R = cos(10 deg) = 0.9848078, ln R = -0.0153088,
    # sd = sqrt(0.0306176) = 0.174979 rad = 10.0256 deg.
    mean, sd = circular_mean_sd(np.array([170.0, -170.0, math.nan]))
    assert difference(mean, 180) < 1e-9
    assert sd == pytest.approx(10.0256, abs=1e-4)


def test_circular_mean_of_one_and_of_none() -> None:
    mean, sd = circular_mean_sd(np.array([40.0]))
    assert mean == pytest.approx(40)
    assert math.isnan(sd)
    assert all(map(math.isnan, circular_mean_sd(np.array([math.nan]))))


# --- amplitude, energy, cost, centre of pressure


def test_amplitude_is_half_the_peak_to_peak_averaged_over_cycles() -> None:
    # Peak-to-peak 2 and 6 in the two cycles: (2 + 6) / 2 / 2 = 2. Over the whole it would be 8 / 2 = 4.
    signal = np.array([0.0, 2, 1, 8, 2, 3, 99])
    assert cycle_amplitude(signal, [slice(0, 3), slice(3, 6)]) == 2
    assert math.isnan(cycle_amplitude(signal, []))


def test_energy_counts_both_signs() -> None:
    # 2 steps of 0.5 s: |10 x 2| + |-3 x 4| = 32 W, then |1 x -1| + |0 x 9| = 1 W; 33 x 0.5 = 16.5 J.
    torque, velocity = np.array([[10.0, -3], [1, 0]]), np.array([[2.0, 4], [-1, 9]])
    assert energy(torque, velocity, 0.5) == 16.5


def test_energy_of_a_sinusoid() -> None:
    # tau = 20 cos, omega = 3 cos at 0.5 Hz over 100 s: |tau omega| has the mean 60 / 2, so 3000 J.
    assert energy(20 * wave(0.5)[:, None], 3 * wave(0.5)[:, None], DT) == pytest.approx(3000)


def test_cost_sums_joints_and_averages_time() -> None:
    # Limit 50: 4 x (25/50)^2 = 1, then 4 x 0 = 0; mean 0.5.
    assert torque_cost(np.array([[25.0, -25, 25, -25], [0, 0, 0, 0]]), 50.0) == 0.5


def test_percentiles_leave_out_steps_without_load() -> None:
    # 0, 1 .. 100 mm: the p-th percentile is p mm.
    cop = np.append(np.arange(101) * 1e-3, [math.nan] * 50)
    np.testing.assert_allclose(cop_percentiles(cop), [0.005, 0.025, 0.05, 0.075, 0.095])
    assert np.isnan(cop_percentiles(np.full(4, math.nan))).all()


# --- transition frequency


def test_transition_is_interpolated() -> None:
    # From 0.6 at 0.6 Hz to -0.2 at 0.8 Hz: zero after 0.6 / 0.8 of the way, 0.75 Hz. Order does not matter.
    assert sign_change_frequency([0.8, 0.4, 0.6], [-0.2, 0.9, 0.6]) == pytest.approx(0.75)


@given(st.floats(0.1, 1.4), st.floats(0.1, 5), st.sampled_from([-1, 1]))
def test_transition_of_a_straight_line(zero: float, slope: float, sign: int) -> None:
    f = np.linspace(0.05, 1.5, 20)
    assert sign_change_frequency(f, sign * slope * (zero - f)) == pytest.approx(zero)


def test_the_first_of_several_transitions() -> None:
    assert sign_change_frequency([1, 2, 3, 4], [1, -1, 1, -1]) == pytest.approx(1.5)


def test_transition_at_an_exact_zero() -> None:
    assert sign_change_frequency([1, 2, 4], [1, 0, -1]) == 2
    assert sign_change_frequency([1, 2, 4], [1, 0, 1]) is None


def test_a_fall_widens_the_bracket() -> None:
    # The neighbours of nan are 1 Hz (+1) and 3 Hz (-1): zero at 2 Hz.
    assert sign_change_frequency([1, 2.5, 3], [1, math.nan, -1]) == pytest.approx(2)


@pytest.mark.parametrize("r", [[], [1.0], [0.5, 0.2], [-0.5, -0.2], [math.nan, math.nan], [0.0, 0.0]])
def test_no_transition(r: list[float]) -> None:
    assert sign_change_frequency(list(range(len(r))), r) is None


def test_transition_refuses_unlike_arrays() -> None:
    with pytest.raises(ValueError, match="both must be"):
        sign_change_frequency([1, 2], [1, 2, 3])


# --- a world's row


@pytest.mark.parametrize(("phase", "name"), [(0.0, "in-phase"), (math.pi, "anti-phase"), (2.0, "anti-phase")])
@pytest.mark.parametrize("freq", [0.15, 0.75, 1.47])  # 15, 75 and 147 cycles in 100 s; 0.15 and 1.47 not in 90 s
def test_coordination_of_a_trial(freq: float, phase: float, name: str) -> None:
    found = row(trial(freq, phase))
    assert (found.mode, found.valid, found.fell) == (name, True, False)
    assert found.cycles == math.floor(90 * freq + 1e-9)
    assert found.hip_ankle_r == pytest.approx(math.cos(phase), abs=1e-3)
    resolution = 1.01 * DT * freq * math.pi
    assert found.relative_phase_paper_rad == pytest.approx(phase / 2, abs=resolution)
    assert found.relative_phase_deg == pytest.approx(math.degrees(phase), abs=math.degrees(2 * resolution))
    assert difference(found.phase_mean_deg, math.degrees(phase)) < 1e-5
    assert found.phase_sd_deg < 1e-3
    # Peak-to-peak 2 x 3 deg and 2 x 1.5 deg; the mean of left and right.
    assert found.hip_range_deg == pytest.approx(6, rel=2e-3)
    assert found.ankle_range_deg == pytest.approx(3, rel=2e-3)


def test_tracking_of_a_trial() -> None:
    # The head moves 0.08 m where the target moves 0.1 m, about the same middle: the error is 0.02 |cos|, mean
    # 0.02 x 2/pi, rms 0.02 / sqrt(2). |cos| > 1/2 for 2/3 of the time. Mean speed of a sinusoid: 4 A f.
    freq, amplitude = 0.5, 0.08
    head = 0.1 - amplitude * wave(freq)[:, None]
    speed = amplitude * 2 * math.pi * freq * np.sin(2 * math.pi * freq * TIME)[:, None]
    found = row(trial(freq, head_x=head, head_vx=speed), tolerance_m=0.0100001)
    assert found.target_head_r == pytest.approx(1)
    assert found.head_amplitude_m == pytest.approx(amplitude)
    assert found.head_speed_mps == pytest.approx(4 * amplitude * freq, rel=1e-3)
    assert found.tracking_error_mean_mm == pytest.approx(20 * 2 / math.pi, rel=1e-3)
    assert found.tracking_error_rms_mm == pytest.approx(20 / math.sqrt(2))
    assert found.beyond_tolerance_share == pytest.approx(2 / 3, abs=2 / 120)  # to a sample at each edge


def test_a_late_head_lowers_its_correlation() -> None:
    head = 0.1 - 0.1 * wave(0.5, -0.3)[:, None]
    assert row(trial(0.5, head_x=head)).target_head_r == pytest.approx(math.cos(0.3))


def test_effort_of_a_trial() -> None:
    # Hips 50 Nm, ankles 20 Nm, limit 100 Nm: 2 x 0.25 + 2 x 0.04 = 0.58. Hips at 1 rad/s, ankles at -2 rad/s:
    # 2 x 50 + 2 x 40 = 180 W for 100 s. The torques never change, so their range is 0.
    torque = np.broadcast_to([50.0, 20, 50, 20], (STEPS, 1, 4))
    velocity = np.broadcast_to([1.0, -2, 1, -2], (STEPS, 1, 4))
    found = row(trial(0.5, joint_torque=torque, joint_velocity=velocity))
    assert found.cost == pytest.approx(0.58)
    assert found.energy_j == pytest.approx(18000)
    assert found.hip_torque_range_nm == found.ankle_torque_range_nm == 0


def test_ranges_are_those_of_the_mean_of_left_and_right() -> None:
    # Left hip 40 cos, right hip 20 cos: mean 30 cos, range 60. Ankles 10 cos and -4 cos: mean 3 cos, range 6.
    torque = (wave(0.5)[:, None] * [40.0, 10, 20, -4])[:, None]
    found = row(trial(0.5, joint_torque=torque))
    assert found.hip_torque_range_nm == pytest.approx(60)
    assert found.ankle_torque_range_nm == pytest.approx(6)


def test_balance_of_a_trial() -> None:
    # After 10 s the pressure lies at 1 cm for half of the time and at 5 cm for the rest. In the middle a
    # foot is not flat for 36 s of the 90 s and neither carries load for 22.5 s. The feet slid 3 cm at first.
    cop = np.where(TIME < 55, 0.01, 0.05)
    cop[TIME < 10] = -9.0
    lifted = (TIME >= 37) & (TIME < 73)
    cop[(TIME >= 43.75) & (TIME < 66.25)] = math.nan
    slid = np.where(TIME < 5, 0.03, 0.0)
    changes = {"cop_x": cop, "foot_flat": ~lifted, "foot_displacement": slid}
    found = row(trial(0.5, **{name: value[:, None] for name, value in changes.items()}))
    assert found.cop_p05_m == found.cop_p25_m == pytest.approx(0.01)
    assert found.cop_p75_m == found.cop_p95_m == pytest.approx(0.05)
    assert found.foot_not_flat_share == pytest.approx(0.4)
    assert found.foot_displacement_max_m == 0.03


def test_the_transient_is_left_out_where_it_should() -> None:
    # In the first 10 s everything is wild; only the paper's whole-trial indices may see it.
    calm = trial(0.5)
    wild = np.where(TIME < 10, 1.0, 0.0)
    noisy = trial(
        0.5,
        head_x=calm.head_x + wild[:, None],
        head_vx=wild[:, None],
        joint_angle=calm.joint_angle + wild[:, None, None] * [1, -1, 1, -1],
        joint_torque=np.broadcast_to(wild[:, None, None], (STEPS, 1, 4)),
        joint_velocity=np.ones((STEPS, 1, 4)),
    )
    before, after = as_row(row(calm)), as_row(row(noisy))
    whole = {"hip_ankle_r", "mode", "target_head_r", "head_speed_mps", "energy_j"}
    assert {name for name in before if before[name] == pytest.approx(after[name], nan_ok=True)} == set(before) - whole
    # 1 m/s for 10 of 100 s; 4 joints x 1 Nm x 1 rad/s for 10 s.
    assert after["head_speed_mps"] == pytest.approx(0.1)
    assert after["energy_j"] == pytest.approx(40)


@pytest.mark.parametrize("joint", [HIPS, ANKLES])
def test_a_joint_that_hardly_moves_has_no_mode(joint: slice) -> None:
    angle = trial(0.5).joint_angle.copy()
    angle[..., joint] = math.radians(0.2) * wave(0.5)[:, None, None]  # peak-to-peak 0.4 deg
    found = row(trial(0.5, joint_angle=angle), still_joint_deg=0.5)
    assert found.mode == "undefined"
    assert found.valid
    undefined = (
        "hip_ankle_r",
        "relative_phase_paper_rad",
        "relative_phase_deg",
        "phase_mean_deg",
        "phase_sd_deg",
    )
    assert all(math.isnan(getattr(found, name)) for name in undefined)
    assert found.target_head_r == pytest.approx(1)
    assert row(trial(0.5, joint_angle=angle), still_joint_deg=0.3).mode == "in-phase"


def test_a_fall_makes_all_indices_undefined() -> None:
    # The second world falls at step 738, 738 / 60 = 12.3 s.
    fallen, standing = measure_trajectory(trial([0.3, 0.6], fall_step=np.array([738, -1])), **SETTINGS)
    assert (fallen.fell, fallen.valid, fallen.mode) == (True, False, "undefined")
    assert fallen.fall_time_s == pytest.approx(12.3)
    kept = {"freq_hz": 0.3, "hip_k_nm_per_rad": 125.0, "ankle_k_nm_per_rad": 25.0, "load_kg": 0.0}
    assert {name: getattr(fallen, name) for name in kept} == kept
    rest = set(as_row(fallen)) - set(kept) - {"fell", "valid", "mode", "fall_time_s"}
    assert len(rest) > 20
    assert all(math.isnan(getattr(fallen, name)) for name in rest)
    assert standing.valid
    assert math.isnan(standing.fall_time_s)
    assert all(math.isfinite(getattr(standing, name)) for name in rest - {"cost_ratio"})


def test_a_fall_at_the_first_step_counts() -> None:
    assert row(trial(0.3, fall_step=np.array([0]))).fell


def test_a_simulation_that_blew_up_is_not_valid() -> None:
    head = trial(0.5).head_x.copy()
    head[-1] = math.nan
    found = row(trial(0.5, head_x=head))
    assert (found.valid, found.fell, found.mode) == (False, False, "undefined")
    assert math.isnan(found.cost)


def test_a_slow_target_with_less_than_two_cycles() -> None:
    # 0.015 Hz: 66.7 s a cycle. One fits into 90 s: a mean but no deviation; none fits into 60 s.
    one = row(trial(0.015, 0.5))
    assert one.cycles == 1
    assert one.phase_mean_deg == pytest.approx(math.degrees(0.5))
    assert math.isnan(one.phase_sd_deg)
    assert one.head_amplitude_m == pytest.approx(0.1, rel=1e-3)
    none = row(trial(0.015, 0.5), transient_s=40.0)
    assert none.cycles == 0
    assert none.mode == "in-phase"
    undefined = ("relative_phase_paper_rad", "relative_phase_deg", "phase_mean_deg", "head_amplitude_m")
    assert all(math.isnan(getattr(none, name)) for name in undefined)
    assert math.isfinite(none.tracking_error_rms_mm)


def test_a_ramp_has_a_correlation_but_no_cycles() -> None:
    found = row(replace(trial(0.5), freq=np.array([math.nan])))
    assert (found.cycles, found.mode, found.valid) == (0, "in-phase", True)
    assert math.isnan(found.head_amplitude_m)


def test_a_transient_longer_than_the_trial_is_refused() -> None:
    with pytest.raises(ValueError, match="transient_s is 100 s"):
        row(trial(0.5), transient_s=100.0)


# --- CSV


def test_csv_holds_every_row(tmp_path: Path) -> None:
    rows = measure_trajectory(trial([0.3, 0.6], fall_step=np.array([738, -1])), **SETTINGS)
    write_csv(rows, tmp_path / "rows.csv")
    with (tmp_path / "rows.csv").open(newline="") as file:
        read = list(csv.DictReader(file))
    assert [list(line) for line in read] == [list(as_row(r)) for r in rows]
    assert (read[0]["freq_hz"], read[0]["fall_time_s"], read[0]["fell"]) == ("0.3", "12.3", "True")
    assert (read[0]["hip_ankle_r"], read[1]["mode"]) == ("nan", "in-phase")
    assert float(read[1]["head_amplitude_m"]) == pytest.approx(rows[1].head_amplitude_m, rel=1e-5)
    assert [path.name for path in tmp_path.iterdir()] == ["rows.csv"]


def test_csv_of_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no rows"):
        write_csv([], tmp_path / "rows.csv")
    assert not list(tmp_path.iterdir())
