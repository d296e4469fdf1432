"""The stander's segments in the sagittal plane, read from its Newton model, for planar mechanics and theory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from envs.body.joints import ANKLE, BODIES, HIP, JOINTS
from envs.config import EnvConfig

if TYPE_CHECKING:
    import newton

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Segments:
    """Masses, inertias and geometry of HAT, both legs together and both feet together, without springs and load.

    hat_mass, leg_mass, foot_mass [kg]. hat_inertia, leg_inertia, foot_inertia: about y through centres of mass [kg m2].
    Positions are (x, z) [m] along the segment's own axes, which are the world's when upright: hat_com, hat_frame and head
    from the hip; leg_com, leg_frame and hip from the ankle; foot_com, foot_frame, heel and toe (centres of the balls at the
    ends of the sole) from the ankle. sole_radius: of those balls [m]. half_width: distance of the frames of leg and foot
    from the midplane [m], (2,). gravity [m/s2].
    """

    hat_mass: float
    leg_mass: float
    foot_mass: float
    hat_inertia: float
    leg_inertia: float
    foot_inertia: float
    hat_com: Array
    hat_frame: Array
    head: Array
    leg_com: Array
    leg_frame: Array
    hip: Array
    foot_com: Array
    foot_frame: Array
    heel: Array
    toe: Array
    sole_radius: float
    half_width: Array
    gravity: float

    @property
    def ankle_x(self) -> float:
        """Ankle in the foot's frame along x [m]."""
        return -float(self.foot_frame[0])

    @property
    def ankle_height(self) -> float:
        """Ankle above the ground, feet flat [m]."""
        return self.sole_radius - float(self.heel[1])

    @property
    def heel_x(self) -> float:
        """Rear end of the contact line in the foot's frame [m]."""
        return float((self.heel - self.foot_frame)[0])

    @property
    def toe_x(self) -> float:
        """Front end of the contact line in the foot's frame [m]."""
        return float((self.toe - self.foot_frame)[0])


def segments(model: newton.Model) -> Segments:
    """The segments of one stander of `model`; all worlds are copies of it."""
    # Imported here because users of `Segments` need no simulator.
    from envs.body.model import geometry

    plane = [0, 2]
    mass, com = (np.asarray(a.numpy()[: len(BODIES)], dtype=np.float64) for a in (model.body_mass, model.body_com))
    inertia = model.body_inertia.numpy()[: len(BODIES), 1, 1].astype(np.float64)
    first = len(model.joint_label) // model.world_count - len(JOINTS)
    joints = slice(first, first + len(JOINTS))
    in_parent, in_child = (a.numpy()[joints, :3].astype(np.float64) for a in (model.joint_X_p, model.joint_X_c))
    hat, leg, foot = (BODIES.index(name) for name in ("hat", "leg_left", "foot_left"))
    shape = geometry(model)
    sole = [label.rsplit("/", 1)[-1] for label in model.shape_label].index("sole_left")
    sole_z = float(model.shape_transform.numpy()[sole][2])
    foot_frame = -in_child[ANKLE]
    # Distance of hip and ankle from the midplane: that of the parent's frame plus the offset in it.
    hip_y = float(in_parent[HIP][1] - in_child[HIP][1])
    ankle_y = hip_y + float(in_parent[ANKLE][1] - in_child[ANKLE][1])
    return Segments(
        hat_mass=float(mass[hat]),
        leg_mass=2 * float(mass[leg]),
        foot_mass=2 * float(mass[foot]),
        hat_inertia=float(inertia[hat]),
        leg_inertia=2 * float(inertia[leg]),
        foot_inertia=2 * float(inertia[foot]),
        hat_com=(com[hat] - in_parent[HIP])[plane],
        hat_frame=-in_parent[HIP][plane],
        head=(np.asarray(shape.head, dtype=np.float64) - in_parent[HIP])[plane],
        leg_com=(com[leg] - in_parent[ANKLE])[plane],
        leg_frame=-in_parent[ANKLE][plane],
        hip=(in_child[HIP] - in_parent[ANKLE])[plane],
        foot_com=(com[foot] + foot_frame)[plane],
        foot_frame=foot_frame[plane],
        heel=np.array([shape.heel_x + foot_frame[0], sole_z + foot_frame[2]]),
        toe=np.array([shape.toe_x + foot_frame[0], sole_z + foot_frame[2]]),
        sole_radius=float(model.shape_scale.numpy()[sole][0]),
        half_width=np.array([hip_y, ankle_y]),
        gravity=-float(model.gravity.numpy()[-1][2]),
    )


def read_segments(config: EnvConfig) -> Segments:
    """The segments of the body as simulated, from the Newton model that `build_model` gives for `config`."""
    # Imported here because users of the result need no simulator.
    from envs.body.model import build_model

    return segments(build_model(config, num_worlds=1, device="cpu"))
