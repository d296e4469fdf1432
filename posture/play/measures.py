"""What the page shows of the recent past: mode, cost, tracking; and the trail of the correlation over frequency."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from posture.analysis.coordination import mode
from posture.analysis.ramp import window_correlation
from posture.play.history import History


@dataclass(frozen=True)
class Measures:
    """Over the window that ends now, nan where it is not full.

    window [s]. freq: mean frequency [Hz]. r: hip-ankle correlation [-], nan where a joint hardly moves. cost [-]: mean of
    the sum over the four joints of (tau / limit)^2, over the whole cycles in the window. error [m]: root mean square of head
    from target. beyond: share of time with the head beyond the tolerance, 0 .. 1.
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
    """Over `window_steps` control steps of `dt` [s], or over one cycle of the target where that is longer: a part of a slow
    cycle has a correlation of its own. A joint that moves less than `still_rad` [rad] has no mode."""
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


class Trail:
    """Where the correlation has been over frequency: rising, falling, or held. Hysteresis shows where the first two part."""

    LENGTH = 600

    def __init__(self) -> None:
        self.points: deque[tuple[float, float, int]] = deque(maxlen=self.LENGTH)
        """(frequency [Hz], correlation [-], 1 rising, -1 falling, 0 held)"""

    def add(self, measures: Measures, ramping: int) -> None:
        """Add a point, where the mode is defined."""
        if not math.isnan(measures.r):
            self.points.append((measures.freq, measures.r, ramping))
