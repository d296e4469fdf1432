"""Indices of synthetic motions with known phase, amplitude, noise, drift and missing cycles."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from envs.body.joints import ANKLES, HIPS
from posture.analysis.coordination import (
    circular_mean_sd,
    correlation,
    cycle_amplitude,
    cycle_phases,
    cycles,
    relative_phase_paper,
)
from posture.analysis.results import read_csv, write_csv
from posture.analysis.table import evaluation_columns, markdown_table, text_table
from tests.posture.analysis.test_coordination import DT, TIME, difference, row, trial, wave

# Periods that are a whole number of samples and fit whole into 100 s and into 90 s, so that hand arithmetic is exact.
samples_a_period = st.sampled_from([40, 50, 60, 120, 300, 600])
phases = st.floats(-3.0, 3.0)
seeds = st.integers(0, 2**32 - 1)


@given(samples_a_period, phases, st.floats(0.0, 0.5), seeds)
@settings(deadline=None)
def test_noise_lowers_the_correlation_by_the_reliability(period, phase, noise, seed):
    """White noise of variance s^2 on both unit sinusoids (variance 1/2): r = cos(phase) / (1 + 2 s^2), within five standard
    errors of 6000 samples."""
    drawn = np.random.default_rng(seed).normal(size=(2, len(TIME)))
    freq = 1 / (period * DT)
    a, b = wave(freq, phase) + noise * drawn[0], wave(freq) + noise * drawn[1]
    assert correlation(a, b) == pytest.approx(
        math.cos(phase) / (1 + 2 * noise**2), abs=5 * noise * 2 / math.sqrt(len(TIME)) + 1e-9
    )


@given(samples_a_period, phases, st.floats(0.0, 0.3), seeds)
@settings(deadline=None)
def test_noise_does_not_bias_the_phase(period, phase, noise, seed):
    """Of a fit over M samples in all, the phase of a unit sinusoid has the standard error s sqrt(2 / M); two of them."""
    drawn = np.random.default_rng(seed).normal(size=(2, len(TIME)))
    freq = 1 / (period * DT)
    parts = cycles(TIME, freq, 10.0)
    found = cycle_phases(wave(freq, phase) + noise * drawn[0], wave(freq) + noise * drawn[1], TIME, freq, parts, still=0.0)
    mean, _ = circular_mean_sd(found)
    error = math.degrees(noise * math.sqrt(4 / (len(parts) * period)))
    assert difference(mean, math.degrees(phase)) < 6 * error + 1e-6


@given(samples_a_period, phases, st.floats(-0.02, 0.02), st.floats(0.5, 2.0))
@settings(deadline=None)
def test_drift_leaves_phase_and_amplitude(period, phase, drift, amplitude):
    """A drift of d a second moves a cycle's Fourier component by d T / pi at most, T its period, and its peak-to-peak
    value by d T at most."""
    freq = 1 / (period * DT)
    parts = cycles(TIME, freq, 10.0)
    hip, ankle = amplitude * wave(freq, phase) + drift * TIME, wave(freq)
    mean, sd = circular_mean_sd(cycle_phases(hip, ankle, TIME, freq, parts, still=0.0))
    shift = abs(drift) / freq / math.pi / amplitude
    assert difference(mean, math.degrees(phase)) < math.degrees(math.asin(min(1.0, 1.05 * shift))) + 1e-4
    assert sd < 1e-3 + math.degrees(1e-6)
    found = cycle_amplitude(hip, parts)
    assert abs(found - amplitude) <= abs(drift) / freq / 2 + amplitude * (1 - math.cos(math.pi / period)) + 1e-9


@given(samples_a_period, phases, st.data())
@settings(deadline=None)
def test_cycles_without_motion_are_left_out_of_the_phase(period, phase, data):
    """In some cycles the hip is still: their phase is undefined, and the mean is that of the others."""
    freq = 1 / (period * DT)
    parts = cycles(TIME, freq, 10.0)
    missing = data.draw(st.sets(st.integers(0, len(parts) - 1), max_size=len(parts)))
    hip = wave(freq, phase)
    for i in missing:
        hip[parts[i]] = 0.3
    found = cycle_phases(hip, wave(freq), TIME, freq, parts, still=0.5)
    assert set(np.flatnonzero(np.isnan(found))) == missing
    mean, _ = circular_mean_sd(found)
    assert math.isnan(mean) if len(missing) == len(parts) else difference(mean, math.degrees(phase)) < 1e-6


@given(samples_a_period, phases)
@settings(deadline=None)
def test_definitions_of_the_paper_by_hand(period, phase):
    """|t0 - t1| f pi, where t0 and t1 are the maxima: for a lag of k samples in a period of n it is pi k / n."""
    freq = 1 / (period * DT)
    lag = round(phase / (2 * math.pi) * period)
    parts = cycles(TIME, freq, 10.0)
    hip, ankle = (np.cos(2 * math.pi * (np.arange(len(TIME)) + k) / period) for k in (lag, 0))
    assert relative_phase_paper(hip, ankle, TIME, freq, parts) == pytest.approx(math.pi * abs(lag) / period)
    assert correlation(hip, ankle) == pytest.approx(math.cos(2 * math.pi * lag / period), abs=1e-9)


UNDEFINED = ("hip_ankle_r", "relative_phase_paper_rad", "relative_phase_deg", "phase_mean_deg", "phase_sd_deg")


@given(st.sampled_from(["hip", "ankle", "both"]), st.floats(-1.0, 1.0), st.floats(0.0, 0.2))
@settings(max_examples=20, deadline=None)
def test_a_flat_joint_is_undefined_in_every_table(tmp_path_factory, which, level, ripple):
    """Neither 0 nor nan is shown: the mode is "undefined" and numbers are a dash. `ripple` [deg] is below what counts."""
    angle = trial(0.5).joint_angle.copy()
    for joint, columns in (("hip", HIPS), ("ankle", ANKLES)):
        if which in (joint, "both"):
            angle[..., columns] = level + math.radians(ripple) * wave(0.5)[:, None, None]
    found = row(trial(0.5, joint_angle=angle))
    assert found.valid and found.mode == "undefined" and all(math.isnan(getattr(found, name)) for name in UNDEFINED)
    for text in (draw([found], evaluation_columns([found], None)) for draw in (text_table, markdown_table)):
        assert "undefined" in text and "nan" not in text
        assert [cell for cell in text.splitlines()[-1].replace("|", " ").split()].count("-") == 2
    path = tmp_path_factory.mktemp("rows") / "rows.csv"
    write_csv([found], path)
    (read,) = read_csv(path)
    assert read.mode == "undefined" and math.isnan(read.hip_ankle_r)


def test_a_head_or_target_that_stands_still_has_no_correlation():
    still = np.full((len(TIME), 1), 0.1)
    found = row(trial(0.5, head_x=still))
    assert math.isnan(found.target_head_r) and found.head_amplitude_m == 0.0
    assert "nan" not in text_table([found], evaluation_columns([found], None))
