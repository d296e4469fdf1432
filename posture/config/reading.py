"""From plain mappings to a checked configuration."""

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from posture.config.errors import ConfigError, one_line

Config = TypeVar("Config", bound=BaseModel)


def read(kind: type[Config], values: Mapping[str, Any], where: str = "") -> Config:
    """`values` as a checked `kind`. Raises ConfigError with one line; `where` says which file is meant, if any."""
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        raise ConfigError((f"{where}: " if where else "") + one_line(error)) from None
