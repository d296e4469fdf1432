"""What the linear stander says of one condition, as a flat row beside which measured rows can stand."""

from __future__ import annotations

import math
from dataclasses import asdict, fields

from envs.body.segments import Segments
from envs.config import EnvConfig
from posture.analysis.coordination import Row, mode
from posture.theory.motion import MotionIndices, indices
from posture.theory.optimum import bound, cheapest_sinusoid
from posture.theory.program import InfeasibleError
from posture.theory.reward_optimum import reward_terms
from posture.theory.stander import Stander, linearise

AT_THE_EDGE_M = 1e-4
"""The centre of pressure binds where it comes this close to an end of the foot [m]."""


def predict(body: Segments, config: EnvConfig, freq: float, tolerance: float, duration: float) -> Row:
    """One row for the stander of `config` at `freq` [Hz], head within `tolerance` [m], energy over `duration` [s].

    The condition under the names of `coordination.indices`; then `MotionIndices` twice, as sinusoid_* of the closed form
    and least_* of the bound, with their modes; least_reward_energy and least_reward_torque, the bound's mean R_energy and
    R_torque as configured; and cop_binds: none, heel, toe, or both. Where no motion keeps the limits, `feasible` is
    false, least_* are nan, and cop_binds is a dash.
    """
    stander = linearise(body, config)
    sinusoid = indices(cheapest_sinusoid(stander, freq, config.amplitude, tolerance), duration)
    row: Row = {
        "freq_hz": freq,
        "hip_k_nm_per_rad": config.hip_k,
        "ankle_k_nm_per_rad": config.ankle_k,
        "load_kg": config.load,
        "tolerance_m": tolerance,
        "feasible": True,
    }
    least = MotionIndices(**{field.name: math.nan for field in fields(MotionIndices)})
    energy = torque = math.nan
    try:
        motion = bound(stander, freq, config.amplitude, tolerance)
    except InfeasibleError:
        row["feasible"] = False
    else:
        least = indices(motion, duration)
        energy, torque = reward_terms(motion, config)
    for name, measured in (("sinusoid", sinusoid), ("least", least)):
        row[f"{name}_mode"] = mode(measured.hip_ankle_r)
        row |= {f"{name}_{column}": value for column, value in asdict(measured).items()}
    return row | {
        "least_reward_energy": energy,
        "least_reward_torque": torque,
        "cop_binds": cop_binds(stander, least.cop_min_m, least.cop_max_m) if row["feasible"] else "-",
    }


def cop_binds(stander: Stander, low: float, high: float) -> str:
    """Which end of the foot a centre of pressure between `low` and `high` [m] comes up against: none, heel, toe or both."""
    heel, toe = low <= stander.heel_x + AT_THE_EDGE_M, high >= stander.toe_x - AT_THE_EDGE_M
    return "both" if heel and toe else "heel" if heel else "toe" if toe else "none"
