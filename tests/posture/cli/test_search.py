"""A search for hyper-parameters with Optuna."""

from pathlib import Path

import pytest
import yaml
from hydra.core.config_store import ConfigStore
from hydra.core.plugins import Plugins

from posture.analysis.results import read_csv
from posture.evaluation.best import objective
from posture.storage.run_dir import read_config
from tests.commands import ANY_FREQ, call, refused

pytestmark = pytest.mark.usefixtures("elsewhere")

SEARCH = ["-m", "experiment=search", *ANY_FREQ, "hydra.sweeper.n_trials=3"]
RATE = "agent.algorithm.learning_rate"


def test_three_trainings_and_the_best_of_them(monkeypatch, capsys):
    """The same command again repeats no training, and finds the same. In 0.3 s no policy falls, so each has its own cost."""
    search = [*SEARCH, "evaluation.duration=0.3"]
    call(monkeypatch, "train", *search)
    assert "sweep: 3 of 3 jobs done" in capsys.readouterr().out
    trials = {path.parent.parent for path in Path("runs/search").glob("*/evaluation/metrics.csv")}
    assert len(trials) == 3
    results = {
        read_config(run).agent.algorithm.learning_rate: objective(read_csv(run / "evaluation" / "metrics.csv"))
        for run in trials
    }
    assert len(set(results.values())) == 3
    found = Path("runs/search/optimization_results.yaml").read_text()
    best = yaml.safe_load(found)
    assert best["best_value"] == min(results.values()) == results[best["best_params"][RATE]]
    models = {path: path.stat().st_mtime_ns for path in Path("runs").glob("**/model_*.pt")}
    call(monkeypatch, "train", *search)
    assert {path: path.stat().st_mtime_ns for path in Path("runs").glob("**/model_*.pt")} == models
    assert Path("runs/search/optimization_results.yaml").read_text() == found


def test_the_ends_of_every_range_are_checked_before_the_first_training(monkeypatch, capsys):
    line = refused(monkeypatch, capsys, "train", *SEARCH, "agent.algorithm.gamma=interval(0.9,1.5)")
    assert line.startswith("error: agent.algorithm.gamma = 1.5")
    assert "evaluate=false: a search" in refused(monkeypatch, capsys, "train", *SEARCH, "evaluate=false")
    assert not Path("runs").exists()


def test_without_the_package(monkeypatch, capsys):
    Plugins.instance()  # which enters it into the store
    monkeypatch.delitem(ConfigStore.instance().repo["hydra"]["sweeper"], "optuna.yaml")
    line = refused(monkeypatch, capsys, "train", *SEARCH)
    assert line.startswith("error: a search needs the package hydra-optuna-sweeper: python -m pip install")


def test_other_commands_have_no_search(monkeypatch, capsys):
    line = refused(monkeypatch, capsys, "eval", "-m", "hydra/sweeper=optuna", "env.load=interval(0.0,4.0)")
    assert "hydra/sweeper=optuna: allowed is a search among trainings" in line
