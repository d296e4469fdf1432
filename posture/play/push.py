"""A push: what a horizontal force on the trunk does to the velocities of the planar body.

The engine knows no forces but those of joints and ground. A force F over a control step dt is the same as a change of the
generalised velocities by M^-1 J' F dt before the step; mass matrix M and Jacobian J of the HAT's centre of mass are
MuJoCo's, of the body file that the engine is made from.
"""

import mujoco
import numpy as np
import torch

from envs.body.joints import ANKLES, BODIES, HIPS, JOINTS
from envs.body.model import MJCF
from envs.config import EnvConfig
from envs.task.head_tracking import HeadTrackingEnv


class Pusher:
    """Pushes the only stander of an environment in the sagittal engine."""

    def __init__(self, config: EnvConfig) -> None:
        self._model = mujoco.MjModel.from_xml_path(str(MJCF))
        self._dofs = [self._model.joint(name).dofadr[0] for name in JOINTS]
        self._hat = self._model.body(BODIES[0]).id
        self._mass = float(self._model.body_mass[self._hat])
        self._model.dof_armature[self._dofs] = config.joint_armature

    def push(self, env: HeadTrackingEnv, impulse: float) -> None:
        """Give the HAT's centre of mass `impulse` [Ns] along x, all at once."""
        model = self._model
        # The load sits at the centre of mass, and so adds no inertia about it.
        model.body_mass[self._hat] = self._mass + float(env.sim.load[0])
        data = mujoco.MjData(model)
        x, y, z, w = env.hat_pose[0, 3:].tolist()
        data.qpos[:7] = [*env.hat_pose[0, :3].tolist(), w, x, y, z]
        for i, name in enumerate(JOINTS):
            data.joint(name).qpos = float(env.sim.joint_angle[0, i])
        mujoco.mj_forward(model, data)
        jacobian, change = np.zeros((3, model.nv)), np.zeros((1, model.nv))
        mujoco.mj_jacBodyCom(model, data, jacobian, None, self._hat)
        mujoco.mj_solveM(model, data, change, impulse * jacobian[:1])
        hip, ankle = (float(change[0, self._dofs[kind]].mean()) for kind in (HIPS, ANKLES))
        pitch = float(change[0, 4])
        # The engine's coordinates: x and z of the HAT's frame, and the pitch of each segment in the world.
        planar = [float(change[0, 0]), float(change[0, 2]), pitch, pitch + hip, pitch + hip + ankle]
        state = env.sim.state_dict()
        state["qd"] += torch.tensor([planar])
        env.sim.load_state_dict(state)
