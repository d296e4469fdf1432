"""The mean of a few runs with its bootstrap interval."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import bootstrap


def bootstrap_mean(values: ArrayLike, confidence: float = 0.95, seed: int = 0) -> tuple[float, float, float]:
    """Mean of `values` (N,), in any unit, and the low and high end of its percentile bootstrap interval.

    `confidence` is the interval's share, 0 .. 1; the same `seed` gives the same interval. nan values (a fall, an undefined
    index) are left out; the mean of none and the interval of fewer than two are nan. With few values the interval is
    too narrow: that of two values never reaches beyond them. Source: field practice (Efron and
    Tibshirani, An Introduction to the Bootstrap, chapter 13).
    """
    known = np.asarray(values, dtype=np.float64)
    if known.ndim != 1:
        raise ValueError(f"values have shape {known.shape}: they must be (N,)")
    known = known[~np.isnan(known)]
    mean = float(known.mean()) if len(known) else math.nan
    if len(known) < 2:
        return mean, math.nan, math.nan
    # `random_state` rather than `rng`, which SciPy before 1.15 does not have.
    interval = bootstrap(
        (known,), np.mean, confidence_level=confidence, method="percentile", random_state=np.random.default_rng(seed)
    ).confidence_interval
    return mean, float(interval.low), float(interval.high)
