"""The trials of a map: which bodies follow which targets."""

from dataclasses import dataclass

import numpy as np

from envs.config import EnvConfig
from envs.task import bodies
from envs.task.bodies import COLUMNS, Table
from posture.config.map import MapConfig
from posture.theory.least_costs import least_costs

RANDOM = "random"
"""Name of the trials that are drawn from all ranges together."""


@dataclass(frozen=True)
class Trials:
    """varied: of each row the parameter whose map it belongs to, or `RANDOM`. rows: (N, 8), see `envs.task.bodies`."""

    varied: list[str]
    rows: Table


def trials(config: MapConfig, env: EnvConfig) -> Trials:
    """The trials that `config` asks for, of a policy trained in `env`.

    Maps vary one parameter and the frequency, and random trials everything that `env` has a range for, uniformly. Of the
    latter those that the limits of torque and foot do not allow are replaced.
    """
    nominal = {name: bodies.value_of(env, name) for name in COLUMNS[1:]} | {"tolerance": config.evaluation.tolerance}
    found = [
        (name, {**nominal, "freq": freq, name: value})
        for name, values in config.varied
        for value in values
        for freq in config.freq.values
    ]
    rows = [np.array([[values[name] for name in COLUMNS] for _, values in found]).reshape(-1, len(COLUMNS))]
    if config.random:
        uniform = env.model_copy(update={"log_ranges": ()})
        rows.append(bodies.table(uniform, config.seed + 2**31, least_costs, config.random)[0])
    return Trials([name for name, _ in found] + config.random * [RANDOM], np.concatenate(rows))
