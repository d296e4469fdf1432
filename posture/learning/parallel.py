"""One training shared among processes: each steps a part of the worlds, and their gradients are averaged.

On a CPU the processes are started here and talk over `posture.learning.board`; with several GPUs `torchrun` starts one for
each, and rsl-rl joins them by NCCL. Every process holds the same policy; the first alone writes, shows and evaluates.
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
from posture.config.errors import ConfigError, RunError


def rank() -> int:
    """Which of the processes this is; the first is 0."""
    return dist.get_rank() if dist.is_initialized() else int(os.environ.get("RANK", "0"))


def size() -> int:
    """How many processes share the training."""
    return dist.get_world_size() if dist.is_initialized() else int(os.environ.get("WORLD_SIZE", "1"))


def own_device(device: str) -> str:
    """The device of this process: where there are several, `cuda` means the GPU of its place on this machine."""
    return f"cuda:{os.environ.get('LOCAL_RANK', '0')}" if size() > 1 and device == "cuda" else device


def by_torchrun() -> bool:
    """Whether `torchrun` started this process."""
    return "TORCHELASTIC_RUN_ID" in os.environ


@contextlib.contextmanager
def crew(processes: int, device: str, work: Callable[..., None], *arguments: Any) -> Iterator[None]:
    """Within it `processes` - 1 others run `work(*arguments)` on the CPU, joined with this process into one group.

    Under torchrun, which has started them all, it only joins the group; one GPU is for one process. Raises RunError if a
    process fails. The others get no signal of the terminal's: this process decides, and they end with it, however it ends.
    """
    if by_torchrun():
        if device == "cpu":
            dist.init_process_group("board")
        yield
        if dist.is_initialized():
            dist.destroy_process_group()
        return
    if processes == 1 or device != "cpu":
        yield
        return
    with tempfile.TemporaryDirectory(prefix="posture-") as folder:
        meeting = str(Path(folder) / "meeting")
        spawn = multiprocessing.get_context("spawn")
        others = [
            spawn.Process(target=_other, args=(place, processes, meeting, work, arguments), daemon=True)
            for place in range(1, processes)
        ]
        try:
            resource_tracker.ensure_running()  # else it is started together with the first process, and unblocks signals
            with signals.blocked():
                for other in others:
                    other.start()
            _join(0, processes, meeting, others)
            yield
            dist.destroy_process_group()
            for other in others:
                other.join(timeout=10.0)
        finally:
            # Whatever happened here, what the others still do is of no use: this process alone saves.
            if dist.is_initialized():
                dist.destroy_process_group()
            for other in others:
                if other.is_alive():
                    other.kill()
                    other.join()
        failed = [str(place) for place, other in enumerate(others, 1) if other.exitcode]
        if failed:
            raise RunError(f"process {', '.join(failed)} of {processes} failed")


def average(tensor: torch.Tensor) -> None:
    """Replace `tensor` by its mean over the processes."""
    dist.all_reduce(tensor)
    tensor /= size()


def gather(thing: Any) -> list[Any]:
    """The `thing` of every process in the order of their ranks, for the first process; an empty list for the others."""
    if size() == 1:
        return [thing]
    things: list[Any] | None = [None] * size() if rank() == 0 else None
    dist.gather_object(thing, things)
    return things or []


def any_of(here: bool, device: str) -> bool:
    """Whether it is so on any process. `device`: where this process trains."""
    if size() == 1:
        return here
    count = torch.tensor(float(here), device=device)
    dist.all_reduce(count)
    return bool(count)


def _join(place: int, processes: int, meeting: str, others: Sequence[BaseProcess] = ()) -> None:
    """Form the group; the first process waits for the `others` and watches over them meanwhile."""
    store = dist.FileStore(meeting, processes)  # type: ignore[attr-defined]
    store.set(f"here {place}", "yes")
    # torch's own waiting would neither see that a process has died nor let a signal through.
    for number, other in enumerate(others, 1):
        while not store.check([f"here {number}"]):
            if other.exitcode is not None:
                raise RunError(f"process {number} of {processes} failed")
            time.sleep(0.02)
    dist.init_process_group("board", store=store, rank=place, world_size=processes)


def _other(place: int, processes: int, meeting: str, work: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    threading.Thread(target=_end_with_the_first, daemon=True).start()
    _join(place, processes, meeting)
    try:
        with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
            work(*arguments)
    except (signals.Stopped, FloatingPointError, ConfigError):
        sys.exit(1)  # the first process has met the same, and tells of it
    dist.destroy_process_group()


def _end_with_the_first() -> None:
    first = multiprocessing.parent_process()
    assert first is not None
    first.join()
    os._exit(1)
