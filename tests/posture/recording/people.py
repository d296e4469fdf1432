"""Recordings with known signals, as files and as arrays, for the tests of how they are read and measured."""

import functools
import math
from pathlib import Path
from typing import Any

import numpy as np
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf

from posture.cli import jobs
from posture.config.analyse import AnalyseConfig
from posture.config.reading import read
from posture.recording.columns import Recording

RATE = 100.0  # [Hz]
HIP, ANKLE, HEAD = math.radians(6.0), math.radians(3.0), 0.08  # amplitudes [rad], [m]


@functools.cache
def _defaults() -> dict[str, Any]:
    return jobs.compose("analyse", AnalyseConfig).model_dump()


def config(*overrides: str) -> AnalyseConfig:
    """The configuration of posture.analyse with these overrides, without composing it anew."""
    values = OmegaConf.create(_defaults())
    for override in OverridesParser.create().parse_overrides(list(overrides)):
        OmegaConf.update(values, override.key_or_group, override.value())
    return read(AnalyseConfig, OmegaConf.to_container(values))


def times(duration: float = 40.0, rate: float = RATE) -> np.ndarray:
    return np.arange(round(duration * rate)) / rate


def wave(time: np.ndarray, freq: float, phase_deg: float | np.ndarray = 0.0) -> np.ndarray:
    return np.cos(2 * math.pi * freq * time + np.radians(phase_deg))


def recording(freq: float = 0.5, lead_deg: float = 0.0, time: np.ndarray | None = None, **changes: object) -> Recording:
    """The hip leads the ankle by `lead_deg`; in our signs."""
    t = times() if time is None else time
    fields = {
        "path": Path("made.csv"),
        "time": t,
        "hip": HIP * wave(t, freq, lead_deg) - 0.1,
        "ankle": ANKLE * wave(t, freq) - 0.05,
        "head": HEAD * (1 - wave(t, freq)),
        "target": HEAD * (1 - wave(t, freq)),
        "simulated": {},
    }
    return Recording(**{**fields, **changes})


def lines(recording: Recording, names: str, separator: str = ",", factor: float = 1.0) -> list[str]:
    """The rows of a file with time, hip and ankle, the angles times `factor`, below the line `names`."""
    table = np.column_stack([recording.time, factor * recording.hip, factor * recording.ankle])
    return [names, *(separator.join(map(repr, row)) for row in table.tolist())]


def write(path: Path, content: str | bytes | list[str]) -> Path:
    if isinstance(content, list):
        content = "\n".join(content) + "\n"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path
