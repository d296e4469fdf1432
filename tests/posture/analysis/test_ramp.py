"""Ramp indices of signals whose phase is known; the running correlation against NumPy's own, window by window."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posture.analysis.ramp import ramp_frequency, ramp_transition, transitions, window_correlation

DT = 1 / 60
TIME = np.arange(1500) * DT  # 25 s
RATE, WINDOW = 0.036, 300  # paper Exp. 4a


def wave(freq: float, phase: float = 0.0) -> np.ndarray:
    return np.cos(2 * math.pi * freq * TIME + phase)


# --- frequency


def test_frequency_by_hand() -> None:
    # 0.1 + 0.036 x 10 = 0.46 Hz after 10 s; it holds at 0.1 + 0.036 x 25 = 1 Hz.
    assert ramp_frequency([0.0, 10.0, 25.0, 40.0], 0.1, RATE, 25.0) == pytest.approx([0.1, 0.46, 1.0, 1.0])


def test_frequency_is_the_derivative_of_the_phase_of_the_target() -> None:
    """The phase is 2 pi times the integral of the frequency: start t + rate t^2 / 2 cycles until the ramp ends."""
    time = np.arange(0, 30, 0.01)
    ramped = np.minimum(time, 25.0)
    cycles = 0.2 * time + RATE * (ramped * time - ramped**2 / 2)
    # The derivative by central differences, exact for a parabola; it is not where the ramp ends.
    inside = abs(time[1:-1] - 25.0) > 0.011
    expected = ((cycles[2:] - cycles[:-2]) / 0.02)[inside]
    assert ramp_frequency(time, 0.2, RATE, 25.0)[1:-1][inside] == pytest.approx(expected, abs=1e-9)


# --- running correlation


@pytest.mark.parametrize("centred", [True, False])
@pytest.mark.parametrize("steps", [2, 7, 40])
@given(seed=st.integers(0, 1000), offset=st.floats(-1e3, 1e3))
def test_every_window_agrees_with_numpy(steps: int, centred: bool, seed: int, offset: float) -> None:
    draw = np.random.default_rng(seed)
    a = offset + draw.normal(size=60).cumsum()
    b = 0.3 * a + draw.normal(size=60)
    found = window_correlation(a, b, steps, centred=centred)
    for i, value in enumerate(found):
        start = i - steps // 2 if centred else i - steps + 1
        if start < 0 or start + steps > 60:
            assert math.isnan(value)
        else:
            expected = np.corrcoef(a[start : start + steps], b[start : start + steps])[0, 1]
            assert value == pytest.approx(expected, abs=1e-7)


def test_a_small_motion_far_from_zero_keeps_its_correlation() -> None:
    # 1 part in 10 million of the offset: running sums of squares would lose it by cancellation.
    hip, ankle = 1.0 + 1e-7 * wave(1.0), 1.0 - 1e-7 * wave(1.0)
    assert np.nanmax(abs(window_correlation(hip, ankle, WINDOW, centred=False) + 1)) < 1e-8


@pytest.mark.parametrize("phase", [0.0, 1.0, math.pi / 2, 2.5, math.pi])
def test_of_two_sinusoids_it_is_the_cosine_of_their_phase(phase: float) -> None:
    # Over whole cycles: 300 steps are five of 1 Hz.
    r = window_correlation(-0.1 + wave(1.0, phase), 0.3 * wave(1.0), WINDOW, centred=True)
    assert r[150:1351] == pytest.approx(np.full(1201, math.cos(phase)), abs=1e-9)
    assert np.isnan(r[:150]).all()
    assert np.isnan(r[1351:]).all()


@pytest.mark.parametrize(("centred", "lag"), [(True, 0.0), (False, 2.5)])
def test_trailing_lags_by_half_a_window(centred: bool, lag: float) -> None:
    # In-phase up to 12 s, anti-phase from there: r is zero where half of the window, 2.5 s, lies on either side.
    hip = wave(1.0) * np.where(TIME < 12.0, 1.0, -1.0)
    r = window_correlation(hip, wave(1.0), WINDOW, centred=centred)
    change = TIME[np.flatnonzero(r > 0)[-1]]
    assert change == pytest.approx(12.0 + lag, abs=2 * DT)
    found = ramp_transition(ramp_frequency(TIME, 0.0, RATE, 25.0), r)
    assert found.freq_hz == pytest.approx(RATE * (12.0 + lag), abs=RATE * 2 * DT)
    assert found.crossings == 1


def test_a_joint_that_hardly_moves_has_no_correlation() -> None:
    # The ankle moves by +-0.5 deg for 10 s and by +-0.05 deg after.
    ankle = np.radians(np.where(TIME < 10.0, 0.5, 0.05)) * wave(1.0)
    r = window_correlation(wave(1.0), ankle, WINDOW, centred=False, still_rad=math.radians(0.3))
    assert np.isnan(r[:299]).all()
    assert np.isfinite(r[299:600]).all()
    # 5 s later only the small motion is in the window.
    assert np.isnan(r[900:]).all()
    assert np.isfinite(window_correlation(wave(1.0), ankle, WINDOW, centred=False)[299:]).all()
    assert np.isnan(window_correlation(wave(1.0), np.full(1500, 0.2), WINDOW, centred=False)).all()


def test_windows_with_a_gap_or_longer_than_the_trial_are_undefined() -> None:
    hip = wave(1.0)
    hip[700] = math.nan
    r = window_correlation(hip, wave(1.0), WINDOW, centred=False)
    assert np.flatnonzero(np.isfinite(r)).tolist() == [*range(299, 700), *range(1000, 1500)]
    for steps, defined in ((299, 0), (300, 1)):
        assert np.isfinite(window_correlation(hip[:steps], hip[:steps], WINDOW, centred=False)).sum() == defined


def test_bad_input_is_refused() -> None:
    with pytest.raises(ValueError, match=r"hip has shape \(3,\), ankle \(2,\)"):
        window_correlation([1.0, 2.0, 3.0], [1.0, 2.0], 2, centred=True)
    with pytest.raises(ValueError, match="window_steps is 1"):
        window_correlation([1.0, 2.0], [1.0, 2.0], 1, centred=True)
    with pytest.raises(ValueError, match=r"freq_t has shape \(2,\), r \(1,\)"):
        ramp_transition([0.1, 0.2], [1.0])


# --- transition


NAN = math.nan


@pytest.mark.parametrize(
    ("freq", "r", "expected", "crossings"),
    [
        # From 0.6 to -0.2 between 0.4 and 0.6 Hz: three quarters of the way.
        ([0.2, 0.4, 0.6, 0.8], [0.9, 0.6, -0.2, -0.9], 0.55, 1),
        # Noise at the start (down at 0.15 Hz, up at 0.25 Hz), then the transition: the last change to anti-phase counts,
        ([0.1, 0.2, 0.3, 0.6, 0.7], [0.5, -0.5, 0.5, 0.5, -0.5], 0.65, 3),
        # also where it is followed by a change back to in-phase.
        ([0.1, 0.2, 0.3, 0.6, 0.7], [0.5, 0.5, -0.5, -0.5, 0.5], 0.25, 2),
        ([0.1, 0.2, 0.3], [0.5, 0.4, 0.3], None, 0),
        ([0.1, 0.2, 0.3], [-0.5, -0.4, 0.3], None, 1),
        ([0.1, 0.2, 0.3], [NAN, NAN, NAN], None, 0),
        ([], [], None, 0),
        # Over a gap the line runs from neighbour to neighbour. A zero counts where it is, with a sign change only.
        ([0.1, 0.2, 0.3, 0.4], [NAN, 0.5, NAN, -0.5], 0.3, 1),
        ([0.1, 0.2, 0.3, 0.4], [0.5, 0.0, 0.0, -0.5], 0.2, 1),
        ([0.1, 0.2, 0.3], [0.5, 0.0, 0.5], None, 0),
        # The frequency is constant from 0.3 Hz on: a sign change there has no frequency.
        ([0.1, 0.2, 0.3, 0.3, 0.3], [0.5, 0.5, 0.4, -0.4, -0.5], None, 0),
    ],
)
def test_transition_by_hand(freq, r, expected, crossings) -> None:
    assert ramp_transition(freq, r) == (None if expected is None else pytest.approx(expected), crossings)


@given(st.floats(0.1, 0.8))
def test_transition_of_a_straight_line(zero: float) -> None:
    freq = ramp_frequency(TIME, 0.0, RATE, 25.0)
    assert ramp_transition(freq, zero - freq) == (pytest.approx(zero), 1)


def test_a_ramp_of_known_phase() -> None:
    """Motion at the rising frequency, the hip lagging by 90 deg x f / 0.5 Hz: at 0.5 Hz the correlation is zero."""
    freq = ramp_frequency(TIME, 0.0, RATE, 25.0)
    angle = 2 * math.pi * 0.5 * RATE * TIME**2
    hip, ankle = np.cos(angle - math.pi / 2 * freq / 0.5)[:, None], np.cos(angle)[:, None]
    recorded = SimpleNamespace(time=TIME, hip=np.hstack([hip, hip]), ankle=np.hstack([ankle, hip]))
    found, without = transitions(recorded, 0.0, RATE, 25.0, WINDOW, 0.0)
    # A window of 5 s holds 2.5 cycles there, and the remaining half cycle moves the zero a little.
    assert found.transition_centred_hz == pytest.approx(0.5, abs=0.04)
    # Half a window is 2.5 s x 0.036 Hz/s = 0.09 Hz.
    assert found.transition_trailing_hz - found.transition_centred_hz == pytest.approx(0.09, abs=0.001)
    assert found.crossings_centred == found.crossings_trailing == 1
    assert math.isnan(without.transition_centred_hz) and without.crossings_trailing == 0
