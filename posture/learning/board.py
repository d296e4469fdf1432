"""A torch.distributed backend for the few processes of one machine: each writes to its place on a board that all read.

The sums that a training shares are small (50 kB) and many (three a mini-batch), so what counts is how fast a process
learns that the others are there. Here it looks again and again, for some milliseconds, and a sum takes 0.03 ms; gloo
sleeps, and took 0.3-1.2 ms on the same machine. Sums are taken in the order of the ranks, so they are the same bits on
every process.
"""

import mmap
import multiprocessing
import os
import tempfile
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
import torch.distributed as dist
from torch._C._distributed_c10d import _create_work_from_future  # type: ignore[attr-defined]
from torch.futures import Future

from posture.config.errors import RunError
from posture.operating_system import process_is_alive, yield_processor

PLACE_BYTES = 1 << 20
"""A longer message goes in pieces of this size."""
_LINE = 8
"""Counters lie this many int64 apart, a cache line, so that looking at one does not disturb another."""
_EAGER_S, _CHECK_S = 0.005, 1.0
"""A process waits without sleeping for so long, and after so long asks whether the others live [s]."""


class BoardGroup(dist.ProcessGroup):
    """The collectives that rsl-rl and `posture.learning.parallel` use, for tensors in CPU memory."""

    def __init__(self, rank: int, size: int, path: str) -> None:
        super().__init__(rank, size)  # type: ignore[call-arg]
        self._rank, self._size, self._turn = rank, size, 0
        head = 8 * _LINE * size
        with open(path, "r+b") as file:
            memory = mmap.mmap(file.fileno(), head + 2 * size * PLACE_BYTES)
        self._counters = np.frombuffer(memory, np.int64, _LINE * size).reshape(size, _LINE)
        # Two boards in turn: who writes to one has seen that all are done with what it held before.
        self._boards = np.frombuffer(memory, np.uint8, 2 * size * PLACE_BYTES, head).reshape(2, size, PLACE_BYTES)
        self._counters[rank, 1] = os.getpid()

    @staticmethod
    def bytes_for(size: int) -> int:
        """Size of the board's file."""
        return 8 * _LINE * size + 2 * size * PLACE_BYTES

    def getBackendName(self) -> str:  # noqa: N802 - torch's name
        """Its name for torch."""
        return "board"

    def allreduce(self, tensors: list[torch.Tensor], options: Any = None) -> Any:  # type: ignore[override]
        """Replace each tensor by its sum over the processes."""
        if options is not None and options.reduceOp != dist.ReduceOp.SUM:
            raise NotImplementedError("the board only adds")
        for tensor in tensors:
            flat = tensor.detach().reshape(-1).numpy().copy()
            for part, pieces in self._exchange(flat):
                flat[part] = pieces.sum(axis=0, dtype=flat.dtype)
            tensor.copy_(torch.from_numpy(flat).view(tensor.shape))
        return _done(tensors)

    def broadcast(self, tensors: list[torch.Tensor], options: Any) -> Any:  # type: ignore[override]
        """Give every process the tensors of one of them."""
        for tensor in tensors:
            flat = tensor.detach().reshape(-1).numpy().copy()
            for part, pieces in self._exchange(flat):
                flat[part] = pieces[options.rootRank]
            tensor.copy_(torch.from_numpy(flat).view(tensor.shape))
        return _done(tensors)

    def allgather(self, outputs: list[list[torch.Tensor]], inputs: list[torch.Tensor], options: Any = None) -> Any:  # type: ignore[override]
        """Give every process the tensor of each."""
        for output, tensor in zip(outputs, inputs, strict=True):
            flat = tensor.detach().reshape(-1).numpy()
            whole = np.empty((self._size, flat.size), flat.dtype)
            for part, pieces in self._exchange(flat):
                whole[:, part] = pieces
            for place, row in zip(output, whole, strict=True):
                place.copy_(torch.from_numpy(row).view(place.shape))
        return _done(outputs)

    def gather(self, outputs: list[list[torch.Tensor]], inputs: list[torch.Tensor], options: Any) -> Any:  # type: ignore[override]
        """Give one process the tensor of each."""
        here = self._rank == options.rootRank
        spare = [[torch.empty_like(tensor) for _ in range(self._size)] for tensor in inputs]
        return self.allgather(outputs if here else spare, inputs)

    def barrier(self, options: Any = None) -> Any:
        """Wait for all."""
        return self.allreduce([torch.zeros(1)])

    # -- inside ------------------------------------------------------------------------------------------------------

    def _exchange(self, mine: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
        """Piece by piece: where it belongs, and that piece of every process, (processes, length), valid until the next."""
        length = PLACE_BYTES // mine.itemsize
        for first in range(0, mine.size, length):
            piece = mine[first : first + length]
            board = self._boards[self._turn % 2].view(mine.dtype)
            board[self._rank, : piece.size] = piece
            # A call of the kernel keeps the processor from showing the counter before the piece.
            yield_processor()
            self._turn += 1
            self._counters[self._rank, 0] = self._turn
            self._wait()
            yield slice(first, first + piece.size), board[:, : piece.size]

    def _wait(self) -> None:
        """Until every process has come to this turn. Raises RunError if one of them is gone."""
        counters, began, checked = self._counters[:, 0], time.perf_counter(), 0.0
        while counters.min() < self._turn:
            waited = time.perf_counter() - began
            if waited < _EAGER_S:
                yield_processor()
                continue
            time.sleep(0.0005)
            if waited - checked > _CHECK_S:
                checked = waited
                self._check()

    def _check(self) -> None:
        multiprocessing.active_children()  # buries those that have ended
        for place, process in enumerate(self._counters[:, 1].tolist()):
            if process and not process_is_alive(process):
                raise RunError(f"process {place} of {self._size} is gone")


def _done(result: Any) -> Any:
    """torch's handle of something that is already done."""
    future: Future[Any] = Future()
    future.set_result(result)
    return _create_work_from_future(future)


def _create(store: Any, rank: int, size: int, timeout: Any) -> BoardGroup:
    if rank == 0:
        with tempfile.NamedTemporaryFile(prefix="posture-board-", delete=False) as file:
            file.truncate(BoardGroup.bytes_for(size))
        store.set("board", file.name)
        group = BoardGroup(rank, size, file.name)
        for other in range(1, size):
            store.get(f"joined {other}")
        os.unlink(file.name)  # what is mapped stays until the last process lets go of it
        return group
    group = BoardGroup(rank, size, store.get("board").decode())
    store.set(f"joined {rank}", "yes")
    return group


dist.Backend.register_backend("board", _create, devices=["cpu"])
