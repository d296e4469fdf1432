"""The least cost of many bodies and targets, quickly and a little too high: rows of `envs.task.bodies`."""

import math

import numpy as np

from envs.body.segments import Segments, read_segments
from envs.config import EnvConfig
from envs.task import rewards
from envs.task.bodies import COLUMNS, Table, effort_scale, value_of
from posture.analysis.coordination import torque_cost
from posture.analysis.trajectory import Array
from posture.theory.motion import PeriodicMotion, joint_arrays
from posture.theory.optimum import cheapest_sinusoid
from posture.theory.program import InfeasibleError, Program
from posture.theory.stander import linearise

SAMPLES = 40
"""Instants of a cycle."""
HARMONICS = 5
"""Of the program that decides where a sinusoid exceeds a limit: fewer than for the least cost itself, for speed. It finds a
few motions less."""
MARGIN = 0.98
"""Share of the torque limit and of the foot that a sinusoid may use, since instants between the samples are not checked."""


def least_costs(config: EnvConfig, rows: Table) -> Array:
    """Mean of the sum of squared torques over their limit, (rows,); nan where no motion within the tolerance keeps the
    torque limit and the centre of pressure inside the foot.

    The cost of the cheapest sinusoid that keeps the limits, typically a tenth above the least, or else of a program with
    few harmonics. `config` has what the rows do not say. Friction is not part of the linear stander.
    """
    body = read_segments(config)
    return np.array([_least_cost(body, config, dict(zip(COLUMNS, row, strict=True))) for row in rows.tolist()])


def weighted(config: EnvConfig, body: Segments, freq: float) -> EnvConfig:
    """`config` with the final weight of effort that a training on its ranges gives its own body at `freq` [Hz]."""
    exponent = rewards.weight(config.reward.effort_exponent)
    if not config.ranges.given or not exponent:
        return config
    row = {name: value_of(config, name) for name in COLUMNS[1:]} | {"freq": freq}
    (scale,) = effort_scale(config, np.array([_least_cost(body, config, row)]))
    return config.model_copy(update={"energy_weight": rewards.weight(config.energy_weight) * float(scale) ** exponent})


def _least_cost(body: Segments, config: EnvConfig, row: dict[str, float]) -> float:
    own = {name: row[name] for name in ("hip_k", "ankle_k", "load", "joint_damping")}
    stander = linearise(body, config.model_copy(update=own))
    task = row["freq"], row["amplitude"], row["tolerance"]
    motion = cheapest_sinusoid(stander, *task)
    time = motion.cycle(SAMPLES)
    middle, half = (stander.heel_x + stander.toe_x) / 2, (stander.toe_x - stander.heel_x) / 2
    used = np.abs(motion.torque(time)).max() / stander.torque_limit, np.abs(motion.cop(time) - middle).max() / half
    if max(used) > MARGIN:
        program = Program(stander, *task, harmonics=HARMONICS, samples=SAMPLES)
        try:
            motion = program.motion(program.least_torque())
        except InfeasibleError:
            return math.nan
    return _cost(motion)


def _cost(motion: PeriodicMotion) -> float:
    torque, _ = joint_arrays(motion, SAMPLES)
    return torque_cost(torque, motion.stander.torque_limit)
