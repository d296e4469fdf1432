"""Checkpoints of rsl-rl's own runner as run folders."""

import os
import shutil
from pathlib import Path

import pytest
import torch
import yaml
from rsl_rl.runners import OnPolicyRunner

from envs.task.head_tracking import HeadTrackingEnv
from posture.storage import checkpoint
from posture.storage.run_dir import read_config
from tests.commands import TINY, call, refused, same, table
from tests.conftest import compose

pytestmark = pytest.mark.usefixtures("elsewhere")


@pytest.fixture(scope="module")
def stock(tmp_path_factory):
    """The checkpoint that rsl-rl saves after two iterations."""
    folder = tmp_path_factory.mktemp("stock")
    config = compose(*TINY)
    env = HeadTrackingEnv(config.env, 1, "cpu")
    agent = config.agent.model_dump(mode="json", exclude_none=True, exclude={"std_floor", "average_from"})
    OnPolicyRunner(env, agent, log_dir=str(folder), device="cpu").learn(2)
    return folder / "model_1.pt"


def test_it_is_evaluated_and_fine_tuned_like_a_run(stock, monkeypatch):
    call(monkeypatch, "import_checkpoint", f"file={stock}", "out=run", "seed=7")
    own, theirs = checkpoint.load(Path("run/model_2.pt"), "cpu"), torch.load(stock, weights_only=True)
    assert own.pop("iter") == theirs.pop("iter") + 1 == 2  # rsl-rl saves the index of the last iteration
    assert same(own, theirs)
    assert read_config(Path("run")).seed == 7
    (start,) = yaml.safe_load(Path("run/provenance.yaml").read_text())
    assert start["begun_from"]["checkpoint"] == str(stock)
    call(
        monkeypatch,
        "eval",
        "ckpt=run",
        "evaluation.duration=0.2",
        "evaluation.transient=0",
        "evaluation.figures=false",
        "out=e",
    )
    assert len(table(Path("e/metrics.csv"))) == 10
    call(monkeypatch, "train", *TINY, "init=run", "max_iterations=1", "evaluate=false", "out=tuned")
    assert Path("tuned/model_1.pt").exists()


def test_what_does_not_fit_is_refused_and_nothing_is_written(stock, monkeypatch, capsys):
    line = refused(monkeypatch, capsys, "import_checkpoint", f"file={stock}", "out=run", "senses=position")
    assert "does not hold this run's policy (" in line and "allowed is float32" in line
    assert "name the checkpoint to import" in refused(monkeypatch, capsys, "import_checkpoint", "out=run")
    line = refused(monkeypatch, capsys, "import_checkpoint", f"file={stock}", "out=run", "processes=1")
    assert "processes: has no effect on an import" in line
    assert "posture.import_checkpoint" in refused(monkeypatch, capsys, "train", f"init={stock}")
    torch.save(torch.load(stock, weights_only=True) | {"iter": 10_000_000}, "late.pt")
    assert "max_iterations = 10000001" in refused(monkeypatch, capsys, "import_checkpoint", "file=late.pt", "out=run")
    assert not Path("run").exists()


def test_a_checkpoint_of_our_own_run_is_refused(sound, monkeypatch, capsys):
    line = refused(monkeypatch, capsys, "import_checkpoint", f"file={sound / 'model_2.pt'}", "out=run")
    assert "is a checkpoint of a run of posture, which ckpt= and init= take as it is" in line


def test_a_pickle_that_would_run_code_is_refused_and_runs_none(stock, monkeypatch, capsys):
    class Trap:
        def __reduce__(self):
            return os.mkdir, ("trap",)

    torch.save(torch.load(stock, weights_only=True) | {"infos": Trap()}, "model_1.pt")
    line = refused(monkeypatch, capsys, "import_checkpoint", "file=model_1.pt", "out=run")
    assert "holds more than tensors and plain values" in line
    assert not Path("trap").exists() and not Path("run").exists()
    torch.save(torch.load(stock, weights_only=True) | {"iter": "1"}, "model_1.pt")
    assert "iter = '1'" in refused(monkeypatch, capsys, "import_checkpoint", "file=model_1.pt", "out=run")


def test_a_folder_with_another_checkpoint_is_refused(stock, sound, monkeypatch, capsys):
    shutil.copytree(sound, "run")
    before = Path("run/model_2.pt").read_bytes()
    refused(monkeypatch, capsys, "import_checkpoint", f"file={stock}", "out=run")
    assert Path("run/model_2.pt").read_bytes() == before
