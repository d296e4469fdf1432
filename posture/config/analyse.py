"""Configuration of the analysis of recordings; values and units in conf/analyse.yaml."""

import re
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from envs.config import EnvConfig, Freq, Ramp, Seconds, Strict
from posture.config.checks import CommandConfig, PathText, listed
from posture.config.eval import EvaluationConfig, one_body

UNUSED = (
    "num_envs", "freq", "freq_draw", "ramp", "log_ranges", "energy_weight", "physics", "episode_steps", "friction",
    "observations", "reward", "termination", "solver",
)  # fmt: skip
"""Keys of `env` that the prediction does not depend on."""


def _paths(value: object) -> object:
    """One path as a list of one; none as an empty list, which the command refuses with an example."""
    return () if value is None else listed(value)


def _names(value: object) -> object:
    """One name as a list of one."""
    if value is None:
        return None
    names = listed(value)
    if not isinstance(names, (list, tuple)) or not names or not all(isinstance(name, str) and name for name in names):
        raise ValueError(
            f"{value!s:.100}: allowed is the name of a column, or a list of names, in quotes if they have spaces"
        )
    return tuple(names)


def _expression(text: str) -> str:
    try:
        re.compile(text)
    except (re.error, OverflowError, RecursionError) as error:
        raise ValueError(f"{text!r:.100} is not a regular expression: {error}") from None
    return text


Names = Annotated[tuple[str, ...] | None, BeforeValidator(_names)]
Rate = Annotated[float, Field(ge=0.01, le=1e6)]
Cutoff = Annotated[float, Field(ge=1e-6, le=1e6)]
Factor = Annotated[float, Field(ge=-1e6, le=1e6)]


class Columns(Strict):
    """Names of the columns in the file; None: the known names."""

    time: Names
    hip: Names
    ankle: Names
    head: Names
    target: Names


class Scale(Strict):
    """A factor for each signal, after unit and signs."""

    hip: Factor
    ankle: Factor
    head: Factor
    target: Factor


class AnalyseConfig(CommandConfig):
    """Configuration of `posture.analyse`."""

    recording: Annotated[tuple[PathText, ...], BeforeValidator(_paths), Field(max_length=100_000)]
    subject: Annotated[str, AfterValidator(_expression)] | None
    freq: Freq | None
    ramp: Ramp | Literal["estimate"] | None
    window: Seconds | None
    columns: Columns
    side: Literal["both", "left", "right"]
    rate: Rate | None
    angle_unit: Literal["deg", "rad"] | None
    length_unit: Literal["m", "cm", "mm"] | None
    signs: Literal["opensim", "posture"] | None
    scale: Scale
    max_gap: Annotated[float, Field(ge=0, le=100_000)]
    detrend: bool
    high_pass: Cutoff | None
    low_pass: Cutoff | None
    resample: Rate | None
    own_figures: Annotated[int, Field(ge=0, le=100_000)]
    same_freq: Annotated[float, Field(ge=0, le=10)]
    prediction: bool | None
    prediction_tolerance: Annotated[float, Field(gt=0, le=2)]
    env: EnvConfig
    evaluation: EvaluationConfig

    @property
    def predicts(self) -> bool:
        """Whether theory is drawn beside the recordings: where that is asked for, or `env` has the body of a person."""
        return self.env.body is not None if self.prediction is None else self.prediction

    def without_effect(self) -> dict[str, str]:
        """See `CommandConfig`."""
        unused = dict.fromkeys(("evaluation.freq", "evaluation.duration"), "on recordings")
        unused |= {"window": "without ramp"} if self.ramp is None else {"freq": "beside ramp"}
        if not self.evaluation.figures:
            unused["own_figures"] = "without evaluation.figures"
        if self.predicts:
            return unused | dict.fromkeys((f"env.{key}" for key in UNUSED), "on the prediction")
        used = {"torque_limit", "control_dt"}
        unused["prediction_tolerance"] = "without prediction=true"
        return unused | {f"env.{key}": "without prediction=true" for key in EnvConfig.model_fields if key not in used}

    @model_validator(mode="after")
    def _consistent(self) -> "AnalyseConfig":
        if self.predicts:
            one_body(self.env, "the prediction is of one body")
        if self.high_pass is not None and self.low_pass is not None and self.high_pass >= self.low_pass:
            raise ValueError(f"high_pass: {self.high_pass:g} Hz leaves nothing below the low_pass of {self.low_pass:g} Hz")
        for name, factor in self.scale:
            if factor == 0:
                raise ValueError(f"scale.{name}: 0 leaves nothing of the signal; -1 reverses it")
        return self
