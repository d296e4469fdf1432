"""The progress line and the notice about compilation."""

import dataclasses
import time
from pathlib import Path

import pytest
import warp

from posture.learning.progress import ProgressLine, Status, preparing

STATUS = Status(
    iteration=9999,
    total=9999,
    steps_per_s=12345.6,
    reward=-1234.5,
    episode_length=5000.4,
    error_mm=12.34,
    cost=0.05678,
    learning_rate=0.00034,
    seconds_left=754.0,
)
ESSENTIAL = ("9999/9999", "12:34 left", "12.3k steps/s", "reward -1234", "error 12.3 mm", "cost 0.057")


def test_line_holds_everything_and_the_essential_part_fits_80_columns():
    line = str(STATUS)
    assert all(part in line[:79] for part in ESSENTIAL), line
    assert "episode 5000 steps" in line and "learning rate 3.4e-04" in line
    assert "reward -," in str(dataclasses.replace(STATUS, reward=None, episode_length=None))


@pytest.mark.parametrize("columns", [40, 80, 200])
def test_terminal_shows_one_line_that_never_wraps(monkeypatch, capsys, columns):
    for name, value in {"COLUMNS": str(columns), "LINES": "24", "TERM": "xterm", "TTY_COMPATIBLE": "1"}.items():
        monkeypatch.setenv(name, value)
    progress = ProgressLine()
    for iteration in range(9990, 10000):
        progress.show(dataclasses.replace(STATUS, iteration=iteration))
    progress.close()
    output = capsys.readouterr().out
    assert output.count("\n") == 1 and output.count("\x1b[2K") >= 9  # each status erases the one before
    last = output.split("\x1b[2K")[-1].split("\n")[0]
    assert last.startswith("9999/9999") and len(last.split("\x1b")[0]) <= columns


def test_no_terminal_shows_few_plain_lines_and_always_the_last(capsys):
    progress = ProgressLine()
    for iteration in range(1, 6):
        progress.show(dataclasses.replace(STATUS, iteration=iteration, total=5))
    progress.close()
    output = capsys.readouterr().out
    assert [line.split(",")[0] for line in output.splitlines()] == ["1/5", "5/5"] and "\r" not in output


@pytest.mark.parametrize("compiles", [True, False])
def test_compilation_is_announced_only_when_it_happens(monkeypatch, capsys, tmp_path, compiles):
    warp.init()
    capsys.readouterr()  # what Warp prints when it starts
    monkeypatch.setattr(warp.config, "kernel_cache_dir", str(tmp_path))
    monkeypatch.setattr("posture.learning.progress.CACHE_POLL_S", 0.01)
    with preparing():
        if compiles:
            Path(tmp_path, "wp_module").mkdir()
        time.sleep(0.2)
    assert capsys.readouterr().out.splitlines() == ["compiling kernels, first run only"] * compiles
