"""Which bodies can follow which targets: the linear stander's answer for rows of `envs.task.bodies`."""

import numpy as np
from numpy.typing import NDArray

from envs.body.segments import Segments, read_segments
from envs.config import EnvConfig
from envs.task.bodies import COLUMNS, Table
from posture.theory.optimum import cheapest_sinusoid
from posture.theory.program import InfeasibleError, Program
from posture.theory.stander import linearise

CYCLE = np.arange(48) / 48
"""Instants of a cycle at which a sinusoidal motion is checked."""
MARGIN = 0.98
"""Share of the torque limit and of the foot that a sinusoidal motion may use; where it uses more, a program decides."""
HARMONICS, SAMPLES = 5, 40
"""Of that program: fewer than for the least cost, for speed. It finds a few motions less."""


def feasible(config: EnvConfig, rows: Table) -> NDArray[np.bool_]:
    """Whether a motion within the tolerance keeps the torque limit and the centre of pressure inside the foot, (rows,).

    `config` has what the rows do not say. Friction is not part of the linear stander.
    """
    body = read_segments(config)
    return np.array([_is_feasible(body, config, dict(zip(COLUMNS, row, strict=True))) for row in rows.tolist()], dtype=bool)


def _is_feasible(body: Segments, config: EnvConfig, row: dict[str, float]) -> bool:
    own = {name: row[name] for name in ("hip_k", "ankle_k", "load", "joint_damping")}
    stander = linearise(body, config.model_copy(update=own))
    task = row["freq"], row["amplitude"], row["tolerance"]
    if row["freq"] == 0.0:  # a ramp
        return True
    motion = cheapest_sinusoid(stander, *task)
    time = CYCLE / row["freq"]
    middle, half = (stander.heel_x + stander.toe_x) / 2, (stander.toe_x - stander.heel_x) / 2
    used = np.abs(motion.torque(time)).max() / stander.torque_limit, np.abs(motion.cop(time) - middle).max() / half
    if max(used) < MARGIN:
        return True
    try:
        Program(stander, *task, harmonics=HARMONICS, samples=SAMPLES).least_torque()
    except InfeasibleError:
        return False
    return True
