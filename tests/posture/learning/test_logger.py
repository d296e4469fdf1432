"""The logger's sums over long episodes, and the loggers."""

import json
import shutil
import struct
import time
from pathlib import Path

import pytest
import torch
import wandb
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from posture.learning.logger import NullWriter, TrainingLogger
from posture.storage import checkpoint
from tests.commands import TINY, call, same


def test_reward_of_an_episode_of_ten_million_steps():
    """The last thousand steps of 0.09 each are added in full, although the sum is already 900,000."""
    logger = TrainingLogger(
        log_dir=None,
        cfg={"algorithm": {}},
        env_cfg={},
        num_envs=1,
        is_distributed=False,
        gpu_world_size=1,
        gpu_global_rank=0,
        device="cpu",
    )
    logger.writer = NullWriter()
    logger.cur_reward_sum.fill_(900_000.0)
    logger.cur_episode_length.fill_(9_999_000)
    for step in range(1000):
        logger.process_env_step(torch.tensor([0.09]), torch.tensor([step == 999]), {"log": {}})
    logger._note_ended_episodes()
    assert list(logger.rewbuffer) == pytest.approx([900_090.0], abs=1e-3)
    assert list(logger.lenbuffer) == [10_000_000]


# -- where the curves go -----------------------------------------------------------------------------------------------

QUICK = [*TINY, "evaluate=false", "out=run"]


def records(run):
    """What the log of Weights & Biases holds, in the order of its starts. Its format is LevelDB's log."""
    from wandb.proto.wandb_internal_pb2 import Record

    for path in sorted(Path(run).glob("wandb/offline-run-*/*.wandb")):
        data, at, record = path.read_bytes(), 7, b""
        while at + 7 <= len(data):
            if (left := 32768 - at % 32768) < 7:
                at += left
                continue
            _, size, kind = struct.unpack("<IHB", data[at : at + 7])
            record, at = record + data[at + 7 : at + 7 + size], at + 7 + size
            if kind in (1, 4):  # whole, or the last part
                yield Record.FromString(record)
                record = b""


def test_wandb_continues_the_run_of_a_training_that_is_resumed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("WANDB_MODE", "offline")
    call(monkeypatch, "train", *QUICK, "agent.logger=wandb")
    time.sleep(1.1)  # wandb's file is named by the second
    call(monkeypatch, "train", "resume=run", "max_iterations=4")
    found = list(records("run"))
    begun = [record.run for record in found if record.WhichOneof("record_type") == "run"]
    assert len(begun) == 2 and len({run.run_id for run in begun}) == 1
    assert {(run.project, run.display_name) for run in begun} == {("posture", "run")}
    history = [record.history for record in found if record.WhichOneof("record_type") == "history"]
    rows = [
        (row.step.num, {".".join(item.nested_key) or item.key: json.loads(item.value_json) for item in row.item})
        for row in history
    ]
    assert [step for step, _ in rows] == [1, 2, 3, 4]
    log = EventAccumulator("run").Reload()  # TensorBoard's has the same
    for tag in ("Loss/value", "Policy/mean_std", "/cost"):
        assert [(event.step, event.value) for event in log.Scalars(tag)] == [
            (step, pytest.approx(values[tag], rel=1e-6)) for step, values in rows
        ]


def test_wandb_that_cannot_begin(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("WANDB_MODE", "online")
    monkeypatch.setenv("WANDB_API_KEY", "")
    monkeypatch.setenv("HOME", str(tmp_path))
    wandb.teardown()  # it reads the environment once
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, "train", *QUICK, "agent.logger=wandb")
    lines = capsys.readouterr().err.strip().splitlines()
    assert stop.value.code == 1 and lines[-1].startswith("error: wandb: ") and "WANDB_MODE=offline" in lines[-1]


def test_without_a_log_the_policy_is_the_same(sound, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call(monkeypatch, "train", *QUICK, "agent.logger=none")
    assert not list(Path("run").glob("events*"))
    one, other = (checkpoint.load(folder / "model_2.pt", "cpu") for folder in (Path("run"), sound))
    assert same(one, other)


def test_another_logger_is_the_same_training(sound, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(sound, "run")
    call(monkeypatch, "train", *QUICK, "agent.logger=none")
    assert "already trained" in capsys.readouterr().out
