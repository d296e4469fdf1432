"""Trials with known signals, for the tests of what is measured and drawn."""

import math
from typing import Any

import numpy as np

from posture.analysis.coordination import measure_trajectory
from posture.analysis.results import Result
from posture.analysis.trajectory import Trajectory

DT = 1 / 60
STEPS = 6000  # 100 s
TIME = np.arange(STEPS) * DT
SETTINGS = {"transient_s": 10.0, "tolerance_m": 0.025, "still_joint_deg": 0.5}


def wave(freq: Any, phase: Any = 0.0, time: np.ndarray = TIME) -> np.ndarray:
    return np.cos(2 * math.pi * freq * time + phase)


def trial(freq: float | list[float], phase: float | list[float] = 0.0, **changes: Any) -> Trajectory:
    """One world for each frequency [Hz]: hip 6 and ankle 3 deg peak-to-peak, the hip `phase` [rad] ahead."""
    f = np.atleast_1d(np.asarray(freq, dtype=float))
    shape, moved = (STEPS, len(f)), np.nan_to_num(f, nan=0.5)
    hip = math.radians(3) * wave(moved, np.asarray(phase), TIME[:, None]) - 0.1
    ankle = math.radians(1.5) * wave(moved, 0.0, TIME[:, None]) - 0.05
    target = 0.1 - 0.1 * wave(moved, 0.0, TIME[:, None])
    fields: dict[str, Any] = {
        "time": TIME,
        "freq": f,
        "hip_k": np.full(len(f), 125.0),
        "ankle_k": np.full(len(f), 25.0),
        "load": np.zeros(len(f)),
        "target_x": target,
        "head_x": target,
        "head_vx": np.zeros(shape),
        "joint_angle": np.stack([hip, ankle, hip, ankle], axis=-1),
        "joint_velocity": np.zeros((*shape, 4)),
        "joint_torque": np.zeros((*shape, 4)),
        "cop_x": np.zeros(shape),
        "torso_height": np.full(shape, 1.29),
        "foot_displacement": np.zeros(shape),
        "foot_flat": np.ones(shape, dtype=bool),
        "fall_step": np.full(len(f), -1),
        "torque_limit": 100.0,
        "control_dt": DT,
    }
    return Trajectory(**{**fields, **changes})


def measured(trajectory: Trajectory, **settings: float) -> list[Result]:
    return measure_trajectory(trajectory, **{**SETTINGS, **settings})


def angle_difference(a: float, b: float) -> float:
    """Distance of two angles [deg], the shorter way round."""
    return abs((a - b + 180) % 360 - 180)
