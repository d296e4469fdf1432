"""The stander in 3-D, in a scene of viser: body, target with its tolerance, and ground reaction forces."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import mujoco
import numpy as np
import trimesh
import viser
from matplotlib.colors import to_rgb

from envs.body.joints import BODIES
from envs.body.mjcf import mjcf
from envs.config import Person
from posture.analysis.trajectory import Array
from posture.drawing.silhouette import target_height
from posture.drawing.style import FALL_COLOUR, MODE_COLOUR, ORANGE, RED
from posture.play.session import State

BODY_COLOUR, LIMB_COLOUR, LOAD_COLOUR = (79, 124, 172), (122, 157, 195), (70, 70, 75)
TARGET_RADIUS = 0.03  # [m]
METRES_PER_NEWTON = 1.0 / 400.0  # of the force arrows: the weight of the body is about a metre
ARROW_OFFSET = np.array([[0.0, 0.09, 0.0], [0.0, -0.09, 0.0]])  # [m] beside the legs, which would hide the arrows
LEAD_DENSITY = 11_340  # [kg/m^3]
CAMERA, LOOK_AT, FIELD_OF_VIEW = (0.75, -3.3, 1.25), (0.1, 0.0, 0.95), 0.7

# Bodies that move together in the sagittal plane, drawn in the frame of the first.
PARTS = {"hat": ("hat",), "leg": ("leg_left", "leg_right"), "foot": ("foot_left", "foot_right")}


class Shape(NamedTuple):
    """A mesh of a part, in the part's frame [m], with its colour."""

    vertices: Array
    faces: Array
    colour: tuple[int, int, int]


class Scene:
    """Draws states into `scene`, of a server or of one of its clients."""

    def __init__(self, scene: viser.SceneApi, sole: tuple[float, float], person: Person | None) -> None:
        """`sole`: its ends in the foot frame [m]. `person`: whose body it is; None: the paper's. What a scene of another
        body has drawn into `scene` is replaced."""
        self.person, target = person, target_height(person)
        model, data = _upright(person)
        head, head_height = float(model.geom("head").pos[2]), float(data.geom("head").xpos[2])
        scene.set_up_direction("+z")
        scene.configure_default_lights(enabled=True, cast_shadow=False)  # shadows are slow without a GPU
        scene.add_grid(
            "/ground",
            3.0,
            2.0,
            cell_size=0.1,
            section_size=0.5,
            cell_thickness=0.5,
            section_thickness=1.0,
        )
        self._parts = {}
        for part in PARTS:
            self._parts[part] = scene.add_frame(f"/{part}", show_axes=False)
            for i, shape in enumerate(_shapes(person)[part]):
                scene.add_mesh_simple(f"/{part}/{i}", shape.vertices, shape.faces, color=shape.colour)
        self._load = scene.add_icosphere("/hat/load", 1.0, LOAD_COLOUR, visible=False)
        # Across the head at its centre, visible against the tolerance band.
        pin = trimesh.creation.cylinder(0.006, segment=[[0, -0.19, head], [0, 0.19, head]], sections=8)
        scene.add_mesh_simple("/hat/pin", pin.vertices, pin.faces, color=(20, 20, 20))
        self._target = scene.add_frame("/target", show_axes=False)
        scene.add_icosphere("/target/ball", TARGET_RADIUS, rgb(ORANGE), position=(0.0, 0.0, target))
        line = [[[0.0, 0.0, head_height - 0.06], [0.0, 0.0, target]]]
        scene.add_line_segments("/target/line", np.array(line), rgb(ORANGE), thickness=2.0, thickness_units="screen")
        at = 0.0, 0.0, head_height - 0.02
        self._band = scene.add_box("/target/band", rgb(ORANGE), (1.0, 0.36, 0.3), opacity=0.35, position=at)
        self._foot_middle = (sole[0] + sole[1]) / 2
        self._plate = scene.add_box("/plate", rgb(MODE_COLOUR["undefined"]), (0.5, 0.6, 0.004), opacity=0.6)
        self._force = scene.add_arrows(
            "/force", np.zeros((2, 2, 3)), rgb(FALL_COLOUR), shaft_radius=0.008, head_radius=0.022, head_length=0.05
        )
        self._label = scene.add_label(
            "/label", "", position=(0.1, 0.0, target + 0.2), anchor="bottom-center", font_screen_scale=1.6
        )
        self._shown: dict[str, object] = {}

    def show(self, state: State, tolerance: float, load: float, load_at: tuple[float, float] | None) -> None:
        """Move everything to `state`; present tolerance [m], load [kg] and its place (`EnvConfig.load_at`)."""
        for part, bodies in PARTS.items():
            pose = state.pose[BODIES.index(bodies[0])]
            frame = self._parts[part]
            frame.position = pose[:3]
            frame.wxyz = pose[[6, 3, 4, 5]]
        self._target.position = (state.target, 0.0, 0.0)
        foot = state.pose[BODIES.index("foot_left")]
        self._plate.position = (foot[0] + self._foot_middle, 0.0, -0.004)
        start = state.point + ARROW_OFFSET
        self._force.points = np.stack([start, start + METRES_PER_NEWTON * state.force], axis=1).astype(np.float32)
        outside = abs(state.head - state.target) > tolerance
        if self._changed("band", (tolerance, outside)):
            self._band.scale = (2 * tolerance, 1.0, 1.0)
            self._band.color = rgb(RED if outside else ORANGE)
        if self._changed("load", (load, load_at)):
            self._load.visible = load > 0
            x, z = load_at or tuple(_upright(self.person)[0].body("hat").ipos[[0, 2]])
            self._load.position = (x, -0.16, z)  # beside the trunk, where it is seen
            self._load.scale = max(1e-3, (3 * load / (4 * np.pi * LEAD_DENSITY)) ** (1 / 3))  # a sphere of lead

    def show_mode(self, mode: str, text: str) -> None:
        """Show `text` above the body, and the colour of `mode` on the ground under its feet."""
        if self._changed("text", text):
            self._label.text = text
        if self._changed("mode", mode):
            self._plate.color = rgb(MODE_COLOUR[mode])

    def _changed(self, name: str, value: object) -> bool:
        """Whether `value` differs from the last one of `name`; only changes are sent."""
        changed = self._shown.get(name) != value
        self._shown[name] = value
        return changed


def aim_camera(camera: viser.CameraHandle | viser.InitialCameraConfig) -> None:
    """Point `camera` at the stander from its right, a little from the front."""
    camera.position, camera.look_at, camera.fov = CAMERA, LOOK_AT, FIELD_OF_VIEW


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 .. 255."""
    r, g, b = (round(255 * x) for x in to_rgb(colour))
    return r, g, b


@lru_cache(maxsize=4)
def _upright(person: Person | None) -> tuple[Any, Any]:
    """MuJoCo's model of the body, and its data standing upright."""
    model = mujoco.MjModel.from_xml_string(mjcf(person))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@lru_cache(maxsize=4)
def _shapes(person: Person | None) -> dict[str, list[Shape]]:
    """The solids of each part, one mesh per colour."""
    model, data = _upright(person)
    shapes = {}
    for part, bodies in PARTS.items():
        origin = data.body(bodies[0]).xpos
        meshes: dict[tuple[int, int, int], list[trimesh.Trimesh]] = {}
        for i in range(model.ngeom):
            geom = model.geom(i)
            if model.body(geom.bodyid[0]).name not in bodies or geom.contype[0]:
                continue
            mesh = _mesh(geom, data.geom(i))
            mesh.apply_translation(-origin)
            arm = "arm" in geom.name or "hand" in geom.name
            meshes.setdefault(LIMB_COLOUR if arm or part != "hat" else BODY_COLOUR, []).append(mesh)
        if part == "hat":
            meshes[BODY_COLOUR].append(_trunk(meshes[BODY_COLOUR], model.geom("head")))
        if part == "leg":
            meshes[LIMB_COLOUR] += _knees(meshes[LIMB_COLOUR], model)
        joined = {colour: trimesh.util.concatenate(of_colour) for colour, of_colour in meshes.items()}
        shapes[part] = [Shape(mesh.vertices, mesh.faces, colour) for colour, mesh in joined.items()]
    return shapes


def _mesh(geom: Any, pose: Any) -> trimesh.Trimesh:
    """A sphere or capsule at its place in the world."""
    if geom.type[0] == mujoco.mjtGeom.mjGEOM_SPHERE:
        mesh = trimesh.creation.uv_sphere(radius=geom.size[0], count=[20, 20])
    else:
        mesh = trimesh.creation.capsule(height=2 * geom.size[1], radius=geom.size[0], count=[16, 16])
        mesh.apply_translation(-mesh.bounds.mean(axis=0))
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = pose.xmat.reshape(3, 3), pose.xpos
    mesh.apply_transform(transform)
    return mesh


def _trunk(solids: list[trimesh.Trimesh], head: Any) -> trimesh.Trimesh:
    """Hulls that fill the gaps between neighbours along the midline, and a neck; drawn only, without mass."""
    height, radius = float(head.pos[2]), float(head.size[0])
    trunk = sorted((mesh for mesh in solids if mesh.bounds[:, 2].max() < height), key=lambda mesh: mesh.centroid[2])
    hulls = [trimesh.convex.convex_hull(np.vstack([a.vertices, b.vertices])) for a, b in zip(trunk, trunk[1:], strict=False)]
    neck = trimesh.creation.cylinder(0.5 * radius, segment=[[0, 0, 0.03], [0, 0, height]], sections=16)
    return trimesh.util.concatenate([*hulls, neck])


def _knees(solids: list[trimesh.Trimesh], model: Any) -> list[trimesh.Trimesh]:
    """Hulls that fill the gap between thigh and shin of the rigid legs; drawn only, without mass."""
    filled = []
    # In the left leg's frame, whose origin is the hip joint.
    midplane = -float(model.body("leg_left").pos[1])
    below, above = (0.92 * float(model.geom(name).size[0]) for name in ("thigh_left", "shin_left"))
    for side in (1.0, -1.0):
        thigh, shin = sorted((m for m in solids if (m.centroid[1] - midplane) * side > 0), key=lambda m: -m.centroid[2])
        low = thigh.vertices[thigh.vertices[:, 2] < thigh.bounds[0, 2] + below]
        high = shin.vertices[shin.vertices[:, 2] > shin.bounds[1, 2] - above]
        filled.append(trimesh.convex.convex_hull(np.vstack([low, high])))
    return filled
