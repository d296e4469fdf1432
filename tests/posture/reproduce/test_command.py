"""The whole paper in one command, at tiny size: what it writes, what it skips, and what it says of what failed."""

import os
from pathlib import Path

import pytest

from posture.reproduce.page.page import Verdict
from posture.reproduce.ship import ship
from posture.storage import run_dir, yaml_files
from tests.commands import TINY, call, refused, table

TINIER = [option for option in TINY if not option.startswith(("evaluation.freq", "processes"))]
OVERRIDES = f"overrides=[{','.join(repr(option) for option in TINIER)}]"
QUICK = ["seeds=1", OVERRIDES, "out=report", "parallel=2"]


@pytest.fixture(scope="module")
def reproduced(tmp_path_factory):
    """Every experiment with untrained policies, which all fall, made once; and what it printed."""
    folder = tmp_path_factory.mktemp("reproduced")
    here = os.getcwd()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        call(patch, "reproduce", *QUICK)
    os.chdir(here)
    return folder


@pytest.mark.slow
def test_every_condition_is_trained_once(reproduced):
    counts = {name: len(run_dir.runs_in(reproduced / "runs" / name)) for name in ("frequency", "energy", "hip_stiffness")}
    assert counts == {"frequency": 1, "energy": 9, "hip_stiffness": 8}


@pytest.mark.slow
def test_the_tables_are_tidy(reproduced):
    tables = {path.stem: table(path) for path in (reproduced / "report" / "tables").glob("*.csv")}
    counts = {name: len(rows) for name, rows in tables.items()}
    expected = {"frequency": 15, "energy": 9, "hip_stiffness": 80, "ramp": 1, "load": 9, "amplitude": 40, "engines": 30}
    assert expected.items() <= counts.items()
    assert {row["physics"] for row in tables["engines"]} == {"sagittal", "mujoco", "mujoco_c"}
    assert all(row["seed"] == "1" for name in expected for row in tables[name])
    assert {float(row["load_kg"]) for row in tables["load"]} == {0.5 * i for i in range(9)}


@pytest.mark.slow
def test_the_page_claims_nothing_where_everybody_fell(reproduced):
    verdicts = {row["key"]: row["verdict"] for row in table(reproduced / "report" / "tables" / "verdicts.csv")}
    assert len(verdicts) >= 16
    assert {verdict for key, verdict in verdicts.items() if key.startswith("frequency")} == {"not"}
    text = (reproduced / "report" / "report.html").read_text()
    assert text.count("<img") >= 5 and "trained between" in text.lower()
    assert Verdict.REPRODUCED.value in text  # the word stands in the rules
    assert (reproduced / "report" / "summary.md").read_text().startswith("# ")


@pytest.mark.slow
def test_results_of_other_code_are_left_out_and_named(reproduced, monkeypatch, capfd):
    monkeypatch.chdir(reproduced)
    (run,) = run_dir.runs_in(Path("runs/frequency"))
    about = yaml_files.read_yaml(run / "evaluation" / "trial.yaml")
    try:
        yaml_files.write_yaml(run / "evaluation" / "trial.yaml", about | {"training_code": "of another day"})
        call(monkeypatch, "reproduce", "seeds=1", OVERRIDES, "out=other", "stages=[report]")
    finally:
        yaml_files.write_yaml(run / "evaluation" / "trial.yaml", about)
    for told in (capfd.readouterr().err, Path("other/summary.md").read_text(), Path("other/report.html").read_text()):
        assert "Left out" in told and f"1 ({run}/evaluation)" in told.replace("\\_", "_")
    verdicts = {row["key"]: row["verdict"] for row in table(Path("other/tables/verdicts.csv"))}
    assert {verdict for key, verdict in verdicts.items() if key.startswith("frequency")} == {"not measured"}


@pytest.mark.slow
def test_a_second_start_does_nothing_again(reproduced, monkeypatch, capfd):
    monkeypatch.chdir(reproduced)
    before = {path: path.stat().st_mtime_ns for path in Path("runs").rglob("*.npz")}
    assert before
    call(monkeypatch, "reproduce", *QUICK, "stages=[train,evaluate]")
    told = capfd.readouterr().out
    assert "sweep: 18 of 18 jobs done, 18 of them before" in told
    assert {path: path.stat().st_mtime_ns for path in Path("runs").rglob("*.npz")} == before


@pytest.mark.slow
def test_shipped_policies_are_small_and_can_be_evaluated(reproduced, monkeypatch, tmp_path):
    from posture.cli.jobs import check
    from posture.config.train import TrainConfig

    monkeypatch.chdir(reproduced)
    jobs = check("train", TrainConfig, ["-m", "experiment=energy", *TINIER]).jobs
    jobs += check("train", TrainConfig, ["-m", "experiment=frequency", *TINIER]).jobs
    monkeypatch.setattr(run_dir, "PRETRAINED", tmp_path)
    made = ship(jobs, tmp_path)
    assert sorted(path.name for path in made) == sorted(
        ["default", *(f"energy_weight-{gamma}" for gamma in range(0, 41, 5))]
    )
    assert all(sum(file.stat().st_size for file in path.iterdir()) < 60_000 for path in made)
    monkeypatch.chdir(tmp_path)
    trial = [option for option in TINIER if option.startswith("evaluation")]
    call(monkeypatch, "eval", "ckpt=pretrained/energy_weight-5", "out=a", "evaluation.freq=[0.4]", *trial)
    (original,) = (reproduced / "runs" / "energy").glob("energy_weight-5_*")
    assert table(Path("a/metrics.csv")) == table(original / "evaluation" / "metrics.csv")


@pytest.mark.parametrize(
    ("argument", "expected"),
    [
        ("seeds=0", "seeds = 0"),
        ("stages=[train,dream]", "stages"),
        ("launcher=fast", "launcher = 'fast'"),
        ("search=[1.0,0.5]", "from low to high"),
        ("overrides=['env.hip_k=-5']", "env.hip_k = -5"),
        ("stages=[report]", "no policy of Exp. 1 is done"),
    ],
)
def test_bad_input(monkeypatch, capsys, tmp_path, argument, expected):
    monkeypatch.chdir(tmp_path)
    assert expected in refused(monkeypatch, capsys, "reproduce", argument)
    assert not Path("runs").exists()
