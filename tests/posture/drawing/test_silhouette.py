"""The drawn body against trigonometry and against MuJoCo's kinematics; colours of pixels at known places."""

import math
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch

from envs.config import Person
from posture.drawing.silhouette import (
    TARGET_COLOUR,
    Disc,
    draw_body,
    draw_phases,
    head_position,
    joint_positions,
    solids,
    target_height,
)
from posture.drawing.style import ANKLE_COLOUR, HIP_COLOUR

MJCF = Path(__file__).parents[3] / "envs" / "body" / "humanoid.xml"
# Along the segments [m]: ankle joint above ground when the sole is flat, ankle to hip joint, hip joint to head. The head is
# 0.01 ahead of the hip joint, which is above the ankle in the upright body.
ANKLE_HEIGHT, LEG, TRUNK, AHEAD = 0.080 + 0.028, 0.713, 0.655, 0.01

hips, ankles = st.floats(-1.5, 0.7), st.floats(-0.6, 0.6)


def expected(hip: float, ankle: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hip joint, ankle joint and head (x, z): the leg leans forward by -ankle, the trunk by -(ankle + hip)."""
    lean, tilt = -ankle, -(ankle + hip)
    foot = np.array([-AHEAD, ANKLE_HEIGHT])
    joint = foot + LEG * np.array([math.sin(lean), math.cos(lean)])
    head = joint + TRUNK * np.array([math.sin(tilt), math.cos(tilt)])
    return joint, foot, head + AHEAD * np.array([math.cos(tilt), -math.sin(tilt)])


@given(hips, ankles, st.floats(-0.2, 0.2))
def test_positions_of_joints_and_head(hip: float, ankle: float, foot_x: float) -> None:
    joint, foot, head = expected(hip, ankle)
    assert joint_positions(hip, ankle, foot_x) == pytest.approx(np.array([joint, foot]) + [foot_x, 0], abs=1e-9)
    assert head_position(hip, ankle, foot_x) == pytest.approx(tuple(head + [foot_x, 0]), abs=1e-9)


@settings(max_examples=20)
@given(hips, ankles)
def test_solids_against_mujoco_in_the_foot_frame(hip: float, ankle: float) -> None:
    """The same body with its root at an arbitrary pose: positions in the foot frame must not depend on it."""
    model = mujoco.MjModel.from_xml_path(str(MJCF))
    data = mujoco.MjData(model)
    data.qpos[:3] = 0.3, -0.2, 2.0
    for side in ("left", "right"):
        data.joint(f"hip_{side}").qpos = hip
        data.joint(f"ankle_{side}").qpos = ankle
    mujoco.mj_kinematics(model, data)
    foot = data.body("foot_right")
    turn, place = foot.xmat.reshape(3, 3), foot.xpos
    # In the foot frame, whose origin is 0.028 m above the ground and 0.01 m behind the head of the upright body.
    seen = {i: (data.geom(i).xpos - place) @ turn + [-AHEAD, 0, 0.028] for i in range(model.ngeom)}
    drawn = {name: solid for part in solids(hip, ankle).values() for name, solid in part.items()}
    for name, solid in drawn.items():
        centre = np.mean([(disc.x, disc.z) for disc in solid], axis=0)
        assert centre == pytest.approx(seen[model.geom(name).id][[0, 2]], abs=1e-9)
        assert {disc.radius for disc in solid} == {model.geom(name).size[0]}
    solid_geoms = {model.geom(i).name for i in range(model.ngeom)} - {"ground", "sole_left", "sole_right"}
    assert set(drawn) == {name for name in solid_geoms if not name.endswith("_left")}


def test_dimensions_of_solids() -> None:
    parts = solids(0.0, 0.0)
    assert parts["head"]["head"] == (pytest.approx(Disc(0.0, 1.476, 0.09)),)
    # Shin: 0.403 to 0.703 below the hip joint, which is at 0.821 above ground and 0.01 behind the head.
    ends = sorted(parts["leg"]["shin_right"], key=lambda disc: disc.z)
    assert np.array(ends) == pytest.approx(np.array([[-0.01, 0.118, 0.049], [-0.01, 0.418, 0.049]]))
    # The pelvis lies along y: seen from the side it is a circle.
    assert np.array(parts["trunk"]["pelvis"]) == pytest.approx(np.array(2 * [[-0.03, 0.861, 0.09]]))
    # Lean the leg by 30 deg: the thigh, 0.34 long, keeps its length and has this direction.
    lower, upper = sorted(solids(0.0, -math.pi / 6)["leg"]["thigh_right"], key=lambda disc: disc.z)
    assert (upper.x - lower.x, upper.z - lower.z) == pytest.approx((0.34 * 0.5, 0.34 * math.sqrt(0.75)))


def test_the_foot_stays_flat_on_the_ground() -> None:
    for hip, ankle in ((0.0, 0.0), (-0.6, 0.2), (0.2, -0.3)):
        foot = solids(hip, ankle)["foot"]
        for a, b in foot.values():
            assert a.z == pytest.approx(b.z)
            assert a.z - a.radius == pytest.approx(0.001)  # the sole's contact line is 0.028 down, the foot's edge 0.027
            # Heel and toe at -0.07 and 0.14 of the foot frame, wherever the body is.
            assert sorted((a.x, b.x)) == pytest.approx([-0.08, 0.13])


@pytest.fixture
def figure() -> Figure:
    drawn = Figure(figsize=(6, 4), dpi=80)
    FigureCanvasAgg(drawn)
    drawn.subplots().set_axis_off()
    return drawn


def pixels(figure: Figure) -> np.ndarray:
    """Red, green and blue, 0 .. 1, shape (rows, columns, 3)."""
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3] / 255


def colour_at(figure: Figure, x: float, z: float) -> np.ndarray:
    image = pixels(figure)
    column, row = figure.axes[0].transData.transform((x, z))
    return image[image.shape[0] - 1 - int(row), int(column)]


def test_colours_of_body_and_joints(figure: Figure) -> None:
    ax = figure.axes[0]
    draw_body(ax, -0.3, 0.1, colour="#0000FF")
    ax.set(xlim=(-0.6, 0.9), ylim=(-0.1, 1.8))
    white = np.ones(3)
    hip, ankle = joint_positions(-0.3, 0.1)
    knee = ankle + 0.55 * (hip - ankle)
    assert colour_at(figure, *knee) == pytest.approx(to_rgb("#0000FF"), abs=0.01)
    assert colour_at(figure, *hip) == pytest.approx(to_rgb(HIP_COLOUR), abs=0.01)
    assert colour_at(figure, *ankle) == pytest.approx(to_rgb(ANKLE_COLOUR), abs=0.01)
    head = np.array(head_position(-0.3, 0.1))
    assert not np.allclose(colour_at(figure, *head), white)
    assert not np.allclose(colour_at(figure, *head), to_rgb("#0000FF"), atol=0.2)  # distinct from the leg
    for beyond in (head + [0.11, 0], head + [0, 0.11], knee + [0.1, 0], knee - [0.1, 0]):
        assert np.allclose(colour_at(figure, *beyond), white)
    assert ax.get_aspect() == 1.0


def test_extent_of_the_drawing(figure: Figure) -> None:
    # Upright, from the lower edge of the foot to the top of the head: 1.476 + 0.09; behind and ahead the foot's ends.
    ax = figure.axes[0]
    draw_body(ax, 0.0, 0.0, shift=2.0)
    boxes = [patch.get_path().get_extents() for patch in ax.patches if isinstance(patch, PathPatch)]
    assert max(box.y1 for box in boxes) == pytest.approx(1.566, abs=1e-3)
    assert min(box.y0 for box in boxes) == pytest.approx(0.001, abs=1e-3)
    assert min(box.x0 for box in boxes) == pytest.approx(2.0 - 0.12, abs=1e-3)  # the pelvis: -0.03 - 0.09
    assert max(box.x1 for box in boxes) == pytest.approx(2.0 + 0.13 + 0.027, abs=1e-3)


def test_the_drawing_of_a_person_is_as_tall_as_they_are(figure: Figure) -> None:
    """The foot is 258.1 / 1741 of the stature long, of which 0.81 is ahead of the ankle (de Leva 1996; Pai and Patton 1997).
    The paper's target is 1.7 - 1.57 m above its body."""
    ax, person = figure.axes[0], Person(mass=90, height=1.9, sex="male")
    draw_body(ax, 0.0, 0.0, person=person)
    boxes = [patch.get_path().get_extents() for patch in ax.patches if isinstance(patch, PathPatch)]
    assert max(box.y1 for box in boxes) == pytest.approx(1.9, abs=1e-3)
    assert 0 <= min(box.y0 for box in boxes) < 2e-3
    assert max(box.x1 for box in boxes) == pytest.approx(0.81 * 258.1 / 1741 * 1.9, abs=1e-3)
    assert (target_height(person), target_height(None)) == pytest.approx((2.03, 1.7))


def test_low_alpha_does_not_show_overlaps(figure: Figure) -> None:
    # alpha 0.25 of blue on white is [0.75, 0.75, 1], also where shin and thigh overlap and where the foot begins.
    ax = figure.axes[0]
    draw_body(ax, 0.0, 0.0, alpha=0.25, colour="#0000FF")
    ax.set(xlim=(-0.3, 0.3), ylim=(0.0, 0.7))
    for height in (0.2, 0.6):
        assert colour_at(figure, -0.02, height) == pytest.approx([0.75, 0.75, 1.0], abs=0.02)
    # Between the lower end of the thigh (0.821 - 0.34 - 0.06) and the upper end of the shin (0.418 + 0.049).
    assert colour_at(figure, -0.01, 0.445) == pytest.approx([0.75, 0.75, 1.0], abs=0.02)


def test_phases_are_drawn_side_by_side(figure: Figure) -> None:
    ax = figure.axes[0]
    angles = np.array([0.0, -0.1, -0.2])
    places = draw_phases(ax, angles, -0.05, [0.0, 0.1, 0.2], 0.6)
    assert places == pytest.approx([0.0, 0.6, 1.2])
    for place, angle, target in zip(places, angles, (0.0, 0.1, 0.2), strict=True):
        assert colour_at(figure, place + target, 1.7) == pytest.approx(to_rgb(TARGET_COLOUR), abs=0.01)
        hip = joint_positions(angle, -0.05)[0] + [place, 0]
        assert colour_at(figure, *hip) == pytest.approx(to_rgb(HIP_COLOUR), abs=0.01)
    # Nothing between two bodies.
    assert np.allclose(colour_at(figure, 0.42, 0.8), 1)


def test_phases_refuse_two_dimensions(figure: Figure) -> None:
    with pytest.raises(ValueError, match=r"must be \(P,\), but are \(2, 2\)"):
        draw_phases(figure.axes[0], np.zeros((2, 2)), 0.0, 0.0, 0.5)


def test_drawing_needs_no_simulator_and_importing_it_not_even_mujoco() -> None:
    code = """
import sys
from posture.drawing.silhouette import solids
assert "mujoco" not in sys.modules
solids(0, 0)
assert not {"torch", "warp", "newton"} & sys.modules.keys()
"""
    subprocess.run([sys.executable, "-c", code], check=True)
