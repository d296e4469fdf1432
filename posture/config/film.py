"""Configuration of the films; values, units and sources in conf/film.yaml."""

import math
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from envs.config import Freq, Ramp, check_once
from posture.config.checks import CommandConfig, PathText, check_engine
from posture.config.eval import EnvChanges

FRAMES_A_CYCLE = 4
"""Fewer frames per cycle would show a different motion (aliasing)."""


class FilmEnv(EnvChanges):
    """Changes to the environment of the filmed policy, and its targets."""

    freq: Annotated[
        tuple[Freq, ...],
        BeforeValidator(lambda value: value if isinstance(value, (list, tuple)) else (value,)),
        Field(min_length=1, max_length=4),
    ]
    ramp: Ramp


Length = Annotated[float, Field(gt=0, le=1000)]


class FilmConfig(CommandConfig):
    """Configuration of `posture.film`."""

    ckpt: PathText
    device: str
    films: Annotated[tuple[Literal["two_modes", "ramp"], ...], Field(min_length=1)]
    formats: Annotated[tuple[Literal["mp4", "gif"], ...], Field(min_length=1)]
    env: FilmEnv
    settle: Annotated[float, Field(ge=0, le=1000)]
    shortest: Length
    longest: Length
    fps: Annotated[float, Field(ge=5, le=50)]
    width: Annotated[int, Field(ge=60, le=1920, multiple_of=2)]

    @property
    def two_modes_duration(self) -> float:
        """Duration of the film `two_modes` [s]: whole cycles of the slowest target, at least `shortest`."""
        slowest = min(self.env.freq)
        return math.ceil(self.shortest * slowest - 1e-9) / slowest

    def without_effect(self) -> dict[str, str]:
        """See `CommandConfig`."""
        keys = {"two_modes": ("env.freq", "settle", "shortest"), "ramp": ("env.ramp",)}
        return {key: f"without {film} in films" for film in keys.keys() - self.films for key in keys[film]}

    @model_validator(mode="after")
    def _consistent(self) -> "FilmConfig":
        check_engine(self.env.physics, self.device)
        check_once(self.films, "films")
        check_once(self.formats, "formats")
        if "two_modes" in self.films:
            for freq in self.env.freq:
                if freq > self.fps / FRAMES_A_CYCLE:
                    raise ValueError(
                        f"env.freq = {freq:g}: fewer than {FRAMES_A_CYCLE} frames to a cycle; allowed is up to "
                        f"{self.fps / FRAMES_A_CYCLE:g} Hz with fps = {self.fps:g}"
                    )
                if 1 / freq > self.longest:
                    raise ValueError(
                        f"env.freq = {freq:g}: a cycle lasts {1 / freq:g} s, longer than a film; allowed is "
                        f"{1 / self.longest:g} Hz or more with longest = {self.longest:g}"
                    )
            if self.two_modes_duration > self.longest:
                raise ValueError(
                    f"shortest = {self.shortest:g}: whole cycles of {min(self.env.freq):g} Hz for that long last "
                    f"{self.two_modes_duration:g} s; allowed is up to longest = {self.longest:g} s"
                )
        if "ramp" in self.films and self.env.ramp.duration > self.longest:
            raise ValueError(
                f"env.ramp.duration = {self.env.ramp.duration:g}: allowed is up to longest = {self.longest:g} s"
            )
        return self
