"""A signal ends work that is shared among processes, and is never taken for bad input."""

import multiprocessing
import signal
import subprocess
import sys
import threading
import time

import pytest

from posture.cli import entry, jobs, signals
from posture.config.errors import ConfigError
from posture.config.eval import EvalConfig

PROGRAM = """
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

from posture.cli import signals

if __name__ == "__main__":
    with signals.handled(), ProcessPoolExecutor(2, get_context("spawn")) as pool:
        list(pool.map(abs, [-1, 2]))
        waiting = pool.map(time.sleep, [60.0] * 5000)
        print("begun", flush=True)
        list(waiting)
"""


@pytest.mark.parametrize("attempt", range(8))  # the pool's thread and the cancelling of its work race each other
def test_a_pool_ends_with_its_program(attempt, tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM)
    with subprocess.Popen(
        [sys.executable, "program.py"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout.readline() == b"begun\n"
        time.sleep(0.2)  # Python handles a signal late that comes just before it waits
        began = time.monotonic()
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=50)
    assert time.monotonic() - began < 30.0  # without the signal to the pool: 180 s
    assert process.returncode == 128 + signal.SIGTERM
    assert errors == b""


def test_a_signal_waits_for_pools_alone():
    ended = threading.Event()
    other = threading.Thread(target=ended.wait)
    other.start()
    child = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(60.0,))
    child.start()
    began = time.monotonic()
    with pytest.raises(signals.Stopped), signals.handled():
        signal.raise_signal(signal.SIGTERM)
    assert time.monotonic() - began < 1.0
    child.join(10.0)
    assert child.exitcode == -signal.SIGTERM
    ended.set()
    other.join()


def test_a_library_that_fails_while_it_is_interrupted_is_not_bad_input(monkeypatch, capsys):
    def interrupted(*_):
        try:
            try:
                raise signals.Stopped(signal.SIGTERM)
            finally:
                raise AttributeError("half an object")
        except AttributeError as error:
            raise ConfigError("the command line cannot be read") from error

    monkeypatch.setattr(jobs, "check", interrupted)
    with pytest.raises(signals.Stopped) as stopped:
        entry.run("eval", EvalConfig, lambda *_: None)
    assert stopped.value.code == 128 + signal.SIGTERM
    assert capsys.readouterr().err == ""
