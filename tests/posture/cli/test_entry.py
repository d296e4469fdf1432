"""Commands as users type them: real runs of tiny size, and one clear line with exit code 2 for bad input."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import torch
import yaml

from posture.storage import provenance, run_dir
from tests.commands import CONSTANT, EVALUATION, TINY, call, refused, runs, same, table

pytestmark = pytest.mark.usefixtures("elsewhere")

NO_FIGURES = ["evaluation.figures=false"]


# -- bad input -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("argument", "expected"),
    [
        ("env.frequency=1", "env.frequency: no such key; allowed there are num_envs, freq, ramp"),
        ("+env.frequency=1", "env.frequency: no such key"),
        ("env.ramp.start=0.1", "env.ramp has none; give all of it, as in 'env.ramp={start: .., rate: .., duration: ..}'"),
        ("env.sensing.noise.head=0.1", "env.sensing.noise.head: no such key; +env.sensing.noise.head=.. adds it"),
        ("env.sensing.delay=0.008", "env.sensing.delay: has no effect below half a control step of 0.0166 s"),
        ("env.reward=[1]", "env.reward: it has keys of its own, which are given one by one, as in env.reward.<key>=.."),
        ("resume.run=1", "resume.run: no such key, since resume has none"),
        ("env.freq=[", "no viable alternative"),
        ("env=papers", "Could not find 'env/papers'"),
        ("env=null", "group override must be a string"),
        ("env.reward.alive={start: 1.0, end: -1.0, until: 0.5}", "both be positive or both negative"),
        ("env.reward.alive={start: 1.0}", "allowed is a number, or a schedule"),
        ("device=cuda:77", "cuda"),
        ("device=cpu:0", "device: 'cpu:0' is not known"),
        ("device=tpu", "device: 'tpu' is not known; allowed are cpu, cuda"),
        ("resume=runs/none", "runs/none: not a run folder"),
        ("resume=latest", "latest: no run with a checkpoint"),
    ],
)
def test_bad_input_to_train(monkeypatch, capsys, argument, expected):
    assert expected in refused(monkeypatch, capsys, "train", argument)
    assert runs() == []


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["hydra.verbose=[1]"], "A logger name must be a string"),
        (["hydra.job_logging.version=7"], "Unsupported version: 7"),
        (["hydra.job_logging.version=7", "-m", "seed=1,2"], "Unsupported version: 7"),
        (["hydra/launcher=joblib", "hydra.launcher.n_jobs=0", "-m", "seed=1,2"], "n_jobs == 0 in Parallel has no meaning"),
    ],
)
def test_a_key_of_hydra_with_which_it_cannot_start(monkeypatch, capsys, arguments, expected):
    line = refused(monkeypatch, capsys, "train", *TINY, *arguments)
    assert line.startswith("error: Hydra cannot start the command, see its keys hydra.*: ") and expected in line
    assert not list(Path.cwd().rglob("config.yaml"))


@pytest.mark.skipif(torch.cuda.is_available(), reason="this machine has CUDA")
def test_cuda_without_cuda(monkeypatch, capsys):
    assert "finds no CUDA device; use cpu" in refused(monkeypatch, capsys, "train", "device=cuda")


def test_bad_input_to_eval(monkeypatch, capsys, tmp_path):
    assert "no such file or folder" in refused(monkeypatch, capsys, "eval", "ckpt=runs/none")
    assert "latest: no run with a checkpoint" in refused(monkeypatch, capsys, "eval")
    (tmp_path / "empty").mkdir()
    assert "neither a run folder" in refused(monkeypatch, capsys, "eval", "ckpt=empty")
    (tmp_path / "stray.pt").write_bytes(b"x")
    assert "no config.yaml beside it" in refused(monkeypatch, capsys, "eval", "ckpt=stray.pt")


# -- runs ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A run of two tiny iterations with its evaluation, trained once for all tests."""
    folder = tmp_path_factory.mktemp("trained")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        call(patch, "train", *TINY)
        return folder / runs()[0]


def test_a_run_folder_explains_itself(trained):
    files = {path.name for path in trained.iterdir()}
    assert {"config.yaml", "provenance.yaml", "model_1.pt", "model_2.pt", "resume.pt", "evaluation"} <= files
    assert any(name.startswith("events.out.tfevents") for name in files)
    config = yaml.safe_load((trained / "config.yaml").read_text())
    assert config["env"]["num_envs"] == 8 and config["seed"] == 1
    provenance = yaml.safe_load((trained / "provenance.yaml").read_text())
    assert len(provenance) == 1 and provenance[0]["versions"]["newton"] and "git_commit" in provenance[0]
    assert not [path for path in trained.rglob("*.tmp")]


def test_evaluation_writes_trajectories_metrics_and_figures(trained):
    folder = trained / "evaluation"
    rows = table(folder / "metrics.csv")
    assert [float(row["freq_hz"]) for row in rows] == [0.5, 1.5]
    fallen = [row for row in rows if row["fell"] == "True"]
    assert fallen and all(row["valid"] == "False" and row["cost"] == "nan" for row in fallen)
    assert (folder / "trajectories.npz").exists() and len(list(folder.glob("*.png"))) >= 7


def counts(run):
    """Whether the evaluation of a run counts as that of its policy."""
    from posture.evaluation.trial import AS_TRAINED, is_current

    config = run_dir.read_config(run)
    return is_current(run / "evaluation", run_dir.newest_model(run), config, config.evaluation, AS_TRAINED, "cpu")


def test_an_evaluation_by_other_libraries_does_not_count(trained, monkeypatch):
    assert counts(trained)
    monkeypatch.setattr(provenance, "library_versions", lambda: {"newton": "0.1"})
    assert not counts(trained)


@pytest.mark.parametrize("name", ["metrics.csv", "trajectories.npz"])
def test_damaged_results_are_computed_again(trained, monkeypatch, capsys, tmp_path, name):
    run = shutil.copytree(trained, tmp_path / "run")
    path = run / "evaluation" / name
    whole = path.read_bytes()
    header = whole.splitlines(keepends=True)[0]
    assert counts(run)
    path.unlink()
    assert not counts(run)
    for damage in (b"", header, whole[: len(whole) * 2 // 3], b"\xff" + whole, whole.replace(b"5", b"6", 1)):
        path.write_bytes(damage)
        assert not counts(run)
    assert not evaluated_before(monkeypatch, capsys, run)
    assert path.read_bytes() == whole
    assert evaluated_before(monkeypatch, capsys, run)


def evaluated_before(monkeypatch, capsys, run):
    call(monkeypatch, "eval", f"ckpt={run}", "again=false", *EVALUATION, "evaluation.figures=false")
    printed = capsys.readouterr().out
    assert " 0.5 " in printed and " 1.5 " in printed  # both rows of the table
    return "evaluated before" in printed


def test_tensorboard_has_the_curves(trained):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    curves = EventAccumulator(str(trained))
    curves.Reload()
    assert {"/cost", "/tracking_error_mm", "Loss/learning_rate", "Perf/total_fps"} <= set(curves.Tags()["scalars"])
    assert [value.step for value in curves.Scalars("/cost")] == [1, 2]  # as in model_1.pt and model_2.pt


def test_eval_by_file_folder_and_latest_agree(trained, monkeypatch, capsys):
    monkeypatch.chdir(trained.parent.parent)
    tables = []
    for ckpt, out in ((trained, "a"), (trained / "model_2.pt", "b"), ("latest", "c")):
        call(monkeypatch, "eval", f"ckpt={ckpt}", f"out={out}", *EVALUATION, *NO_FIGURES)
        tables.append(Path(out, "metrics.csv").read_text())
    assert tables[0] == tables[1] == tables[2] == (trained / "evaluation" / "metrics.csv").read_text()
    assert "fell" in capsys.readouterr().out


def test_eval_may_take_the_contacts_of_mujoco(trained, monkeypatch, capsys):
    call(monkeypatch, "eval", f"ckpt={trained}", "env.solver.contact_bias=false", *EVALUATION, *NO_FIGURES)
    (folder,) = trained.glob("evaluation_solver*")
    assert folder.name == "evaluation_solver-contact_bias-False"
    solver = yaml.safe_load((folder / "trial.yaml").read_text())["env"]["solver"]
    assert solver["contact_bias"] is False and solver["substeps"] == 2
    line = refused(monkeypatch, capsys, "eval", f"ckpt={trained}", "env.solver.contact_bias=5")
    assert "env.solver.contact_bias = 5" in line
    lqr = ["policy=lqr", "env.solver.contact_bias=false", "lqr.env.solver.contact_bias=true"]
    line = refused(monkeypatch, capsys, "eval", *lqr)
    assert "lqr.env.solver.contact_bias: has no effect beside env.solver.contact_bias" in line


def test_eval_may_change_the_subject(trained, monkeypatch):
    before = (trained / "evaluation" / "metrics.csv").read_bytes()
    call(
        monkeypatch, "eval", f"ckpt={trained}", "env.load=4", "env.hip_k=60", "env.physics=mujoco", *EVALUATION, *NO_FIGURES
    )
    folder = trained / "evaluation_hip_k-60_load-4_physics-mujoco"
    row = table(folder / "metrics.csv")[0]
    tried = yaml.safe_load((folder / "trial.yaml").read_text())["env"]
    assert tried["load"] == 4.0 and tried["physics"] == "mujoco"
    assert (trained / "evaluation" / "metrics.csv").read_bytes() == before
    assert float(row["load_kg"]) == 4.0 and float(row["hip_k_nm_per_rad"]) == 60.0


@pytest.mark.parametrize("processes", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_resume_continues_exactly(monkeypatch, capsys, processes):
    """Two iterations, a break and two more equal four without a break, bit for bit."""
    quick = [*TINY, *CONSTANT, "evaluate=false", "env.num_envs=16", f"processes={processes}"]
    call(monkeypatch, "train", *quick)
    run = runs()[0]
    call(monkeypatch, "train", f"resume={run}", "max_iterations=4")
    assert runs() == [run]
    call(monkeypatch, "train", *quick, "max_iterations=4")
    other = runs()[1]
    assert {path.name for path in run.glob("model_*")} == {f"model_{n}.pt" for n in (1, 2, 3, 4)}
    ours, theirs = (torch.load(path / "model_4.pt", weights_only=True) for path in (run, other))
    assert ours["iter"] == 4 and same(ours, theirs)
    ours, theirs = (torch.load(path / "resume.pt", weights_only=True) for path in (run, other))
    assert len(ours["processes"]) == processes
    for one, other_one in zip(ours["processes"], theirs["processes"], strict=True):
        assert (one["env"].pop("training_steps"), other_one["env"].pop("training_steps")) == (2 * 4, 4 * 4)
        assert same(one["env"], other_one["env"]) and same(one["rng"], other_one["rng"])

    kept = {path: path.read_bytes() for path in run.glob("*.yaml")}
    assert len(yaml.safe_load((run / "provenance.yaml").read_text())) == 2
    assert "it is a total" in refused(monkeypatch, capsys, "train", f"resume={run}", "max_iterations=4")
    line = refused(monkeypatch, capsys, "train", f"resume={run}", "max_iterations=5", "env.hip_k=50")
    assert "env.hip_k cannot be changed" in line
    (run / "resume.pt").write_bytes(b"damaged")
    assert "resume.pt: not a checkpoint" in refused(monkeypatch, capsys, "train", f"resume={run}", "max_iterations=6")
    assert kept == {path: path.read_bytes() for path in run.glob("*.yaml")}


def test_a_run_trained_on_another_device_can_be_evaluated_here(trained, monkeypatch, tmp_path):
    config = yaml.safe_load((trained / "config.yaml").read_text())
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config | {"device": "cuda"}))
    (tmp_path / "model_2.pt").write_bytes((trained / "model_2.pt").read_bytes())
    call(monkeypatch, "eval", f"ckpt={tmp_path}", *EVALUATION, *NO_FIGURES)
    assert (tmp_path / "evaluation" / "metrics.csv").exists()


def test_an_unwritable_folder_is_refused_before_anything_is_computed(trained, monkeypatch, capsys):
    assert "cannot write to the folder /proc" in refused(monkeypatch, capsys, "eval", f"ckpt={trained}", "out=/proc")


def test_a_sweep_makes_a_folder_a_job_and_eval_one_table(monkeypatch):
    call(monkeypatch, "train", "-m", "env.hip_k=25,100,...,175", *TINY, "max_iterations=1", "evaluate=false")
    (sweep,) = runs()
    assert sorted(path.name for path in sweep.iterdir() if path.is_dir()) == ["0_hip_k-25", "1_hip_k-100", "2_hip_k-175"]
    call(monkeypatch, "eval", f"ckpt={sweep}", *EVALUATION, *NO_FIGURES)
    rows = table(sweep / "metrics.csv")
    assert [float(row["hip_k_nm_per_rad"]) for row in rows] == [25.0, 25.0, 100.0, 100.0, 175.0, 175.0]
    assert len({row["run"] for row in rows}) == 3
    # The first run has these hips anyway; the table is one of changed bodies all the same.
    call(monkeypatch, "eval", f"ckpt={sweep}", "env.hip_k=25", *EVALUATION, *NO_FIGURES)
    assert table(sweep / "metrics.csv") == rows
    assert {row["hip_k_nm_per_rad"] for row in table(sweep / "metrics_hip_k-25.csv")} == {"25"}


def test_two_runs_of_the_same_second_do_not_share_a_folder():
    folders = []
    for _ in range(5):
        folders.append(run_dir.folder_for("runs", None))
        Path(folders[-1]).mkdir(parents=True)
    assert len(set(folders)) == 5
    other = subprocess.run(
        [sys.executable, "-c", "from posture.storage import run_dir; print(run_dir.folder_for('runs', None))"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert other.stdout.strip() not in folders
