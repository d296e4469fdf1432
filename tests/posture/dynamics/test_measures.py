"""What trials show, on motions whose answers are known: made-up sinusoids, and a linear oscillator that is pushed."""

import math

import numpy as np
import pytest

from posture.analysis.relaxation import Joints, angle_deviation, phase_deviation, relaxation_time, typical_size
from posture.analysis.trajectory import Trajectory
from posture.cli import jobs
from posture.config.dynamics import DynamicsConfig
from posture.dynamics import courses, measures
from posture.dynamics.findings import findings
from posture.dynamics.measures import FluctuationRow, RelaxationRow, SwitchRow

DT = 0.0166


def config(*overrides):
    return jobs.compose("dynamics", DynamicsConfig, *overrides)


def made_up(hip, ankle, freq=math.nan, fall_step=-1):
    """A trajectory of one world with these angles [rad], (T,)."""
    steps = len(hip)
    zeros, joints = np.zeros((steps, 1)), np.stack([hip, ankle, hip, ankle], -1)[:, None]
    return Trajectory(
        time=DT * np.arange(1, steps + 1),
        **{name: np.array([value]) for name, value in (("freq", freq), ("hip_k", 125.0), ("ankle_k", 25.0), ("load", 0.0))},
        **dict.fromkeys(("target_x", "head_x", "head_vx", "cop_x", "torso_height", "foot_displacement"), zeros),
        joint_angle=joints,
        joint_velocity=np.gradient(joints, DT, axis=0),
        joint_torque=0.0 * joints,
        foot_flat=np.ones((steps, 1), dtype=bool),
        fall_step=np.array([fall_step]),
        torque_limit=100.0,
        control_dt=DT,
    )


# -- courses -----------------------------------------------------------------------------------------------------------


def test_a_staircase_has_ten_cycles_a_step_up_and_down():
    steps = courses.staircase((0.5, 1.0), config().staircase, DT)
    assert [(step.freq, step.rising) for step in steps] == [(0.5, True), (1.0, True), (1.0, False), (0.5, False)]
    assert [step.end - step.first for step in steps] == [round(20 / DT), round(10 / DT), round(10 / DT), round(20 / DT)]
    assert [step.first for step in steps[1:]] == [step.end for step in steps[:-1]]
    freq = courses.frequency_of(steps)
    assert len(freq) == steps[-1].end and (freq[0], freq[steps[1].first], freq[-1]) == (0.5, 1.0, 0.5)


def test_a_ramp_rises_at_its_rate_and_falls_as_it_rose():
    freq = courses.up_and_down(config("ramp={start: 0.2, end: 1.2, rate: 0.1, window: 2}").ramp, DT)
    assert len(freq) == 2 * round(10 / DT) and (freq[0], freq.max(), freq[-1]) == (0.2, 1.2, 0.2)
    assert np.diff(freq)[:10] == pytest.approx(0.1 * DT, rel=0.01)
    assert np.array_equal(freq, freq[::-1])


# -- staircases and ramps ----------------------------------------------------------------------------------------------


def switching(freq, up, down):
    """Angles [rad] whose relative phase is 0 below the switch and 180 deg above it, which differs on the way up and down."""
    phase, rising = 2 * math.pi * DT * np.cumsum(freq), np.arange(len(freq)) < len(freq) // 2
    sign = np.where(freq < np.where(rising, up, down), 1.0, -1.0)
    return 0.1 * sign * np.cos(phase), 0.05 * np.cos(phase)


def test_hysteresis_of_a_staircase():
    """In-phase up to 0.8 Hz on the way up, down to 0.5 Hz on the way down: with steps of 0.1 Hz, 0.3 Hz wide."""
    conf = config("+staircase.courses.made=[0.35,0.45,0.55,0.65,0.75,0.85,0.95]")
    steps = courses.staircase(conf.staircase.courses["made"], conf.staircase, DT)
    hip, ankle = switching(courses.frequency_of(steps), 0.8, 0.5)
    rows = measures.steps_of(made_up(hip, ankle), steps, "made", 4, conf)
    assert [row.hip_ankle_r > 0 for row in rows] == [row.freq_hz < (0.8 if row.rising else 0.5) for row in rows]
    assert all(abs(abs(row.phase_mean_deg) - (0 if row.hip_ankle_r > 0 else 180)) < 1e-6 for row in rows)
    assert max(row.phase_sd_deg for row in rows) < 1e-3
    (switch,) = measures.switches_of_steps(rows)
    assert (switch.seed, switch.rising_hz, switch.falling_hz) == (4, pytest.approx(0.8), pytest.approx(0.5))
    assert switch.width_hz == pytest.approx(0.3)


def test_nothing_is_measured_from_the_step_of_a_fall_on():
    conf = config("staircase.cycles=4", "staircase.skip=1")
    steps = courses.staircase((0.5, 1.0), conf.staircase, DT)
    hip, ankle = switching(courses.frequency_of(steps), 0.8, 0.8)
    rows = measures.steps_of(made_up(hip, ankle, fall_step=steps[1].first + 5), steps, "made", 1, conf)
    assert [row.fell for row in rows] == [False, True, True, True]
    assert [math.isnan(row.hip_ankle_r) for row in rows] == [False, True, True, True]
    (switch,) = measures.switches_of_steps(rows)
    assert math.isnan(switch.rising_hz) and math.isnan(switch.width_hz)


@pytest.mark.parametrize(("up", "down"), [(0.8, 0.8), (0.9, 0.6), (0.6, 0.9)])
def test_hysteresis_of_a_ramp(up, down):
    """The window of 2 cycles at 0.65 Hz, 3 s, sees the change in its middle: 0.01 Hz/s times half of it is 0.015 Hz."""
    conf = config()
    freq = courses.up_and_down(conf.ramp, DT)
    (switch,) = measures.switches_of_ramp(made_up(*switching(freq, up, down)), freq, 1, conf)
    assert (switch.rising_hz, switch.falling_hz) == (pytest.approx(up, abs=0.015), pytest.approx(down, abs=0.015))
    assert switch.width_hz == pytest.approx(up - down, abs=0.015)


# -- relaxation --------------------------------------------------------------------------------------------------------


def test_relaxation_time_of_a_decay_is_its_time_constant():
    time = DT * np.arange(400)
    for tau in (0.2, 0.7, 1.5):
        assert relaxation_time(np.exp(-time / tau), DT) == pytest.approx(tau, rel=0.03, abs=1.01 * DT)
        assert relaxation_time(0.4 + 3 * np.exp(-time / tau), DT) == relaxation_time(np.exp(-time / tau), DT)


def test_the_size_of_a_deviation_is_its_median_over_the_pushes():
    assert typical_size(np.array([[1.0, -2.0], [-3.0, 100.0], [2.0, 1.0]])).tolist() == [2.0, 2.0]


def test_relaxation_time_counts_from_the_greatest_deviation_to_the_last_excursion():
    deviation = np.zeros(200)
    deviation[[10, 60, 110]] = 1.0, 0.5, 0.2
    assert relaxation_time(deviation, 0.01) == pytest.approx(0.51)


@pytest.mark.parametrize("values", [np.zeros(50), np.ones(50), np.full(50, np.nan)])
def test_relaxation_time_is_unknown_where_nothing_decays(values):
    assert math.isnan(relaxation_time(values, DT))


def sinusoid(phase, freq, time, amplitude):
    omega = 2 * math.pi * freq
    return amplitude * np.cos(omega * time + phase), -amplitude * omega * np.sin(omega * time + phase)


def joints(hip_phase, ankle_phase, freq, time, offset=0.0):
    (hip, hip_rate), (ankle, ankle_rate) = (sinusoid(phase, freq, time, 0.1) for phase in (hip_phase, ankle_phase))
    return Joints(hip + offset, ankle, hip_rate, ankle_rate)


def test_deviation_of_the_relative_phase_of_sinusoids():
    """The hip's phase is 30 deg ahead of its twin's, the ankle's 10 deg behind: 40 deg, whatever that of the twin is."""
    time = np.arange(0, 20, DT)
    for own in (0.0, 2.0, math.pi):
        twin = joints(own, 0.0, 0.5, time, offset=0.3)
        pushed = joints(own + math.radians(30), math.radians(-10), 0.5, time, offset=0.3)
        assert phase_deviation(pushed, twin, 0.5) == pytest.approx(40.0, abs=0.5)
    assert phase_deviation(twin, twin, 0.5) == pytest.approx(0.0, abs=1e-9)


def test_deviation_of_the_angles_is_their_distance():
    time = np.arange(0, 1, DT)
    twin = joints(0.0, 0.0, 1.0, time)
    pushed = twin._replace(hip=twin.hip + math.radians(3), ankle=twin.ankle - math.radians(4))
    assert angle_deviation(pushed, twin) == pytest.approx(5.0)


# -- findings ----------------------------------------------------------------------------------------------------------


def fluctuation(seed, switch, sd, modes=(10.0, 175.0)):
    """Rows at 0.1 ... 1.2 Hz of a policy that switches at `switch` [Hz], with `sd`(distance from it) [deg]."""
    rows = []
    for freq in np.round(np.arange(0.1, 1.25, 0.1), 3).tolist():
        phase = modes[0] if freq < switch else modes[1]
        rows.append(FluctuationRow(seed, freq, 1, 0, switch - freq, phase, sd(abs(freq - switch)), 0.03))
    return rows


def relaxation(seed, time):
    return [RelaxationRow(seed, freq, 1, 0, 1.0, time(freq), 1.0, 0.5) for freq in np.arange(0.2, 1.25, 0.1).tolist()]


def named(found):
    return {one.name: one for one in found}


def test_hysteresis_over_seeds_has_students_interval():
    """Widths 0.1, 0.2, 0.3 Hz: mean 0.2, standard error 0.1 / sqrt(3), t(0.975, 2) = 4.303."""
    rows = [
        SwitchRow("platform", seed, repeat, 0.7, 0.7 - width, width)
        for seed, width in enumerate((0.1, 0.2, 0.3))
        for repeat in (0, 1)
    ]
    one = named(findings(rows, [], [], 0.1))["hysteresis_platform"]
    half = 4.3027 * 0.1 / math.sqrt(3)
    assert (one.seeds, one.value, one.low, one.high) == (3, *(pytest.approx(0.2 + x, abs=1e-4) for x in (0, -half, half)))
    assert one.found.startswith("no hysteresis") and "Ko et al. 2003" in one.people
    wide = [SwitchRow("ramp", seed, 0, 0.7, 0.5, width) for seed, width in enumerate((0.2, 0.21, 0.19))]
    assert named(findings(wide, [], [], 0.1))["hysteresis_ramp"].found.startswith("hysteresis")
    tiny = [SwitchRow("ramp", seed, 0, 0.7, 0.698, width) for seed, width in enumerate((0.002, 0.0021, 0.0019))]
    assert named(findings(tiny, [], [], 0.1))["hysteresis_ramp"].found == "no hysteresis of 0.01 Hz or more"
    unknown = [SwitchRow("ramp", seed, 0, 0.7, 0.7 - width, width) for seed, width in enumerate((0.1, -0.1, 0.001))]
    assert named(findings(unknown, [], [], 0.1))["hysteresis_ramp"].found == "no hysteresis that could be told from zero"
    reversed_ = [SwitchRow("ramp", seed, 0, 0.5, 0.7, -width) for seed, width in enumerate((0.2, 0.21, 0.19))]
    assert named(findings(reversed_, [], [], 0.1))["hysteresis_ramp"].found.startswith("reversed")


def test_hysteresis_of_one_seed_has_students_interval_over_its_repeats():
    """Widths 0.02 and 0.04 Hz: mean 0.03, standard error 0.01, t(0.975, 1) = 12.706. Two of one sign are no finding."""
    rows = [SwitchRow("ramp", 1, repeat, 0.7, 0.7 - width, width) for repeat, width in enumerate((0.02, 0.04))]
    (one,) = findings(rows, [], [], 0.1)
    assert (one.value, one.low, one.high) == tuple(pytest.approx(0.03 + x, abs=1e-5) for x in (0, -0.12706, 0.12706))
    assert one.found == "no hysteresis that could be told from zero"


def test_fluctuations_and_relaxation_near_the_switch_over_those_elsewhere():
    """SD 6 deg within 0.1 Hz of the switch and 2 deg elsewhere: 3. Relaxation 1 s everywhere: 1."""
    rows = [row for seed in (1, 2, 3) for row in fluctuation(seed, 0.65, lambda away: 6.0 if away <= 0.1 else 2.0)]
    times = [row for seed in (1, 2, 3) for row in relaxation(seed, lambda freq: 1.0)]
    found = named(findings([], rows, times, 0.1))
    assert (found["fluctuation"].value, found["fluctuation"].found) == (pytest.approx(3.0), "larger near the switch")
    one = found["phase_relaxation"]
    assert (one.value, one.found) == (pytest.approx(1.0), "not larger near the switch")


def test_a_relative_phase_that_hardly_varies_does_not_fluctuate():
    rows = [row for seed in (1, 2, 3) for row in fluctuation(seed, 0.65, lambda away: 0.6 if away <= 0.1 else 0.2)]
    one = named(findings([], rows, [], 0.1))["fluctuation"]
    assert one.value == pytest.approx(3.0) and one.found == "below 1 deg at every frequency"


def test_modes_are_circular_means_below_and_above_the_switch():
    """Over 170, -170 and 180 deg the mean is 180 deg, and their interval is about it."""
    rows = [
        row
        for seed, fast in enumerate((170.0, -170.0, 180.0))
        for row in fluctuation(seed, 0.65, lambda _: 1.0, (20.0, fast))
    ]
    found = named(findings([], rows, [], 0.1))
    assert found["slow_mode"].value == pytest.approx(20.0)
    assert abs(found["fast_mode"].value) == pytest.approx(180.0)
    half = 4.3027 * 10 / math.sqrt(3)
    assert found["fast_mode"].high - found["fast_mode"].low == pytest.approx(2 * half, rel=1e-3)


def test_nothing_is_claimed_without_a_switch():
    rows = fluctuation(1, 5.0, lambda _: 1.0)
    found = named(findings([], rows, relaxation(1, lambda _: 1.0), 0.1))
    assert math.isnan(found["fluctuation"].value) and found["fluctuation"].found == "-"
