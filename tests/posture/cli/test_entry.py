"""The command line as users meet it: real runs of tiny size, and one clear line with exit code 2 for bad input."""

import subprocess
import sys
from pathlib import Path

import pytest
import torch
import yaml

from posture.storage import run_dir
from tests.commands import TINY, call, refused, runs, table


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    """Runs go to runs/ of the current directory: an empty one of the test's own."""
    monkeypatch.chdir(tmp_path)


# -- bad input -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("argument", "expected"),
    [
        ("env.frequency=1", ["env.frequency: no such key", "num_envs, freq, ramp"]),
        ("+env.frequency=1", ["env.frequency: no such key"]),
        ("env.freq=[", ["no viable alternative"]),
        ("env.freq=fast", ["env.freq = fast", "allowed is a number, or a range"]),
        ("env.freq=-1", ["env.freq"]),
        ("env.freq=[1.0,0.5]", ["from low to high"]),
        ("env.ramp={start: 0.0, rate: -0.1, duration: 5.0}", ["the ramp ends at -0.5 Hz"]),
        ("env.episode_steps=0", ["env.episode_steps = 0", "greater than or equal to 1"]),
        ("env.episode_steps=[9,3]", ["episode_steps: a range goes from low to high"]),
        ("env.hip_k=-5", ["env.hip_k = -5", "greater than or equal to 0"]),
        ("env.hip_k=nan", ["env.hip_k", "finite"]),
        ("env.num_envs=0", ["env.num_envs = 0", "greater than or equal to 1"]),
        ("env.num_envs=2.5", ["env.num_envs = 2.5", "integer"]),
        ("env.control_dt=0", ["env.control_dt"]),
        ("env.termination.head_tolerance=0.3", ["head_tolerance", "at most the target's amplitude of 0.1 m"]),
        ("env.observations.policy=[head,balance]", ["'balance': must be", "joint_angle"]),
        ("agent.obs_groups.actor=[foot_wrench]", ["agent.obs_groups.actor", "foot_wrench not among"]),
        ("env.num_envs=2 agent.num_steps_per_env=4", ["4 samples a process do not fill 16 mini-batches"]),
        ("env.num_envs=3", ["env.num_envs = 3 cannot be shared equally among 2 processes"]),
        ("processes=0", ["processes = 0"]),
        ("agent.algorithm.gamma=1.5", ["agent.algorithm.gamma = 1.5", "less than or equal to 1"]),
        ("agent.actor.class_name=os.system", ["agent.actor.class_name", "MLPModel"]),
        ("env=papers", ["env/papers", "authors_code"]),
        ("device=cuda:77", ["device", "cuda"]),
        ("device=cpu:0", ["device: 'cpu:0' is not known"]),
        ("env.load=true", ["env.load", "true is not allowed here"]),
        ("env=null", ["group override must be a string"]),
        ("agent.actor.distribution_cfg.init_std=2", ["init_std = 2 must lie within std_range"]),
        ("evaluation.duration=10.01", ["leaves nothing of a trial of 10.01 s"]),
        ("-m resume=a,b", ["resume continues one run"]),
        ("device=tpu", ["device: 'tpu' is not known; allowed are cpu, cuda"]),
        ("max_iterations=0", ["max_iterations = 0"]),
        ("env.reward.alive={start: 1.0, end: -1.0, steps: 5}", ["both be positive or both negative"]),
        ("env.reward.alive=x", ["env.reward.alive = x: allowed is a number, or a schedule"]),
        ("env.reward.alive={start: 1.0}", ["env.reward.alive = {'start': 1.0}: allowed is a number, or a schedule"]),
        ("env.reward.scale=0", ["env.reward.scale = 0"]),
        ("evaluation.transient=100", ["leaves nothing of a trial of 100 s"]),
        ("resume=runs/none", ["runs/none: not a run folder"]),
        ("resume=latest", ["latest: no run with a checkpoint"]),
        ("env.hip_k=25,50,...,190 -m", ["190 is not reached"]),
        ("env.hip_k=25,50,-1 -m", ["env.hip_k = -1"]),
    ],
)
def test_bad_input_to_train(monkeypatch, capsys, argument, expected):
    pieces = [argument] if "{" in argument else argument.split()
    line = refused(monkeypatch, capsys, "train", *pieces)
    for part in expected:
        assert part in line
    assert runs() == []


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
    assert "freq" in refused(monkeypatch, capsys, "eval", "evaluation.freq=[]")


def test_a_python_process_exits_with_2(tmp_path):
    told = subprocess.run(
        [sys.executable, "-m", "posture.train", "env.hip_k=-5"], capture_output=True, text=True, cwd=tmp_path
    )
    assert told.returncode == 2
    assert told.stderr.strip() == "error: env.hip_k = -5: must be greater than or equal to 0"


# -- runs ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A run of two tiny iterations, with its evaluation, made once."""
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
    assert all(row["fell"] == "True" and row["valid"] == "False" and row["cost"] == "nan" for row in rows)
    assert (folder / "trajectories.npz").exists() and len(list(folder.glob("*.png"))) >= 7


def test_an_evaluation_by_other_libraries_does_not_count(trained, monkeypatch):
    from posture.evaluation.trial import AS_TRAINED, is_current

    model, run = run_dir.newest_model(trained), run_dir.read_config(trained)
    asked = (trained / "evaluation", model, run, run.evaluation, AS_TRAINED, "cpu")
    assert is_current(*asked)
    monkeypatch.setattr(run_dir, "versions", lambda: {"newton": "0.1"})
    assert not is_current(*asked)


def test_tensorboard_has_the_curves(trained):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    curves = EventAccumulator(str(trained))
    curves.Reload()
    assert {"/cost", "/tracking_error_mm", "Loss/learning_rate", "Perf/total_fps"} <= set(curves.Tags()["scalars"])
    assert len(curves.Scalars("/cost")) == 2


def test_eval_by_file_folder_and_latest_agree(trained, monkeypatch, capsys):
    monkeypatch.chdir(trained.parent.parent)
    tables = []
    for ckpt, out in ((trained, "a"), (trained / "model_2.pt", "b"), ("latest", "c")):
        call(monkeypatch, "eval", f"ckpt={ckpt}", f"out={out}", *(t for t in TINY if t.startswith("evaluation")))
        tables.append(Path(out, "metrics.csv").read_text())
    assert tables[0] == tables[1] == tables[2] == (trained / "evaluation" / "metrics.csv").read_text()
    assert "fell" in capsys.readouterr().out


def test_eval_may_change_the_subject(trained, monkeypatch):
    evaluation = [t for t in TINY if t.startswith("evaluation")]
    before = (trained / "evaluation" / "metrics.csv").read_bytes()
    call(monkeypatch, "eval", f"ckpt={trained}", "env.load=4", "env.hip_k=60", "env.physics=mujoco", *evaluation)
    folder = trained / "evaluation_hip_k-60_load-4_physics-mujoco"
    row = table(folder / "metrics.csv")[0]
    tried = yaml.safe_load((folder / "trial.yaml").read_text())["env"]
    assert tried["load"] == 4.0 and tried["physics"] == "mujoco"
    assert (trained / "evaluation" / "metrics.csv").read_bytes() == before
    assert float(row["load_kg"]) == 4.0 and float(row["hip_k_nm_per_rad"]) == 60.0


def same(a, b):
    """Whether two checkpoints hold the same numbers, bit for bit."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    return torch.equal(a, b) if isinstance(a, torch.Tensor) else a == b


@pytest.mark.parametrize("processes", [1, 2])
def test_resume_goes_on_exactly(monkeypatch, capsys, processes):
    """Two iterations, a break and two more equal four without a break, bit for bit."""
    quick = [*TINY, "evaluate=false", "env.num_envs=16", f"processes={processes}"]
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
        assert same(one["env"], other_one["env"]) and same(one["rng"], other_one["rng"])

    kept = {path: path.read_bytes() for path in run.glob("*.yaml")}
    assert len(yaml.safe_load((run / "provenance.yaml").read_text())) == 2
    assert "it is a total" in refused(monkeypatch, capsys, "train", f"resume={run}", "max_iterations=4")
    line = refused(monkeypatch, capsys, "train", f"resume={run}", "max_iterations=5", "env.hip_k=50")
    assert "env.hip_k cannot be changed" in line
    (run / "resume.pt").write_bytes(b"damaged")
    assert "resume.pt: not a checkpoint" in refused(monkeypatch, capsys, "train", f"resume={run}", "max_iterations=6")
    assert kept == {path: path.read_bytes() for path in run.glob("*.yaml")}


def test_a_run_trained_elsewhere_can_be_evaluated_here(trained, monkeypatch, tmp_path):
    """The device that a run was trained on need not exist where it is evaluated."""
    config = yaml.safe_load((trained / "config.yaml").read_text())
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config | {"device": "cuda"}))
    (tmp_path / "model_2.pt").write_bytes((trained / "model_2.pt").read_bytes())
    call(monkeypatch, "eval", f"ckpt={tmp_path}", *(t for t in TINY if t.startswith("evaluation")))
    assert (tmp_path / "evaluation" / "metrics.csv").exists()


def test_an_unwritable_folder_is_said_before_anything_is_computed(trained, monkeypatch, capsys):
    assert "cannot write to the folder /proc" in refused(monkeypatch, capsys, "eval", f"ckpt={trained}", "out=/proc")


def test_a_sweep_makes_a_folder_a_job_and_eval_one_table(monkeypatch):
    call(monkeypatch, "train", "-m", "env.hip_k=25,75,...,175", *TINY, "max_iterations=1", "evaluate=false")
    (sweep,) = runs()
    jobs = sorted(path for path in sweep.iterdir() if path.is_dir())
    assert len(jobs) == 4
    assert not [path for path in jobs if {"=", ","} & set(path.name)]
    stiffness = [yaml.safe_load((job / "config.yaml").read_text())["env"]["hip_k"] for job in run_dir.runs_in(sweep)]
    assert stiffness == [25.0, 75.0, 125.0, 175.0]
    call(monkeypatch, "eval", f"ckpt={sweep}", *(t for t in TINY if t.startswith("evaluation")))
    rows = table(sweep / "metrics.csv")
    assert [float(row["hip_k_nm_per_rad"]) for row in rows] == [25.0, 25.0, 75.0, 75.0, 125.0, 125.0, 175.0, 175.0]
    assert len({row["run"] for row in rows}) == 4


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
