"""The recent past of a session: its signals, and the mode, cost and tracking error computed from them."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from posture.analysis.coordination import mode
from posture.analysis.ramp import window_correlation
from posture.analysis.trajectory import Array

SIGNALS = ("time", "freq", "hip", "ankle", "target", "head", "cop", "cost")


class History:
    """The last `capacity` samples of each signal, evenly spaced in time.

    time [s]; freq [Hz]; hip, ankle [rad], flexion and forward lean negative; target, head [m] along x; cop [m] in the foot
    frame, nan if the feet carry no load; cost [-], sum over the four joints of (tau / limit)^2.
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        # Twice the capacity: the last samples are always one slice, and are moved to the front only when it is full.
        self._rows = np.empty((2 * capacity, len(SIGNALS)))
        self._end = 0

    def __len__(self) -> int:
        return min(self._end, self.capacity)

    def append(self, *sample: float) -> None:
        """Add one sample, in the order of SIGNALS."""
        if self._end == len(self._rows):
            self._rows[: self.capacity] = self._rows[self.capacity :]
            self._end = self.capacity
        self._rows[self._end] = sample
        self._end += 1

    def last(self, signal: str, count: int) -> Array:
        """The last `count` samples of `signal`, fewer if there are fewer. (n,)."""
        count = min(count, len(self))
        return self._rows[self._end - count : self._end, SIGNALS.index(signal)]

    def clear(self) -> None:
        """Remove all samples."""
        self._end = 0


@dataclass(frozen=True)
class Measures:
    """Measures over the window that ends now, nan until the window is full.

    window: length [s]. freq: mean frequency [Hz]. r: hip-ankle correlation [-], nan if a joint hardly moves. cost [-]: mean
    of the sum over the four joints of (tau / limit)^2, over the whole cycles in the window. error: root-mean-square distance
    of head and target [m]. beyond: share of time with the head outside the tolerance, 0 .. 1.
    """

    window: float
    freq: float
    r: float
    cost: float
    error: float
    beyond: float

    @property
    def mode(self) -> str:
        """in-phase, anti-phase or undefined."""
        return mode(self.r)


def measure(history: History, dt: float, window_steps: int, still_rad: float, tolerance: float) -> Measures:
    """Measures over `window_steps` control steps of `dt` [s], or over one cycle of the target if that is longer: the
    correlation over part of a cycle differs from that of the cycle. A joint that moves less than `still_rad` [rad] gives
    no mode."""
    freq = float(history.last("freq", 1)[-1]) if len(history) else math.nan
    count = window_steps if math.isnan(freq) else max(window_steps, math.ceil(1 / (freq * dt)))
    if len(history) < count:
        return Measures(count * dt, freq, *4 * (math.nan,))
    hip, ankle = (history.last(joint, count) for joint in ("hip", "ankle"))
    r = window_correlation(hip, ankle, count, centred=False, still_rad=still_rad)[-1]
    cycles = math.floor(count * freq * dt + 1e-9)
    error = history.last("head", count) - history.last("target", count)
    return Measures(
        window=count * dt,
        freq=float(history.last("freq", count).mean()),
        r=float(r),
        cost=float(history.last("cost", round(cycles / (freq * dt))).mean()),
        error=float(np.sqrt(np.mean(error**2))),
        beyond=float(np.mean(np.abs(error) > tolerance)),
    )


class TrailPoint(NamedTuple):
    """freq [Hz]; r: hip-ankle correlation [-]; direction of the frequency: 1 rising, -1 falling, 0 constant."""

    freq: float
    r: float
    direction: int


class Trail:
    """Correlation against frequency over the past. Hysteresis shows as a distance of the rising from the falling points."""

    LENGTH = 600

    def __init__(self) -> None:
        self.points: deque[TrailPoint] = deque(maxlen=self.LENGTH)

    def add(self, measures: Measures, direction: int) -> None:
        """Add a point if the correlation is defined."""
        if not math.isnan(measures.r):
            self.points.append(TrailPoint(measures.freq, measures.r, direction))
