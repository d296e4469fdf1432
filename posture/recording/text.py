"""Text files with one row for each sample: CSV and TSV with a row of names, and OpenSim's .sto and .mot.

Rows are numbered as an editor numbers the lines of the file. An empty cell, nan or NA is a missing value. In files whose
columns are not separated by commas a number may have a decimal comma. A row of units may follow the names.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from operator import methodcaller
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from posture.analysis.trajectory import Array
from posture.config.errors import ConfigError
from posture.recording.table import Table, name_and_unit, refuse, unit_of

STORAGE = (".sto", ".mot")
SEPARATED = (".csv", ".tsv", ".txt")
_MISSING = {"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "."}
_COMMENT = ("#", "%")


def read_text(path: Path, lines: Sequence[str]) -> Table:
    """The table of a text file with these lines. Raises ConfigError where it has no names of columns or no rows."""
    storage = path.suffix.lower() in STORAGE
    first, header = _storage_header(path, lines) if storage else _names_at(path, lines)
    heading = lines[first]
    separator = _separator(path, heading, storage)
    headings = [cell.strip() for cell in cells_of(heading, separator)]
    while headings and not headings[-1]:  # a separator at the end of the line
        headings.pop()
    begin = first + 1
    named = [name_and_unit(name) for name in headings]
    names, units = [name for name, _ in named], [unit for _, unit in named]
    if begin < len(lines) and _is_units(cells_of(lines[begin], separator)):
        below = [unit_of(cell) for cell in cells_of(lines[begin], separator)]
        units = [unit or other for unit, other in zip(units, below + len(units) * [""], strict=False)]
        begin += 1
    filled = np.fromiter(map(len, map(str.strip, lines)), np.int64) > 0
    rows = begin + np.flatnonzero(filled[begin:])
    if not len(rows):
        raise refuse(path, "has names of columns, but no rows of numbers")
    general = {"length": "m"} if storage else {}  # OpenSim computes in SI units
    if (in_degrees := header.get("indegrees")) in ("yes", "no"):
        general["angle"] = "deg" if in_degrees == "yes" else "rad"
    data = Rows(path, lines, rows, headings, separator)
    return Table(path, names, units, general, None, rows + 1, data.values)


class Rows:
    """The rows of a text file, parsed on demand. numbers: of their lines, from 0."""

    def __init__(
        self,
        path: Path,
        lines: Sequence[str],
        numbers: NDArray[np.int64],
        headings: Sequence[str],
        separator: str | None,
    ) -> None:
        self._path, self.numbers, self._headings, self._separator = path, numbers, headings, separator
        self._lines = [lines[row] for row in numbers]

    def values(self, places: Sequence[int]) -> Array:
        """The columns at `places`, (T, len(places)). See `Table`."""
        if self._is_plain():
            try:
                return np.loadtxt(self._lines, delimiter=self._separator, usecols=places, ndmin=2, comments=None)
            except ValueError:  # an empty cell, a decimal comma, or a mistake, which is named below
                pass
        return self._cell_by_cell(places)

    def _is_plain(self) -> bool:
        """Whether every row has as many cells as there are names, without quotes around them. Of rows that are separated by
        blanks only the last is looked at, since a file that was cut short ends in it."""
        if self._separator is None:
            return len(self._lines[-1].split()) == len(self._headings)
        marks = len(self._headings) - 1
        return {*map(methodcaller("count", self._separator), self._lines)} == {marks} and '"' not in "".join(self._lines)

    def _cell_by_cell(self, places: Sequence[int]) -> Array:
        width, decimal_comma = len(self._headings), self._separator != ","
        found = np.empty((len(self._lines), len(places)))
        for i, line in enumerate(self._lines):
            cells = cells_of(line, self._separator)
            if len(cells) != width and any(cell.strip() for cell in cells[width:]) or len(cells) < width:
                raise ConfigError(
                    f"{self._path}: row {self.numbers[i] + 1} has {len(cells)} cells, but the file has {width} columns"
                )
            for j, place in enumerate(places):
                found[i, j] = self._number(cells[place].strip(), i, place, decimal_comma)
        return found

    def _number(self, cell: str, row: int, place: int, decimal_comma: bool) -> float:
        try:
            return float(cell)
        except ValueError:
            if cell.lower() in _MISSING:
                return math.nan
        try:
            return float(cell.replace(",", ".") if decimal_comma else "")
        except ValueError:
            where = f"{self._path}: row {self.numbers[row] + 1}, column {self._headings[place]}"
            raise ConfigError(f"{where}: {cell!r:.50} is not a number") from None


def read_lines(path: Path) -> list[str]:
    """The lines of a file. Raises ConfigError if it cannot be read or is not a text."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise refuse(path, f"cannot be read: {error.strerror}") from None
    wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
    if b"\0" in content[:10_000] and not wide:
        raise refuse(path, "is not a text file")
    try:
        text = content.decode("utf-16", "replace") if wide else content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")  # a degree sign, or an accent in a name, of an older program
    if not text.strip():
        raise refuse(path, "is empty")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _storage_header(path: Path, lines: Sequence[str]) -> tuple[int, dict[str, str]]:
    """The number of the line of labels of a storage file, from 0, and the keys of its header in small letters."""
    header: dict[str, str] = {}
    for number, line in enumerate(lines):
        if line.strip().lower() == "endheader":
            for first in range(number + 1, len(lines)):
                if lines[first].strip():
                    return first, header
            raise refuse(path, "has no labels after endheader")
        key, separator, value = line.partition("=")
        if separator:
            header[key.strip().lower()] = value.strip().lower()
    raise refuse(path, "has no endheader, which ends the header of OpenSim's storage files")


def _names_at(path: Path, lines: Sequence[str]) -> tuple[int, dict[str, str]]:
    """The number of the line with the names of the columns, from 0: the first that is neither empty nor a comment."""
    for number, line in enumerate(lines):
        text = line.strip()
        if not text or text.startswith(_COMMENT) or text.lower().strip('"').startswith("sep="):
            continue
        return number, {}
    raise refuse(path, "has comments only")


def _separator(path: Path, heading: str, storage: bool) -> str | None:
    """What separates columns, by the line of names; None for blanks. Raises ConfigError for a line of numbers or one
    name."""
    separator = next((mark for mark in ("\t", ";", ",") if mark in heading), None)
    if storage:
        separator = None if len(heading.split()) > 1 and not _has_blank_names(heading) else separator
    cells = [cell.strip() for cell in cells_of(heading, separator)]
    if len(cells) < 2:
        raise refuse(
            path, f"has one column only, {heading.strip()!r:.60}; commas, semicolons, tabs or blanks separate columns"
        )
    if all(is_number(cell) for cell in cells if cell):
        raise refuse(path, "begins with numbers; allowed is a file whose first row has the names of the columns")
    return separator


def _has_blank_names(heading: str) -> bool:
    """Whether labels that are separated by tabs have blanks in them."""
    return "\t" in heading and any(" " in cell.strip() for cell in heading.split("\t"))


def cells_of(line: str, separator: str | None) -> list[str]:
    """The cells of a line."""
    if separator is None:
        return line.split()
    return next(csv.reader([line], delimiter=separator)) if '"' in line else line.split(separator)


def _is_units(cells: Sequence[str]) -> bool:
    """Whether a row below the names holds units: at least one, and no numbers."""
    return any(map(unit_of, cells)) and not any(map(is_number, cells))


def is_number(cell: str) -> bool:
    """Whether a cell holds a number, with a decimal point or a comma."""
    try:
        float(cell.strip().replace(",", "."))
    except ValueError:
        return False
    return True
