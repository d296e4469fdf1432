"""C3D files of motion capture systems, read by ezc3d: of each point the columns LABEL.x, LABEL.y and LABEL.z, and one for
each analogue channel, its mean about the time of each frame. Samples are named by the numbers of their frames, from 1."""

from __future__ import annotations

import importlib.util
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from posture.analysis.trajectory import Array
from posture.config.errors import ConfigError
from posture.recording.table import Table, refuse, unit_of

SUFFIX = ".c3d"
_AXES = ("x", "y", "z")
_MOST_FRAMES = 65535
"""As the number of the last frame in the header: that or more."""


def check_installed() -> None:
    """Raise ConfigError if ezc3d is missing."""
    if importlib.util.find_spec("ezc3d") is None:
        raise ConfigError("c3d files need ezc3d, which is not installed: python -m pip install ezc3d")


def read_c3d(path: Path) -> Table:
    """The table of a C3D file. Raises ConfigError where it cannot be read or has no frames."""
    check_installed()
    import ezc3d

    try:
        with path.open("rb") as file:  # ezc3d's own message does not say why
            header = file.read(10)
    except OSError as error:
        raise refuse(path, f"cannot be read: {error.strerror}") from None
    try:
        content = ezc3d.c3d(str(path))
        parameters, points = content["parameters"], np.asarray(content["data"]["points"], dtype=np.float64)
        analogs = np.asarray(content["data"]["analogs"], dtype=np.float64)
        labels, channels = _texts(parameters["POINT"], "LABELS"), _texts(parameters.get("ANALOG", {}), "LABELS")
        rate = float(parameters["POINT"]["RATE"]["value"][0])
        missing = np.asarray(content["data"]["meta_points"]["residuals"])[0] < 0  # (points, frames)
    except Exception as error:  # ezc3d raises what its parser meets
        text = " ".join(str(error).split())
        if "MIPS" in text:
            why = "is in the MIPS (SGI) format of C3D, which ezc3d cannot read; convert it to the Intel format"
            raise refuse(path, why) from None
        raise refuse(path, f"is not a C3D file that ezc3d can read ({type(error).__name__}: {text:.100})") from None
    frames = points.shape[2]
    if not frames:
        raise refuse(path, "has no frames")
    if not labels:
        raise refuse(path, "has no points; at least one with a name in POINT:LABELS is needed")
    if not rate > 0:
        raise refuse(path, f"has a POINT:RATE of {rate:g} Hz; allowed is a sampling rate above 0")
    first, last = struct.unpack("<HH", header[6:10])  # little-endian: ezc3d reads no other files
    if first <= last < _MOST_FRAMES and frames < last - first + 1:
        raise refuse(path, f"was cut short: it has {frames} of its {last - first + 1} frames")
    length, angle = (unit_of("".join(_texts(parameters["POINT"], name)[:1])) for name in ("UNITS", "ANGLE_UNITS"))
    labels, channels = labels[: points.shape[1]], channels[: analogs.shape[1]]
    # POINT:UNITS says nothing of a channel, whose unit is mostly volts.
    texts = [*_texts(parameters.get("ANALOG", {}), "UNITS"), *len(channels) * [""]][: len(channels)]
    of_channels = [unit_of(text) or text or "an unknown unit" for text in texts]

    def column(place: int) -> Array:
        point, axis = divmod(place, len(_AXES))
        if point < len(labels):
            return np.where(missing[point], np.nan, points[axis, point])
        return at_frames(analogs[0, place - len(_AXES) * len(labels)], frames)

    def values(places: Sequence[int]) -> Array:
        return np.stack([column(place) for place in places], axis=1)

    names = [f"{label}.{axis}" for label in labels for axis in _AXES] + channels
    return Table(
        path,
        names,
        len(_AXES) * len(labels) * [""] + of_channels,
        {kind: unit for kind, unit in (("length", length), ("angle", angle)) if unit},
        rate,
        np.arange(1, frames + 1),
        values,
        row_word="frame",
    )


def at_frames(channel: Array, frames: int) -> Array:
    """An analogue channel (frames x k,) at each frame, (frames,): its mean over the duration of a frame about the first of
    the frame's k samples, which is as old as its points; beyond its ends it is mirrored at their values."""
    k = len(channel) // frames
    weights = np.ones(2 * (k // 2) + 1)
    weights[[0, -1]] = 1.0 if k % 2 else 0.5
    return np.convolve(np.pad(channel, k // 2, "reflect", reflect_type="odd"), weights / k, "valid")[::k]


def _texts(group: Any, name: str) -> list[str]:
    """A parameter that is a list of texts, with its continuations LABELS2, LABELS3, ..; [] where it is missing."""
    found: list[str] = []
    for key in (name, *(f"{name}{number}" for number in range(2, 100))):
        if key not in group:
            break
        found += [str(text).strip() for text in group[key]["value"]]
    return found
