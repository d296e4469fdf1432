"""A page on this machine with a live stander: sliders, pushes, and the present mode.

python -m posture.play                                   # the shipped policy; prints the address of the page
python -m posture.play ckpt=runs/<run> port=8090
python -m posture.play ckpt=lqr hip_k=60                 # the model-based controller
python -m posture.play record=out.html                   # no page: one file that plays without Python
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from posture.cli import signals

if TYPE_CHECKING:
    from posture.config.play import PlayConfig


def play(config: PlayConfig, folder: Path) -> None:
    """Serve the page until Ctrl-C, or write a recording to `folder`.

    Raises ConfigError if the port is in use, or the file cannot be written.
    """
    from posture.play.address import check_port
    from posture.storage import run_dir

    if config.record is None:
        check_port(config.port)
    else:
        path = recording_path(config.record, folder)
        run_dir.writable(path.parent, path.name)
    # What is slow to import is imported after these checks.
    with signals.blocked():  # an exception while torch imports its C++ parts would abort the process
        import_module("torch")
    if config.record is not None:
        from posture.play.recording import record

        record(config, path)
        return
    from posture.play.server import serve

    serve(config)


def check(configs: Sequence[PlayConfig], in_sweep: bool) -> None:
    """Raise ConfigError if viser is not installed, or a job of a sweep would serve a page."""
    from importlib.util import find_spec

    from posture.config.errors import ConfigError

    if find_spec("viser") is None:
        raise ConfigError("the page needs viser, which is not installed: python -m pip install viser")
    if in_sweep and any(config.record is None for config in configs):
        raise ConfigError("record: missing; the jobs of a sweep record, because a page is served until it is stopped")


def recording_path(name: str, folder: Path) -> Path:
    """The file `name`, in the job's `folder` if it has one. Raises ConfigError for a path that leads out of it."""
    from posture.cli import entry
    from posture.config.errors import ConfigError

    if not entry.has_folder():
        return Path(name)
    if Path(name).is_absolute() or ".." in Path(name).parts:
        raise ConfigError(f"record = {name}: with out and in a sweep allowed is a path within the job's folder")
    return folder / name


def main() -> None:
    """The command `python -m posture.play`; Ctrl-C ends it with exit code 130, SIGTERM with 143, also during start-up."""
    with signals.handled():
        # Imported here because they are slow, and Ctrl-C must work meanwhile.
        from posture.cli import entry
        from posture.config.play import PlayConfig

        entry.run("play", PlayConfig, play, check)


if __name__ == "__main__":
    main()
