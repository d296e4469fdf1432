"""Which reader a file needs."""

from __future__ import annotations

from pathlib import Path

from posture.recording.c3d import SUFFIX, read_c3d
from posture.recording.nexus import is_nexus, read_nexus
from posture.recording.table import Table
from posture.recording.text import SEPARATED, STORAGE, read_lines, read_text

SUFFIXES = (*SEPARATED, *STORAGE, SUFFIX)
"""Files that are recordings, by the end of their names."""


def read_table(path: Path) -> Table:
    """The columns of a file, by the end of its name, or by what it begins with. Raises ConfigError where it cannot be
    read."""
    if path.suffix.lower() == SUFFIX:
        return read_c3d(path)
    lines = read_lines(path)
    if path.suffix.lower() in SEPARATED and is_nexus(lines):
        return read_nexus(path, lines)
    return read_text(path, lines)
