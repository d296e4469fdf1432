"""rsl-rl's logger with a progress line, and with a state that a resumed training continues.

rsl-rl's own writer for Weights & Biases begins a new run at each start; `WandbWriter` continues the one that was begun.
"""

import contextlib
import io
import os
import sys
import threading
import uuid
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import torch
from PIL import Image
from rsl_rl.utils.logger import Logger
from tensorboard.compat.proto.summary_pb2 import Summary
from torch.utils.tensorboard import SummaryWriter

from posture.config.errors import RunError
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

    def add_film(self, path: Path, step: int) -> None:
        """Write a GIF at an iteration; TensorBoard plays it among its images."""
        if self._writer is not None:
            with self._given_up(), Image.open(path) as gif:
                image = Summary.Image(
                    width=gif.width, height=gif.height, colorspace=3, encoded_image_string=path.read_bytes()
                )
                summary = Summary(value=[Summary.Value(tag="film", image=image)])
                self._writer._get_file_writer().add_summary(summary, step)  # type: ignore[no-untyped-call]

    def flush(self) -> None:
        """Values are written as they come."""

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


class WandbWriter(Writer):
    """A run of Weights & Biases beside TensorBoard's files. WANDB_MODE, WANDB_PROJECT and the like have their usual effect.

    Raises RunError if it cannot be begun. Errors later in the training are left to wandb, which goes on in the background.
    """

    def __init__(self, folder: str, purge_step: int, run_id: str, config: dict[str, Any]) -> None:
        import wandb

        try:
            self._run = wandb.init(
                project=os.environ.get("WANDB_PROJECT", "posture"),
                name=Path(folder).name,
                dir=folder,
                id=run_id,
                resume="allow",
                config=config,
                settings=wandb.Settings(console="off", silent=True),
            )
        except wandb.Error as error:
            reason = " ".join(str(error).split())
            raise RunError(f"wandb: {reason}; WANDB_MODE=offline logs into {folder}/wandb") from None
        # Evaluations and films end after later iterations have been logged, and steps cannot go back.
        for name in ("Evaluation/*", "film"):
            self._run.define_metric(name, step_metric="iteration")
        self._values: dict[str, Any] = {}
        self._step = 0
        super().__init__(folder, purge_step)

    def add_scalar(self, tag: str, value: Any, step: int) -> None:
        """Write a value at an iteration."""
        super().add_scalar(tag, value, step)
        if tag.startswith("Evaluation/"):
            self._run.log({tag: float(value), "iteration": step})
        elif not tag.endswith("/time"):
            self._values[tag], self._step = float(value), step

    def add_film(self, path: Path, step: int) -> None:
        """Write a GIF at an iteration."""
        import wandb

        super().add_film(path, step)
        self._run.log({"film": wandb.Video(str(path), format="gif"), "iteration": step})

    def flush(self) -> None:
        """Send the values of an iteration, together because each call takes time."""
        self._run.log(self._values, step=self._step)
        self._values = {}

    def close(self) -> None:
        """Write buffered data."""
        super().close()
        self._run.finish()


class NullWriter:
    """Takes the place of TensorBoard's writer in a process that writes no files, and with `agent.logger=none`."""

    def add_scalar(self, *_: Any) -> None:
        """Do nothing."""

    def add_film(self, *_: Any) -> None:
        """Do nothing."""

    def flush(self) -> None:
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
        self._wandb_id: str | None = None
        self._steps: list[tuple[torch.Tensor, torch.Tensor, torch.Tensor]] = []
        # In single precision the sum over an episode of millions of steps would stop growing.
        self.cur_reward_sum = torch.zeros_like(self.cur_episode_length, dtype=torch.float64)

    def init_logging_writer(self) -> None:
        """Open the writer. A process that writes nothing gets one too, since rsl-rl calls `save` only if there is one."""
        self.writer: Any = NullWriter()
        if self.disable_logs:
            return
        # What a killed training wrote after its last checkpoint is replaced when it is resumed.
        purge_step = self.iterations_done + 1
        if self.cfg["logger"] == "tensorboard":
            self.writer = Writer(self.log_dir, purge_step)
        elif self.cfg["logger"] == "wandb":
            self._wandb_id = self._wandb_id or uuid.uuid4().hex[:12]
            config = {"agent": self.cfg, "env": self.env_cfg}
            self.writer = WandbWriter(self.log_dir, purge_step, self._wandb_id, config)

    def stop_logging_writer(self) -> None:
        """Write buffered data, and end the progress line."""
        self._progress.close()
        if self.writer is not None:
            self.writer.close()
            self.writer = None

    def process_env_step(
        self, rewards: torch.Tensor, dones: torch.Tensor, extras: dict[str, Any], intrinsic_rewards: Any = None
    ) -> None:
        """As rsl-rl's, but without waiting for a GPU: ended episodes are looked for after the iteration."""
        self.ep_extras.append(extras["log"])
        self.cur_reward_sum += rewards
        self.cur_episode_length += 1
        self._steps.append((dones, self.cur_reward_sum.clone(), self.cur_episode_length.clone()))
        for values in (self.cur_reward_sum, self.cur_episode_length):
            values.masked_fill_(dones, 0)

    def _note_ended_episodes(self) -> None:
        """Returns and lengths of the episodes that ended in this iteration."""
        for dones, returns, lengths in self._steps:
            self.rewbuffer.extend(returns[dones].tolist())
            self.lenbuffer.extend(lengths[dones].tolist())
        self._steps.clear()

    def log(self, it: int, start_it: int, total_it: int, collect_time: float, learn_time: float, **rest: Any) -> None:
        """Write the iteration with index `it` to TensorBoard, and show it."""
        self._note_ended_episodes()
        error_mm, cost = self._mean("/tracking_error_mm"), self._mean("/cost")  # before rsl-rl clears them
        with contextlib.redirect_stdout(io.StringIO()):
            super().log(it + 1, start_it, total_it, collect_time, learn_time, **rest)
        self.writer.flush()
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
        own = {} if self._wandb_id is None else {"wandb_id": self._wandb_id}
        return state | {name: list(getattr(self, name)) for name in _BUFFERS} | own

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from a `state_dict`."""
        self._wandb_id = state.get("wandb_id")
        for name in _NUMBERS:
            setattr(self, name, state[name])
        for name in _TENSORS:
            getattr(self, name).copy_(state[name])
        for name in _BUFFERS:
            setattr(self, name, deque(state[name], maxlen=getattr(self, name).maxlen))

    def _mean(self, name: str) -> float:
        """Mean over this iteration's steps of one of the environment's measurements."""
        return float(torch.stack([step[name] for step in self.ep_extras]).mean())
