"""rsl-rl's logger with a progress line, and with a state that a resumed training continues."""

import contextlib
import io
import sys
import threading
from collections import deque
from collections.abc import Iterator
from typing import Any

import torch
from rsl_rl.utils.logger import Logger
from torch.utils.tensorboard import SummaryWriter

from posture.learning.progress import ProgressLine, Status

_NUMBERS, _TENSORS, _BUFFERS = (
    ("tot_timesteps", "tot_time"),
    ("cur_reward_sum", "cur_episode_length"),
    ("rewbuffer", "lenbuffer"),
)


class Writer:
    """TensorBoard's writer, without the curves over seconds, which rsl-rl writes beside those over iterations.

    When the log cannot be written, as on a full disk, the training goes on without it, and says so once.
    """

    def __init__(self, folder: str, purge_step: int) -> None:
        self._folder = folder
        self._writer: SummaryWriter | None = None
        self._hook = threading.excepthook
        threading.excepthook = self._report
        with self._given_up():
            self._writer = SummaryWriter(folder, purge_step=purge_step, flush_secs=10)

    def add_scalar(self, tag: str, *arguments: Any) -> None:
        """Write a value at an iteration."""
        if self._writer is not None and not tag.endswith("/time"):
            with self._given_up():
                self._writer.add_scalar(tag, *arguments)

    def close(self) -> None:
        """Write buffered data."""
        if self._writer is not None:
            with self._given_up():
                self._writer.close()
        threading.excepthook = self._hook

    @contextlib.contextmanager
    def _given_up(self) -> Iterator[None]:
        """In this context an OSError ends the log."""
        try:
            yield
        except OSError as error:
            self._writer = None
            print(
                f"{self._folder}: the training goes on without its TensorBoard log, events.out.tfevents.*, which cannot be "
                f"written: {error.strerror}",
                file=sys.stderr,
            )

    def _report(self, failed: threading.ExceptHookArgs) -> None:
        """Leave out the traceback of TensorBoard's thread, whose error the next call raises again."""
        if not (issubclass(failed.exc_type, OSError) and type(failed.thread).__module__.startswith("tensorboard.")):
            self._hook(failed)


class NullWriter:
    """Takes the place of TensorBoard's writer in a process that writes no files."""

    def add_scalar(self, *_: Any) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


class TrainingLogger(Logger):
    """Writes to TensorBoard what rsl-rl does, and shows a progress line in place of rsl-rl's page of text per iteration.

    The step of a value is the number of iterations done, as in the names of checkpoints. iterations_done: before this start.
    """

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        self._progress = ProgressLine()
        self._recent_s: deque[float] = deque(maxlen=20)
        self.iterations_done = 0
        # In single precision the sum over an episode of millions of steps would stop growing.
        self.cur_reward_sum = torch.zeros_like(self.cur_episode_length, dtype=torch.float64)

    def init_logging_writer(self) -> None:
        """Open the writer. A process that writes nothing gets one too, since rsl-rl calls `save` only if there is one."""
        if self.disable_logs:
            self.writer: Any = NullWriter()
        else:
            # purge_step: what a killed training wrote after its last checkpoint is replaced when it is resumed.
            self.writer = Writer(self.log_dir, self.iterations_done + 1)

    def stop_logging_writer(self) -> None:
        """Write buffered data, and end the progress line."""
        self._progress.close()
        if self.writer is not None:
            self.writer.close()
            self.writer = None

    def log(self, it: int, start_it: int, total_it: int, collect_time: float, learn_time: float, **rest: Any) -> None:
        """Write the iteration with index `it` to TensorBoard, and show it."""
        error_mm, cost = self._mean("/tracking_error_mm"), self._mean("/cost")  # before rsl-rl clears them
        with contextlib.redirect_stdout(io.StringIO()):
            super().log(it + 1, start_it, total_it, collect_time, learn_time, **rest)
        if self.disable_logs:
            return
        seconds = collect_time + learn_time
        self._recent_s.append(seconds)
        self._progress.show(
            Status(
                iteration=it + 1,
                total=total_it,
                steps_per_s=self.num_envs * self.gpu_world_size * self.cfg["num_steps_per_env"] / seconds,
                reward=sum(self.rewbuffer) / len(self.rewbuffer) if self.rewbuffer else None,
                episode_length=sum(self.lenbuffer) / len(self.lenbuffer) if self.lenbuffer else None,
                error_mm=error_mm,
                cost=cost,
                learning_rate=rest["learning_rate"],
                seconds_left=sum(self._recent_s) / len(self._recent_s) * (total_it - it - 1),
            )
        )

    def state_dict(self) -> dict[str, Any]:
        """State for an exact resume: totals, unfinished episodes, and the last finished ones."""
        state = {name: getattr(self, name) for name in (*_NUMBERS, *_TENSORS)}
        return state | {name: list(getattr(self, name)) for name in _BUFFERS}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from a `state_dict`."""
        for name in _NUMBERS:
            setattr(self, name, state[name])
        for name in _TENSORS:
            getattr(self, name).copy_(state[name])
        for name in _BUFFERS:
            setattr(self, name, deque(state[name], maxlen=getattr(self, name).maxlen))

    def _mean(self, name: str) -> float:
        """Mean over this iteration's steps of one of the environment's measurements."""
        return float(torch.stack([step[name] for step in self.ep_extras]).mean())
