"""Configuration of the live page; values, units and sources in conf/play.yaml."""

from typing import Annotated

from pydantic import Field, model_validator

from envs.config import Amplitude, AnkleStiffness, Freq, HipStiffness, Load, Mass, Person, Stature, Strict
from posture.config.body import factor
from posture.config.checks import CommandConfig, PathText, Share, Tolerance
from posture.config.eval import LQR_ENV, BodyChanges, EvaluationConfig, LqrConfig

Step = Annotated[float, Field(gt=0, le=1000)]
Force = Annotated[float, Field(gt=0, le=10_000)]

SETTINGS = {
    "freq": "frequency [Hz]",
    "hip_k": "hip stiffness [Nm/rad]",
    "ankle_k": "ankle stiffness [Nm/rad]",
    "load": "load [kg]",
    "amplitude": "amplitude [m]",
    "tolerance": "tolerance [m]",
}
"""Names of the sliders' settings, and their labels."""
STIFFNESS = ("hip_k", "ankle_k")
"""Those of them that are scaled with the body."""
MEASURES = {"mass": "mass [kg]", "height": "height [m]"}
"""Names of the sliders of a person's body, and their labels."""


class Sliders(Strict):
    """[from, to, step] of each setting, in its unit."""

    freq: tuple[Freq, Freq, Step]
    hip_k: tuple[HipStiffness, HipStiffness, Step]
    ankle_k: tuple[AnkleStiffness, AnkleStiffness, Step]
    load: tuple[Load, Load, Step]
    amplitude: tuple[Amplitude, Amplitude, Step]
    tolerance: tuple[Tolerance, Tolerance, Step]
    mass: tuple[Mass, Mass, Step]
    height: tuple[Stature, Stature, Step]

    def for_body(self, name: str, body: Person | None) -> tuple[float, float, float]:
        """From, to and step of a slider with this body. Stiffnesses go as far as the scaled ones, in the same steps."""
        low, high, step = getattr(self, name)
        if name in STIFFNESS and body is not None:
            low, high = (step * round(factor(name, body) * end / step) for end in (low, high))
        return low, high, step

    @model_validator(mode="after")
    def _ordered(self) -> "Sliders":
        for name in (*SETTINGS, *MEASURES):
            low, high, step = getattr(self, name)
            if not low < high or step > high - low:
                raise ValueError(f"sliders.{name}: goes from low to high in steps between, got {[low, high, step]}")
        if not self.tolerance[1] < self.amplitude[0]:
            raise ValueError(
                f"sliders.tolerance: ends at {self.tolerance[1]:g} m, where to stand still is good enough; allowed is less "
                f"than the least amplitude, {self.amplitude[0]:g} m"
            )
        return self


class Push(Strict):
    """A horizontal `force` [N], forward, on the HAT's centre of mass for `duration` [s]; its slider ends at `limit` [N]."""

    force: Force
    limit: Force
    duration: Annotated[float, Field(gt=0, le=5)]

    @model_validator(mode="after")
    def _within(self) -> "Push":
        if self.force > self.limit:
            raise ValueError(f"push.force = {self.force:g}: allowed is up to push.limit = {self.limit:g} N")
        return self


class Recording(Strict):
    """A ramp `freq` from .. to [Hz], with `hold` [s] at either end."""

    freq: tuple[Freq, Freq]
    hold: Annotated[float, Field(ge=0, le=60)]


class PlayConfig(CommandConfig):
    """Configuration of `posture.play`."""

    ckpt: PathText
    port: Annotated[int, Field(ge=0, le=65535)]
    browser: bool
    visitors: Annotated[int, Field(ge=1, le=64)]
    freq: Freq
    hip_k: HipStiffness | None
    ankle_k: AnkleStiffness | None
    load: Load | None
    amplitude: Amplitude | None
    tolerance: Tolerance | None
    body: BodyChanges
    sliders: Sliders
    ramp_rate: Annotated[float, Field(gt=0, le=10)]
    window_steps: Annotated[int, Field(ge=2, le=10_000)]
    push: Push
    slow_motion: Share
    frames_per_s: Annotated[float, Field(ge=1, le=60)]
    plots_per_s: Annotated[float, Field(ge=0.5, le=30)]
    theory_freqs: Annotated[int, Field(ge=2, le=200)]
    record: PathText | None
    recording: Recording
    lqr: LqrConfig
    evaluation: EvaluationConfig

    def without_effect(self) -> dict[str, str]:
        """See `CommandConfig`."""
        unused = EvaluationConfig.model_fields.keys() - {"tolerance", "still_joint_deg"}
        never = [*(f"evaluation.{key}" for key in unused), *(f"lqr.env.{key}" for key in (*LQR_ENV, "physics", "ramp"))]
        if self.record is None:
            return dict.fromkeys(never, "on the page") | dict.fromkeys(("recording", "out"), "without record")
        page = ("port", "browser", "visitors", "freq", "push", "slow_motion", "plots_per_s")
        others = ("lqr",) if self.ckpt != "lqr" else ()
        return dict.fromkeys([*never, *page, *others], "on a recording")

    @model_validator(mode="after")
    def _consistent(self) -> "PlayConfig":
        measures = self.body.model_dump()
        body = None if None in measures.values() else Person(**measures)
        given = {name: getattr(self, name) for name in SETTINGS} | {f"body.{name}": measures[name] for name in MEASURES}
        for name, value in given.items():
            low, high, _ = self.sliders.for_body(name.removeprefix("body."), body)
            if value is not None and not low <= value <= high:
                raise ValueError(f"{name} = {value:g}: allowed is {low:g}..{high:g}, as far as its slider goes")
        low, high, _ = self.sliders.freq
        start, end = self.recording.freq
        if not low <= start < end <= high:
            raise ValueError(f"recording.freq: a ramp goes up within {low:g}..{high:g} Hz, got {[start, end]}")
        if self.record is not None and not self.record.endswith(".html"):
            raise ValueError(f"record = {self.record}: the name must end in .html")
        return self
