"""N standers in the sagittal plane: the fused kernel of envs/engines/sagittal_kernel.py behind the interface of
`Simulation`."""

import math
from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np
import torch
import warp as wp
from newton.solvers import SolverMuJoCo

from envs.body.joints import ANKLE, BODIES, FEET, HIP, JOINTS
from envs.body.load import TrunkOfModel
from envs.body.model import build_model, geometry
from envs.body.segments import Segments, segments
from envs.config import EnvConfig
from envs.engines.contact_bias import bias_share, sole_contact, stiffness_and_damping
from envs.engines.interface import SUBJECT, Simulation, top_speed
from envs.engines.launch import Launch
from envs.engines.sagittal_contact import Softness, vec5
from envs.engines.sagittal_kernel import Body, Worlds, advance, reset, write_all_outputs

_TYPES = {
    **dict.fromkeys(("_q", "_qd", "_qdd"), vec5),
    "diverged": wp.bool,
    **dict.fromkeys(("joint_angle", "joint_velocity", "joint_force"), wp.float32),
    "body_pose": wp.transform,
    "body_velocity": wp.spatial_vector,
    **dict.fromkeys(("sole_force", "sole_position"), wp.vec3),
}
"""Warp's types of the tensors that a step changes."""


class SagittalSimulation(Simulation):
    """The `Simulation` of the planar body. It applies the sum of the left and the right torque."""

    def __init__(self, config: EnvConfig, num_worlds: int, device: str) -> None:
        self.config = config
        self.num_worlds = num_worlds
        self.device = torch.device(device)
        model = build_model(config, 1, "cpu")
        self.geometry = geometry(model)
        # MuJoCo's compiled model, for the softness of contacts and for the inverse weights that it derives from the masses.
        self._mujoco = SolverMuJoCo(model).mj_model
        self._trunk = TrunkOfModel(self._mujoco, config)
        body = segments(model)
        self._body = _constants(body, config, self._mujoco)
        start_x, _, start_z = model.joint_q.numpy()[:3].tolist()
        self._start = vec5(start_x, start_z, 0.0, 0.0, 0.0)
        self._allocate()
        self.set_subject(**{name: torch.full((num_worlds,), getattr(config, name), device=self.device) for name in SUBJECT})
        self._record_launches()
        self.reset(torch.ones_like(self.diverged))

    def step(self, torque: torch.Tensor) -> None:
        """See `Simulation`."""
        self._torque.copy_(torque)
        self._advance()

    def reset(self, mask: torch.Tensor) -> None:
        """See `Simulation`."""
        self._reset_mask.copy_(mask)
        self._reset()

    def check_capacity(self) -> None:
        """The kernel has room for every possible contact, so nothing is dropped."""

    def _allocate(self) -> None:
        n, device = self.num_worlds, self.device

        def zeros(*shape: int, dtype: torch.dtype = torch.float32) -> torch.Tensor:
            return torch.zeros(n, *shape, dtype=dtype, device=device)

        self._q, self._qd, self._qdd = zeros(5), zeros(5), zeros(5)
        self._torque = zeros(len(JOINTS))
        self._inv_weight = zeros(3)
        self._weights_of_loads: torch.Tensor | None = None
        self.hip_k, self.ankle_k, self.load, self.joint_damping, self.friction = (zeros() for _ in SUBJECT)
        self.push = zeros()
        self.diverged = zeros(dtype=torch.bool)
        self.joint_angle, self.joint_velocity, self.joint_force = (zeros(len(JOINTS)) for _ in range(3))
        self.body_pose, self.body_velocity = zeros(len(BODIES), 7), zeros(len(BODIES), 6)
        self.sole_force, self.sole_position = zeros(len(FEET), 2, 3), zeros(len(FEET), 2, 3)
        self._reset_mask = zeros(dtype=torch.bool)

    def _record_launches(self) -> None:
        config, n, device = self.config, self.num_worlds, self.device
        worlds = Worlds()
        for name, dtype in _TYPES.items():
            setattr(worlds, name.removeprefix("_"), wp.from_torch(getattr(self, name), dtype=dtype))
        step = [
            config.solver.substeps,
            config.control_dt / config.solver.substeps,
            config.solver.iterations,
            top_speed(config),
            self._body,
            wp.from_torch(self._torque),
            *(wp.from_torch(getattr(self, name)) for name in (*SUBJECT, "push")),
            wp.from_torch(self._inv_weight, dtype=wp.vec3),
        ]
        self._advance = Launch(advance, n, step, [worlds], device)
        self._reset = Launch(reset, n, [self._body, self._start, wp.from_torch(self._reset_mask)], [worlds], device)
        self._write_outputs = Launch(write_all_outputs, n, [self._body], [worlds], device)

    def _inv_weights(self, load: float) -> list[float]:
        """MuJoCo's body_invweight0 of a foot [1/kg], dof_invweight0 of hip and ankle [1/(kg m2)], with `load` [kg].

        The scale of a constraint's softness; MuJoCo derives it from the mass matrix of the upright body.
        """
        model = self._mujoco
        foot = _last_named(model.body, model.nbody, "foot_left")
        self._trunk.carry(load)
        mujoco.mj_setConst(model, mujoco.MjData(model))
        first = model.nv - len(JOINTS)
        dofs = model.dof_invweight0[[first + HIP, first + ANKLE]]
        return [float(model.body_invweight0[foot, 0]), *map(float, dofs)]

    def _apply(self, names: Iterable[str]) -> None:
        if "load" in names:  # the kernel reads the others
            loads, which = torch.unique(self.load, return_inverse=True)
            weights = torch.tensor([self._inv_weights(mass) for mass in loads.tolist()], device=self.device)
            self._inv_weight.copy_(weights[which])

    def apply_drawn(self, names: Iterable[str]) -> None:
        """See `Simulation`. Inverse weights of drawn loads are interpolated between loads 50 g apart."""
        if "load" in names and self.config.ranges.load is not None:
            low, high = self.config.ranges.load
            if self._weights_of_loads is None:
                count = 2 + math.ceil((high - low) / 0.05)
                table = [self._inv_weights(mass) for mass in np.linspace(low, high, count)]
                self._weights_of_loads = torch.tensor(table, device=self.device)
            place = (self.load - low) / max(high - low, 1e-6) * (len(self._weights_of_loads) - 1)
            before = place.long().clamp(0, len(self._weights_of_loads) - 2)
            share = (place - before)[:, None]
            torch.lerp(self._weights_of_loads[before], self._weights_of_loads[before + 1], share, out=self._inv_weight)

    def _restore(self, state: dict[str, torch.Tensor]) -> None:
        self._write_outputs()

    def _saved(self) -> dict[str, torch.Tensor]:
        return super()._saved() | {"q": self._q, "qd": self._qd, "qdd": self._qdd, "diverged": self.diverged}


def _last_named(named: Any, count: int, name: str) -> int:
    """Index of the body of MuJoCo's model whose label ends in `name`."""
    return next(i for i in range(count) if named(i).name.endswith(f"_{name}"))


def _constants(body: Segments, config: EnvConfig, model: mujoco.MjModel) -> Any:
    """The kernel's `Body`: all constants that are the same in every world."""
    step = config.control_dt / config.solver.substeps
    result = Body()
    masses = ("hat_mass", "leg_mass", "foot_mass", "hat_inertia", "leg_inertia", "foot_inertia")
    for name in (*masses, "sole_radius", "gravity"):
        setattr(result, name, getattr(body, name))
    points = {
        "hat_com": body.hat_com - body.hat_frame,
        "load": body.hat_com - body.hat_frame if config.load_at is None else np.array(config.load_at),
        "hip": -body.hat_frame,
        "ankle": -body.hip,
        "leg_com": body.leg_com - body.hip,
        "leg_frame": body.leg_frame - body.hip,
        "foot_com": body.foot_com,
        "foot_frame": body.foot_frame,
        "heel": body.heel,
        "toe": body.toe,
        "half_width": body.half_width,
    }
    first = model.njnt - len(JOINTS)
    hip, ankle = first + HIP, first + ANKLE
    points["lower"], points["upper"] = model.jnt_range[[hip, ankle]].T
    for name, point in points.items():
        setattr(result, name, wp.vec2(*map(float, point)))
    result.joint_armature = config.joint_armature

    solref, solimp, _ = sole_contact(model)
    result.contact = _softness(solref, solimp, step)
    result.contact_bias = bias_share(config, model)
    result.limit = _softness(model.jnt_solref[hip], model.jnt_solimp[hip], step)
    return result


def _softness(solref: np.ndarray, solimp: np.ndarray, step: float) -> Any:
    """MuJoCo's K and B from solref [time constant, damping ratio], or [-K, -B], and its solimp, at time step `step` [s]."""
    result = Softness()
    result.low, result.high, result.width, result.midpoint, result.power = map(float, solimp)
    result.stiffness, result.damping = stiffness_and_damping(solref, solimp, step)
    return result
