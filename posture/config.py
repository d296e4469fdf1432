"""Configuration of learner and analyst, typed and range-checked, and the one way from plain mappings to it.

Bad input becomes a `ConfigError` whose message is one line: what was wrong and what is allowed.
"""

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeVar

import torch
from pydantic import AfterValidator, BaseModel, Field, ValidationError, model_validator

from envs.config import (
    Amplitude,
    AnkleStiffness,
    EnvConfig,
    Freq,
    HipStiffness,
    Load,
    Physics,
    Ramp,
    Seconds,
    Steps,
    Strict,
    check_followed,
)
from envs.observations import TERMS
from posture.config_error import ConfigError as ConfigError
from posture.config_error import one_line
from posture.path_text import PathText
from posture.published import Paper

Share = Annotated[float, Field(gt=0, le=1)]
Small = Annotated[float, Field(ge=1e-9, le=1)]
Tolerance = Annotated[float, Field(gt=0, le=2)]
MAX_SAMPLES = 10_000_000
"""Control steps times worlds of one evaluation: what is recorded of so many takes some gigabytes of memory."""


def _known_terms(env: EnvConfig) -> EnvConfig:
    for group, terms in env.observations.items():
        unknown = sorted(set(terms) - set(TERMS))
        if unknown:
            raise ValueError(f"observations.{group}: unknown {', '.join(unknown)}; allowed are {', '.join(sorted(TERMS))}")
    return env


Environment = Annotated[EnvConfig, AfterValidator(_known_terms)]
"""The task's configuration, with terms of observation that there are."""


class ObsGroups(Strict):
    """Which of the environment's observation groups each network sees."""

    actor: Annotated[tuple[str, ...], Field(min_length=1)]
    critic: Annotated[tuple[str, ...], Field(min_length=1)]


class AlgorithmConfig(Strict):
    """rsl-rl's PPO, its keys unrenamed."""

    class_name: Literal["PPO"]
    num_learning_epochs: Annotated[int, Field(ge=1, le=1000)]
    num_mini_batches: Annotated[int, Field(ge=1, le=1_000_000)]
    clip_param: Small
    gamma: Share
    lam: Annotated[float, Field(ge=0, le=1)]
    value_loss_coef: Annotated[float, Field(ge=0, le=1000)]
    entropy_coef: Annotated[float, Field(ge=0, le=1000)]
    learning_rate: Small
    max_grad_norm: Annotated[float, Field(gt=0, le=1e6)]
    optimizer: Literal["adam", "adamw", "sgd", "rmsprop"]
    use_clipped_value_loss: bool
    schedule: Literal["adaptive", "fixed"]
    desired_kl: Small
    normalize_advantage_per_mini_batch: bool


class DistributionConfig(Strict):
    """rsl-rl's Gaussian action distribution with a standard deviation that does not depend on the state."""

    class_name: Literal["GaussianDistribution"]
    init_std: Annotated[float, Field(ge=1e-6, le=1e6)]
    std_range: tuple[Annotated[float, Field(ge=1e-6, le=1e6)], Annotated[float, Field(ge=1e-6, le=1e6)]]
    std_type: Literal["log", "scalar"]

    @model_validator(mode="after")
    def _ordered(self) -> "DistributionConfig":
        if not self.std_range[0] <= self.init_std <= self.std_range[1]:
            raise ValueError(f"init_std = {self.init_std:g} must lie within std_range {list(self.std_range)}")
        return self


class CriticConfig(Strict):
    """rsl-rl's MLPModel."""

    class_name: Literal["MLPModel"]
    hidden_dims: Annotated[tuple[Annotated[int, Field(ge=1, le=4096)], ...], Field(min_length=1, max_length=16)]
    activation: Literal["elu", "selu", "relu", "crelu", "lrelu", "tanh", "sigmoid", "softplus", "gelu", "swish", "mish"]
    obs_normalization: bool


class ActorConfig(CriticConfig):
    """rsl-rl's MLPModel with an action distribution."""

    distribution_cfg: DistributionConfig


class AgentConfig(Strict):
    """What rsl-rl's OnPolicyRunner is given."""

    num_steps_per_env: Annotated[int, Field(ge=1, le=100_000)]
    save_interval: Steps
    obs_groups: ObsGroups
    algorithm: AlgorithmConfig
    actor: ActorConfig
    critic: CriticConfig


class EvaluationConfig(Strict):
    """How a policy is evaluated; units and sources in conf/evaluation/."""

    freq: Annotated[tuple[Freq, ...], Field(min_length=1, max_length=500)]
    duration: Seconds
    transient: Annotated[float, Field(ge=0, le=100_000)]
    tolerance: Tolerance
    still_joint_deg: Annotated[float, Field(gt=0, le=360)]
    figures: bool


class TrainConfig(Strict):
    """Everything that `posture.train` is told, and what a run folder keeps as config.yaml."""

    env: Environment
    agent: AgentConfig
    evaluation: EvaluationConfig
    seed: Annotated[int, Field(ge=0, lt=2**31)]
    device: str
    processes: Annotated[int, Field(ge=1, le=256)]
    threads: Annotated[int, Field(ge=1, le=1024)]
    max_iterations: Steps
    resume: PathText | None
    evaluate: bool
    paper: Paper

    @model_validator(mode="after")
    def _consistent(self) -> "TrainConfig":
        check_trial(self.evaluation, self.env)
        check_engine(self.env.physics, self.device)
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

    hip_k: HipStiffness | None
    ankle_k: AnkleStiffness | None
    load: Load | None
    amplitude: Amplitude | None
    physics: Physics | None
    ramp: Ramp | None


class LqrConfig(Strict):
    """The model-based controller (posture/lqr.py), and the environment that it acts in before `EnvChanges`."""

    env: Environment
    angle: Annotated[float, Field(ge=0.001, le=10)]
    velocity: Annotated[float, Field(ge=0.001, le=1000)]
    torque: Annotated[float, Field(ge=0.001, le=1000)]
    fade_in: Annotated[float, Field(ge=0.001, le=100_000)]
    foot_margin: Annotated[float, Field(ge=0, le=0.05)]  # heel and toe are 0.19 m apart
    tolerance_margin: Annotated[float, Field(ge=0, le=2)]


class EvalConfig(Strict):
    """Everything that `posture.eval` is told."""

    policy: Literal["trained", "lqr"]
    lqr: LqrConfig
    ckpt: PathText
    device: str
    out: PathText | None
    again: bool
    env: EnvChanges
    evaluation: EvaluationConfig
    paper: Paper

    @model_validator(mode="after")
    def _consistent(self) -> "EvalConfig":
        check_engine(self.env.physics or (self.lqr.env.physics if self.policy == "lqr" else None), self.device)
        if self.policy == "lqr":
            check_trial(self.evaluation, self.lqr.env)
            if self.lqr.tolerance_margin >= self.evaluation.tolerance:
                raise ValueError(
                    f"lqr.tolerance_margin: {self.lqr.tolerance_margin:g} m leaves nothing of the evaluation.tolerance of "
                    f"{self.evaluation.tolerance:g} m"
                )
        return self


Config = TypeVar("Config", bound=BaseModel)


def read(kind: type[Config], values: Mapping[str, Any], where: str = "") -> Config:
    """`values` as a checked `kind`. Raises ConfigError with one line; `where` says which file is meant, if any."""
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        raise ConfigError((f"{where}: " if where else "") + one_line(error)) from None


def check_device(device: str) -> None:
    """Raise ConfigError unless torch can compute on `device` here."""
    if not re.fullmatch(r"cpu|cuda(:[0-9]{1,4})?", device):
        raise ConfigError(f"device: {device!r} is not known; allowed are cpu, cuda, cuda:0, cuda:1, ...")
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
    """Raise ValueError unless a trial lasts for two control steps or more after its transient, can be kept in memory, and
    its targets are slow enough for the control step."""
    steps = round(evaluation.duration / env.control_dt)
    if (steps - 1) * env.control_dt < evaluation.transient:
        raise ValueError(
            f"evaluation.transient: {evaluation.transient:g} s leaves nothing of a trial of {evaluation.duration:g} s in "
            f"control steps of {env.control_dt:g} s"
        )
    if steps * len(evaluation.freq) > MAX_SAMPLES:
        raise ValueError(
            f"evaluation.duration: {evaluation.duration:g} s in control steps of {env.control_dt:g} s at "
            f"{len(evaluation.freq)} frequencies make {steps * len(evaluation.freq):,} samples; allowed are {MAX_SAMPLES:,}"
        )
    check_followed(max(evaluation.freq), env.control_dt, "evaluation.freq")
