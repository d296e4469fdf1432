"""The task's configuration: every key typed and range-checked in one place. The values live in conf/env/.

No field has a default: a number that is missing from conf/ is an error, not a guess.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

MAX_FREQ_HZ = 10.0
"""Above this a period has fewer than six control steps, and the target is no longer a motion to follow [Hz]."""


class Strict(BaseModel):
    """A frozen record that refuses unknown keys, NaN and infinities."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_for_a_number(cls, value: Any, info: ValidationInfo) -> Any:
        if isinstance(value, bool) and cls.model_fields[str(info.field_name)].annotation is not bool:
            raise ValueError(f"{str(value).lower()} is not allowed here")
        return value


Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
NonPositive = Annotated[float, Field(le=0)]
Steps = Annotated[int, Field(ge=1)]
Physics = Literal["sagittal", "mujoco", "mujoco_c"]
Freq = Annotated[float, Field(gt=0, le=MAX_FREQ_HZ)]


class Ramp(Strict):
    """A target whose frequency changes linearly: `start` [Hz], `rate` [Hz/s], for `duration` [s], then holds."""

    start: Annotated[float, Field(ge=0, le=MAX_FREQ_HZ)]
    rate: float
    duration: Positive

    @model_validator(mode="after")
    def _stays_in_range(self) -> "Ramp":
        end = self.start + self.rate * self.duration
        if not 0.0 <= end <= MAX_FREQ_HZ:
            raise ValueError(f"the ramp ends at {end:g} Hz; allowed is 0..{MAX_FREQ_HZ:g} Hz")
        return self


class Schedule(Strict):
    """A weight that goes from `start` to `end` geometrically over `steps` control steps of each world, then holds."""

    start: float
    end: float
    steps: Annotated[int, Field(ge=1)]

    @model_validator(mode="after")
    def _geometric(self) -> "Schedule":
        if not self.start * self.end > 0.0:
            raise ValueError("start and end must both be positive or both negative (the path between them is geometric)")
        return self


Weight = float | Schedule


class RewardConfig(Strict):
    """Terms of paper Eq. 6-10 and of the authors' code; see envs/rewards.py for the formula that joins them."""

    stay_weight: Weight
    stay_sharpness: Positive
    target_weight: Weight
    target_sharpness: Positive
    alive: Weight
    joint_limit_weight: NonNegative
    torque_unit: Literal["newton_metre", "normalised"]
    energy_unit: Literal["joule", "normalised", "authors_code"]
    ended: Weight | None
    scale: Positive


class TerminationConfig(Strict):
    """What ends an episode early; null: it does not."""

    fall_height: Positive
    foot_motion: Positive | None
    head_tolerance: Positive | None


class SolverConfig(Strict):
    """Time step and contact of all engines; rows and contacts are of SolverMuJoCo alone."""

    substeps: Annotated[int, Field(ge=1, le=100)]
    iterations: Annotated[int, Field(ge=1, le=1000)]
    ls_iterations: Annotated[int, Field(ge=1, le=1000)]
    constraint_rows: Annotated[int, Field(ge=1, le=1000)]
    contacts: Annotated[int, Field(ge=1, le=100)]


class EnvConfig(Strict):
    """The head-tracking task. Units and sources stand beside the values in conf/env/head_tracking.yaml."""

    num_envs: Annotated[int, Field(ge=1, le=1_000_000)]
    freq: Freq | tuple[Freq, Freq]
    freq_draw: Literal["uniform", "stratified"]
    ramp: Ramp | None
    amplitude: Positive
    hip_k: NonNegative
    ankle_k: NonNegative
    load: NonNegative
    energy_weight: Annotated[float, Field(ge=0)] | Schedule

    physics: Physics
    control_dt: Annotated[float, Field(gt=0, le=0.1)]
    episode_steps: Steps | tuple[Steps, Steps]
    joint_damping: NonNegative
    joint_armature: NonNegative
    torque_limit: Positive
    friction: Positive
    observations: Annotated[dict[str, Annotated[tuple[str, ...], Field(min_length=1)]], Field(min_length=1)]

    reward: RewardConfig
    termination: TerminationConfig
    solver: SolverConfig

    @model_validator(mode="after")
    def _consistent(self) -> "EnvConfig":
        if isinstance(self.freq, tuple) and not self.freq[0] <= self.freq[1]:
            raise ValueError(f"freq: a range goes from low to high, got {list(self.freq)}")
        if isinstance(self.episode_steps, tuple) and not self.episode_steps[0] <= self.episode_steps[1]:
            raise ValueError(f"episode_steps: a range goes from low to high, got {list(self.episode_steps)}")
        tolerance = self.termination.head_tolerance
        if tolerance is not None and tolerance > 2 * self.amplitude:
            raise ValueError(
                f"termination.head_tolerance: {tolerance:g} m is beyond the target's whole path of {2 * self.amplitude:g} m"
            )
        return self


def as_plain(config: BaseModel) -> dict[str, Any]:
    """The configuration as plain numbers, strings, lists and dicts, for writing to YAML."""
    return config.model_dump(mode="json")
