"""The interface of the physics engines."""

import math
from collections.abc import Iterable
from typing import Protocol

import torch

from envs.body.model import Geometry
from envs.config import EnvConfig

SUBJECT = ("hip_k", "ankle_k", "load", "joint_damping", "friction")
"""Properties that may differ between worlds, by their keys in the configuration."""


class Simulation(Protocol):
    """N worlds advanced by whole control steps under joint torques; reset, stiffness and load world by world.

    Attributes (torch tensors on `device`, refreshed in place by every step; N worlds, joints in the order of
    `envs.body.joints.JOINTS`):
        joint_angle, joint_velocity: (N, 4) [rad], [rad/s].
        joint_force: (N, 4) torque about each joint axis by actuator, spring and damper over the last substep [Nm].
        body_pose: (N, 5, 7) frame of each body in `envs.body.joints.BODIES`: position [m], quaternion x y z w.
        body_velocity: (N, 5, 6) linear velocity of the body's centre of mass [m/s], of the HAT's without its load, and
            angular velocity [rad/s], both in the world frame.
        sole_force: (N, 2, 2, 3) force of the ground on left and right foot at heel and toe, world frame [N], as of the
            last substep; zero after a reset, before the first step.
        sole_position: (N, 2, 2, 3) where it acts, in the foot frame [m]; without meaning where there is no force.
        hip_k, ankle_k [Nm/rad per joint], load [kg], joint_damping [Nm s/rad per joint], friction [-]: (N,).
        push: (N,) horizontal force on the centre of mass of the HAT without its load [N], forward positive; to be written,
            and constant until it is.
        diverged: (N,) bool, worlds whose last step did not lead to finite values below `top_speed`; they need a reset. The
            tensors above then still hold the values before that step, so they are finite.
    geometry: `envs.body.model.Geometry` of the stander.
    replays_graph: whether a step launches a CUDA graph of its own, which cannot be part of another one.
    """

    config: EnvConfig
    num_worlds: int
    device: torch.device
    geometry: Geometry
    replays_graph: bool = False
    joint_angle: torch.Tensor
    joint_velocity: torch.Tensor
    joint_force: torch.Tensor
    body_pose: torch.Tensor
    body_velocity: torch.Tensor
    sole_force: torch.Tensor
    sole_position: torch.Tensor
    hip_k: torch.Tensor
    ankle_k: torch.Tensor
    load: torch.Tensor
    joint_damping: torch.Tensor
    friction: torch.Tensor
    push: torch.Tensor
    diverged: torch.Tensor

    def step(self, torque: torch.Tensor) -> None:
        """Advance every world by one control step under constant actuator torques, shape (N, 4) [Nm]."""

    def reset(self, mask: torch.Tensor) -> None:
        """Put the worlds of `mask` (N,) bool upright and at rest, as they were when the model was built.

        Also clears the solver's own state: a world that had diverged recovers, and moves bit for bit like a
        new one.
        """

    def set_subject(self, **changes: torch.Tensor) -> None:
        """Give each world its own values of some of `SUBJECT`, (N,).

        The load is a point mass on the HAT, at its centre of mass or at `EnvConfig.load_at`.
        """
        for name, value in changes.items():
            if value.shape != (self.num_worlds,) or not bool((value >= 0).all()) or not bool(value.isfinite().all()):
                raise ValueError(f"{name}: expected {self.num_worlds} finite values of at least 0, one per world")
        for name, value in changes.items():
            getattr(self, name).copy_(value)
        self._apply(changes)

    def apply_drawn(self, names: Iterable[str]) -> None:
        """Take over values of `SUBJECT` that were written into their tensors on the device, without waiting for it."""
        self._apply(names)

    def check_capacity(self) -> None:
        """Raise `ConstraintOverflowError`, which states the size needed, if contacts or constraint rows were dropped in any
        step so far."""

    def state_dict(self) -> dict[str, torch.Tensor]:
        """A copy of everything that the next step depends on, warm start and sensor readings included."""
        return {name: tensor.clone() for name, tensor in self._saved().items()}

    def load_state_dict(self, state: dict[str, torch.Tensor]) -> None:
        """Restore the state of a `state_dict` exactly."""
        # Earlier versions saved neither damping nor friction, which were the same in all worlds.
        self.set_subject(**{name: state[name] for name in SUBJECT if name in state})
        for name, tensor in self._saved().items():
            if name not in SUBJECT:
                tensor.copy_(state[name])
        self._restore(state)

    def _apply(self, names: Iterable[str]) -> None:
        """Write the values of these of `SUBJECT` to the model."""

    def _saved(self) -> dict[str, torch.Tensor]:
        """The tensors that `state_dict` copies; each engine adds its own."""
        return {name: getattr(self, name) for name in ("joint_force", "sole_force", "sole_position", *SUBJECT)}

    def _restore(self, state: dict[str, torch.Tensor]) -> None:
        """Recompute everything derived from the saved tensors after they were restored."""


def top_speed(config: EnvConfig) -> float:
    """The speed [m/s], [rad/s] of body or joint at which a world has diverged: half a turn in one physics step.

    Beyond it the direction of a rotation cannot be determined from one step to the next. The same number bounds metres per
    second: it is the speed of a point one metre, about a segment's length, from the axis.
    """
    return math.pi * config.solver.substeps / config.control_dt
