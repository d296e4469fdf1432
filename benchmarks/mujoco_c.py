"""The body in MuJoCo's C engine."""

import mujoco

from envs.body import ANKLES, JOINTS, MJCF
from envs.config import EnvConfig


def build(config: EnvConfig) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """envs/humanoid.xml with the physical parameters and the solver's limits of `config`."""
    model = mujoco.MjModel.from_xml_path(str(MJCF))
    model.opt.timestep = config.control_dt / config.solver.substeps
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    model.opt.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    model.opt.iterations, model.opt.ls_iterations = config.solver.iterations, config.solver.ls_iterations
    hinges = [model.joint(name).id for name in JOINTS]
    model.jnt_stiffness[hinges] = [config.ankle_k if place in ANKLES else config.hip_k for place in range(len(JOINTS))]
    dofs = model.jnt_dofadr[hinges]
    model.dof_damping[dofs], model.dof_armature[dofs] = config.joint_damping, config.joint_armature
    model.geom_friction[:, 0] = config.friction
    model.body("hat").mass += config.load
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)  # the softness of contacts depends on mass and armature
    return model, data
