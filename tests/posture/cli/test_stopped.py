"""Trainings stopped by a signal, a kill or a full disk: what was saved stays whole, and resume continues exactly."""

import contextlib
import errno
import itertools
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
import uuid
from pathlib import Path

import pytest
from tensorboard.summary.writer.record_writer import RecordWriter

from posture.cli import signals
from posture.cli.sweep import status
from posture.learning.resume import iterations_done
from posture.storage import atomic, checkpoint, run_dir
from posture.storage.lock import is_busy
from tests.commands import CONSTANT, TINY, call, refused, same

pytestmark = pytest.mark.usefixtures("elsewhere")

PLAIN = [*TINY, "evaluate=false", "env.num_envs=16"]
FOREVER = "max_iterations=1000000"
RARE = "agent.save_interval=1000000"
LIMIT_S = 180
"""On a busy machine two processes take half a minute to start."""
UNTIL_ALL_TRAIN_S = 1.0
"""The first process opens its log before it trains; the others may be a moment behind."""


@contextlib.contextmanager
def started(*arguments):
    """`python -m posture.train arguments` as the leader of its own process group, as a shell starts it."""
    command = [sys.executable, "-m", "posture.train", *arguments]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        if not process.stdout.closed:
            process.communicate()


def wait_for(condition, process):
    deadline = time.monotonic() + LIMIT_S
    while not (found := condition()):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline, "the training does not get there"
        time.sleep(0.02)
    return found


def wait_until_group_ends(group):
    """Raises ProcessLookupError as soon as no process of the group is left."""
    for _ in range(500):
        os.killpg(group, 0)
        time.sleep(0.02)


def train(*arguments):
    """A training in its own process."""
    command = [sys.executable, "-m", "posture.train", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S)
    assert done.returncode == 0, done.stderr


def comparable(run):
    """What resume.pt of `run` holds, without the time that the training took and the length that it began with."""
    state = checkpoint.load(run / "resume.pt", "cpu")
    for process in state["processes"]:
        del process["logger"]["tot_time"]
        process["env"].pop("training_steps", None)
    return state


def equal(one, other, iterations):
    """Whether two runs have the same policy, value function, optimiser and state for a resume."""
    models = [checkpoint.load(run / f"model_{iterations}.pt", "cpu") for run in (one, other)]
    return same(*models) and same(comparable(one), comparable(other))


def steps(run):
    """The steps of `run` that TensorBoard shows, in order."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    return [event.step for event in EventAccumulator(str(run)).Reload().Scalars("/cost")]


# -- signals -------------------------------------------------------------------------------------------------------------


def stop_and_resume(monkeypatch, number, processes, to_all):
    """Stop a training by a signal, resume it for two iterations, and compare with one that never stopped."""
    shared, run = [*PLAIN, *CONSTANT, f"processes={processes}", RARE], Path("stopped")
    with started(*shared, FOREVER, f"hydra.run.dir={run}") as process:
        wait_for(lambda: list(run.glob("events.out.*")), process)
        time.sleep(UNTIL_ALL_TRAIN_S)
        (os.killpg if to_all else os.kill)(process.pid, number)
        out, err = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 128 + number, err
    assert "Traceback" not in out + err and "stopped after iteration" in out
    assert not is_busy(run)
    (model,) = run.glob("model_*.pt")  # saved because of the signal, since no other save was due
    done = run_dir.iteration_of(model)
    assert iterations_done(run) == done and steps(run) == list(range(1, done + 1))
    call(monkeypatch, "train", f"resume={run}", f"max_iterations={done + 2}")
    call(monkeypatch, "train", *shared, f"max_iterations={done + 2}", "hydra.run.dir=whole")
    assert equal(run, Path("whole"), done + 2)
    assert steps(run) == steps(Path("whole")) == list(range(1, done + 3))


def test_a_signal_ends_the_iteration_and_saves(monkeypatch):
    stop_and_resume(monkeypatch, signal.SIGTERM, 1, to_all=False)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX only")
@pytest.mark.parametrize("processes", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_closed_terminal_ends_the_iteration_and_saves(processes):
    """It sends SIGHUP to all processes, more than once, and its output is gone."""
    with started(*PLAIN, f"processes={processes}", RARE, FOREVER, "hydra.run.dir=hung_up") as process:
        wait_for(lambda: list(Path("hung_up").glob("events.out.*")), process)
        time.sleep(UNTIL_ALL_TRAIN_S)
        process.stdout.close()
        process.stderr.close()
        for _ in range(3):
            os.killpg(process.pid, signal.SIGHUP)
            time.sleep(0.01)
        assert process.wait(LIMIT_S) == 129
    (model,) = Path("hung_up").glob("model_*.pt")
    assert iterations_done(Path("hung_up")) == run_dir.iteration_of(model) and not is_busy(Path("hung_up"))


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX only")
def test_under_nohup_a_closed_terminal_changes_nothing():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with signals.deferred():
            os.kill(os.getpid(), signal.SIGHUP)
            assert not signals.pending()
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "to_all"), [(signal.SIGINT, True), (signal.SIGTERM, True), (signal.SIGTERM, False)])
def test_a_signal_stops_both_processes_after_the_same_iteration(monkeypatch, number, to_all):
    stop_and_resume(monkeypatch, number, 2, to_all)


@pytest.mark.slow
def test_a_second_signal_ends_at_once_and_what_is_saved_stays():
    run = Path("twice")
    train(*PLAIN, "max_iterations=1", f"hydra.run.dir={run}")
    kept = {path: path.read_bytes() for path in run.glob("*.pt")}
    # From now on its iterations are too long to end by themselves.
    config = (run / "config.yaml").read_text()
    (run / "config.yaml").write_text(config.replace("num_steps_per_env: 4", "num_steps_per_env: 100000"))
    with started(f"resume={run}", FOREVER) as process:
        wait_for(lambda: len(list(run.glob("events.out.*"))) == 2, process)
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        time.sleep(1.0)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 130 and "Traceback" not in err and "a second signal stops at once" in err
    assert kept == {path: path.read_bytes() for path in run.glob("*.pt")}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "to_all", "moment"), [(signal.SIGINT, True, 0.0), (signal.SIGINT, True, 5.0), (signal.SIGKILL, False, 5.0)]
)
def test_an_end_before_the_first_iteration(number, to_all, moment):
    """Of two processes, while the second one starts: none is left running, and none reports an error."""
    with started(*PLAIN, FOREVER, "processes=2", "hydra.run.dir=early") as process:
        wait_for(lambda: Path("early/.lock").exists(), process)
        time.sleep(moment)
        (os.killpg if to_all else os.kill)(process.pid, number)
        _, err = process.communicate(timeout=LIMIT_S)
        assert process.returncode == (130 if number == signal.SIGINT else -signal.SIGKILL)
        assert "Traceback" not in err, err
        with pytest.raises(ProcessLookupError):
            wait_until_group_ends(process.pid)


@pytest.mark.slow
def test_a_sweep_stops_with_its_job_saved():
    sweep = ["-m", "experiment=energy", *PLAIN, "env.energy_weight=0,5", "seed=1", RARE]
    with started(*sweep, FOREVER) as process:
        wait_for(lambda: list(Path("runs/energy").glob("*/events.out.*")), process)
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 130 and "Traceback" not in out + err, err
    (job,) = run_dir.runs_in(Path("runs/energy"))  # the second one never started
    assert status(job)["state"] == "running" and not is_busy(job)
    assert iterations_done(job) == run_dir.iteration_of(run_dir.newest_model(job))


# -- a job of a sweep ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_job_of_a_sweep_equals_the_same_training_alone(monkeypatch):
    """The second job of a sweep, in a process that has already trained another, and the same in its own process."""
    call(monkeypatch, "train", "-m", *PLAIN, "env.hip_k=50,150", "seed=3", "hydra.sweep.dir=sweep")
    other, job = run_dir.runs_in(Path("sweep"))
    train(*PLAIN, "env.hip_k=150", "seed=3", "hydra.run.dir=alone")
    assert equal(job, Path("alone"), 2) and not equal(other, Path("alone"), 2)


# -- kills and full disks ------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("processes", [1, 2])
def test_kills_at_random_moments(processes):
    """After each kill the newest checkpoint loads, nothing is left running or locked, and the training can be resumed."""
    moments, run = random.Random(processes), Path("killed")
    shared = [*PLAIN, *CONSTANT, f"processes={processes}"]
    train(*shared, "max_iterations=1", f"hydra.run.dir={run}")
    for _ in range(6):
        before = iterations_done(run)
        with started(f"resume={run}", FOREVER) as process:
            wait_for(lambda b=before: checkpoint.load(run / "resume.pt", "cpu")["iteration"] > b, process)
            time.sleep(moments.uniform(0.0, 0.3))
            process.kill()
            process.wait()
            with pytest.raises(ProcessLookupError):
                wait_until_group_ends(process.pid)
        assert not is_busy(run)
        done, newest = iterations_done(run), run_dir.newest_model(run)
        assert done > before and checkpoint.load(newest, "cpu")["iter"] == run_dir.iteration_of(newest) >= done
    train(f"resume={run}", f"max_iterations={done + 1}")
    train(*shared, f"max_iterations={done + 1}", RARE, "hydra.run.dir=whole")
    assert equal(run, Path("whole"), done + 1)
    assert not list(run.glob(".*.tmp"))


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """Runs of two and of four iterations, `begun` and `whole`, made once; tests change copies of the former."""
    folder = tmp_path_factory.mktemp("trained")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        call(patch, "train", *PLAIN, *CONSTANT, "hydra.run.dir=begun")
        call(patch, "train", *PLAIN, *CONSTANT, "max_iterations=4", "hydra.run.dir=whole")
    return folder


@pytest.fixture
def begun(trained):
    return Path(shutil.copytree(trained / "begun", "begun"))


@pytest.fixture
def saving(monkeypatch):
    """The names of the checkpoints whose save has begun; temporary files do not show them."""
    names, save = [], checkpoint.save
    monkeypatch.setattr(checkpoint, "save", lambda content, path: (names.append(path.name), save(content, path)))
    return names


class Cut(BaseException):
    """The moment at which a process is killed."""


@pytest.mark.parametrize("name", ["model_3.pt", "resume.pt"])
@pytest.mark.parametrize("moment", ["before the file is renamed", "before the file is written", "after it is renamed"])
def test_an_interrupted_save_loses_nothing(trained, begun, saving, monkeypatch, name, moment):
    """After a kill at that moment the run continues from what resume.pt says, exactly."""
    with monkeypatch.context() as patch:
        replace, write = os.replace, Path.write_bytes

        def cut_replace(source, target):
            if Path(target).name == name and "before" in moment:
                raise Cut
            replace(source, target)
            if Path(target).name == name:
                raise Cut

        def cut_write(path, content):
            if "written" in moment and saving[-1] == name:
                write(path, content[: len(content) // 2])
                raise Cut
            return write(path, content)

        patch.setattr(os, "replace", cut_replace)
        patch.setattr(Path, "write_bytes", cut_write)
        patch.setattr(Path, "unlink", lambda *_, **__: None)  # a killed process removes nothing
        with pytest.raises(Cut):
            call(patch, "train", f"resume={begun}", "max_iterations=4")
    done = 3 if (name, moment) == ("resume.pt", "after it is renamed") else 2
    assert iterations_done(begun) == done
    temporary = list(begun.glob(".*.tmp"))
    assert bool(temporary) == ("before" in moment) and run_dir.newest_model(begun) not in temporary
    call(monkeypatch, "train", f"resume={begun}", "max_iterations=4")
    assert equal(begun, trained / "whole", 4) and not list(begun.glob(".*.tmp"))
    assert steps(begun) == [1, 2, 3, 4]


def test_the_last_checkpoint_is_written_once(begun, saving, monkeypatch):
    call(monkeypatch, "train", f"resume={begun}", "max_iterations=3")
    assert saving == ["model_3.pt", "resume.pt"]


def test_temporary_files_are_removed_by_the_next_start_and_others_kept(begun, monkeypatch, capsys):
    """Unless another process is training in the folder, whose files they may be."""
    temporary, other = begun / ".posture-1.tmp", begun / ".mine.tmp"
    temporary.write_bytes(b"half")
    other.write_bytes(b"another program's")
    assert run_dir.newest_model(begun).name == "model_2.pt"
    code = (
        "import pathlib, sys; from posture.storage.lock import locked\n"
        "with locked(pathlib.Path('begun')): print('locked', flush=True); sys.stdin.read()"
    )
    holder = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert holder.stdout.readline() == b"locked\n"
    assert "another process" in refused(monkeypatch, capsys, "train", f"resume={begun}", "max_iterations=3")
    assert temporary.exists()
    holder.communicate()
    call(monkeypatch, "train", f"resume={begun}", "max_iterations=3")
    assert not temporary.exists() and other.exists()


@pytest.mark.parametrize("name", ["model_3.pt", "resume.pt"])
def test_a_full_disk_is_one_line_and_loses_nothing_saved(begun, saving, monkeypatch, capfd, name):
    kept = {path: path.read_bytes() for path in begun.glob("*.pt")}
    write = Path.write_bytes

    def full(path, content):
        if saving[-1] == name:
            write(path, content[:100])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(path, content)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        capfd.readouterr()
        with pytest.raises(SystemExit) as stop:
            call(patch, "train", f"resume={begun}", "max_iterations=4")
    assert stop.value.code == 1
    assert capfd.readouterr().err.strip() == f"error: {begun.absolute() / name}: No space left on device"
    assert {path: path.read_bytes() for path in kept} == kept
    assert iterations_done(begun) == 2 and not list(begun.glob(".*.tmp"))
    call(monkeypatch, "train", f"resume={begun}", "max_iterations=4")
    assert iterations_done(begun) == 4


@pytest.mark.parametrize("written", [0, 30])
def test_a_log_that_cannot_be_written_does_not_end_the_training(trained, begun, monkeypatch, capfd, written):
    """After `written` values of its TensorBoard log, by a thread whose traceback is not shown."""
    write, calls = RecordWriter.write, itertools.count()

    def full(writer, data):
        if next(calls) >= written:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(writer, data)

    hook = threading.excepthook
    with monkeypatch.context() as patch:
        patch.setattr(RecordWriter, "write", full)
        capfd.readouterr()
        call(patch, "train", f"resume={begun}", "max_iterations=4")
    (line,) = capfd.readouterr().err.strip().splitlines()
    assert line.startswith(f"{begun.absolute()}: the training goes on without its TensorBoard log")
    assert line.endswith("cannot be written: No space left on device")
    assert equal(begun, trained / "whole", 4) and threading.excepthook is hook


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_an_error_of_the_system_names_the_file_that_was_to_be_written(tmp_path, monkeypatch):
    """By a device that is always full."""
    monkeypatch.setattr(atomic.uuid, "uuid4", lambda: uuid.UUID(int=1))
    (tmp_path / f".posture-{uuid.UUID(int=1).hex}.tmp").symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left on device") as full:
        checkpoint.save({"iter": 1}, tmp_path / "model_1.pt")
    assert full.value.filename == str(tmp_path / "model_1.pt") and list(tmp_path.iterdir()) == []
