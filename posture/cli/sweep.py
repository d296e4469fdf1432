"""A sweep while it runs and when it has ended: what each job's folder says of it, how far all are, and which failed.

A job leaves status.yaml in its folder: its state (running, done or failed), when it began, and of a failed one the error,
whose traceback is in error.txt. Under a launcher of several processes what a job prints is in log.txt.
"""

import contextlib
import datetime
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from posture.cli.jobs import Job
from posture.config.errors import ConfigError
from posture.config.train import TrainConfig
from posture.storage import run_dir, yaml_files
from posture.storage.lock import is_busy, locked

TOLD_EVERY_S = 30.0
"""Seconds between two lines about a sweep whose jobs do not speak for themselves."""


def guarded(task: Callable[[], None], folder: Path, quiet: bool) -> None:
    """Run the job `task` in `folder`, so that its failure is kept there and does not stop the other jobs. A job that another
    process is at work on is left to it.

    `quiet`: what it prints goes to log.txt.
    """
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(locked(folder))
        except ConfigError as busy:
            print(f"left out: {busy}", flush=True)
            return
        about: dict[str, Any] = {
            "state": "running",
            "began": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        }
        if status(folder).get("state") != "done":  # it stays done if this start is cut short
            yaml_files.write_yaml(folder / "status.yaml", about)
        (folder / "error.txt").unlink(missing_ok=True)
        yaml_files.write_yaml(folder / "status.yaml", about | _outcome(task, folder, quiet))


def _outcome(task: Callable[[], None], folder: Path, quiet: bool) -> dict[str, Any]:
    """Run the job; how it ended, for status.yaml."""
    with contextlib.ExitStack() as stack:
        if quiet:
            log = stack.enter_context((folder / "log.txt").open("a", encoding="utf-8", buffering=1))
            stack.enter_context(contextlib.redirect_stdout(log))
            stack.enter_context(contextlib.redirect_stderr(log))
        try:
            task()
        except Exception as error:
            reason = " ".join(str(error).split())
            if not isinstance(error, ConfigError):
                reason = f"{type(error).__name__}: {reason}"
            (folder / "error.txt").write_text(traceback.format_exc(), encoding="utf-8")
            print(f"failed: {reason}", flush=True)
            return {"state": "failed", "error": reason}
    return {"state": "done"}


@dataclass
class Standing:
    """How far the jobs are, read from their folders; those that were done before it was made count as such."""

    jobs: Sequence[Job]
    _began: float = field(default_factory=time.monotonic)
    _at_first: list[float] = field(init=False)

    def __post_init__(self) -> None:
        self._at_first = [progress(job) for job in self.jobs]

    @property
    def before(self) -> int:
        """Number of jobs that were done when it was made."""
        return sum(share >= 1 for share in self._at_first)

    def line(self) -> str:
        """`4 of 18 done, 2 running, 31 min left`, the time by the samples of the jobs and their speed so far."""
        shares = [progress(job) for job in self.jobs]
        sizes = [_size(job) for job in self.jobs]
        states = [status(job.folder).get("state") for job in self.jobs]
        done = sum(share >= 1 for share in shares)
        running = sum(state == "running" and share < 1 for state, share in zip(states, shares, strict=True))
        failed = sum(state == "failed" for state in states)
        made = sum(size * (now - first) for size, now, first in zip(sizes, shares, self._at_first, strict=True))
        left = sum(size * (1 - now) for size, now, state in zip(sizes, shares, states, strict=True) if state != "failed")
        parts = [f"{done} of {len(self.jobs)} done", f"{running} running"]
        parts += [f"{failed} failed"] * bool(failed)
        if left and made > 0:
            parts.append(f"{(time.monotonic() - self._began) * left / made / 60:.0f} min left")
        return ", ".join(parts)


@contextlib.contextmanager
def told(standing: Standing, what: str, every: float = TOLD_EVERY_S) -> Iterator[None]:
    """While the body of this `with` runs, print how far the jobs are, now and then."""
    ended, here = threading.Event(), sys.stdout  # a job in this very process may redirect what is printed

    def tell() -> None:
        while not ended.wait(every):
            print(f"{what}: {standing.line()}", file=here, flush=True)

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        ended.set()
        teller.join()


def sum_up(jobs: Sequence[Job], before: int) -> bool:
    """Print how the jobs ended, each failed one with its error; whether all are done."""
    lost = [(job, status(job.folder)) for job in jobs]
    lost = [(job, about) for job, about in lost if about.get("state") != "done"]
    print(f"sweep: {len(jobs) - len(lost)} of {len(jobs)} jobs done" + (f", {before} of them before" if before else ""))
    for job, about in lost:
        reason = "another process is at work on it" if is_busy(job.folder) else about.get("error", "it did not end")
        print(f"failed: {job.folder}: {reason}")
    return not lost


def status(folder: Path) -> dict[str, Any]:
    """What a job's folder says of it; empty where it has not begun."""
    about = yaml_files.read_yaml(folder / "status.yaml")
    return about if isinstance(about, dict) else {}


def progress(job: Job) -> float:
    """Share of a job that is done, 0 to 1: of a training by its newest checkpoint."""
    if status(job.folder).get("state") == "done":
        return 1.0
    if not isinstance(job.config, TrainConfig):
        return 0.0
    model = run_dir.newest_model(job.folder)
    # The evaluation is still to come.
    return 0.0 if model is None else min(run_dir.iteration_of(model) / job.config.max_iterations, 0.99)


def _size(job: Job) -> float:
    """What a job's time goes with: the samples of a training; all others are taken for equal."""
    if not isinstance(job.config, TrainConfig):
        return 1.0
    return float(job.config.env.num_envs * job.config.agent.num_steps_per_env * job.config.max_iterations)
