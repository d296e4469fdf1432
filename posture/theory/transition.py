"""The frequency at which an optimum of the stander switches from one postural mode to the other."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from envs.config import EnvConfig
from posture.analysis.coordination import correlation
from posture.theory.motion import PeriodicMotion
from posture.theory.optimum import bound, cheapest_sinusoid
from posture.theory.program import InfeasibleError
from posture.theory.reward_optimum import reward_optimum
from posture.theory.stander import Stander

STEP_HZ = 0.1
"""Step of the search [Hz]: two transitions closer than this may be missed; this stander has one or none."""
RESOLUTION_HZ = 1e-4
"""Accuracy of a transition frequency [Hz]."""


def hip_ankle_correlation(motion: PeriodicMotion) -> float:
    """Pearson correlation [-] of hip and ankle angle over a cycle; positive in-phase, nan where a joint is still."""
    angle = motion.angle(motion.cycle())
    return correlation(angle[:, 0], angle[:, 1])


def transition_frequency(optimum: Callable[[float], PeriodicMotion], search: tuple[float, float]) -> float | None:
    """The lowest frequency [Hz] within `search` at which the hip-ankle correlation of `optimum`(freq) changes sign, to
    RESOLUTION_HZ; None where there is none. A frequency at which no motion keeps the limits counts as one without a mode."""

    def r(freq: float) -> float:
        try:
            return hip_ankle_correlation(optimum(freq))
        except InfeasibleError:
            return math.nan

    low, high = search
    grid = np.linspace(low, high, math.ceil((high - low) / STEP_HZ) + 1)
    # Lazily: the search ends at the first transition.
    for (f0, r0), (f1, r1) in pairwise((float(f), r(float(f))) for f in grid):
        if r0 * r1 < 0:
            return float(brentq(r, f0, f1, xtol=RESOLUTION_HZ))
        if r1 == 0:
            return f1
    return None


def sinusoid_transition(stander: Stander, search: tuple[float, float]) -> float | None:
    """f* [Hz] of the closed form, the same for every amplitude, offset and tolerance."""
    return transition_frequency(lambda freq: cheapest_sinusoid(stander, freq, 1.0, 0.0), search)


def bound_transition(stander: Stander, amplitude: float, tolerance: float, search: tuple[float, float]) -> float | None:
    """f* [Hz] of the least-cost motion under the learner's constraints; amplitude and tolerance [m]."""
    return transition_frequency(lambda freq: bound(stander, freq, amplitude, tolerance), search)


def reward_transition(stander: Stander, config: EnvConfig, tolerance: float, search: tuple[float, float]) -> float | None:
    """f* [Hz] of the local optimum of the reward of `config`; tolerance [m]. Takes seconds."""
    return transition_frequency(lambda freq: reward_optimum(stander, freq, config, tolerance), search)
