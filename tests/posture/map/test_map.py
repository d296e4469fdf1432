"""The map: its trials against those of posture.eval, its summary by hand, and the command."""

import math
from pathlib import Path

import numpy as np
import pytest

from envs.body.segments import read_segments
from envs.task import bodies
from envs.task.bodies import COLUMNS
from posture.analysis.results import LeastCost, Origin, Result
from posture.cli import jobs
from posture.config.map import MapConfig
from posture.evaluation.many_bodies import evaluate_many, least_costs_of, with_least_cost
from posture.evaluation.trial import evaluate_at
from posture.map.summary import Transition, agreement, transitions
from posture.map.trials import RANDOM, Trials, trials
from posture.storage import run_dir
from posture.theory.stander import linearise
from posture.theory.transition import bound_transition, reward_transition
from tests.commands import TINY, call, refused, runs, table
from tests.conftest import compose

BODY = {"hip_k": 60.0, "ankle_k": 30.0, "load": 2.0, "amplitude": 0.08}
SMALL = ["freq={low:0.5,high:1.0,step:0.5}", "evaluation.duration=2", "evaluation.transient=0"]


def map_config(*overrides):
    return jobs.compose("map", MapConfig, *overrides)


def row(freq, r, ratio, *, fell=False, hip_k=100.0):
    least = LeastCost(cost=math.nan if ratio is None else 1.0)
    values = {"freq_hz": freq, "hip_k_nm_per_rad": hip_k, "ankle_k_nm_per_rad": 25.0, "load_kg": 0.0}
    state = {"valid": not fell, "fell": fell, "hip_ankle_r": r, "cost_ratio": math.nan if ratio is None else ratio}
    return Result(origin=Origin(seed=1, amplitude_m=0.1), **values, **state, least=least)


def test_trials_are_those_of_posture_eval():
    """Bodies of one batch, each beside a trial of its own."""
    model = run_dir.find_checkpoint("pretrained")
    run = run_dir.read_config(model.parent)
    duration = 12.0
    evaluation = run.evaluation.model_copy(update={"duration": duration})
    plain = {"joint_damping": 1.0, "friction": 1.0, "tolerance": evaluation.tolerance}
    rows = np.array(
        [
            [{**plain, **BODY, "freq": freq, "load": load}[name] for name in COLUMNS]
            for freq, load in ((0.5, 2.0), (1.2, 0.0))
        ]
    )
    found = with_least_cost(evaluate_many(model, run, rows, evaluation, "cpu"), least_costs_of(rows, run.env, duration))
    for one, (freq, load) in zip(found, ((0.5, 2.0), (1.2, 0.0)), strict=True):
        (expected,), _ = evaluate_at([freq], "pretrained", duration, **BODY | {"load": load})
        assert one.cost == pytest.approx(expected.cost, rel=1e-4) and one.cost_ratio == pytest.approx(
            expected.cost_ratio, rel=1e-4
        )
        assert one.hip_ankle_r == pytest.approx(expected.hip_ankle_r, abs=1e-4)
        assert (one.load_kg, one.origin.amplitude_m) == (load, 0.08)


def test_which_trials():
    config = map_config("varied={hip_k:[50,100],ankle_k:[],load:[4],amplitude:[]}", "random=5", *SMALL)
    found = trials(config, compose("env=many_bodies", "agent=universal").env)
    assert found.varied == 4 * ["hip_k"] + 2 * ["load"] + 5 * [RANDOM]
    columns = dict(zip(COLUMNS, found.rows.T, strict=True))
    assert columns["freq"][:6].tolist() == [0.5, 1.0, 0.5, 1.0, 0.5, 1.0]
    assert columns["hip_k"][:6].tolist() == [50.0, 50.0, 100.0, 100.0, 125.0, 125.0]
    assert columns["load"][:6].tolist() == [0.0, 0.0, 0.0, 0.0, 4.0, 4.0]
    assert (columns["amplitude"][:6] == 0.1).all() and (columns["tolerance"][:6] == 0.025).all()
    assert len({*columns["hip_k"][6:]}) == len({*columns["load"][6:]}) == 5


def test_agreement_by_hand():
    """Of five cells one is infeasible, one at the transition, one fell; of the others one has the wrong mode."""
    results = [
        row(0.3, 0.9, 1.1),
        row(0.4, -0.9, 1.3),
        row(0.6, -0.1, 1.0),
        row(0.9, math.nan, 1.0, fell=True),
        row(1.2, -1.0, None),
    ]
    found = Trials(5 * ["hip_k"], np.zeros((5, 8)))
    (answer,) = agreement(found, 1, results, [Transition("hip_k", 100.0, 1, 0.5, 0.5, 0.61)])
    assert (answer.trials, answer.falls) == (4, 1)
    assert answer.cost_ratio_mean == pytest.approx(3.4 / 3) and answer.cost_ratio_max == pytest.approx(1.3)
    assert answer.below_120 == pytest.approx(2 / 3)
    assert answer.same_mode == pytest.approx(1 / 3)  # right, wrong, fell


@pytest.mark.parametrize(("mode", "share"), [("in-phase", 2 / 3), ("anti-phase", 1 / 3), ("", math.nan)])
def test_a_reward_that_does_not_switch_has_one_mode(mode, share):
    results = [row(freq, r, 1.0) for freq, r in ((0.3, 0.9), (0.6, 0.2), (0.9, -0.9))]
    switch = Transition("hip_k", 100.0, 1, 0.5, 0.5, math.nan, mode)
    (answer,) = agreement(Trials(3 * ["hip_k"], np.zeros((3, 8))), 1, results, [switch])
    assert answer.same_mode == pytest.approx(share, nan_ok=True)


def test_stiff_hips_are_in_phase_at_all_low_frequencies():
    """As posture.theory has it: 200 Nm/rad switches at 0.93 Hz (docs/many_bodies.md), 25 Nm/rad is anti-phase at all."""
    config = map_config("varied={hip_k:[25,200],ankle_k:[],load:[],amplitude:[]}", "search=[0.1,0.5]", "random=0", *SMALL)
    results = [row(0.3, 0.5, 1.0, hip_k=hip_k) for hip_k in (25.0, 200.0)]
    found = transitions(config, compose().env, Trials(2 * ["hip_k"], np.zeros((2, 8))), {1: results})
    assert [(one.value, one.reward_mode) for one in found] == [(25.0, "anti-phase"), (200.0, "in-phase")]
    assert all(math.isnan(one.reward_hz) for one in found)


def test_transitions_of_policy_and_theory():
    """The policy's by interpolation; theory's of the default body are those of posture.theory."""
    config = map_config("varied={hip_k:[125],ankle_k:[],load:[],amplitude:[]}", "search=[0.6,0.7]", "random=0", *SMALL)
    results = [row(0.6, 0.5, 1.0, hip_k=125.0), row(0.7, -0.5, 1.0, hip_k=125.0)]
    env, search = compose().env, config.search
    (answer,) = transitions(config, env, Trials(2 * ["hip_k"], np.zeros((2, 8))), {1: results})
    assert answer.policy_hz == pytest.approx(0.65)
    stander = linearise(read_segments(env), env)
    assert answer.least_hz == pytest.approx(bound_transition(stander, env.amplitude, config.evaluation.tolerance, search))
    assert answer.reward_hz == pytest.approx(reward_transition(stander, env, config.evaluation.tolerance, search))


def test_the_command_from_a_training_on(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(bodies, "ROWS", 16)  # their least costs take a minute
    call(monkeypatch, "train", *TINY, "env=many_bodies", "agent=universal", "evaluate=false")
    conditions = ["varied={hip_k:[100],ankle_k:[],load:[4],amplitude:[]}", "search=[0.6,0.7]", "random=1", "out=map", *SMALL]
    call(monkeypatch, "map", f"ckpt={runs()[0]}", *conditions)
    rows = table(Path("map/map.csv"))
    assert [one["varied"] for one in rows] == 2 * ["hip_k"] + 2 * ["load"] + ["random"]
    assert all(float(one["least_cost"]) > 0 for one in rows)
    assert {one["varied"] for one in table(Path("map/agreement.csv"))} == {"hip_k", "load", "random"}
    assert len(table(Path("map/transitions.csv"))) == 2 and Path("map/map.png").stat().st_size > 10_000
    again = ["map", f"ckpt=[{runs()[0]}]", "again=false", *conditions]
    call(monkeypatch, *again)
    assert capsys.readouterr().out.endswith(f"made before: {Path('map').resolve()}\n")
    Path("map/map.csv").unlink()
    Path("map/agreement.csv").write_text("")
    call(monkeypatch, *again)
    assert table(Path("map/map.csv")) == rows and len(table(Path("map/agreement.csv"))) == 3
    assert "nowhere: no such file" in refused(monkeypatch, capsys, "map", "ckpt=nowhere")
    assert "make 0 trials" in refused(
        monkeypatch, capsys, "map", "random=0", "varied={hip_k:[],ankle_k:[],load:[],amplitude:[]}"
    )
