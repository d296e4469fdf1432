"""The stander in MuJoCo's C solver, in double precision: the reference of both engines."""

import mujoco
import numpy as np

from envs.body.joints import BODIES, FEET, JOINTS
from envs.body.mjcf import mjcf


def with_load(config, spec=None):
    """MuJoCo's model of the body, or of `spec`, with the load of `config`; at a place of its own it is a body of its own."""
    spec = spec or mujoco.MjSpec.from_string(mjcf(config.body))
    if config.load and config.load_at:
        x, z = config.load_at
        place = spec.body("hat").add_body(name="load", pos=[x, 0.0, z])
        place.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[2e-5, 0, 0], mass=config.load, contype=0, conaffinity=0)
    model = spec.compile()
    if not config.load_at:
        model.body("hat").mass += config.load
    return model


class MujocoC:
    """The same MJCF in MuJoCo's C solver, with springs, damping, armature, friction, load and contact bias of `config`."""

    def __init__(self, config, height=0.0, timestep=None):
        model = with_load(config)
        model.opt.timestep = timestep or config.control_dt / config.solver.substeps
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
        model.opt.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
        hinges = [model.joint(name).id for name in JOINTS]
        model.jnt_stiffness[hinges] = [config.hip_k, config.ankle_k] * 2
        dofs = model.jnt_dofadr[hinges]
        model.dof_damping[dofs] = config.joint_damping
        model.dof_armature[dofs] = config.joint_armature
        model.geom_friction[:, 0] = config.friction
        self.model, self.data, self.dofs = model, mujoco.MjData(model), dofs
        self.contact_bias, self._other = config.solver.contact_bias, mujoco.MjData(model)
        mujoco.mj_setConst(model, self.data)  # the softness of constraints depends on armature and masses
        self.angles = model.jnt_qposadr[hinges]
        self.data.qpos[2] += height

    def place(self, q, qd):
        """Put the body at planar coordinates x, z, and pitches of HAT, leg and foot, with these velocities."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:7] = q[0], 0, q[1], np.cos(q[2] / 2), 0, np.sin(q[2] / 2), 0
        self.data.qpos[self.angles] = [q[3] - q[2], q[4] - q[3]] * 2
        self.data.qvel[:] = self.spread(qd)

    def spread(self, planar):
        """Planar velocities or accelerations as those of the full body."""
        full = np.zeros(self.model.nv)
        full[[0, 2, 4]] = planar[:3]
        full[self.dofs] = [planar[3] - planar[2], planar[4] - planar[3]] * 2
        return full

    def step(self, torque, substeps):
        self.data.qfrc_applied[self.dofs] = torque
        for _ in range(substeps):
            if not self.contact_bias:
                mujoco.mj_step(self.model, self.data)
                continue
            mujoco.mj_step1(self.model, self.data)
            self.correct()
            mujoco.mj_step2(self.model, self.data)

    def correct(self):
        """Subtract (1 - B h / 2) J'v from the reference accelerations of all contacts, where `contact_bias` is true."""
        for i in range(self.data.ncon if self.contact_bias else 0):
            contact = self.data.contact[i]
            damping = 2.0 / (contact.solimp[1] * contact.solref[0])
            share = 1.0 - damping * self.model.opt.timestep / 2
            normal, *sliding = contact.frame.reshape(3, 3) @ self._bias(contact)
            for row, edge in enumerate(
                f * side * s for f, s in zip(contact.friction[:2], sliding, strict=True) for side in (1, -1)
            ):
                self.data.efc_aref[contact.efc_address + row] -= share * (normal + edge)

    def _bias(self, contact):
        """J'v of a contact [m/s2], by central differences of its Jacobian along the motion."""
        model, data, dt = self.model, self.data, 1e-6
        sole = contact.geom[1]
        radius = model.geom_size[sole, 0]
        # MuJoCo's point of contact lies halfway between the ground and the lowest point of the ball.
        centre = contact.pos + [0, 0, radius + contact.dist / 2]
        local = data.geom_xmat[sole].reshape(3, 3).T @ (centre - data.geom_xpos[sole])
        rows = []
        for time in (dt, -dt):
            self._other.qpos[:] = data.qpos
            mujoco.mj_integratePos(model, self._other.qpos, data.qvel, time)
            mujoco.mj_kinematics(model, self._other)
            mujoco.mj_comPos(model, self._other)
            centre = self._other.geom_xpos[sole] + self._other.geom_xmat[sole].reshape(3, 3) @ local
            row = np.zeros((3, model.nv))
            mujoco.mj_jac(model, self._other, row, None, centre - [0, 0, radius], model.geom_bodyid[sole])
            rows.append(row)
        return (rows[0] - rows[1]) @ data.qvel / (2 * dt)

    def read(self):
        """The outputs of a `Simulation` after a step, under the same names."""
        model, data = self.model, self.data
        joint_force = (data.qfrc_passive + data.qfrc_applied)[self.dofs]
        force, position = self._soles()
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        pose, velocity = np.zeros((len(BODIES), 7)), np.zeros((len(BODIES), 6))
        turning_first = np.zeros(6)
        for i, name in enumerate(BODIES):
            body = data.body(name)
            pose[i] = *body.xpos, *body.xquat[[1, 2, 3, 0]]
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body.id, turning_first, 0)
            velocity[i] = np.roll(turning_first, 3)
        return {
            "joint_angle": data.qpos[self.angles].copy(),
            "joint_velocity": data.qvel[self.dofs].copy(),
            "joint_force": joint_force,
            "body_pose": pose,
            "body_velocity": velocity,
            "sole_force": force,
            "sole_position": position,
        }

    def _soles(self):
        """Forces on left and right foot at heel and toe, and where they act in the foot frame, as of the last substep."""
        force, position, wrench = np.zeros((2, 2, 3)), np.zeros((2, 2, 3)), np.zeros(6)
        for i in range(self.data.ncon):
            contact = self.data.contact[i]
            mujoco.mj_contactForce(self.model, self.data, i, wrench)
            sole = self.data.geom(contact.geom[1])
            foot = sole.name.replace("sole", "foot")
            # Of the capsule's ends that which lies where the contact is, on the ground and below it.
            radius, half, _ = self.model.geom(sole.id).size
            ends = sole.xpos + np.outer([-half, half], sole.xmat.reshape(3, 3)[:, 2])
            if (self.data.body(foot).xmat.reshape(3, 3).T @ (ends[1] - ends[0]))[0] < 0:
                ends = ends[::-1]
            lowest = ends - [0, 0, radius]
            end = np.argmin(np.abs(lowest - (contact.pos + [0, 0, contact.dist / 2])).sum(1))
            place = FEET.index(foot), end
            force[place] = contact.frame.reshape(3, 3).T @ wrench[:3]
            body = self.data.body(foot)
            position[place] = body.xmat.reshape(3, 3).T @ (contact.pos - body.xpos)
        return force, position

    def energy(self):
        """Kinetic plus potential energy of body and springs [J]."""
        mujoco.mj_forward(self.model, self.data)
        mujoco.mj_energyPos(self.model, self.data)
        mujoco.mj_energyVel(self.model, self.data)
        return float(self.data.energy.sum())
