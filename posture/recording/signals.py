"""A recording on an even time base: missing samples, drift, noise and sampling rate. Pure functions on arrays."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.signal import butter, sosfiltfilt

from posture.analysis.trajectory import Array
from posture.config.analyse import AnalyseConfig
from posture.recording.columns import Recording
from posture.recording.table import refuse

JITTER = 0.05
"""Times that are this share of a sampling interval off an even grid are even ones that were rounded."""
FILTER_ORDER = 2
"""Of a Butterworth filter, which runs forward and backward, so that it shifts no phase and has twice this order."""
NEW_RATE_SHARE = 0.4
"""Of a lower sampling rate: where the signals are low-pass filtered before they are resampled."""
FEWEST, MOST = 10, 50_000_000
"""Samples without which nothing can be said, and more than which take gigabytes of memory."""


def prepare(recording: Recording, config: AnalyseConfig) -> Recording:
    """The recording on an even time base, with short gaps filled, long ones nan in each signal, and filtered as configured.

    Times that do not begin within a sampling interval of 0 are counted from the first sample. Raises ConfigError where the
    recording is too short, or a filter does not fit its sampling rate.
    """
    known = np.isfinite(recording.hip) & np.isfinite(recording.ankle)
    if np.count_nonzero(known) < FEWEST:
        raise refuse(recording.path, f"has {np.count_nonzero(known)} samples of hip and ankle; at least {FEWEST} are needed")
    time = recording.time
    interval = float(np.median(np.diff(time)))
    _check_rates(recording, config, 1 / interval)
    grid = even_times(time, interval)
    new = grid if config.resample is None else np.arange(_count(grid, 1 / config.resample)) / config.resample + grid[0]
    lowest = NEW_RATE_SHARE * config.resample if config.resample and config.resample * interval < 1 else None

    def prepared(values: Array) -> Array:
        filled = fill_gaps(time, values, grid, config.max_gap, interval)
        if config.detrend:
            filled = without_trend(grid, filled)
        if config.high_pass is not None:
            filled = filtered(filled, 1 / interval, config.high_pass, "highpass")
        for cutoff in (config.low_pass, lowest):
            if cutoff is not None:
                filled = filtered(filled, 1 / interval, cutoff, "lowpass")
        return filled if new is grid else fill_gaps(grid, filled, new, 0.0, interval)

    def resampled(values: Array) -> Array:
        filled = fill_gaps(time, values, grid, config.max_gap, interval)
        return filled if new is grid else fill_gaps(grid, filled, new, 0.0, interval)

    shift = 0.0 if abs(new[0]) <= 1.5 * interval else new[0]
    return replace(
        recording,
        time=new - shift,
        hip=prepared(recording.hip),
        ankle=prepared(recording.ankle),
        head=None if recording.head is None else prepared(recording.head),
        target=None if recording.target is None else prepared(recording.target),
        simulated={name: resampled(values) for name, values in recording.simulated.items()},
    )


def _check_rates(recording: Recording, config: AnalyseConfig, rate: float) -> None:
    """Raise ConfigError where a filter or the new rate does not fit a sampling rate [Hz]."""
    for key in ("low_pass", "high_pass"):
        cutoff = getattr(config, key)
        if cutoff is not None and cutoff >= 0.499999 * rate:
            raise refuse(recording.path, f"{key}={cutoff:g} is not below half its sampling rate of {rate:.4g} Hz")
    duration = recording.time[-1] - recording.time[0]
    if duration * max(rate, config.resample or 0.0) > MOST:
        rates = f"{rate:.4g} Hz" if config.resample is None else f"resample={config.resample:g}"
        raise refuse(recording.path, f"{duration:.4g} s at {rates} are more than {MOST:,} samples")


def even_times(time: Array, interval: float) -> Array:
    """Evenly spaced times [s] from the first to the last of `time` (T,), `interval` [s] apart; `time` itself where it is
    even but for rounding."""
    line = np.linspace(time[0], time[-1], len(time))
    if np.abs(time - line).max() <= JITTER * interval:
        return time if np.abs(time - line).max() <= 1e-6 * interval else line
    return np.asarray(time[0] + interval * np.arange(_count(time, interval)))


def _count(time: Array, interval: float) -> int:
    return math.floor((time[-1] - time[0]) / interval + 1e-6) + 1


def fill_gaps(time: Array, values: Array, grid: Array, max_gap: float, interval: float) -> Array:
    """`values` (T,) at `time` (T,) [s], nan where missing, at the times `grid` (N,) [s].

    Between samples that are further apart than `interval` [s], values are missing for the time between them less one
    interval. Up to `max_gap` [s] of it are filled by a monotone cubic (Fritsch and Carlson 1980), which never goes beyond
    the samples on either side; longer gaps, and times before the first and after the last value, are nan.
    """
    known = np.isfinite(values)
    if grid is time and known.all():
        return values
    t, v = time[known], values[known]
    if len(t) < 2:
        return np.full(len(grid), math.nan)
    after = np.clip(np.searchsorted(t, grid), 1, len(t) - 1)
    left, right = t[after - 1], t[after]
    nearest = np.minimum(np.abs(grid - left), np.abs(right - grid))
    slack = 1e-6 * interval
    inside = (grid >= t[0] - slack) & (grid <= t[-1] + slack)
    short = (right - left - interval <= max_gap + slack) | (nearest <= 0.5 * interval + slack)
    smooth = PchipInterpolator(t, v)(np.clip(grid, t[0], t[-1]))
    return np.where(inside & short, smooth, math.nan)


def without_trend(time: Array, values: Array) -> Array:
    """`values` (T,) less their straight line over `time` (T,), with their mean; nan is kept."""
    known = np.isfinite(values)
    if np.count_nonzero(known) < 2:
        return values
    centred = time - time[known].mean()
    slope = (centred[known] @ (values[known] - values[known].mean())) / (centred[known] @ centred[known])
    return np.asarray(values - slope * centred)


def filtered(values: Array, rate: float, cutoff: float | tuple[float, float], kind: str) -> Array:
    """`values` (T,), sampled at `rate` [Hz], through a zero-phase Butterworth filter: `kind` is lowpass, highpass or
    bandpass, `cutoff` [Hz]. Each stretch between gaps by itself; one too short for the filter becomes nan."""
    sos = butter(FILTER_ORDER, cutoff, kind, fs=rate, output="sos")
    slowest = cutoff if isinstance(cutoff, float) else cutoff[0]
    out = np.full(len(values), math.nan)
    for run in stretches(np.isfinite(values)):
        length = run.stop - run.start
        padding = min(max(round(rate / slowest), 12), length - 1)
        if length > 12:
            out[run] = sosfiltfilt(sos, values[run], padlen=padding)
    return out


def stretches(known: NDArray[np.bool_]) -> Iterator[slice]:
    """The runs of true values of `known` (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(np.int8)))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        yield slice(int(start), int(stop))
