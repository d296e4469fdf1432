"""The whole paper in one command, at tiny size: what it writes, what it skips, and which input it refuses."""

import os
import shutil
import signal
import sys
import threading
import time
from pathlib import Path

import pytest

from posture.cli import signals
from posture.config.reproduce import ReproduceConfig
from posture.reproduce.__main__ import Start, evaluation, of_several_seeds, run, run_at_once
from posture.reproduce.experiments import TRAININGS
from posture.reproduce.ship import archive, duration, ship
from posture.storage import run_dir, yaml_files
from tests.commands import TINY, call, refused, table

TINIER = [option for option in TINY if not option.startswith(("evaluation.freq", "processes"))]
OVERRIDES = f"overrides=[{','.join(repr(option) for option in TINIER)}]"
QUICK = ["seeds=1", OVERRIDES, "out=report", "parallel=2"]
FEW_TRIALS = {
    "map": [
        *("varied={hip_k:[100],ankle_k:[],load:[4],amplitude:[]}", "freq={low:0.5,high:1.0,step:0.5}", "random=1"),
        "search=[0.6,0.7]",
    ],
    "dynamics": [
        *("repeats=2", "staircase.cycles=2", "staircase.skip=0", "ramp={start:0.8,end:1.2,rate:0.2,window:1}"),
        "perturbation={freq:{low:0.8,high:1.2,step:0.4},force:20,time:0.1,first:1.5,every:1.5,pushes:2}",
        *("fluctuation.freq={low:0.8,high:1.2,step:0.2}", "evaluation.duration=5"),
    ],
}
"""For the commands that evaluate all seeds of an experiment together, whose own trials take minutes."""


def reproduce_quickly(monkeypatch, *arguments):
    """The whole command at tiny size."""

    def with_few_trials(command, *others):
        return [*of_several_seeds(command, *others), *FEW_TRIALS[command]]

    monkeypatch.setattr("posture.reproduce.__main__.of_several_seeds", with_few_trials)
    call(monkeypatch, "reproduce", *QUICK, *arguments)


@pytest.fixture(scope="module")
def reproduced(tmp_path_factory):
    """The folder of all experiments with untrained policies, which fall in Exp. 1."""
    folder = tmp_path_factory.mktemp("reproduced")
    here = os.getcwd()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        reproduce_quickly(patch)
    os.chdir(here)
    return folder


@pytest.mark.slow
def test_every_condition_is_trained_once(reproduced):
    folders = [reproduced / "runs" / name for name in TRAININGS]
    counts = {folder.name: len(run_dir.runs_in(folder)) for folder in folders if folder.exists()}
    assert counts == {"frequency": 1, "energy": 9, "hip_stiffness": 8, "map": 1, "human": 1}  # by default


@pytest.mark.slow
def test_the_tables_are_tidy(reproduced):
    tables = {path.stem: table(path) for path in (reproduced / "report" / "tables").glob("*.csv")}
    counts = {name: len(rows) for name, rows in tables.items()}
    expected = {"frequency": 15, "energy": 9, "hip_stiffness": 80, "ramp": 1, "amplitude": 40, "engines": 30}
    expected |= {"load": 9, "load_trained": 9}
    assert expected.items() <= counts.items()
    assert {row["physics"] for row in tables["engines"]} == {"sagittal", "mujoco", "mujoco_c"}
    assert all(row["seed"] == "1" for name in expected for row in tables[name])
    assert {float(row["load_kg"]) for row in tables["load"]} == {0.5 * i for i in range(9)}


@pytest.mark.slow
def test_nothing_is_reproduced_where_all_fell(reproduced):
    verdicts = {row["key"]: row["verdict"] for row in table(reproduced / "report" / "tables" / "verdicts.csv")}
    assert len(verdicts) == 19
    assert {verdict for key, verdict in verdicts.items() if key.startswith("frequency")} == {"not reproduced"}
    assert (reproduced / "report" / "report.html").read_text().count("<img") >= 5
    assert (reproduced / "report" / "summary.md").read_text().startswith("# ")


@pytest.mark.slow
def test_a_second_start_repeats_nothing(reproduced, monkeypatch, capfd):
    monkeypatch.chdir(reproduced)
    before = {path: path.stat().st_mtime_ns for path in Path("runs").rglob("*.npz")}
    assert before
    reproduce_quickly(monkeypatch, "stages=[train,evaluate]")
    assert "sweep: 20 of 20 jobs done, 20 of them before" in capfd.readouterr().out
    assert {path: path.stat().st_mtime_ns for path in Path("runs").rglob("*.npz")} == before


@pytest.mark.slow
def test_shipped_policies_are_small_and_can_be_evaluated(reproduced, monkeypatch, tmp_path):
    from posture.cli.jobs import check
    from posture.config.train import TrainConfig

    monkeypatch.chdir(reproduced)
    jobs = check("train", TrainConfig, ["-m", "experiment=energy", *TINIER]).jobs
    jobs += check("train", TrainConfig, ["-m", "experiment=frequency", *TINIER]).jobs
    monkeypatch.setattr(run_dir, "PRETRAINED", tmp_path)
    made = ship(jobs, 1, tmp_path)
    assert sorted(path.name for path in made) == sorted(
        ["default", *(f"energy_weight-{gamma}" for gamma in range(0, 41, 5))]
    )
    assert all(sum(file.stat().st_size for file in path.iterdir()) < 60_000 for path in made)
    monkeypatch.chdir(tmp_path)
    trial = [option for option in TINIER if option.startswith("evaluation")]
    call(monkeypatch, "eval", "ckpt=pretrained/energy_weight-5", "out=a", "evaluation.freq=[0.4]", *trial)
    (original,) = (reproduced / "runs" / "energy").glob("energy_weight-5_*")
    assert table(Path("a/metrics.csv")) == table(original / "evaluation" / "metrics.csv")


def test_archived_policies_are_not_trained_again(monkeypatch, capsys, tmp_path):
    from posture.cli.jobs import check
    from posture.config.train import TrainConfig

    monkeypatch.chdir(tmp_path)
    trainings = ["-m", "experiment=frequency", "seed=1", *TINIER, "evaluation.freq=[0.5]", "evaluation.figures=false"]
    call(monkeypatch, "train", *trainings)
    jobs = check("train", TrainConfig, [*trainings]).jobs
    jobs += check("train", TrainConfig, [*trainings, "env.hip_k=60"]).jobs  # not done
    trained = jobs[0].folder
    before, seconds = table(trained / "evaluation" / "metrics.csv"), duration(trained)
    (made,) = archive({"frequency": jobs}, Path("report/policies"))
    assert made == Path("report/policies/frequency") / trained.name
    assert sorted(path.name for path in made.iterdir()) == ["config.yaml", "model_2.pt", "provenance.yaml"]
    with monkeypatch.context() as patch, pytest.raises(OSError, match="full"):
        patch.setattr(yaml_files, "write_yaml", full_disk)
        archive({"frequency": jobs}, Path("report/policies"))
    assert sorted(path.name for path in made.iterdir()) == ["config.yaml", "model_2.pt", "provenance.yaml"]
    assert [path.name for path in made.parent.iterdir()] == [made.name]
    shutil.rmtree("runs")
    shutil.copytree("report/policies", "runs")
    capsys.readouterr()
    call(monkeypatch, "train", *trainings)
    assert "already trained" in capsys.readouterr().out
    assert table(trained / "evaluation" / "metrics.csv") == before
    assert duration(trained) == seconds > 0


def full_disk(*arguments):
    raise OSError("full")


@pytest.mark.parametrize(
    ("argument", "expected"),
    [
        ("seeds=0", "seeds = 0"),
        ("stages=[train,dream]", "stages"),
        ("launcher=fast", "launcher = 'fast'"),
        ("search=[1.0,0.5]", "from low to high"),
        ("report.claims.modes_share=75", "report.claims.modes_share = 75"),
        ("report.claims.rho_partly=0.9", "rho_partly must not be above rho_reproduced, got 0.9 and 0.8"),
        ("report.grid.amplitudes_m=[0.1,0.06]", "amplitudes_m must rise"),
        (
            "report.claims.high_freq_hz=1.1",
            "allowed are 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.05, 1.2, 1.35",
        ),
        ("report.claims.high_freq_hz=1.5", "high_freq_hz = 1.5: allowed are"),
        ("report.claims.soft_hip_k=25", "soft_hip_k = 25: allowed is more than Fig. 13's lowest, 25"),
        ("report.claims.stiff_hip_k=200", "stiff_hip_k = 200: allowed is less than Fig. 13's highest, 200"),
        ("experiments=[map,map]", "experiments: map appears 2 times"),
        ("overrides=['env.hip_k=-5']", "env.hip_k = -5"),
        ("stages=[report]", "no policy of frequency is done"),
        (
            "stages=[evaluate]",
            "map, human is done: run the stage train first, which keeps what is trained",
        ),
        ("stages=[ship]", "no policy of frequency is done"),
        ("experiments=[load]", "experiments"),
        *(
            (f"overrides=['{text}']", f"{text!r}: allowed are keys of a training with their values")
            for text in (
                *("-h", "-m", "--help", "-cn=eval", "--config-dir=conf", "", " ", "device", "=1", " out=there"),
                *("out=there", "+out=there", "seed=1", "seed=1,2", "++seed=1", "experiment=load", "resume=latest"),
                *("hydra/launcher=basic", "hydra.run.dir=there", "hydra={}", "~seed", "experiment@a=load"),
            )
        ),
    ],
)
def test_bad_input(monkeypatch, capsys, tmp_path, argument, expected):
    monkeypatch.chdir(tmp_path)
    assert expected in refused(monkeypatch, capsys, "reproduce", argument)
    assert not Path("runs").exists()


def test_a_file_in_the_place_of_the_archive_is_refused(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / "policies").touch()
    line = refused(monkeypatch, capsys, "reproduce", "out=report", "stages=[archive]")
    assert line == f"error: cannot write to the folder {tmp_path / 'report' / 'policies'}: Not a directory"
    assert "no policy of" in refused(monkeypatch, capsys, "reproduce", "out=report", "stages=[report]")


def test_what_the_last_command_would_refuse_is_refused_before_the_first_training(monkeypatch, capsys, tmp_path):
    """`posture.dynamics` needs longer trials than the others."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("posture.reproduce.__main__.TRAININGS", ("frequency", "map", "human"))  # to compose all is slow
    line = refused(monkeypatch, capsys, "reproduce", "overrides=['evaluation.duration=20']")
    assert "evaluation.duration: 20 s with a transient of 10 s has fewer than 3 cycles at 0.1 Hz" in line
    assert not Path("runs").exists()


def test_every_evaluation_takes_the_frequencies_of_the_overrides(monkeypatch, tmp_path):
    """But those in a ramp, which have no constant frequency."""
    from posture.cli.jobs import check
    from posture.config.eval import EvalConfig

    monkeypatch.chdir(tmp_path)
    config = check("reproduce", ReproduceConfig, ["overrides=['evaluation.freq=[0.4,1.2]']"]).jobs[0].config
    taken = {name: check("eval", EvalConfig, evaluation(name, config)).jobs[0].config for name in ("engines", "ramp_as_run")}
    assert taken["engines"].evaluation.freq == (0.4, 1.2)
    assert taken["ramp_as_run"].evaluation.freq != (0.4, 1.2) and taken["ramp_as_run"].env.ramp is not None


def test_a_folder_may_have_any_name(monkeypatch, tmp_path):
    """The commands that evaluate all seeds together get its path as it is."""
    from posture.cli.jobs import check
    from posture.config.map import MapConfig
    from posture.config.train import TrainConfig

    folder = tmp_path / "Müller (copy), a=b [1] 'x' $HOME"
    folder.mkdir()
    monkeypatch.chdir(folder)
    policies = check("train", TrainConfig, ["-m", "experiment=map"]).jobs
    config = check("reproduce", ReproduceConfig, []).jobs[0].config
    arguments = of_several_seeds("map", policies, config, folder / "report")
    (job,) = check("map", MapConfig, arguments).jobs
    assert job.folder == folder / "report" / "map"
    assert list(job.config.ckpt) == [str(policy.folder) for policy in policies]


def in_place_of_python(monkeypatch, program):
    """Let commands run this shell program, whose third argument is their first."""
    Path("python").write_text(f"#!/bin/sh\n{program}\n")
    Path("python").chmod(0o755)
    monkeypatch.setattr(sys, "executable", os.path.abspath("python"))


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX only")
def test_commands_run_two_at_the_same_time(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    in_place_of_python(
        monkeypatch, "mkdir $3; ls -d job* | wc -l >> counts; echo hello; sleep 0.3; rmdir $3; [ $3 != job3 ]"
    )
    starts = [Start("train", [f"job{number}"], Path(f"log{number}")) for number in range(5)]
    assert run_at_once(starts, 2)  # one of them fails
    assert max(map(int, Path("counts").read_text().split())) == 2
    assert all((start.folder / "log.txt").read_text() == "hello\n" for start in starts)
    assert not run_at_once(starts[:3], 2)


def test_a_job_can_be_run_by_a_command_of_its_own(monkeypatch, tmp_path):
    """With the overrides in which it differs from its sweep it has the same configuration and folder."""
    from posture.cli.jobs import check
    from posture.config.train import TrainConfig

    monkeypatch.chdir(tmp_path)
    sweep = ["-m", "experiment=energy", "env.freq=0.5", "seed=1,2"]
    jobs = check("train", TrainConfig, sweep).jobs
    assert len(jobs) == 18 and jobs[3].own == ("env.energy_weight=5", "seed=2")
    assert check("train", TrainConfig, [*sweep[:3], *jobs[3].own]).jobs == [jobs[3]]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX only")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP] if sys.platform != "win32" else [])
def test_a_signal_is_passed_on_and_the_training_may_save(monkeypatch, tmp_path, number):
    """By a program in place of a training that takes a moment to save."""
    monkeypatch.chdir(tmp_path)
    program = "trap 'sleep 0.3; touch saved; exit 1' TERM HUP; touch started; while true; do sleep 0.05; done"
    in_place_of_python(monkeypatch, program)
    monkeypatch.setattr(signals, "_hung_up", False)

    def stop():
        while not Path("started").exists():
            time.sleep(0.02)
        os.kill(os.getpid(), number)

    with signals.handled(), pytest.raises(signals.Stopped) as stopped:
        threading.Thread(target=stop, daemon=True).start()
        run("train", [])
    assert stopped.value.code == 128 + number and Path("saved").exists()
