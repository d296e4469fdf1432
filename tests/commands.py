"""Commands as users type them, run in this process, and their results."""

import contextlib
import csv
import io
import logging
import sys
from pathlib import Path

import pytest
import torch
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig

from posture.analyse import analyse_recordings
from posture.analyse import check as check_analyse
from posture.cli import entry
from posture.config.analyse import AnalyseConfig
from posture.config.dynamics import DynamicsConfig
from posture.config.eval import EvalConfig
from posture.config.export import ExportConfig
from posture.config.film import FilmConfig
from posture.config.import_checkpoint import ImportConfig
from posture.config.map import MapConfig
from posture.config.play import PlayConfig
from posture.config.reproduce import ReproduceConfig
from posture.config.theory import TheoryConfig
from posture.config.train import TrainConfig
from posture.dynamics.__main__ import check as check_dynamics
from posture.dynamics.__main__ import examine
from posture.eval import evaluate_all
from posture.export.__main__ import check as check_export
from posture.export.__main__ import export
from posture.film.__main__ import check as check_film
from posture.film.__main__ import film
from posture.import_checkpoint import import_checkpoint
from posture.map.__main__ import check as check_map
from posture.map.__main__ import make_map
from posture.play.__main__ import check as check_play
from posture.play.__main__ import play
from posture.reproduce.__main__ import reproduce
from posture.theory.__main__ import theory
from posture.train import check as check_train
from posture.train import train

SHORT = ["evaluation.duration=1.0", "evaluation.transient=0.1"]
EVALUATION = [*SHORT, "evaluation.freq=[0.5,1.5]"]
TINY = [
    "env.num_envs=8",
    "processes=1",
    "max_iterations=2",
    "agent.num_steps_per_env=4",
    "agent.algorithm.num_mini_batches=2",
    "agent.algorithm.num_learning_epochs=1",
    "agent.save_interval=1",
    *EVALUATION,
]
ANY_FREQ = [option for option in TINY if not option.startswith("evaluation.freq")]
"""For experiments that fix their frequencies."""
TINY_THEORY = [
    "evaluation.freq=[0.3]",
    "experiment_3.hip_k=[100]",
    "experiment_4b.step=4",
    "figure_13={hip_k: [50, 100], freq: [0.3, 0.5], step: 0.2}",
    "around={ankle_k: [25], load: [0], tolerance: [0.025]}",
    "search=[0.6,0.7]",
]
CONSTANT = ["env.reward.stay_weight=1.5", "env.reward.target_weight=1.5", "env.reward.ended=-9", "agent.std_floor=null"]
"""Schedules last as long as the training that began them; without them trainings of different lengths can be compared."""
ENTRIES = {
    "train": (TrainConfig, train, check_train),
    "import_checkpoint": (ImportConfig, import_checkpoint),
    "eval": (EvalConfig, evaluate_all),
    "analyse": (AnalyseConfig, analyse_recordings, check_analyse),
    "map": (MapConfig, make_map, check_map),
    "dynamics": (DynamicsConfig, examine, check_dynamics),
    "theory": (TheoryConfig, theory),
    "reproduce": (ReproduceConfig, reproduce),
    "play": (PlayConfig, play, check_play),
    "film": (FilmConfig, film, check_film),
    "export": (ExportConfig, export, check_export),
}


def call(monkeypatch, command, *arguments, task=None):
    """`python -m posture.<command> arguments` in this process, with another function as its task if one is given."""
    GlobalHydra.instance().clear()
    HydraConfig.instance().cfg = None
    monkeypatch.setattr(sys, "argv", [f"posture.{command}", *arguments])
    monkeypatch.setattr(logging, "raiseExceptions", False)  # Hydra logs to the stdout of an earlier test
    kind, *own = ENTRIES[command]
    entry.run(command, kind, *([task] if task else own))


def answer(command, *arguments):
    """Exit code, stderr, and the configurations that the jobs of a command line would have; nothing is run."""
    configs, stderr, code = [], io.StringIO(), 0
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stderr(stderr),
        contextlib.redirect_stdout(io.StringIO()),
    ):
        try:
            call(patch, command, *arguments, task=lambda config, folder: configs.append(config))
        except SystemExit as stop:
            code = stop.code
    return code, stderr.getvalue(), configs


def refused(monkeypatch, capsys, command, *arguments):
    """The one-line error for bad input."""
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, command, *arguments)
    printed = capsys.readouterr()
    assert stop.value.code == 2, printed.err
    lines = printed.err.strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("error: "), printed.err
    assert "Traceback" not in printed.err + printed.out
    return lines[0]


def table(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def runs():
    return sorted(path for path in Path("runs").glob("*") if path.is_dir())


def same(a, b):
    """Whether two checkpoints hold the same numbers, bit for bit."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    return torch.equal(a, b) if isinstance(a, torch.Tensor) else a == b
