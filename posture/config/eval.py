"""Configuration of `posture.eval`: the trial, changes to the environment, and the model-based controller."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from envs.config import (
    Amplitude,
    AnkleStiffness,
    EnvConfig,
    Freq,
    HipStiffness,
    Load,
    LoadPlace,
    Mass,
    Person,
    Physics,
    Ramp,
    Seconds,
    Sex,
    Stature,
    Strict,
    check_followed,
)
from posture.config.body import with_body
from posture.config.checks import CommandConfig, PathText, Tolerance, check_engine
from posture.config.errors import ConfigError

MAX_SAMPLES = 10_000_000
"""Control steps times worlds of one evaluation; recording that many takes some gigabytes of memory."""

MAX_STEPS = 4_999_999
"""Control steps of one trial, of which the longest episode has twice as many and one more."""


class EvaluationConfig(Strict):
    """How a policy is evaluated; units and sources in conf/evaluation/."""

    freq: Annotated[tuple[Freq, ...], Field(min_length=1, max_length=500)]
    duration: Seconds
    transient: Annotated[float, Field(ge=0, le=100_000)]
    tolerance: Tolerance
    still_joint_deg: Annotated[float, Field(gt=0, le=360)]
    figures: bool


class SolverChanges(Strict):
    """Changes to `env.solver`; None: as trained."""

    contact_bias: bool | None


class BodyChanges(Strict):
    """Changes to `env.body`; None: as trained."""

    mass: Mass | None
    height: Stature | None
    sex: Sex | None

    def apply_to(self, body: Person | None) -> Person | None:
        """The body with these changes. Raises ConfigError where a part of a person's body is missing."""
        given = _given(self.model_dump())
        values = {} if body is None else body.model_dump()
        if given and (missing := Person.model_fields.keys() - (values | given)):
            raise ConfigError(f"body.{min(missing)}: missing; the policy was trained with the paper's body, which has none")
        return Person(**values | given) if given else body


class EnvChanges(Strict):
    """Changes to the environment of a run under evaluation; None: as trained. ramp "none": constant frequencies."""

    hip_k: HipStiffness | None
    ankle_k: AnkleStiffness | None
    load: Load | None
    load_at: tuple[LoadPlace, LoadPlace] | None
    amplitude: Amplitude | None
    body: BodyChanges
    physics: Physics | None
    ramp: Ramp | Literal["none"] | None
    solver: SolverChanges

    def apply_to(self, env: EnvConfig) -> dict[str, Any]:
        """The values of `env` with these changes, to be checked. Its joints are scaled with its body. Raises ConfigError
        where a part of a person's body is missing."""
        try:
            values = with_body(env.without_ranges(), self.body.apply_to(env.body))
        except ConfigError as error:
            raise ConfigError(f"env.{error}") from None
        changes = self.model_dump(exclude={"body"})
        values["solver"] |= _given(changes.pop("solver"))
        return values | _given(changes) | ({"ramp": None} if self.ramp == "none" else {})

    def ramps(self, env: EnvConfig) -> bool:
        """Whether the frequency of the target changes in `env` with these changes."""
        return (self.ramp or env.ramp or "none") != "none"


def _given(changes: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in changes.items() if value is not None}


def one_body(env: EnvConfig, why: str) -> None:
    """Raise ValueError, which says `why`, if `env` has ranges."""
    for name in env.ranges.given:
        raise ValueError(f"env.ranges.{name}: {why}; allowed is null")


class LqrConfig(Strict):
    """The model-based controller (posture/theory/lqr.py), and the environment that it acts in before `EnvChanges`."""

    env: EnvConfig
    angle: Annotated[float, Field(ge=0.001, le=10)]
    velocity: Annotated[float, Field(ge=0.001, le=1000)]
    torque: Annotated[float, Field(ge=0.001, le=1000)]
    fade_in: Annotated[float, Field(ge=0.001, le=100_000)]
    foot_margin: Annotated[float, Field(ge=0, le=0.05)]  # heel and toe are 0.19 m apart
    tolerance_margin: Annotated[float, Field(ge=0, le=2)]


LQR_ENV = ("num_envs", "freq", "freq_draw", "energy_weight", "episode_steps", "observations", "reward")
"""Keys of the environment that the model-based controller does not depend on in a trial."""


class EvalConfig(CommandConfig):
    """Configuration of `posture.eval`."""

    policy: Literal["trained", "lqr"]
    lqr: LqrConfig
    ckpt: PathText
    device: str
    again: bool
    env: EnvChanges
    evaluation: EvaluationConfig

    def without_effect(self) -> dict[str, str]:
        """See `CommandConfig`."""
        ramp = {"evaluation.freq": "beside env.ramp"} if isinstance(self.env.ramp, Ramp) else {}
        if self.policy == "trained":
            return ramp | {"lqr": "with policy=trained"}
        own = (*LQR_ENV, "termination.foot_motion", "termination.head_tolerance")
        given = [
            *_given(self.env.model_dump(exclude={"body", "solver"})),
            *(f"body.{key}" for key in _given(dict(self.env.body))),
            *(f"solver.{key}" for key in _given(dict(self.env.solver))),
        ]
        changed = {f"lqr.env.{key}": f"beside env.{key}" for key in given}
        return dict.fromkeys(("ckpt", "again", *(f"lqr.env.{key}" for key in own)), "with policy=lqr") | changed

    @model_validator(mode="after")
    def _consistent(self) -> "EvalConfig":
        check_engine(self.env.physics or (self.lqr.env.physics if self.policy == "lqr" else None), self.device)
        if self.policy == "lqr":
            check_trial(self.evaluation, self.lqr.env)
            one_body(self.lqr.env, "policy=lqr plans the motion of one body")
            if self.env.ramps(self.lqr.env):
                raise ValueError("env.ramp: policy=lqr plans its motion for constant frequencies; allowed is none")
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
    if steps < 1:
        raise ValueError(
            f"evaluation.duration = {evaluation.duration:g}: shorter than a control step of {env.control_dt:g} s"
        )
    if (steps - 1) * env.control_dt < evaluation.transient:
        raise ValueError(
            f"evaluation.transient: {evaluation.transient:g} s leaves nothing of a trial of {evaluation.duration:g} s in "
            f"control steps of {env.control_dt:g} s"
        )
    most = min(MAX_SAMPLES // len(evaluation.freq), MAX_STEPS) * env.control_dt
    if evaluation.duration > most:
        raise ValueError(
            f"evaluation.duration = {evaluation.duration:g}: allowed is at most {most:.6g} s at {len(evaluation.freq)} "
            f"frequencies in control steps of {env.control_dt:g} s"
        )
    check_followed(max(evaluation.freq), env.control_dt, "evaluation.freq")
