"""A saved configuration is read as plain values: nothing in it is executed, looked up or replaced."""

import os
import shutil

import pytest
import yaml
from omegaconf import OmegaConf

import envs.task.head_tracking
from posture.config.errors import ConfigError
from posture.storage.run_dir import read_config
from tests.commands import refused

SECRET = "the-secret-of-the-environment"
COMMANDS = {
    "eval": ("eval", "ckpt=run", "evaluation.duration=1.0", "evaluation.transient=0.1", "evaluation.freq=[0.5]"),
    "resume": ("train", "resume=run", "max_iterations=3"),
}


@pytest.fixture
def run(sound, tmp_path, monkeypatch):
    """A copy of a trained run, a secret in the environment, and a resolver and a module that leave a trace when used."""

    def fail(*_):
        raise AssertionError("physics was built")

    monkeypatch.setattr(envs.task.head_tracking, "simulate", fail)
    monkeypatch.setenv("CANARY", SECRET)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "trap.py").write_text("from pathlib import Path\nPath('canary').touch()\nclass Trap: ...\n")
    monkeypatch.syspath_prepend(tmp_path)
    OmegaConf.register_new_resolver("canary", lambda: (tmp_path / "canary").touch(), replace=True)
    yield shutil.copytree(sound, tmp_path / "run")
    OmegaConf.clear_resolver("canary")


def put(path, value):
    """A change of a saved configuration: `value` at the dotted `path`."""

    def change(values):
        *parents, last = path.split(".")
        for key in parents:
            values = values[key]
        values[last] = value

    return change


TAMPERED = {
    "target": put("env._target_", "os.system"),
    "target of the learner": put("agent.actor._target_", "trap.Trap"),
    "target of the evaluation": put("evaluation._target_", "trap.Trap"),
    "class of the actor": put("agent.actor.class_name", "trap:Trap"),
    "class of the critic": put("agent.critic.class_name", "trap:Trap"),
    "class of the algorithm": put("agent.algorithm.class_name", "trap:Trap"),
    "class of the distribution": put("agent.actor.distribution_cfg.class_name", "trap:Trap"),
    "optimiser": put("agent.algorithm.optimizer", "trap:Trap"),
    "activation": put("agent.actor.activation", "trap:Trap"),
    "extension": put("agent.algorithm.rnd_cfg", {"weight_schedule": "trap:Trap"}),
    "environment variable": put("device", "${oc.env:CANARY}"),
    "environment variable as a number": put("env.hip_k", "${oc.env:CANARY}"),
    "environment variable in a list": put("evaluation.freq", ["${oc.env:CANARY}"]),
    "environment variable within text": put("resume", "runs/${oc.env:CANARY}/x"),
    "environment variable as a key": put("env.reward", {"${oc.env:CANARY}": 1.0}),
    "nested": put("resume", "${oc.decode:${oc.env:CANARY}}"),
    "decoded": put("env.freq", "${oc.decode:'[0.1,1.0]'}"),
    "other key": put("env.hip_k", "${env.ankle_k}"),
    "resolver": put("resume", "${canary:}"),
    "resolver of ours": put("resume", "${posture.run_folder:/tmp,null}"),
    "defaults": put("defaults", ["/etc/passwd", {"env": "../../../trap"}]),
    "search path": put("hydra", {"searchpath": ["file:///tmp"]}),
    "callback": put("hydra", {"callbacks": {"x": {"_target_": "trap.Trap"}}}),
    "number as a key": put("evaluation", {1: 2}),
}
TEXTS = {
    "call": "!!python/object/apply:os.system ['touch canary']",
    "call by name": "env: !!python/name:trap.Trap",
    "import": "env: !!python/module:trap",
    "own tag": "env: !trap {a: 1}",
    "alias": "a: &a [1]\nb: [*a]",
    "endless": "a: &a\n  b: *a",
    "laughs": "a: &a [x,x]\nb: &b [*a,*a]\nc: [*b,*b]",
    "deep": "[" * 1500,
    "no date": "env: 2020-13-45",
    "long number": "seed: " + "9" * 5000,
    "unclosed": "env: {freq: [1",
    "bell": "env: \x07",
    "empty": "",
    "text": "hello",
    "list": "- env",
    "two documents": "a: 1\n---\nb: 2",
}


def refused_without_a_trace(monkeypatch, capsys, command):
    """The last line of the command's output; nothing may have been written."""
    before = sorted(os.listdir("run"))
    line = refused(monkeypatch, capsys, *COMMANDS[command])
    assert "config.yaml: " in line and SECRET not in line
    assert not os.path.exists("canary") and sorted(os.listdir("run")) == before
    return line


def tamper(run, name):
    values = yaml.safe_load((run / "config.yaml").read_text())
    TAMPERED[name](values)
    (run / "config.yaml").write_text(yaml.safe_dump(values))


def check_refused(run):
    with pytest.raises(ConfigError) as refusal:
        read_config(run)
    line = str(refusal.value)
    assert "config.yaml: " in line and "\n" not in line and SECRET not in line and not os.path.exists("canary")


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", ["target", "class of the actor", "environment variable", "nested", "resolver", "defaults"])
def test_a_tampered_configuration_ends_the_command(run, monkeypatch, capsys, command, name):
    tamper(run, name)
    refused_without_a_trace(monkeypatch, capsys, command)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", ["call", "laughs"])
def test_a_file_without_plain_values_ends_the_command(run, monkeypatch, capsys, command, name):
    (run / "config.yaml").write_text(TEXTS[name])
    refused_without_a_trace(monkeypatch, capsys, command)


@pytest.mark.parametrize("name", TAMPERED)
def test_a_tampered_configuration(run, name):
    tamper(run, name)
    check_refused(run)


@pytest.mark.parametrize("name", TEXTS)
def test_a_file_without_plain_values(run, name):
    (run / "config.yaml").write_text(TEXTS[name])
    check_refused(run)


def test_bytes_that_are_not_text(run):
    (run / "config.yaml").write_bytes(b"env: \xff\xfe")
    check_refused(run)


def test_the_traps_work(run, tmp_path):
    """The files above do harm when they are read without our checks."""
    trap = OmegaConf.create({"a": "${oc.env:CANARY}", "b": "${canary:}"})
    assert trap.a == SECRET and not (tmp_path / "canary").exists()
    assert trap.b is None and (tmp_path / "canary").exists()
    (tmp_path / "canary").unlink()
    import hydra

    hydra.utils.instantiate({"_target_": "trap.Trap"})
    assert (tmp_path / "canary").exists()
    (tmp_path / "canary").unlink()
    yaml.unsafe_load(TEXTS["call"])
    assert (tmp_path / "canary").exists()


def test_provenance_is_read_as_plain_values(run, monkeypatch, capsys):
    for text in (TEXTS["call"], TEXTS["unclosed"], "hello"):
        (run / "provenance.yaml").write_text(text)
        assert "provenance.yaml: " in refused(monkeypatch, capsys, *COMMANDS["resume"])
    assert not os.path.exists("canary")
