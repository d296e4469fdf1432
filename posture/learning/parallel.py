"""One training shared among processes: each steps a part of the worlds, and their gradients are averaged.

On a CPU the worker processes are started here and joined by `posture.learning.shared_memory`. With several GPUs `torchrun`
starts one process for each, and rsl-rl joins them by NCCL. Every process holds the same policy; only the first writes
files, reports progress and evaluates.
"""

import contextlib
import multiprocessing
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import torch
import torch.distributed as dist

from posture.cli import signals
from posture.cli.entry import FAILURES, one_line
from posture.config import torchrun
from posture.config.errors import ConfigError, RunError
from posture.learning.shared_memory import BACKEND

EXIT_S = 60.0
"""How long the first process waits for the others to exit after the work is done [s]."""
_REASON = "reason_{}"
"""Name of the file in which a worker process leaves the reason of its failure for the first process to report."""


def rank() -> int:
    """Number of this process; the first is 0."""
    return dist.get_rank() if dist.is_initialized() else torchrun.rank()


def size() -> int:
    """How many processes share the training."""
    return dist.get_world_size() if dist.is_initialized() else (torchrun.place() or torchrun.Place()).size


def local_device(device: str) -> str:
    """The device of this process: with several processes, `cuda` means the GPU with its number on this machine."""
    place = torchrun.place()
    return f"cuda:{place.local_rank}" if place and place.size > 1 and device == "cuda" else device


@contextlib.contextmanager
def worker_processes(processes: int, device: str, work: Callable[..., None], *arguments: Any) -> Iterator[None]:
    """Join `processes` - 1 workers, which run `work(*arguments)` on the CPU, with this process while the block runs.

    Under torchrun, which has started all processes, only join their group. A training on one GPU has one process, and so
    has every training on Windows. Raises RunError if a worker fails. The terminal's signals do not reach the workers: this
    process decides what to do, and the workers end when it ends.
    """
    if torchrun.place():
        try:
            if device == "cpu":
                dist.init_process_group(BACKEND)
            yield
        except dist.DistError as error:
            address = f"{os.environ['MASTER_ADDR']}:{os.environ['MASTER_PORT']}"
            raise RunError(f"the connection of the processes at {address} failed: {one_line(error):.300}") from None
        if dist.is_initialized():
            dist.destroy_process_group()
        return
    if processes > 1 and device == "cpu" and sys.platform == "win32":
        print(f"training in one process instead of {processes}: on Windows processes cannot share a training")
        processes = 1
    if processes == 1 or device != "cpu":
        yield
        return
    with tempfile.TemporaryDirectory(prefix="posture-") as folder:
        rendezvous = str(Path(folder) / "rendezvous")
        spawn = multiprocessing.get_context("spawn")
        workers = [
            spawn.Process(target=_run_worker, args=(number, processes, rendezvous, work, arguments), daemon=True)
            for number in range(1, processes)
        ]
        try:
            with signals.blocked():  # else SIGHUP would end it
                resource_tracker.ensure_running()  # started together with the first worker, it would unblock signals
            with signals.blocked():
                for worker in workers:
                    worker.start()
            _join_group(0, processes, rendezvous, workers)
            yield
            dist.destroy_process_group()
            for worker in workers:
                worker.join(timeout=EXIT_S)  # one that takes longer has not failed
            failed = [str(number) for number, worker in enumerate(workers, 1) if worker.exitcode]
            if failed:
                raise RunError(f"process {', '.join(failed)} of {processes} failed")
        except RunError:
            for reason in Path(folder).glob(_REASON.format("*")):
                raise RunError(reason.read_text(encoding="utf-8")) from None
            raise
        finally:
            # Only this process saves, so whatever workers are still doing is of no use.
            if dist.is_initialized():
                dist.destroy_process_group()
            for worker in workers:
                if worker.is_alive():
                    worker.kill()
                    worker.join()


def gather(value: Any) -> list[Any]:
    """The `value` of every process in the order of their ranks, for the first process; an empty list for the others."""
    if size() == 1:
        return [value]
    values: list[Any] | None = [None] * size() if rank() == 0 else None
    dist.gather_object(value, values)
    return values or []


def any_process(condition: bool, device: str) -> bool:
    """Whether `condition` holds on any process. `device`: where this process trains."""
    if size() == 1:
        return condition
    count = torch.tensor(float(condition), device=device)
    dist.all_reduce(count)
    return bool(count)


def _join_group(number: int, processes: int, rendezvous: str, workers: Sequence[BaseProcess] = ()) -> None:
    """Form the process group by a rendezvous file. The first process waits for its `workers` and sees if one fails."""
    store = dist.FileStore(rendezvous, processes)  # type: ignore[attr-defined]
    store.set(f"ready {number}", "yes")
    # torch's own wait would neither notice a worker that has ended nor let a signal through.
    for other, worker in enumerate(workers, 1):
        while not store.check([f"ready {other}"]):
            if worker.exitcode is not None:
                raise RunError(f"process {other} of {processes} failed")
            time.sleep(0.02)
    dist.init_process_group(BACKEND, store=store, rank=number, world_size=processes)


def _run_worker(number: int, processes: int, rendezvous: str, work: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    threading.Thread(target=_exit_with_parent, daemon=True).start()
    _join_group(number, processes, rendezvous)
    try:
        with open(os.devnull, "w") as devnull, contextlib.redirect_stdout(devnull):
            work(*arguments)
    except (signals.Stopped, FloatingPointError, ConfigError, RunError):
        sys.exit(1)  # the first process has the same error, and reports it
    except FAILURES as error:
        with contextlib.suppress(OSError):  # the first process has ended
            Path(rendezvous).with_name(_REASON.format(number)).write_text(one_line(error), encoding="utf-8")
        sys.exit(1)
    dist.destroy_process_group()


def _exit_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
