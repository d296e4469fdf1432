"""Files of a run that are damaged, or belong to another run, are refused in one line before physics is imported."""

import os
import shutil
import subprocess
import sys
from functools import reduce

import pytest
import torch

import envs.task.head_tracking
from posture.config.errors import ConfigError
from posture.learning.networks import load_policy
from posture.learning.resume import iterations_done
from posture.storage import checkpoint
from posture.storage.run_dir import read_config
from tests.commands import refused

COMMANDS = {
    "eval": ["eval", "ckpt=run", "evaluation.duration=1.0", "evaluation.transient=0.1", "evaluation.freq=[0.5]"],
    "resume": ["train", "resume=run", "max_iterations=3"],
}


@pytest.fixture
def run(sound, tmp_path, monkeypatch):
    """A copy of a trained run. Building the simulation fails the test."""

    def fail(*_):
        raise AssertionError("physics was built")

    monkeypatch.setattr(envs.task.head_tracking, "simulate", fail)
    monkeypatch.chdir(tmp_path)
    return shutil.copytree(sound, tmp_path / "run")


def read_policy(run):
    """What `posture.eval` reads first."""
    load_policy(checkpoint.load(run / "model_2.pt", "cpu"), read_config(run), run / "model_2.pt", "cpu")


READERS = {"eval": read_policy, "resume": iterations_done}


def refusal(read, run):
    with pytest.raises(ConfigError) as refused:
        read(run)
    assert "\n" not in str(refused.value)
    return str(refused.value)


# -- damaged files ----------------------------------------------------------------------------------------------------


def flip_a_bit(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def replace_by_image(path):
    from matplotlib import image

    image.imsave(path, torch.rand(8, 8).numpy(), format="png")


def replace_by(make):
    def harm(path):
        path.unlink()
        make(path)

    return harm


DAMAGE = {
    "empty": (lambda path: path.write_bytes(b""), "is empty"),
    "truncated": (lambda path: path.write_bytes(path.read_bytes()[:-1000]), "does not end in a digest"),
    "flipped bit": (flip_a_bit, "is damaged"),
    "no digest": (lambda path: torch.save(torch.load(path, weights_only=True), path), "does not end in a digest"),
    "text": (lambda path: path.write_text("weights: 1\n"), "not a checkpoint"),
    "image": (replace_by_image, "not a checkpoint"),
    "folder": (replace_by(lambda path: path.mkdir()), "not a file"),
    "pipe": (replace_by(os.mkfifo), "not a file"),
    "list": (lambda path: checkpoint.save([torch.zeros(3000)], path), "holds no named tensors"),
}


@pytest.mark.parametrize(("command", "file"), [("eval", "model_2.pt"), ("resume", "model_2.pt"), ("resume", "resume.pt")])
@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_files(run, command, file, damage):
    harm, message = DAMAGE[damage]
    harm(run / file)
    line = refusal(READERS[command], run)
    assert f"{file}: {message}" in line and "allowed" in line


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_report_a_damaged_file_and_write_nothing(run, monkeypatch, capsys, command):
    flip_a_bit(run / "model_2.pt")
    before = sorted(run.iterdir())
    assert "model_2.pt: is damaged" in refused(monkeypatch, capsys, *COMMANDS[command])
    assert sorted(run.iterdir()) == before


def test_missing_files(run, monkeypatch, capsys):
    for file, command, message in (
        ("model_2.pt", "resume", "model_2.pt: no such checkpoint"),
        ("model_1.pt", "eval", "no checkpoint (model_<n>.pt) in it yet"),
        ("resume.pt", "resume", "resume.pt: no such checkpoint"),
        ("config.yaml", "eval", "neither a run folder"),
        ("config.yaml", "resume", "not a run folder"),
    ):
        (run / file).unlink(missing_ok=True)
        assert message in refused(monkeypatch, capsys, *COMMANDS[command])


def test_one_damaged_policy_of_a_sweep_is_reported_before_any_is_evaluated(run, monkeypatch, capsys):
    for name in ("0_a", "1_b"):
        shutil.copytree(run, run.parent / "sweep" / name)
    flip_a_bit(run.parent / "sweep" / "1_b" / "model_2.pt")
    assert "1_b/model_2.pt: is damaged" in refused(monkeypatch, capsys, "eval", "ckpt=sweep", *COMMANDS["eval"][2:])


@pytest.mark.parametrize("command", COMMANDS)
def test_physics_is_not_imported(run, command):
    flip_a_bit(run / "model_2.pt")
    code = (
        "import importlib, sys; from posture.cli import entry; from posture.config import eval, train\n"
        "name, module = sys.argv[1], importlib.import_module(f'posture.{sys.argv[1]}'); del sys.argv[1]\n"
        "try: entry.run(name, *{'eval': (eval.EvalConfig, getattr(module, 'evaluate_all', None)),"
        " 'train': (train.TrainConfig, getattr(module, 'train', None))}[name])\n"
        "finally: print(sorted({'torch', 'newton', 'mujoco'} & sys.modules.keys()))"
    )
    process = subprocess.run([sys.executable, "-c", code, *COMMANDS[command]], capture_output=True, text=True)
    assert process.returncode == 2 and process.stdout.strip() == "['torch']"
    assert "run/model_2.pt: is damaged" in process.stderr and process.stderr.count("\n") == 1


# -- files of another run ---------------------------------------------------------------------------------------------


def put(*keys, value):
    """A change of a checkpoint's content: `value` at the nested `keys`."""

    def change(content):
        reduce(lambda part, key: part[key], keys[:-1], content)[keys[-1]] = value

    return change


def remove(*keys):
    def change(content):
        del reduce(lambda part, key: part[key], keys[:-1], content)[keys[-1]]

    return change


def fill(*keys, value):
    """A change: `value` as the first number of the tensor at the nested `keys`."""
    return lambda content: reduce(lambda part, key: part[key], keys, content).view(-1)[:1].fill_(value)


def update_policy(function):
    return lambda content: content.update(actor_state_dict=function(content["actor_state_dict"]))


def save_changed(path, change):
    """Save a checkpoint again, with a correct digest, after `change` of its content."""
    content = checkpoint.load(path, "cpu")
    change(content)
    checkpoint.save(content, path)


def put_weight(value):
    return put("actor_state_dict", "mlp.0.weight", value=value)


OTHER_POLICY = {
    "wider": (
        put_weight(torch.zeros(64, 19)),
        "mlp.0.weight is float32 of shape (64, 19); allowed is float32 of shape (64, 18)",
    ),
    "deeper": (put("actor_state_dict", "mlp.9.weight", value=torch.zeros(2, 2)), ": mlp.9.weight"),
    "no bias": (remove("actor_state_dict", "mlp.0.bias"), ": mlp.0.bias"),
    "doubles": (update_policy(lambda state: {name: value.double() for name, value in state.items()}), "is float64"),
    "list": (update_policy(lambda state: list(state.values())), "no actor_state_dict"),
    "exabytes": (
        put_weight(torch.zeros(()).expand(2**30, 2**30)),
        "mlp.0.weight is float32 of shape (1073741824, 1073741824)",
    ),
    "number": (put_weight(1.0), "mlp.0.weight is float; allowed is float32"),
    "NaN": (fill("actor_state_dict", "mlp.2.weight", value=torch.nan), "mlp.2.weight holds weights that are not finite"),
    "infinite": (
        fill("actor_state_dict", "obs_normalizer._std", value=torch.inf),
        "obs_normalizer._std holds weights that are not finite",
    ),
    "foreign": (lambda content: [content.clear(), content.update(weights=torch.zeros(3))], "actor_state_dict"),
}


@pytest.mark.parametrize("command", READERS)
@pytest.mark.parametrize("case", OTHER_POLICY)
def test_another_policy(run, command, case):
    change, message = OTHER_POLICY[case]
    save_changed(run / "model_2.pt", change)
    line = refusal(READERS[command], run)
    assert "model_2.pt: " in line and message in line


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_report_another_policy(run, monkeypatch, capsys, command):
    save_changed(run / "model_2.pt", OTHER_POLICY["wider"][0])
    assert "model_2.pt: " in refused(monkeypatch, capsys, *COMMANDS[command])


@pytest.mark.parametrize("command", READERS)
@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("    - last_command\n", "", "(1, 18); allowed is float32 of shape (1, 16)"),
        ("    - last_command\n", "    - foot_wrench\n", "(1, 18); allowed is float32 of shape (1, 28)"),
        ("    - 64\n    - 64\n", "    - 64\n    - 32\n", "mlp.2.weight is float32 of shape (64, 64)"),
        ("    - 64\n    - 64\n", "    - 64\n", ": mlp.4.bias, mlp.4.weight"),
    ],
)
def test_a_configuration_with_another_network_or_other_observations(run, command, before, after, message):
    text = (run / "config.yaml").read_text()
    assert before in text
    (run / "config.yaml").write_text(text.replace(before, after))
    assert message in refusal(READERS[command], run)


FIRST_WEIGHT = ("optimizer_state_dict", "state", 1, "exp_avg")
FIRST_GROUP = ("optimizer_state_dict", "param_groups", 0)
FIRST_PROCESS = ("processes", 0)


@pytest.mark.parametrize(
    ("file", "change", "message"),
    [
        ("model_2.pt", put("critic_state_dict", "mlp.0.weight", value=torch.zeros(3, 3)), "is float32 of shape (3, 3)"),
        (
            "model_2.pt",
            fill("critic_state_dict", "mlp.0.bias", value=torch.nan),
            "mlp.0.bias holds weights that are not finite",
        ),
        ("model_2.pt", remove("optimizer_state_dict"), "no 'optimizer_state_dict'"),
        ("model_2.pt", put(*FIRST_WEIGHT, value=torch.zeros(3, 3)), "exp_avg of weight 1 has the shape (3, 3)"),
        ("model_2.pt", lambda content: content["optimizer_state_dict"]["param_groups"][0]["params"].append(99), ""),
        ("model_2.pt", fill(*FIRST_WEIGHT, value=torch.nan), "not finite"),
        ("model_2.pt", put(*FIRST_GROUP, "lr", value=float("nan")), "not finite"),
        ("model_2.pt", put("iter", value=1), "saved after 1 iterations"),
        ("resume.pt", put(*FIRST_PROCESS, "env", "freq", value=torch.zeros(16)), "16 worlds, not 8"),
        ("resume.pt", lambda content: content.update(processes=2 * content["processes"]), "8 worlds, not 4"),
        ("resume.pt", put("processes", value=[]), "not the state of this run"),
        ("resume.pt", put(*FIRST_PROCESS, "rng", value=torch.zeros(3, dtype=torch.uint8)), "random number generator"),
        ("resume.pt", remove(*FIRST_PROCESS, "logger"), "no 'logger'"),
        ("resume.pt", put("iteration", value=1.5), "iteration = 1.5, allowed is a whole number"),
        ("resume.pt", put("processes", value=torch.zeros(3)), "not the state of this run"),
        ("resume.pt", lambda content: [content.clear(), content.update(actor_state_dict={}, iter=2)], "no 'iteration'"),
    ],
)
def test_a_training_that_cannot_be_resumed(run, file, change, message):
    save_changed(run / file, change)
    line = refusal(iterations_done, run)
    assert f"{file}: " in line and message in line
