"""Configuration of `posture.dynamics`; values, units and sources in conf/dynamics.yaml."""

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, field_validator, model_validator

from envs.config import Freq, Seconds, Strict, check_followed, check_once
from posture.config.checks import CommandConfig, PathText, listed
from posture.config.eval import MAX_SAMPLES, MAX_STEPS, EvaluationConfig
from posture.config.map import Frequencies

Experiment = Literal["staircase", "ramp", "perturbation", "fluctuation"]
FEWEST_CYCLES = 3
"""Without which a standard deviation over cycles says nothing."""
FEWEST_STEPS = 8
"""Control steps after a push without which a recovery cannot be seen."""
Name = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]


class StaircaseConfig(Strict):
    """Steps of the frequency, up and down again."""

    cycles: Annotated[int, Field(ge=2, le=1000)]
    skip: Annotated[int, Field(ge=0, le=1000)]
    courses: Annotated[dict[Name, Annotated[tuple[Freq, ...], Field(min_length=2, max_length=200)]], Field(min_length=1)]

    @field_validator("courses")
    @classmethod
    def _rising(cls, courses: dict[str, tuple[float, ...]]) -> dict[str, tuple[float, ...]]:
        for name, freq in courses.items():
            if list(freq) != sorted(set(freq)):
                raise ValueError(f"{name}: frequencies must rise, got {list(freq)}")
        return courses

    @model_validator(mode="after")
    def _counts(self) -> "StaircaseConfig":
        if self.skip >= self.cycles:
            raise ValueError(f"skip: {self.skip} leaves nothing of {self.cycles} cycles")
        return self


class SlowRamp(Strict):
    """A steady rise of the frequency, and a fall back."""

    start: Freq
    end: Freq
    rate: Annotated[float, Field(gt=0, le=10)]
    window: Annotated[float, Field(ge=1, le=100)]

    @model_validator(mode="after")
    def _rises(self) -> "SlowRamp":
        if not self.start < self.end:
            raise ValueError(f"a ramp rises from start to end, got {self.start:g} and {self.end:g}")
        return self


class PerturbationConfig(Strict):
    """Pushes on the trunk."""

    freq: Frequencies
    force: Annotated[float, Field(ge=-1000, le=1000)]
    time: Annotated[float, Field(gt=0, le=10)]
    first: Seconds
    every: Seconds
    pushes: Annotated[int, Field(ge=1, le=1000)]

    @property
    def duration(self) -> float:
        """Of the whole trial [s]."""
        return self.first + self.pushes * self.every

    @model_validator(mode="after")
    def _recovers(self) -> "PerturbationConfig":
        if self.force == 0:
            raise ValueError("force: 0 N is no push")
        if self.time >= self.every / 2:
            raise ValueError(f"time: {self.time:g} s leaves no time to recover in {self.every:g} s")
        return self


class FluctuationConfig(Strict):
    """Trials at constant frequencies."""

    freq: Frequencies


class DynamicsConfig(CommandConfig):
    """Configuration of `posture.dynamics`."""

    ckpt: PathText | Annotated[tuple[PathText, ...], Field(min_length=1)]
    device: str
    again: bool
    what: Annotated[tuple[Experiment, ...], BeforeValidator(listed), Field(min_length=1)]
    evaluation: EvaluationConfig
    repeats: Annotated[int, Field(ge=1, le=1000)]
    near: Annotated[float, Field(gt=0, le=1)]
    staircase: StaircaseConfig
    ramp: SlowRamp
    perturbation: PerturbationConfig
    fluctuation: FluctuationConfig

    def without_effect(self) -> dict[str, str]:
        """See `CommandConfig`."""
        experiments = ("staircase", "ramp", "perturbation", "fluctuation")
        unused = dict.fromkeys(("evaluation.freq", "evaluation.figures"), "on these trials")
        return unused | {name: f"without {name} in what" for name in experiments if name not in self.what}

    @model_validator(mode="after")
    def _consistent(self) -> "DynamicsConfig":
        check_once(self.what, "what")
        duration, transient, lowest = self.evaluation.duration, self.evaluation.transient, self.fluctuation.freq.low
        if "fluctuation" in self.what and (duration - transient) * lowest < FEWEST_CYCLES:
            raise ValueError(
                f"evaluation.duration: {duration:g} s with a transient of {transient:g} s has fewer than {FEWEST_CYCLES} "
                f"cycles at {lowest:g} Hz"
            )
        return self


def check_trials(config: DynamicsConfig, control_dt: float) -> None:
    """Raise ValueError unless all trials suit a policy with control steps of `control_dt` [s]: each has a step or more, fits
    in memory, and has targets slow enough; a push lasts a step or more, and the recovery from it several."""
    push, ramp, steady = config.perturbation, config.ramp, config.fluctuation.freq.values
    way = (ramp.end - ramp.start) / ramp.rate
    # Of each kind of trial: key, highest frequency [Hz], duration [s], and how many there are at once.
    kinds = {
        "staircase": [
            (f"staircase.courses.{name}", freq[-1], 2 * config.staircase.cycles * sum(1 / one for one in freq), 1)
            for name, freq in config.staircase.courses.items()
        ],
        "ramp": [("ramp", ramp.end, 2 * way, 1)],
        "perturbation": [("perturbation", push.freq.values[-1], push.duration, len(push.freq.values))],
        "fluctuation": [("fluctuation", steady[-1], config.evaluation.duration, len(steady))],
    }
    for key, highest, duration, count in (trial for kind in config.what for trial in kinds[kind]):
        check_followed(highest, control_dt, key)
        most = min(MAX_SAMPLES // (count * config.repeats), MAX_STEPS) * control_dt
        if duration > most:
            raise ValueError(
                f"{key}: {duration:.6g} s; allowed is at most {most:.6g} s for {count * config.repeats} trials in control "
                f"steps of {control_dt:g} s"
            )
    if "ramp" in config.what and way < (window := 2 * ramp.window / (ramp.start + ramp.end)):
        raise ValueError(f"ramp.window: {window:.4g} s, but each way of the ramp takes {way:.4g} s")
    if "perturbation" in config.what:
        if round(push.time / control_dt) < 1:
            raise ValueError(f"perturbation.time: {push.time:g} s is less than a control step of {control_dt:g} s")
        if round((push.every - push.time) / control_dt) <= FEWEST_STEPS:
            raise ValueError(
                f"perturbation.every: {push.every:g} s leaves no time to recover in control steps of {control_dt:g} s"
            )
