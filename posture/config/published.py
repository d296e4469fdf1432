"""The published numbers of conf/paper.yaml, typed and checked.

`amplitude` is half the peak-to-peak value. The lists of a table belong together, entry by entry.
"""

from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import Field, model_validator

from envs.config import Amplitude, AnkleStiffness, Freq, HipStiffness, Load, Seconds, Steps, Strict
from posture.config.errors import ConfigError
from posture.config.reading import read

_POSTURE = Path(__file__).resolve().parents[1]
CONF = next(folder for folder in (_POSTURE / "conf", _POSTURE.parent / "conf") if folder.is_dir())
"""Folder of all configuration files: inside the package where it is installed, beside it in a checkout."""

Mode = Literal["in", "anti"]
Quantity = Annotated[float, Field(gt=0, le=1e9)]
Degrees = Annotated[float, Field(ge=-360, le=360)]
Place = Annotated[float, Field(ge=-10, le=10)]
Correlation = Annotated[float, Field(ge=-1, le=1)]
Gamma = Annotated[float, Field(ge=0, le=10_000)]


class Columns(Strict):
    """A table whose columns, all fields that are tuples, are equally long."""

    @model_validator(mode="after")
    def _equally_long(self) -> "Columns":
        lengths = {name: len(value) for name, value in self if isinstance(value, tuple)}
        if len(set(lengths.values())) > 1 or 0 in lengths.values():
            found = ", ".join(f"{name} has {length}" for name, length in lengths.items())
            raise ValueError(f"columns must be equally long and not empty: {found}")
        return self


class Table1(Strict):
    """The body."""

    mass_kg: Quantity
    height_m: Quantity
    com_m: tuple[Place, Place, Place]
    hip_range_deg: tuple[Degrees, Degrees]
    ankle_range_deg: tuple[Degrees, Degrees]
    torque_limit_nm: Quantity
    target_height_m: Quantity


class Table2(Strict):
    """The learner."""

    environments: Steps
    kl_threshold: Quantity
    mini_batch_size: Steps
    horizon: Steps
    epochs: Steps
    hidden: Annotated[tuple[Steps, ...], Field(min_length=1)]
    training_steps: Steps


class Condition(Strict):
    """Keys of `env` under which a table was measured."""

    hip_k: HipStiffness
    ankle_k: AnkleStiffness
    load: Load
    amplitude: Amplitude
    energy_weight: Gamma


class Table3(Columns):
    """Exp. 1, by frequency [Hz]."""

    condition: Condition
    freq_hz: tuple[Freq, ...]
    target_head_r: tuple[Correlation, ...]
    head_amplitude_m: tuple[Quantity, ...]
    head_speed_mps: tuple[Quantity, ...]
    mode: tuple[Mode, ...]


class Table4(Columns):
    """Exp. 2, by gamma, at one frequency [Hz]."""

    freq_hz: Freq
    gamma: tuple[Gamma, ...]
    target_head_r: tuple[Correlation, ...]
    head_amplitude_m: tuple[Quantity, ...]
    energy_j: tuple[Quantity, ...]
    mode: tuple[Mode, ...]


class Experiment3(Columns):
    """By hip stiffness, at one frequency [Hz]."""

    freq_hz: Freq
    hip_k_nm_per_rad: tuple[HipStiffness, ...]
    mode: tuple[Mode, ...]


class Experiment4a(Strict):
    """A rising frequency."""

    rate_hz_per_s: Annotated[float, Field(gt=0, le=10)]
    duration_s: Seconds
    window_steps: Annotated[int, Field(ge=2, le=1_000_000)]
    transition_hz: Freq


class Experiment4b(Strict):
    """Without load and with the heaviest, at one frequency [Hz]."""

    freq_hz: Freq
    load_kg: tuple[Load, Load]
    mode_at_ends: tuple[Mode, Mode]


class Figure13(Strict):
    """The map's hip stiffnesses and its range of frequencies [Hz]."""

    hip_k_nm_per_rad: Annotated[tuple[HipStiffness, ...], Field(min_length=1)]
    freq_range_hz: tuple[Freq, Freq]


class Published(Strict):
    """All of conf/paper.yaml."""

    table_1: Table1
    table_2: Table2
    table_3: Table3
    table_4: Table4
    experiment_3: Experiment3
    experiment_4a: Experiment4a
    experiment_4b: Experiment4b
    figure_13: Figure13


@cache
def read_published() -> Published:
    """The numbers of conf/paper.yaml."""
    return read(Published, _values(), str(CONF / "paper.yaml"))


def without_published(values: dict[str, Any]) -> dict[str, Any]:
    """A composed configuration without `paper`, which is in it only for other keys to refer to.

    Raises ConfigError if the command line changed a published number: no command reads them from there.
    """
    if values.get("paper", _values()) != _values():
        raise ConfigError("paper: published numbers cannot be changed on the command line; they are in conf/paper.yaml")
    return {key: value for key, value in values.items() if key != "paper"}


@cache
def _values() -> dict[str, Any]:
    values: dict[str, Any] = yaml.safe_load((CONF / "paper.yaml").read_text(encoding="utf-8"))
    return values
