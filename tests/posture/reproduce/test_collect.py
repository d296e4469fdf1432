"""The theory beside the results: the optimum of the trained reward in each condition, and where the modes switch."""

import math
from dataclasses import astuple, replace

import pytest

from envs.body.segments import read_segments
from envs.config import EnvConfig
from posture.analysis.results import NO_REWARD, RewardOptimum
from posture.reproduce import collect
from posture.reproduce.collect import _recipe, _with_reward_optimum, theory_transitions
from posture.theory.motion import PeriodicMotion, motion_indices
from posture.theory.reward_optimum import reward_optimum
from posture.theory.stander import linearise
from posture.theory.transition import hip_ankle_correlation
from tests.conftest import compose
from tests.posture.reproduce.examples import PAPER, result


def optimum(env: EnvConfig, freq: float) -> PeriodicMotion:
    return reward_optimum(linearise(read_segments(env), env), freq, env, 0.025)


def test_a_result_gets_the_optimum_of_its_own_condition() -> None:
    run = compose("experiment=frequency")
    condition = {"hip_k_nm_per_rad": 100.0, "load_kg": 1.0, "energy_weight": 10.0, "amplitude_m": 0.08}
    free = result(freq_hz=0.5, energy_weight=0.0)  # no motion is better than another
    elsewhere = result(freq_hz=0.6, reward=RewardOptimum(0.1, 0.2, 0.3))
    trials = [free, elsewhere, result(freq_hz=0.5, **condition)]
    found = _with_reward_optimum(trials, run, 0.5)
    assert found[0].reward is NO_REWARD and found[1] is elsewhere
    env = compose("env.hip_k=100", "env.load=1", "env.energy_weight=10", "env.amplitude=0.08").env
    indices = motion_indices(optimum(env, 0.5), 100.0)
    assert astuple(found[2].reward) == pytest.approx((indices.hip_ankle_r, indices.cost, indices.energy_j), rel=1e-6)
    assert replace(found[2], reward=NO_REWARD) == trials[2]


def test_without_a_frequency_every_result_does_if_there_is_a_motion() -> None:
    trials = [result(freq_hz=0.3), result(freq_hz=1.5, amplitude_m=1.0)]  # the second head would need 89 m/s2
    run = compose("experiment=frequency")
    slow, impossible = _with_reward_optimum(trials, run, None)
    assert slow.reward.hip_ankle_r == pytest.approx(hip_ankle_correlation(optimum(run.env, 0.3)), abs=1e-6)
    assert impossible.reward is NO_REWARD


def test_transitions_are_those_of_docs_theory() -> None:
    run = compose("experiment=frequency")
    assert astuple(theory_transitions(run, (0.6, 0.7))) == pytest.approx((0.656, 0.677, 0.680), abs=6e-4)
    assert all(map(math.isnan, astuple(theory_transitions(run, (0.2, 0.25)))))


@pytest.mark.parametrize(
    ("name", "hz", "search"),
    [
        ("as_published", pytest.approx(0.75, abs=0.002), (0.745, 0.755)),  # docs/results.md: 0.75 Hz
        ("as_run", pytest.approx(0.664, abs=6e-4), (0.662, 0.667)),  # docs/task.md
    ],
)
def test_a_recipe_switches_where_its_own_reward_does(name: str, hz: object, search: tuple[float, float]) -> None:
    assert _recipe(name, {name: []}, compose(f"experiment={name}"), search, PAPER).reward_hz == hz


def test_a_recipe_has_its_own_results_and_optima(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collect, "reward_transition", lambda *_: None)
    names = ("frequency", "ramp", "load", "as_published", "ramp_as_published", "load_as_published")
    results = {name: [result(0.1 * i)] for i, name in enumerate(names)}
    recipe = _recipe("as_published", results, compose("experiment=as_published"), (0.6, 0.7), PAPER)
    assert [recipe.frequency, recipe.ramp, recipe.load] == [results[name] for name in names[3:]]
    assert recipe.name == "as_published" and math.isnan(recipe.reward_hz)
    # The paper's last anti-phase conditions: hips of 100 Nm/rad in Exp. 3, at 0.5 Hz, and gamma 5 in Exp. 2, at 0.4 Hz.
    for found, freq, change in (
        (recipe.soft_hip_r, 0.5, "env.hip_k=100"),
        (recipe.low_weight_r, 0.4, "env.energy_weight=5"),
    ):
        best = optimum(compose("experiment=as_published", change).env, freq)
        assert found == pytest.approx(hip_ankle_correlation(best), abs=1e-6)
