"""The place of this process among those that torchrun, or a job manager with the same variables, started together.

It counts only if every variable that torch needs to join the processes is valid. Some job managers set a few of them in
every job: these have no effect.
"""

import os
import re
from typing import NamedTuple

VARIABLES = ("RANK", "WORLD_SIZE", "LOCAL_RANK", "MASTER_ADDR", "MASTER_PORT")


class Place(NamedTuple):
    """rank: number of this process among `size`, from 0. local_rank: its number among those of this machine."""

    rank: int = 0
    size: int = 1
    local_rank: int = 0


def place() -> Place | None:
    """The place of this process; None if it was started alone."""
    return None if problem() else Place(*(int(os.environ[name]) for name in ("RANK", "WORLD_SIZE", "LOCAL_RANK")))


def rank() -> int:
    """Number of this process among those started together; 0 if it was started alone."""
    return (place() or Place()).rank


def problem() -> str:
    """Why the variables give this process no place, for a message; empty if they do."""
    values = {name: os.environ.get(name, "") for name in VARIABLES}
    if missing := [name for name, value in values.items() if not value]:
        return f"{', '.join(missing)} not set"
    for name, value in values.items():
        if name != "MASTER_ADDR" and not re.fullmatch("[0-9]{1,9}", value):
            return f"{name}={value!r:.40} is not a number"
    number, size, local, port = (int(values[name]) for name in ("RANK", "WORLD_SIZE", "LOCAL_RANK", "MASTER_PORT"))
    if not (number < size and local < size):
        return f"RANK={number} and LOCAL_RANK={local} must be below WORLD_SIZE={size}"
    return "" if 0 < port < 65536 else f"MASTER_PORT={port} is not a port"
