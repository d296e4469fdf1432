"""Field types and checks shared by several commands."""

import re
import unicodedata
from typing import Annotated

from pydantic import AfterValidator, Field

from envs.config import Freq, Physics, Strict
from posture.config.errors import ConfigError

Share = Annotated[float, Field(gt=0, le=1)]
Small = Annotated[float, Field(ge=1e-9, le=1)]
Tolerance = Annotated[float, Field(gt=0, le=2)]


def _valid_path(text: str) -> str:
    if any(unicodedata.category(character) in ("Cc", "Cs") for character in text):
        raise ValueError(f"{ascii(text)} is not a path: it has control characters or is not valid text")
    if not text.strip():
        raise ValueError("a path must not be empty; null means the default folder")
    if len(text.encode()) > 4000 or any(len(part.encode()) > 255 for part in text.split("/")):
        raise ValueError("a path has at most 4000 bytes, and each of its parts 255")
    return text


PathText = Annotated[str, AfterValidator(_valid_path)]
"""A path that a file system allows, whether or not it exists."""


def _rising(search: tuple[float, float]) -> tuple[float, float]:
    if not search[0] < search[1]:
        raise ValueError(f"a range goes from low to high, got {list(search)}")
    return search


Search = Annotated[tuple[Freq, Freq], AfterValidator(_rising)]
"""Range of frequencies [Hz] in which theory's transition is looked for."""


def listed(value: object) -> object:
    """One name as a list of one."""
    return (value,) if isinstance(value, str) else value


class Output(Strict):
    """The key of every command for the folder of its results."""

    out: PathText


class CommandConfig(Strict):
    """The configuration of a command."""

    def without_effect(self) -> dict[str, str]:
        """The keys that have no effect beside the others, and why. Such a key is refused where the command line sets it."""
        return {}


def check_device(device: str) -> None:
    """Raise ConfigError unless torch can compute on `device` here."""
    if not re.fullmatch(r"cpu|cuda(:[0-9]{1,4})?", device):
        raise ConfigError(f"device: {device!r} is not known; allowed are cpu, cuda, cuda:0, cuda:1, ...")
    if device == "cpu":
        return
    import torch

    if not torch.cuda.is_available():
        raise ConfigError(f"device: '{device}' needs CUDA, but torch {torch.__version__} finds no CUDA device; use cpu")
    if int(device.partition(":")[2] or 0) >= torch.cuda.device_count():
        raise ConfigError(f"device: '{device}' does not exist; this machine has {torch.cuda.device_count()} CUDA devices")


def check_engine(physics: Physics | None, device: str) -> None:
    """Raise ValueError unless the engine, if one is named, can compute on `device`."""
    if physics == "mujoco_c" and device != "cpu":
        raise ValueError(f"device: env.physics=mujoco_c computes only on the cpu, not on '{device}'")
