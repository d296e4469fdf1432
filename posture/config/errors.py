"""The two errors that a command answers with one line, and pydantic's errors as such a line."""

import re

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from envs.config import MAX_FREQ_HZ, MIN_FREQ_HZ

_UNION_BRANCHES = {"float", "int", "Schedule", "Ramp", "tuple", "constrained-float"}


class ConfigError(Exception):
    """The user's input is wrong; the message is one line. Commands end with exit code 2."""


class RunError(RuntimeError):
    """Work cannot go on, although the input was right; the message is one line. Commands end with exit code 1."""


def one_line(error: ValidationError) -> str:
    """The first thing that is wrong, by the name of its key."""
    return " ".join(_told(error).split())


def _told(error: ValidationError) -> str:
    errors = error.errors()
    # Of a union pydantic reports every branch: the branch that took the value's shape and refused its content says most.
    first = next((e for e in errors if e["type"] == "value_error"), errors[0])
    place = _place(first)
    branches = [e for e in errors if _place(e).startswith(place)]
    if first["type"] != "value_error":
        first = next((e for e in branches if _is_range(e)), first)
    inner, message, given = _place(first), first["msg"].removeprefix("Value error, "), first["input"]
    if first["type"] == "value_error":
        if not place or message.startswith(place):
            return message
        return f"{place}.{message}" if re.match(r"[a-z]\w*[.\w]*(:| =) ", message) else f"{place}: {message}"
    if first["type"] == "extra_forbidden":
        return f"{place}: no such key"
    if first["type"] == "missing":
        return f"{place}: missing"
    if place == "env.freq" and len(branches) > 1:
        allowed = f"a number in [{MIN_FREQ_HZ:g}, {MAX_FREQ_HZ:g}] Hz, or a range [low, high] of such numbers"
        return f"{place} = {_cut(str(given))}: allowed is {allowed}"
    if place == "env.episode_steps" and len(branches) > 1:
        return (
            f"{place} = {_cut(str(given))}: allowed is a whole number of at least 1, or a range [low, high] of such numbers"
        )
    if not _is_range(first) and any("Schedule" in str(e["loc"]) for e in branches):
        return f"{place} = {_cut(str(given))}: allowed is a number, or a schedule {{start: .., end: .., steps: ..}}"
    return f"{inner} = {_cut(repr(given))}: {message[0].lower()}{message[1:]}"


def _place(error: ErrorDetails) -> str:
    return ".".join(str(part) for part in error["loc"] if not _is_branch(str(part)))


def _is_range(error: ErrorDetails) -> bool:
    return error["type"].startswith(("greater", "less", "finite"))


def _cut(text: str) -> str:
    return text if len(text) <= 100 else f"{text[:100]}..."


def _is_branch(part: str) -> bool:
    return part in _UNION_BRANCHES or part.startswith(("constrained", "tuple[", "function-"))
