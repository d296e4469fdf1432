"""The task's configuration: every key typed and range-checked in one place. The values live in conf/env/.

No field has a default: a number that is missing from conf/ is an error, not a guess.
"""

from collections.abc import Sequence
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from envs.task.observations import TERMS, Component

MIN_FREQ_HZ, MAX_FREQ_HZ = 0.001, 10.0
"""Frequencies of the target [Hz]: a period is 1000 s at most."""
STEPS_A_PERIOD = 6
"""With fewer control steps in a period the target is not a motion that can be followed."""
MAX_PHYSICS_STEP_S = 0.01
"""Half the time constant of contact in humanoid.xml [s]: with longer steps the engines soften the ground."""


class ConstraintOverflowError(RuntimeError):
    """The solver dropped contacts or constraints, so its result is not the configured physics; the message is one line."""


class Strict(BaseModel):
    """A frozen record that refuses unknown keys, NaN and infinities."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _no_boolean_for_a_number(cls, value: Any, info: ValidationInfo) -> Any:
        annotation = cls.model_fields[str(info.field_name)].annotation
        if bool not in (annotation, *get_args(annotation)):
            for part in value if isinstance(value, (list, tuple)) else (value,):
                if isinstance(part, bool):
                    raise ValueError(f"{str(part).lower()} is not allowed here")
        return value


# Upper bounds are far beyond useful values, and low enough for physics in single precision: springs are integrated
# explicitly, and stiffer ones would be unstable at the longest physics step without armature and damping.
Freq = Annotated[float, Field(ge=MIN_FREQ_HZ, le=MAX_FREQ_HZ)]
Seconds = Annotated[float, Field(gt=0, le=100_000)]
Steps = Annotated[int, Field(ge=1, le=10_000_000)]
Amplitude = Annotated[float, Field(ge=0.001, le=2)]
HipStiffness = Annotated[float, Field(ge=0, le=2000)]
AnkleStiffness = Annotated[float, Field(ge=0, le=400)]
Load = Annotated[float, Field(ge=0, le=50)]
LoadPlace = Annotated[float, Field(ge=-1, le=1)]
JointDamping = Annotated[float, Field(ge=0, le=1000)]
Friction = Annotated[float, Field(ge=0.01, le=5)]
HeadTolerance = Annotated[float, Field(gt=0, le=2)]
Sharpness = Annotated[float, Field(gt=0, le=10_000)]
Physics = Literal["sagittal", "mujoco", "mujoco_c"]
Mass = Annotated[float, Field(ge=20, le=200)]
Stature = Annotated[float, Field(ge=1.0, le=2.3)]
Sex = Literal["female", "male"]

MAX_FALL_HEIGHT = 1.2
"""Of the paper's body [m], whose torso is at 1.29 m when upright."""
MAX_FALL_SHARE = 0.75
"""The same of a person's stature; the shoulders are at 0.79 of it or above."""


class Person(Strict):
    """A person whose body follows from `mass` [kg] and stature `height` [m], by envs/body/proportions.yaml."""

    mass: Mass
    height: Stature
    sex: Sex


class Ramp(Strict):
    """A target whose frequency changes linearly: `start` [Hz], `rate` [Hz/s], for `duration` [s], then is constant."""

    start: Annotated[float, Field(ge=0, le=MAX_FREQ_HZ)]
    rate: Annotated[float, Field(ge=-MAX_FREQ_HZ, le=MAX_FREQ_HZ)]
    duration: Seconds

    @property
    def end(self) -> float:
        """Frequency at its end [Hz]."""
        return round(self.start + self.rate * self.duration, 9)  # 0.9 - 0.036 x 25 is 0, not a rounding error below it

    @model_validator(mode="after")
    def _stays_in_range(self) -> "Ramp":
        if not 0.0 <= self.end <= MAX_FREQ_HZ:
            raise ValueError(f"the ramp ends at {self.end:g} Hz; allowed is 0..{MAX_FREQ_HZ:g} Hz")
        if max(self.start, self.end) < MIN_FREQ_HZ:
            raise ValueError(f"the ramp stays below {MIN_FREQ_HZ:g} Hz: its target would not move")
        return self


class Schedule(Strict):
    """A weight that changes geometrically from `start` to `end` up to the share `until` of the training, then stays."""

    start: Annotated[float, Field(ge=-10_000, le=10_000)]
    end: Annotated[float, Field(ge=-10_000, le=10_000)]
    until: Annotated[float, Field(gt=0, le=1e9)]

    @model_validator(mode="after")
    def _geometric(self) -> "Schedule":
        if not self.start * self.end > 0.0:
            raise ValueError("start and end must both be positive or both negative (the path between them is geometric)")
        if not 1e-9 <= self.end / self.start <= 1e9:
            raise ValueError("start and end must not lie further apart than a factor of 1e9")
        return self


Weight = Annotated[float, Field(ge=-10_000, le=10_000)] | Schedule


class RewardConfig(Strict):
    """Terms of paper Eq. 6-10 and of the authors' code; see envs/task/rewards.py for the formula that joins them."""

    stay_weight: Weight
    stay_sharpness: Sharpness
    target_weight: Weight
    target_sharpness: Sharpness
    alive: Weight
    tolerance: HeadTolerance
    tolerance_weight: Annotated[float, Field(ge=0, le=1e6)]
    joint_limit_weight: Annotated[float, Field(ge=0, le=10_000)]
    torque_unit: Literal["newton_metre", "normalised"]
    energy_unit: Literal["joule", "normalised", "authors_code"]
    effort_exponent: Annotated[float, Field(ge=0, le=2)] | Schedule
    effort_reference: Annotated[float, Field(gt=0, le=4)]
    effort_scale_max: Annotated[float, Field(ge=1, le=1e6)]
    as_run: bool
    ended: Weight | None
    scale: Annotated[float, Field(ge=1e-6, le=1000)]

    @model_validator(mode="after")
    def _small_exponent(self) -> "RewardConfig":
        exponent = self.effort_exponent
        if isinstance(exponent, Schedule) and not 0 < max(exponent.start, exponent.end) <= 2:
            raise ValueError("effort_exponent: allowed is a schedule between 0 and 2")
        return self


class TerminationConfig(Strict):
    """Limits that end an episode early; None: no limit."""

    fall_height: Annotated[float, Field(gt=0, le=2)]  # `EnvConfig` has the limit that depends on the body
    foot_motion: Annotated[float, Field(gt=0, le=1)] | None
    head_tolerance: HeadTolerance | None


class SolverConfig(Strict):
    """Time step and contact of all engines. `ls_iterations` has no effect in the planar one; `constraint_rows` and
    `contacts` are for SolverMuJoCo only."""

    substeps: Annotated[int, Field(ge=1, le=100)]
    iterations: Annotated[int, Field(ge=1, le=1000)]
    ls_iterations: Annotated[int, Field(ge=1, le=1000)]
    constraint_rows: Annotated[int, Field(ge=1, le=1000)]
    contacts: Annotated[int, Field(ge=1, le=100)]
    contact_bias: bool


StandardDeviation = Annotated[float, Field(ge=0, le=1e6)]


class Noise(Strict):
    """Noise of an observation term: standard deviations of its white and its drifting part, in the unit of each value; one
    number for all values of the term, or one for each."""

    white: StandardDeviation | tuple[StandardDeviation, ...]
    drift: StandardDeviation | tuple[StandardDeviation, ...]

    def of_values(self, part: Literal["white", "drift"], size: int) -> list[float]:
        """The standard deviation of each of the term's `size` values."""
        given: float | tuple[float, ...] = getattr(self, part)
        return list(given) if isinstance(given, tuple) else [given] * size


class SensingConfig(Strict):
    """What reaches the policy of its observations; units in conf/env/head_tracking.yaml."""

    delay: Annotated[float, Field(ge=0, le=2)]
    noise: dict[str, Noise]
    drift_time: Annotated[float, Field(gt=0, le=100_000)]
    history: Annotated[int, Field(ge=0, le=100)]
    history_step: Annotated[int, Field(ge=1, le=100)]
    exact: tuple[str, ...]

    @field_validator("noise", mode="before")
    @classmethod
    def _none_is_empty(cls, value: Any) -> Any:
        return {} if value is None else value

    @property
    def is_exact(self) -> bool:
        """Whether the policy observes the true values, at once, and nothing of the past."""
        return self.delay == 0 and not self.noise and not self.history

    def delay_steps(self, control_dt: float) -> int:
        """The delay in control steps of `control_dt` [s], rounded."""
        return round(self.delay / control_dt)


class ActuationConfig(Strict):
    """From command to torque; units in conf/env/head_tracking.yaml."""

    time_constant: Annotated[float, Field(ge=0, le=10)]
    noise: Annotated[float, Field(ge=0, le=1)]

    @property
    def is_ideal(self) -> bool:
        """Whether the torque is the command."""
        return self.time_constant == 0 and self.noise == 0


class Ranges(Strict):
    """What a training draws for each episode of each world, [low, high]; None: always the value of the key itself."""

    hip_k: tuple[HipStiffness, HipStiffness] | None
    ankle_k: tuple[AnkleStiffness, AnkleStiffness] | None
    load: tuple[Load, Load] | None
    amplitude: tuple[Amplitude, Amplitude] | None
    joint_damping: tuple[JointDamping, JointDamping] | None
    friction: tuple[Friction, Friction] | None
    tolerance: tuple[HeadTolerance, HeadTolerance] | None

    @property
    def given(self) -> dict[str, tuple[float, float]]:
        """The ranges, by name."""
        return {name: bounds for name, bounds in self if bounds is not None}

    @model_validator(mode="after")
    def _ordered(self) -> "Ranges":
        for name, (low, high) in self.given.items():
            if not low <= high:
                raise ValueError(f"{name}: a range goes from low to high, got [{low:g}, {high:g}]")
        return self


RANGE_KEYS = {name: f"reward.{name}" if name == "tolerance" else name for name in Ranges.model_fields}
"""Keys of `EnvConfig` that take a range, by its name in `Ranges`."""


class EnvConfig(Strict):
    """The head-tracking task. Units and sources are in conf/env/head_tracking.yaml.

    A key of `RANGE_KEYS` may be given as [low, high], which is kept in `ranges`. The key itself is then the middle: the
    value of a trial that gives none. body: a person's; None: the paper's.
    """

    num_envs: Annotated[int, Field(ge=1, le=1_000_000)]
    freq: Freq | tuple[Freq, Freq]
    freq_draw: Literal["uniform", "stratified"]
    ramp: Ramp | None
    amplitude: Amplitude
    hip_k: HipStiffness
    ankle_k: AnkleStiffness
    load: Load
    load_at: tuple[LoadPlace, LoadPlace] | None
    ranges: Ranges
    log_ranges: tuple[str, ...]
    energy_weight: Annotated[float, Field(ge=0, le=10_000)] | Schedule

    body: Person | None
    physics: Physics
    control_dt: Annotated[float, Field(ge=1e-5, le=0.1)]
    episode_steps: Steps | tuple[Steps, Steps]
    joint_damping: JointDamping
    joint_armature: Annotated[float, Field(ge=0, le=10)]
    torque_limit: Annotated[float, Field(ge=1, le=1000)]
    friction: Friction
    observations: Annotated[
        dict[
            Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")],
            tuple[str, ...],
        ],
        Field(min_length=1),
    ]

    sensing: SensingConfig
    actuation: ActuationConfig
    reward: RewardConfig
    termination: TerminationConfig
    solver: SolverConfig

    @model_validator(mode="before")
    @classmethod
    def _ranges_of_keys(cls, values: Any) -> Any:
        """Move a range that is given as the value of a key to `ranges`."""
        if not isinstance(values, dict) or not isinstance(values.get("ranges"), (dict, Ranges)):
            return values
        reward = values.get("reward")
        parts = {"": dict(values), "reward": dict(reward) if isinstance(reward, dict) else {}}
        ranges = dict(values["ranges"])
        for name, key in RANGE_KEYS.items():
            part = parts[key.rpartition(".")[0]]
            if isinstance(value := part.get(name), (list, tuple)):
                # An integer may be larger than any float.
                if len(value) != 2 or not all(type(bound) in (int, float) and abs(bound) < 1e9 for bound in value):
                    raise ValueError(f"{key} = {list(value)}: allowed is a number, or a range [low, high]")
                if ranges.get(name) is not None:
                    raise ValueError(f"ranges.{name}: {key} has a range, too; give one of them")
                ranges[name], part[name] = tuple(value), sum(value) / 2
        return parts[""] | {"ranges": ranges} | ({"reward": parts["reward"]} if isinstance(reward, dict) else {})

    @model_validator(mode="after")
    def _consistent(self) -> "EnvConfig":
        if isinstance(self.freq, tuple) and not self.freq[0] <= self.freq[1]:
            raise ValueError(f"freq: a range goes from low to high, got {list(self.freq)}")
        if isinstance(self.episode_steps, tuple) and not self.episode_steps[0] <= self.episode_steps[1]:
            raise ValueError(f"episode_steps: a range goes from low to high, got {list(self.episode_steps)}")
        if self.control_dt / self.solver.substeps > MAX_PHYSICS_STEP_S * (1 + 1e-9):
            raise ValueError(
                f"control_dt: {self.control_dt:g} s in {self.solver.substeps} solver.substeps make physics steps of "
                f"{self.control_dt / self.solver.substeps:g} s; allowed is at most {MAX_PHYSICS_STEP_S:g} s"
            )
        for group, terms in self.observations.items():
            unknown = sorted(set(terms) - TERMS.keys())
            if unknown:
                raise ValueError(
                    f"observations.{group}: unknown {', '.join(unknown)}; allowed are {', '.join(sorted(TERMS))}"
                )
            check_once(terms, f"observations.{group}")
        self._check_sensing()
        highest = MAX_FALL_HEIGHT if self.body is None else MAX_FALL_SHARE * self.body.height
        if self.termination.fall_height > highest:
            raise ValueError(
                f"termination.fall_height: {self.termination.fall_height:g} m is too near to the torso of the upright body; "
                f"allowed is at most {highest:.4g} m"
            )
        check_once(self.log_ranges, "log_ranges")
        for name in self.log_ranges:
            if name not in self.ranges.given:
                raise ValueError(f"log_ranges: {name} has no range; allowed are {', '.join(self.ranges.given) or 'none'}")
            if not self.ranges.given[name][0] > 0:
                raise ValueError(f"log_ranges: {name} has a range from 0, which has no logarithm")
        check_followed(self.highest_freq, self.control_dt, "freq" if self.ramp is None else "ramp")
        tolerances = {"termination.head_tolerance": self.termination.head_tolerance or 0.0}
        if self.reward.tolerance_weight:
            tolerances["reward.tolerance"] = max([self.reward.tolerance, *(self.ranges.tolerance or ())])
        smallest = min([self.amplitude, *(self.ranges.amplitude or ())])
        for key, tolerance in tolerances.items():
            if tolerance > smallest:
                raise ValueError(
                    f"{key}: {tolerance:g} m leaves the head no motion to make; allowed is at most the target's amplitude "
                    f"of {smallest:g} m"
                )
        return self

    def _check_sensing(self) -> None:
        """Raise ValueError where `sensing` names what is not observed."""
        sensing = self.sensing
        check_once(sensing.exact, "sensing.exact")
        for group in sensing.exact:
            if group not in self.observations:
                raise ValueError(
                    f"sensing.exact: no group of observations is called {group}; allowed are {', '.join(self.observations)}"
                )
        sensed = self._sensed
        if not sensed and not sensing.is_exact:
            raise ValueError("sensing.exact: it names all groups with terms, so that nothing is sensed late or with noise")
        if sensing.delay_steps(self.control_dt) >= self.episode_bounds[1]:
            raise ValueError(
                f"sensing.delay: {sensing.delay:g} s is as long as an episode of {self.episode_bounds[1]} control steps of "
                f"{self.control_dt:g} s, so that nothing but its start is sensed"
            )
        for name, noise in sensing.noise.items():
            if name not in TERMS:
                raise ValueError(f"sensing.noise: unknown {name}; allowed are {', '.join(sorted(sensed)) or 'none'}")
            size = len(TERMS[name].components)
            for part, given in noise:
                if isinstance(given, tuple) and len(given) != size:
                    units = ", ".join(f"{value} [{unit}]" for value, unit in TERMS[name].components)
                    raise ValueError(f"sensing.noise.{name}.{part}: {len(given)} numbers for {size} values: {units}")

    @property
    def _sensed(self) -> set[str]:
        """The observation terms that are not exact everywhere."""
        return {term for group, terms in self.observations.items() if group not in self.sensing.exact for term in terms}

    @property
    def is_noisy(self) -> bool:
        """Whether two trials of one policy under the same conditions differ: for the noise of senses or muscles."""
        noises = self.sensing.noise.values()
        return self.actuation.noise > 0 or any(any(one.of_values("white", 1) + one.of_values("drift", 1)) for one in noises)

    @property
    def observed(self) -> dict[str, list[Component]]:
        """Name and unit of each value of each group of observations, those of earlier moments included."""
        result = {}
        for group, terms in self.observations.items():
            newest = [component for term in terms for component in TERMS[term].components]
            moments = 0 if group in self.sensing.exact else self.sensing.history
            result[group] = newest + [
                (f"{name}_{moment * self.sensing.history_step}_steps_before", unit)
                for moment in range(1, moments + 1)
                for name, unit in newest
            ]
        return result

    def without_effect(self, prefix: str = "") -> dict[str, str]:
        """Keys that have no effect, and why; each key begins with `prefix`."""
        unused: dict[str, str] = {}
        if self.ramp is not None:
            unused |= dict.fromkeys((f"{prefix}freq", f"{prefix}freq_draw"), f"beside {prefix}ramp")
        elif not isinstance(self.freq, tuple):
            unused[f"{prefix}freq_draw"] = f"with one {prefix}freq"
        if self.reward.tolerance_weight == 0:
            keys = (f"{prefix}reward.tolerance", f"{prefix}ranges.tolerance")
            unused |= dict.fromkeys(keys, f"with {prefix}reward.tolerance_weight=0")
        if not self.sensing.history:
            unused[f"{prefix}sensing.history_step"] = f"with {prefix}sensing.history=0"
        if not any(noise.drift for noise in self.sensing.noise.values()):
            unused[f"{prefix}sensing.drift_time"] = f"without a drift in {prefix}sensing.noise"
        if self.sensing.delay and not self.sensing.delay_steps(self.control_dt):
            unused[f"{prefix}sensing.delay"] = f"below half a control step of {self.control_dt:g} s"
        silent = (f"{prefix}sensing.noise.{name}" for name in self.sensing.noise if name not in self._sensed)
        unused |= dict.fromkeys(silent, "on what is not observed, or only exactly")
        if self.sensing.is_exact:
            unused[f"{prefix}sensing.exact"] = f"where {prefix}sensing has neither delay nor noise nor history"
        if self.reward.effort_exponent == 0:
            keys = (f"{prefix}reward.effort_reference", f"{prefix}reward.effort_scale_max")
            unused |= dict.fromkeys(keys, f"with {prefix}reward.effort_exponent=0")
        return unused

    def without_ranges(self) -> "EnvConfig":
        """The same of one body: every key has its own value."""
        return self.model_copy(update={"ranges": Ranges(**dict.fromkeys(RANGE_KEYS)), "log_ranges": ()})

    @property
    def head_tolerance(self) -> float | None:
        """How far the head may be from its target [m]: where the reward begins to count it, or else where episodes end."""
        return self.reward.tolerance if self.reward.tolerance_weight else self.termination.head_tolerance

    @property
    def schedules(self) -> dict[str, Schedule]:
        """The weights that change during a training, by their keys."""
        weights = {"energy_weight": self.energy_weight, **{f"reward.{name}": weight for name, weight in self.reward}}
        return {name: weight for name, weight in weights.items() if isinstance(weight, Schedule)}

    @property
    def episode_bounds(self) -> tuple[int, int]:
        """Shortest and longest episode [control steps]."""
        return self.episode_steps if isinstance(self.episode_steps, tuple) else (self.episode_steps, self.episode_steps)

    @property
    def highest_freq(self) -> float:
        """The highest frequency that a target can have [Hz]."""
        if self.ramp is not None:
            return max(self.ramp.start, self.ramp.end)
        return max(self.freq) if isinstance(self.freq, tuple) else self.freq


def check_once(names: Sequence[object], key: str) -> None:
    """Raise ValueError if one of the `names` of `key` appears twice."""
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{key}: {name} appears {names.count(name)} times; give each name once")


def check_followed(freq: float, control_dt: float, key: str) -> None:
    """Raise ValueError, which names `key`, where a period at `freq` [Hz] has too few control steps of `control_dt` [s]."""
    if freq * control_dt * STEPS_A_PERIOD > 1.0 + 1e-9:
        raise ValueError(
            f"{key}: a period at {freq:g} Hz has fewer than {STEPS_A_PERIOD} control steps of {control_dt:g} s; allowed is "
            f"at most {1.0 / (STEPS_A_PERIOD * control_dt):.4g} Hz"
        )


def as_plain(config: BaseModel) -> dict[str, Any]:
    """The configuration as plain numbers, strings, lists and dicts, for writing to YAML."""
    return config.model_dump(mode="json")
