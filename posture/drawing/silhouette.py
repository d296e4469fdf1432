"""The stander's body from the side, drawn into matplotlib axes, without a GPU or a display.

The view is along +y onto the sagittal plane: x forward to the right, z up, in metres, the ground at z = 0. Hip flexion is
negative, and the ankle is negative when the body leans forward. The foot lies flat, so the two angles
determine the pose. Left and right move together; only the near (right) side is drawn. MuJoCo reads all lengths from the
MJCF of the body, `person`'s or by default the paper's; it is imported in the functions that use it because it is slow.

x is that of a trial: the head of the upright body is at 0 before the foot has moved. `foot_x` [m] is how far forward the
foot has moved since (`Trajectory.foot_displacement`, if forward).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, PathPatch
from matplotlib.path import Path as Outline
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull

from envs.config import Person
from posture.config.published import read_published
from posture.drawing.style import ANKLE_COLOUR, HIP_COLOUR, ORANGE

Array = NDArray[np.float64]

BODY_COLOUR, TARGET_COLOUR, GROUND_COLOUR = "#4F7CAC", ORANGE, "#555555"
DOT_RADIUS, TARGET_RADIUS = 0.018, 0.03  # of the marks for joints and target [m]
NECK_WIDTH = 0.6  # as a share of the radius of the shoulders
WHITENESS = (0.45, 0.65, 0.0, 0.2)  # of the layers from back to front: trunk, head, leg and foot, arm; 1 is white

NEAR = "_right"
SIDES = ("_left", NEAR)


class Disc(NamedTuple):
    """The projected end of a solid: centre (x, z) and radius, all [m]."""

    x: float
    z: float
    radius: float


Solid = tuple[Disc, ...]
"""The convex hull of its discs: one for a sphere, two for a capsule."""


class DrawnBody(NamedTuple):
    """The artists of a drawn stander, from back to front: fill and edge of each layer, then hip and ankle joint."""

    layers: list[PathPatch]
    joints: list[Circle]
    shift: float  # of the drawing along x [m]
    person: Person | None

    def move(self, hip: float, ankle: float, foot_x: float = 0.0) -> None:
        """Move the artists to `hip` and `ankle` angle [rad] and `foot_x` [m]."""
        outlines = [outline for layer in _layers(hip, ankle, foot_x, self.shift, self.person) for outline in layer]
        for patch, outline in zip(self.layers, outlines, strict=True):
            patch.set_path(outline)
        for circle, (x, z) in zip(self.joints, joint_positions(hip, ankle, foot_x, self.person), strict=True):
            circle.center = x + self.shift, z


def target_height(person: Person | None) -> float:
    """Height at which the target is drawn [m]: as far above the head as in paper Table 1."""
    table = read_published().table_1
    return table.target_height_m if person is None else table.target_height_m - table.height_m + person.height


def joint_positions(hip: float, ankle: float, foot_x: float = 0.0, person: Person | None = None) -> Array:
    """Hip joint and ankle joint (x, z) [m] at `hip` and `ankle` angle [rad]. Shape (2, 2), the hip first."""
    data = _pose(hip, ankle, foot_x, person)
    return np.stack([data.joint(name + NEAR).xanchor[[0, 2]] for name in ("hip", "ankle")])


def head_position(hip: float, ankle: float, foot_x: float = 0.0, person: Person | None = None) -> tuple[float, float]:
    """Centre of the head (x, z) [m] at `hip` and `ankle` angle [rad]."""
    x, _, z = _pose(hip, ankle, foot_x, person).geom("head").xpos
    return float(x), float(z)


def solids(hip: float, ankle: float, foot_x: float = 0.0, person: Person | None = None) -> dict[str, dict[str, Solid]]:
    """Solids of the trunk, head, near arm, leg and foot at `hip` and `ankle` angle [rad], by part and by geom name.

    These are the geoms with mass: without the ground and the soles, which only define the contact.
    """
    import mujoco

    model, data = _model(person), _pose(hip, ankle, foot_x, person)
    parts: dict[str, dict[str, Solid]] = {"trunk": {}, "head": {}, "leg": {}, "foot": {}, "arm": {}}
    for i in range(model.ngeom):
        geom = model.geom(i)
        body, far = model.body(geom.bodyid[0]).name, geom.name.endswith(SIDES) and not geom.name.endswith(NEAR)
        if far or geom.contype[0] or geom.type[0] == mujoco.mjtGeom.mjGEOM_PLANE:
            continue
        if body == "hat":
            part = "head" if geom.name == "head" else "arm" if geom.name.endswith(NEAR) else "trunk"
        else:
            part = body.removesuffix(NEAR)
        parts[part][geom.name] = _projection(geom, data.geom(i))
    return parts


def draw_body(
    ax: Axes,
    hip: float,
    ankle: float,
    *,
    foot_x: float = 0.0,
    shift: float = 0.0,
    alpha: float = 1.0,
    colour: str = BODY_COLOUR,
    person: Person | None = None,
) -> DrawnBody:
    """Draw the stander at `hip` and `ankle` angle [rad], its two joints as dots; the aspect of `ax` becomes equal.

    `shift` [m] moves the drawing along x. From back to front: trunk and head, leg, arm, as seen from the right. Use `alpha`
    below 1 for overlapping bodies.
    """
    body = DrawnBody([], [], shift, person)
    style = {"alpha": alpha, "zorder": 2}
    # One path per layer, so that overlapping solids are filled once and a low alpha does not show the overlap.
    for (whole, solid), whiteness in zip(_layers(hip, ankle, foot_x, shift, person), WHITENESS, strict=True):
        body.layers.append(ax.add_patch(PathPatch(whole, fc=_mixed(colour, "white", whiteness), ec="none", **style)))
        body.layers.append(ax.add_patch(PathPatch(solid, fc="none", ec=_mixed(colour, "black", 0.5), lw=0.6, **style)))
    for (x, z), dot in zip(joint_positions(hip, ankle, foot_x, person), (HIP_COLOUR, ANKLE_COLOUR), strict=True):
        circle = Circle((x + shift, z), DOT_RADIUS, facecolor=dot, edgecolor="white", lw=0.7, alpha=alpha, zorder=2)
        body.joints.append(ax.add_patch(circle))
    ax.set_aspect("equal")
    return body


def draw_ground(ax: Axes, left: float, right: float) -> None:
    """The ground as a line at height 0 from x = `left` to `right` [m]."""
    ax.plot([left, right], [0.0, 0.0], color=GROUND_COLOUR, lw=1.2, solid_capstyle="butt", zorder=1)


def draw_target(ax: Axes, x: float, height: float, *, head_height: float = 0.0) -> tuple[Line2D, Circle]:
    """The target as a ball at (`x`, `height`) [m], and a dashed line from it down to `head_height` [m]; line and ball."""
    (line,) = ax.plot([x, x], [head_height, height], color=TARGET_COLOUR, lw=1.0, ls=(0, (3, 2)), zorder=3)
    ball = Circle((x, height), TARGET_RADIUS, facecolor=TARGET_COLOUR, edgecolor="black", lw=0.5, zorder=3)
    return line, ax.add_patch(ball)


def draw_phases(
    ax: Axes,
    hip: ArrayLike,
    ankle: ArrayLike,
    target_x: ArrayLike,
    spacing: float,
    *,
    foot_x: ArrayLike = 0.0,
    colour: str = BODY_COLOUR,
    person: Person | None = None,
) -> Array:
    """Draw P instants of a motion side by side, `spacing` [m] apart, each with the target above. Source: paper Fig. 2.

    `hip` and `ankle` [rad], `target_x` [m] and `foot_x` [m], each (P,) or one number. A dashed line runs from the target
    down to the height of the head's centre, which is a black dot. A short mark on the ground below each body is at its
    x = 0. Returns the positions of these marks [m], (P,), for labels.
    """
    arrays = [np.asarray(values, dtype=np.float64) for values in (hip, ankle, target_x, foot_x)]
    instants = np.stack(np.broadcast_arrays(*map(np.atleast_1d, arrays)), axis=1)
    if instants.ndim != 2 or not len(instants):
        raise ValueError(f"hip, ankle, target_x and foot_x must be (P,), but are {', '.join(str(a.shape) for a in arrays)}")
    height = target_height(person)
    places: Array = spacing * np.arange(len(instants), dtype=np.float64)
    for place, (hip_angle, ankle_angle, target, foot) in zip(places, instants, strict=True):
        draw_body(ax, hip_angle, ankle_angle, foot_x=foot, shift=place, colour=colour, person=person)
        head_x, head_z = head_position(hip_angle, ankle_angle, foot, person)
        draw_target(ax, place + target, height, head_height=head_z)
        ax.add_patch(Circle((place + head_x, head_z), DOT_RADIUS / 2, fc="black", ec="none", zorder=3))
        ax.plot([place, place], [-0.05, 0.0], color=GROUND_COLOUR, lw=1.2, zorder=1)
    draw_ground(ax, places[0] - spacing / 2, places[-1] + spacing / 2)
    ax.set(xlim=(places[0] - spacing / 2, places[-1] + spacing / 2), ylim=(-0.08, height + 2 * TARGET_RADIUS))
    ax.set_axis_off()
    return places


@lru_cache(maxsize=16)
def _model(person: Person | None) -> Any:
    """MuJoCo's model of the body."""
    import mujoco

    from envs.body.mjcf import mjcf

    return mujoco.MjModel.from_xml_string(mjcf(person))


def _pose(hip: float, ankle: float, foot_x: float, person: Person | None) -> Any:
    """MuJoCo's kinematics of the body with both feet flat on the ground, `foot_x` [m] ahead of their place in the MJCF.

    Pitch [rad] about +y: foot = HAT + hip + ankle. That of a flat foot is 0, which gives the HAT's; then the body is moved
    so that the sole is at its place.
    """
    import mujoco

    model = _model(person)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    place = data.body("foot" + NEAR).xpos[0] + foot_x
    for side in SIDES:
        data.joint("hip" + side).qpos = hip
        data.joint("ankle" + side).qpos = ankle
    root = data.joint("root").qpos
    mujoco.mju_axisAngle2Quat(root[3:], np.array([0.0, 1.0, 0.0]), -(hip + ankle))
    mujoco.mj_kinematics(model, data)
    root[0] += place - data.body("foot" + NEAR).xpos[0]
    root[2] -= data.geom("sole" + NEAR).xpos[2] - model.geom("sole" + NEAR).size[0]
    mujoco.mj_kinematics(model, data)
    return data


def _layers(hip: float, ankle: float, foot_x: float, shift: float, person: Person | None) -> list[tuple[Outline, Outline]]:
    """For each layer, in the order of WHITENESS: the outline that is filled, and the solids whose edges are drawn."""
    parts = {part: list(found.values()) for part, found in solids(hip, ankle, foot_x, person).items()}
    ankle_joint = joint_positions(hip, ankle, foot_x, person)[1]
    layers: tuple[tuple[list[Solid], list[Solid]], ...] = (
        (parts["trunk"], _trunk_links(parts)),
        (parts["head"], []),
        (parts["foot"] + parts["leg"], _ankle_links(parts, ankle_joint)),
        (parts["arm"], []),
    )
    return [(_outline([*found, *links], shift), _outline(found, shift)) for found, links in layers]


def _projection(geom: Any, placed: Any) -> Solid:
    """A sphere or capsule, projected along y. Raises ValueError for another type."""
    import mujoco

    x, _, z = placed.xpos
    if geom.type[0] == mujoco.mjtGeom.mjGEOM_SPHERE:
        return (Disc(x, z, geom.size[0]),)
    if geom.type[0] != mujoco.mjtGeom.mjGEOM_CAPSULE:
        raise ValueError(f"geom {geom.name} is neither a sphere nor a capsule")
    half_x, _, half_z = geom.size[1] * placed.xmat.reshape(3, 3)[:, 2]
    return Disc(x - half_x, z - half_z, geom.size[0]), Disc(x + half_x, z + half_z, geom.size[0])


def _trunk_links(parts: dict[str, list[Solid]]) -> list[Solid]:
    """Solids that fill the gaps along the midline: hulls of neighbours, and a neck up to the edge of the head."""
    trunk = sorted((solid[0] for solid in parts["trunk"]), key=lambda disc: disc.z)
    top, head = trunk[-1], parts["head"][0][0]
    share = 1 - head.radius / math.hypot(head.x - top.x, head.z - top.z)
    width = NECK_WIDTH * top.radius
    neck = Disc(top.x, top.z, width), Disc(top.x + share * (head.x - top.x), top.z + share * (head.z - top.z), width)
    return [*pairwise(trunk), neck]


def _ankle_links(parts: dict[str, list[Solid]], joint: Array) -> list[Solid]:
    """The solid that fills the gap between shin and foot: from the lower end of the shin to below the ankle joint (x, z)."""
    shin = min((disc for solid in parts["leg"] for disc in solid), key=lambda disc: disc.z)
    foot = parts["foot"][0][0]
    return [(shin, Disc(float(joint[0]), foot.z, foot.radius))]


def _outline(solids: Sequence[Solid], shift: float) -> Outline:
    """Closed outlines of solids, `shift` [m] further along x; all counter-clockwise, so that overlaps are filled."""
    angle = np.linspace(0.0, 2.0 * np.pi, 96, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    outlines = []
    for solid in solids:
        points = np.concatenate([(disc.x + shift, disc.z) + disc.radius * circle for disc in solid])
        hull = points[ConvexHull(points).vertices]
        outlines.append(Outline(np.concatenate([hull, hull[:1]]), closed=True))
    return Outline.make_compound_path(*outlines)


def _mixed(colour: str, other: str, share: float) -> Array:
    """`colour` with a `share` (0 .. 1) of `other` in it. RGB, shape (3,)."""
    return np.asarray((1 - share) * np.array(to_rgb(colour)) + share * np.array(to_rgb(other)), dtype=np.float64)
