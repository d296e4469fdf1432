"""Gaps, drift, noise and sampling rates, against signals that are known in between."""

import math

import numpy as np
import pytest

from posture.config.errors import ConfigError
from posture.recording.signals import even_times, fill_gaps, filtered, prepare, stretches, without_trend
from tests.posture.recording.people import HIP, RATE, config, recording, times, wave


def test_an_even_time_base():
    even = times(1.0)
    assert even_times(even, 0.01) is even
    rounded = np.round(np.arange(100) / 60, 3)  # to milliseconds
    np.testing.assert_allclose(even_times(rounded, 0.0167), np.arange(100) / 60, atol=1e-5)
    np.testing.assert_allclose(even_times(np.array([0.0, 0.1, 0.2, 0.5, 0.6]), 0.1), np.arange(7) / 10)  # frames were lost


def test_short_gaps_are_filled_and_long_ones_are_not():
    time = times(10.0)
    signal = wave(time, 0.5)
    missing = signal.copy()
    missing[300:310] = missing[500:521] = missing[:2] = missing[-1:] = math.nan
    filled = fill_gaps(time, missing, time, 0.2, 0.01)
    assert np.flatnonzero(np.isnan(filled)).tolist() == [0, 1, *range(500, 521), 999]  # 0.21 s is too long
    np.testing.assert_array_equal(filled[:300][2:], signal[2:300])
    # Over 0.11 s of a wave of 2 s even a straight line is off by at most (0.11 pi)^2 / 8 = 0.015.
    np.testing.assert_allclose(filled[300:310], signal[300:310], atol=0.01)


def test_lost_rows_and_uneven_times():
    time = times(10.0)
    kept = np.ones(len(time), dtype=bool)
    kept[200:215] = kept[600:650] = False
    filled = fill_gaps(time[kept], wave(time, 0.5)[kept], even_times(time[kept], 0.01), 0.2, 0.01)
    assert np.flatnonzero(np.isnan(filled)).tolist() == list(range(600, 650))
    shaken = time + np.random.default_rng(1).uniform(-0.004, 0.004, len(time))
    grid = even_times(shaken, 0.01)
    inside = slice(1, -1)
    np.testing.assert_allclose(
        fill_gaps(shaken, wave(shaken, 0.5), grid, 0.2, 0.01)[inside], wave(grid, 0.5)[inside], atol=1e-3
    )


def test_a_straight_line_is_taken_away_and_the_mean_kept():
    time = times(10.0)
    line = 0.3 * time + 2.0
    missing = line.copy()
    missing[100:200] = math.nan
    flat = without_trend(time, missing)
    known = np.isfinite(missing)
    np.testing.assert_allclose(flat[known], missing[known].mean())
    assert np.isnan(flat[~known]).all()


@pytest.mark.parametrize(("kind", "cutoff"), [("lowpass", 2.0), ("highpass", 2.0)])
def test_filters_have_the_gain_of_butterworth_twice_and_no_phase(kind, cutoff):
    """|H|^2 = 1 / (1 + (f / fc)^4) of order 2, and once in each direction; a filter for high frequencies has fc / f."""
    time = times(40.0)
    for freq in (0.5, 2.0, 5.0):
        ratio = freq / cutoff if kind == "lowpass" else cutoff / freq
        gain = 1 / (1 + ratio**4)
        middle = slice(1000, 3000)
        found = filtered(wave(time, freq), RATE, cutoff, kind)[middle]
        # The bilinear transform bends frequencies near half the sampling rate, here 50 Hz.
        np.testing.assert_allclose(found, gain * wave(time, freq)[middle], atol=0.02)


def test_filters_do_not_reach_over_gaps():
    signal = wave(times(20.0), 0.5)
    signal[1000:1100] = math.nan
    changed = signal.copy()
    changed[1100:] += 100.0
    first, second = (filtered(values, RATE, 3.0, "lowpass") for values in (signal, changed))
    np.testing.assert_array_equal(first[:1000], second[:1000])
    assert [(run.start, run.stop) for run in stretches(np.isfinite(first))] == [(0, 1000), (1100, 2000)]


def test_what_is_configured_is_done():
    time = times(40.0)
    noisy = recording(0.5, time=time + 100.0, hip=HIP * wave(time, 0.5) + 0.02 * time + 0.05 * wave(time, 20.0))
    found = prepare(noisy, config("detrend=true", "low_pass=3", "resample=25"))
    assert found.time[0] == 0.0 and np.diff(found.time) == pytest.approx(0.04)
    # The line of a sinusoid over whole cycles is not quite level, which the tolerance covers.
    expected = HIP * wave(found.time, 0.5)
    middle = slice(50, -50)
    np.testing.assert_allclose((found.hip - found.hip.mean())[middle], expected[middle], atol=0.01)
    untouched = prepare(recording(), config())
    np.testing.assert_array_equal(untouched.hip, recording().hip)
    np.testing.assert_array_equal(untouched.time, recording().time)


def test_high_pass_takes_slow_drift():
    time = times(60.0)
    drifting = recording(0.5, time=time, hip=HIP * wave(time, 0.5) + 0.2 * wave(time, 0.01))
    found = prepare(drifting, config("high_pass=0.1"))
    middle = slice(1000, -1000)
    np.testing.assert_allclose(found.hip[middle], HIP * wave(time, 0.5)[middle], atol=0.005)


@pytest.mark.parametrize(
    ("changes", "overrides", "message"),
    [
        ({"time": times(0.05)}, [], "has 5 samples of hip and ankle; at least 10 are needed"),
        ({"hip": np.full(4000, math.nan)}, [], "has 0 samples of hip and ankle"),
        ({}, ["low_pass=50"], "low_pass=50 is not below half its sampling rate of 100 Hz"),
        ({}, ["high_pass=60"], "high_pass=60 is not below half"),
        ({"time": np.append(times()[:-1], 1e9)}, [], r"1e\+09 s at 100 Hz are more than 50,000,000 samples"),
        ({"time": 10 * times()}, ["resample=1000000"], r"399\.9 s at resample=1e\+06 are more than"),
    ],
)
def test_what_cannot_be_prepared(changes, overrides, message):
    with pytest.raises(ConfigError, match=message):
        prepare(recording(**changes), config(*overrides))
