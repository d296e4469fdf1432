"""Builds the configured physics engine; only that engine's libraries are imported."""

from envs.config import EnvConfig
from envs.engines.interface import Simulation


def simulate(config: EnvConfig, num_worlds: int, device: str) -> Simulation:
    """The engine that `env.physics` names, with `num_worlds` standers at their start."""
    if config.physics == "sagittal":
        from envs.engines.sagittal import SagittalSimulation

        return SagittalSimulation(config, num_worlds, device)
    if config.physics == "mujoco_c":
        from envs.engines.mujoco_c import MujocoCSimulation

        return MujocoCSimulation(config, num_worlds, device)
    from envs.engines.newton_mujoco import NewtonMujocoSimulation

    return NewtonMujocoSimulation(config, num_worlds, device)
