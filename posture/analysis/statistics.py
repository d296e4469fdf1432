"""Means with their intervals: by a bootstrap, and by Student's t."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import bootstrap
from scipy.stats import t as student


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


class Interval(NamedTuple):
    """A mean, and the ends of its confidence interval; nan where undefined."""

    mean: float
    low: float
    high: float


def mean_interval(values: ArrayLike, confidence: float = 0.95) -> Interval:
    """Mean of `values` (N,), in any unit, and its interval by Student's t.

    nan values are left out; the mean of none and the interval of fewer than two are nan. The values should be independent:
    of cycles that follow one another, which are alike, the interval is rather too narrow. Source: field practice.
    """
    known = np.asarray(values, dtype=np.float64)
    known = known[np.isfinite(known)]
    if not len(known):
        return Interval(math.nan, math.nan, math.nan)
    mean = float(known.mean())
    if len(known) < 2:
        return Interval(mean, math.nan, math.nan)
    half = float(student.ppf((1 + confidence) / 2, len(known) - 1) * known.std(ddof=1) / math.sqrt(len(known)))
    return Interval(mean, mean - half, mean + half)
