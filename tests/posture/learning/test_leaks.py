"""Long trainings and long sweeps in one process keep no files, tensors, objects or memory of what is over."""

import gc
import os
import sys

import pytest
import torch

from envs.task.head_tracking import HeadTrackingEnv
from posture.learning.learner import Learner
from tests.commands import TINY, call
from tests.conftest import compose

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows does not list a process's open files")


def held():
    """Open files, tensors and all objects that the garbage collector tracks."""
    gc.collect()
    objects = gc.get_objects()
    return len(os.listdir("/dev/fd")), sum(issubclass(type(thing), torch.Tensor) for thing in objects), len(objects)


def assert_no_growth(work, repetitions, objects_each=1):
    """Run `work` often: no file or tensor more than after the first times, and fewer than `objects_each` objects more."""
    work(3)  # what is made once: caches, imported modules, buffers
    files, tensors, objects = held()
    work(repetitions)
    more_files, more_tensors, more_objects = held()
    assert more_files <= files and more_tensors <= tensors
    assert more_objects - objects < objects_each * repetitions


def learner(folder, *overrides):
    config = compose(*TINY, "agent.save_interval=20", *overrides)
    return Learner(HeadTrackingEnv(config.env, 0, "cpu"), config.agent, folder, "cpu")


def test_training_keeps_nothing(tmp_path):
    trained = learner(tmp_path)
    assert_no_growth(lambda iterations: trained.train(trained.current_learning_iteration + iterations), 60)


@pytest.mark.parametrize("jobs", [5, pytest.param(50, marks=pytest.mark.slow)])
def test_sweep_keeps_nothing(monkeypatch, tmp_path, jobs):
    """Hydra and importlib keep a few objects per sweep; a job that stayed would be thousands."""
    monkeypatch.chdir(tmp_path)
    small = ["train", "-m", *TINY, "max_iterations=1", "evaluate=false"]
    assert_no_growth(lambda number: call(monkeypatch, *small, f"seed=range({number})"), jobs, 50)


def test_resets_keep_nothing():
    """Every episode ends after its first step."""
    config = compose("env.episode_steps=1", "env.num_envs=64", "processes=1", "agent.algorithm.num_mini_batches=1")
    env = HeadTrackingEnv(config.env, 0, "cpu")

    def steps(number):
        for _ in range(number):
            assert env.step(torch.zeros(64, 2))[2].all()

    assert_no_growth(steps, 300)
    assert env.episodes.episode.tolist() == [303] * 64


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_of_an_iteration_is_freed(tmp_path):
    """200 iterations together keep less than a tenth of the samples that they have made."""

    def resident_bytes():
        gc.collect()
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    trained = learner(tmp_path, "env.num_envs=512", "agent.num_steps_per_env=32")
    trained.train(20)
    before = resident_bytes()
    trained.train(220)
    stored = trained.alg.storage
    bytes_of_one = stored.observations["policy"].nbytes + stored.actions.nbytes + stored.rewards.nbytes
    assert resident_bytes() - before < 0.1 * 200 * bytes_of_one
