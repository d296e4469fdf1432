"""N standers in MuJoCo's own C solver, in double precision, the full three-dimensional body: to evaluate policies in.

It reads the MJCF of the body without Newton. Worlds are stepped one after the other on the CPU, so it is for tens of
worlds, not for training. The tensors are in single precision; the state is kept and saved in double.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import mujoco
import numpy as np
import torch

from envs.body.joints import ANKLES, BODIES, FEET, HIPS, JOINTS
from envs.body.load import TrunkOfModel
from envs.body.mjcf import mjcf
from envs.body.model import build_model, geometry
from envs.config import ConstraintOverflowError, EnvConfig
from envs.engines.contact_bias import bias_share, subtract_bias
from envs.engines.interface import SUBJECT, Simulation, top_speed

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
"""Everything that mj_step depends on, qacc_warmstart included."""
_BAD = [int(getattr(mujoco.mjtWarning, f"mjWARN_BAD{name}")) for name in ("QPOS", "QVEL", "QACC")]
_HAT = BODIES.index("hat")
_FULL = [int(getattr(mujoco.mjtWarning, f"mjWARN_{name}FULL")) for name in ("CONTACT", "CNSTR")]


def build(config: EnvConfig) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The body with the physical parameters and the solver's limits of `config`."""
    model = mujoco.MjModel.from_xml_string(mjcf(config.body))
    model.opt.timestep = config.control_dt / config.solver.substeps
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    model.opt.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    model.opt.iterations, model.opt.ls_iterations = config.solver.iterations, config.solver.ls_iterations
    hinges = [model.joint(name).id for name in JOINTS]
    model.jnt_stiffness[hinges] = 2 * [config.hip_k, config.ankle_k]
    dofs = model.jnt_dofadr[hinges]
    model.dof_damping[dofs], model.dof_armature[dofs] = config.joint_damping, config.joint_armature
    model.geom_friction[:, 0] = config.friction
    TrunkOfModel(model, config).carry(config.load)
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)  # the softness of contacts depends on mass and armature
    return model, data


class MujocoCSimulation(Simulation):
    """The `Simulation` of the full body in MuJoCo's C solver; every world has its own model."""

    def __init__(self, config: EnvConfig, num_worlds: int, device: str) -> None:
        if device != "cpu":
            raise ValueError(f"device: env.physics=mujoco_c computes only on the cpu, not on '{device}'")
        self.config = config
        self.num_worlds = num_worlds
        self.device = torch.device(device)
        self.geometry = geometry(build_model(config, 1, device))
        unloaded = config.model_copy(update={"load": 0.0})
        made = [build(unloaded) for _ in range(num_worlds)]
        self._models, self._data = [model for model, _ in made], [data for _, data in made]
        self._trunks = [TrunkOfModel(model, config) for model in self._models]
        self._top_speed = top_speed(config)
        self._bias_share = bias_share(config, self._models[0])
        self._find_indices()
        self._allocate()
        for name in SUBJECT:
            getattr(self, name).fill_(getattr(config, name))
        self._apply(["load"])  # the models have the others
        self.reset(torch.ones(num_worlds, dtype=torch.bool))

    def step(self, torque: torch.Tensor) -> None:
        """See `Simulation`."""
        torques = torque.detach().double().numpy()
        before = np.zeros(self._state_size)
        with _silent():
            for world, (model, data) in enumerate(zip(self._models, self._data, strict=True)):
                mujoco.mj_getState(model, data, before, _STATE)
                data.qfrc_applied[self._dofs] = torques[world]
                self._push(world)
                for _ in range(self.config.solver.substeps):
                    mujoco.mj_step1(model, data)
                    if self._bias_share:
                        subtract_bias(model, data, self._bias_share)
                    mujoco.mj_step2(model, data)
                warned = data.warning.number
                self._dropped[world] |= bool(warned[_FULL].any())
                # MuJoCo warns of values that are not finite or above 1e10.
                self.diverged[world] = bool(warned[_BAD].any() or not np.abs(data.qvel).max() < self._top_speed)
                if self.diverged[world]:
                    # MuJoCo may have reset the world by itself: restore the state before the step.
                    mujoco.mj_resetData(model, data)
                    mujoco.mj_setState(model, data, before, _STATE)
                    continue
                self._read_sensors(world)
                self._write_outputs(world)
        self._write_velocities()

    def reset(self, mask: torch.Tensor) -> None:
        """See `Simulation`."""
        for world in mask.nonzero().flatten().tolist():
            mujoco.mj_resetData(self._models[world], self._data[world])
            self._write_outputs(world)
        for sensor in (self.sole_force, self.sole_position, self.joint_force):
            sensor[mask] = 0.0
        self.diverged[mask] = False
        self._write_velocities()

    def check_capacity(self) -> None:
        """See `Simulation`."""
        if bool(self._dropped.any()):
            raise ConstraintOverflowError(f"MuJoCo had no memory for all contacts in {int(self._dropped.sum())} worlds")

    def state_dict(self) -> dict[str, torch.Tensor]:
        """See `Simulation`."""
        for model, data, row in zip(self._models, self._data, self._state.numpy(), strict=True):
            mujoco.mj_getState(model, data, row, _STATE)
        return super().state_dict()

    def _restore(self, state: dict[str, torch.Tensor]) -> None:
        for world, row in enumerate(self._state.numpy()):
            mujoco.mj_resetData(self._models[world], self._data[world])  # clears its warnings
            mujoco.mj_setState(self._models[world], self._data[world], row, _STATE)
            self._write_outputs(world)
        self._write_velocities()

    def _apply(self, names: Iterable[str]) -> None:
        for world, model in enumerate(self._models):
            if "hip_k" in names:
                model.jnt_stiffness[self._hinges[HIPS]] = float(self.hip_k[world])
            if "ankle_k" in names:
                model.jnt_stiffness[self._hinges[ANKLES]] = float(self.ankle_k[world])
            if "joint_damping" in names:
                model.dof_damping[self._dofs] = float(self.joint_damping[world])
            if "friction" in names:
                model.geom_friction[:, 0] = float(self.friction[world])
            if "load" in names:
                self._trunks[world].carry(float(self.load[world]))
                mujoco.mj_setConst(model, self._scratch)  # the softness of contacts depends on mass

    def _find_indices(self) -> None:
        """Indices of joints, bodies and soles in MuJoCo's arrays, the same in every world."""
        model = self._models[0]
        self._hinges = np.array([model.joint(name).id for name in JOINTS])
        self._angles, self._dofs = model.jnt_qposadr[self._hinges], model.jnt_dofadr[self._hinges]
        self._bodies = np.array([model.body(name).id for name in BODIES])
        self._sole_foot = {model.geom(foot.replace("foot", "sole")).id: place for place, foot in enumerate(FEET)}
        self._foot_bodies = [model.body(foot).id for foot in FEET]
        self._mid_x = 0.5 * (self.geometry.heel_x + self.geometry.toe_x)
        self._scratch = mujoco.MjData(model)
        self._state_size = mujoco.mj_stateSize(model, _STATE)

    def _allocate(self) -> None:
        n = self.num_worlds
        self.joint_angle, self.joint_velocity, self.joint_force = (torch.zeros(n, len(JOINTS)) for _ in range(3))
        self.body_pose, self.body_velocity = torch.zeros(n, len(BODIES), 7), torch.zeros(n, len(BODIES), 6)
        self.sole_force, self.sole_position = torch.zeros(n, len(FEET), 2, 3), torch.zeros(n, len(FEET), 2, 3)
        self.hip_k, self.ankle_k, self.load, self.joint_damping, self.friction = (torch.zeros(n) for _ in SUBJECT)
        self.push = torch.zeros(n)
        self.diverged, self._dropped = torch.zeros(n, dtype=torch.bool), torch.zeros(n, dtype=torch.bool)
        self._state = torch.zeros(n, self._state_size, dtype=torch.float64)
        self._spatial_velocity, self._lever = np.zeros((n, len(BODIES), 6)), np.zeros((n, len(BODIES), 3))

    def _push(self, world: int) -> None:
        """Apply `push` to the HAT. MuJoCo's force acts on its centre of mass with the load, so a torque goes with it."""
        data, hat = self._data[world], self._bodies[_HAT]
        force = np.array([float(self.push[world]), 0.0, 0.0])
        point = data.xpos[hat] + data.xmat[hat].reshape(3, 3) @ self.geometry.hat_com
        data.xfrc_applied[hat] = [*force, *np.cross(point - data.xipos[hat], force)]

    def _read_sensors(self, world: int) -> None:
        """Forces of the last substep; before `_write_outputs`, while positions are still those of its start."""
        model, data = self._models[world], self._data[world]
        self.joint_force.numpy()[world] = (data.qfrc_passive + data.qfrc_applied)[self._dofs]
        force, position = self.sole_force.numpy()[world], self.sole_position.numpy()[world]
        force[:], position[:] = 0.0, 0.0
        wrench = np.zeros(6)
        contact = data.contact
        for i, (geoms, place, frame) in enumerate(zip(contact.geom, contact.pos, contact.frame, strict=True)):
            mujoco.mj_contactForce(model, data, i, wrench)
            # MuJoCo's force acts on the second geom; the ground is the first, since planes come first by type.
            foot = self._sole_foot[int(geoms[1])]
            body = self._foot_bodies[foot]
            local = (place - data.xpos[body]) @ data.xmat[body].reshape(3, 3)
            end = int(local[0] > self._mid_x)
            force[foot, end] = wrench[:3] @ frame.reshape(3, 3)
            position[foot, end] = local

    def _write_outputs(self, world: int) -> None:
        """Set the tensors of joints and bodies from the coordinates: mj_step leaves them as before its last substep."""
        model, data = self._models[world], self._data[world]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        self.joint_angle.numpy()[world] = data.qpos[self._angles]
        self.joint_velocity.numpy()[world] = data.qvel[self._dofs]
        pose = self.body_pose.numpy()[world]
        pose[:, :3] = data.xpos[self._bodies]
        pose[:, 3:] = np.roll(data.xquat[self._bodies], -1, axis=1)  # MuJoCo's is w x y z
        self._spatial_velocity[world] = data.cvel[self._bodies]
        # MuJoCo's velocities are at the centre of mass of the whole body.
        centre = data.xipos[self._bodies]
        centre[_HAT] = data.xpos[self._bodies[_HAT]] + data.xmat[self._bodies[_HAT]].reshape(3, 3) @ self.geometry.hat_com
        self._lever[world] = centre - data.subtree_com[self._bodies[0]]

    def _write_velocities(self) -> None:
        turning, moving = self._spatial_velocity[..., :3], self._spatial_velocity[..., 3:]
        velocity = self.body_velocity.numpy()
        velocity[..., :3] = moving + np.cross(turning, self._lever)
        velocity[..., 3:] = turning

    def _saved(self) -> dict[str, torch.Tensor]:
        return super()._saved() | {"mujoco": self._state, "diverged": self.diverged}


@contextmanager
def _silent() -> Iterator[None]:
    """Keep MuJoCo from writing warnings to the terminal and to a file; `diverged` reports them."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)
