"""Variables of the experiments and quantities of the report: typed access to results, with names and units."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from posture.analysis.results import Result

Getter = Callable[[Result], float]
Theory = Literal["least", "reward"]
"""The motion of least torque, or the optimum of the trained reward."""


@dataclass(frozen=True)
class Variable:
    """A condition that an experiment varies. text: how a value is written; axis: the label of a figure's axis."""

    value: Getter
    text: str
    axis: str


@dataclass(frozen=True)
class Quantity:
    """A number of a trial, and the same in theory; None where theory does not give it.

    name: with its unit. spec: format of its values.
    """

    name: str
    spec: str
    measured: Getter
    least: Getter | None = None
    reward: Getter | None = None

    def in_theory(self, theory: Theory) -> Getter | None:
        """The number as one of the theories gives it."""
        return self.least if theory == "least" else self.reward


FREQ = Variable(lambda r: r.freq_hz, "{:g} Hz", "target frequency [Hz]")
HIP_K = Variable(lambda r: r.hip_k_nm_per_rad, "{:g} Nm/rad", "hip stiffness [Nm/rad per joint]")
LOAD = Variable(lambda r: r.load_kg, "{:g} kg", "load on the trunk [kg]")
ENERGY_WEIGHT = Variable(lambda r: r.origin.energy_weight, "gamma {:g}", "weight of effort, gamma")
AMPLITUDE = Variable(lambda r: r.origin.amplitude_m, "{:g} m", "target amplitude [m]")

HIP_ANKLE_R = Quantity("r", ".2f", lambda r: r.hip_ankle_r, lambda r: r.least.hip_ankle_r, lambda r: r.reward.hip_ankle_r)
RELATIVE_PHASE = Quantity("phase [deg]", ".0f", lambda r: r.relative_phase_deg)
HIP_RANGE = Quantity("hip angle [deg]", ".1f", lambda r: r.hip_range_deg, lambda r: r.least.hip_range_deg)
ANKLE_RANGE = Quantity("ankle angle [deg]", ".1f", lambda r: r.ankle_range_deg, lambda r: r.least.ankle_range_deg)
HIP_TORQUE = Quantity("hip torque [Nm]", ".1f", lambda r: r.hip_torque_range_nm, lambda r: r.least.hip_torque_range_nm)
ANKLE_TORQUE = Quantity(
    "ankle torque [Nm]", ".1f", lambda r: r.ankle_torque_range_nm, lambda r: r.least.ankle_torque_range_nm
)
TARGET_HEAD_R = Quantity("target-head r", ".4f", lambda r: r.target_head_r, lambda r: r.least.target_head_r)
HEAD_AMPLITUDE = Quantity("head amplitude [m]", ".4f", lambda r: r.head_amplitude_m, lambda r: r.least.head_amplitude_m)
HEAD_SPEED = Quantity("head speed [m/s]", ".4f", lambda r: r.head_speed_mps, lambda r: r.least.head_speed_mps)
ENERGY = Quantity("energy [J]", ".0f", lambda r: r.energy_j, lambda r: r.least.energy_j, lambda r: r.reward.energy_j)
COST_RATIO = Quantity("cost over least cost", ".2f", lambda r: r.cost_ratio)
COP_SPREAD = Quantity(  # 5th to 95th percentile; in theory from end to end
    "spread [m]", ".3f", lambda r: r.cop_p95_m - r.cop_p05_m, lambda r: r.least.cop_max_m - r.least.cop_min_m
)
