"""N standers in Newton's SolverMuJoCo (MuJoCo Warp), the full three-dimensional body: the reference.

The tensors are torch views of Newton's arrays, without a copy: writing to them changes the state of the solver.
"""

import math
from collections.abc import Iterable
from typing import Any

import mujoco_warp
import newton
import torch
import warp as wp
from mujoco_warp import OverflowType
from mujoco_warp._src.support import jac_dot_dof  # not part of its public interface; newton pins its version
from mujoco_warp._src.types import vec5
from newton.solvers import SolverMuJoCo

from envs.body.joints import ANKLES, BODIES, FEET, HIPS, JOINTS
from envs.body.load import loaded
from envs.body.model import build_model, geometry
from envs.body.rotation import rotate
from envs.config import ConstraintOverflowError, EnvConfig
from envs.engines.contact_bias import bias_share
from envs.engines.interface import SUBJECT, Simulation, top_speed

_HAT = BODIES.index("hat")
_ROOT_Q, _ROOT_QD = 7, 6
"""Coordinates and velocities of the free root joint ahead of the hinges."""
_DROPPED = int(OverflowType.NEFC | OverflowType.NJMAX_NNZ | OverflowType.BROADPHASE | OverflowType.NARROWPHASE)
"""Those of MuJoCo Warp's flags that report a dropped contact or constraint; the others report an iteration limit."""


@wp.kernel
def _note_dropped(
    overflow: wp.array[wp.int32],
    mask: int,
    num_rows: wp.array[wp.int32],
    num_pairs: wp.array[wp.int32],
    num_contacts: wp.array[wp.int32],
    dropped: wp.array[wp.int32],
    most_rows: wp.array[wp.int32],
    most_contacts: wp.array[wp.int32],
) -> None:
    """Record the drops of a substep and the largest size it needed; the solver clears both at the next substep.

    MuJoCo Warp keeps counting beyond its capacity. Contacts and pairs of geoms are counted over all worlds.
    """
    world = wp.tid()
    dropped[world] = dropped[world] | (overflow[world] & mask)
    most_rows[world] = wp.max(most_rows[world], num_rows[world])
    most_contacts[world] = wp.max(most_contacts[world], wp.max(num_pairs[0], num_contacts[0]))


@wp.kernel
def _add_torques(passive: wp.array2d[float], actuator: wp.array2d[float], first: int, total: wp.array2d[float]) -> None:
    """Torque of actuator, spring and damper about each joint axis."""
    world, joint = wp.tid()
    total[world, joint] = passive[world, first + joint] + actuator[world, first + joint]


@wp.kernel
def _shift_velocity(
    index: int,
    bodies: int,
    pose: wp.array[wp.transform],
    com: wp.array[wp.vec3],
    centre: wp.vec3,
    velocity: wp.array[wp.spatial_vector],
) -> None:
    """From the velocity of the centre of mass of body `index` of each world to that of its point `centre`."""
    body = wp.tid() * bodies + index
    turning = wp.spatial_bottom(velocity[body])
    lever = wp.transform_vector(pose[body], centre - com[body])
    velocity[body] = wp.spatial_vector(wp.spatial_top(velocity[body]) + wp.cross(turning, lever), turning)


@wp.kernel
def _push_body(
    index: int,
    bodies: int,
    push: wp.array[float],
    pose: wp.array[wp.transform],
    com: wp.array[wp.vec3],
    point: wp.vec3,
    wrench: wp.array[wp.spatial_vector],
) -> None:
    """Wrench about the centre of mass of body `index` of each world by a force along x [N] at its point `point`."""
    world = wp.tid()
    body = world * bodies + index
    force = wp.vec3(push[world], 0.0, 0.0)
    lever = wp.transform_vector(pose[body], point - com[body])
    wrench[body] = wp.spatial_vector(force, wp.cross(lever, force))


@wp.kernel
def _sort_sole_forces(
    num_contacts: wp.array[wp.int32],
    contact_world: wp.array[wp.int32],
    contact_geom: wp.array[wp.vec2i],
    contact_position: wp.array[wp.vec3],
    wrench: wp.array[wp.spatial_vector],
    geom_foot: wp.array[wp.int32],
    foot_body: wp.array[wp.int32],
    body_position: wp.array2d[wp.vec3],
    body_rotation: wp.array2d[wp.mat33],
    mid_x: float,
    force: wp.array3d[wp.vec3],
    position: wp.array3d[wp.vec3],
) -> None:
    """Ground-on-sole force of each contact by world, foot, and heel or toe; each has at most one contact."""
    i = wp.tid()
    if i >= num_contacts[0]:
        return
    world = contact_world[i]
    # MuJoCo's force acts on the second geom; the ground is the first, since planes come first by type.
    foot = geom_foot[contact_geom[i][1]]
    body = foot_body[foot]
    # Contacts are those of the pose at the start of the substep, which MuJoCo keeps.
    local = wp.transpose(body_rotation[world, body]) * (contact_position[i] - body_position[world, body])
    end = wp.where(local[0] > mid_x, 1, 0)
    force[world, foot, end] = wp.spatial_top(wrench[i])
    position[world, foot, end] = local


@wp.kernel(module="unique", enable_backward=False)
def _subtract_bias(
    share: float,
    num_dofs: int,
    body_parent: wp.array[int],
    body_root: wp.array[int],
    joint_type: wp.array[int],
    joint_first_dof: wp.array[int],
    dof_body: wp.array[int],
    dof_joint: wp.array[int],
    is_ancestor: wp.array2d[int],
    geom_body: wp.array[int],
    geom_size: wp.array2d[wp.vec3],
    subtree_com: wp.array2d[wp.vec3],
    cdof: wp.array2d[wp.spatial_vector],
    cvel: wp.array2d[wp.spatial_vector],
    cdof_dot: wp.array2d[wp.spatial_vector],
    velocity: wp.array2d[float],
    num_contacts: wp.array[int],
    contact_world: wp.array[int],
    contact_geom: wp.array[wp.vec2i],
    contact_position: wp.array[wp.vec3],
    contact_distance: wp.array[float],
    contact_frame: wp.array[wp.mat33],
    contact_friction: wp.array[vec5],
    contact_row: wp.array2d[int],
    reference: wp.array2d[float],
) -> None:
    """`envs.engines.contact_bias.subtract_bias` for one contact of all worlds."""
    i = wp.tid()
    if i >= num_contacts[0] or contact_row[i, 0] < 0:
        return
    world, geom = contact_world[i], contact_geom[i][1]
    frame = contact_frame[i]
    radius = geom_size[world % geom_size.shape[0], geom][0]
    centre = contact_position[i] + (radius + 0.5 * contact_distance[i]) * frame[0]
    moving, turning = wp.vec3(), wp.vec3()
    for dof in range(num_dofs):
        move_dot, turn_dot = jac_dot_dof(
            body_parent, body_root, joint_type, joint_first_dof, dof_body, dof_joint, is_ancestor,
            subtree_com, cdof, cvel, cdof_dot, centre, geom_body[geom], dof, world,
        )  # fmt: skip
        moving += velocity[world, dof] * move_dot
        turning += velocity[world, dof] * turn_dot
    bias = frame @ (moving - radius * wp.cross(turning, frame[0]))
    for edge in range(4):
        direction = edge // 2
        side = 1.0 - 2.0 * float(edge % 2)
        row = contact_row[i, edge]
        reference[world, row] -= share * (bias[0] + side * contact_friction[i][direction] * bias[1 + direction])


class NewtonMujocoSimulation(Simulation):
    """The `Simulation` of the full body; its tensors are views of the state."""

    def __init__(self, config: EnvConfig, num_worlds: int, device: str) -> None:
        self.config = config
        self.num_worlds = num_worlds
        self.device = torch.device(device)
        self.model = build_model(config, num_worlds, device)
        self.geometry = geometry(self.model)
        self._solver = SolverMuJoCo(
            self.model,
            integrator="euler",
            cone="pyramidal",
            iterations=config.solver.iterations,
            ls_iterations=config.solver.ls_iterations,
            njmax=config.solver.constraint_rows,
            nconmax=config.solver.contacts,
            # Avoids a weld of the root, which is not needed here and would add six rows to every solve.
            kinematic_switchable_roots=False,
        )
        # `check_capacity` reports dropped contacts; the solver need not print them as well.
        self._solver.mjw_model.opt.warn_overflow = 0
        self._state = self.model.state()
        self._control = self.model.control()
        self._data = self._solver.mjw_data
        newton.eval_fk(self.model, self._state.joint_q, self._state.joint_qd, self._state)
        self._make_views()
        self._make_sole_sensor()
        coordinates = (self._joint_q, self._joint_qd, self.body_pose, self.body_velocity)
        self._outputs = (*coordinates, self.joint_force, self.sole_force, self.sole_position)
        self._top_speed = top_speed(config)
        self._trunk = [self._per_world(array)[0, _HAT].clone() for array in self._trunk_arrays()]
        self._load_at: torch.Tensor | None = None
        if config.load_at is not None:
            self._load_at = torch.tensor([config.load_at[0], 0.0, config.load_at[1]], device=self.device)
        # The model has them already, but for the load.
        subject = (torch.full((num_worlds,), getattr(config, name), device=self.device) for name in SUBJECT)
        self.push = torch.zeros(num_worlds, device=self.device)
        self.hip_k, self.ankle_k, self.load, self.joint_damping, self.friction = subject
        if config.load:
            self._apply(["load"])
        self._graph: Any = None
        self.replays_graph = self.device.type == "cuda"
        self._bias_share = bias_share(config, self._solver.mj_model)
        if self._bias_share:
            # MuJoCo Warp calls this between the reference accelerations and the solver.
            self._solver.mjw_model.callback.control = self._subtract_bias

    def step(self, torque: torch.Tensor) -> None:
        """See `Simulation`."""
        before = [output.clone() for output in self._outputs]
        self._launch(torque)
        slow = (self._joint_qd.abs() < self._top_speed).all(-1)
        self.diverged.copy_(~(slow & self._joint_q.isfinite().all(-1)))
        for output, kept in zip(self._outputs, before, strict=True):
            output.copy_(torch.where(self.diverged.view(-1, *[1] * (output.dim() - 1)), kept, output))

    def _launch(self, torque: torch.Tensor) -> None:
        """The control step itself, on a GPU as a graph that the first call captures."""
        self._actuator_torque.copy_(torque)
        if self.device.type == "cpu":
            self._advance()
            return
        stream = wp.stream_from_torch(torch.cuda.current_stream(self.device))
        if self._graph is None:
            # The first step compiles and allocates, which cannot be captured; afterwards the state is restored.
            before = self.state_dict()
            with wp.ScopedStream(stream):
                self._advance()
            self.load_state_dict(before)
            self._actuator_torque.copy_(torque)
            with wp.ScopedCapture(device=str(self.device)) as capture:
                self._advance()
            self._graph = capture.graph
        wp.capture_launch(self._graph, stream=stream)

    def reset(self, mask: torch.Tensor) -> None:
        """See `Simulation`."""
        self._reset_mask[:-1].copy_(mask)
        self._solver.reset(self._state, self._reset_mask_wp)
        newton.eval_fk(self.model, self._state.joint_q, self._state.joint_qd, self._state, mask=self._reset_articulations)
        for sensor in (self.sole_force, self.sole_position, self.joint_force):
            sensor.masked_fill_(mask.view(-1, *[1] * (sensor.dim() - 1)), 0.0)
        self.diverged.masked_fill_(mask, False)

    def check_capacity(self) -> None:
        """See `Simulation`."""
        if not bool(self._dropped.any()):
            return
        # The solver's own capacity, which is at least that of the start pose.
        most = {
            "constraint_rows": (self._data.njmax, int(self._most_rows.max())),
            "contacts": (
                self._data.naconmax // self.num_worlds,
                math.ceil(int(self._most_contacts.max()) / self.num_worlds),
            ),
        }
        short = [f"env.solver.{key} = {has}, needed at least {need}" for key, (has, need) in most.items() if need > has]
        count = int((self._dropped != 0).sum())
        raise ConstraintOverflowError(f"contacts or constraints were dropped in {count} worlds: {'; '.join(short)}")

    def _restore(self, state: dict[str, torch.Tensor]) -> None:
        newton.eval_fk(self.model, self._state.joint_q, self._state.joint_qd, self._state)
        self._write_trunk_velocity()
        # A step in which a world diverged leaves values that are not finite in the solver's warm start.
        self.diverged.copy_(~self._warmstart.isfinite().all(-1))

    def _apply(self, names: Iterable[str]) -> None:
        changed, names = 0, {*names}
        if names & {"hip_k", "ankle_k", "joint_damping"}:
            stiffness = self._per_world(self.model.joint_stiffness)[:, _ROOT_QD:]
            stiffness[:, HIPS] = self.hip_k[:, None]
            stiffness[:, ANKLES] = self.ankle_k[:, None]
            self._per_world(self.model.joint_damping)[:, _ROOT_QD:] = self.joint_damping[:, None]
            changed |= newton.ModelFlags.JOINT_DOF_FORCE_PROPERTIES
        if "friction" in names:
            self._per_world(self.model.shape_material_mu)[:] = self.friction[:, None]
            changed |= newton.ModelFlags.SHAPE_PROPERTIES
        if "load" in names:
            mass, com, inertia = (self._per_world(array)[:, _HAT] for array in self._trunk_arrays())
            mass[:] = self._trunk[0] + self.load
            self._per_world(self.model.body_inv_mass)[:, _HAT] = 1.0 / mass
            if self._load_at is not None:
                own_mass, own_com, own_inertia = self._trunk
                _, centre, inertia[:] = loaded(own_mass, own_com, own_inertia, self.load, self._load_at)
                # The root's velocity is that of the centre of mass, which moves within the HAT.
                lever = rotate(self._joint_q[:, 3:_ROOT_Q], centre - com)
                self._joint_qd[:, :3] += torch.linalg.cross(self._joint_qd[:, 3:_ROOT_QD], lever)
                com[:] = centre
                self._per_world(self.model.body_inv_inertia)[:, _HAT] = torch.linalg.inv_ex(inertia).inverse
            changed |= newton.ModelFlags.BODY_INERTIAL_PROPERTIES
        self._solver.notify_model_changed(changed)

    def _advance(self) -> None:
        dt = self.config.control_dt / self.config.solver.substeps
        # Some of MuJoCo Warp's functions launch on the default device, which need not be the model's.
        with wp.ScopedDevice(self.model.device):
            wp.launch(
                _push_body,
                dim=self.num_worlds,
                inputs=[
                    _HAT,
                    len(BODIES),
                    wp.from_torch(self.push),
                    self._state.body_q,
                    self.model.body_com,
                    wp.vec3(*self.geometry.hat_com),
                ],
                outputs=[self._state.body_f],
            )
            for _ in range(self.config.solver.substeps):
                self._solver.step(self._state, self._state, self._control, None, dt)
                wp.launch(
                    _note_dropped,
                    dim=self.num_worlds,
                    inputs=[self._data.overflow, _DROPPED, self._data.nefc, self._data.ncollision, self._data.nacon],
                    outputs=[self._dropped_wp, self._most_rows_wp, self._most_contacts_wp],
                )
            self._read_sensors()
            self._write_trunk_velocity()

    def _write_trunk_velocity(self) -> None:
        """Newton's velocity is that of the centre of mass with the load; see `Simulation.body_velocity`."""
        if self._load_at is None:
            return
        state, model = self._state, self.model
        wp.launch(
            _shift_velocity,
            dim=self.num_worlds,
            inputs=[_HAT, len(BODIES), state.body_q, model.body_com, wp.vec3(*self.geometry.hat_com)],
            outputs=[state.body_qd],
            device=model.device,
        )

    def _subtract_bias(self, model: mujoco_warp.Model, data: mujoco_warp.Data) -> None:
        """Subtract the bias acceleration from the reference acceleration of all contacts."""
        contact = data.contact
        wp.launch(
            _subtract_bias,
            dim=data.naconmax,
            inputs=[
                self._bias_share,
                model.nv,
                model.body_parentid,
                model.body_rootid,
                model.jnt_type,
                model.jnt_dofadr,
                model.dof_bodyid,
                model.dof_jntid,
                model.body_isdofancestor,
                model.geom_bodyid,
                model.geom_size,
                data.subtree_com,
                data.cdof,
                data.cvel,
                data.cdof_dot,
                data.qvel,
                data.nacon,
                contact.worldid,
                contact.geom,
                contact.pos,
                contact.dist,
                contact.frame,
                contact.friction,
                contact.efc_address,
            ],
            outputs=[data.efc.aref],
            device=self.model.device,
        )

    def _read_sensors(self) -> None:
        self._sole_force_wp.zero_()
        self._sole_position_wp.zero_()
        mujoco_warp.contact_force(self._solver.mjw_model, self._data, self._contact_ids, True, self._contact_wrench)
        wp.launch(
            _sort_sole_forces,
            dim=self._data.naconmax,
            inputs=[
                self._data.nacon,
                self._data.contact.worldid,
                self._data.contact.geom,
                self._data.contact.pos,
                self._contact_wrench,
                self._geom_foot,
                self._foot_body,
                self._data.xpos,
                self._data.xmat,
                self._mid_x,
            ],
            outputs=[self._sole_force_wp, self._sole_position_wp],
            device=self.model.device,
        )
        wp.launch(
            _add_torques,
            dim=(self.num_worlds, len(JOINTS)),
            inputs=[self._data.qfrc_passive, self._joint_f, _ROOT_QD],
            outputs=[self._joint_force_wp],
            device=self.model.device,
        )

    def _trunk_arrays(self) -> tuple[wp.array, wp.array, wp.array]:
        return self.model.body_mass, self.model.body_com, self.model.body_inertia

    def _per_world(self, array: wp.array) -> torch.Tensor:
        tensor = wp.to_torch(array)
        return tensor.view(self.num_worlds, -1, *tensor.shape[1:])

    def _make_views(self) -> None:
        q = self._per_world(self._state.joint_q)
        qd = self._per_world(self._state.joint_qd)
        self._joint_q, self._joint_qd = q, qd
        self.joint_angle, self.joint_velocity = q[:, _ROOT_Q:], qd[:, _ROOT_QD:]
        self.body_pose = self._per_world(self._state.body_q)
        self.body_velocity = self._per_world(self._state.body_qd)
        self._joint_f = self._control.joint_f.reshape((self.num_worlds, _ROOT_QD + len(JOINTS)))
        self._actuator_torque = wp.to_torch(self._joint_f)[:, _ROOT_QD:]
        self._warmstart = wp.to_torch(self._data.qacc_warmstart)
        self._dropped_wp = wp.zeros(self.num_worlds, dtype=wp.int32, device=self.model.device)
        self._dropped = wp.to_torch(self._dropped_wp)
        self._most_rows_wp, self._most_contacts_wp = wp.zeros_like(self._dropped_wp), wp.zeros_like(self._dropped_wp)
        self._most_rows, self._most_contacts = wp.to_torch(self._most_rows_wp), wp.to_torch(self._most_contacts_wp)
        self.diverged = torch.zeros(self.num_worlds, dtype=torch.bool, device=self.device)
        self._joint_force_wp = wp.zeros((self.num_worlds, len(JOINTS)), dtype=float, device=self.model.device)
        self.joint_force = wp.to_torch(self._joint_force_wp)
        # Newton's mask has one more element than there are worlds, for bodies that belong to no world.
        self._reset_mask = torch.zeros(self.num_worlds + 1, dtype=torch.bool, device=self.device)
        self._reset_mask_wp = wp.from_torch(self._reset_mask, dtype=wp.bool)
        self._reset_articulations = self._reset_mask_wp[: self.num_worlds]

    def _make_sole_sensor(self) -> None:
        device = self.model.device
        shape = (self.num_worlds, len(FEET), 2)
        self._sole_force_wp = wp.zeros(shape, dtype=wp.vec3, device=device)
        self._sole_position_wp = wp.zeros(shape, dtype=wp.vec3, device=device)
        self.sole_force = wp.to_torch(self._sole_force_wp)
        self.sole_position = wp.to_torch(self._sole_position_wp)
        self._contact_wrench = wp.zeros(self._data.naconmax, dtype=wp.spatial_vector, device=device)
        self._contact_ids = wp.array(range(self._data.naconmax), dtype=wp.int32, device=device)
        geom_foot = []
        labels = self.model.shape_label
        for shape_index in self._solver.mjc_geom_to_newton_shape.numpy()[0]:
            name = labels[shape_index].rsplit("/", 1)[-1]
            foot = name.replace("sole", "foot")
            geom_foot.append(FEET.index(foot) if name.startswith("sole") else -1)
        self._geom_foot = wp.array(geom_foot, dtype=wp.int32, device=device)
        # The world is MuJoCo's first body.
        self._foot_body = wp.array([1 + BODIES.index(foot) for foot in FEET], dtype=wp.int32, device=device)
        self._mid_x = 0.5 * (self.geometry.heel_x + self.geometry.toe_x)

    def _saved(self) -> dict[str, torch.Tensor]:
        return super()._saved() | {"joint_q": self._joint_q, "joint_qd": self._joint_qd, "warmstart": self._warmstart}
