"""Indices of a trial in which the target's frequency rises linearly (paper Exp. 4a, Fig. 10): pure functions on arrays.

Signs: hip flexion is negative and the ankle is negative when the body leans forward, so a positive correlation is in-phase.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from posture.analysis.results import RampTransitions
from posture.analysis.trajectory import Array, Trajectory


class RampTransition(NamedTuple):
    """Where the correlation changes sign in a ramp.

    freq_hz: target frequency [Hz] of the last change from in-phase to anti-phase, None without one. crossings: the number
    of sign changes in either direction.
    """

    freq_hz: float | None
    crossings: int


def ramp_frequency(time: ArrayLike, start: float, rate: float, duration: float) -> Array:
    """Momentary frequency of the target [Hz] at `time` (T,) [s], shape (T,). Source: paper Exp. 4a.

    It begins at `start` [Hz], changes by `rate` [Hz/s] for `duration` [s] and then holds. The target's phase is 2 pi times
    its integral.
    """
    return start + rate * np.clip(np.asarray(time, dtype=np.float64), 0.0, duration)


def window_correlation(
    hip: ArrayLike, ankle: ArrayLike, window_steps: int, *, centred: bool, still_rad: float = 0.0
) -> Array:
    """Pearson correlation of hip and ankle in a window of `window_steps` samples, at every sample. Shape (T,).

    `hip` and `ankle` (T,) [rad], evenly spaced. The trailing window ends at the sample, as one that is computed while the
    trial runs. The centred one has the sample in its middle, and of an even number of samples one more before it than
    after it; the paper does not say which it used. In a ramp the trailing one shows a change (window_steps - 1) // 2 samples
    later, and so at a higher frequency.

    nan where the window is not full, where a value in it is not finite, and where either joint hardly moves in it: where it
    is constant, or its peak-to-peak is below `still_rad` [rad]. Source: paper Fig. 10, window of 300 steps.
    """
    a, b = (np.asarray(signal, dtype=np.float64) for signal in (hip, ankle))
    if a.shape != b.shape or a.ndim != 1:
        raise ValueError(f"hip has shape {a.shape}, ankle {b.shape}: both must be (T,)")
    if window_steps < 2:
        raise ValueError(f"window_steps is {window_steps}, but a correlation needs at least 2 samples")
    running = np.full(len(a), np.nan)
    if len(a) < window_steps:
        return running
    # Every window is centred and scaled by itself: sums carried along the trial would cancel where a joint moves little.
    windows = [sliding_window_view(signal, window_steps) for signal in (a, b)]
    span = [np.ptp(window, axis=1) for window in windows]
    moving = np.minimum(*span) >= max(still_rad, np.finfo(np.float64).tiny)  # false for nan
    first, second = (
        (window[moving] - window[moving].mean(axis=1, keepdims=True)) / np.ptp(window[moving], axis=1, keepdims=True)
        for window in windows
    )
    r = np.full(len(moving), np.nan)
    r[moving] = np.sum(first * second, axis=1) / np.sqrt(np.sum(first**2, axis=1) * np.sum(second**2, axis=1))
    lead = window_steps // 2 if centred else window_steps - 1
    running[lead : lead + len(r)] = np.clip(r, -1.0, 1.0)
    return running


def ramp_transition(freq_t: ArrayLike, r: ArrayLike) -> RampTransition:
    """The frequency at which a ramp leaves the in-phase mode, and how often the correlation changes sign in it.

    `freq_t` (T,) [Hz], the momentary target frequency, as from `ramp_frequency`; `r` (T,), the running correlation, as from
    `window_correlation`. The transition is the *last* change from positive to negative while the frequency rises, linear
    between its two samples. The last, since a ramp starts nearly at rest, where the sign of the correlation is noise, and
    since a stander that hesitates between the modes has made the switch only once it no longer returns. The paper reports a
    single zero, where any definition gives the same; `crossings` other than 1 says that here they may differ.

    A nan is left out, which widens the bracket it falls in. Samples at which the frequency does not rise (before and after
    the ramp) do not count. Source: paper Fig. 10, 0.69 Hz.
    """
    f, values = np.asarray(freq_t, dtype=np.float64), np.asarray(r, dtype=np.float64)
    if f.shape != values.shape or f.ndim != 1:
        raise ValueError(f"freq_t has shape {f.shape}, r {values.shape}: both must be (T,)")
    known = np.isfinite(f) & np.isfinite(values)
    f, values = f[known], values[known]
    transition, crossings = None, 0
    for i, j in pairwise(np.flatnonzero(values)):
        if (values[i] > 0) == (values[j] > 0) or f[j] <= f[i]:
            continue
        crossings += 1
        if values[i] > 0:
            # Over samples that are exactly zero, the first of them.
            share = 1.0 if j > i + 1 else values[i] / (values[i] - values[j])
            transition = float(f[i] + share * (f[i + 1] - f[i]))
    return RampTransition(transition, crossings)


def transitions(
    trajectory: Trajectory, start: float, rate: float, duration: float, window_steps: int, still_rad: float
) -> list[RampTransitions]:
    """The transition in each world of a ramp. See `ramp_frequency`, `window_correlation` and `ramp_transition`."""
    freq = ramp_frequency(trajectory.time, start, rate, duration)
    found = []
    for hip, ankle in zip(trajectory.hip.T, trajectory.ankle.T, strict=True):
        centred, trailing = (
            ramp_transition(freq, window_correlation(hip, ankle, window_steps, centred=centred, still_rad=still_rad))
            for centred in (True, False)
        )
        found.append(
            RampTransitions(
                transition_centred_hz=math.nan if centred.freq_hz is None else centred.freq_hz,
                crossings_centred=centred.crossings,
                transition_trailing_hz=math.nan if trailing.freq_hz is None else trailing.freq_hz,
                crossings_trailing=trailing.crossings,
            )
        )
    return found
