"""The model-based controller in the full simulation."""

import pytest

from envs.task.head_tracking import HeadTrackingEnv
from posture.analysis.results import read_csv
from posture.config.errors import ConfigError
from posture.config.eval import EvalConfig
from posture.config.reading import read
from posture.evaluation.lqr_policy import LqrController
from posture.evaluation.trial import AS_TRAINED, evaluate_lqr, trial_config
from posture.theory.lqr import plan
from posture.theory.nonlinear import exact_stander
from tests.conftest import compose_eval

EVAL: EvalConfig = compose_eval("evaluation.freq=[0.5,1.0]", "evaluation.duration=10.0", "evaluation.transient=4.0")
LQR = EVAL.lqr


def test_it_stands_and_costs_what_the_optimum_costs(tmp_path, capsys):
    """Feet flat and in place, at most 3 % from the least cost of the exact equations; in-phase, then anti-phase."""
    rows = evaluate_lqr(LQR, EVAL.evaluation, AS_TRAINED, "cpu", tmp_path)
    assert [row.mode for row in rows] == ["in-phase", "anti-phase"]
    for row, written in zip(rows, read_csv(tmp_path / "metrics.csv"), strict=True):
        assert row.valid and row.foot_not_flat_share == 0.0
        assert 0.98 < row.cost / row.least.exact_cost < 1.03 and row.foot_displacement_max_m < 0.001
        assert row.cost_ratio == pytest.approx(row.cost / row.least.cost)
        assert row.head_amplitude_m == pytest.approx(0.076, abs=0.004)
        assert (written.mode, written.cost_ratio) == (row.mode, pytest.approx(row.cost_ratio, rel=1e-5))
    assert {"trial.yaml", "table.md", "coordination.png"} <= {path.name for path in tmp_path.iterdir()}
    assert "cost/least" in " ".join(capsys.readouterr().out.split())


def test_on_flat_feet_and_within_the_tolerance_nothing_costs_less_than_the_bound(tmp_path):
    """With 6 mm left to feedback the head stays within the tolerance, and the least cost is then a lower bound, except for
    the squares of angles that the linear model leaves out: a ratio under 0.97 would be an error of theory or simulation."""
    careful = LQR.model_copy(update={"tolerance_margin": 0.006})
    for row in evaluate_lqr(careful, EVAL.evaluation, AS_TRAINED, "cpu", tmp_path):
        assert row.beyond_tolerance_share == 0.0 and row.foot_not_flat_share == 0.0
        assert 0.97 <= row.cost_ratio < 1.3


def test_with_soft_hips_the_exact_equations_count(tmp_path):
    """Hips of 25 Nm/rad need half a newton metre: the terms that small angles leave out are a quarter of the cost."""
    soft = AS_TRAINED.model_copy(update={"hip_k": 25.0})
    for row in evaluate_lqr(LQR, EVAL.evaluation, soft, "cpu", tmp_path):
        assert 0.97 < row.cost / row.least.exact_cost < 1.04 and row.cost_ratio > 1.15


def test_every_world_needs_a_motion(body):
    env = HeadTrackingEnv(trial_config(LQR.env, EVAL.evaluation, AS_TRAINED, "cpu"), 0, "cpu")
    with pytest.raises(ValueError, match="1 motions for 2 worlds"):
        LqrController(env, [plan(exact_stander(body, LQR.env), 0.5, 0.1, 0.025, LQR)], LQR, 1.0)


def test_a_motion_that_cannot_be_made_is_refused(tmp_path):
    changes = AS_TRAINED.model_copy(update={"amplitude": 2.0})
    with pytest.raises(ConfigError, match="cannot be met"):
        evaluate_lqr(LQR, EVAL.evaluation, changes, "cpu", tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_unknown_policies_are_refused():
    with pytest.raises(ConfigError, match="policy = 'mpc'"):
        read(EvalConfig, EVAL.model_dump() | {"policy": "mpc"})
