"""From command to torque (`env.actuation`): a first-order lag, as of a muscle's activation, and noise in proportion."""

import math

import warp as wp

from envs.config import EnvConfig
from envs.engines.launch import Launch
from envs.task.episodes import Episodes
from envs.task.target import normal, random_bits

wp.set_module_options({"fuse_fp": False})


@wp.kernel(enable_backward=False)
def _actuate(
    keep: float,
    noise: float,
    seeds: wp.array[wp.int64],
    world: wp.array[wp.int64],
    episode: wp.array[wp.int64],
    step: wp.array[wp.int64],
    command: wp.array2d[float],
    activation: wp.array2d[float],
    action: wp.array2d[float],
) -> None:
    """One control step of a world. Left and right have the same noise, as they have the same command."""
    i = wp.tid()
    bits = random_bits(seeds[1], world[i], episode[i], step[i])
    kinds = command.shape[1] // 2
    for kind in range(kinds):
        active = keep * activation[i, kind] + (1.0 - keep) * command[i, kind]
        torque = wp.clamp(active * (1.0 + noise * normal(bits, kind)), -1.0, 1.0)
        if wp.isnan(active):
            torque = active
        for side in range(2):
            activation[i, kind + kinds * side] = active
            action[i, kind + kinds * side] = torque


class Actuation:
    """The actuators of N worlds."""

    def __init__(self, config: EnvConfig, episodes: Episodes) -> None:
        time_constant = config.actuation.time_constant
        keep = math.exp(-config.control_dt / time_constant) if time_constant else 0.0
        numbers = (episodes.seeds, episodes.world, episodes.episode, episodes.step)
        inputs = [keep, config.actuation.noise, *map(wp.from_torch, (*numbers, episodes.command))]
        outputs = [wp.from_torch(tensor) for tensor in (episodes.activation, episodes.action)]
        self._actuate = Launch(_actuate, len(episodes.world), inputs, outputs, episodes.world.device)

    def actuate(self) -> None:
        """Before a control step of the physics: `activation` and `action` of the episodes from their `command`."""
        self._actuate()
