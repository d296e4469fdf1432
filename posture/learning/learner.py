"""rsl-rl's OnPolicyRunner with safe files, an exact resume and our progress line."""

import contextlib
import io
import signal
from collections import deque
from pathlib import Path
from typing import Any

import torch
from rsl_rl.runners import OnPolicyRunner
from rsl_rl.utils.logger import Logger

from envs.task.head_tracking import HeadTrackingEnv
from posture.cli import signals
from posture.config.agent import AgentConfig
from posture.config.errors import ConfigError
from posture.learning import parallel
from posture.learning.progress import Progress, Status
from posture.storage import checkpoint

_LOGGER_TENSORS = ("cur_reward_sum", "cur_episode_length")
_LOGGER_BUFFERS = ("rewbuffer", "lenbuffer")


class Learner(OnPolicyRunner):
    """PPO on a `HeadTrackingEnv`. Iterations are counted as done: model_10.pt is the policy after ten."""

    env: HeadTrackingEnv
    logger: Logger
    current_learning_iteration: int
    is_distributed: bool

    def __init__(self, env: HeadTrackingEnv, agent: AgentConfig, folder: Path, device: str) -> None:
        config = agent.model_dump(mode="json")
        config["logger"] = "tensorboard"
        config["algorithm"]["class_name"] = "posture.learning.ppo:LeanPPO"
        # rsl-rl would save after iterations 1, 51, 101, ...; `save` is asked every time and keeps 50, 100, ... and the last.
        config["save_interval"] = 1
        config["check_for_nan"] = False  # LeanPPO looks for infinities too, and on all processes together
        self._save_interval, self._last, self._done = agent.save_interval, 0, 0
        with contextlib.redirect_stdout(io.StringIO()):  # rsl-rl prints its networks
            super().__init__(env, config, log_dir=str(folder), device=device)
        stock = self.logger
        self.logger = ProgressLogger(
            log_dir=stock.log_dir,
            cfg=stock.cfg,
            env_cfg=stock.env_cfg,
            num_envs=stock.num_envs,
            is_distributed=self.is_distributed,
            gpu_world_size=self.gpu_world_size,
            gpu_global_rank=self.gpu_global_rank,
            device=device,
        )
        self.folder = folder
        if self.is_distributed:
            self.alg.broadcast_parameters()
            self.is_distributed = False  # rsl-rl would do it again at every `learn`, and say so

    def train(self, total_iterations: int) -> None:
        """Learn until `total_iterations` iterations are done, those before a resume included.

        SIGINT or SIGTERM ends it after the iteration in which it comes, saved: raises signals.Stopped on every process.
        Raises FloatingPointError that names the iteration, see `posture.learning.ppo`.
        """
        self._last, self._done = total_iterations, self.current_learning_iteration
        try:
            with signals.deferred():
                self.learn(total_iterations - self._done)
        except FloatingPointError as error:
            raise FloatingPointError(f"iteration {self._done + 1}: {error}") from None
        finally:
            self.logger.stop_logging_writer()
        self.current_learning_iteration = total_iterations  # rsl-rl leaves the index of the last one

    def save(self, path: str, infos: dict[str, Any] | None = None) -> None:
        """Save model_<iterations done>.pt, and resume.pt with what else an exact resume needs, if it is time to.

        rsl-rl asks after every iteration, so this is also where a training that a signal has asked to stop does.
        """
        self._done = done = self.current_learning_iteration + 1
        stop = parallel.any_process(bool(signals.asked()), self.device)
        if stop or done % self._save_interval == 0 or done == self._last:
            self._save(done, Path(path).with_name(f"model_{done}.pt"), infos)
        if stop:
            if parallel.rank() == 0:
                print(f"\nstopped after iteration {done}: saved in {self.folder}, resume goes on from there", flush=True)
            raise signals.Stopped(signals.asked() or signal.SIGTERM)

    def _save(self, done: int, model: Path, infos: dict[str, Any] | None) -> None:
        states = parallel.gather(self._own_state())
        if parallel.rank() != 0:
            return
        content = self.alg.save()
        content["iter"] = done
        content["infos"] = infos
        checkpoint.save(content, model)
        checkpoint.save({"iteration": done, "processes": states}, self.folder / "resume.pt")

    def load(
        self, path: str, load_cfg: dict[str, Any] | None = None, strict: bool = True, map_location: str | None = None
    ) -> Any:
        """Load policy, value function and optimiser; the next iteration is the one after those done."""
        content = checkpoint.load(Path(path), map_location or self.device)
        try:
            self.alg.load(content, load_cfg, strict)
            self.current_learning_iteration = int(content["iter"])
        except (KeyError, RuntimeError, TypeError, ValueError) as error:
            reason = " ".join(str(error).split())[:200]
            raise ConfigError(f"{path}: does not fit this run's configuration ({reason})") from None
        return content.get("infos")

    def resume(self) -> None:
        """Go on from the newest checkpoint of the run's folder exactly as if there had been no break."""
        kept = checkpoint.load(self.folder / "resume.pt", self.device)
        try:
            self.load(str(self.folder / f"model_{kept['iteration']}.pt"))
            if len(kept["processes"]) != parallel.size():
                raise ValueError(f"{len(kept['processes'])} processes have trained it, not {parallel.size()}")
            state = kept["processes"][parallel.rank()]
            self.env.load_state_dict(state["env"])
            self._load_logger(state["logger"])
            torch.set_rng_state(state["rng"].cpu())
            if torch.device(self.device).type == "cuda":
                torch.cuda.set_rng_state(state["cuda_rng"].cpu(), self.device)
        except (KeyError, RuntimeError, TypeError, AttributeError, ValueError) as error:
            reason = " ".join(str(error).split())[:200]
            raise ConfigError(f"{self.folder / 'resume.pt'}: does not fit this run's configuration ({reason})") from None

    def _own_state(self) -> dict[str, Any]:
        """What this process needs for an exact resume, beside the policy."""
        state: dict[str, Any] = {
            "env": self.env.state_dict(),
            "rng": torch.get_rng_state(),
            "logger": {name: getattr(self.logger, name) for name in ("tot_timesteps", "tot_time", *_LOGGER_TENSORS)}
            | {name: list(getattr(self.logger, name)) for name in _LOGGER_BUFFERS},
        }
        if torch.device(self.device).type == "cuda":
            state["cuda_rng"] = torch.cuda.get_rng_state(self.device)
        return state

    def _configure_multi_gpu(self) -> None:
        """Join the processes that share the training: on a CPU those of `posture.learning.parallel`, on GPUs rsl-rl's
        own."""
        if self.device != "cpu":
            super()._configure_multi_gpu()
            return
        self.gpu_world_size, self.gpu_global_rank, self.gpu_local_rank = parallel.size(), parallel.rank(), parallel.rank()
        self.is_distributed = self.gpu_world_size > 1
        self.cfg["multi_gpu"] = None
        if self.is_distributed:
            self.cfg["multi_gpu"] = {
                "global_rank": self.gpu_global_rank,
                "local_rank": self.gpu_local_rank,
                "world_size": self.gpu_world_size,
            }

    def _load_logger(self, state: dict[str, Any]) -> None:
        self.logger.tot_timesteps, self.logger.tot_time = state["tot_timesteps"], state["tot_time"]
        for name in _LOGGER_TENSORS:
            getattr(self.logger, name).copy_(state[name])
        for name in _LOGGER_BUFFERS:
            setattr(self.logger, name, deque(state[name], maxlen=getattr(self.logger, name).maxlen))


class Nowhere:
    """A writer of a process that writes nothing."""

    def add_scalar(self, *_: Any) -> None:
        """Write nothing."""

    def close(self) -> None:
        """Nothing to close."""


class ProgressLogger(Logger):
    """rsl-rl's TensorBoard logger, with our progress line instead of its page of text an iteration."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        self._progress = Progress()

    def init_logging_writer(self) -> None:
        """Begin to write; a process that does not write still counts, since `save` is asked of those that have a writer."""
        super().init_logging_writer()
        if self.disable_logs:
            self.writer: Any = Nowhere()

    def stop_logging_writer(self) -> None:
        """Write out what is still held back."""
        if self.writer is not None:
            self.writer.close()
            self.writer = None

    def log(self, it: int, start_it: int, total_it: int, collect_time: float, learn_time: float, **rest: Any) -> None:
        """Write the iteration to TensorBoard and show it."""
        error_mm = float(torch.stack([step["/tracking_error_mm"] for step in self.ep_extras]).mean())
        cost = float(torch.stack([step["/cost"] for step in self.ep_extras]).mean())
        with contextlib.redirect_stdout(io.StringIO()):
            super().log(
                it=it, start_it=start_it, total_it=total_it, collect_time=collect_time, learn_time=learn_time, **rest
            )
        seconds = collect_time + learn_time
        if self.disable_logs:
            return
        self._recent = (*getattr(self, "_recent", ()), seconds)[-20:]
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
                seconds_left=sum(self._recent) / len(self._recent) * (total_it - it - 1),
            )
        )

    def _store_code_state(self) -> list[str]:
        # The commit is in provenance.yaml; a diff of whatever checkout surrounds the run is not the run's to copy.
        return []
