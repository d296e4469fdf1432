"""A run whose files are damaged, foreign or another's: one line and exit code 2, before physics is built.

For `posture.eval` and for `posture.train resume=`.
"""

import os
import shutil
import subprocess
import sys

import pytest
import torch

import envs.task.head_tracking
from posture.config.errors import ConfigError
from posture.learning.networks import load_policy
from posture.learning.resume import iterations_done
from posture.storage import checkpoint
from posture.storage.run_dir import read_config
from tests.commands import refused

SHORT = ["evaluation.duration=1.0", "evaluation.transient=0.1", "evaluation.freq=[0.5]", "evaluation.figures=false"]


@pytest.fixture
def run(sound, tmp_path, monkeypatch):
    """A copy of it, to be harmed; and no physics may be built."""

    def built(*_):
        raise AssertionError("physics was built")

    monkeypatch.setattr(envs.task.head_tracking, "simulate", built)
    monkeypatch.chdir(tmp_path)
    return shutil.copytree(sound, tmp_path / "run")


def line_of(check, *arguments):
    """The line that a command would answer with."""
    with pytest.raises(ConfigError) as refused:
        check(*arguments)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def policy_refused(run):
    return line_of(load_policy, checkpoint.load(run / "model_2.pt", "cpu"), read_config(run), run / "model_2.pt", "cpu")


def training_refused(run):
    return line_of(iterations_done, run)


CHECKED = {"eval": policy_refused, "resume": training_refused}


def eval_refused(monkeypatch, capsys, run):
    return refused(monkeypatch, capsys, "eval", f"ckpt={run}", *SHORT)


def resume_refused(monkeypatch, capsys, run):
    return refused(monkeypatch, capsys, "train", f"resume={run}", "max_iterations=3")


REFUSED = {"eval": eval_refused, "resume": resume_refused}


def changed(path, change):
    """Save a file anew, with a right digest, after `change` of its content."""
    content = checkpoint.load(path, "cpu")
    checkpoint.save(change(content) or content, path)


def empty(path):
    path.write_bytes(b"")


def truncated(path):
    path.write_bytes(path.read_bytes()[:-1000])


def flipped(path):
    whole = bytearray(path.read_bytes())
    whole[len(whole) // 2] ^= 1
    path.write_bytes(whole)


def without_digest(path):
    torch.save(torch.load(path, weights_only=True), path)


def text(path):
    path.write_text("weights: 1\n")


def folder(path):
    path.unlink()
    path.mkdir()


def image(path):
    from matplotlib import image as images

    images.imsave(path, torch.rand(8, 8).numpy(), format="png")


def pipe(path):
    path.unlink()
    os.mkfifo(path)


def foreign(path):
    checkpoint.save({"weights": torch.zeros(3)}, path)


def no_dict(path):
    checkpoint.save([torch.zeros(3000)], path)


DAMAGE = [
    (empty, "is empty"),
    (truncated, "does not end in a digest"),
    (flipped, "is damaged"),
    (without_digest, "does not end in a digest"),
    (text, "not a checkpoint"),
    (folder, "not a file"),
    (image, "not a checkpoint"),
    (pipe, "not a file"),
    (no_dict, "holds no named tensors"),
]


@pytest.mark.parametrize("command", REFUSED)
@pytest.mark.parametrize(("harm", "told"), DAMAGE, ids=lambda value: getattr(value, "__name__", ""))
def test_a_damaged_checkpoint(run, monkeypatch, capsys, command, harm, told):
    harm(run / "model_2.pt")
    line = REFUSED[command](monkeypatch, capsys, run)
    assert f"model_2.pt: {told}" in line and "allowed" in line
    assert not (run / "evaluation").exists()


@pytest.mark.parametrize(("harm", "told"), DAMAGE, ids=lambda value: getattr(value, "__name__", ""))
def test_a_damaged_state_of_the_training(run, monkeypatch, capsys, harm, told):
    harm(run / "resume.pt")
    line = resume_refused(monkeypatch, capsys, run)
    assert f"resume.pt: {told}" in line and "allowed" in line


def test_missing_files(run, monkeypatch, capsys):
    (run / "model_2.pt").unlink()
    assert "model_2.pt: no such checkpoint" in resume_refused(monkeypatch, capsys, run)
    (run / "model_1.pt").unlink()
    assert "no checkpoint (model_<n>.pt) in it yet" in eval_refused(monkeypatch, capsys, run)
    (run / "resume.pt").unlink()
    assert "resume.pt: no such checkpoint" in resume_refused(monkeypatch, capsys, run)
    (run / "config.yaml").unlink()
    assert "neither a run folder" in eval_refused(monkeypatch, capsys, run)
    assert "not a run folder" in resume_refused(monkeypatch, capsys, run)


def wider(content):
    content["actor_state_dict"]["mlp.0.weight"] = torch.zeros(64, 18)


def longer(content):
    content["actor_state_dict"]["mlp.9.weight"] = torch.zeros(2, 2)


def shorter(content):
    del content["actor_state_dict"]["mlp.0.bias"]


def doubles(content):
    content["actor_state_dict"] = {name: value.double() for name, value in content["actor_state_dict"].items()}


def listed(content):
    content["actor_state_dict"] = list(content["actor_state_dict"].values())


def spread(content):
    content["actor_state_dict"]["mlp.0.weight"] = torch.zeros(()).expand(2**30, 2**30)  # four exabytes, were it copied


def numbers(content):
    content["actor_state_dict"]["mlp.0.weight"] = 1.0


def nan(content):
    content["actor_state_dict"]["mlp.2.weight"][3, 4] = torch.nan


def infinite(content):
    content["actor_state_dict"]["obs_normalizer._std"][0, 1] = torch.inf


WRONG_POLICY = [
    (wider, "mlp.0.weight is float32 of shape (64, 18); allowed is float32 of shape (64, 17)"),
    (longer, "too much or missing: mlp.9.weight"),
    (shorter, "too much or missing: mlp.0.bias"),
    (doubles, "is float64"),
    (listed, "no actor_state_dict"),
    (spread, "mlp.0.weight is float32 of shape (1073741824, 1073741824)"),
    (numbers, "mlp.0.weight is float; allowed is float32"),
    (nan, "mlp.2.weight holds weights that are not finite"),
    (infinite, "obs_normalizer._std holds weights that are not finite"),
]


@pytest.mark.parametrize("check", CHECKED)
@pytest.mark.parametrize(("change", "told"), WRONG_POLICY, ids=lambda value: getattr(value, "__name__", ""))
def test_a_policy_that_is_not_the_runs(run, check, change, told):
    changed(run / "model_2.pt", change)
    line = CHECKED[check](run)
    assert "model_2.pt: " in line and told in line


@pytest.mark.parametrize("command", REFUSED)
@pytest.mark.parametrize("change", [foreign, wider, nan])
def test_a_policy_that_is_not_the_runs_ends_the_command(run, monkeypatch, capsys, command, change):
    if change is foreign:
        foreign(run / "model_2.pt")
    else:
        changed(run / "model_2.pt", change)
    assert "model_2.pt: " in REFUSED[command](monkeypatch, capsys, run)


@pytest.mark.parametrize("check", CHECKED)
@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        ("    - last_command\n", "", "(1, 17); allowed is float32 of shape (1, 15)"),
        ("    - last_command\n", "    - foot_wrench\n", "(1, 17); allowed is float32 of shape (1, 27)"),
        ("    - 64\n    - 64\n", "    - 64\n    - 32\n", "mlp.2.weight is float32 of shape (64, 64)"),
        ("    - 64\n    - 64\n", "    - 64\n", "too much or missing: mlp.4.bias, mlp.4.weight"),
    ],
)
def test_a_policy_of_another_configuration(run, check, before, after, told):
    """The file is whole; the run's configuration is of another network or of another number of observations."""
    text = (run / "config.yaml").read_text()
    assert before in text
    (run / "config.yaml").write_text(text.replace(before, after))
    line = CHECKED[check](run)
    assert "does not hold this run's policy" in line and told in line


def other_critic(content):
    content["critic_state_dict"]["mlp.0.weight"] = torch.zeros(3, 3)


def nan_critic(content):
    content["critic_state_dict"]["mlp.0.bias"][0] = torch.nan


def no_optimiser(content):
    del content["optimizer_state_dict"]


def other_optimiser(content):
    content["optimizer_state_dict"]["state"][1]["exp_avg"] = torch.zeros(3, 3)


def one_weight_more(content):
    content["optimizer_state_dict"]["param_groups"][0]["params"].append(99)


def nan_optimiser(content):
    content["optimizer_state_dict"]["state"][1]["exp_avg"].fill_(torch.nan)


def nan_rate(content):
    content["optimizer_state_dict"]["param_groups"][0]["lr"] = float("nan")


def other_iteration(content):
    content["iter"] = 1


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (other_critic, "value function (mlp.0.weight is float32 of shape (3, 3)"),
        (nan_critic, "mlp.0.bias holds weights that are not finite"),
        (no_optimiser, "no 'optimizer_state_dict'"),
        (other_optimiser, "exp_avg of weight 1 has the shape (3, 3)"),
        (one_weight_more, "training cannot continue from it"),
        (nan_optimiser, "not finite"),
        (nan_rate, "not finite"),
        (other_iteration, "saved after 1 iterations"),
    ],
)
def test_a_training_that_cannot_go_on(run, change, told):
    changed(run / "model_2.pt", change)
    line = training_refused(run)
    assert "model_2.pt: " in line and told in line


def other_worlds(content):
    content["processes"][0]["env"]["freq"] = torch.zeros(16)


def other_processes(content):
    content["processes"] = 2 * content["processes"]


def no_process(content):
    content["processes"] = []


def no_rng(content):
    content["processes"][0]["rng"] = torch.zeros(3, dtype=torch.uint8)


def no_logger(content):
    del content["processes"][0]["logger"]


def half_iteration(content):
    content["iteration"] = 1.5


def of_a_tensor(content):
    content["processes"] = torch.zeros(3)


def a_policy(content):
    return {"actor_state_dict": {}, "iter": 2}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (other_worlds, "freq is of 16 worlds, not 8"),
        (other_processes, "action is of 8 worlds, not 4"),
        (no_process, "not the state of this run"),
        (no_rng, "rng is not the state of a random number generator"),
        (no_logger, "no 'logger'"),
        (half_iteration, "iteration = 1.5, allowed is a whole number"),
        (of_a_tensor, "not the state of this run"),
        (a_policy, "no 'iteration'"),
    ],
)
def test_a_state_that_is_not_the_runs(run, change, told):
    changed(run / "resume.pt", change)
    line = training_refused(run)
    assert "resume.pt: " in line and told in line


def test_one_refused_policy_of_a_sweep_is_told_before_any_is_evaluated(run, monkeypatch, capsys):
    sweep = run.parent / "sweep"
    for name in ("0_a", "1_b"):
        shutil.copytree(run, sweep / name)
    flipped(sweep / "1_b" / "model_2.pt")
    assert "1_b/model_2.pt: is damaged" in eval_refused(monkeypatch, capsys, sweep)


@pytest.mark.parametrize("command", [["eval", "ckpt=run"], ["train", "resume=run", "max_iterations=3"]])
def test_physics_is_not_even_imported(run, command):
    flipped(run / "model_2.pt")
    code = (
        "import importlib, sys; from posture.cli import entry; from posture.config import eval, train\n"
        "name, module = sys.argv[1], importlib.import_module(f'posture.{sys.argv[1]}'); del sys.argv[1]\n"
        "try: entry.run(name, *{'eval': (eval.EvalConfig, getattr(module, 'evaluate_all', None)),"
        " 'train': (train.TrainConfig, getattr(module, 'train', None))}[name])\n"
        "finally: print(sorted({'torch', 'newton', 'mujoco'} & sys.modules.keys()))"
    )
    told = subprocess.run([sys.executable, "-c", code, *command], capture_output=True, text=True, cwd=run.parent)
    assert told.returncode == 2 and told.stdout.strip() == "['torch']"
    assert "run/model_2.pt: is damaged" in told.stderr and told.stderr.count("\n") == 1
