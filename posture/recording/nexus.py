"""The text export of Vicon Nexus: sections such as Model Outputs and Trajectories, each with a rate and three rows of
headings.

Columns are named as those of a C3D file, LABEL.x, LABEL.y and LABEL.z. Sections of another rate, such as Devices, are left
out, wherever they stand in the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from posture.analysis.trajectory import Array
from posture.recording.table import Table, refuse, unit_of
from posture.recording.text import Rows, cells_of, is_number

HEADINGS = 5
"""Rows above the numbers of a section: title, rate, labels, components, units."""
OF_FRAMES = ("model outputs", "joints", "segments", "trajectories")
"""Titles of sections with one row for each frame of the cameras."""


@dataclass(frozen=True)
class _Section:
    title: str
    rate: float
    names: list[str]
    units: list[str]
    rows: Rows


def is_nexus(lines: Sequence[str]) -> bool:
    """Whether this is such a file: below a title stands a rate, and below a row of labels one that begins with Frame."""
    return (
        len(lines) > HEADINGS
        and is_number(cells_of(lines[1], _separator(lines))[0])
        and cells_of(lines[3], _separator(lines))[0].strip().lower() == "frame"
    )


def read_nexus(path: Path, lines: Sequence[str]) -> Table:
    """The table of all sections that have the rate and the number of rows of the first in `OF_FRAMES`, or without such a
    section, of the one with the lowest rate. Raises ConfigError where no section has rows."""
    separator = _separator(lines)
    starts, sections = [0], []
    starts += [i + 1 for i, line in enumerate(lines) if not line.strip(f" {separator}")]
    for start, end in zip(starts, [*starts[1:], len(lines) + 1], strict=True):
        if is_nexus(lines[start : start + HEADINGS + 1]):
            sections.append(_section(path, lines, start, end - 1, separator))
    sections = [one for one in sections if len(one.rows.numbers)]
    if not sections:
        raise refuse(path, "has headings of Vicon Nexus, but no rows of numbers")
    first = next((one for one in sections if one.title in OF_FRAMES), min(sections, key=lambda one: one.rate))
    alike = [one for one in sections if one.rate == first.rate and len(one.rows.numbers) == len(first.rows.numbers)]
    owner = [(one, place) for one in alike for place in range(len(one.names))]

    def values(places: Sequence[int]) -> Array:
        found = np.empty((len(first.rows.numbers), len(places)))
        for section in alike:
            own = [(column, owner[place][1]) for column, place in enumerate(places) if owner[place][0] is section]
            if own:
                found[:, [column for column, _ in own]] = section.rows.values([place for _, place in own])
        return found

    names = [name for one in alike for name in one.names]
    return Table(path, names, [unit for one in alike for unit in one.units], {}, first.rate, first.rows.numbers + 1, values)


def _section(path: Path, lines: Sequence[str], start: int, end: int, separator: str) -> _Section:
    labels, components, units = (cells_of(lines[start + row], separator) for row in (2, 3, 4))
    names, label = [], ""
    for i, component in enumerate(components):
        label = labels[i].strip() if i < len(labels) and labels[i].strip() else label
        names.append(f"{label}.{component.strip().lower()}" if label else component.strip())
    units = [unit_of(unit) for unit in units[: len(names)]] + (len(names) - len(units)) * [""]
    numbers = np.array([row for row in range(start + HEADINGS, end) if lines[row].strip()], dtype=np.int64)
    return _Section(
        cells_of(lines[start], separator)[0].strip().lower(),
        float(cells_of(lines[start + 1], separator)[0].replace(",", ".")),
        names,
        units,
        Rows(path, lines, numbers, names, separator),
    )


def _separator(lines: Sequence[str]) -> str:
    return next((mark for mark in ("\t", ";") if len(lines) > 3 and mark in lines[3]), ",")
