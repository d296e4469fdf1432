"""The jobs of a command line: which there are, where they go, and what makes two of them the same."""

import pytest

from posture.cli.jobs import check, identity
from posture.config.eval import EvalConfig
from posture.config.train import TrainConfig
from tests.conftest import compose


@pytest.mark.parametrize(
    ("experiment", "count"), [("frequency", 5), ("energy", 9 * 3), ("hip_stiffness", 8 * 3), ("grid", 10 * 8)]
)
def test_an_experiment_is_a_sweep(experiment, count):
    found = check("train", TrainConfig, ["-m", f"experiment={experiment}"])
    assert len(found.jobs) == count and found.launcher == "basic"
    assert {str(job.folder.parent) for job in found.jobs} == {f"runs/{experiment}"}
    assert len({job.folder.name for job in found.jobs}) == count


def test_the_grid_evaluates_each_policy_where_it_was_trained():
    jobs = check("train", TrainConfig, ["-m", "experiment=grid", "env.freq=0.1,0.4", "env.hip_k=50"]).jobs
    assert [(job.config.env.freq, job.config.evaluation.freq) for job in jobs] == [(0.1, (0.1,)), (0.4, (0.4,))]
    assert all(job.config.env.hip_k == 50 for job in jobs)


@pytest.mark.parametrize(("experiment", "count"), [("ramp", 1), ("load", 9), ("amplitude", 4), ("engines", 3)])
def test_experiments_without_training(experiment, count):
    assert len(check("eval", EvalConfig, ["-m", f"experiment={experiment}"]).jobs) == count


def test_the_ramp_is_the_papers():
    (job,) = check("eval", EvalConfig, ["-m", "experiment=ramp"]).jobs
    ramp = job.config.env.ramp
    assert (ramp.start, ramp.rate, ramp.duration) == (0.0, 0.036, 25.0)
    assert job.config.evaluation.duration == 25.0


def test_the_command_line_narrows_an_experiment():
    jobs = check("train", TrainConfig, ["-m", "experiment=energy", "env.energy_weight=5,20", "seed=2"]).jobs
    assert [job.config.env.energy_weight for job in jobs] == [5, 20] and {job.config.seed for job in jobs} == {2}
    whole = {job.folder for job in check("train", TrainConfig, ["-m", "experiment=energy"]).jobs}
    assert {job.folder for job in jobs} < whole, "a part of a sweep finds the folders of the whole"


def test_what_a_policy_depends_on_and_nothing_else_names_its_folder():
    plain = identity(compose())
    assert len(plain) == 8
    for same in ("evaluate=false", "threads=2", "evaluation.duration=50", "env.hip_k=125"):
        assert identity(compose(same)) == plain
    others = ("seed=2", "env.hip_k=125.5", "max_iterations=999", "agent.algorithm.gamma=0.97", "processes=1")
    assert len({plain, *(identity(compose(other)) for other in others)}) == 1 + len(others)
