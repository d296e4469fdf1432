"""Evaluations and films of a training's checkpoints, in other processes of the lowest priority, one at a time.

They are the commands `posture.eval` and `posture.film`. The training only starts them, and reads their files.
"""

import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from pathlib import Path
from types import TracebackType
from typing import Any

from posture import operating_system
from posture.analysis.results import read_csv
from posture.cli import signals
from posture.cli.jobs import quoted
from posture.config import torchrun
from posture.config.train import TrainConfig
from posture.evaluation.best import evaluation_folder, has_plateaued, keep_best, score, scores
from posture.evaluation.trial import AS_TRAINED, is_current

FILM = "two_modes.gif"


class Background:
    """Work for the checkpoints of the training in the folder `run`. As a context manager it ends its process at the end."""

    def __init__(self, run: Path, config: TrainConfig) -> None:
        self._run, self._config = run, config
        self._thread = ThreadPoolExecutor(1)
        self._pending: dict[Future[str], tuple[str, int]] = {}
        self._child: subprocess.Popen[bytes] | None = None
        self._lock, self._closed = threading.Lock(), False

    def __enter__(self) -> "Background":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        with self._lock:
            self._closed = True
            if self._child is not None:
                self._child.kill()
        self._thread.shutdown(cancel_futures=True)

    def catch_up(self, done: int) -> bool:
        """Begin the evaluations that a training of `done` iterations lacks, as after it was stopped. Returns whether
        `patience` ended it then."""
        every = self._config.evaluate_every or done + 1
        for iteration in range(every, done, every):
            self._evaluate_if_missing(iteration)
        if self._has_plateaued(done, None):
            return True
        if done and done % every == 0:
            self._evaluate_if_missing(done)
        return False

    def after_checkpoint(self, done: int, writer: Any) -> bool:
        """Begin what is due for the checkpoint after `done` iterations, and write to the log of the training what has ended
        since. Returns whether the training is to end, since its policies no longer improve.

        With `patience` the evaluations of earlier checkpoints are waited for, so that the training ends after the same
        iteration on any machine. At the end of the training everything is waited for.
        """
        self._collect(writer)
        config = self._config
        ends = self._has_plateaued(done, writer)
        if ends:
            print(f"no better policy in {config.patience} evaluations: it ends after {done} iterations", flush=True)
        if config.film_every and done % config.film_every == 0:
            self._film(done)
        if not ends and config.evaluate_every and done % config.evaluate_every == 0:
            self._evaluate(done)
        if ends or done >= config.max_iterations:
            self.finish(writer)
        return ends

    def _has_plateaued(self, done: int, writer: Any) -> bool:
        """Whether `patience` ends the training after `done` iterations. Waits for the evaluations of earlier checkpoints."""
        patience, every = self._config.patience, self._config.evaluate_every
        if patience is None or every is None or done % every:
            return False
        self._wait(writer)
        if signals.pending():
            return False
        earlier = [one for one in scores(self._run, self._config) if one.iteration < done and one.iteration % every == 0]
        return has_plateaued(earlier, patience)

    def finish(self, writer: Any = None) -> None:
        """Wait until everything has ended."""
        if running := sum(not job.done() for job in self._pending):
            print(f"waiting for {running} evaluations or films of checkpoints", flush=True)
        self._wait(writer)

    def _wait(self, writer: Any) -> None:
        """Wait for the work that has begun, or for a signal; collect its results."""
        while self._pending and not signals.pending():
            wait(self._pending, timeout=0.2)
            self._collect(writer)

    def _collect(self, writer: Any) -> None:
        """Report and log the work that has ended; keep the best policy."""
        evaluated = False
        for job in [job for job in self._pending if job.done()]:
            command, iteration = self._pending.pop(job)
            if problem := job.result():
                print(f"posture.{command} of model_{iteration}.pt failed: {problem}", file=sys.stderr, flush=True)
            elif command == "film" and writer is not None:
                writer.add_film(self._films(iteration) / FILM, iteration)
            elif command == "eval":
                evaluated = True
                one = score(iteration, read_csv(evaluation_folder(self._run, self._config, iteration) / "metrics.csv"))
                falls = f"falls at {one.falls} of {len(self._config.evaluation.freq)} frequencies"
                print(f"model_{iteration}.pt: {falls}, {one.cost_ratio:.3f} times the least cost", flush=True)
                if writer is not None:
                    writer.add_scalar("Evaluation/falls", one.falls, iteration)
                    writer.add_scalar("Evaluation/cost_ratio", one.cost_ratio, iteration)
        if evaluated:
            keep_best(self._run, self._config)

    def _evaluate_if_missing(self, iteration: int) -> None:
        config, model = self._config, self._run / f"model_{iteration}.pt"
        out = evaluation_folder(self._run, config, iteration)
        if model.exists() and not is_current(out, model, config, config.evaluation, AS_TRAINED, config.device):
            self._evaluate(iteration)

    def _films(self, iteration: int) -> Path:
        return self._run / "films" / f"model_{iteration}"

    def _evaluate(self, iteration: int) -> None:
        conditions = self._config.evaluation.model_dump(mode="json")
        conditions["figures"] &= iteration >= self._config.max_iterations
        self._begin("eval", iteration, [f"evaluation.{key}={value}".replace(" ", "") for key, value in conditions.items()])

    def _film(self, iteration: int) -> None:
        """Film the policy at the lowest and the highest frequency of its evaluation."""
        freq, out = self._config.evaluation.freq, quoted(self._films(iteration))
        ends = f"env.freq={sorted({min(freq), max(freq)})}".replace(" ", "")
        self._begin("film", iteration, ["films=[two_modes]", "formats=[gif]", ends, f"out={out}"])

    def _begin(self, command: str, iteration: int, arguments: Sequence[str]) -> None:
        ckpt = f"ckpt={quoted(self._run / f'model_{iteration}.pt')}"
        line = [sys.executable, "-m", f"posture.{command}", ckpt, *arguments]
        self._pending[self._thread.submit(self._process, line)] = (command, iteration)

    def _process(self, line: Sequence[str]) -> str:
        """Run a command; return the last line of its errors, or an empty text if it did not fail."""
        with tempfile.TemporaryFile() as messages:
            with self._lock:
                if self._closed:
                    return "the training has ended"
                # It is none of the processes that torchrun started, and more threads would take the cores of the training.
                own = {name: value for name, value in os.environ.items() if name not in torchrun.VARIABLES}
                environment = own | {"OMP_NUM_THREADS": "1"}
                self._child = operating_system.start_in_background(line, messages, environment)
            code = self._child.wait()
            messages.seek(0)
            lines = messages.read().decode(errors="replace").strip().splitlines() or [f"exit code {code}"]
            return lines[-1].removeprefix("error: ") if code else ""
