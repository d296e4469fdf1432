"""Which files are recordings: names, folders and patterns."""

from __future__ import annotations

import glob
from collections.abc import Sequence
from pathlib import Path

from posture.config.errors import ConfigError
from posture.recording.c3d import SUFFIX, check_installed
from posture.recording.formats import SUFFIXES


def find_recordings(names: Sequence[str]) -> list[Path]:
    """The files that `names` select, each once: a file, all recordings of a folder, or those that fit a pattern such as
    data/S*.csv. Raises ConfigError where a name selects none, or a file has another ending than those of `SUFFIXES`."""
    if not names:
        raise ConfigError("recording: name a file, a folder or a pattern, as in recording=trial.csv")
    found: dict[Path, None] = {}
    for name in names:
        path = Path(name)
        try:
            if path.is_dir():
                own = sorted(one for one in path.iterdir() if one.suffix.lower() in SUFFIXES and one.is_file())
                if not own:
                    raise ConfigError(f"{name}: no recording in this folder; allowed are {', '.join(SUFFIXES)}")
            elif path.exists() or not glob.has_magic(name):
                own = [path]
            else:
                own = sorted(Path(one) for one in glob.glob(name, recursive=True) if Path(one).is_file())
                if not own:
                    raise ConfigError(f"recording: no file fits {name}")
        except OSError as error:
            raise ConfigError(f"{name}: cannot be read: {error.strerror}") from None
        found |= dict.fromkeys(own)
    for path in found:
        if path.suffix.lower() not in SUFFIXES:
            raise ConfigError(f"{path}: not a recording by its name; allowed are {', '.join(SUFFIXES)}")
        if not path.is_file():
            raise ConfigError(f"{path}: no such file" if not path.exists() else f"{path}: not a file")
    if any(path.suffix.lower() == SUFFIX for path in found):
        check_installed()
    return list(found)
