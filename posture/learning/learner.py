"""rsl-rl's OnPolicyRunner with checkpoints in safe files, an exact resume and a progress line."""

import contextlib
import io
import math
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import torch
from rsl_rl.runners import OnPolicyRunner
from torch.optim.swa_utils import AveragedModel

from envs.task.head_tracking import HeadTrackingEnv
from posture.cli import signals
from posture.config.agent import AgentConfig
from posture.config.errors import ConfigError
from posture.learning import parallel
from posture.learning.logger import TrainingLogger
from posture.storage import checkpoint


class _EndedEarlyError(Exception):
    """The training ends before its last iteration."""


class Learner(OnPolicyRunner):
    """PPO on a `HeadTrackingEnv`. Iterations are counted when they are done: model_10.pt is the policy after ten."""

    env: HeadTrackingEnv
    logger: TrainingLogger
    current_learning_iteration: int
    is_distributed: bool

    def __init__(self, env: HeadTrackingEnv, agent: AgentConfig, folder: Path, device: str) -> None:
        config = agent.model_dump(mode="json", exclude_none=True, exclude={"std_floor", "average_from"})
        self._average_from = agent.average_from
        self._std_floor, self._highest_floor = agent.std_floor, agent.actor.distribution_cfg.std_range[0]
        config["algorithm"]["class_name"] = "posture.learning.ppo:LeanPPO"
        # rsl-rl would save after iterations 1, 51, ...; `save` is called after each, and keeps 50, 100, ... and the last.
        config["save_interval"] = 1
        config["check_for_nan"] = False  # LeanPPO checks for infinities too, and on all processes together
        self.folder = folder
        self._save_interval, self._total, self._done = agent.save_interval, 0, 0
        self._after_checkpoint: Callable[[int, Any], bool] | None = None
        with contextlib.redirect_stdout(io.StringIO()):  # rsl-rl prints its networks
            super().__init__(env, config, log_dir=str(folder), device=device)
        self._average = AveragedModel(self.alg.actor)
        self.logger = TrainingLogger(
            log_dir=str(folder),
            cfg=self.cfg,
            env_cfg=env.cfg,
            num_envs=env.num_envs,
            is_distributed=self.is_distributed,
            gpu_world_size=self.gpu_world_size,
            gpu_global_rank=self.gpu_global_rank,
            device=device,
        )
        if self.is_distributed:
            self.alg.broadcast_parameters()
            self.is_distributed = False  # else rsl-rl broadcasts again in every `learn`, and prints that it does

    def train(self, total_iterations: int, after_checkpoint: Callable[[int, Any], bool] | None = None) -> None:
        """Learn until `total_iterations` iterations are done, those before a resume included.

        `after_checkpoint(iterations done, log writer)` is called in the first process after it has saved a checkpoint; where
        it returns True the training ends.
        SIGINT or SIGTERM ends the training after the current iteration, saved, and raises signals.Stopped in every process.
        Raises FloatingPointError with the number of the iteration, see `posture.learning.ppo`.
        """
        self._total, self._done = total_iterations, self.current_learning_iteration
        self._after_checkpoint = after_checkpoint
        self.logger.iterations_done = self._done
        self._set_std_floor()
        try:
            with signals.deferred(), contextlib.suppress(_EndedEarlyError):
                self.learn(total_iterations - self._done)
        except FloatingPointError as error:
            raise FloatingPointError(f"iteration {self._done + 1}: {error}") from None
        finally:
            self.logger.stop_logging_writer()
        self.current_learning_iteration = self._done  # rsl-rl leaves the index of the last one

    def save(self, path: str, infos: dict[str, Any] | None = None) -> None:
        """Save a checkpoint if one is due; rsl-rl calls this after every iteration.

        After a signal, save and raise signals.Stopped.
        """
        self.env.sim.check_capacity()
        done = self.current_learning_iteration + 1
        if done == self._done:
            return  # rsl-rl calls this once more at the end
        self._done = done
        if self._average_from is not None and self._share() > self._average_from:
            self._average.update_parameters(self.alg.actor)
        stop = parallel.any_process(bool(signals.pending()), self.device)
        due = done % self._save_interval == 0 or done == self._total
        if stop or due:
            self._save(done, infos)
        self._set_std_floor()
        if due and not stop:
            ends = self._after_checkpoint is not None and self._after_checkpoint(done, self.logger.writer)
            if parallel.any_process(ends, self.device):
                raise _EndedEarlyError
        if stop:
            if parallel.rank() == 0:
                print(f"stopped after iteration {done}: saved in {self.folder}; resume continues from there", flush=True)
            raise signals.Stopped(signals.pending() or signal.SIGTERM)

    def _share(self) -> float:
        """Share of the training that is done."""
        steps = self.env.training_steps
        return self._done * self.cfg["num_steps_per_env"] / steps if steps is not None else self._done / self._total

    def _set_std_floor(self) -> None:
        """Set the lower bound of the actions' standard deviation for the next iteration; see `agent.std_floor`."""
        if self._std_floor is None or self.env.training_steps is None:
            return
        progress = min(max((self._share() - self._std_floor.begin) / (1.0 - self._std_floor.begin), 0.0), 1.0)
        floor = self._highest_floor ** (1.0 - progress) * self._std_floor.end**progress
        distribution = self.alg.actor.distribution
        distribution.std_range[0], distribution.log_std_range[0] = floor, math.log(floor)

    def _save(self, done: int, infos: dict[str, Any] | None) -> None:
        """Write model_<done>.pt, and resume.pt with everything else that an exact resume needs.

        The averages of the actor's weights are the policy of evaluations (`posture.learning.networks.load_policy`).
        """
        states = parallel.gather(self._process_state())
        if parallel.rank() != 0:
            return
        content = self.alg.save() | {"iter": done, "infos": infos}
        if self._average.n_averaged:
            content["average_state_dict"] = self._average.module.state_dict()
        checkpoint.save(content, self.folder / f"model_{done}.pt")
        averaged = int(self._average.n_averaged)
        checkpoint.save({"iteration": done, "averaged": averaged, "processes": states}, self.folder / "resume.pt")

    def load(
        self, path: str, load_cfg: dict[str, Any] | None = None, strict: bool = True, map_location: str | None = None
    ) -> Any:
        """Load policy, value function and optimiser; the next iteration is the one after those done."""
        content = checkpoint.load(Path(path), map_location or self.device)
        with _must_fit(Path(path)):
            self.alg.load(content, load_cfg, strict)
            self.current_learning_iteration = int(content["iter"])
            if "average_state_dict" in content:
                self._average.module.load_state_dict(content["average_state_dict"])
        return content.get("infos")

    def start_from(self, file: Path) -> None:
        """Take the policy, value function and normalisers of another training, not its optimiser and counters."""
        content = checkpoint.as_policy(checkpoint.load(file, self.device))
        with _must_fit(file):
            self.alg.load(content, {"actor": True, "critic": True}, strict=True)
        distribution = self.alg.actor.distribution
        with torch.no_grad():  # outside its bounds a standard deviation has no gradient
            for name, bounds in (("log_std_param", distribution.log_std_range), ("std_param", distribution.std_range)):
                if hasattr(distribution, name):
                    getattr(distribution, name).clamp_(*bounds)

    def resume(self) -> None:
        """Continue from the newest checkpoint of the run's folder exactly as if training had never stopped."""
        file = self.folder / "resume.pt"
        saved = checkpoint.load(file, self.device)
        with _must_fit(file):
            self.load(str(self.folder / f"model_{saved['iteration']}.pt"))
            if len(saved["processes"]) != parallel.size():
                raise ValueError(f"it was trained by {len(saved['processes'])} processes, not {parallel.size()}")
            self._average.n_averaged.fill_(saved.get("averaged", 0))
            state = saved["processes"][parallel.rank()]
            self.env.load_state_dict(state["env"])
            self.logger.load_state_dict(state["logger"])
            torch.set_rng_state(state["rng"].cpu())
            for network, memory in zip((self.alg.actor, self.alg.critic), state["memory"], strict=True):
                network.reset(hidden_state=memory)
            if torch.device(self.device).type == "cuda":
                torch.cuda.set_rng_state(state["cuda_rng"].cpu(), self.device)

    def _process_state(self) -> dict[str, Any]:
        """State of this process beside the policy: worlds, random numbers, logger and memory of recurrent networks."""
        memory = [network.get_hidden_state() for network in (self.alg.actor, self.alg.critic)]  # None if not recurrent
        state = {
            "env": self.env.state_dict(),
            "rng": torch.get_rng_state(),
            "logger": self.logger.state_dict(),
            "memory": memory,
        }
        if torch.device(self.device).type == "cuda":
            state["cuda_rng"] = torch.cuda.get_rng_state(self.device)
        return state

    def _configure_multi_gpu(self) -> None:
        """On GPUs rsl-rl joins the processes; on a CPU `posture.learning.parallel` has done so.

        rsl-rl reads WORLD_SIZE, which may have no effect (`posture.config.torchrun`).
        """
        if self.device != "cpu" and parallel.size() > 1:
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


@contextlib.contextmanager
def _must_fit(file: Path) -> Iterator[None]:
    """Turn the errors that a file of another configuration causes into a ConfigError."""
    try:
        yield
    except (KeyError, RuntimeError, TypeError, AttributeError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ConfigError(f"{file}: does not fit this run's configuration ({reason})") from None
