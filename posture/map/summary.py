"""What a map says: the transition against each parameter, and how near a policy is to the theory."""

import contextlib
import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np

from envs.body.segments import Segments, read_segments
from envs.config import EnvConfig
from posture.analysis.coordination import sign_change_frequency
from posture.analysis.results import Result
from posture.config.map import MapConfig
from posture.map.trials import RANDOM, Trials
from posture.theory.least_costs import weighted
from posture.theory.motion import PeriodicMotion
from posture.theory.program import InfeasibleError
from posture.theory.reward_optimum import reward_optimum
from posture.theory.stander import linearise
from posture.theory.transition import bound_transition, hip_ankle_correlation, transition_frequency

NEAR_HZ = 0.03
"""From its transition on, in either direction, a cell has no mode that the theory would insist on [Hz]."""


@dataclass(frozen=True)
class Transition:
    """The frequencies at which the modes switch at one `value` of the parameter `varied`; nan where they do not [Hz].

    least: of the motion of least cost. reward: of the optimum of the reward that was trained. policy: of seed `seed`.
    reward_mode: "in-phase" or "anti-phase" where the reward's optimum does not switch, else "".
    """

    varied: str
    value: float
    seed: int
    policy_hz: float
    least_hz: float
    reward_hz: float
    reward_mode: str = ""


@dataclass(frozen=True)
class Agreement:
    """How near a policy is to the theory over the trials of a map, or the random ones.

    trials: feasible ones. falls: of these. cost_ratio: mean, 95th percentile and largest of cost over least cost.
    below_120: share with a ratio of at most 1.2. exact_*: the same of the cost over `LeastCost.exact_cost`. same_mode: share
    of the cells at least `NEAR_HZ` from the transition of the trained reward whose correlation has the theory's sign; nan
    for random trials.
    """

    varied: str
    seed: int
    trials: int
    falls: int
    cost_ratio_mean: float
    cost_ratio_p95: float
    cost_ratio_max: float
    below_120: float
    exact_ratio_mean: float
    exact_ratio_p95: float
    exact_below_120: float
    same_mode: float


def transitions(config: MapConfig, env: EnvConfig, found: Trials, seeds: dict[int, list[Result]]) -> list[Transition]:
    """The transition at each value of each parameter, and of each seed."""
    body, rows = read_segments(env), []
    values = [(name, value) for name, values in config.varied for value in values]
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn")) as pool:
        theory = list(pool.map(_Theory(body, env, config), values))
    for (name, value), (least, reward, mode) in zip(values, theory, strict=True):
        for seed, results in seeds.items():
            own = [result for result, row in cells(found, results, name) if row == value]
            policy = sign_change_frequency([one.freq_hz for one in own], [one.hip_ankle_r for one in own])
            rows.append(Transition(name, value, seed, _or_nan(policy), _or_nan(least), _or_nan(reward), mode))
    return rows


def cells(found: Trials, results: Sequence[Result], name: str) -> list[tuple[Result, float]]:
    """The results of the map of parameter `name`, each with its value."""
    of: dict[str, Callable[[Result], float]] = {
        "hip_k": lambda one: one.hip_k_nm_per_rad,
        "ankle_k": lambda one: one.ankle_k_nm_per_rad,
        "load": lambda one: one.load_kg,
        "amplitude": lambda one: one.origin.amplitude_m,
    }
    return [(one, of[name](one)) for one, varied in zip(results, found.varied, strict=True) if varied == name]


def agreement(found: Trials, seed: int, results: Sequence[Result], switches: Sequence[Transition]) -> list[Agreement]:
    """The agreement over each map, and over the random trials."""
    rows = []
    for name in dict.fromkeys(found.varied):
        own = [one for one, varied in zip(results, found.varied, strict=True) if varied == name]
        feasible = [one for one in own if math.isfinite(one.least.cost)]
        standing = [one for one in feasible if one.valid]
        mean, high, most, below = _spread([one.cost_ratio for one in standing])
        exact_mean, exact_high, _, exact_below = _spread([one.cost / one.least.exact_cost for one in standing])
        same = math.nan
        if name != RANDOM:
            of = {row.value: row for row in switches if row.varied == name}
            signs = [
                one.valid and ("in-phase" if one.hip_ankle_r > 0 else "anti-phase") == mode
                for one, value in cells(found, results, name)
                if math.isfinite(one.least.cost) and (mode := _reward_mode(of[value], one.freq_hz))
            ]
            same = float(np.mean(signs)) if signs else math.nan
        rows.append(
            Agreement(
                varied=name,
                seed=seed,
                trials=len(feasible),
                falls=sum(one.fell for one in feasible),
                cost_ratio_mean=mean,
                cost_ratio_p95=high,
                cost_ratio_max=most,
                below_120=below,
                exact_ratio_mean=exact_mean,
                exact_ratio_p95=exact_high,
                exact_below_120=exact_below,
                same_mode=same,
            )
        )
    return rows


def _reward_mode(switch: Transition, freq: float) -> str:
    """The mode of the reward's optimum at `freq` [Hz]; "" near its transition, or where it is not known."""
    if math.isnan(switch.reward_hz):
        return switch.reward_mode
    if abs(freq - switch.reward_hz) < NEAR_HZ:
        return ""
    return "in-phase" if freq < switch.reward_hz else "anti-phase"


def _spread(ratios: Sequence[float]) -> tuple[float, float, float, float]:
    """Mean, 95th percentile, maximum, and share of at most 1.2, of those that are finite; nan without any."""
    finite = np.array([ratio for ratio in ratios if math.isfinite(ratio)])
    if not len(finite):
        return 4 * (math.nan,)
    return float(finite.mean()), float(np.percentile(finite, 95)), float(finite.max()), float(np.mean(finite <= 1.2))


class _Theory:
    """Transitions of the least cost and of the reward at one value of one parameter, for another process."""

    def __init__(self, body: Segments, env: EnvConfig, config: MapConfig) -> None:
        self._body, self._env, self._search, self._tolerance = body, env, config.search, config.evaluation.tolerance

    def __call__(self, varied: tuple[str, float]) -> tuple[float | None, float | None, str]:
        env = self._env.model_copy(update=dict([varied]))
        stander = linearise(self._body, env)
        least = bound_transition(stander, env.amplitude, self._tolerance, self._search)

        def best(freq: float) -> PeriodicMotion:
            return reward_optimum(stander, freq, weighted(env, self._body, freq), self._tolerance)

        try:
            reward = transition_frequency(best, self._search)
        except ValueError:  # a reward without effort
            return least, None, ""
        if reward is not None:
            return least, reward, ""
        for freq in np.linspace(*self._search, 20):  # one mode at all frequencies at which a motion is possible
            with contextlib.suppress(InfeasibleError):
                return least, None, "in-phase" if hip_ankle_correlation(best(float(freq))) > 0 else "anti-phase"
        return least, None, ""


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value
