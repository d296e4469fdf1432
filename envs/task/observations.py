"""Registry of the observation terms: for each its function, and the name and unit of each of its values.

`env.observations` names groups and lists the terms that each joins, in order; `agent.obs_groups` says which groups actor and
critic get. Values are in SI units and in the world frame unless stated otherwise: the policy normalises its input by running
statistics.

Configuration is checked against these names before torch is imported, hence the imports within functions.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from envs.body.joints import FEET, JOINTS, KINDS, LEFT, RIGHT

if TYPE_CHECKING:
    import torch

PAST = 8
"""Earlier positions of the target that `target_history` gives."""
PAST_STEPS = 6
"""Control steps between two of them."""


@dataclass(frozen=True)
class TaskState:
    """Arguments of reward, terminations and observations after a step (N worlds, joints in the order of `JOINTS`).

    hat_pose, hat_velocity: (N, 7), (N, 6) of the HAT, see `Simulation.body_pose`, `body_velocity`.
    foot_pose: (N, 2, 7) of the left and the right foot. foot_displacement: (N, 2) distance from the start [m].
    joint_angle, joint_velocity: (N, 4) [rad], [rad/s].
    joint_force: (N, 4) torque about each joint axis by actuator, spring and damper [Nm].
    sole_force, sole_position: (N, 2, 2, 3), see `Simulation`.
    action: (N, 4) actuator torque of each joint over the torque limit. command: (N, 4) what was commanded; the same tensor
        where actuation is ideal.
    head_x, head_vx: (N,) head along x, 0 at the start [m], [m/s].
    target_x, target_vx, target_ax: (N,) [m], [m/s], [m/s2]. target_freq: (N,) its momentary frequency [Hz].
    hip_k, ankle_k [Nm/rad per joint], load [kg], joint_damping [Nm s/rad per joint], friction [-], amplitude of the target
        and tolerance around it [m]: (N,), the same during an episode.
    target_past: (N, PAST) target_x before PAST_STEPS, 2 PAST_STEPS, ... control steps [m]; before the start it was at 0.
    """

    hat_pose: "torch.Tensor"
    hat_velocity: "torch.Tensor"
    foot_pose: "torch.Tensor"
    foot_displacement: "torch.Tensor"
    joint_angle: "torch.Tensor"
    joint_velocity: "torch.Tensor"
    joint_force: "torch.Tensor"
    sole_force: "torch.Tensor"
    sole_position: "torch.Tensor"
    action: "torch.Tensor"
    command: "torch.Tensor"
    head_x: "torch.Tensor"
    head_vx: "torch.Tensor"
    target_x: "torch.Tensor"
    target_vx: "torch.Tensor"
    target_ax: "torch.Tensor"
    target_freq: "torch.Tensor"
    hip_k: "torch.Tensor"
    ankle_k: "torch.Tensor"
    load: "torch.Tensor"
    joint_damping: "torch.Tensor"
    friction: "torch.Tensor"
    amplitude: "torch.Tensor"
    tolerance: "torch.Tensor"
    target_past: "torch.Tensor"


Component = tuple[str, str]
"""Name and unit of one value."""
Function = Callable[[TaskState], "torch.Tensor"]


@dataclass(frozen=True)
class Term:
    """A term: `function` returns (N, len(components)). is_own: known without sensing, as an own command is."""

    function: Function
    components: tuple[Component, ...]
    is_own: bool = False


TERMS: dict[str, Term] = {}
"""Every term under the name of its function."""


def _term(*components: Component, is_own: bool = False) -> Callable[[Function], Function]:
    def register(function: Function) -> Function:
        TERMS[function.__name__] = Term(function, components, is_own)
        return function

    return register


@_term(("torso_z", "m"))
def torso_height(state: TaskState) -> "torch.Tensor":
    """Height of the torso frame."""
    return state.hat_pose[:, 2:3]


@_term(*((f"torso_v{axis}", "m/s") for axis in "xyz"))
def torso_velocity(state: TaskState) -> "torch.Tensor":
    """Linear velocity of the HAT's centre of mass."""
    return state.hat_velocity[:, 0:3]


@_term(*((f"torso_w{axis}", "rad/s") for axis in "xyz"))
def torso_angular_velocity(state: TaskState) -> "torch.Tensor":
    """Angular velocity of the HAT."""
    return state.hat_velocity[:, 3:6]


@_term(("torso_pitch", "rad"))
def torso_pitch(state: TaskState) -> "torch.Tensor":
    """Forward lean of the HAT: angle of its z axis from the vertical in the sagittal plane."""
    from envs.body.rotation import pitch

    return pitch(state.hat_pose[:, 3:])[:, None]


@_term(("torso_vx", "m/s"), ("torso_vz", "m/s"), ("torso_wy", "rad/s"))
def torso_motion(state: TaskState) -> "torch.Tensor":
    """Velocity of the HAT in the sagittal plane: of its centre of mass along x and z, and angular about y."""
    return state.hat_velocity[:, 0:5:2]


@_term(("torso_yaw", "rad"), ("torso_roll", "rad"), ("torso_upright", "1"))
def torso_orientation(state: TaskState) -> "torch.Tensor":
    """Yaw, roll and the vertical component of the HAT's z axis, 1 when upright."""
    import torch

    from envs.body.rotation import roll, upright, yaw

    attitude = state.hat_pose[:, 3:]
    return torch.stack((yaw(attitude), roll(attitude), upright(attitude)), dim=-1)


@_term(*((f"{joint}_angle", "rad") for joint in JOINTS))
def joint_angle(state: TaskState) -> "torch.Tensor":
    """Joint angles, hip flexion negative, ankle negative when leaning forward."""
    return state.joint_angle


@_term(*((f"{joint}_velocity", "rad/s") for joint in JOINTS))
def joint_velocity(state: TaskState) -> "torch.Tensor":
    """Joint velocities."""
    return state.joint_velocity


@_term(*((f"{kind}_angle_mean", "rad") for kind in KINDS))
def hip_ankle_angle(state: TaskState) -> "torch.Tensor":
    """Mean angle of left and right hip, and of left and right ankle."""
    return 0.5 * (state.joint_angle[:, LEFT] + state.joint_angle[:, RIGHT])


@_term(*((f"{kind}_velocity_mean", "rad/s") for kind in KINDS))
def hip_ankle_velocity(state: TaskState) -> "torch.Tensor":
    """Mean velocity of left and right hip, and of left and right ankle."""
    return 0.5 * (state.joint_velocity[:, LEFT] + state.joint_velocity[:, RIGHT])


@_term(*((f"{joint}_torque_with_spring_and_damper", "Nm") for joint in JOINTS))
def joint_force(state: TaskState) -> "torch.Tensor":
    """Torque about each joint axis by actuator, spring and damper."""
    return state.joint_force


@_term(*((f"{foot}_{axis}", "m") for foot in FEET for axis in "xyz"))
def foot_position(state: TaskState) -> "torch.Tensor":
    """Position of the left, then the right foot frame."""
    return state.foot_pose[..., :3].flatten(1)


@_term(("feet_x_mean", "m"), ("feet_z_mean", "m"))
def feet_place(state: TaskState) -> "torch.Tensor":
    """Mean position of the two foot frames along x and z."""
    return state.foot_pose[..., :3].mean(1)[:, 0::2]


@_term(*((f"{foot}_{kind}{axis}", unit) for foot in FEET for kind, unit in (("f", "N"), ("m", "Nm")) for axis in "xyz"))
def foot_wrench(state: TaskState) -> "torch.Tensor":
    """Force of the ground on each foot and its moment about the foot frame, in world axes, left foot first."""
    import torch

    from envs.body.rotation import rotate

    force = state.sole_force
    lever = rotate(state.foot_pose[:, :, None, 3:], state.sole_position)
    moment = torch.linalg.cross(lever, force).sum(2)
    return torch.cat((force.sum(2), moment), dim=-1).flatten(1)


@_term(("heels_fz", "N"), ("toes_fz", "N"))
def sole_load(state: TaskState) -> "torch.Tensor":
    """Vertical force on the heels, and on the toes, of both feet together."""
    return state.sole_force[..., 2].sum(1)


@_term(("head_x", "m"), ("head_vx", "m/s"))
def head(state: TaskState) -> "torch.Tensor":
    """Head position and velocity along x."""
    import torch

    return torch.stack((state.head_x, state.head_vx), dim=-1)


@_term(*((f"{joint}_last_action", "1") for joint in JOINTS), is_own=True)
def last_action(state: TaskState) -> "torch.Tensor":
    """Torque that was commanded of each joint in the last step over the torque limit."""
    return state.command


@_term(*((f"{kind}_last_action", "1") for kind in KINDS), is_own=True)
def last_command(state: TaskState) -> "torch.Tensor":
    """Torque that was commanded of one hip and of one ankle in the last step over the torque limit."""
    return state.command[:, LEFT]


@_term(("target_x", "m"))
def target(state: TaskState) -> "torch.Tensor":
    """Target position along x."""
    return state.target_x[:, None]


@_term(("target_vx", "m/s"))
def target_velocity(state: TaskState) -> "torch.Tensor":
    """Target velocity along x; the paper's policy does not observe it."""
    return state.target_vx[:, None]


@_term(("target_ax", "m/s2"))
def target_acceleration(state: TaskState) -> "torch.Tensor":
    """Target acceleration along x."""
    return state.target_ax[:, None]


@_term(("target_freq", "Hz"))
def target_frequency(state: TaskState) -> "torch.Tensor":
    """Momentary frequency of the target."""
    return state.target_freq[:, None]


@_term(*((f"target_moved_in_{PAST_STEPS * (i + 1)}_steps", "m") for i in range(PAST)))
def target_history(state: TaskState) -> "torch.Tensor":
    """How far the target has moved along x since each of the earlier times of `TaskState.target_past`."""
    return state.target_x[:, None] - state.target_past


@_term(
    ("hip_k", "Nm/rad"),
    ("ankle_k", "Nm/rad"),
    ("load", "kg"),
    ("joint_damping", "Nm s/rad"),
    ("friction", "1"),
    ("amplitude", "m"),
    ("tolerance", "m"),
    is_own=True,
)
def body(state: TaskState) -> "torch.Tensor":
    """What `env.ranges` may vary: properties of the body, amplitude of the target and tolerance around it."""
    import torch

    own = (state.hip_k, state.ankle_k, state.load, state.joint_damping, state.friction)
    return torch.stack((*own, state.amplitude.to(state.tolerance.dtype), state.tolerance), dim=-1)


@_term(*((f"{kind}_passive_torque", "Nm") for kind in KINDS))
def passive_torque(state: TaskState) -> "torch.Tensor":
    """Torque of spring and damper at one hip and at one ankle, means of left and right. Its sign is that of the action."""
    import torch

    stiffness = torch.stack((state.hip_k, state.ankle_k), dim=-1)
    return -stiffness * hip_ankle_angle(state) - state.joint_damping[:, None] * hip_ankle_velocity(state)


@_term(("target_x_minus_head_x", "m"))
def target_error(state: TaskState) -> "torch.Tensor":
    """Target minus head along x."""
    return (state.target_x - state.head_x)[:, None]
