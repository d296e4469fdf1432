"""The rules and means by hand, and the conditions that the claims need."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import spearmanr

from posture.analysis.results import LeastCost
from posture.cli.jobs import check
from posture.config.eval import EvalConfig
from posture.config.train import TrainConfig
from posture.reproduce.claims.rules import Judgement, Outcome, combined, part, spearman
from posture.reproduce.claims.seed_means import label, sample, seed_means, span, theory_means, where
from posture.reproduce.claims.stiffness import map_grid
from posture.reproduce.quantities import COST_RATIO, FREQ, HIP_ANKLE_R, HIP_K
from tests.posture.reproduce.examples import PAPER, REPORT, TEN, fallen, result


@given(
    st.lists(
        st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=4, max_size=12, unique_by=(lambda p: p[0], lambda p: p[1])
    )
)
def test_rank_correlation_equals_scipys(pairs: list[tuple[float, float]]) -> None:
    a, b = zip(*pairs, strict=True)
    assert spearman(a, b) == pytest.approx(spearmanr(a, b).statistic)


def test_a_rank_correlation_at_a_limit_reaches_it() -> None:
    """Squared differences of the ranks: 64 + 36 + 0 + 9 + 16 + 16 + 9 + 9 + 9 = 168, so rho = 1 - 6 * 168 / 720 = -0.4."""
    falling = [136.0, 20.5, 11.1, 16.2, 6.1, 11.0, 14.0, 14.5, 14.7]
    assert spearman(range(9), falling) == -0.4


def test_combined_parts() -> None:
    yes, no, half = part(True, "a"), part(False, "b"), Judgement(Outcome.PARTLY, "c")
    assert combined(yes, yes) == Judgement(Outcome.REPRODUCED, "a; a")
    assert [combined(*p).outcome for p in ((yes, no), (yes, half), (half, half))] == [Outcome.PARTLY] * 3
    assert combined(half, no).outcome is Outcome.NOT
    assert combined(yes, Judgement(Outcome.NOT_MEASURED, "")).outcome is Outcome.NOT_MEASURED


def test_means() -> None:
    results = [
        result(0.2, 1, freq_hz=0.3),
        result(0.4, 2, freq_hz=0.1 + 0.2),
        fallen(result(0.9, 3, freq_hz=0.3)),
        result(1.0, 1, freq_hz=0.1),
    ]
    means = seed_means(results, (FREQ,), HIP_ANKLE_R.measured)
    assert list(means) == [(0.1,), (0.3,)]
    mean = means[0.3,]
    assert (mean.mean, mean.n, mean.trials) == (pytest.approx(0.3), 2, 3)
    # The interval of two values is that between them.
    assert mean.text(".2f") == "0.30 (0.20 to 0.40)" and means[0.1,].text(".2f") == "1.00"
    assert span(means, (FREQ,), ".1f") == "1.0 at 0.1 Hz, 0.3 (0.2 to 0.4) at 0.3 Hz"
    assert sample(results, (FREQ,)) == "3 seeds (1 to 3 for a condition); 1 of 4 trials fell: 0.3 Hz (seed 3)"
    assert seed_means(results, (FREQ,), COST_RATIO.measured)[0.1,].n == 0
    assert len(where(results, FREQ, [0.3])) == 3
    assert label((HIP_K, FREQ), (25.0, 0.5)) == "25 Nm/rad and 0.5 Hz"


def test_theory_has_values_where_everyone_fell() -> None:
    trial = replace(result(0.1, freq_hz=0.3), least=LeastCost(hip_ankle_r=0.02))
    unknown = replace(trial, freq_hz=0.6, least=LeastCost(hip_ankle_r=math.nan))
    means = theory_means([fallen(trial), unknown], (FREQ,), HIP_ANKLE_R.least)
    assert {c: mean.mean for c, mean in means.items()} == {(0.3,): 0.02}


def test_the_experiments_have_the_conditions_of_the_claims() -> None:
    def swept(name: str, kind: type[TrainConfig] | type[EvalConfig]) -> list[Any]:
        one_seed = ["seed=1"] if kind is TrainConfig else []
        command = check(kind.__name__[:-6].lower(), kind, ["-m", f"experiment={name}", *one_seed])
        return [job.config for job in command.jobs]

    assert all(set(TEN) <= set(run.evaluation.freq) for run in swept("frequency", TrainConfig))
    runs = swept("energy", TrainConfig)
    assert sorted({run.env.energy_weight for run in runs}) == list(PAPER.table_4.gamma)
    assert {(run.env.freq, *run.evaluation.freq) for run in runs} == {(PAPER.table_4.freq_hz,) * 2}
    runs = swept("hip_stiffness", TrainConfig)
    assert sorted({run.env.hip_k for run in runs}) == list(PAPER.experiment_3.hip_k_nm_per_rad)
    assert {(run.env.hip_k, freq) for run in runs for freq in run.evaluation.freq} == set(map_grid(PAPER, REPORT))
    assert PAPER.experiment_3.freq_hz in runs[0].evaluation.freq
    trials = swept("load", EvalConfig)
    first, last = PAPER.experiment_4b.load_kg
    step = REPORT.grid.load_step_kg
    assert [trial.env.load for trial in trials] == pytest.approx(np.arange(first, last + step / 2, step))
    assert {trial.evaluation.freq for trial in trials} == {(PAPER.experiment_4b.freq_hz,)}
    trials = swept("amplitude", EvalConfig)
    assert tuple(trial.env.amplitude for trial in trials) == REPORT.grid.amplitudes_m
    assert {trial.evaluation.freq for trial in trials} == {TEN}
