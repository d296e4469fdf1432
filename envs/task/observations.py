"""What the policy may sense, one function a term: the environment in, (N, size) out.

`env.observations` names groups and the terms that each joins, in order; `agent.obs_groups` says which of them actor and
critic see. Values are in SI units, in the world frame unless said otherwise: the policy normalises what it sees by its own
running statistics.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import torch

from envs.body.rotation import pitch, roll, rotate, upright, yaw

if TYPE_CHECKING:
    from envs.task.head_tracking import HeadTrackingEnv


def torso_height(env: "HeadTrackingEnv") -> torch.Tensor:
    """Height of the torso frame [m]. (N, 1)."""
    return env.hat_pose[:, 2:3]


def torso_velocity(env: "HeadTrackingEnv") -> torch.Tensor:
    """Linear velocity of the HAT's centre of mass [m/s]. (N, 3)."""
    return env.hat_velocity[:, 0:3]


def torso_angular_velocity(env: "HeadTrackingEnv") -> torch.Tensor:
    """Angular velocity of the HAT [rad/s]. (N, 3)."""
    return env.hat_velocity[:, 3:6]


def torso_pitch(env: "HeadTrackingEnv") -> torch.Tensor:
    """Forward lean of the HAT [rad], the angle of its own z axis from the vertical in the sagittal plane. (N, 1)."""
    return pitch(env.hat_pose[:, 3:])[:, None]


def torso_motion(env: "HeadTrackingEnv") -> torch.Tensor:
    """Velocity of the HAT's centre of mass along x and z [m/s], angular velocity about y [rad/s]. (N, 3)."""
    return env.hat_velocity[:, (0, 2, 4)]


def torso_orientation(env: "HeadTrackingEnv") -> torch.Tensor:
    """Yaw [rad], roll [rad] and the vertical component of the HAT's own z axis (1 when upright). (N, 3)."""
    attitude = env.hat_pose[:, 3:]
    return torch.stack((yaw(attitude), roll(attitude), upright(attitude)), dim=-1)


def joint_angle(env: "HeadTrackingEnv") -> torch.Tensor:
    """Joint angles [rad], hip flexion negative, ankle negative when leaning forward. (N, 4)."""
    return env.sim.joint_angle


def joint_velocity(env: "HeadTrackingEnv") -> torch.Tensor:
    """Joint velocities [rad/s]. (N, 4)."""
    return env.sim.joint_velocity


def hip_ankle_angle(env: "HeadTrackingEnv") -> torch.Tensor:
    """Mean of left and right hip, and of left and right ankle [rad]. (N, 2)."""
    return 0.5 * (env.sim.joint_angle[:, :2] + env.sim.joint_angle[:, 2:])


def hip_ankle_velocity(env: "HeadTrackingEnv") -> torch.Tensor:
    """Mean of left and right hip velocity, and of left and right ankle velocity [rad/s]. (N, 2)."""
    return 0.5 * (env.sim.joint_velocity[:, :2] + env.sim.joint_velocity[:, 2:])


def joint_force(env: "HeadTrackingEnv") -> torch.Tensor:
    """Torque about each joint axis by actuator, spring and damper [Nm]. (N, 4)."""
    return env.sim.joint_force


def foot_position(env: "HeadTrackingEnv") -> torch.Tensor:
    """Position of the left, then the right foot frame [m]. (N, 6)."""
    return env.foot_position.flatten(1)


def feet_place(env: "HeadTrackingEnv") -> torch.Tensor:
    """Mean of the feet's frames along x and z [m]. (N, 2)."""
    return env.foot_position.mean(1)[:, 0::2]


def sole_load(env: "HeadTrackingEnv") -> torch.Tensor:
    """Vertical force on the heels, and on the toes, of both feet together [N]. (N, 2)."""
    return env.sim.sole_force[..., 2].sum(1)


def foot_wrench(env: "HeadTrackingEnv") -> torch.Tensor:
    """Force of the ground on each foot [N] (world frame) and its moment about the foot frame [Nm] (world axes), left foot
    first. (N, 12)."""
    force = env.sim.sole_force
    foot = env.sim.body_pose[:, env.FOOT_BODIES, 3:]
    lever = rotate(foot[:, :, None, :], env.sim.sole_position)
    moment = torch.linalg.cross(lever, force).sum(2)
    return torch.cat((force.sum(2), moment), dim=-1).flatten(1)


def head(env: "HeadTrackingEnv") -> torch.Tensor:
    """Head position [m] and velocity [m/s] along x. (N, 2)."""
    return torch.stack((env.head_x, env.head_vx), dim=-1)


def last_action(env: "HeadTrackingEnv") -> torch.Tensor:
    """The normalised torque of each joint in the step just made. (N, 4)."""
    return env.action


def last_command(env: "HeadTrackingEnv") -> torch.Tensor:
    """The normalised torque of hip and ankle in the step just made. (N, 2)."""
    return env.action[:, :2]


def target(env: "HeadTrackingEnv") -> torch.Tensor:
    """Target position along x [m]. (N, 1)."""
    return env.target_x[:, None]


def target_velocity(env: "HeadTrackingEnv") -> torch.Tensor:
    """Target velocity along x [m/s]; not sensed in the paper. (N, 1)."""
    return env.target_vx[:, None]


def target_error(env: "HeadTrackingEnv") -> torch.Tensor:
    """Target minus head along x [m]. (N, 1)."""
    return (env.target_x - env.head_x)[:, None]


TERMS: dict[str, Callable[["HeadTrackingEnv"], torch.Tensor]] = {
    function.__name__: function
    for function in (
        torso_height,
        torso_velocity,
        torso_angular_velocity,
        torso_pitch,
        torso_motion,
        torso_orientation,
        joint_angle,
        joint_velocity,
        hip_ankle_angle,
        hip_ankle_velocity,
        joint_force,
        foot_position,
        feet_place,
        foot_wrench,
        sole_load,
        head,
        last_action,
        last_command,
        target,
        target_velocity,
        target_error,
    )
}
