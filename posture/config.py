"""Configuration of learner and analyst, typed and range-checked, and the one way from plain mappings to it.

Bad input becomes a `ConfigError` whose message is one line: what was wrong and what is allowed.
"""

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeVar

import torch
from pydantic import BaseModel, Field, ValidationError, model_validator

from envs.config import MAX_FREQ_HZ, EnvConfig, Freq, NonNegative, Physics, Positive, Ramp, Strict
from envs.observations import TERMS

Count = Annotated[int, Field(ge=1)]
Share = Annotated[float, Field(gt=0, le=1)]


class ConfigError(Exception):
    """The user's input is wrong; the message is one line. Entry points end with exit code 2."""


class ObsGroups(Strict):
    """Which of the environment's observation groups each network sees."""

    actor: Annotated[tuple[str, ...], Field(min_length=1)]
    critic: Annotated[tuple[str, ...], Field(min_length=1)]


class AlgorithmConfig(Strict):
    """rsl-rl's PPO, its keys unrenamed."""

    class_name: Literal["PPO"]
    num_learning_epochs: Count
    num_mini_batches: Count
    clip_param: Positive
    gamma: Share
    lam: Annotated[float, Field(ge=0, le=1)]
    value_loss_coef: NonNegative
    entropy_coef: NonNegative
    learning_rate: Positive
    max_grad_norm: Positive
    optimizer: Literal["adam", "adamw", "sgd", "rmsprop"]
    use_clipped_value_loss: bool
    schedule: Literal["adaptive", "fixed"]
    desired_kl: Positive
    normalize_advantage_per_mini_batch: bool


class DistributionConfig(Strict):
    """rsl-rl's Gaussian action distribution with a standard deviation that does not depend on the state."""

    class_name: Literal["GaussianDistribution"]
    init_std: Positive
    std_range: tuple[Positive, Positive]
    std_type: Literal["log", "scalar"]

    @model_validator(mode="after")
    def _ordered(self) -> "DistributionConfig":
        if not self.std_range[0] <= self.init_std <= self.std_range[1]:
            raise ValueError(f"init_std = {self.init_std:g} must lie within std_range {list(self.std_range)}")
        return self


class CriticConfig(Strict):
    """rsl-rl's MLPModel."""

    class_name: Literal["MLPModel"]
    hidden_dims: Annotated[tuple[Count, ...], Field(min_length=1)]
    activation: Literal["elu", "selu", "relu", "crelu", "lrelu", "tanh", "sigmoid", "softplus", "gelu", "swish", "mish"]
    obs_normalization: bool


class ActorConfig(CriticConfig):
    """rsl-rl's MLPModel with an action distribution."""

    distribution_cfg: DistributionConfig


class AgentConfig(Strict):
    """What rsl-rl's OnPolicyRunner is given."""

    num_steps_per_env: Count
    save_interval: Count
    obs_groups: ObsGroups
    algorithm: AlgorithmConfig
    actor: ActorConfig
    critic: CriticConfig


class EvaluationConfig(Strict):
    """How a policy is evaluated; units and sources in conf/evaluation/."""

    freq: Annotated[tuple[Freq, ...], Field(min_length=1, max_length=500)]
    duration: Positive
    transient: NonNegative
    tolerance: Positive
    still_joint_deg: Positive
    figures: bool


class TrainConfig(Strict):
    """Everything that `posture.train` is told, and what a run folder keeps as config.yaml."""

    env: EnvConfig
    agent: AgentConfig
    evaluation: EvaluationConfig
    seed: Annotated[int, Field(ge=0, lt=2**31)]
    device: str
    processes: Annotated[int, Field(ge=1, le=256)]
    threads: Count
    max_iterations: Count
    resume: str | None
    evaluate: bool
    paper: dict[str, Any]

    @model_validator(mode="after")
    def _consistent(self) -> "TrainConfig":
        check_trial(self.evaluation, self.env)
        check_engine(self.env.physics, self.device)
        for group, terms in self.env.observations.items():
            unknown = sorted(set(terms) - set(TERMS))
            if unknown:
                raise ValueError(
                    f"env.observations.{group}: unknown {', '.join(unknown)}; allowed are {', '.join(sorted(TERMS))}"
                )
        known = set(self.env.observations)
        for network, groups in (("actor", self.agent.obs_groups.actor), ("critic", self.agent.obs_groups.critic)):
            missing = sorted(set(groups) - known)
            if missing:
                raise ValueError(
                    f"agent.obs_groups.{network}: {', '.join(missing)} not among the groups of env.observations "
                    f"({', '.join(sorted(known))})"
                )
        if self.env.num_envs % self.processes:
            raise ValueError(f"env.num_envs = {self.env.num_envs} cannot be shared equally among {self.processes} processes")
        own = self.env.num_envs // self.processes * self.agent.num_steps_per_env
        parts = self.agent.algorithm.num_mini_batches
        if own < 2 * parts:
            raise ValueError(
                f"env.num_envs x agent.num_steps_per_env = {own} samples a process do not fill {parts} mini-batches with "
                "two samples each: raise one of the former, or lower agent.algorithm.num_mini_batches"
            )
        return self


class EnvChanges(Strict):
    """Changes to the environment of a run under evaluation; None: as trained."""

    hip_k: NonNegative | None
    ankle_k: NonNegative | None
    load: NonNegative | None
    amplitude: Positive | None
    physics: Physics | None
    ramp: Ramp | None


class LqrConfig(Strict):
    """The model-based controller (posture/lqr.py), and the environment that it acts in before `EnvChanges`."""

    env: EnvConfig
    angle: Positive
    velocity: Positive
    torque: Positive
    fade_in: Positive
    foot_margin: NonNegative
    tolerance_margin: NonNegative


class EvalConfig(Strict):
    """Everything that `posture.eval` is told."""

    policy: Literal["trained", "lqr"]
    lqr: LqrConfig
    ckpt: str
    device: str
    out: str | None
    again: bool
    env: EnvChanges
    evaluation: EvaluationConfig
    paper: dict[str, Any]

    @model_validator(mode="after")
    def _consistent(self) -> "EvalConfig":
        check_engine(self.env.physics or (self.lqr.env.physics if self.policy == "lqr" else None), self.device)
        return self


Config = TypeVar("Config", bound=BaseModel)


def read(kind: type[Config], values: Mapping[str, Any], where: str = "") -> Config:
    """`values` as a checked `kind`. Raises ConfigError with one line; `where` says which file is meant, if any."""
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        raise ConfigError((f"{where}: " if where else "") + _one_line(error)) from None


def check_device(device: str) -> None:
    """Raise ConfigError unless torch can compute on `device` here."""
    if not re.fullmatch(r"cpu|cuda(:\d+)?", device):
        raise ConfigError(f"device: '{device}' is not known; allowed are cpu, cuda, cuda:0, cuda:1, ...")
    if device == "cpu":
        return
    if not torch.cuda.is_available():
        raise ConfigError(f"device: '{device}' asks for CUDA, but torch {torch.__version__} finds no CUDA device; use cpu")
    if int(device.partition(":")[2] or 0) >= torch.cuda.device_count():
        raise ConfigError(f"device: '{device}' does not exist; this machine has {torch.cuda.device_count()} CUDA devices")


def check_engine(physics: Physics | None, device: str) -> None:
    """Raise ValueError unless the engine, where one is named, can compute on `device`."""
    if physics == "mujoco_c" and device != "cpu":
        raise ValueError(f"device: env.physics=mujoco_c computes on cpu alone, not on '{device}'")


def check_trial(evaluation: EvaluationConfig, env: EnvConfig) -> None:
    """Raise ValueError unless a trial lasts for two control steps or more after its transient."""
    steps = round(evaluation.duration / env.control_dt)
    if (steps - 1) * env.control_dt < evaluation.transient:
        raise ValueError(
            f"evaluation.transient: {evaluation.transient:g} s leaves nothing of a trial of {evaluation.duration:g} s in "
            f"control steps of {env.control_dt:g} s"
        )


_UNION_BRANCHES = {"float", "int", "Schedule", "Ramp", "tuple", "constrained-float"}


def _one_line(error: ValidationError) -> str:
    errors = error.errors()
    # Of a union pydantic reports every branch: the branch that took the value's shape and refused its content says most.
    first = next((e for e in errors if e["type"] == "value_error"), errors[0])
    names = [str(part) for part in first["loc"] if not _is_branch(str(part))]
    place, message, given = ".".join(names), first["msg"].removeprefix("Value error, "), first["input"]
    if first["type"] == "value_error":
        return f"{place}: {message}" if place and not message.startswith(place) else message
    if first["type"] == "extra_forbidden":
        return f"{place}: no such key"
    if first["type"] == "missing":
        return f"{place}: missing"
    if place == "env.freq" and len(errors) > 1:
        return f"env.freq = {given}: allowed is a number in (0, {MAX_FREQ_HZ:g}] Hz, or a range [low, high] of such numbers"
    if place == "env.episode_steps" and len(errors) > 1:
        return f"{place} = {given}: allowed is a whole number of at least 1, or a range [low, high] of such numbers"
    if len(errors) > 1 and any("Schedule" in str(e["loc"]) for e in errors):
        return f"{place} = {given}: allowed is a number, or a schedule {{start: .., end: .., steps: ..}}"
    return f"{place} = {given!r}: {message[0].lower()}{message[1:]}"


def _is_branch(part: str) -> bool:
    return part in _UNION_BRANCHES or part.startswith(("constrained", "tuple[", "function-"))
