"""Statistics of directions. Pure functions on angles in degrees; nan entries are left out.

Sources: Mardia and Jupp, Directional Statistics; Zar, Biostatistical Analysis, chapters 26 and 27.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.stats import chi2

from posture.analysis.trajectory import Array


def resultant_length(angles_deg: Array) -> float:
    """Mean resultant length R, 0 (no common direction) .. 1 (all the same), of angles (N,) [deg]; nan if there
    are none."""
    known = np.radians(angles_deg[np.isfinite(angles_deg)])
    return float(abs(np.exp(1j * known).mean())) if len(known) else math.nan


def mean_half_width(angles_deg: Array, confidence: float = 0.95) -> float:
    """Half width [deg] of the confidence interval of the mean direction of angles (N,) [deg].

    Large-sample interval of Upton (1986), as in Zar's equations 26.24 and 26.26. nan where there are fewer than two angles,
    or where they are too spread for an interval: then the mean may lie anywhere.
    """
    n = int(np.count_nonzero(np.isfinite(angles_deg)))
    if n < 2:
        return math.nan
    r = resultant_length(angles_deg)
    quantile, total = float(chi2.ppf(confidence, 1)), n * r
    if r >= 0.9:
        cosine = math.sqrt(max(n**2 - (n**2 - total**2) * math.exp(quantile / n), 0.0)) / total
    elif 2 * total**2 > n * quantile and 4 * n > quantile:
        cosine = math.sqrt(2 * n * (2 * total**2 - n * quantile) / (4 * n - quantile)) / total
    else:
        return math.nan
    return math.degrees(math.acos(min(cosine, 1.0)))


def rayleigh_p(angles_deg: Array) -> float:
    """Probability by chance of a resultant at least as long, if directions are uniform, for angles (N,) [deg]: the Rayleigh
    test, in the approximation of Zar's equation 27.4. nan if there are none."""
    n = int(np.count_nonzero(np.isfinite(angles_deg)))
    if not n:
        return math.nan
    total = n * resultant_length(angles_deg)
    return min(1.0, math.exp(math.sqrt(1 + 4 * n + 4 * max(n**2 - total**2, 0.0)) - (1 + 2 * n)))
