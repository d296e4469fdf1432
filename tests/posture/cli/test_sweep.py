"""Sweeps that continue, name failed jobs and skip those that are done: real ones of tiny size, under each launcher."""

import re
import time
from pathlib import Path

import pytest
import yaml
from joblib.externals.loky import get_reusable_executor

from posture.cli.jobs import Job, check
from posture.cli.sweep import SweepProgress, fraction_done, run_job, status
from posture.config.errors import ConfigError
from posture.config.train import TrainConfig
from posture.eval import only_current
from posture.storage import checkpoint, run_dir
from posture.storage.lock import locked
from tests.commands import ANY_FREQ, CONSTANT, SHORT, TINY, call, refused, same, table
from tests.conftest import compose

NO_FIGURES = "evaluation.figures=false"
SWEEP = ["-m", "experiment=energy", *TINY, *CONSTANT, NO_FIGURES, "env.energy_weight=0,5", "seed=1", "evaluation.freq=[0.5]"]
JOBLIB = ["hydra/launcher=joblib", "hydra.launcher.n_jobs=2"]
UNEVALUATED = [*SWEEP, "evaluate=false"]
SUBMITIT = ["hydra/launcher=submitit_local", "hydra.launcher.timeout_min=5"]


@pytest.fixture(autouse=True)
def _without_processes(elsewhere):
    yield
    get_reusable_executor().shutdown()  # joblib keeps its processes, which would stay in this test's folder


def folders(arguments=SWEEP):
    return [job.folder for job in check("train", TrainConfig, arguments).jobs]


def models():
    return {path: path.stat().st_mtime_ns for path in Path("runs").rglob("model_*.pt")}


def launchers(*others):
    """Hydra's basic launcher, and others in the slow tests."""
    slow = [pytest.param(launcher, marks=pytest.mark.slow, id=launcher[0].split("=")[1]) for launcher in others]
    return pytest.mark.parametrize("launcher", [pytest.param([], id="basic"), *slow])


@launchers(JOBLIB, SUBMITIT)
def test_a_sweep_under_each_launcher(monkeypatch, capsys, launcher):
    """Each job gets the folder that was known in advance; a second start trains nothing."""
    call(monkeypatch, "train", *SWEEP, *launcher)
    assert "sweep: 2 of 2 jobs done" in capsys.readouterr().out
    assert sorted(path for path in Path("runs/energy").iterdir() if path.is_dir() and path.name[0] != ".") == sorted(
        folders()
    )
    for folder in folders():
        assert (folder / "model_2.pt").exists() and (folder / "evaluation" / "metrics.csv").exists()
        assert status(folder)["state"] == "done"
    before = models()
    call(monkeypatch, "train", *SWEEP, *launcher)
    assert "2 of 2 jobs done, 2 of them before" in capsys.readouterr().out
    assert models() == before


def test_a_second_start_does_what_is_missing(monkeypatch, capsys):
    """An interrupted job continues from its last checkpoint; one that never started starts."""
    call(monkeypatch, "train", *UNEVALUATED, "env.energy_weight=5")
    (folder,) = folders([*UNEVALUATED, "env.energy_weight=5"])
    whole = (folder / "model_2.pt").read_bytes()
    (folder / "model_2.pt").unlink()
    (folder / "status.yaml").write_text("state: running\n")
    resume = checkpoint.load(folder / "resume.pt", "cpu")
    assert resume["iteration"] == 2
    call(monkeypatch, "train", *UNEVALUATED, "max_iterations=1", "env.energy_weight=5")
    (shorter,) = [path for path in Path("runs/energy").iterdir() if path.is_dir() and path != folder]
    for name in ("resume.pt", "model_1.pt"):
        (folder / name).write_bytes((shorter / name).read_bytes())  # as a kill after the first iteration leaves it
    capsys.readouterr()
    call(monkeypatch, "train", *UNEVALUATED)
    assert "sweep: 2 of 2 jobs done" in capsys.readouterr().out
    ours = checkpoint.load(folder / "model_2.pt", "cpu")["actor_state_dict"]
    (folder / "whole.pt").write_bytes(whole)
    theirs = checkpoint.load(folder / "whole.pt", "cpu")["actor_state_dict"]
    assert same(ours, theirs)
    assert len(yaml.safe_load((folder / "provenance.yaml").read_text())) == 2


@launchers(JOBLIB)
def test_a_failed_job_is_named_and_stops_no_other(monkeypatch, capsys, launcher):
    broken, sound = folders(UNEVALUATED)
    broken.mkdir(parents=True)
    (broken / "provenance.yaml").write_text("text")
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, "train", *UNEVALUATED, *launcher)
    printed = capsys.readouterr()
    assert stop.value.code == 1
    assert "sweep: 1 of 2 jobs done" in printed.out
    assert re.search(rf"failed: .*{broken.name}: .*provenance.yaml: not a list", printed.out)
    assert "Traceback" in (broken / "error.txt").read_text() and "Traceback" not in printed.out + printed.err
    assert (sound / "model_2.pt").exists() and not (sound / "error.txt").exists()
    (broken / "provenance.yaml").unlink()
    before = models()
    call(monkeypatch, "train", *UNEVALUATED, *launcher)
    assert "2 of 2 jobs done, 1 of them before" in capsys.readouterr().out
    assert not (broken / "error.txt").exists() and before.items() <= models().items()


@pytest.mark.slow
def test_two_by_two_of_the_grid(monkeypatch):
    grid = ["-m", "experiment=grid", "env.freq=0.2,0.5", "env.hip_k=50,150"]
    call(monkeypatch, "train", *grid, *ANY_FREQ, *CONSTANT, NO_FIGURES, "max_iterations=1")
    rows = [table(job / "evaluation" / "metrics.csv") for job in run_dir.runs_in(Path("runs/grid"))]
    cells = {(float(row["freq_hz"]), float(row["hip_k_nm_per_rad"])) for (row,) in rows}
    assert cells == {(0.2, 50.0), (0.2, 150.0), (0.5, 50.0), (0.5, 150.0)}


def test_a_wrong_value_is_refused_before_the_first_job(monkeypatch, capsys):
    assert "env.energy_weight = -5" in refused(monkeypatch, capsys, "train", *SWEEP, "env.energy_weight=5,-5")
    assert not Path("runs").exists()
    assert "experiment/speed" in refused(monkeypatch, capsys, "train", "-m", "experiment=speed")


def test_the_policies_of_a_sweep_in_every_experiment(monkeypatch, capsys):
    """Experiments without training take the policies of another and write to their own folder; repeated, they only read."""
    call(monkeypatch, "train", "-m", "experiment=frequency", *ANY_FREQ, *CONSTANT, "seed=1,2", "evaluate=false")
    evaluation = [*SHORT, NO_FIGURES]
    for experiment, name in (("load", "load-4"), ("ramp", "job")):
        change = ["env.load=0,4"] if experiment == "load" else []
        call(monkeypatch, "eval", "-m", f"experiment={experiment}", "ckpt=runs/frequency", *change, *evaluation)
        rows = table(Path("runs", experiment, name, "metrics.csv"))
        assert [row["seed"] for row in rows] == ["1", "2"]
    assert {"transition_centred_hz", "crossings_trailing"} <= rows[0].keys() and rows[0]["freq_hz"] == "nan"
    assert [row["load_kg"] for row in table(Path("runs/load/load-4/metrics.csv"))] == ["4", "4"]
    capsys.readouterr()
    call(monkeypatch, "eval", "-m", "experiment=load", "ckpt=runs/frequency", "env.load=4", *evaluation)
    assert capsys.readouterr().out.count("evaluated before") == 2
    for run in Path("runs/frequency").glob("seed-*"):
        (run / "status.yaml").write_text("state: failed\n")
    with pytest.raises(ConfigError, match="runs/frequency: no run in it is finished and of the current code"):
        run_dir.find_checkpoints("runs/frequency", only_current)


# -- progress ---------------------------------------------------------------------------------------------------


def job_with(folder, iterations=None, state=None):
    folder.mkdir()
    if iterations is not None:
        (folder / f"model_{iterations}.pt").touch()
    if state is not None:
        (folder / "status.yaml").write_text(f"state: {state}\n")
    return Job(compose("max_iterations=800"), folder)


def test_progress_is_that_of_the_newest_checkpoint(tmp_path):
    assert fraction_done(job_with(tmp_path / "new")) == 0.0
    assert fraction_done(job_with(tmp_path / "half", 400, "running")) == 0.5
    assert fraction_done(job_with(tmp_path / "trained", 800, "running")) == 0.99
    assert fraction_done(job_with(tmp_path / "done", 800, "done")) == 1.0


def test_time_left_by_the_speed_so_far(tmp_path, monkeypatch):
    """Of three equal jobs one was done before. Half of the second took 10 minutes, so the rest takes 30."""
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now)
    jobs = [job_with(tmp_path / "a", 800, "done"), job_with(tmp_path / "b"), job_with(tmp_path / "c")]
    progress = SweepProgress(jobs)
    assert progress.done_before == 1 and progress.line() == "1 of 3 done, 0 running"
    (tmp_path / "b" / "model_400.pt").touch()
    (tmp_path / "b" / "status.yaml").write_text("state: running\n")
    monkeypatch.setattr(time, "monotonic", lambda: now + 600)
    with locked(tmp_path / "b"):
        assert progress.line() == "1 of 3 done, 1 running, 30 min left"
    assert progress.line() == "1 of 3 done, 0 running, 30 min left"


def test_a_failure_keeps_its_traceback(tmp_path):
    def fail():
        raise ValueError("no\nsuch thing")

    run_job(fail, tmp_path / "job", to_log=True)
    assert status(tmp_path / "job")["error"] == "ValueError: no such thing"
    assert "in fail" in (tmp_path / "job" / "error.txt").read_text()
    assert "failed: ValueError" in (tmp_path / "job" / "log.txt").read_text()
