"""Training shared among processes: together they are one batch of worlds, one policy and one normalisation."""

import os
import signal

import pytest
import torch
import torch.distributed as dist
from rsl_rl.storage import RolloutStorage
from tensordict import TensorDict

from envs.task.head_tracking import HeadTrackingEnv
from posture.learning import parallel
from posture.learning.ppo import ShuffledStorage, _pool


class Normalizer:
    """What `_pool` reads of rsl-rl's EmpiricalNormalization."""

    def __init__(self, samples):
        self._mean, self._var = samples.mean(0, keepdim=True), samples.var(0, unbiased=False, keepdim=True)
        self._std = self._var.sqrt()


def samples_of(rank):
    return torch.randn(500, 3, generator=torch.Generator().manual_seed(rank)) * (1 + rank) + rank


def pooled():
    normalizer = Normalizer(samples_of(parallel.rank()))
    _pool(normalizer)
    return normalizer


def test_moments_of_two_processes_are_those_of_all_samples():
    with parallel.worker_processes(2, "cpu", pooled):
        assert (parallel.rank(), parallel.size()) == (0, 2)
        mine = pooled()
    everything = torch.cat([samples_of(0), samples_of(1)])
    assert torch.allclose(mine._mean[0], everything.mean(0), atol=1e-5)
    assert torch.allclose(mine._var[0], everything.var(0, unbiased=False), atol=1e-5)
    assert not dist.is_initialized()
    assert (parallel.rank(), parallel.size()) == (0, 1)


def exchanged():
    """A sum that needs three pieces of the board, a broadcast of whole numbers, and what each process has to say."""
    rank = parallel.rank()
    numbers = torch.arange(600_000, dtype=torch.float32) * (rank + 1)
    dist.all_reduce(numbers)
    told = torch.tensor([7, 8, 9]) if rank == 1 else torch.zeros(3, dtype=torch.long)
    dist.broadcast(told, src=1)
    return numbers, told, parallel.gather({"rank": rank, "tensor": torch.full((400_000,), float(rank))})


def test_the_board_adds_tells_and_gathers():
    with parallel.worker_processes(3, "cpu", exchanged):
        numbers, told, states = exchanged()
    assert torch.equal(numbers, torch.arange(600_000, dtype=torch.float32) * 6)
    assert told.tolist() == [7, 8, 9]
    assert [state["rank"] for state in states] == [0, 1, 2]
    assert all(float(state["tensor"].mean()) == place for place, state in enumerate(states))


def asked_to_stop():
    """Whether one, or none, knows of a reason to stop; and which processes the terminal's signals do not reach."""
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    by_one, by_none = parallel.any_process(parallel.rank() == 1, "cpu"), parallel.any_process(False, "cpu")
    return by_one, by_none, parallel.gather({signal.SIGINT, signal.SIGTERM} <= blocked)


def test_what_one_process_knows_all_know_and_the_first_alone_hears_signals():
    with parallel.worker_processes(2, "cpu", asked_to_stop):
        assert asked_to_stop() == (True, False, [False, True])


def test_a_gpu_is_for_one_process(monkeypatch):
    with parallel.worker_processes(2, "cuda", die):
        assert parallel.size() == 1 and parallel.local_device("cuda") == "cuda"
    monkeypatch.setenv("WORLD_SIZE", "4")
    monkeypatch.setenv("LOCAL_RANK", "3")
    assert parallel.local_device("cuda") == "cuda:3" and parallel.local_device("cpu") == "cpu"


def die():
    if parallel.rank() != 0:
        os.kill(os.getpid(), signal.SIGKILL)


def test_a_process_that_is_gone_is_not_waited_for():
    with pytest.raises(RuntimeError, match="process 1 of 2 ended unexpectedly"), parallel.worker_processes(2, "cpu", die):
        dist.all_reduce(torch.zeros(1))


def fail_elsewhere():
    if parallel.rank() != 0:
        raise SystemExit(3)


def test_a_process_that_fails_is_an_error():
    with pytest.raises(RuntimeError, match="process 1 of 2 failed"), parallel.worker_processes(2, "cpu", fail_elsewhere):
        pass


def test_parts_of_the_worlds_are_the_worlds(env_config):
    """Two environments of half the worlds each, dealt in turn, move like one of all."""
    config = env_config("env.num_envs=8", "env.freq_draw=stratified")
    whole = HeadTrackingEnv(config, 1, "cpu")
    parts = [HeadTrackingEnv(config, 1, "cpu", (part, 2)) for part in range(2)]
    generator = torch.Generator().manual_seed(0)
    for _ in range(30):
        actions = 0.3 * torch.randn(8, 2, generator=generator)
        seen, reward, done, _ = whole.step(actions)
        for place, part in enumerate(parts):
            own, own_reward, own_done, _ = part.step(actions[place::2])
            assert torch.equal(own["policy"], seen["policy"][place::2])
            assert torch.equal(own_reward, reward[place::2]) and torch.equal(own_done, done[place::2])
    assert int(whole.episode.sum()) > 0


def test_shuffled_storage_gives_rsl_rls_mini_batches():
    """Same random state, same mini-batches in the same order, bit for bit."""
    observation = TensorDict({"policy": torch.zeros(6, 3)}, batch_size=[6])
    stores = [kind("rl", 6, 4, observation, [2], "cpu") for kind in (RolloutStorage, ShuffledStorage)]
    batches = []
    for store in stores:
        torch.manual_seed(3)
        for name in ("actions", "values", "returns", "advantages", "actions_log_prob"):
            getattr(store, name).copy_(torch.randn_like(getattr(store, name)))
        store.observations["policy"].copy_(torch.randn(4, 6, 3))
        store.distribution_params = (torch.randn(4, 6, 2), torch.rand(4, 6, 2))
        batches.append(list(store.mini_batch_generator(4, 3)))
    assert len(batches[0]) == len(batches[1]) == 12
    for ours, theirs in zip(*batches, strict=True):
        assert torch.equal(ours.observations["policy"], theirs.observations["policy"])
        for name in ("actions", "values", "returns", "advantages", "old_actions_log_prob"):
            assert torch.equal(getattr(ours, name), getattr(theirs, name)), name
        for a, b in zip(ours.old_distribution_params, theirs.old_distribution_params, strict=True):
            assert torch.equal(a, b)
