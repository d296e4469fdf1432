"""Where results go: a folder for every command and each job, and one for what differs from a run's own evaluation."""

from pathlib import Path

import pytest
import yaml

from posture.cli import entry
from posture.cli.jobs import check
from posture.eval import differences
from tests.commands import ENTRIES, EVALUATION, TINY, answer, call, refused, table
from tests.conftest import compose, compose_eval

pytestmark = pytest.mark.usefixtures("elsewhere")

TRIAL = [*EVALUATION, "evaluation.figures=false"]


def folders_of(command, *arguments):
    """The folders of the jobs of a command line relative to the working directory; None for a job without one."""
    found = []
    with pytest.MonkeyPatch.context() as patch:
        call(patch, command, *arguments, task=lambda config, folder: found.append(folder if entry.has_folder() else None))
    return [folder and folder.relative_to(Path.cwd()) for folder in found]


SWEPT = {
    "train": "seed=1,2",
    "import_checkpoint": "seed=1,2",
    "eval": "evaluation.transient=5,10",
    "analyse": "evaluation.transient=5,10",
    "map": "random=10,20",
    "dynamics": "repeats=2,3",
    "theory": "env.load=0,1",
    "film": "env.load=0,1",
    "export": "env.load=0,1",
    "play": "load=0,1",
    "reproduce": "seeds=1,2",
}


@pytest.mark.parametrize("command", ENTRIES)
def test_each_job_has_a_folder_of_its_own(command):
    needed = {"play": ["record=a.html"], "import_checkpoint": ["file=model_1.pt"]}.get(command, [])
    key = SWEPT[command].partition("=")[0].rpartition(".")[2]
    names = [f"{number}_{key}-{value}" for number, value in enumerate(SWEPT[command].partition("=")[2].split(","))]
    assert folders_of(command, *needed, "out=here/a b") == [Path("here/a b")]
    assert folders_of(command, *needed, "-m", SWEPT[command], "out=there") == [Path("there", name) for name in names]
    swept = [job.folder for job in check(command, ENTRIES[command][0], [*needed, "-m", SWEPT[command]]).jobs]
    assert [folder.name for folder in swept] == names and swept[0].parent == swept[1].parent
    (single,) = folders_of(command, *needed)
    if command == "reproduce":
        assert single == Path("results/reproduction")
    else:
        assert swept[0].parts[0] == "runs"
        assert single is None if command in ("eval", "play") else single.parts[0] == "runs"


def test_no_empty_folder_remains_after_bad_input(monkeypatch, capsys):
    Path("kept").mkdir()
    for arguments in (["out=a/b"], ["out=kept"], []):
        assert "nowhere: no such file" in refused(monkeypatch, capsys, "film", "ckpt=nowhere", *arguments)
    assert [path.name for path in Path().iterdir()] == ["kept"]


@pytest.mark.parametrize("out", ["5", "''", "[a,b]", "{a: b}"])
def test_out_is_a_path(out):
    code, stderr, _ = answer("theory", f"out={out}")
    assert code == 2 and stderr.startswith("error: out") and stderr.count("\n") == 1


def test_a_sweep_has_one_out():
    assert "out: allowed is one folder" in answer("theory", "-m", "out=a,b")[1]


def test_a_training_writes_into_out_and_an_evaluation_beside_it_where_something_differs(monkeypatch):
    call(monkeypatch, "train", *TINY, "max_iterations=1", "evaluation.figures=false", "out=run")
    own = Path("run/evaluation/trial.yaml").read_bytes()
    call(monkeypatch, "eval", "ckpt=run", *TRIAL, "evaluation.transient=0.2", "env.hip_k=60", "env.load=0")
    trial = yaml.safe_load(Path("run/evaluation_hip_k-60_transient-0.2/trial.yaml").read_text())
    assert trial["evaluation"]["transient"] == 0.2 and trial["env"]["hip_k"] == 60.0
    call(monkeypatch, "eval", "-m", "ckpt=run", *TRIAL, "evaluation.transient=0.3,0.4", "out=swept")
    for name, transient in (("0_transient-0.3", 0.3), ("1_transient-0.4", 0.4)):
        assert yaml.safe_load(Path("swept", name, "trial.yaml").read_text())["evaluation"]["transient"] == transient
        assert len(table(Path("swept", name, "metrics.csv"))) == 2
    assert {path.name for path in Path("run").glob("evaluation*")} == {"evaluation", "evaluation_hip_k-60_transient-0.2"}
    assert Path("run/evaluation/trial.yaml").read_bytes() == own


@pytest.mark.parametrize(
    ("run", "changes", "name"),
    [
        ([], [], []),
        ([], ["env.hip_k=125", "evaluation.figures=false", "env.ramp=none"], []),
        ([], ["evaluation.transient=5"], ["transient-5"]),
        ([], ["evaluation.tolerance=0.02", "evaluation.freq=[0.3,1.25]"], ["freq-0.3-1.25_tolerance-0.02"]),
        (["evaluation.transient=5"], [], ["transient-10"]),
        (["env.ramp={start:0.1,rate:0.1,duration:5}"], [], []),
        (["env.ramp={start:0.1,rate:0.1,duration:5}"], ["env.ramp=none"], ["ramp-none"]),
        ([], ["env.ramp={start:0.9,rate:-0.1,duration:5}"], ["ramp-start-0.9-rate--0.1-duration-5"]),
    ],
)
def test_what_differs_from_the_runs_own_evaluation(run, changes, name):
    assert differences(compose(*run), compose_eval(*changes)) == name


def test_a_record_stays_within_the_folder_of_its_job(monkeypatch, capsys):
    for path in ("/tmp/a.html", "../a.html"):
        assert "allowed is a path within" in refused(monkeypatch, capsys, "play", f"record={path}", "out=here")


@pytest.mark.parametrize("arguments", [["play", "-m", "port=8081,8082"], ["film", "-m", "width=360,400"]])
def test_what_no_job_could_run_is_refused_before_the_first(monkeypatch, capsys, tmp_path, arguments):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path))
    expected = {"play": "record: missing", "film": "with the encoder libx264: Permission denied"}[arguments[0]]
    assert expected in refused(monkeypatch, capsys, *arguments) and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["film", "export"])
def test_a_policy_that_is_missing_is_refused_before_the_first_job(monkeypatch, capsys, tmp_path, command):
    monkeypatch.chdir(tmp_path)
    line = refused(monkeypatch, capsys, command, "-m", "ckpt=pretrained,nope")
    assert "nope: no such file or folder" in line and list(tmp_path.iterdir()) == []
