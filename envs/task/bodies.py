"""The bodies and targets that a training draws from, where keys of the configuration have ranges.

They are a table of points of a Sobol sequence over all ranges and the frequency together, which fills them more evenly than
independent draws do. A world draws a row of it for each episode. With `freq_draw: stratified` the table is sorted by
frequency, and world i of N draws from the i-th of N equal parts.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from envs.config import RANGE_KEYS, EnvConfig

COLUMNS = ("freq", *RANGE_KEYS)
"""Columns of the table, before that of `effort_scale`."""
ROWS = 16_384
"""Rows at least; and eight for each world."""

Table = NDArray[np.float64]
LeastCosts = Callable[[EnvConfig, Table], NDArray[np.float64]]
"""The least cost of each row of a table, (rows,); nan where a stander of that body cannot follow."""


def table(
    config: EnvConfig, seed: int, least_costs: LeastCosts | None = None, count: int | None = None
) -> tuple[Table, NDArray[np.float64], float]:
    """`count` rows with the values of `COLUMNS`, (count, 8), and their least costs; nan without `least_costs`. `count` None:
    `ROWS` or eight for each of the `config.num_envs` worlds, in a multiple of it.

    Targets that the body cannot follow are replaced by later points of the sequence. The last value is their share. Raises
    ValueError if they are nearly all.
    """
    drawn = isinstance(config.freq, tuple) and config.ramp is None
    bounds = {"freq": config.freq if drawn else 2 * (config.highest_freq,)}  # a ramp must be feasible at its highest
    bounds |= {name: 2 * (value_of(config, name),) for name in RANGE_KEYS} | config.ranges.given
    low, high = np.array([bounds[name] for name in COLUMNS]).T
    in_log = np.isin(COLUMNS, config.log_ranges)
    varied = high > low
    size = config.num_envs * max(8, -(-ROWS // config.num_envs)) if count is None else count
    sequence = qmc.Sobol(max(1, int(varied.sum())), rng=np.random.default_rng(seed))
    kept: list[Table] = []
    costs: list[NDArray[np.float64]] = []
    found = tried = 0
    while found < size:
        unit = np.zeros((2 ** int(np.ceil(np.log2(size))), len(COLUMNS)))
        unit[:, varied] = sequence.random(len(unit))[:, : varied.sum()]
        points = low + (high - low) * unit
        points[:, in_log] = low[in_log] * (high[in_log] / low[in_log]) ** unit[:, in_log]
        cost = np.full(len(points), np.nan) if least_costs is None else least_costs(config, points)
        able = np.isfinite(cost) | (least_costs is None)
        kept.append(points[able])
        costs.append(cost[able])
        found, tried = found + int(able.sum()), tried + len(points)
        if found < 0.01 * tried:
            raise ValueError("env.ranges: the limits of torque and foot allow hardly any of these bodies and targets")
    rows, least = np.concatenate(kept)[:size], np.concatenate(costs)[:size]
    order = np.argsort(rows[:, 0], kind="stable") if config.freq_draw == "stratified" else np.arange(size)
    return rows[order], least[order], 1.0 - found / tried


def effort_scale(config: EnvConfig, least: NDArray[np.float64]) -> NDArray[np.float64]:
    """`env.reward.effort_reference` over the least cost of each row, at most `effort_scale_max`; 1 where it is not known."""
    scale = np.minimum(config.reward.effort_reference / least, config.reward.effort_scale_max)
    return np.where(np.isfinite(least), scale, 1.0)


def value_of(config: EnvConfig, name: str) -> float:
    """The value of a key of `RANGE_KEYS` without a range."""
    return config.reward.tolerance if name == "tolerance" else float(getattr(config, name))
