"""The record of a roll-out: arrays of one deterministic trial in W parallel worlds."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from envs.body.joints import ANKLES, HIPS, JOINTS
from posture.storage.atomic import replacing

Array = NDArray[np.float64]

_EARLIER_JOINTS = ("hip_left", "hip_right", "ankle_left", "ankle_right")
"""Order of the joints in files that do not name them, which earlier versions wrote."""

# Axes of every array field: T control steps, W worlds, J joints.
_AXES = {
    "time": "T", "freq": "W", "hip_k": "W", "ankle_k": "W", "load": "W", "target_x": "TW", "head_x": "TW",
    "head_vx": "TW", "joint_angle": "TWJ", "joint_velocity": "TWJ", "joint_torque": "TWJ", "cop_x": "TW",
    "torso_height": "TW", "foot_displacement": "TW", "foot_flat": "TW", "fall_step": "W",
}  # fmt: skip
_DTYPES = {"foot_flat": np.bool_, "fall_step": np.int64}  # all others float64


@dataclass(frozen=True, eq=False)
class Trajectory:
    """One deterministic roll-out of W worlds over T control steps.

    Angles follow the joint axes (+y, child relative to parent): hip flexion is negative, and the ankle is
    negative when the body leans forward. x points forward. Arrays are kept as float64 (`foot_flat` bool,
    `fall_step` int64); a wrong shape raises ValueError.
    """

    time: Array  # (T,) [s]
    freq: Array  # (W,) target frequency [Hz], nan where it is a ramp
    hip_k: Array  # (W,) passive hip stiffness [Nm/rad per joint]
    ankle_k: Array  # (W,) passive ankle stiffness [Nm/rad per joint]
    load: Array  # (W,) mass added to the upper body [kg]
    target_x: Array  # (T, W) [m]
    head_x: Array  # (T, W) [m]
    head_vx: Array  # (T, W) [m/s]
    joint_angle: Array  # (T, W, 4) [rad], order JOINTS
    joint_velocity: Array  # (T, W, 4) [rad/s], order JOINTS
    joint_torque: Array  # (T, W, 4) actuator torque, springs not included [Nm], order JOINTS
    cop_x: Array  # (T, W) centre of pressure in the foot frame [m], nan while no foot carries load
    torso_height: Array  # (T, W) [m]
    foot_displacement: Array  # (T, W) distance of the feet from their start [m]
    foot_flat: NDArray[np.bool_]  # (T, W) heel and toe of both feet on the ground
    fall_step: NDArray[np.int64]  # (W,) first step below the fall height, or that diverged; -1: none
    torque_limit: float  # [Nm]
    control_dt: float  # [s]

    def __post_init__(self) -> None:
        size = {"T": len(self.time), "W": len(self.freq), "J": len(JOINTS)}
        for name, axes in _AXES.items():
            array: NDArray[Any] = np.asarray(getattr(self, name), dtype=_DTYPES.get(name, np.float64))
            expected = tuple(size[axis] for axis in axes)
            if array.shape != expected:
                raise ValueError(f"{name} has shape {array.shape}, expected {expected} ({', '.join(axes)})")
            object.__setattr__(self, name, array)

    @property
    def hip(self) -> Array:
        """Hip angle [rad], mean of left and right, flexion negative. Shape (T, W)."""
        return np.asarray(self.joint_angle[..., HIPS].mean(axis=-1))

    @property
    def ankle(self) -> Array:
        """Ankle angle [rad], mean of left and right, negative when leaning forward. Shape (T, W)."""
        return np.asarray(self.joint_angle[..., ANKLES].mean(axis=-1))

    def save(self, path: str | Path) -> None:
        """Write every field and the names of the joints to a compressed .npz at exactly `path`, atomically."""
        arrays: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(self)}
        with replacing(Path(path)) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, joints=np.array(JOINTS), **arrays)

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Read what `save` wrote. Raises ValueError where a field is missing or is not a plain array."""
        with np.load(path, allow_pickle=False) as stored:
            missing = [f.name for f in fields(cls) if f.name not in stored]
            if missing:
                raise ValueError(f"{path} is not a trajectory: it lacks {', '.join(missing)}")
            arrays = {name: stored[name] for name in _AXES}
            names = stored["joints"].tolist() if "joints" in stored else list(_EARLIER_JOINTS)
            if sorted(names) != sorted(JOINTS):
                raise ValueError(f"{path} has the joints {names}; allowed are {list(JOINTS)}")
            for name in (name for name, axes in _AXES.items() if axes == "TWJ"):
                arrays[name] = arrays[name][..., [names.index(joint) for joint in JOINTS]]
            return cls(
                **arrays,
                torque_limit=float(stored["torque_limit"]),
                control_dt=float(stored["control_dt"]),
            )
