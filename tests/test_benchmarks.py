"""The benchmarks: their arithmetic, and that each writes its files."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))  # its files are scripts, which find one another so
import engines  # noqa: E402

NAMED = {
    ("engines.py", "one"): set(engines.ENGINES),
    ("learners.py", "one"): {"ours", "sb3"},
    ("learners.py", "two"): {"ours", "sb3"},
    ("gpu.py", "one"): {"sagittal", "mujoco"},
    ("gpu.py", "two"): {"laptop", "ppo_paper"},
}
"""What each file has rows of."""


def row(worlds, rate, memory):
    about = {"engine": "mujoco", "worlds": worlds, "threads": 1, "device": "-", "cores": 1, "contacts_dropped": False}
    return about | {"env_steps_per_s": rate, "physics_steps_per_s": None, "bytes": memory}


def test_rows_by_hand():
    """The median of three repeats, and memory a world by the growth over the fewest worlds, where it is more than noise."""
    assert engines.median([row(1, rate, 5) for rate in (30.0, 10.0, 20.4)])["env_steps_per_s"] == 20
    assert engines.median([row(1, 1.0, 5)])["physics_steps_per_s"] is None
    rows = engines.summary([row(1, 10, 50_000_000), row(11, 90, 50_000_100), row(1001, 900, 150_000_000)])
    assert [each["bytes_per_world"] for each in rows] == [None, None, 100_000]
    assert "(1.00x)" in engines.table(rows)


@pytest.mark.slow
def test_the_commands_write_their_files(tmp_path):
    tiny = ["--device", "cpu", "--worlds", "16", "--samples", "1"]
    few = ["--worlds", "4", "env.physics=mujoco", "agent.algorithm.num_mini_batches=1", "evaluation.duration=12"]
    for script, arguments, files in (
        ("engines.py", ["--worlds", "1", "2", "--seconds", "0.05", "--repeats", "1", "--csv", "one"], ["one"]),
        ("learners.py", ["--budget", "2", "--every", "1", "--csv", "one", "--curves", "two", *few], ["one", "two"]),
        ("gpu.py", [*tiny, "--csv", "one", "--trainings", "two"], ["one", "two"]),
    ):
        subprocess.run([sys.executable, BENCHMARKS / script, *arguments], cwd=tmp_path, check=True, timeout=600)
        for file in files:
            rows = list(csv.DictReader((tmp_path / file).open()))
            named = {each.get("engine") or each.get("agent") or each["learner"] for each in rows}
            assert named == NAMED[script, file]
