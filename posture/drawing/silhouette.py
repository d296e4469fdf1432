"""The stander's body from the side, drawn into matplotlib axes: what a screenshot shows, without a GPU or a display.

The view is along +y onto the sagittal plane: x forward to the right, z up, in metres, the ground at z = 0. Hip flexion is
negative, and the ankle is negative when the body leans forward. The foot lies flat, so that the two angles fix the pose;
left and right move alike, and the near (right) side alone is drawn. MuJoCo reads every length from envs/body/humanoid.xml.

x is counted as in a trial: the head of the upright body is at 0 before the foot has moved. `foot_x` [m] is how far forward
the foot has moved since (`Trajectory.foot_displacement`, where it crept forward).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, PathPatch
from matplotlib.path import Path as Outline
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull

Array = NDArray[np.float64]

BODY_COLOUR, TARGET_COLOUR, GROUND_COLOUR = "#4F7CAC", "#E69F00", "#555555"
HIP_COLOUR, ANKLE_COLOUR = "#CC79A7", "#009E73"  # those of the joints in every figure
DOT_RADIUS, TARGET_RADIUS = 0.018, 0.03  # of the marks, not of the body [m]
NECK_WIDTH = 0.6  # as a share of the shoulders' radius

PALENESS = (0.45, 0.65, 0.0, 0.2)  # of trunk, head, leg and foot, arm: from back to front, 1 is white

_PLANE, _SPHERE, _CAPSULE = 0, 2, 3  # mujoco.mjtGeom

NEAR = "_right"
SIDES = ("_left", NEAR)


class Disc(NamedTuple):
    """An end of a solid in projection: centre (x, z) and radius, all [m]."""

    x: float
    z: float
    radius: float


Solid = tuple[Disc, ...]
"""The convex hull of its discs: of one for a sphere, of two for a capsule."""


class DrawnBody(NamedTuple):
    """The artists of a drawn stander, from back to front: of each layer its fill and its edge, then hip and ankle."""

    layers: list[PathPatch]
    joints: list[Circle]
    shift: float  # of the drawing along x [m]

    def move(self, hip: float, ankle: float, foot_x: float = 0.0) -> None:
        """Move the artists to `hip` and `ankle` angle [rad], `foot_x` [m], in place of drawing anew."""
        outlines = [outline for layer in _layers(hip, ankle, foot_x, self.shift) for outline in layer]
        for patch, outline in zip(self.layers, outlines, strict=True):
            patch.set_path(outline)
        for circle, (x, z) in zip(self.joints, joint_positions(hip, ankle, foot_x), strict=True):
            circle.center = x + self.shift, z


def joint_positions(hip: float, ankle: float, foot_x: float = 0.0) -> Array:
    """Hip joint and ankle joint (x, z) [m] at `hip` and `ankle` angle [rad]. Shape (2, 2), the hip first."""
    data = _pose(hip, ankle, foot_x)
    return np.stack([data.joint(name + NEAR).xanchor[[0, 2]] for name in ("hip", "ankle")])


def head_position(hip: float, ankle: float, foot_x: float = 0.0) -> tuple[float, float]:
    """Centre of the head (x, z) [m] at `hip` and `ankle` angle [rad]."""
    x, _, z = _pose(hip, ankle, foot_x).geom("head").xpos
    return float(x), float(z)


def solids(hip: float, ankle: float, foot_x: float = 0.0) -> dict[str, dict[str, Solid]]:
    """Solids of the trunk, head, near arm, leg and foot at `hip` and `ankle` angle [rad], by part and by geom name.

    All that carry mass are there: not the ground, nor the soles, which mark where the foot can touch it.
    """
    model, data = _model(), _pose(hip, ankle, foot_x)
    parts: dict[str, dict[str, Solid]] = {"trunk": {}, "head": {}, "leg": {}, "foot": {}, "arm": {}}
    for i in range(model.ngeom):
        geom = model.geom(i)
        body, far = model.body(geom.bodyid[0]).name, geom.name.endswith(SIDES) and not geom.name.endswith(NEAR)
        if far or geom.contype[0] or geom.type[0] == _PLANE:
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
) -> DrawnBody:
    """Draw the stander at `hip` and `ankle` angle [rad], its two joints as dots; the aspect of `ax` becomes equal.

    `shift` [m] moves the drawing along x and nothing else. From back to front: trunk and head, leg, arm, as seen from
    the right. `alpha` below 1 suits several bodies in one place.
    """
    body = DrawnBody([], [], shift)
    style = {"alpha": alpha, "zorder": 2}
    # One path a layer: where its solids overlap it is filled once, so that a low alpha does not show the overlap.
    for (whole, solid), paleness in zip(_layers(hip, ankle, foot_x, shift), PALENESS, strict=True):
        body.layers.append(ax.add_patch(PathPatch(whole, fc=_mixed(colour, "white", paleness), ec="none", **style)))
        body.layers.append(ax.add_patch(PathPatch(solid, fc="none", ec=_mixed(colour, "black", 0.5), lw=0.6, **style)))
    for (x, z), dot in zip(joint_positions(hip, ankle, foot_x), (HIP_COLOUR, ANKLE_COLOUR), strict=True):
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
    target_height: float,
    foot_x: ArrayLike = 0.0,
    colour: str = BODY_COLOUR,
) -> Array:
    """Draw P instants of a motion side by side, `spacing` [m] apart, each with the target above. Source: paper Fig. 2.

    `hip` and `ankle` [rad], `target_x` [m] and `foot_x` [m], all (P,) or one number for all; `target_height` [m], paper
    Table 1. A dashed line hangs from the target to the height of the head's centre, a black dot; the short mark on the
    ground below each body is x = 0 there. Returns the places of these marks [m], (P,), for labels.
    """
    arrays = [np.asarray(values, dtype=np.float64) for values in (hip, ankle, target_x, foot_x)]
    instants = np.stack(np.broadcast_arrays(*map(np.atleast_1d, arrays)), axis=1)
    if instants.ndim != 2 or not len(instants):
        raise ValueError(f"hip, ankle, target_x and foot_x must be (P,), but are {', '.join(str(a.shape) for a in arrays)}")
    places: Array = spacing * np.arange(len(instants), dtype=np.float64)
    for place, (hip_angle, ankle_angle, target, foot) in zip(places, instants, strict=True):
        draw_body(ax, hip_angle, ankle_angle, foot_x=foot, shift=place, colour=colour)
        head_x, head_z = head_position(hip_angle, ankle_angle, foot)
        draw_target(ax, place + target, target_height, head_height=head_z)
        ax.add_patch(Circle((place + head_x, head_z), DOT_RADIUS / 2, fc="black", ec="none", zorder=3))
        ax.plot([place, place], [-0.05, 0.0], color=GROUND_COLOUR, lw=1.2, zorder=1)
    draw_ground(ax, places[0] - spacing / 2, places[-1] + spacing / 2)
    ax.set(xlim=(places[0] - spacing / 2, places[-1] + spacing / 2), ylim=(-0.08, target_height + 2 * TARGET_RADIUS))
    ax.set_axis_off()
    return places


@cache
def _model() -> Any:
    """The body as MuJoCo reads it; its file is found without importing `envs`, which needs the simulator."""
    import mujoco  # only where a body is drawn: figures without one need no simulator

    spec = find_spec("envs")
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError("the package envs, which holds humanoid.xml, is not installed")
    return mujoco.MjModel.from_xml_path(str(Path(spec.origin).with_name("body") / "humanoid.xml"))


def _pose(hip: float, ankle: float, foot_x: float) -> Any:
    """MuJoCo's kinematics of the body with both feet flat on the ground, `foot_x` [m] ahead of where the MJCF has them.

    Pitch [rad] about +y adds up from the root down: foot = HAT + hip + ankle. A flat foot has none, which gives the HAT's;
    then the whole is moved to bring the sole to its place.
    """
    import mujoco

    model = _model()
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


def _layers(hip: float, ankle: float, foot_x: float, shift: float) -> list[tuple[Outline, Outline]]:
    """Of each layer of the drawing, in the order of PALENESS: what is filled, and the solids in it, which have edges."""
    parts = {part: list(found.values()) for part, found in solids(hip, ankle, foot_x).items()}
    ankle_joint = joint_positions(hip, ankle, foot_x)[1]
    layers: tuple[tuple[list[Solid], list[Solid]], ...] = (
        (parts["trunk"], _trunk_links(parts)),
        (parts["head"], []),
        (parts["foot"] + parts["leg"], _ankle_links(parts, ankle_joint)),
        (parts["arm"], []),
    )
    return [(_outline([*found, *links], shift), _outline(found, shift)) for found, links in layers]


def _projection(geom: Any, placed: Any) -> Solid:
    """A sphere or capsule, seen along y. ValueError for another type."""
    x, _, z = placed.xpos
    if geom.type[0] == _SPHERE:
        return (Disc(x, z, geom.size[0]),)
    if geom.type[0] != _CAPSULE:
        raise ValueError(f"geom {geom.name} is neither a sphere nor a capsule, and nothing else can be drawn")
    half_x, _, half_z = geom.size[1] * placed.xmat.reshape(3, 3)[:, 2]
    return Disc(x - half_x, z - half_z, geom.size[0]), Disc(x + half_x, z + half_z, geom.size[0])


def _trunk_links(parts: dict[str, list[Solid]]) -> list[Solid]:
    """What fills the gaps along the midline: the hulls of neighbours, and a neck that ends at the edge of the head."""
    trunk = sorted((solid[0] for solid in parts["trunk"]), key=lambda disc: disc.z)
    top, head = trunk[-1], parts["head"][0][0]
    share = 1 - head.radius / math.hypot(head.x - top.x, head.z - top.z)
    width = NECK_WIDTH * top.radius
    neck = Disc(top.x, top.z, width), Disc(top.x + share * (head.x - top.x), top.z + share * (head.z - top.z), width)
    return [*pairwise(trunk), neck]


def _ankle_links(parts: dict[str, list[Solid]], joint: Array) -> list[Solid]:
    """What fills the gap between shin and foot: from the lower end of the shin to below the ankle joint (x, z)."""
    shin = min((disc for solid in parts["leg"] for disc in solid), key=lambda disc: disc.z)
    foot = parts["foot"][0][0]
    return [(shin, Disc(float(joint[0]), foot.z, foot.radius))]


def _outline(solids: Sequence[Solid], shift: float) -> Outline:
    """Closed outlines of solids, `shift` [m] further along x; all counter-clockwise, so that overlaps stay filled."""
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
