"""A folder that holds a training is started again only as that training; relative paths under hydra.job.chdir."""

import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from posture.cli.jobs import Job
from posture.cli.sweep import SweepProgress
from posture.storage import provenance, yaml_files
from tests.commands import EVALUATION, TINY, answer, call, refused, runs, table
from tests.conftest import compose
from tests.posture.storage.test_folders import held_by_another_process

pytestmark = pytest.mark.usefixtures("elsewhere")

QUICK = [*TINY, "evaluate=false"]


@pytest.fixture
def run(sound, tmp_path):
    """A finished run of `QUICK`, trained with the default values."""
    return shutil.copytree(sound, tmp_path / "run")


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file() and path.name != ".lock"}


@pytest.mark.parametrize(
    ("changes", "differences"),
    [
        (["env.hip_k=60", "seed=7"], ["env.hip_k = 125, not 60", "seed = 1, not 7"]),
        (["max_iterations=5", "env.energy_weight=0"], ["max_iterations = 2, not 5", "env.energy_weight = 20, not 0"]),
        (["max_iterations=1"], ["max_iterations = 2, not 1"]),
        (["processes=2", "agent.save_interval=2"], ["processes = 1, not 2", "agent.save_interval = 1, not 2"]),
    ],
)
def test_a_folder_of_another_training_is_refused(run, monkeypatch, capsys, changes, differences):
    before = contents(run)
    line = refused(monkeypatch, capsys, "train", *QUICK, f"hydra.run.dir={run}", *changes)
    assert f"{run}: holds another training (" in line and f"resume={run}" in line and "another folder" in line
    assert sorted(line.partition("(")[2].partition(")")[0].split("; ")) == sorted(differences)
    assert contents(run) == before


def test_keys_that_do_not_decide_the_policy_may_differ(run):
    for change in ("threads=2", "evaluate=true", "evaluation.duration=3", "evaluation.freq=[0.6]"):
        assert answer("train", *QUICK, f"hydra.run.dir={run}", change)[0] == 0, change


def test_another_evaluation_of_the_same_training(run, monkeypatch, capsys):
    again = ["train", *TINY, f"hydra.run.dir={run}", "evaluation.freq=[0.6]", "evaluation.figures=false"]
    models = {path: path.read_bytes() for path in run.glob("model_*")}
    call(monkeypatch, *again)
    assert "already trained" in capsys.readouterr().out
    assert [row["freq_hz"] for row in table(run / "evaluation" / "metrics.csv")] == ["0.6"]
    assert {path: path.read_bytes() for path in run.glob("model_*")} == models


def test_a_sweep_with_another_fixed_key_is_refused_before_its_first_job(run, monkeypatch, capsys, tmp_path):
    sweep = ["train", "-m", *QUICK, "env.hip_k=100,125", "hydra.sweep.dir=sweep"]
    shutil.copytree(run, tmp_path / "sweep" / "1_hip_k-125")
    assert answer(*sweep)[0] == 0
    before = contents(tmp_path / "sweep")
    line = refused(monkeypatch, capsys, *sweep, "env.load=2")
    assert "sweep/1_hip_k-125: holds another training (env.load = 0, not 2)" in line
    assert contents(tmp_path / "sweep") == before


def test_other_code_or_libraries_are_another_training(run, monkeypatch, capsys):
    (start,) = yaml.safe_load((run / "provenance.yaml").read_text())
    start["training_code"] = "0123456789ab"
    start["versions"]["torch"] = "1.0"
    yaml_files.write_yaml(run / "provenance.yaml", [start])
    line = refused(monkeypatch, capsys, "train", *QUICK, f"hydra.run.dir={run}")
    assert f"training code 0123456789ab, not {provenance.training_code()}" in line and "torch 1.0, not " in line
    call(monkeypatch, "train", f"resume={run}", "max_iterations=3")
    assert "begun with other code or libraries: training code 0123456789ab" in capsys.readouterr().out


def test_a_folder_without_a_checkpoint_is_free(run, monkeypatch):
    for file in [*run.glob("model_*"), run / "resume.pt"]:
        file.unlink()
    (start,) = provenance.starts(run)
    yaml_files.write_yaml(run / "provenance.yaml", [start | {"training_code": "0123456789ab"}])
    call(monkeypatch, "train", *QUICK, f"hydra.run.dir={run}", "env.hip_k=60")
    assert provenance.other_code(run) == []  # the start that saved nothing does not count


def test_checkpoints_without_the_state_of_their_training_are_kept(run, monkeypatch, capsys):
    """The training cannot go on; if it is complete, it is not repeated."""
    (run / "resume.pt").unlink()
    again = ["train", *QUICK, f"hydra.run.dir={run}"]
    before = contents(run)
    call(monkeypatch, *again)
    assert "already trained" in capsys.readouterr().out and contents(run) == before
    (run / "model_2.pt").unlink()
    before = contents(run)
    assert f"{run}: holds checkpoints without resume.pt" in refused(monkeypatch, capsys, *again)
    shutil.copytree(run, "sweep/0_seed-1")
    sweep = ["train", "-m", *QUICK, "seed=1,2", "hydra.sweep.dir=sweep"]
    assert "sweep/0_seed-1: holds checkpoints without resume.pt" in refused(monkeypatch, capsys, *sweep)
    assert contents(run) == before


def test_a_run_is_resumed_in_its_own_folder(run, monkeypatch, capsys):
    line = refused(monkeypatch, capsys, "train", f"resume={run}", "max_iterations=3", "hydra.run.dir=other")
    assert "a resumed run stays in its folder" in line and not Path("other").exists()
    assert refused(monkeypatch, capsys, "train", "resume=nope").startswith("error: nope: not a run folder")


def test_another_training_is_refused_before_torch_is_imported(run):
    script = (
        "import sys; from posture.train import main\n"
        "try: main()\n"
        "except SystemExit as stop: print(stop.code, 'torch' in sys.modules)"
    )
    for arguments in ([*QUICK, f"hydra.run.dir={run}", "seed=7"], [f"resume={run}", "seed=7"]):
        done = subprocess.run([sys.executable, "-c", script, *arguments], capture_output=True, text=True)
        assert done.stdout == "2 False\n", done.stderr


def test_relative_paths_under_chdir(run, monkeypatch, capsys):
    """They are relative to the directory of the start, and jobs are counted as without it."""
    chdir = ["hydra.job.chdir=true", *EVALUATION, "evaluation.figures=false"]
    call(monkeypatch, "eval", "-m", "ckpt=run", "env.load=0,4", "out=sweep", *chdir)
    printed = capsys.readouterr().out
    assert "sweep: 2 of 2 done, 0 running" in printed and "sweep: 2 of 2 jobs done" in printed
    assert len(list(Path("sweep").glob("*/**/metrics.csv"))) == 2
    call(monkeypatch, "train", "resume=run", "max_iterations=3", "hydra.job.chdir=true")
    assert (run / "model_3.pt").is_file() and not (run / "run").exists()
    call(monkeypatch, "export", "ckpt=run", "what=[trajectories]", "out=there", "hydra.job.chdir=true", EVALUATION[0])
    assert list(Path("there").iterdir()) and not Path("there/there").exists()


def test_a_killed_job_is_not_counted_as_running(tmp_path):
    job = Job(compose(), tmp_path / "job")
    with held_by_another_process(job.folder):
        yaml_files.write_yaml(job.folder / "status.yaml", {"state": "running"})
        assert SweepProgress([job]).line() == "0 of 1 done, 1 running"
    assert SweepProgress([job]).line() == "0 of 1 done, 0 running"


def test_a_stopped_evaluation_leaves_no_empty_folder(tmp_path):
    arguments = ["ckpt=pretrained", "evaluation.duration=1000", "evaluation.freq=[0.6]"]
    process = subprocess.Popen(
        [sys.executable, "-m", "posture.eval", *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    deadline = time.monotonic() + 60.0
    while not runs():
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.1)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == 143 and runs() == [] and list(tmp_path.iterdir()) == []
