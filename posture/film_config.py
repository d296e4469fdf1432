"""Configuration of the films; values and units in conf/film.yaml."""

from typing import Annotated, Any

from pydantic import Field, field_validator, model_validator

from envs.config import Freq, Seconds, Strict
from posture.config import EnvChanges, EvaluationConfig, check_engine
from posture.path_text import PathText
from posture.published import Paper


class FilmEnv(EnvChanges):
    """The targets that are filmed, and changes to the environment of the policy."""

    freq: Annotated[tuple[Freq, ...], Field(min_length=1, max_length=4)]

    @field_validator("freq", mode="before")
    @classmethod
    def _one_or_several(cls, value: Any) -> Any:
        return value if isinstance(value, (list, tuple)) else [value]

    @property
    def changes(self) -> EnvChanges:
        """The changes alone, without the ramp, which has a film of its own."""
        return EnvChanges(**(self.model_dump(exclude={"freq"}) | {"ramp": None}))


class PhasesConfig(Strict):
    """Seconds of film for one cycle, slowed down or sped up, and for its last picture."""

    cycle: Annotated[float, Field(ge=0.1, le=60)]
    hold: Annotated[float, Field(ge=0, le=60)]


class FilmConfig(Strict):
    """Everything that `posture.film` is told."""

    ckpt: PathText
    device: str
    out: PathText | None
    fps: Annotated[int, Field(ge=1, le=50)]
    height: Annotated[int, Field(ge=96, le=2160, multiple_of=2)]
    shortest: Seconds
    longest: Seconds
    phases: PhasesConfig
    env: FilmEnv
    evaluation: EvaluationConfig
    paper: Paper

    @model_validator(mode="after")
    def _consistent(self) -> "FilmConfig":
        check_engine(self.env.physics, self.device)
        if 100 % self.fps:
            allowed = ", ".join(str(fps) for fps in range(1, 51) if 100 % fps == 0)
            raise ValueError(f"fps = {self.fps}: a GIF cannot show that rate; allowed are {allowed}")
        seconds = max(1 / min(self.env.freq), self.env.ramp.duration if self.env.ramp else 0.0)
        if seconds > self.longest:
            raise ValueError(f"env: a film of {seconds:g} s; allowed is up to longest = {self.longest:g} s (cycle or ramp)")
        return self
