"""A torch.distributed backend for the processes of one machine, over shared memory.

The sums that a training shares are small (50 kB) and frequent (three per mini-batch), so latency decides. A process of
this backend polls for a few milliseconds before it sleeps, and a sum takes 0.03 ms; gloo sleeps immediately, and a sum
takes 0.3 to 1.2 ms on the same machine. Two processes train 1.65 times as fast over this backend as one process with two
torch threads under passive waiting (docs/speed.md). Sums are taken in the order of the ranks, so every process gets the
same bits.
"""

import mmap
import multiprocessing
import os
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
import torch.distributed as dist

from posture.config.errors import RunError
from posture.operating_system import process_is_alive, yield_processor

BACKEND = "shared_memory"
BUFFER_BYTES = 1 << 20
"""Size of one process's buffer; a longer message is exchanged in pieces of this size."""
_CACHE_LINE = 8
"""Distance between two processes' counters [int64], so that polling one does not slow down writing another."""
_POLL_S, _CHECK_EVERY_S = 0.005, 1.0
"""How long a process polls without sleeping, and how often it then checks that the others are alive [s]."""


class SharedMemoryGroup(dist.ProcessGroup):
    """The collectives that rsl-rl and `posture.learning.parallel` use, for tensors in CPU memory.

    The memory holds, for each process, a counter of its exchanges, its process id, and two buffers. All collectives are
    synchronous; returning None instead of a handle signals this to torch.
    """

    def __init__(self, rank: int, size: int, path: str) -> None:
        super().__init__(rank, size)  # type: ignore[call-arg]
        self._rank, self._size, self._exchanges = rank, size, 0
        header = 8 * _CACHE_LINE * size
        with open(path, "r+b") as file:
            memory = mmap.mmap(file.fileno(), self.memory_bytes(size))
        table = np.frombuffer(memory, np.int64, _CACHE_LINE * size).reshape(size, _CACHE_LINE)
        self._counters, self._process_ids = table[:, 0], table[:, 1]
        # Two buffers in turn: a process that writes to one has seen that all others have finished reading it.
        self._buffers = np.frombuffer(memory, np.uint8, 2 * size * BUFFER_BYTES, header).reshape(2, size, BUFFER_BYTES)
        self._process_ids[rank] = os.getpid()

    @staticmethod
    def memory_bytes(size: int) -> int:
        """Size of the shared file for `size` processes."""
        return 8 * _CACHE_LINE * size + 2 * size * BUFFER_BYTES

    def getBackendName(self) -> str:  # noqa: N802 - torch's name
        """The backend's name in torch."""
        return BACKEND

    def allreduce(self, tensors: list[torch.Tensor], options: Any = None) -> None:  # type: ignore[override]
        """Replace each tensor by its sum over the processes."""
        if options is not None and options.reduceOp != dist.ReduceOp.SUM:
            raise NotImplementedError("the shared-memory backend implements sums only")
        for tensor in tensors:
            _copy(self._exchange(tensor).sum(axis=0), tensor)

    def broadcast(self, tensors: list[torch.Tensor], options: Any) -> None:  # type: ignore[override]
        """Replace each tensor by that of one process."""
        for tensor in tensors:
            _copy(self._exchange(tensor)[options.rootRank], tensor)

    def allgather(self, outputs: list[list[torch.Tensor]], inputs: list[torch.Tensor], options: Any = None) -> None:  # type: ignore[override]
        """Give every process the tensors of all."""
        for output, tensor in zip(outputs, inputs, strict=True):
            for values, target in zip(self._exchange(tensor), output, strict=True):
                _copy(values, target)

    def gather(self, outputs: list[list[torch.Tensor]], inputs: list[torch.Tensor], options: Any) -> None:  # type: ignore[override]
        """Give one process the tensors of all."""
        unused = [[torch.empty_like(tensor) for _ in range(self._size)] for tensor in inputs]
        self.allgather(outputs if self._rank == options.rootRank else unused, inputs)

    def _exchange(self, tensor: torch.Tensor) -> np.ndarray:
        """The elements of every process's tensor, shape (processes, elements), valid until the next exchange."""
        values = tensor.detach().reshape(-1).numpy()
        length = BUFFER_BYTES // values.itemsize
        if values.size <= length:
            return self._exchange_piece(values)
        pieces = [self._exchange_piece(values[first : first + length]).copy() for first in range(0, values.size, length)]
        return np.concatenate(pieces, axis=1)

    def _exchange_piece(self, values: np.ndarray) -> np.ndarray:
        buffer = self._buffers[self._exchanges % 2].view(values.dtype)[:, : values.size]
        buffer[self._rank] = values
        yield_processor()  # a memory barrier: no process may see the counter before the values
        self._exchanges += 1
        self._counters[self._rank] = self._exchanges
        self._wait()
        return buffer

    def _wait(self) -> None:
        """Wait until every process has made this exchange. Raises RunError if one of them has ended."""
        start, checked = time.perf_counter(), 0.0
        while self._counters.min() < self._exchanges:
            waited = time.perf_counter() - start
            if waited < _POLL_S:
                yield_processor()
                continue
            time.sleep(0.0005)
            if waited - checked > _CHECK_EVERY_S:
                checked = waited
                self._check_alive()
        yield_processor()  # a memory barrier: the values must be read after the counters

    def _check_alive(self) -> None:
        multiprocessing.active_children()  # reaps those that have ended
        for rank, process_id in enumerate(self._process_ids.tolist()):
            if process_id and not process_is_alive(process_id):
                raise RunError(f"process {rank} of {self._size} ended unexpectedly")


def _copy(values: np.ndarray, target: torch.Tensor) -> None:
    target.copy_(torch.from_numpy(values).view(target.shape))


def _create_group(store: Any, rank: int, size: int, timeout: Any) -> SharedMemoryGroup:
    """Open the same memory in every process; the first process makes the file, and sends its name through `store`."""
    if rank > 0:
        group = SharedMemoryGroup(rank, size, store.get("memory file").decode())
        store.set(f"joined {rank}", "yes")
        return group
    length = SharedMemoryGroup.memory_bytes(size)
    # Mapped memory stays after the file is removed, until the last process has closed it.
    with tempfile.NamedTemporaryFile(prefix="posture-") as file:
        try:
            # A file with a hole would be mapped too, but on a full disk writing to it ends the process by SIGBUS.
            Path(file.name).write_bytes(bytes(length))
        except OSError as error:
            raise RunError(
                f"the processes of a training share {length / 1e6:.1f} MB in the temporary folder {tempfile.gettempdir()}: "
                f"{error.strerror}; name another folder in TMPDIR, or use processes=1"
            ) from None
        store.set("memory file", file.name)
        group = SharedMemoryGroup(rank, size, file.name)
        for other in range(1, size):
            store.get(f"joined {other}")
    return group


dist.Backend.register_backend(BACKEND, _create_group, devices=["cpu"])
