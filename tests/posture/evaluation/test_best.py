"""The best of several evaluated policies, and when they no longer improve, by hand."""

import dataclasses
import hashlib
import math
import shutil
from pathlib import Path

import pytest
import yaml

from posture.analysis.results import LeastCost, Result
from posture.evaluation.best import Score, best, has_plateaued, objective, score
from posture.play.policies import policy_choices
from tests.commands import EVALUATION, TINY, call
from tests.conftest import compose_eval

NAN = math.nan


def result(ratio=NAN, least=0.02):
    """The result at one frequency; without a ratio, that of a fall."""
    fell = math.isnan(ratio)
    return Result(
        freq_hz=0.4,
        hip_k_nm_per_rad=125,
        ankle_k_nm_per_rad=25,
        load_kg=0,
        valid=not fell,
        fell=fell,
        cost_ratio=ratio,
        least=LeastCost(cost=least),
    )


def test_the_score_is_the_mean_over_the_frequencies_without_a_fall():
    assert score(50, [result(1.1), result(), result(1.4)]) == Score(50, 1, pytest.approx(1.25))
    fallen = score(50, [result(), result()])
    assert fallen.falls == 2 and math.isnan(fallen.cost_ratio)


def test_a_fall_counts_in_a_search_as_full_torque_at_all_four_joints():
    assert objective([result(1.1), result(1.3)]) == pytest.approx(1.2)
    assert objective([result(1.1), result(least=0.02)]) == pytest.approx((1.1 + 4 / 0.02) / 2)


def test_fewest_falls_come_before_the_least_cost_and_the_first_before_its_equals():
    found = [Score(10, 2, 1.0), Score(20, 0, 1.3), Score(30, 0, 1.2), Score(40, 0, 1.2), Score(50, 3, NAN)]
    assert best(found) == found[2]
    assert best(found[:1]) == found[0]
    assert best([found[4], dataclasses.replace(found[4], iteration=60)]) is None and best([]) is None


@pytest.mark.parametrize(
    ("ratios", "plateau"),
    [
        ([1.3, 1.2, 1.1], False),
        ([1.3, 1.1, 1.2], False),
        ([1.3, 1.1, 1.2, 1.1], True),  # equal is not better
        ([1.3, 1.1, 1.2, 1.09], False),
        ([NAN, NAN, NAN, NAN], False),  # no policy stands yet
        ([NAN, NAN, 1.5, NAN, NAN], True),
    ],
)
def test_two_evaluations_without_a_better_policy_are_a_plateau(ratios, plateau):
    found = [Score(10 * n, 1 if math.isnan(ratio) else 0, ratio) for n, ratio in enumerate(ratios, 1)]
    assert has_plateaued(found, 2) is plateau


def test_every_command_takes_the_best_policy(sound, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = shutil.copytree(sound, tmp_path / "run")
    shutil.copy(run / "model_1.pt", run / "best.pt")
    call(monkeypatch, "eval", "ckpt=run/best.pt", *EVALUATION, "evaluation.figures=false", "evaluation.freq=[0.5]")
    (folder,) = run.glob("evaluation_best*")
    record = yaml.safe_load((folder / "trial.yaml").read_text())
    assert record["policy_sha256"] == hashlib.sha256((run / "model_1.pt").read_bytes()).hexdigest()
    films = ["films=[two_modes]", "formats=[gif]", "width=60", "fps=6", "settle=0", "shortest=0.5", "env.freq=1.5"]
    call(monkeypatch, "film", "ckpt=run/best.pt", *films, "out=film")
    call(monkeypatch, "export", "ckpt=run/best.pt", "what=[trajectories]", "evaluation.duration=1.0", "out=export")
    assert Path("film/two_modes.gif").exists() and list(Path("export").glob("*.csv"))
    first = policy_choices("run/best.pt", compose_eval().lqr)[0]
    assert (first.name, first.model) == ("run/best", Path("run/best.pt"))
    call(monkeypatch, "train", *TINY, "init=run/best.pt", "evaluate=false", "out=tuned")
