"""Runs and jobs write only into their own folders, whatever their names, and one process at a time."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from posture.cli.jobs import check
from posture.cli.sweep import run_job, status
from posture.config.errors import ConfigError
from posture.config.train import TrainConfig
from posture.storage import run_dir, yaml_files
from posture.storage.lock import is_busy, locked
from tests.commands import EVALUATION, TINY, call, refused, runs

QUICK = [*TINY, "max_iterations=1", "evaluate=false"]
NAMES = ["two words, a=b größe 人", "-it's {x} #%41..dots"]


@pytest.fixture(autouse=True)
def _other_folder(tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")


def quoted(text):
    """`text` as a value that Hydra reads unchanged."""
    return "'" + str(text).replace("'", "\\'") + "'"


def tree(top):
    return {path.relative_to(top) for path in top.rglob("*")}


# -- invalid folders -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("folder", ["/proc/x", "file", "file/sub", "/sys/x/y", "hanging"])
def test_a_folder_that_cannot_be_written_is_refused(monkeypatch, capsys, folder):
    Path("file").write_text("mine")
    Path("hanging").symlink_to("/nowhere/at/all")
    before = tree(Path.cwd())
    for arguments in (
        ["train", *QUICK, f"hydra.run.dir={folder}"],
        ["train", "-m", *QUICK, f"hydra.sweep.dir={folder}"],
        ["eval", "ckpt=pretrained", f"out={folder}"],
        ["reproduce", f"out={folder}"],
    ):
        line = refused(monkeypatch, capsys, *arguments)
        assert f"cannot write to the folder {folder}" in line
    assert tree(Path.cwd()) == before and Path("file").read_text() == "mine"


def test_a_read_only_folder_is_refused(monkeypatch, capsys):
    """Root may write anywhere, so the error of the file system is raised by hand."""

    def deny(*_, dir, **__):
        raise PermissionError(13, "Permission denied", str(dir))

    monkeypatch.setattr("tempfile.TemporaryFile", deny)
    for arguments in (["train", *QUICK], ["train", "-m", *QUICK], ["eval", "ckpt=pretrained", "out=there"]):
        assert "cannot write to the folder" in (line := refused(monkeypatch, capsys, *arguments))
        assert line.endswith("Permission denied")


@pytest.mark.parametrize(
    ("arguments", "file"),
    [
        (["eval", "ckpt=pretrained", "out=out"], "metrics.csv"),
        (["eval", "policy=lqr", "evaluation.freq=[0.5]", "out=out"], "trial.yaml"),
        (["export", "what=[trajectories]", "evaluation.freq=[0.5]", "out=out"], "trajectory_0.5Hz.csv"),
        (["export", "what=[policy]", "out=out"], "policy.onnx"),
        (["export", "evaluation.freq=[0.5]", "out=out"], "policy.onnx"),
        (["eval", "ckpt=pretrained", "evaluation.freq=[0.5]", "out=out"], "tracking.png"),
        (["eval", "policy=lqr", "evaluation.freq=[0.5]", "out=out"], "joint_angles.png"),
        (["theory", "out=out"], "theory_map.png"),
        (["theory", "out=out"], "figure_13.csv"),
        (["film", "films=[ramp]", "formats=[gif]", "out=out"], "ramp.gif"),
        (["play", "record=out/session.html"], "session.html"),
        (["reproduce", "out=out"], "report.html"),
        (["reproduce", "out=out"], "tables/ramp.csv"),
        (["reproduce", "out=out"], "figures/figure_5.png"),
    ],
)
def test_a_folder_in_the_place_of_a_file_is_refused_before_the_work(monkeypatch, capsys, arguments, file):
    (Path("out") / file).mkdir(parents=True)
    before = tree(Path.cwd())
    assert f"out/{file}: Is a directory" in refused(monkeypatch, capsys, *arguments)
    assert tree(Path.cwd()) == before


@pytest.mark.parametrize(
    ("arguments", "path"),
    [
        (["seed=1", "out=out"], "out/config.yaml"),
        (["seed=1", "out=out"], "out/model_1.pt"),
        (["seed=1", "out=out"], "out/.lock"),
        (["-m", "seed=1,2", "out=out"], "out/1_seed-2/provenance.yaml"),
        (["-m", "seed=1,2", "out=out"], "out/1_seed-2/status.yaml"),
        (["-m", "seed=1,2", "out=out"], "out/1_seed-2/error.txt"),
        (["-m", "seed=1,2", "out=out"], "out/1_seed-2/log.txt"),
    ],
)
@pytest.mark.parametrize(("make", "why"), [(Path.mkdir, "Is a directory"), (os.mkfifo, "A pipe or a device")])
def test_a_folder_or_a_pipe_in_the_place_of_a_file_of_a_training(monkeypatch, capsys, arguments, path, make, why):
    Path(path).parent.mkdir(parents=True)
    make(Path(path))
    before = tree(Path.cwd())
    assert f"{path}: {why}" in refused(monkeypatch, capsys, "train", *QUICK, *arguments)
    assert tree(Path.cwd()) == before


def test_a_file_in_the_place_of_the_evaluation_is_refused_before_the_training(monkeypatch, capsys):
    Path("out").mkdir()
    Path("out/evaluation").touch()
    line = refused(monkeypatch, capsys, "train", *QUICK, "evaluate=true", "out=out")
    assert "cannot write to the folder out/evaluation: Not a directory" in line and runs() == []


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_a_pipe_in_the_place_of_a_yaml_file_is_not_read(tmp_path):
    os.mkfifo(tmp_path / "status.yaml")
    assert yaml_files.read_yaml(tmp_path / "status.yaml") is None
    for path in (tmp_path / "status.yaml", Path("/dev/zero")):
        with pytest.raises(ConfigError, match=r"cannot be read \(not a file\)"):
            yaml_files.read(path)


def test_a_file_name_that_is_too_long_for_the_file_system_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="cannot write the file .*: File name too long"):
        run_dir.writable(tmp_path, "x" * 300)


def test_an_empty_sweep_is_refused(monkeypatch, capsys):
    assert "the sweep is empty" in refused(monkeypatch, capsys, "train", "-m", *QUICK, "seed=range(1,1)")
    assert runs() == []


@pytest.mark.parametrize("swept", ["seed=1,1", "env.hip_k=25,25.0"])
def test_jobs_that_would_do_the_same_are_refused(monkeypatch, capsys, swept):
    line = refused(monkeypatch, capsys, "train", "-m", *QUICK, swept)
    assert "two jobs of the sweep would do the same" in line and line.endswith("give each value once") and runs() == []


def test_jobs_have_different_folders_within_the_sweep(monkeypatch, capsys, tmp_path):
    sweep = ["train", "-m", *QUICK, "seed=1,2"]
    assert "would have the folder" in refused(monkeypatch, capsys, *sweep, "hydra.sweep.subdir=same")
    assert "does not lie within" in refused(monkeypatch, capsys, *sweep, "hydra.sweep.subdir=../../x")
    again = ["train", "-m", "experiment=energy", *QUICK, "seed=1,1", "env.energy_weight=5"]
    assert "give each value once" in refused(monkeypatch, capsys, *again)
    assert tree(tmp_path) == {Path("here")}


# -- names -----------------------------------------------------------------------------------------------------------


def test_any_folder_name(monkeypatch, tmp_path):
    """A run is trained, resumed and evaluated in a folder of any name, and nothing is written elsewhere."""
    for name in NAMES:
        run = Path("runs") / name
        call(monkeypatch, "train", *QUICK, f"hydra.run.dir={quoted(run)}")
        assert (run / "model_1.pt").is_file()
        call(monkeypatch, "train", f"resume={quoted(run)}", "max_iterations=2")
        call(monkeypatch, "eval", f"ckpt={quoted(run / 'model_2.pt')}", *EVALUATION, "evaluation.figures=false")
        assert (run / "model_2.pt").is_file() and (run / "evaluation" / "metrics.csv").is_file()
    assert sorted(path.name for path in Path("runs").iterdir()) == sorted(NAMES)
    assert list(tmp_path.iterdir()) == [tmp_path / "here"] and list(Path.cwd().iterdir()) == [Path.cwd() / "runs"]


def test_a_path_upwards(monkeypatch, tmp_path):
    call(monkeypatch, "train", *QUICK, "hydra.run.dir=../there/run")
    assert (tmp_path / "there" / "run" / "model_1.pt").is_file()
    assert list(Path.cwd().iterdir()) == []


# -- several processes------------------------------------------------------------------------------------------------

NAME = "from posture.storage.run_dir import folder_for; from pathlib import Path; print('ready', flush=True); input(); \
f = folder_for('runs', None); Path(f).mkdir(parents=True); print(f)"


def test_runs_started_at_the_same_time_have_different_folders():
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    started = [subprocess.Popen([sys.executable, "-c", NAME], **pipes) for _ in range(4)]
    assert [process.stdout.readline() for process in started] == 4 * ["ready\n"]
    for process in started:
        print(file=process.stdin, flush=True)
    folders = [process.communicate(timeout=60)[0].strip() for process in started]
    assert all(process.returncode == 0 for process in started) and len(set(folders)) == 4
    assert len({folder.rsplit("_", 1)[0] for folder in folders}) <= 2, "they should be named in the same second"


HOLD = "import sys, time; from pathlib import Path; from posture.storage.lock import locked\n\
with locked(Path(sys.argv[1])): print('held', flush=True); time.sleep(100)"


@contextlib.contextmanager
def held_by_another_process(folder):
    with subprocess.Popen([sys.executable, "-c", HOLD, str(folder)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        try:
            yield
        finally:
            process.kill()  # it has no chance to clean up


def test_a_folder_is_refused_until_the_process_that_uses_it_ends(monkeypatch, capsys):
    job = Path("job")
    with held_by_another_process(job):
        assert is_busy(job)
        with pytest.raises(ConfigError, match="another process is using this folder"), locked(job):
            pass
        line = refused(monkeypatch, capsys, "train", *QUICK, f"hydra.run.dir={job}")
        assert "another process is using this folder" in line and not (job / "config.yaml").exists()
    assert not is_busy(job)
    with locked(job), locked(job):
        assert not is_busy(job)
    call(monkeypatch, "train", *QUICK, f"hydra.run.dir={job}")
    assert (job / "model_1.pt").is_file()


@pytest.mark.parametrize("command", ["eval", "eval policy=lqr", "export", "film", "theory", "reproduce"])
def test_no_command_writes_into_a_folder_that_another_process_uses(monkeypatch, capsys, command):
    """The refusal comes before any work: the folder stays as it is."""
    name, *arguments = command.split()
    policy = ["ckpt=pretrained"] if command in ("eval", "export", "film") else []
    with held_by_another_process(Path("results")):
        line = refused(monkeypatch, capsys, name, *arguments, *policy, "out=results")
    assert "results: another process is using this folder" in line
    assert [path.name for path in Path("results").iterdir()] == [".lock"]


def test_the_evaluation_of_a_run_is_that_of_one_process(sound, monkeypatch, capsys, tmp_path):
    """Its folder is locked, not that of the run, which may still be in training."""
    run = shutil.copytree(sound, tmp_path / "run")
    with held_by_another_process(run / "evaluation"):
        for command in (
            ["eval", f"ckpt={run}", *EVALUATION],
            ["train", *QUICK, "max_iterations=2", "evaluate=true", f"out={run}"],
        ):
            line = refused(monkeypatch, capsys, *command)
            assert line.startswith(f"error: {run}/evaluation: another process is using this folder")
        assert [path.name for path in (run / "evaluation").iterdir()] == [".lock"]
    with held_by_another_process(run):
        call(monkeypatch, "eval", f"ckpt={run}", *EVALUATION, "evaluation.figures=false")
    names = {path.name for path in (run / "evaluation").iterdir()}
    assert names == {"metrics.csv", "table.md", "trajectories.npz", "trial.yaml"}


def test_a_lock_leaves_nothing_behind():
    with locked(Path("new/folder")), locked(Path("new/folder")):
        assert Path("new/folder/.lock").exists()
    assert not Path("new").exists()
    Path("kept").mkdir()
    with locked(Path("kept")):
        pass
    assert not list(Path("kept").iterdir())


def test_a_job_of_another_process_is_skipped(capsys):
    job = Path("job")
    with held_by_another_process(job):
        (job / "status.yaml").write_text("state: running\nbegan: theirs\n")
        run_job(lambda: pytest.fail("it ran"), job, to_log=False)
    assert "skipped" in capsys.readouterr().out
    assert status(job) == {"state": "running", "began": "theirs"}


def test_a_sweep_names_the_job_of_another_process(monkeypatch, capsys):
    sweep = ["-m", "experiment=energy", *QUICK, "env.energy_weight=0,5", "seed=1"]
    first, second = (job.folder for job in check("train", TrainConfig, sweep).jobs)
    with held_by_another_process(first), pytest.raises(SystemExit) as stop:
        call(monkeypatch, "train", *sweep)
    output = capsys.readouterr().out
    assert stop.value.code == 1 and "sweep: 1 of 2 jobs done" in output
    assert f"failed: {first}: another process is running it" in output
    assert not (first / "config.yaml").exists() and status(second)["state"] == "done"
    call(monkeypatch, "train", *sweep)
    assert "2 of 2 jobs done, 1 of them before" in capsys.readouterr().out


def test_ctrl_c_in_a_job_keeps_its_state_and_releases_its_lock(tmp_path):
    def interrupt():
        raise KeyboardInterrupt

    for before in ("done", "running"):
        yaml_files.write_yaml(tmp_path / before / "status.yaml", {"state": before})
        with pytest.raises(KeyboardInterrupt):
            run_job(interrupt, tmp_path / before, to_log=True)
        assert status(tmp_path / before)["state"] == before and not is_busy(tmp_path / before)


@pytest.mark.slow
def test_an_interrupted_sweep_keeps_the_jobs_that_are_done():
    """Ctrl-C in the second of two jobs: the first stays done, and the same command does the second."""
    sweep = [sys.executable, "-m", "posture.train", "-m", "experiment=energy", *QUICK, "env.energy_weight=0,5", "seed=1"]
    long = [*(a for a in sweep if not a.startswith("max_iterations")), "max_iterations=1", "env.energy_weight=0"]
    subprocess.run(long, check=True, capture_output=True)
    (done,) = run_dir.runs_in(Path("runs/energy"))
    kept = (done / "model_1.pt").stat().st_mtime_ns
    # The second job has so many samples per iteration that it does not finish.
    second = [*sweep, "agent.num_steps_per_env=100000", "env.energy_weight=5"]
    process = subprocess.Popen(second, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60
    while not list(Path("runs/energy").glob("*/events.out.*"))[1:] and time.monotonic() < deadline:
        time.sleep(0.1)
    for _ in range(2):  # the first would let the iteration end
        time.sleep(2.0)
        process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 130
    states = {path.name: status(path)["state"] for path in Path("runs/energy").iterdir() if path.is_dir()}
    assert states.pop(done.name) == "done" and list(states.values()) == ["running"]
    assert (done / "model_1.pt").stat().st_mtime_ns == kept
    assert not any(is_busy(path) for path in Path("runs/energy").iterdir() if path.is_dir())
    again = subprocess.run(sweep, check=True, capture_output=True, text=True)
    assert "sweep: 2 of 2 jobs done, 1 of them before" in again.stdout
    assert yaml.safe_load((done / "status.yaml").read_text())["state"] == "done"


@pytest.mark.skipif(sys.platform == "win32", reason="there a working directory cannot be deleted")
def test_a_deleted_working_directory(tmp_path, monkeypatch, capsys):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert refused(monkeypatch, capsys, "train") == "error: the working directory has been deleted"
