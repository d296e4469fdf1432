"""`python -m posture.theory`: tables, map and errors."""

import math
from pathlib import Path

import pytest

from envs.body.segments import read_segments
from posture.config.theory import TheoryConfig
from posture.theory.prediction import cop_binds, predict
from posture.theory.tables import _steps
from tests.commands import call, refused, table
from tests.conftest import composed

pytestmark = pytest.mark.usefixtures("elsewhere")

TINY = [
    "evaluation.freq=[0.6,0.75]",
    "experiment_3.hip_k=[75,125]",
    "experiment_4b.step=4",
    "figure_13.hip_k=[50,125]",
    "figure_13.step=0.45",
    "around.ankle_k=[25]",
    "around.load=[0]",
    "around.tolerance=[0.025,0.2]",
    "search=[0.6,0.7]",
]
FILES = [
    *(f"{name}.csv" for name in ("around", "experiment_1", "experiment_3", "experiment_4b", "figure_13")),
    "theory_map.png",
    "transition.csv",
]


def test_tables_and_map(monkeypatch, capsys):
    call(monkeypatch, "theory", *TINY, "out=here")
    printed = capsys.readouterr().out
    assert sorted(path.name for path in Path("here").iterdir()) == FILES
    assert Path("here/theory_map.png").read_bytes().startswith(b"\x89PNG")
    for title in ("Exp. 1: hip 125 Nm/rad, load 0 kg", "Exp. 3: 0.5 Hz", "Exp. 4b: 0.4 Hz", "Fig. 13"):
        assert title in printed
    first, second = table(Path("here/experiment_1.csv"))
    assert (
        (first["least_mode"], second["least_mode"])
        == (first["paper_mode"], second["paper_mode"])
        == ("in-phase", "anti-phase")
    )
    assert [row["load_kg"] for row in table(Path("here/experiment_4b.csv"))] == ["0", "4"]
    soft, stiff = table(Path("here/figure_13.csv"))
    assert soft["sinusoid_transition_hz"] == "nan" and float(stiff["sinusoid_transition_hz"]) == pytest.approx(
        0.68, abs=0.005
    )
    assert stiff["mode_at_0.05_hz"] == "in" and soft["mode_at_0.5_hz"] == "anti"
    assert len(table(Path("here/around.csv"))) == 3  # a tolerance beyond the amplitude is left out


def test_without_values_around_the_stander_there_is_no_such_table(monkeypatch, capsys):
    Path("here").mkdir()
    Path("here/around.csv").write_text("of an earlier start")
    nothing = ["around.ankle_k=[]", "around.load=[]", "around.tolerance=[0.2]"]  # beyond the amplitude
    call(monkeypatch, "theory", *TINY, *nothing, "out=here")
    assert "one parameter varied" not in capsys.readouterr().out
    assert sorted(path.name for path in Path("here").iterdir()) == [name for name in FILES if name != "around.csv"]


def test_overrides_and_sweeps_make_a_folder_a_job(monkeypatch):
    call(monkeypatch, "theory", "-m", *TINY, "env.hip_k=75,100", "env.load=2")
    jobs = sorted(path for path in Path("runs").glob("*/*") if path.is_dir())
    assert [job.name[:2] for job in jobs] == ["0_", "1_"]
    for job, hip_k in zip(jobs, ("75", "100"), strict=True):
        row = table(job / "experiment_1.csv")[0]
        assert (row["hip_k_nm_per_rad"], row["load_kg"]) == (hip_k, "2")
        assert row["paper_mode"] == "-"  # the paper's stander had no load


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["env.hip_k=-5"], ["env.hip_k = -5", "greater than or equal to 0"]),
        (["env.ankle_k=-0.1"], ["env.ankle_k = -0.1"]),
        (["env.load=-1"], ["env.load = -1"]),
        (["tolerance=0.1"], ["tolerance: 0.1 m leaves the head no motion", "less than env.amplitude = 0.1 m"]),
        (["env.termination.head_tolerance=0.15"], ["tolerance: 0.15 m leaves the head no motion"]),
        (["tolerance=0"], ["tolerance", "greater than 0"]),
        (["search=[1.0,0.5]"], ["search: a range goes from low to high"]),
        (["experiment_4b.load=[4,0]"], ["experiment_4b.load: a range goes from low to high"]),
        (["env.hip_k=75,-1", "-m"], ["env.hip_k = -1"]),
        (["hip_k=75"], ["hip_k"]),
        (["env.amplitude=0.9", *TINY], ["head motion of 0.9 m within 0.025 m at 0.", "cannot be met", "inside the foot"]),
        (["env.torque_limit=1", *TINY], ["head motion of 0.1 m within 0.025 m at 0.6 Hz", "1 Nm a joint"]),
    ],
)
def test_bad_input_gets_one_line(monkeypatch, capsys, arguments, expected):
    line = refused(monkeypatch, capsys, "theory", *arguments)
    assert [part for part in expected if part not in line] == []


def test_the_tolerance_of_the_evaluation_counts_where_none_ends_the_episode():
    config = composed("theory", TheoryConfig, ("env=paper",))
    assert config.tolerance is None and config.head_tolerance == config.evaluation.tolerance


def test_a_motion_that_cannot_be_made_is_not_feasible(env_config):
    config = env_config("env.torque_limit=1")
    row = predict(read_segments(config), config, 0.6, 0.025, 100.0)
    assert row.feasible is False and math.isnan(row.least.cost) and row.least.mode == "undefined"
    assert row.sinusoid.cost > 1.0 and row.least.cop_binds == "-"


def test_where_the_centre_of_pressure_binds(stander):
    assert [cop_binds(stander, low, high) for low, high in ((-0.05, 0.12), (-0.06, 0.12), (-0.05, 0.13), (-0.06, 0.13))] == [
        "none", "heel", "toe", "both"]  # fmt: skip


def test_steps_end_where_they_should():
    assert _steps((0.0, 4.0), 0.5) == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0]
    assert _steps((0.05, 0.5), 0.05)[-2:] == [0.45, 0.5]
    assert _steps((0.0, 1.0), 0.4) == [0.0, 0.4, 0.8, 1.0]
