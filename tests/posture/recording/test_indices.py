"""Indices of known motions, and of trials of the simulated body: those that `posture.eval` has."""

import math
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posture.analysis.results import Result
from posture.analysis.statistics import mean_interval
from posture.evaluation.trial import evaluate_at
from posture.export.trajectory_files import write_csv, write_sto
from posture.recording.indices import Indices, hilbert_phases, mean_correlation, measure
from posture.recording.trial import analyse
from tests.posture.analysis.trials import angle_difference
from tests.posture.recording.people import ANKLE, HEAD, HIP, config, recording, times, wave

SETTINGS = {"transient_s": 10.0, "tolerance_m": 0.025, "still_joint_deg": 0.5, "torque_limit": 100.0}


def measured(one, freq, **settings):
    return measure(one, freq, **{**SETTINGS, **settings})


# -- a known motion ----------------------------------------------------------------------------------------------------


@given(freq=st.floats(0.1, 2.0), lead=st.floats(-179, 179))
def test_phase_and_correlation_of_two_sinusoids(freq, lead):
    """Phases are exact; the correlation is cos(lead) over whole cycles, and near it otherwise."""
    found, cycles = measured(recording(freq, lead, times(60.0)), freq)
    for phase in (found.phase_mean_deg, found.hilbert_mean_deg, *cycles.values["phase_deg"]):
        assert angle_difference(phase, lead) < 0.5
    assert found.phase_resultant == pytest.approx(1.0) and found.phase_high_deg - found.phase_low_deg < 0.1
    assert found.hip_ankle_r == pytest.approx(math.cos(math.radians(lead)), abs=0.03)
    assert found.cycles == len(cycles.start) and found.cycles in (int(50 * freq), int(50 * freq) + 1)
    # Peak to peak by samples: short by at most 1 - cos(pi f dt).
    slack = 1 - math.cos(math.pi * freq / 100) + 1e-9
    assert found.hip_range_deg == pytest.approx(math.degrees(2 * HIP), rel=slack + 1e-6)
    assert found.ankle_range_deg == pytest.approx(math.degrees(2 * ANKLE), rel=slack + 1e-6)
    assert found.head_amplitude_m == pytest.approx(HEAD, rel=slack + 1e-6)
    assert found.head_speed_mps == pytest.approx(4 * HEAD * freq, rel=0.03)  # a sinusoid's mean speed, over part cycles
    assert found.tracking_error_mean_mm == 0.0 and found.target_head_r == pytest.approx(1.0)


def test_mode_and_what_is_left_undefined():
    assert measured(recording(0.5, 20.0), 0.5)[0].mode == "in-phase"
    assert measured(recording(0.5, 160.0), 0.5)[0].mode == "anti-phase"
    still, cycles = measured(recording(0.5, ankle=np.full(4000, 0.1)), 0.5)
    assert still.mode == "undefined" and math.isnan(still.hip_ankle_r) and math.isnan(still.phase_mean_deg)
    assert math.isnan(still.hilbert_mean_deg) and np.isnan(cycles.values["hip_ankle_r"]).all()
    assert np.isnan(cycles.values["relative_phase_deg"]).all()
    alone, cycles = measured(recording(0.5, head=None, target=None), 0.5)
    assert math.isnan(alone.head_amplitude_m) and math.isnan(alone.target_head_r) and "head_speed_mps" not in cycles.values
    assert alone.cycles == 15


def test_a_gap_costs_its_cycles_only():
    one = recording(0.5, 30.0)
    hip = one.hip.copy()
    hip[2050:2060] = math.nan  # within the cycle from 20 to 22 s
    found, cycles = measured(recording(0.5, 30.0, hip=hip), 0.5)
    whole, _ = measured(one, 0.5)
    assert (whole.cycles, found.cycles, found.cycles_left_out) == (15, 14, 1)
    assert 20.0 not in cycles.start and 22.0 in cycles.start
    assert found.missing_share == pytest.approx(10 / 4000)
    assert found.phase_mean_deg == pytest.approx(whole.phase_mean_deg, abs=1e-6)
    assert found.hip_ankle_r == pytest.approx(whole.hip_ankle_r, abs=0.01)


def test_what_cannot_be_measured():
    with pytest.raises(ValueError, match="evaluation.transient: 40 s leaves nothing of a trial that ends at 39.99 s"):
        measured(recording(), 0.5, transient_s=40.0)
    with pytest.raises(ValueError, match="fewer than 6 samples in a cycle at 2 Hz"):
        measured(recording(2.0, time=times(40.0, 10.0)), 2.0)


# -- intervals ---------------------------------------------------------------------------------------------------------


def test_intervals_by_hand():
    """1, 2, 3: mean 2, sd 1, Student's t for 2 degrees of freedom 4.3027, so 2 -+ 4.3027 / sqrt(3) = 2 -+ 2.4842."""
    assert mean_interval(np.array([1.0, 2.0, 3.0, math.nan])) == pytest.approx((2.0, -0.4842, 4.4842), abs=1e-4)
    assert mean_interval(np.array([5.0]))[0] == 5.0 and math.isnan(mean_interval(np.array([5.0])).low)
    # artanh 0.5 = 0.5493 and artanh 0.9 = 1.4722: mean 1.0108, sd 0.6526, t for 1 degree of freedom 12.7062.
    half = 12.7062 * 0.6526 / math.sqrt(2)
    expected = [math.tanh(value) for value in (1.0108, 1.0108 - half, 1.0108 + half)]
    assert mean_correlation([0.5, 0.9]) == pytest.approx(expected, abs=1e-4)
    assert mean_correlation([1.0, 1.0]).mean == pytest.approx(1.0)


def test_intervals_hold_the_mean_over_many_trials():
    """Cycles with independent noise: 95 % of the intervals of the relative phase and of the hip's range hold the truth."""
    draw, inside, wide = np.random.default_rng(7), 0, 0
    time = times(30.0, 25.0)
    for _ in range(100):
        leads = np.repeat(draw.normal(40.0, 12.0, 30), 25)
        sizes = np.repeat(draw.normal(1.0, 0.1, 30), 25)
        hip = HIP * sizes * wave(time, 1.0, leads)
        found, cycles = measured(recording(1.0, time=time, hip=hip), 1.0, transient_s=0.0)
        inside += found.phase_low_deg < 40.0 < found.phase_high_deg
        low, high = cycles.intervals()["hip_range_deg"][1:]
        wide += low < math.degrees(2 * HIP) * 0.996 < high  # the mean of the largest of 25 samples a cycle
    assert inside / 100 > 0.88 and wide / 100 > 0.85


# -- the Hilbert transform ---------------------------------------------------------------------------------------------


def test_hilbert_leaves_out_edges_and_gaps():
    one = recording(0.5, 70.0)
    hip = one.hip.copy()
    hip[2000:2010] = math.nan
    found = hilbert_phases(hip, one.ankle, one.time, (0.25, 1.0), 2.0, 0.0)
    assert np.isnan(found[:200]).all() and np.isnan(found[1800:2210]).all() and np.isnan(found[-200:]).all()
    inside = found[np.isfinite(found)]
    assert len(inside) == 4000 - 200 - 410 - 200
    np.testing.assert_allclose(inside, 70.0, atol=7.0)
    assert inside.mean() == pytest.approx(70.0, abs=0.6)


# -- trials of the simulated body --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def evaluated():
    """The results of `posture.eval` for the shipped policy, and its trajectories."""
    return evaluate_at([0.3, 0.9], "pretrained", duration=20.0)


SAME = [
    field.name
    for field in fields(Indices)
    if field.name in {other.name for other in fields(Result)} and field.name != "ramp"
]


@pytest.mark.parametrize("kind", ["csv", "sto", "sto in degrees"])
@pytest.mark.parametrize("world", [0, 1])
def test_an_exported_trial_has_the_indices_of_its_evaluation(evaluated, tmp_path, kind, world):
    rows, trajectory = evaluated
    if kind == "csv":
        write_csv(trajectory, world, path := tmp_path / "a.csv")
    else:
        write_sto(trajectory, world, path := tmp_path / "a.sto", in_degrees="degrees" in kind)
    found = analyse(path, config()).trial
    assert found.freq_from == "target" and found.indices.freq_hz == pytest.approx(rows[world].freq_hz, rel=1e-6)
    assert len(SAME) == 27
    for name in SAME:
        own, expected = getattr(found.indices, name), getattr(rows[world], name)
        if isinstance(expected, str):
            assert own == expected
        else:
            assert own == pytest.approx(expected, rel=1e-5, abs=1e-9), name
