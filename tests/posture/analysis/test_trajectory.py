"""The arrays of a roll-out: wrong shapes are refused, joints averaged, files read back unchanged."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from envs.body.joints import JOINTS
from posture.analysis.trajectory import Trajectory

STEPS, WORLDS = 5, 3


def trajectory(**changes: object) -> Trajectory:
    """Random but reproducible values, so that no two fields can be mistaken for each other."""
    draw = np.random.default_rng(1)
    per_step, per_joint = (STEPS, WORLDS), (STEPS, WORLDS, len(JOINTS))
    fields: dict[str, object] = {
        "time": np.arange(STEPS) * 0.5,
        "freq": np.array([0.15, np.nan, 0.3]),
        **{name: draw.random(WORLDS) for name in ("hip_k", "ankle_k", "load")},
        **{name: draw.random(per_step) for name in ("target_x", "head_x", "head_vx", "cop_x")},
        **{name: draw.random(per_step) for name in ("torso_height", "foot_displacement")},
        **{name: draw.random(per_joint) for name in ("joint_angle", "joint_velocity", "joint_torque")},
        "foot_flat": draw.random(per_step) > 0.5,
        "fall_step": np.array([-1, 3, -1]),
        "torque_limit": 7.0,
        "control_dt": 0.5,
    }
    return Trajectory(**{**fields, **changes})  # type: ignore[arg-type]


def test_saved_is_read_back_unchanged(tmp_path: Path) -> None:
    saved = trajectory()
    saved.save(tmp_path / "new" / "roll-out.npz")
    read = Trajectory.read(tmp_path / "new" / "roll-out.npz")
    for field in dataclasses.fields(Trajectory):
        np.testing.assert_array_equal(getattr(read, field.name), getattr(saved, field.name), field.name)
    assert read.foot_flat.dtype == np.bool_
    assert read.fall_step.dtype == np.int64
    assert type(read.control_dt) is float
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["roll-out.npz"]


def test_a_file_without_joint_names_has_the_earlier_order(tmp_path: Path) -> None:
    earlier = ("hip_left", "hip_right", "ankle_left", "ankle_right")
    number = {joint: float(i) for i, joint in enumerate(JOINTS)}
    arrays = {field.name: getattr(trajectory(), field.name) for field in dataclasses.fields(Trajectory)}
    for name in ("joint_angle", "joint_velocity", "joint_torque"):
        arrays[name] = np.broadcast_to([number[joint] for joint in earlier], (STEPS, WORLDS, 4))
    np.savez(tmp_path / "earlier.npz", **arrays)
    read = Trajectory.read(tmp_path / "earlier.npz")
    for name in ("joint_angle", "joint_velocity", "joint_torque"):
        np.testing.assert_array_equal(getattr(read, name), np.broadcast_to([0.0, 1.0, 2.0, 3.0], (STEPS, WORLDS, 4)))


def test_unknown_joints_are_refused(tmp_path: Path) -> None:
    arrays = {field.name: getattr(trajectory(), field.name) for field in dataclasses.fields(Trajectory)}
    np.savez(tmp_path / "knees.npz", joints=["hip_left", "knee_left", "hip_right", "knee_right"], **arrays)
    with pytest.raises(ValueError, match="knee_left"):
        Trajectory.read(tmp_path / "knees.npz")


def test_mean_of_left_and_right() -> None:
    # hip: (1 + 3) / 2 = 2; ankle: (-5 - 1) / 2 = -3.
    angle = np.broadcast_to([1.0, -5.0, 3.0, -1.0], (STEPS, WORLDS, 4))
    np.testing.assert_array_equal(trajectory(joint_angle=angle).hip, np.full((STEPS, WORLDS), 2.0))
    np.testing.assert_array_equal(trajectory(joint_angle=angle).ankle, np.full((STEPS, WORLDS), -3.0))


@pytest.mark.parametrize(
    ("name", "shape"),
    [("head_x", (WORLDS, STEPS)), ("joint_angle", (STEPS, WORLDS, 2)), ("load", (STEPS,)), ("fall_step", ())],
)
def test_wrong_shape_is_refused(name: str, shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=rf"{name} has shape .* expected"):
        trajectory(**{name: np.zeros(shape)})


def test_single_precision_is_widened() -> None:
    assert trajectory(head_x=np.zeros((STEPS, WORLDS), np.float32)).head_x.dtype == np.float64


def test_incomplete_file_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "part.npz", time=np.zeros(2))
    with pytest.raises(ValueError, match="lacks freq"):
        Trajectory.read(tmp_path / "part.npz")


def test_pickled_objects_are_refused(tmp_path: Path) -> None:
    arrays = {field.name: getattr(trajectory(), field.name) for field in dataclasses.fields(Trajectory)}
    arrays["load"] = np.array([{"a": 1}] * WORLDS, dtype=object)
    np.savez(tmp_path / "pickle.npz", **arrays)
    with pytest.raises(ValueError, match="pickle"):
        Trajectory.read(tmp_path / "pickle.npz")
