"""Commands as users type them, run in this process, and what comes of them."""

import csv
import sys
from pathlib import Path

import pytest
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig

from posture.cli import entry
from posture.config.eval import EvalConfig
from posture.config.export import ExportConfig
from posture.config.reproduce import ReproduceConfig
from posture.config.train import TrainConfig
from posture.eval import evaluate_all
from posture.export.__main__ import export
from posture.reproduce.__main__ import reproduce
from posture.train import train

TINY = [
    "env.num_envs=8",
    "processes=1",
    "max_iterations=2",
    "agent.num_steps_per_env=4",
    "agent.algorithm.num_mini_batches=2",
    "agent.algorithm.num_learning_epochs=1",
    "agent.save_interval=1",
    "evaluation.duration=1.0",
    "evaluation.transient=0.1",
    "evaluation.freq=[0.5,1.5]",
]
TINY_THEORY = [
    "evaluation.freq=[0.3]",
    "experiment_3.hip_k=[100]",
    "experiment_4b.step=4",
    "figure_13={hip_k: [50, 100], freq: [0.3, 0.5], step: 0.2}",
    "around={ankle_k: [25], load: [0], tolerance: [0.025]}",
]
ENTRIES = {
    "train": (TrainConfig, train),
    "eval": (EvalConfig, evaluate_all),
    "export": (ExportConfig, export),
    "reproduce": (ReproduceConfig, reproduce),
}


def call(monkeypatch, command, *arguments):
    """`python -m posture.<command> arguments` in this process."""
    GlobalHydra.instance().clear()
    HydraConfig.instance().cfg = None
    monkeypatch.setattr(sys, "argv", [f"posture.{command}", *arguments])
    kind, task = ENTRIES[command]
    entry.run(command, kind, task)


def refused(monkeypatch, capsys, command, *arguments):
    """The one line that bad input is answered with."""
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, command, *arguments)
    told = capsys.readouterr()
    assert stop.value.code == 2, told.err
    lines = told.err.strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("error: "), told.err
    assert "Traceback" not in told.err + told.out
    return lines[0]


def table(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def runs():
    return sorted(path for path in Path("runs").glob("*") if path.is_dir())
