"""Configuration of `posture.eval`: the trial, changes to the environment, and the model-based controller."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

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
    Strict,
    check_followed,
)
from posture.config.checks import PathText, Tolerance, check_engine

MAX_SAMPLES = 10_000_000
"""Control steps times worlds of one evaluation; recording that many takes some gigabytes of memory."""


class EvaluationConfig(Strict):
    """How a policy is evaluated; units and sources in conf/evaluation/."""

    freq: Annotated[tuple[Freq, ...], Field(min_length=1, max_length=500)]
    duration: Seconds
    transient: Annotated[float, Field(ge=0, le=100_000)]
    tolerance: Tolerance
    still_joint_deg: Annotated[float, Field(gt=0, le=360)]
    figures: bool


class EnvChanges(Strict):
    """Changes to the environment of a run under evaluation; None: as trained."""

    hip_k: HipStiffness | None
    ankle_k: AnkleStiffness | None
    load: Load | None
    amplitude: Amplitude | None
    physics: Physics | None
    ramp: Ramp | None


class LqrConfig(Strict):
    """The model-based controller (posture/theory/lqr.py), and the environment that it acts in before `EnvChanges`."""

    env: EnvConfig
    angle: Annotated[float, Field(ge=0.001, le=10)]
    velocity: Annotated[float, Field(ge=0.001, le=1000)]
    torque: Annotated[float, Field(ge=0.001, le=1000)]
    fade_in: Annotated[float, Field(ge=0.001, le=100_000)]
    foot_margin: Annotated[float, Field(ge=0, le=0.05)]  # heel and toe are 0.19 m apart
    tolerance_margin: Annotated[float, Field(ge=0, le=2)]


class EvalConfig(Strict):
    """Configuration of `posture.eval`."""

    policy: Literal["trained", "lqr"]
    lqr: LqrConfig
    ckpt: PathText
    device: str
    out: PathText | None
    again: bool
    env: EnvChanges
    evaluation: EvaluationConfig

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


def check_trial(evaluation: EvaluationConfig, env: EnvConfig) -> None:
    """Raise ValueError unless a trial has at least two control steps after its transient, fits in memory, and has targets
    slow enough for the control step."""
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
