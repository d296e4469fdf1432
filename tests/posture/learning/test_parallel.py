"""Training shared among processes: together they are one batch of worlds, one policy and one normalisation."""

import multiprocessing
import resource
import socket
import sys
import tempfile

import pytest
import torch
import torch.distributed as dist
from rsl_rl.storage import RolloutStorage
from tensordict import TensorDict

from envs.task.head_tracking import HeadTrackingEnv
from posture.config import torchrun
from posture.config.errors import RunError
from posture.learning import parallel
from posture.learning.ppo import ShuffledStorage
from posture.learning.shared_memory import _create_group
from tests.posture.learning.processes import exchange, fail, samples_of, work_on

SIZE = 3
"""Processes of the exchanges below."""


@pytest.fixture(scope="module")
def exchanged():
    with parallel.worker_processes(SIZE, "cpu", exchange):
        assert (parallel.rank(), parallel.size()) == (0, SIZE)
        result = exchange()
    assert not dist.is_initialized() and (parallel.rank(), parallel.size()) == (0, 1)
    return result


def test_sum_broadcast_and_gather(exchanged):
    total, sent, states, conditions, _ = exchanged
    assert torch.equal(total, torch.arange(600_000, dtype=torch.float32) * 6)  # 1 + 2 + 3
    assert sent.tolist() == [7, 8, 9]
    assert [state["rank"] for state in states] == [0, 1, 2]
    assert all(bool((state["tensor"] == rank).all()) for rank, state in enumerate(states))
    assert conditions == (True, False)


def test_signals_of_the_terminal_reach_the_first_process_only(exchanged):
    assert [state["blocked"] for state in exchanged[2]] == [False, True, True]


def test_normaliser_has_the_moments_of_all_samples(exchanged):
    samples, normalizer = torch.cat([samples_of(rank) for rank in range(SIZE)], 1).flatten(0, 1).double(), exchanged[4]
    assert normalizer.mean.double() == pytest.approx(samples.mean(0), rel=1e-6, abs=1e-6)
    assert normalizer.std.double() == pytest.approx(samples.std(0, unbiased=False), rel=1e-4)


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("killed", "process 1 of 2 ended unexpectedly"),
        ("exit code 3", "process 1 of 2 failed"),
        ("overflow", "env.solver.contacts = 4, needed at least 5"),
    ],
)
def test_worker_that_fails_is_an_error(how, message):
    with pytest.raises(RunError, match=message), parallel.worker_processes(2, "cpu", fail, how):
        if how != "exit code 3":
            dist.all_reduce(torch.zeros(1))


def test_processes_that_cannot_connect_are_an_error(monkeypatch):
    """The first of two that torchrun would have started, at a port that is in use."""
    # torch counts the failed group, and its number is part of the names by which later groups find each other.
    monkeypatch.setattr(dist.distributed_c10d._world, "group_count", 0)
    with socket.create_server(("localhost", 0)) as taken:
        port = taken.getsockname()[1]
        for name, value in zip(torchrun.VARIABLES, ("0", "2", "0", "localhost", str(port)), strict=True):
            monkeypatch.setenv(name, value)
        with (
            pytest.raises(RunError, match=f"the connection of the processes at localhost:{port} failed: .*address already"),
            parallel.worker_processes(2, "cpu", fail, "killed"),
        ):
            pass


def test_worker_that_exits_late_has_not_failed(monkeypatch):
    monkeypatch.setattr(parallel, "EXIT_S", 0.1)
    with parallel.worker_processes(2, "cpu", work_on):
        work_on()
    assert multiprocessing.active_children() == []


def test_full_temporary_folder_is_named_with_the_size_that_is_needed(monkeypatch, tmp_path):
    """By a limit of the system on the size of files. The pages of a file with a hole would fail when they are written to."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, before[1]))
    try:
        with pytest.raises(RunError, match=f"share 4.2 MB in .* {tmp_path}: File too large; name .* TMPDIR"):
            _create_group(None, 0, 2, None)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("device", ["cuda", "cpu on Windows"])
def test_one_process_on_a_gpu_and_on_windows(monkeypatch, capsys, device):
    if device == "cpu on Windows":
        monkeypatch.setattr(sys, "platform", "win32")
    with parallel.worker_processes(2, device.split()[0], fail, "exit code 3"):
        assert parallel.size() == 1 and parallel.local_device("cuda") == "cuda"
    assert capsys.readouterr().out.count("training in one process") == (device != "cuda")


def test_under_torchrun_each_process_has_its_gpu(monkeypatch):
    for name, value in zip(torchrun.VARIABLES, ("3", "4", "3", "localhost", "29500"), strict=True):
        monkeypatch.setenv(name, value)
    assert (parallel.rank(), parallel.size()) == (3, 4)
    assert parallel.local_device("cuda") == "cuda:3" and parallel.local_device("cpu") == "cpu"


def test_parts_of_the_worlds_move_like_the_whole(env_config):
    """Two environments with alternate worlds of a third one give the same observations, rewards and ends."""
    config = env_config("env.num_envs=8", "env.freq_draw=stratified")
    whole = HeadTrackingEnv(config, 1, "cpu")
    parts = [HeadTrackingEnv(config, 1, "cpu", (part, 2)) for part in range(2)]
    generator = torch.Generator().manual_seed(0)
    for _ in range(30):
        actions = 0.3 * torch.randn(8, 2, generator=generator)
        observed, reward, done, _ = whole.step(actions)
        for number, part in enumerate(parts):
            own, own_reward, own_done, _ = part.step(actions[number::2])
            assert torch.equal(own["policy"], observed["policy"][number::2])
            assert torch.equal(own_reward, reward[number::2]) and torch.equal(own_done, done[number::2])
    assert int(whole.episodes.episode.sum()) > 0


def test_shuffled_storage_gives_rsl_rls_mini_batches():
    """Same random state, same mini-batches in the same order, bit for bit."""
    observation = TensorDict({"policy": torch.zeros(6, 3)}, batch_size=[6])
    all_batches = []
    for kind in (RolloutStorage, ShuffledStorage):
        storage = kind("rl", 6, 4, observation, [2], "cpu")
        torch.manual_seed(3)
        for name in ("actions", "values", "returns", "advantages", "actions_log_prob"):
            getattr(storage, name).copy_(torch.randn_like(getattr(storage, name)))
        storage.observations["policy"].copy_(torch.randn(4, 6, 3))
        storage.distribution_params = (torch.randn(4, 6, 2), torch.rand(4, 6, 2))
        all_batches.append(list(storage.mini_batch_generator(4, 3)))
    assert len(all_batches[0]) == len(all_batches[1]) == 12
    for theirs, ours in zip(*all_batches, strict=True):
        assert torch.equal(theirs.observations["policy"], ours.observations["policy"])
        for name in ("actions", "values", "returns", "advantages", "old_actions_log_prob"):
            assert torch.equal(getattr(theirs, name), getattr(ours, name)), name
        assert all(map(torch.equal, theirs.old_distribution_params, ours.old_distribution_params))
