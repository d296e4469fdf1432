"""An evaluation while a training runs: it reads complete files, is reproducible, and changes no file of the run."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch

from posture.storage import checkpoint
from posture.storage.run_dir import iteration_of, newest_model
from tests.commands import CONSTANT, SHORT, TINY, call, runs

LEARNING = [
    *(a for a in TINY if "max_iterations" not in a and "save_interval" not in a),
    "agent.save_interval=5",
    *CONSTANT,
]
TRIAL = [*SHORT, "evaluation.figures=false", "evaluation.freq=[0.5]"]

opened: list[tuple[str, str]] = []
"""Changes of files by this process: audit event and path. An audit hook cannot be removed, so it is module-wide."""


def _watch(event, arguments):
    if event == "open":
        path, mode, flags = arguments
        writes = flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND)
        if isinstance(path, (str, os.PathLike)) and writes:
            opened.append((event, os.path.abspath(path)))
    elif event in ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate", "os.chmod", "os.utime", "os.link"):
        opened.extend((event, os.path.abspath(path)) for path in arguments if isinstance(path, (str, os.PathLike)))


@pytest.fixture(scope="module")
def training(tmp_path_factory):
    """The folder of a training that runs in another process, after its first checkpoint; and the process."""
    folder = tmp_path_factory.mktemp("training")
    command = [sys.executable, "-m", "posture.train", *LEARNING, "max_iterations=100000", "evaluate=false"]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            deadline = time.monotonic() + 120.0
            while not list(folder.glob("runs/*/resume.pt")):  # written after the checkpoint
                assert process.poll() is None and time.monotonic() < deadline
                time.sleep(0.1)
            yield next(folder.glob("runs/*")), process
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(timeout=30.0)
            except subprocess.TimeoutExpired:
                process.kill()


def test_files_read_during_training_are_complete(training):
    """The saved state, which the training often replaces, and the newest checkpoint at each moment."""
    run, process = training
    states: set[int] = set()
    deadline = time.monotonic() + 60.0
    while len(states) < 5 and time.monotonic() < deadline:
        states.add(checkpoint.load(run / "resume.pt", "cpu")["iteration"])
        newest = newest_model(run)
        assert checkpoint.load(newest, "cpu")["iter"] == iteration_of(newest)
    assert process.poll() is None and len(states) == 5


def test_an_evaluation_is_reproducible_and_changes_no_file_of_the_run(training, tmp_path, monkeypatch):
    run, process = training
    monkeypatch.chdir(tmp_path)
    before = {path: path.read_bytes() for path in run.iterdir() if path.suffix == ".yaml" or path.name.startswith("model_")}
    sys.addaudithook(_watch)
    opened.clear()
    call(monkeypatch, "eval", f"ckpt={run}", *TRIAL)
    (own,) = (path for path in run.iterdir() if path.is_dir())
    number = own.name.split("_")[2]  # evaluation_model_<n>_<what differs>
    call(monkeypatch, "eval", f"ckpt={run}/model_{number}.pt", "out=again", *TRIAL)
    # A check whether the folder can be written opens the folder itself, for a file without a name.
    written = {path for _, path in opened if path.startswith(f"{run}/")}
    after = newest_model(run)
    assert process.poll() is None and iteration_of(after) > int(number)  # it was running all the time

    table = (own / "metrics.csv").read_bytes()
    assert table == Path("again/metrics.csv").read_bytes() and b"nan" in table
    first, second = (np.load(folder / "trajectories.npz") for folder in (own, Path("again")))
    assert set(first.files) == set(second.files)
    assert all(np.array_equal(first[name], second[name], equal_nan=first[name].dtype.kind == "f") for name in first.files)

    # The folder `evaluation` is for the end of the training.
    assert own.name.startswith("evaluation_model_")
    assert written and all(path.startswith(str(own)) for path in written)
    assert {path: path.read_bytes() for path in before} == before

    # The policy is that of a training without an evaluation beside it.
    done = iteration_of(after)
    call(monkeypatch, "train", *LEARNING, f"max_iterations={done}", "evaluate=false")
    (alone,) = runs()
    one, other = (checkpoint.load(path, "cpu")["actor_state_dict"] for path in (after, alone / after.name))
    assert one.keys() == other.keys() and all(torch.equal(one[name], other[name]) for name in one)
