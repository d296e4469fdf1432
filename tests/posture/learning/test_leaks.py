"""Long trainings and long sweeps in one process: memory and open files stay flat."""

import gc
import os
import time

import pytest
import torch

from envs.task.head_tracking import HeadTrackingEnv
from posture.learning.learner import Learner
from tests.commands import TINY, call
from tests.conftest import compose

ALLOWED = 1.05
"""Growth that may be noise of the allocator; of the resident memory once all is loaded and warm."""


def resident():
    """Resident memory of this process [bytes]."""
    gc.collect()
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def open_files():
    return len(os.listdir("/proc/self/fd"))


def check_training(folder, iterations):
    config = compose(*TINY, "agent.save_interval=100")
    env = HeadTrackingEnv(config.env, 0, "cpu")
    learner = Learner(env, config.agent, folder, "cpu")
    env.warm_up()
    learner.train(iterations // 5)  # what grows once: caches, TensorBoard's file, the logger's buffers
    memory, files = resident(), open_files()
    learner.train(iterations)
    told = f"memory {memory / 1e6:.1f} -> {resident() / 1e6:.1f} MB, files {files} -> {open_files()}"
    print(told)
    assert resident() < ALLOWED * memory and open_files() <= files, told


def check_sweep(monkeypatch, jobs, warm):
    marks = []

    def sweep(first, last):
        call(monkeypatch, "train", "-m", *TINY, "max_iterations=1", "evaluate=false", f"seed=range({first},{last})")
        marks.append((resident(), open_files()))

    sweep(0, warm)
    sweep(warm, jobs)
    (memory, files), (later, more) = marks
    told = f"memory {memory / 1e6:.1f} -> {later / 1e6:.1f} MB, files {files} -> {more}"
    print(told)
    assert later < ALLOWED * memory and more <= files, told


def check_resets(worlds, steps):
    """Every episode ends after its first step. Returns world steps a second."""
    changes = ["env.episode_steps=1", f"env.num_envs={worlds}", "processes=1", "agent.algorithm.num_mini_batches=1"]
    env = HeadTrackingEnv(compose(*changes).env, 0, "cpu")
    action = torch.zeros(worlds, 2)
    for _ in range(steps // 5):
        assert env.step(action)[2].all()
    memory, files, began = resident(), open_files(), time.perf_counter()
    for _ in range(steps):
        _, _, done, _ = env.step(action)
    speed = worlds * steps / (time.perf_counter() - began)
    told = f"memory {memory / 1e6:.1f} -> {resident() / 1e6:.1f} MB, files {files} -> {open_files()}, {speed:,.0f} steps/s"
    print(told)
    assert bool(done.all()) and int(env.episode.min()) == steps + steps // 5
    assert resident() < ALLOWED * memory and open_files() <= files, told
    return speed


def test_a_training_does_not_grow(tmp_path):
    check_training(tmp_path, 100)


@pytest.mark.slow
def test_a_thousand_iterations_do_not_grow(tmp_path):
    check_training(tmp_path, 1000)


def test_a_sweep_does_not_grow(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    check_sweep(monkeypatch, 8, 3)


@pytest.mark.slow
def test_fifty_jobs_do_not_grow(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    check_sweep(monkeypatch, 50, 10)


def test_resets_at_every_step_do_not_grow():
    assert check_resets(64, 500) > 1000


@pytest.mark.slow
def test_many_resets_do_not_grow():
    check_resets(2048, 2000)
