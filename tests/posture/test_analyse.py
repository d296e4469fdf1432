"""posture.analyse as users type it: the examples of the documentation, groups, and bad input in one line."""

import math
import os
import re
import runpy
import shlex
import shutil
from pathlib import Path

import pytest
import yaml

from tests.commands import call, refused, table
from tests.posture.analysis.trials import angle_difference
from tests.posture.recording.people import lines, recording, times, write

pytestmark = pytest.mark.usefixtures("elsewhere")

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples" / "recordings"
RAD = "time,hip_flexion_r_rad,ankle_angle_r_rad"


# -- the examples ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def made():
    """The script that made the examples."""
    return runpy.run_path(str(ROOT / "examples" / "synthetic_recordings.py"))


def test_the_examples_are_what_their_script_makes(made):
    files = made["recordings"]()
    assert sorted(files) == sorted(path.name for path in EXAMPLES.iterdir())
    for name, expected in files.items():
        text = (EXAMPLES / name).read_text(encoding="utf-8")
        assert text == "\n".join(expected) + "\n" and text.startswith("# synthetic")


def test_a_group_of_examples(monkeypatch, made, capsys):
    """The phases that were put into the examples come out."""
    names = [f"{EXAMPLES}/*_slow.csv", f"{EXAMPLES}/*_fast.csv"]
    more = [r"subject=S\d+", "prediction=true", "evaluation.figures=false"]
    call(monkeypatch, "analyse", f"recording=[{','.join(names)}]", *more, "out=out")
    printed = capsys.readouterr().out
    files = {path.name for path in Path("out").iterdir()}
    assert files == {"metrics.csv", "cycles.csv", "group.csv", "table.md", "analysis.yaml"}
    rows = table(Path("out/metrics.csv"))
    assert len(rows) == 6
    for row in rows:
        slow, fast = made["PHASES"][row["subject"]]
        is_slow = "slow" in row["recording"]
        # The phase wanders by 10 deg with a correlation over two seconds, so that the mean of 20 s is known to about 4 deg.
        assert angle_difference(float(row["phase_mean_deg"]), slow if is_slow else fast) < 12
        assert angle_difference(float(row["hilbert_mean_deg"]), slow if is_slow else fast) < 12
        assert float(row["phase_resultant"]) > 0.9
        assert row["mode"] == row["least_mode"] == ("in-phase" if is_slow else "anti-phase")
        assert float(row["freq_hz"]) == pytest.approx(made["SLOW"] if is_slow else made["FAST"], abs=1e-3)
        assert row["freq_from"] == "target" and row["cycles_left_out"] == "1"
        assert (
            float(row["hip_ankle_r_cycle_low"]) < float(row["hip_ankle_r_cycle_mean"]) < float(row["hip_ankle_r_cycle_high"])
        )
        assert float(row["head_amplitude_m"]) == pytest.approx(0.95 * made["AMPLITUDE"], abs=0.004)
    groups = table(Path("out/group.csv"))
    assert [row["subject"] for row in groups] == 2 * ["S1", "S2", "S3", "all"]
    assert "1 of 6 cycles left out for gaps" in printed and "Rayleigh" in printed and "out/group.csv" in printed
    record = yaml.safe_load(Path("out/analysis.yaml").read_text())
    assert len(record["recordings"]) == 6 and record["analysis"]["prediction"] is True
    assert len(table(Path("out/cycles.csv"))) == sum(int(row["cycles"]) for row in rows)


def test_a_ramp(monkeypatch, made, capsys):
    call(monkeypatch, "analyse", f"recording={EXAMPLES}/S1_ramp.csv", "ramp=estimate", "out=out")
    (row,) = table(Path("out/metrics.csv"))
    for name in ("transition_centred_hz", "change_point_hz"):
        assert float(row[name]) == pytest.approx(made["SWITCH"], abs=0.05)
    assert {path.name for path in Path("out").iterdir()} == {"metrics.csv", "table.md", "analysis.yaml", "S1_ramp.png"}
    assert "change point" in capsys.readouterr().out


def documented():
    """The commands of docs/people.md that analyse files of this repository."""
    text = (ROOT / "docs" / "people.md").read_text(encoding="utf-8")
    found = re.findall(r"^python -m posture\.analyse (.*?)(?:\s+#.*)?$", text, flags=re.M)
    return [command for command in found if "examples/" in command]


@pytest.mark.parametrize("command", documented())
def test_documented_commands(monkeypatch, command):
    os.symlink(ROOT / "examples", "examples")
    call(monkeypatch, "analyse", *shlex.split(command), "evaluation.figures=false", "out=out")
    assert table(Path("out/metrics.csv"))


# -- files and folders -------------------------------------------------------------------------------------------------


def test_a_folder_and_names_that_occur_twice(monkeypatch):
    for folder in ("one", "two"):
        Path(folder).mkdir()
        write(Path(folder, "trial.csv"), lines(recording(0.5, time=times(20.0, 50.0)), RAD))
    Path("one/notes.md").write_text("none")
    call(monkeypatch, "analyse", "recording=[one,two/trial.csv,one/trial.csv]", "out=out")
    assert len(table(Path("out/metrics.csv"))) == 2
    assert {path.name for path in Path("out").glob("*.png")} == {"trial.png", "trial_2.png", "group.png"}


def test_an_earlier_analysis_survives_a_bad_file(monkeypatch, capsys):
    write(Path("a.csv"), lines(recording(0.5, time=times(20.0, 50.0)), RAD))
    call(monkeypatch, "analyse", "recording=a.csv", "out=out")
    before = {path.name: path.read_bytes() for path in Path("out").iterdir()}
    shutil.copy("a.csv", "b.csv")
    with open("b.csv", "a") as file:
        file.write("20.0,oops,0\n")
    capsys.readouterr()
    line = refused(monkeypatch, capsys, "analyse", "recording=[a.csv,b.csv]", "out=out")
    assert line == "error: b.csv: row 1002, column hip_flexion_r_rad: 'oops' is not a number"
    assert {path.name: path.read_bytes() for path in Path("out").iterdir()} == before


def test_many_recordings_in_several_processes(monkeypatch):
    for number in range(9):
        write(Path(f"{number}.csv"), lines(recording(0.5, 10.0 * number, times(20.0, 50.0)), RAD))
    call(monkeypatch, "analyse", "recording=.", "own_figures=8", "out=out")
    rows = table(Path("out/metrics.csv"))
    assert [row["recording"] for row in rows] == [f"{number}.csv" for number in range(9)]
    assert [float(row["phase_mean_deg"]) for row in rows] == pytest.approx([10.0 * number for number in range(9)], abs=0.1)
    files = {path.name for path in Path("out").iterdir()}
    assert files == {"metrics.csv", "cycles.csv", "group.csv", "group.png", "table.md", "analysis.yaml"}


MOTION = recording(0.5, time=times(20.0, 50.0))
STILL = recording(time=MOTION.time, hip=0 * MOTION.time, ankle=0 * MOTION.time)
CONTENT = {
    "none": None,
    "empty": b"",
    "one": b"time,hip_flexion_r_rad,ankle_angle_r_rad\n0,0.1,0.1\n",
    "sound": lines(MOTION, RAD),
    "short": lines(recording(time=times(8.0, 50.0)), RAD),
    "coarse": lines(recording(2.0, time=times(20.0, 10.0)), RAD),
    "still": lines(STILL, RAD),
}


@pytest.mark.parametrize(
    ("content", "arguments", "message"),
    [
        ("none", [], "recording: name a file, a folder or a pattern"),
        ("none", ["recording=none.csv"], "none.csv: no such file"),
        ("none", ["recording='data/*.csv'"], "recording: no file fits data/*.csv"),
        ("none", ["recording=empty"], "empty: no recording in this folder; allowed are .csv"),
        ("none", ["recording=notes.md"], "notes.md: not a recording by its name; allowed are .csv"),
        ("empty", [], "a.csv: is empty"),
        ("one", [], "a.csv: has 1 samples of hip and ankle"),
        ("short", [], "a.csv: evaluation.transient: 10 s leaves nothing of a trial that ends at 7.98 s"),
        ("coarse", [], "a.csv: has fewer than 6 samples in a cycle at 2 Hz"),
        ("still", [], "a.csv: no signal moves for a whole cycle, from which the frequency could be told; freq= gives it"),
        (
            "sound",
            ["ramp=fast"],
            "ramp = fast: allowed is a ramp {start: .., rate: .., duration: ..} in quotes, or estimate",
        ),
        ("sound", ["freq=0"], "freq = 0: must be greater than or equal to 0.001"),
        ("sound", ["subject='(S'"], "subject: '(S' is not a regular expression"),
        ("sound", ["subject=S9"], "a.csv: subject=S9 finds nothing in it"),
        ("sound", ["low_pass=30"], "a.csv: low_pass=30 is not below half its sampling rate of 50 Hz"),
        ("sound", ["freq=0.5", "low_pass=0.3"], "a.csv: low_pass=0.3 Hz takes away its motion at 0.5 Hz"),
        ("sound", ["freq=0.5", "high_pass=0.6"], "a.csv: high_pass=0.6 Hz takes away its motion at 0.5 Hz"),
        ("sound", ["low_pass=1", "high_pass=2"], "high_pass: 2 Hz leaves nothing below the low_pass of 1 Hz"),
        ("sound", ["scale.hip=0"], "scale.hip: 0 leaves nothing"),
        ("sound", ["ramp=estimate"], "a.csv: has neither target nor head"),
        ("sound", ["columns.hip=3"], "columns.hip: 3: allowed is the name of a column"),
        ("sound", ["out=/proc/analysis"], "cannot write to the folder /proc/analysis"),
        ("sound", ["env.hip_k=60"], "env.hip_k: has no effect without prediction=true"),
        ("sound", ["prediction=true", "env=many_bodies"], "env.ranges.hip_k: the prediction is of one body"),
    ],
)
def test_bad_input(monkeypatch, capsys, content, arguments, message):
    Path("empty").mkdir()
    Path("notes.md").write_text("none")
    if CONTENT[content] is not None:
        write(Path("a.csv"), CONTENT[content])
        arguments = ["recording=a.csv", *arguments]
    assert message in refused(monkeypatch, capsys, "analyse", *arguments)
    assert {path.name for path in Path.cwd().iterdir()} <= {"empty", "notes.md", "a.csv", "runs"}
    assert not list(Path.cwd().rglob("metrics.csv"))


def test_a_file_that_may_not_be_read(monkeypatch, capsys):
    write(Path("a.csv"), lines(MOTION, RAD))
    monkeypatch.setattr(Path, "read_bytes", lambda path: (_ for _ in ()).throw(PermissionError(13, "Permission denied")))
    assert "a.csv: cannot be read: Permission denied" in refused(monkeypatch, capsys, "analyse", "recording=a.csv")


def test_joints_that_hardly_move_are_remarked(monkeypatch, capsys):
    """As where angles in radians are called degrees."""
    write(Path("a.csv"), lines(MOTION, RAD.replace("_rad", "_deg")))
    call(monkeypatch, "analyse", "recording=a.csv", "evaluation.figures=false", "out=out")
    assert "a.csv: hip and ankle move by 0.21 and 0.1 deg, one of them by less than" in capsys.readouterr().out


def test_drift_that_turns_the_sign_of_r_and_another_frequency_than_the_target_has_are_remarked(monkeypatch, capsys):
    """Hip and ankle in phase that drift apart by 0.5 and -0.4 deg/s, as far as the joints move in about ten seconds."""
    time = times(40.0, 50.0)
    drift = recording(0.5, time=time)
    for i, (hip, ankle) in enumerate(((0.5, -0.4), (0.0, 0.0))):
        angles = {"hip": drift.hip + math.radians(hip) * time, "ankle": drift.ankle + math.radians(ankle) * time}
        moved = recording(0.5, time=time, **angles)
        write(Path(f"{i}.csv"), lines(moved, RAD))
        call(monkeypatch, "analyse", f"recording={i}.csv", "evaluation.figures=false", "out=out", "freq=0.5")
        printed = capsys.readouterr().out
        assert ("r, whose sign is the mode, is -0." in printed) == ("detrend=true" in printed) == (i == 0)
        assert "explains" not in printed
    call(monkeypatch, "analyse", "recording=1.csv", "evaluation.figures=false", "out=out", "freq=0.6")
    assert "1.csv: a sinusoid of freq=0.6 Hz explains 0 % of the variance of the target" in capsys.readouterr().out


def test_a_motion_without_one_frequency_is_remarked(monkeypatch, capsys):
    """And a motion that the body cannot make: a head that moves by 1 m to either side, twice a second."""
    time = times(30.0, 50.0)
    wide = recording(2.0, time=time)
    rows = lines(wide, RAD)
    rows = [f"{row},{'head_x_m' if i == 0 else repr(float(1.0 * wide.head[i - 1] / 0.08))}" for i, row in enumerate(rows)]
    write(Path("a.csv"), rows)
    call(monkeypatch, "analyse", "recording=a.csv", "prediction=true", "out=out", "evaluation.figures=false", "freq=2")
    assert "a.csv: the limits of foot and torque allow the body in env no such motion" in capsys.readouterr().out
    assert table(Path("out/metrics.csv"))[0]["least_hip_ankle_r"] == "nan"
    call(monkeypatch, "analyse", f"recording={EXAMPLES}/S1_ramp.csv", "out=other", "evaluation.figures=false")
    assert re.search(
        r"S1_ramp.csv: a sinusoid of 0\.\d+ Hz explains \d+ % of the variance of the target", capsys.readouterr().out
    )
