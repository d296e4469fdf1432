"""The prediction of the linear stander for one condition, as a row comparable with measured ones."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from envs.body.segments import Segments
from envs.config import EnvConfig
from posture.analysis.coordination import torque_cost
from posture.analysis.results import LeastCost, MotionIndices, columns_of
from posture.theory.motion import joint_arrays, motion_indices
from posture.theory.nonlinear import exact_bound, exact_stander
from posture.theory.optimum import bound, cheapest_sinusoid
from posture.theory.program import InfeasibleError
from posture.theory.reward_optimum import reward_terms
from posture.theory.stander import Stander, linearise

AT_THE_EDGE_M = 1e-4
"""The centre of pressure has reached an end of the foot where it is this close to it [m]."""


@dataclass(frozen=True)
class Prediction:
    """The stander under one condition; the columns of the theory's tables."""

    freq_hz: float
    hip_k_nm_per_rad: float
    ankle_k_nm_per_rad: float
    load_kg: float
    tolerance_m: float  # of the head around the target
    feasible: bool  # whether a motion keeps the limits; where none does, least is nan
    sinusoid: MotionIndices = columns_of("sinusoid_")  # closed form
    least: LeastCost = columns_of("least_")
    paper_mode: str = "-"  # of the paper's network; a dash where the paper has no such condition


def predict(body: Segments, config: EnvConfig, freq: float, tolerance: float, duration: float) -> Prediction:
    """The stander of `config` at `freq` [Hz], the head within `tolerance` [m], energy over `duration` [s]."""
    stander = linearise(body, config)
    sinusoid = motion_indices(cheapest_sinusoid(stander, freq, config.amplitude, tolerance), duration)
    try:
        motion = bound(stander, freq, config.amplitude, tolerance)
    except InfeasibleError:
        feasible, least = False, LeastCost()
    else:
        found = motion_indices(motion, duration)
        energy, torque = reward_terms(motion, config)
        binds = cop_binds(stander, found.cop_min_m, found.cop_max_m)
        exact = _exact_cost(body, config, freq, tolerance)
        indices = asdict(found)
        least = LeastCost(**indices, reward_energy=energy, reward_torque=torque, exact_cost=exact, cop_binds=binds)
        feasible = True
    return Prediction(freq, config.hip_k, config.ankle_k, config.load, tolerance, feasible, sinusoid, least)


def _exact_cost(body: Segments, config: EnvConfig, freq: float, tolerance: float) -> float:
    try:
        motion = exact_bound(exact_stander(body, config), freq, config.amplitude, tolerance)
    except InfeasibleError:
        return math.nan
    return torque_cost(joint_arrays(motion)[0], config.torque_limit)


def cop_binds(stander: Stander, low: float, high: float) -> str:
    """Which end of the foot a centre of pressure between `low` and `high` [m] reaches: none, heel, toe or both."""
    heel, toe = low <= stander.heel_x + AT_THE_EDGE_M, high >= stander.toe_x - AT_THE_EDGE_M
    return "both" if heel and toe else "heel" if heel else "toe" if toe else "none"
