"""The columns of a file as they are in it, before they have a meaning; and the errors that name a place in it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from posture.analysis.trajectory import Array
from posture.config.errors import ConfigError

_UNITS = {
    "deg": ("deg", "degs", "degree", "degrees", "°", "deg/s", "deg_per_s", "degrees/second"),
    "rad": ("rad", "rads", "radian", "radians", "rad/s", "rad_per_s", "radians/second"),
    "m": ("m", "metre", "metres", "meter", "meters", "m/s", "m_per_s"),
    "cm": ("cm", "cm/s", "cm_per_s"),
    "mm": ("mm", "mm/s", "mm_per_s"),
    "s": ("s", "sec", "secs", "second", "seconds"),
    "ms": ("ms", "msec", "millisecond", "milliseconds"),
    "nm": ("nm", "n*m", "n.m", "n·m"),
}
_UNIT = {spelling: unit for unit, spellings in _UNITS.items() for spelling in spellings}
_IN_BRACKETS = re.compile(r"^(.*?)\s*[\[(]\s*([^\[\]()]+?)\s*[\])]$")
_SUFFIX = re.compile(rf"^(.+?)_({'|'.join(sorted(map(re.escape, _UNIT), key=len, reverse=True))})$", re.IGNORECASE)


@dataclass(frozen=True)
class Table:
    """A file's columns.

    names: of all columns, in order. units: of each by its heading, "" where that has none; those of a rate of change are
    the same as of the quantity; of an analogue channel any text. units_of: the unit of all angles and all lengths by the
    header of the file, as far as it says. rate: sampling rate [Hz] where the file has one in place of a column of times,
    else None. rows: of each sample, the number by which a message names it. values: the columns of some places as
    (T, len(places)), nan where a cell is empty; raises ConfigError for a cell that is no number.
    """

    path: Path
    names: Sequence[str]
    units: Sequence[str]
    units_of: Mapping[str, str]
    rate: float | None
    rows: NDArray[np.int64]
    values: Callable[[Sequence[int]], Array]
    row_word: str = "row"

    def place(self, sample: int, column: int) -> str:
        """The cell of a sample, for messages."""
        return f"{self.path}: {self.row_word} {self.rows[sample]}, column {self.names[column]}"


def name_and_unit(heading: str) -> tuple[str, str]:
    """A column's heading without its unit, and the unit: "Hip [deg]", "hip (deg)" and "hip_deg" are ("hip", "deg"); ""
    where it has none."""
    for pattern in (_IN_BRACKETS, _SUFFIX):
        if (match := pattern.match(heading.strip())) and (unit := unit_of(match[2])):
            return match[1].strip(), unit
    return heading.strip(), ""


def unit_of(text: str) -> str:
    """The unit that a text names, "" if it is none that is known."""
    return _UNIT.get(text.strip().strip("[]()").strip().lower(), "")


def refuse(path: Path, why: str) -> ConfigError:
    """The error for a file as a whole."""
    return ConfigError(f"{path}: {why}")
