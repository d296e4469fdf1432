"""Configuration of the reproduction; values in conf/reproduce.yaml."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from envs.config import Freq, Strict
from posture.config.fields import PathText

Stage = Literal["train", "evaluate", "report", "ship"]


class ReproduceConfig(Strict):
    """Configuration of `posture.reproduce`."""

    seeds: Annotated[int, Field(ge=1, le=1000)]
    stages: Annotated[tuple[Stage, ...], Field(min_length=1)]
    launcher: Literal["joblib", "basic", "submitit_local", "submitit_slurm"]
    parallel: Annotated[int, Field(ge=1, le=1024)]
    out: PathText
    search: tuple[Freq, Freq]
    overrides: tuple[str, ...]

    @model_validator(mode="after")
    def _consistent(self) -> "ReproduceConfig":
        if not self.search[0] < self.search[1]:
            raise ValueError(f"search: a range goes from low to high, got {list(self.search)}")
        return self
