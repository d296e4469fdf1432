"""The functions that differ between POSIX and Windows."""

import os
import signal
import subprocess
import sys

import pytest

from posture.operating_system import block_signals, lower_priority, process_is_alive, yield_processor

posix = pytest.mark.skipif(sys.platform == "win32", reason="there is no such function on Windows")


@posix
def test_a_process_is_alive_until_it_has_been_waited_for():
    process = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    assert process_is_alive(process.pid) and process_is_alive(os.getpid())
    process.communicate(b"\n")
    assert not process_is_alive(process.pid)


@posix
def test_a_process_of_another_user_is_alive(monkeypatch):
    def refuse(pid, number):
        raise PermissionError

    monkeypatch.setattr(os, "kill", refuse)
    assert process_is_alive(1)


@posix
def test_blocked_signals_arrive_when_the_block_ends():
    arrived = []
    before = signal.signal(signal.SIGTERM, lambda *_: arrived.append(True))
    try:
        with block_signals((signal.SIGTERM,)):
            signal.raise_signal(signal.SIGTERM)
            assert not arrived
        assert arrived
    finally:
        signal.signal(signal.SIGTERM, before)


@posix
def test_processes_started_while_signals_are_blocked_ignore_them():
    code = "import signal; signal.raise_signal(signal.SIGTERM); print('still here')"
    with block_signals((signal.SIGTERM,)):
        result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert result.stdout == "still here\n"


def test_on_windows_no_posix_function_is_called(monkeypatch):
    monkeypatch.setattr(sys, "platform", "win32")
    for module, name in ((signal, "pthread_sigmask"), (os, "sched_yield"), (os, "nice"), (os, "kill")):
        monkeypatch.delattr(module, name, raising=False)
    with block_signals((signal.SIGINT, signal.SIGTERM)):
        yield_processor()
    lower_priority(5)
    with pytest.raises(NotImplementedError):
        process_is_alive(os.getpid())
