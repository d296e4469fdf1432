"""Configuration of the training; values, units and sources in conf/train.yaml."""

from typing import Annotated, Any

from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import Field, model_validator

from envs.config import EnvConfig, Steps, check_once
from posture.config.agent import AgentConfig
from posture.config.checks import CommandConfig, PathText, check_engine
from posture.config.eval import EvaluationConfig, check_trial


class TrainConfig(CommandConfig):
    """Configuration of `posture.train`, which a run folder keeps as config.yaml."""

    env: EnvConfig
    agent: AgentConfig
    evaluation: EvaluationConfig
    seed: Annotated[int, Field(ge=0, lt=2**31)]
    device: str
    processes: Annotated[int, Field(ge=1, le=256)]
    threads: Annotated[int, Field(ge=1, le=1024)]
    max_iterations: Steps
    resume: PathText | None
    init: PathText | None
    evaluate: bool
    evaluate_every: Steps | None
    film_every: Steps | None
    patience: Annotated[int, Field(ge=1, le=1_000_000)] | None

    @property
    def training_steps(self) -> int:
        """Control steps of each world in the whole training."""
        return self.max_iterations * self.agent.num_steps_per_env

    def without_effect(self) -> dict[str, str]:
        """See `CommandConfig`. Keys of the solver and of the evaluation count in later evaluations of the run."""
        shown = {*self.agent.obs_groups.actor, *self.agent.obs_groups.critic}
        unused = {f"env.observations.{group}": "without agent.obs_groups" for group in self.env.observations.keys() - shown}
        unused |= self.env.without_effect("env.")
        if self.agent.algorithm.schedule == "fixed":
            unused["agent.algorithm.desired_kl"] = "with agent.algorithm.schedule=fixed"
        if self.evaluate_every is None and self.resume is None:  # a run that is resumed may have it
            unused["patience"] = "without evaluate_every"
        if self.device != "cpu" and self.processes > 1:
            unused["processes"] = f"with device={self.device}"
        return unused

    @model_validator(mode="after")
    def _consistent(self) -> "TrainConfig":
        check_trial(self.evaluation, self.env)
        check_engine(self.env.physics, self.device)
        for name in ("evaluate_every", "film_every"):
            every, saved = getattr(self, name), self.agent.save_interval
            if every is not None and every % saved and self.resume is None:  # a run that is resumed has its own
                raise ValueError(f"{name} = {every}: allowed is a multiple of agent.save_interval, {saved}")
            if every is not None and every > self.max_iterations and self.resume is None:
                raise ValueError(f"{name} = {every}: allowed is at most max_iterations, {self.max_iterations}")
        if self.evaluate_every is not None and (
            self.env.ramp is not None or self.evaluation.tolerance >= self.env.amplitude
        ):
            raise ValueError(
                "evaluate_every: policies are compared by their cost over the least cost, which there is only at constant "
                "frequencies and with evaluation.tolerance below env.amplitude"
            )
        known = set(self.env.observations)
        for network, groups in (("actor", self.agent.obs_groups.actor), ("critic", self.agent.obs_groups.critic)):
            missing = sorted(set(groups) - known)
            if missing:
                raise ValueError(
                    f"agent.obs_groups.{network}: {', '.join(missing)} not among the groups of env.observations "
                    f"({', '.join(sorted(known))})"
                )
            check_once(groups, f"agent.obs_groups.{network}")
            if not any(self.env.observations[group] for group in groups):
                raise ValueError(f"agent.obs_groups.{network}: the groups {', '.join(groups)} of env.observations are empty")
        processes = self.processes if self.device == "cpu" else 1
        if self.env.num_envs % processes:
            raise ValueError(f"env.num_envs = {self.env.num_envs} cannot be shared equally among {processes} processes")
        own = self.env.num_envs // processes * self.agent.num_steps_per_env
        parts = self.agent.algorithm.num_mini_batches
        if own < 2 * parts:
            raise ValueError(
                f"env.num_envs x agent.num_steps_per_env = {own} samples a process do not fill {parts} mini-batches with "
                "two samples each: raise one of the former, or lower agent.algorithm.num_mini_batches"
            )
        # rsl-rl shares worlds, not samples, among the mini-batches of a network with a memory, and leaves the rest out.
        recurrent = "RNNModel" in (self.agent.actor.class_name, self.agent.critic.class_name)
        if recurrent and self.env.num_envs % (processes * parts):
            raise ValueError(
                f"env.num_envs = {self.env.num_envs}: with a recurrent layer allowed is a multiple of processes x "
                f"agent.algorithm.num_mini_batches, {processes * parts}"
            )
        return self


def amplitudes(share: float, from_hz: float, *, _root_: DictConfig) -> list[float] | None:
    """Lowest and highest amplitude [m] that a training draws if its target is never slower than `from_hz` [Hz].

    They go from `share` of `env.amplitude` to the whole, but not below the head's tolerances. None if the target is slower,
    and in commands that do not train. A resolver of conf/.

    Where a value is of another kind, the check of the configuration says what is wrong.
    """
    if "agent" not in _root_:
        return None
    try:
        keys = ("freq", "amplitude", "termination.head_tolerance", "reward.tolerance", "ranges.tolerance")
        freq, amplitude, *tolerances = (OmegaConf.select(_root_, f"env.{key}") for key in keys)
    except OmegaConfBaseException:
        return None
    slowest = _end(freq, 0)
    limits = [_end(tolerance, -1) for tolerance in tolerances if tolerance is not None]
    numbers = (slowest, amplitude, *limits)
    # An integer may be larger than any float.
    if not all(type(number) in (int, float) and abs(number) < 1e9 for number in numbers) or slowest < from_hz:
        return None
    low = max(float(f"{share * amplitude:.6g}"), *limits)
    return [low, amplitude] if low < amplitude else None


def _end(value: Any, index: int) -> Any:
    """An end of a range; a single number is both ends."""
    return value[index] if isinstance(value, ListConfig) and value else value
