"""Shared by the benchmarks: configuration, clock, measurement in a fresh process, CSV file."""

import csv
import multiprocessing
import os
import platform
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import torch
import warp as wp

from posture.cli import jobs
from posture.config.train import TrainConfig


def compose(*overrides: str) -> TrainConfig:
    """The checked training configuration that these overrides give."""
    return jobs.compose("train", TrainConfig, *overrides)


def timed(device: str, work: Callable[[], Any]) -> float:
    """Wall time of `work()` [s], including the work that it leaves to a GPU."""
    finish(device)
    start = time.perf_counter()
    work()
    finish(device)
    return time.perf_counter() - start


def finish(device: str) -> None:
    """Wait for the GPU."""
    if device.startswith("cuda"):
        wp.synchronize()
        torch.cuda.synchronize()


def memory(device: str) -> int | None:
    """Memory in use [bytes]: all of a GPU's; otherwise that of this process, plus the private memory of its child processes.

    None on systems other than Linux.
    """
    if device.startswith("cuda"):
        free, total = torch.cuda.mem_get_info(device)
        return total - free
    try:
        return _kilobytes(os.getpid(), "Rss:") * 1024 + sum(
            _kilobytes(child.pid, "Private_") * 1024 for child in multiprocessing.active_children()
        )
    except OSError:
        return None


def _kilobytes(process: int | None, field: str) -> int:
    lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith(field))


def in_new_process(function: Callable[..., Any], *arguments: Any) -> Any:
    """`function(*arguments)` in a new process, so that nothing measured before is in its memory."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()


def hardware(device: str) -> dict[str, Any]:
    """The columns that describe the hardware."""
    name = torch.cuda.get_device_name(device) if device.startswith("cuda") else platform.machine()
    return {"device": name, "cores": os.cpu_count()}


def missing(*packages: str) -> str:
    """How to install those of `packages` that are missing; empty if all are installed."""
    lacking = " ".join(package for package in packages if find_spec(package.replace("-", "_")) is None)
    return f"left out; install: python -m pip install -c constraints.txt {lacking}" if lacking else ""


def write(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Write a CSV file with one line per row, None as an empty field. Without rows no file is written."""
    if not rows:
        return
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(f"written: {path}")
