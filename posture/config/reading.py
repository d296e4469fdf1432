"""From plain values to a checked configuration, and from pydantic's errors to one line."""

import re
from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from posture.config.errors import ConfigError

Config = TypeVar("Config", bound=BaseModel)

_SHAPES = {
    "float": "a number",
    "int": "a whole number",
    "_valid_path": "a path",
    "tuple": "a range [low, high]",
    "Schedule": "a schedule {start: .., end: .., until: ..}",
    "Ramp": "a ramp {start: .., rate: .., duration: ..} in quotes",
    "none": "none",
    "estimate": "estimate",
}
"""Allowed values of a key, by a word in pydantic's name for that alternative."""


def read(kind: type[Config], values: Mapping[str, Any], file: str = "") -> Config:
    """`values` as a checked `kind`. Raises ConfigError with one line, which begins with the name of the `file`, if any."""
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        line = " ".join(_first_problem(error.errors()).split())
        raise ConfigError(f"{file}: {line}" if file else line) from None


def _first_problem(errors: list[ErrorDetails]) -> str:
    """The key, the value that was given, and what is allowed.

    For a key that may hold values of several shapes pydantic reports an error for each shape. Reported is a check of our own
    if one failed, else a range, else the list of shapes.
    """
    for error in errors:
        if error["type"] == "value_error":
            return _with_key(_key(error), error["msg"].removeprefix("Value error, "))
    error, key = errors[0], _key(errors[0])
    if error["type"] == "extra_forbidden":
        return f"{key}: no such key"
    if error["type"] == "missing":
        return f"{'.'.join(key.split('.')[:-1])}: too few values" if isinstance(error["loc"][-1], int) else f"{key}: missing"
    if error["type"] in ("too_short", "too_long"):
        end, word = ("min", "least") if error["type"] == "too_short" else ("max", "most")
        return f"{key} = {error['input']!s:.100}: the number of values must be at {word} {error['ctx'][f'{end}_length']}"
    if error["type"] == "tuple_type" and len(errors) == 1:
        return f"{key} = {error['input']!s:.100}: allowed is a list [..]"
    alternatives = [other for other in errors if _key(other).startswith(key)]
    ranges = [other for other in alternatives if other["type"].startswith(("greater", "less", "finite"))]
    if (len(alternatives) > 1 or error["type"] == "model_type") and not ranges:
        names = " ".join(str(part) for other in alternatives for part in other["loc"] if _is_shape(part))
        names += f" {error.get('ctx', {}).get('class_name', '')}"
        shapes = [text for word, text in _SHAPES.items() if re.search(rf"\b{word}\b", names)]
        if _SHAPES["_valid_path"] in shapes:
            shapes = ["a path", "a list of paths"]
        return f"{key} = {error['input']!s:.100}: allowed is {', or '.join(shapes) or 'a group of keys {..: .., ..: ..}'}"
    error = ranges[0] if ranges else error
    return f"{_key(error)} = {error['input']!r:.100}: {error['msg'].replace('Input should', 'must', 1)}"


def _with_key(key: str, message: str) -> str:
    """A check's message, which may begin with a key inside `key`."""
    if not key or message.startswith(key):
        return message
    return f"{key}.{message}" if re.match(r"[a-z]\w*[.\w]*(:| =) ", message) else f"{key}: {message}"


def _key(error: ErrorDetails) -> str:
    return ".".join(str(part) for part in error["loc"] if not _is_shape(part))


def _is_shape(part: int | str) -> bool:
    """Whether a part of an error's location is pydantic's name of an alternative, such as tuple[..], and not a key."""
    return isinstance(part, str) and bool(re.match(r"constrained-|function-|tuple\[|literal\[", part))
