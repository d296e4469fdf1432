"""Frequencies that are known."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posture.recording.frequency import momentary_frequency, sinusoid_frequency
from tests.posture.recording.people import times, wave


@given(freq=st.floats(0.05, 3.0), phase=st.floats(-180, 180), drift=st.floats(-0.1, 0.1))
def test_a_sinusoid_with_offset_and_drift(freq, phase, drift):
    time = times(40.0, 50.0)
    found, explained = sinusoid_frequency(time, 3.0 + drift * time + wave(time, freq, phase))
    assert found == pytest.approx(freq, rel=2e-3 if freq < 0.1 else 2e-4)
    assert explained > 0.99


def test_noise_and_gaps():
    """With the variance bound of Rife and Boorstyn (1974), sd(f) >= sqrt(6 / (snr N)) / (pi T): here 0.0001 Hz."""
    time = times(60.0)
    draw = np.random.default_rng(3)
    signal = wave(time, 0.4, 20.0) + draw.normal(scale=0.5, size=len(time))
    signal[1000:1300] = math.nan
    found, explained = sinusoid_frequency(time, signal)
    bound = math.sqrt(6 / (0.5 / 0.25 * len(time))) / (math.pi * 60)
    assert abs(found - 0.4) < 5 * bound
    # Of means of ten samples, some 24 a cycle, the noise has a tenth of its variance of 0.25, and the wave 0.5.
    assert explained == pytest.approx(0.5 / (0.5 + 0.025), abs=0.02)


def test_no_frequency():
    time = times(10.0)
    assert math.isnan(sinusoid_frequency(time, np.full(len(time), 2.0))[0])
    assert math.isnan(sinusoid_frequency(time, np.full(len(time), math.nan))[0])
    draw = np.random.default_rng(0)
    assert sinusoid_frequency(time, draw.normal(size=len(time)))[1] < 0.5


@pytest.mark.parametrize(("start", "rate"), [(0.2, 0.02), (1.0, -0.02)])
def test_a_frequency_that_changes(start, rate):
    time = times(40.0)
    signal = np.cos(2 * math.pi * (start * time + rate * time**2 / 2)) + np.random.default_rng(5).normal(
        scale=0.02, size=len(time)
    )
    found = momentary_frequency(time, signal)
    inside = (time > 4) & (time < 36)
    np.testing.assert_allclose(found[inside], (start + rate * time)[inside], atol=0.03)
    assert (np.diff(found) * rate > 0).all()


def test_steps_of_frequency():
    """Plateaus, as in experiments that raise the frequency in steps."""
    time = times(40.0)
    freq = np.where(time < 20, 0.3, 0.6)
    found = momentary_frequency(time, np.cos(2 * math.pi * np.cumsum(freq) * 0.01))
    np.testing.assert_allclose(found[(time > 2) & (time < 17)], 0.3, atol=0.01)
    np.testing.assert_allclose(found[(time > 22) & (time < 38)], 0.6, atol=0.01)


def test_too_few_strokes():
    time = times(3.0)
    assert np.isnan(momentary_frequency(time, wave(time, 0.4))).all()
    assert np.isnan(momentary_frequency(time, 0 * time)).all()
    nothing = momentary_frequency(time, np.full(len(time), math.nan))
    assert nothing.shape == time.shape and np.isnan(nothing).all()
