"""The progress line and the notice about compilation."""

import time
from pathlib import Path

import pytest
import warp

from posture.learning.progress import Progress, Status, preparing

STATUS = Status(
    iteration=10,
    total=250,
    steps_per_s=12345.6,
    reward=1.234,
    episode_length=321.4,
    error_mm=12.34,
    cost=0.05678,
    learning_rate=0.00034,
    seconds_left=754.0,
)


def test_a_line_names_all_that_matters():
    line = str(STATUS)
    for part in ("10/250", "12,346 steps/s", "1.23", "321", "12.3 mm", "0.057", "3.4e-04", "12:34 left"):
        assert part in line


def test_a_narrow_terminal_gets_all_of_it_in_one_line(monkeypatch, capsys):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "80")
    Progress().show(
        Status(**{**vars(STATUS), "iteration": 9999, "total": 9999, "reward": -1234.5, "episode_length": 5000.0})
    )
    line = capsys.readouterr().out
    assert line.startswith("\r") and line.endswith("\n") and len(line.strip()) < 80
    for part in ("9999/9999", "12.3k/s", "-1234", "5000", "12.3mm", "0.057", "3e-04", "12:34 left"):
        assert part in line


def test_no_terminal_gives_plain_lines_now_and_then_and_always_the_last(capsys):
    progress = Progress()
    for iteration in range(1, 6):
        progress.show(Status(**{**vars(STATUS), "iteration": iteration, "total": 5}))
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[1] for line in lines] == ["1/5", "5/5"] and "\r" not in "".join(lines)


@pytest.mark.parametrize("compiles", [True, False])
def test_compilation_is_explained_only_when_it_happens(monkeypatch, capsys, tmp_path, compiles):
    warp.init()
    monkeypatch.setattr(warp.config, "kernel_cache_dir", str(tmp_path))
    monkeypatch.setattr("posture.learning.progress.WATCH_EVERY_S", 0.01)
    with preparing():
        if compiles:
            Path(tmp_path, "wp_module").mkdir()
        time.sleep(0.2)
    assert capsys.readouterr().out.splitlines() == ["compiling kernels, first run only"] * compiles
