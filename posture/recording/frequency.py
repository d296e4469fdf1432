"""The frequency of a recorded motion, constant or changing. Pure functions on arrays."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from scipy.optimize import isotonic_regression, minimize_scalar
from scipy.signal import find_peaks

from posture.analysis.trajectory import Array

SAMPLES_A_CYCLE = 24
"""Of the averaged signal to which a sinusoid is fitted."""
PROMINENCE = 0.25
"""Share of its range by which a signal must rise and fall about an extremum that counts."""


def sinusoid_frequency(time: Array, signal: Array) -> tuple[float, float]:
    """Frequency [Hz] of the sinusoid that fits `signal` (T,) best, and the share of the variance that it explains, 0 .. 1.

    `time` (T,) evenly spaced [s]; nan values of the signal are left out. The peak of the spectrum, then least squares with
    offset and straight line about it. (nan, nan) where the signal is constant or shows less than a cycle.
    """
    known = np.isfinite(signal)
    rate = (len(time) - 1) / (time[-1] - time[0])
    if np.count_nonzero(known) < 8 or np.ptp(signal[known]) <= 1e-12 * max(1.0, float(np.abs(signal[known]).max())):
        return math.nan, math.nan
    line = np.polynomial.Polynomial.fit(time[known], signal[known], 1)
    centred = np.where(known, signal - line(time), 0.0)
    size = 4 * len(centred)  # finer than the resolution of the recording, so that the fit begins near its optimum
    spectrum = np.abs(np.fft.rfft(centred * np.hanning(len(centred)), size))
    spectrum[: math.ceil(0.8 * size / len(centred))] = 0.0  # less than a cycle
    if not spectrum.any():
        return math.nan, math.nan
    start = float(np.argmax(spectrum)) * rate / size
    t, y = _averaged(time, signal, max(1, int(rate / (SAMPLES_A_CYCLE * start))))
    width = 0.6 * rate / len(time)
    found = minimize_scalar(
        lambda freq: -share_of_sinusoid(t, y, freq),
        bounds=(max(start - width, 0.2 * start), start + width),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return float(found.x), -float(found.fun)


def share_of_sinusoid(time: Array, signal: Array, freq: float) -> float:
    """Share of the variance of `signal` (T,) that a sinusoid of `freq` [Hz], with offset and straight line, explains,
    0 .. 1; nan values are left out, nan where it is constant. `time` (T,) [s]."""
    known = np.isfinite(signal)
    t, y = time[known], signal[known] - signal[known].mean()
    angle = 2 * math.pi * freq * t
    basis = np.stack([np.ones_like(t), t - t[0], np.cos(angle), np.sin(angle)], axis=1)
    rest = y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0]
    return 1 - float(rest @ rest) / float(y @ y) if y.any() else math.nan


def _averaged(time: Array, signal: Array, count: int) -> tuple[Array, Array]:
    """Means of `count` samples each, without those in which a value is missing."""
    whole = len(time) // count * count
    t, y = (values[:whole].reshape(-1, count).mean(axis=1) for values in (time, signal))
    known = np.isfinite(y)
    return t[known], y[known]


def momentary_frequency(time: Array, signal: Array) -> Array:
    """Momentary frequency [Hz] of `signal` (T,), whose frequency rises or falls throughout, at `time` (T,) [s], evenly
    spaced.

    Half a cycle lies between the times at which two strokes pass the middle between their extrema. Of these half cycles'
    frequencies the best rising, or falling, sequence is taken (isotonic regression), linear between the middles of the half
    cycles and constant beyond; a slope too small to matter makes it strictly so. nan values of the signal are interpolated.
    All nan with fewer than three strokes.
    """
    known = np.isfinite(signal)
    if not known.any():
        return np.full(len(time), math.nan)
    filled = np.interp(time, time[known], signal[known])
    least = PROMINENCE * float(np.ptp(filled))
    if not least > 0:
        return np.full(len(time), math.nan)
    extrema = np.sort(np.concatenate([find_peaks(sign * filled, prominence=least)[0] for sign in (1.0, -1.0)]))
    at = np.array([_crossing(time[i : j + 1], filled[i : j + 1]) for i, j in pairwise(extrema)])
    if len(at) < 3:
        return np.full(len(time), math.nan)
    middle, freq = (at[1:] + at[:-1]) / 2, 0.5 / np.diff(at)
    rising = np.polyfit(middle, freq, 1)[0] >= 0
    ordered = isotonic_regression(freq, increasing=bool(rising)).x
    tilt = (1e-9 if rising else -1e-9) * np.arange(len(time))
    return np.asarray(np.interp(time, middle, ordered) + tilt)


def _crossing(time: Array, stroke: Array) -> float:
    """When a stroke, from one extremum to the next, crosses the middle between them [s]; the mean of the first and the last
    crossing where noise makes several."""
    above = (stroke - (stroke[0] + stroke[-1]) / 2) * np.sign(stroke[-1] - stroke[0])
    first, last = int(np.argmax(above >= 0)), len(above) - int(np.argmax(above[::-1] < 0))
    return float(np.mean([np.interp(0.0, above[i - 1 : i + 1], time[i - 1 : i + 1]) for i in (first, last)]))
