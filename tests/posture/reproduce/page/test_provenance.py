"""Results of different code or versions on one page: never unsaid."""

from pathlib import Path

import pytest

from posture.cli.jobs import Job, check
from posture.config.train import TrainConfig
from posture.reproduce.page.provenance import left_out, mixed
from posture.reproduce.results import strangers
from posture.storage import yaml_files
from tests.commands import TINY

NAMES = ("seed-1", "seed-2", "seed-3", "seed-4", "seed-5")
VERSIONS = {"newton": "1.8.0", "torch": "2.13.0"}


@pytest.fixture
def jobs(tmp_path, monkeypatch):
    """Five trainings that are done, each started once by the same code and versions."""
    monkeypatch.chdir(tmp_path)
    (one,) = check("train", TrainConfig, TINY).jobs
    made = [Job(one.config, Path("runs/frequency") / name) for name in NAMES]
    for job in made:
        folder(job.folder, {"training_code": "aaaa", "versions": VERSIONS})
    return made


def folder(path, *starts):
    path.mkdir(parents=True, exist_ok=True)
    yaml_files.write_yaml(path / "status.yaml", {"state": "done"})
    yaml_files.write_yaml(path / "provenance.yaml", list(starts))
    (path / "config.yaml").write_text("{}")
    (path / "model_2.pt").write_text("")


def test_trainings_alike_need_no_warning(jobs):
    assert mixed(jobs) == ""


def test_other_code_is_named_with_its_trainings(jobs):
    folder(jobs[1].folder, {"training_code": "bbbb", "versions": VERSIONS})
    told = mixed(jobs)
    assert "mixed" in told and "`aaaa` in 4 trainings" in told and "`bbbb` in 1 trainings (seed-2)" in told
    assert "newton" not in told


def test_other_physics_is_named_with_its_trainings(jobs):
    folder(jobs[4].folder, {"training_code": "aaaa", "versions": VERSIONS | {"newton": "1.9.0"}})
    told = mixed(jobs)
    assert "newton: `1.8.0` in 4 trainings, `1.9.0` in 1 trainings (seed-5)" in told
    assert "torch" not in told and "code of the task" not in told


def test_a_training_resumed_by_other_code_is_mixed_in_itself(jobs):
    folder(jobs[0].folder, *({"training_code": code, "versions": VERSIONS} for code in ("aaaa", "bbbb")))
    assert "`aaaa` in 5 trainings, `bbbb` in 1 trainings (seed-1)" in mixed(jobs)


def test_one_that_is_not_done_does_not_count(jobs):
    folder(jobs[1].folder, {"training_code": "bbbb", "versions": VERSIONS})
    yaml_files.write_yaml(jobs[1].folder / "status.yaml", {"state": "running"})
    assert mixed(jobs) == ""


def test_runs_of_other_code_beside_the_jobs_are_left_out_by_name(jobs):
    assert strangers(jobs) == [] and left_out([]) == ""
    folder(Path("runs/frequency/seed-1_older"))
    found = [str(run) for run in strangers(jobs)]
    assert found == ["runs/frequency/seed-1_older"]
    assert "1 (runs/frequency/seed-1_older)" in left_out(found)
