"""Configuration of the map; values, units and sources in conf/map.yaml."""

from typing import Annotated

from pydantic import Field, model_validator

from envs.config import Amplitude, AnkleStiffness, Freq, HipStiffness, Load, Strict, check_once
from posture.config.checks import CommandConfig, PathText, Search
from posture.config.eval import EvaluationConfig

MAX_TRIALS = 100_000
"""Trials of one map; each takes some hundredths of a second, and its theory as long."""


class Frequencies(Strict):
    """Evenly spaced frequencies [Hz]."""

    low: Freq
    high: Freq
    step: Annotated[float, Field(gt=0, le=10)]

    @property
    def values(self) -> list[float]:
        """From low to high."""
        return [round(self.low + i * self.step, 9) for i in range(int((self.high - self.low) / self.step + 1e-9) + 1)]

    @model_validator(mode="after")
    def _ordered(self) -> "Frequencies":
        if not self.low <= self.high:
            raise ValueError(f"a range goes from low to high, got {[self.low, self.high]}")
        if (self.high - self.low) / self.step > 1000:
            raise ValueError(f"step: {self.step:g} makes more than 1000 frequencies; take a larger one")
        return self


class Varied(Strict):
    """Values of each parameter that has a map."""

    hip_k: tuple[HipStiffness, ...]
    ankle_k: tuple[AnkleStiffness, ...]
    load: tuple[Load, ...]
    amplitude: tuple[Amplitude, ...]


class MapConfig(CommandConfig):
    """Configuration of `posture.map`."""

    ckpt: PathText | Annotated[tuple[PathText, ...], Field(min_length=1)]
    device: str
    again: bool
    search: Search
    freq: Frequencies
    varied: Varied
    random: Annotated[int, Field(ge=0, le=MAX_TRIALS)]
    seed: Annotated[int, Field(ge=0, lt=2**31)]
    evaluation: EvaluationConfig

    def without_effect(self) -> dict[str, str]:
        """See `CommandConfig`."""
        unused = dict.fromkeys(("evaluation.freq", "evaluation.figures"), "on a map")
        return unused | ({} if self.random else {"seed": "with random=0"})

    @model_validator(mode="after")
    def _consistent(self) -> "MapConfig":
        for name, values in self.varied:
            check_once(values, f"varied.{name}")
        if any(amplitude <= self.evaluation.tolerance for amplitude in self.varied.amplitude):
            raise ValueError(
                f"varied.amplitude: {min(self.varied.amplitude):g} m leaves the head no motion to make; allowed is more "
                f"than the evaluation.tolerance of {self.evaluation.tolerance:g} m"
            )
        count = sum(len(values) for _, values in self.varied) * len(self.freq.values) + self.random
        if not 0 < count <= MAX_TRIALS:
            raise ValueError(f"varied, freq and random make {count:,} trials; allowed are 1 to {MAX_TRIALS:,}")
        return self
