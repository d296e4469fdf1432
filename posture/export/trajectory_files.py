"""Trajectories as text files for other tools: OpenSim's storage format (.sto) and CSV.

Signs are those of posture/analysis/trajectory.py: x points forward, hip flexion is negative, and so is the ankle when the
body leans forward. OpenSim's gait models count hip flexion and ankle dorsiflexion positive, the opposite of both.

OpenSim stops reading a .sto file of this version at the first nan, so the .sto has none: it ends before a fall, and `cop_x`
is 0 where `foot_loaded` is 0. The CSV holds every step, nan included. Numbers are written with all their digits.
"""

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np

from envs.body.joints import JOINTS
from posture.analysis.trajectory import Array, Trajectory
from posture.storage.atomic import replacing

_IN_DEGREES = ("rad", "rad_per_s")


class Column(NamedTuple):
    """One signal of one world. `unit`: the suffix of the name in the CSV, empty for a share or a truth value (0 or 1)."""

    name: str
    unit: str
    values: Array  # (T,)


def columns(trajectory: Trajectory, world: int) -> list[Column]:
    """Every signal of `world` over all T control steps, in SI units, time first; nan as recorded."""

    def of_joints(signal: str, unit: str, values: Array) -> list[Column]:
        return [Column(f"{joint}_{signal}", unit, values[:, world, i]) for i, joint in enumerate(JOINTS)]

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
    """Write `columns` of `world` to `path`, atomically: one line of names with units, then one line per control step."""
    signals = columns(trajectory, world)
    _write([], [f"{name}_{unit}" if unit else name for name, unit, _ in signals], [c.values for c in signals], ",", path)


def write_sto(trajectory: Trajectory, world: int, path: Path, in_degrees: bool) -> bool:
    """Write `columns` of `world` up to its fall to `path` as an OpenSim storage file of version 1, atomically.

    `in_degrees`: angles and angular velocities in deg and deg/s, as the header then states. Returns False, and writes
    nothing, if the world fell in its first step: OpenSim refuses a file without rows.
    """
    fall = int(trajectory.fall_step[world])
    steps = len(trajectory.time) if fall < 0 else fall
    if steps == 0:
        return False
    signals = columns(trajectory, world)
    values = [np.degrees(c.values) if in_degrees and c.unit in _IN_DEGREES else c.values for c in signals]
    cop_x = [c.name for c in signals].index("cop_x")
    values[cop_x] = np.nan_to_num(values[cop_x], nan=0.0)
    freq = float(trajectory.freq[world])
    header = [
        f"posture_{freq!r}_Hz" if np.isfinite(freq) else "posture_ramp",
        "version=1",
        f"nRows={steps}",
        f"nColumns={len(signals)}",
        f"inDegrees={'yes' if in_degrees else 'no'}",
        f"SI units, angles in {'degrees' if in_degrees else 'radians'}. x points forward.",
        "Hip flexion is negative, and the ankle when the body leans forward. OpenSim's gait models count both positive.",
        "endheader",
    ]
    _write(header, [c.name for c in signals], [x[:steps] for x in values], "\t", path)
    return True


def _write(header: list[str], names: list[str], values: list[Array], separator: str, path: Path) -> None:
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        file.writelines(f"{line}\n" for line in header)
        writer = csv.writer(file, delimiter=separator, lineterminator="\n")  # writes a float as the shortest exact text
        writer.writerow(names)
        writer.writerows(np.column_stack(values).tolist())
