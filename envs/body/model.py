"""The stander's body: its MJCF as a Newton model of N identical, independent worlds.

Frames and signs, stated once for the whole project: x forward, y left, z up; the sagittal plane is x-z. Joint axes point
along +y and angles are those of the child relative to its parent, so hip flexion is negative, and the ankle is negative
when the body leans forward. Joints are in the order of `JOINTS`.
"""

from dataclasses import dataclass

import newton
import numpy as np
import warp
from newton.solvers import SolverMuJoCo

from envs.body.joints import BODIES, JOINTS
from envs.body.mjcf import mjcf
from envs.config import EnvConfig

# Otherwise Warp prints a line for each of some fifty kernel modules that it loads.
warp.config.log_level = warp.LOG_ERROR


def build_model(config: EnvConfig, num_worlds: int, device: str) -> newton.Model:
    """Newton model of `num_worlds` standers, each on its own ground, with body, springs, damping and armature of `config`.

    Stiffness and load of single worlds are set later by the simulation, without a new model.
    """
    stander = newton.ModelBuilder()
    SolverMuJoCo.register_custom_attributes(stander)
    # Contacts are detected at touch, not before, as when MuJoCo reads the MJCF.
    stander.default_shape_cfg.gap = 0.0
    stander.default_shape_cfg.mu = config.friction
    stander.add_mjcf(mjcf(config.body))
    _check_order(stander)
    first = stander.joint_dof_count - len(JOINTS)
    stander.joint_stiffness[first:] = 2 * [config.hip_k, config.ankle_k]
    stander.joint_damping[first:] = len(JOINTS) * [config.joint_damping]
    stander.joint_armature[first:] = len(JOINTS) * [config.joint_armature]

    builder = newton.ModelBuilder()
    SolverMuJoCo.register_custom_attributes(builder)
    builder.replicate(stander, num_worlds)
    return builder.finalize(device=device)


@dataclass(frozen=True)
class Geometry:
    """Positions on the body that the task and the analysis need, read from the model.

    head: head centre in the HAT frame [m], shape (3,). hat_com: centre of mass of the HAT in the same frame [m], (3,).
    heel_x, toe_x: ends of the sole's contact line in the foot frame [m], which bound the centre of pressure.
    joint_limits: lower and upper limit of each joint of `JOINTS` [rad], shape (2, 4).
    """

    head: np.ndarray
    hat_com: np.ndarray
    heel_x: float
    toe_x: float
    joint_limits: np.ndarray


def geometry(model: newton.Model) -> Geometry:
    """The geometry of one stander of `model`; all worlds are copies of it."""
    labels = [label.rsplit("/", 1)[-1] for label in model.shape_label]
    place = model.shape_transform.numpy()
    sole = labels.index("sole_left")
    half_length = float(model.shape_scale.numpy()[sole][1])
    last = model.joint_dof_count // model.world_count
    limits = [getattr(model, name).numpy()[last - len(JOINTS) : last] for name in ("joint_limit_lower", "joint_limit_upper")]
    return Geometry(
        head=place[labels.index("head")][:3],
        hat_com=model.body_com.numpy()[BODIES.index("hat")].copy(),  # loads change the model's
        heel_x=float(place[sole][0]) - half_length,
        toe_x=float(place[sole][0]) + half_length,
        joint_limits=np.stack(limits),
    )


def _check_order(builder: newton.ModelBuilder) -> None:
    """Raise RuntimeError unless bodies and joints are in the order that every view of the state relies on."""
    bodies = tuple(label.rsplit("/", 1)[-1] for label in builder.body_label)
    joints = tuple(label.rsplit("/", 1)[-1] for label in builder.joint_label)
    if bodies != BODIES or joints != ("root", *JOINTS):
        raise RuntimeError(f"unexpected order in the MJCF: bodies {bodies}, joints {joints}")
