"""A trajectory's columns as text files for other tools: OpenSim's storage format (.sto) and CSV.

Signs are those of posture/analysis/trajectory.py: x points forward, hip flexion is negative, and so is the ankle when the
body leans
forward. OpenSim's gait models count flexion of the hip and dorsiflexion of the ankle positive, the opposite of both.

A .sto file holds no nan, since OpenSim's reader of this version stops there: it ends before a fall, and `cop_x` is 0 where
`foot_loaded` is 0. The CSV holds what was recorded, nan included. Both hold every digit.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from envs.body.joints import JOINTS
from posture.analysis.trajectory import Array, Trajectory
from posture.storage.atomic import replacing

_IN_DEGREES = {"rad": "deg", "rad_per_s": "deg_per_s"}


@dataclass(frozen=True, eq=False)
class Column:
    """One signal of one world. `unit`: as at the end of a name in the CSV, empty for a share or a truth (0 or 1)."""

    name: str
    unit: str
    values: Array  # (T,)

    @property
    def heading(self) -> str:
        """Name with the unit."""
        return f"{self.name}_{self.unit}" if self.unit else self.name


def columns(trajectory: Trajectory, world: int) -> list[Column]:
    """Every signal of `world` over all T control steps, in SI units, time first; nan as recorded."""

    def of_joints(kind: str, unit: str, values: Array) -> list[Column]:
        return [Column(f"{joint}_{kind}", unit, values[:, world, place]) for place, joint in enumerate(JOINTS)]

    cop_x = trajectory.cop_x[:, world]
    return [
        Column("time", "s", trajectory.time),
        Column("target_x", "m", trajectory.target_x[:, world]),
        Column("head_x", "m", trajectory.head_x[:, world]),
        Column("head_vx", "m_per_s", trajectory.head_vx[:, world]),
        *of_joints("angle", "rad", trajectory.joint_angle),
        *of_joints("velocity", "rad_per_s", trajectory.joint_velocity),
        *of_joints("torque", "nm", trajectory.joint_torque),
        Column("cop_x", "m", cop_x),
        Column("foot_loaded", "", np.isfinite(cop_x).astype(np.float64)),
        Column("torso_height", "m", trajectory.torso_height[:, world]),
        Column("foot_displacement", "m", trajectory.foot_displacement[:, world]),
        Column("foot_flat", "", trajectory.foot_flat[:, world].astype(np.float64)),
    ]


def write_csv(trajectory: Trajectory, world: int, path: Path) -> None:
    """Write `columns` of `world` to `path`, atomically: a heading of names with units, then a line a control step."""
    signals = columns(trajectory, world)
    _write([",".join(signal.heading for signal in signals)], signals, ",", path)


def write_sto(trajectory: Trajectory, world: int, path: Path, in_degrees: bool) -> bool:
    """Write `columns` of `world` up to its fall to `path` as an OpenSim storage file of version 1, atomically.

    `in_degrees`: angles and their velocities in deg and deg/s, and the header says so. False where the world fell in its
    first step, so that there is nothing to write: OpenSim refuses a file without rows.
    """
    fall = int(trajectory.fall_step[world])
    steps = len(trajectory.time) if fall < 0 else fall
    if steps == 0:
        return False
    signals = []
    for signal in columns(trajectory, world):
        values = signal.values[:steps]
        if signal.name == "cop_x":
            values = np.nan_to_num(values, nan=0.0)
        if in_degrees and signal.unit in _IN_DEGREES:
            values = np.degrees(values)
        signals.append(Column(signal.name, signal.unit, values))
    angles = "degrees" if in_degrees else "radians"
    header = [
        _name(trajectory, world),
        "version=1",
        f"nRows={steps}",
        f"nColumns={len(signals)}",
        f"inDegrees={'yes' if in_degrees else 'no'}",
        f"SI units, angles in {angles}. x points forward.",
        "Hip flexion is negative, and the ankle when the body leans forward. OpenSim's gait models count both positive.",
        "endheader",
        "\t".join(signal.name for signal in signals),
    ]
    _write(header, signals, "\t", path)
    return True


def _name(trajectory: Trajectory, world: int) -> str:
    """What OpenSim calls the file's data."""
    freq = float(trajectory.freq[world])
    return f"posture_{freq!r}_Hz" if np.isfinite(freq) else "posture_ramp"


def _write(header: Iterable[str], signals: list[Column], separator: str, path: Path) -> None:
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        file.writelines(f"{line}\n" for line in header)
        for row in np.column_stack([signal.values for signal in signals]).tolist():
            file.write(separator.join(map(repr, row)) + "\n")
