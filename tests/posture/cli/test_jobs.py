"""The jobs of a command line: which they are, the flags, their folders, and what identifies a training."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from posture.cli.jobs import MAX_SLUG_LENGTH, check, identity, override_slug
from posture.config.eval import EvalConfig
from posture.config.train import TrainConfig
from tests.commands import answer, call
from tests.conftest import compose


def jobs_of(*arguments, kind=TrainConfig):
    return check({TrainConfig: "train", EvalConfig: "eval"}[kind], kind, arguments).jobs


# -- sweeps ----------------------------------------------------------------------------------------------------------


def test_every_combination_is_a_job_in_hydras_order():
    """Those of a range, an experiment's own parameter and a list; the last one varies fastest."""
    command = check("train", TrainConfig, ["-m", "experiment=frequency", "env.hip_k=25,50,...,75", "seed=range(2)"])
    assert [(job.config.seed, job.config.env.hip_k) for job in command.jobs] == [
        (seed, hip_k) for seed in (0, 1) for hip_k in (25, 50, 75)
    ]
    assert command.launcher == "basic" and command.argv[0] == "--multirun"
    assert {str(job.folder.parent) for job in command.jobs} == {"runs/frequency"}
    assert len({job.folder for job in command.jobs}) == 6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("experiment", "count"),
    [("frequency", 5), ("energy", 9 * 3), ("hip_stiffness", 8 * 3), ("grid", 10 * 8), ("senses", 7 * 3)],
)
def test_an_experiment_is_a_sweep(experiment, count):
    assert len(jobs_of("-m", f"experiment={experiment}")) == count


@pytest.mark.parametrize(
    ("experiment", "narrowed", "count"), [("energy", "env.energy_weight=5", 3), ("grid", "env.hip_k=25", 10)]
)
def test_the_command_line_narrows_an_experiment(experiment, narrowed, count):
    jobs = jobs_of("-m", f"experiment={experiment}", narrowed)
    key, value = narrowed.removeprefix("env.").split("=")
    assert len(jobs) == count and {getattr(job.config.env, key) for job in jobs} == {float(value)}


def test_one_job_of_an_experiment_says_that_it_is_one(capsys):
    assert len(jobs_of("experiment=energy", "seed=1")) == 1
    assert capsys.readouterr().err == "one job: the experiment's values of env.energy_weight need -m\n"
    assert len(jobs_of("experiment=energy", "seed=1", "env.energy_weight=5")) == 1
    assert capsys.readouterr().err == ""


def test_part_of_a_sweep_has_the_folders_of_the_whole():
    (one,) = jobs_of("-m", "experiment=energy", "env.energy_weight=5", "seed=2")
    two = jobs_of("-m", "experiment=energy", "env.energy_weight=0,5", "seed=2")
    assert one.folder == two[1].folder != two[0].folder


def test_the_grid_evaluates_each_policy_where_it_was_trained():
    jobs = jobs_of("-m", "experiment=grid", "env.freq=0.1,0.4", "env.hip_k=50")
    assert [(job.config.env.freq, job.config.evaluation.freq) for job in jobs] == [(0.1, (0.1,)), (0.4, (0.4,))]


@pytest.mark.parametrize(("experiment", "count"), [pytest.param("load", 9, marks=pytest.mark.slow), ("engines", 3)])
def test_experiments_with_the_policies_of_another(experiment, count):
    assert len(jobs_of("-m", f"experiment={experiment}", kind=EvalConfig)) == count


def test_the_ramp_is_the_papers():
    (job,) = jobs_of("-m", "experiment=ramp", kind=EvalConfig)
    ramp = job.config.env.ramp
    assert (ramp.start, ramp.rate, ramp.duration) == (0.0, 0.036, 25.0)
    assert job.config.evaluation.duration == 25.0


# -- flags -----------------------------------------------------------------------------------------------------------

LENIENT = "# @package _global_\nenv: {hip_k: 60.0}\n"


@pytest.fixture
def experiments(tmp_path, monkeypatch):
    """A folder of the user's own with the experiments `soft`, and `wrong`, which has a negative stiffness."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "it's mine" / "experiment"
    folder.mkdir(parents=True)
    (folder / "soft.yaml").write_text(LENIENT)
    (folder / "wrong.yaml").write_text(LENIENT.replace("60", "-60"))
    (folder / "sweep.yaml").write_text(LENIENT + "hydra: {mode: MULTIRUN, sweeper: {params: {seed: '1,2'}}}\n")
    return "--config-dir=it's mine"


def test_an_experiment_of_the_users_own_is_checked_and_run(experiments):
    code, stderr, configs = answer("train", experiments, "experiment=soft")
    assert (code, stderr) == (0, "") and [config.env.hip_k for config in configs] == [60.0]
    code, stderr, configs = answer("train", "-m", experiments, "experiment=soft", "seed=3,4")
    assert code == 0 and [(config.env.hip_k, config.seed) for config in configs] == [(60.0, 3), (60.0, 4)]
    code, stderr, configs = answer("train", experiments, "experiment=wrong")
    assert code == 2 and stderr.startswith("error: env.hip_k = -60.0") and not configs


def test_a_sweep_by_the_configuration_itself_is_checked(experiments):
    assert [job.config.seed for job in jobs_of(experiments, "experiment=sweep")] == [1, 2]
    code, stderr, configs = answer("train", experiments, "experiment=sweep", "env.load=0,-1")
    assert code == 2 and stderr.startswith("error: env.load = -1") and not configs


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--run", "env.hip_k=-1"], "env.hip_k = -1"),
        (["--config-name=train", "env.hip_k=-1"], "env.hip_k = -1"),
        (["env.hip_k=-1", "--multirun", "seed=1"], "env.hip_k = -1"),
        (["--config-name=eval"], "env.num_envs: missing"),
        (["--config-name=none"], "Cannot find primary config 'none'"),
        (["--config-dir=none"], "--config-dir: no such folder: none"),
        (["--config-path=conf"], "unrecognized arguments: --config-path=conf"),
        (["--experimental-rerun=job.pickle"], "unrecognized arguments: --experimental-rerun=job.pickle"),
        (["--multi"], "unrecognized arguments: --multi"),
        (["-p", "env"], "--resolve and --package go together with --cfg"),
        (["-m", "--cfg", "job", "env.hip_k=50,75"], "--cfg and --info show one configuration: leave out -m and --run"),
        (["--cfg=none"], "argument --cfg/-c: invalid choice"),
        (["env.hip_k=25,50"], "several values for one key make a sweep: add -m"),
        (["-m", "env.hip_k=interval(0,1)"], "env.hip_k=interval(0,1): an interval has no list of values"),
        (["-m", "seed=range(200)", "env.hip_k=range(200)"], "the sweep has more than 10,000 jobs"),
        (["-m", "experiment=frequency", "seed=1,1"], "two jobs of the sweep would have the folder"),
        (["-m", "seed=range(0)"], "the sweep is empty"),
        (["-m", "hydra.sweep.subdir=../x"], "hydra.sweep.subdir: the job's folder"),
        (["-m", "resume=a,b"], "resume continues one run: not together with -m"),
        (["-m", "env.hip_k=25,50,-1"], "env.hip_k = -1"),
        (["-m", "env.hip_k=25,50,...,190"], "env.hip_k=25,50,...,190: 190 is not reached"),
    ],
)
def test_flags_and_sweeps_that_are_refused(tmp_path, monkeypatch, arguments, expected):
    monkeypatch.chdir(tmp_path)
    code, stderr, configs = answer("train", *arguments)
    assert code == 2 and not configs and stderr.count("\n") == 1
    assert expected in stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("flag", ["--help", "--hydra-help", "--version", "--cfg=job", "--info=defaults", "-c=job"])
def test_flags_that_show_something_run_no_job(monkeypatch, capsys, flag):
    with pytest.raises(SystemExit) if flag in ("--help", "--hydra-help", "--version") else pytest.MonkeyPatch.context():
        call(monkeypatch, "train", flag, task=lambda config, folder: pytest.fail("a job ran"))
    assert capsys.readouterr().out


# -- folders ---------------------------------------------------------------------------------------------------------


def test_a_training_is_identified_by_what_its_policy_depends_on():
    default = identity(compose())
    assert re.fullmatch("[0-9a-f]{8}", default)
    for same in ("evaluate=false", "threads=2", "evaluation.duration=50", "env.hip_k=125"):
        assert identity(compose(same)) == default
    others = ("seed=2", "env.hip_k=125.5", "max_iterations=999", "agent.algorithm.gamma=0.97", "processes=1")
    assert len({default, *(identity(compose(other)) for other in others)}) == 1 + len(others)


@pytest.mark.parametrize(
    ("overrides", "slug"),
    [
        ("env.hip_k=25,seed=3", "hip_k-25_seed-3"),
        ("+env.freq=[0.1,0.2],seed=3", "freq-0.1-0.2_seed-3"),
        ("env.load=-5", "load--5"),  # not the same as 5
        ("ckpt=runs/first run/model.pt", "ckpt-runs-first-run-model.pt"),
        ("env/body=tall", "body-tall"),
        ("experiment=", "experiment"),
        (".hidden=1", "hidden-1"),
        ("../..", "job"),
        ("", "job"),
    ],
)
def test_slug_by_hand(overrides, slug):
    assert override_slug(overrides) == slug


def test_long_slugs_stay_distinct():
    common = ",".join(f"key_{i}=1" for i in range(20))
    first, second = override_slug(f"{common},seed=1"), override_slug(f"{common},seed=2")
    assert len(first) == len(second) == MAX_SLUG_LENGTH and first != second


@given(st.text(max_size=200))
def test_a_slug_is_a_safe_file_name(overrides):
    assert re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,79}", override_slug(overrides))
