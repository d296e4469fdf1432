"""What the processes of test_parallel do. They import this module, and thus no simulator, which takes seconds."""

import os
import signal
import sys
import threading
import time

import torch
import torch.distributed as dist
from rsl_rl.modules import EmpiricalNormalization

from envs.config import ConstraintOverflowError
from posture.learning import parallel


def samples_of(rank):
    """Two updates of 500 samples with three components; the mean of the last is large against its deviation."""
    noise = torch.randn(2, 500, 3, generator=torch.Generator().manual_seed(rank))
    return noise * torch.tensor([1.0, 1.0 + rank, 0.1]) + torch.tensor([0.0, rank, 1000.0])


def exchange():
    """One of each collective operation, and a normaliser that has seen this process's samples."""
    rank = parallel.rank()
    total = torch.arange(600_000, dtype=torch.float32) * (rank + 1)  # more than two buffers
    dist.all_reduce(total)
    sent = torch.tensor([7, 8, 9]) if rank == 1 else torch.zeros(3, dtype=torch.long)
    dist.broadcast(sent, src=1)
    blocked = {signal.SIGINT, signal.SIGTERM} <= signal.pthread_sigmask(signal.SIG_BLOCK, ())
    states = parallel.gather({"rank": rank, "blocked": blocked, "tensor": torch.full((400_000,), float(rank))})
    conditions = parallel.any_process(rank == 1, "cpu"), parallel.any_process(False, "cpu")
    normalizer = EmpiricalNormalization(3)
    for samples in samples_of(rank):
        normalizer.update(samples)
    return total, sent, states, conditions, normalizer


def fail(how):
    if parallel.rank() == 0:
        return
    if how == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if how == "overflow":
        raise ConstraintOverflowError("env.solver.contacts = 4, needed at least 5")
    sys.exit(3)


def work_on():
    if parallel.rank() != 0:
        threading.Thread(target=time.sleep, args=(60,)).start()  # the process exits after its threads
