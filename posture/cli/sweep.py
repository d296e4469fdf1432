"""A sweep: running its jobs, monitoring them from their folders, and the summary at the end.

Each job keeps status.yaml in its folder: its state (running, done or failed), its start time, and after a failure the error,
with the traceback in error.txt. Under a launcher with several processes a job prints to log.txt.
"""

import contextlib
import datetime
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from posture.cli import output, signals
from posture.cli.jobs import Job
from posture.config.errors import ConfigError
from posture.config.train import TrainConfig
from posture.storage import run_dir, yaml_files
from posture.storage.lock import is_busy, is_held, locked

REPORT_EVERY_S = 30.0
"""Seconds between two progress lines of a sweep whose jobs print to files."""


def run_job(task: Callable[[], Any], folder: Path, to_log: bool) -> Any:
    """Run `task` as the job in `folder`, and return its result. Its failure is recorded there and does not stop other jobs.

    A job that another process is running is skipped. `to_log`: redirect its output to log.txt.
    """
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(locked(folder))
        except ConfigError as busy:
            print(f"skipped: {busy}", flush=True)
            return None
        began = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        if status(folder).get("state") != "done":  # a finished job stays done if this start is interrupted
            yaml_files.write_yaml(folder / "status.yaml", {"state": "running", "began": began})
        (folder / "error.txt").unlink(missing_ok=True)
        if to_log:
            log = stack.enter_context(output.log_file(folder / "log.txt"))
            stack.enter_context(contextlib.redirect_stdout(log))
            stack.enter_context(contextlib.redirect_stderr(log))
        outcome, result = {"state": "done", "began": began}, None
        try:
            result = task()
        except Exception as error:
            signals.raise_stopped(error)
            reason = " ".join(str(error).split())
            if not isinstance(error, ConfigError):
                reason = f"{type(error).__name__}: {reason}"
            (folder / "error.txt").write_text(traceback.format_exc(), encoding="utf-8")
            print(f"failed: {reason}", flush=True)
            outcome |= {"state": "failed", "error": reason}
        yaml_files.write_yaml(folder / "status.yaml", outcome)
        return result


def trials(folder: Path) -> list[Job]:
    """The jobs of a search in the folder of its sweep."""
    return [Job(run_dir.read_config(run), run) for run in run_dir.runs_in(folder)] if folder.is_dir() else []


class SweepProgress:
    """Progress of a sweep's jobs since this object was created, read from their folders."""

    def __init__(self, jobs: Sequence[Job]) -> None:
        self.jobs = jobs
        self._started = time.monotonic()
        self._at_start = [fraction_done(job) for job in jobs]

    @property
    def done_before(self) -> int:
        """Number of jobs that were done at the start."""
        return self._at_start.count(1.0)

    def line(self) -> str:
        """`4 of 18 done, 2 running, 31 min left`. The time is extrapolated from the samples trained so far."""
        states = [status(job.folder).get("state") for job in self.jobs]
        fractions = [fraction_done(job) for job in self.jobs]
        finished, remaining = 0.0, 0.0
        for job, state, fraction, before in zip(self.jobs, states, fractions, self._at_start, strict=True):
            finished += _size(job) * (fraction - before)
            remaining += _size(job) * (1 - fraction) * (state != "failed")
        # The status of a killed job stays "running", but its lock is released.
        running = sum(state == "running" and is_held(job.folder) for job, state in zip(self.jobs, states, strict=True))
        parts = [f"{fractions.count(1.0)} of {len(self.jobs)} done", f"{running} running"]
        if failed := states.count("failed"):
            parts.append(f"{failed} failed")
        if remaining and finished > 0:
            parts.append(f"{(time.monotonic() - self._started) * remaining / finished / 60:.0f} min left")
        return ", ".join(parts)


@contextlib.contextmanager
def report_periodically(progress: SweepProgress, label: str, every: float = REPORT_EVERY_S) -> Iterator[None]:
    """In this context print a progress line at regular intervals."""
    ended, stdout = threading.Event(), sys.stdout  # a job in this process may redirect sys.stdout

    def report() -> None:
        while not ended.wait(every):
            print(f"{label}: {progress.line()}", file=stdout, flush=True)

    reporter = threading.Thread(target=report, daemon=True)
    reporter.start()
    try:
        yield
    finally:
        ended.set()
        reporter.join()


def print_summary(jobs: Sequence[Job], done_before: int) -> bool:
    """Print how many jobs are done, and the error of each one that is not; whether all are done."""
    unfinished = [(job, about) for job in jobs if (about := status(job.folder)).get("state") != "done"]
    before = f", {done_before} of them before" if done_before else ""
    print(f"sweep: {len(jobs) - len(unfinished)} of {len(jobs)} jobs done{before}")
    for job, about in unfinished:
        reason = "another process is running it" if is_busy(job.folder) else about.get("error", "it did not finish")
        print(f"failed: {job.folder}: {reason}")
    return not unfinished


def status(folder: Path) -> dict[str, Any]:
    """The status.yaml of a job's folder; empty if the job has not started."""
    about = yaml_files.read_yaml(folder / "status.yaml")
    return about if isinstance(about, dict) else {}


def fraction_done(job: Job) -> float:
    """Fraction of a job that is done, 0 to 1; for a training by its newest checkpoint."""
    if status(job.folder).get("state") == "done":
        return 1.0
    if not isinstance(job.config, TrainConfig):
        return 0.0
    model = run_dir.newest_model(job.folder)
    # The evaluation follows the last iteration.
    return 0.0 if model is None else min(run_dir.iteration_of(model) / job.config.max_iterations, 0.99)


def _size(job: Job) -> float:
    """Relative duration of a job: the samples of a training; all other jobs count as equally long."""
    if not isinstance(job.config, TrainConfig):
        return 1.0
    return float(job.config.env.num_envs * job.config.agent.num_steps_per_env * job.config.max_iterations)
