"""The warning of a training that ends before a schedule of a weight, and the weights that a training begins with."""

import hashlib
import importlib.metadata
import os
import shutil
from pathlib import Path

import pytest
import torch
import yaml

from posture.config.errors import ConfigError
from posture.learning import parallel
from posture.learning.learner import Learner
from posture.storage import checkpoint, run_dir
from posture.train import _learn, _report_unfinished_schedules
from tests.commands import TINY, call, refused, same
from tests.conftest import compose


@pytest.mark.parametrize(
    ("override", "begun_with", "line"),
    [
        ("max_iterations=1000", 1000, ""),
        ("max_iterations=1500", 1000, ""),
        ("env.reward.alive={start: 1.0, end: 2.0, until: 1.0}", 800, ""),
        (
            "env.reward.alive={start: 1.0, end: 2.0, until: 1.5}",
            800,
            "env.reward.alive: the schedule ends after 1200 iterations, the training after 800\n",
        ),
        (
            "max_iterations=300",  # resumed with fewer iterations than it began with
            1000,
            "env.reward.stay_weight, env.reward.target_weight, env.reward.ended: the schedule ends after 400 iterations, "
            "the training after 300\n",
        ),
    ],
)
def test_a_training_that_ends_before_a_schedule_says_so(capsys, override, begun_with, line):
    config = compose("max_iterations=800", override)
    _report_unfinished_schedules(config, begun_with * config.agent.num_steps_per_env)
    assert capsys.readouterr().out == line


QUICK = [*TINY, "evaluate=false", "out=tuned"]


@pytest.fixture
def run(sound, tmp_path, monkeypatch):
    """A trained run, in the working directory."""
    monkeypatch.chdir(tmp_path)
    return shutil.copytree(sound, tmp_path / "run")


@pytest.mark.parametrize("init", ["run", "run/model_1.pt", "latest"])
def test_a_training_begins_with_the_networks_and_normalisers_of_another(run, monkeypatch, init):
    """Not with its optimiser and counters. As it begins: learning nothing leaves the weights as they were."""
    if init == "latest":
        shutil.move("run", "runs/run")
    source = next(Path().glob(f"**/model_{1 if init.endswith('.pt') else 2}.pt"))
    began = {}

    def learn(self, iterations):
        began.update(self.alg.save(), done=self.current_learning_iteration, learning_rate=self.alg.learning_rate)

    monkeypatch.setattr(Learner, "learn", learn)
    call(monkeypatch, "train", *QUICK, f"init={init}", "env.load=4")
    saved = checkpoint.load(source, "cpu")
    assert all(same(began[name], saved[name]) for name in ("actor_state_dict", "critic_state_dict"))
    assert any("obs_normalizer" in name for name in saved["actor_state_dict"])
    assert began["done"] == 0 and began["learning_rate"] == compose().agent.algorithm.learning_rate
    assert began["optimizer_state_dict"]["state"] == {} and saved["optimizer_state_dict"]["state"]
    (start,) = yaml.safe_load(Path("tuned/provenance.yaml").read_text())
    digest = hashlib.sha256(source.read_bytes()).hexdigest()
    assert start["begun_from"] == {"checkpoint": str(source.absolute()), "sha256": digest}


def test_noise_below_its_bound_is_raised_to_it(run, monkeypatch):
    """Below it would have no gradient: rsl-rl clamps it."""
    model = run / "model_2.pt"
    content = checkpoint.load(model, "cpu")
    content["actor_state_dict"]["distribution.log_std_param"][:] = -9.0
    checkpoint.save(content, model)
    began = {}
    monkeypatch.setattr(Learner, "learn", lambda self, _: began.update(self.alg.save()))
    call(monkeypatch, "train", *QUICK, "init=run")
    lowest = compose().agent.actor.distribution_cfg.std_range[0]
    assert began["actor_state_dict"]["distribution.log_std_param"].exp().numpy() == pytest.approx(lowest)


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        (
            ["agent.actor.hidden_dims=[32,32]"],
            "the actor of run has other layers than this training (hidden_dims = [64, 64]",
        ),
        (
            ["agent.critic.activation=elu"],
            "the critic of run has other layers than this training (activation = swish, not elu)",
        ),
        (
            ["senses=frequency"],
            "the actor of run has other observations than this training (target_acceleration, target_freq",
        ),
        (
            ["agent.obs_groups.actor=[target_motion,policy]"],
            "the actor of run has its observations in another order",
        ),
        (["init=nowhere"], "nowhere: no such file or folder; allowed are a checkpoint or a run of your own, or latest"),
        (["init=pretrained"], "init: pretrained comes without the value function that a training goes on from; allowed are"),
    ],
)
def test_another_network_or_observation_is_refused(run, monkeypatch, capsys, changes, problem):
    assert problem in refused(monkeypatch, capsys, "train", *QUICK, "init=run", *changes)
    assert not Path("tuned").exists()


def test_a_shipped_policy_is_known_by_any_path(run, monkeypatch, capsys):
    path = os.path.relpath(run_dir.PRETRAINED / "default")
    assert f"init: {path} comes without the value" in refused(monkeypatch, capsys, "train", *QUICK, f"init={path}")


def test_weights_that_do_not_fit_their_configuration_are_refused(run, monkeypatch, capsys):
    content = checkpoint.load(run / "model_2.pt", "cpu")
    content["critic_state_dict"]["mlp.0.weight"] = torch.zeros(3, 3)
    checkpoint.save(content, run / "model_2.pt")
    assert "mlp.0.weight is float32 of shape (3, 3)" in refused(monkeypatch, capsys, "train", *QUICK, "init=run")


def test_the_latest_run_changes_during_a_sweep(run, monkeypatch, capsys):
    shutil.move("run", "runs/run")
    line = refused(monkeypatch, capsys, "train", "-m", *QUICK, "seed=1,2", "init=latest")
    assert "init=latest changes during a sweep" in line


def test_wandb_without_the_package(run, monkeypatch, capsys):
    def missing(name):
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr("posture.train.importlib.metadata.version", missing)
    line = refused(monkeypatch, capsys, "train", *QUICK, "agent.logger=wandb")
    assert "agent.logger=wandb needs the package wandb: python -m pip install" in line


def test_checkpoints_are_evaluated_only_where_they_are_saved(run, monkeypatch, capsys):
    line = refused(monkeypatch, capsys, "train", *QUICK, "agent.save_interval=4", "film_every=6")
    assert "film_every = 6: allowed is a multiple of agent.save_interval, 4" in line
    assert "without evaluate_every" in refused(monkeypatch, capsys, "train", *QUICK, "patience=3")
    line = refused(monkeypatch, capsys, "train", *QUICK, "agent.save_interval=1", "max_iterations=2", "evaluate_every=3")
    assert "evaluate_every = 3: allowed is at most max_iterations, 2" in line


def test_on_a_gpu_the_standers_are_not_shared_among_processes():
    assert compose("device=cuda", "env.num_envs=1001", "processes=2").env.num_envs == 1001
    with pytest.raises(ConfigError, match="1001 cannot be shared equally among 2 processes"):
        compose("env.num_envs=1001", "processes=2")


def test_with_a_recurrent_layer_every_mini_batch_has_worlds():
    """24 worlds in 16 mini-batches would leave 8 out, and 8 worlds would fill none."""
    for worlds in (8, 24):
        with pytest.raises(ConfigError, match=f"num_envs = {worlds}: with a recurrent layer allowed is .*, 16"):
            compose("senses=recurrent", f"env.num_envs={worlds}", "processes=1")
    assert compose("senses=recurrent", "env.num_envs=32", "processes=1").env.num_envs == 32


def test_processes_of_torchrun_do_not_share_a_gpu(monkeypatch, tmp_path):
    monkeypatch.setattr(parallel, "size", lambda: 2)
    with pytest.raises(ConfigError, match="each process has a GPU of its own; give cuda, not cuda:0"):
        _learn(compose("device=cuda:0"), tmp_path, False, 1)
    assert list(tmp_path.iterdir()) == []
