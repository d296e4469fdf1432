"""YAML files of plain values: nothing in one is built, repeated, looked up or replaced."""

from pathlib import Path
from typing import Any

import yaml

from posture.config.errors import ConfigError
from posture.storage.atomic import replacing

_ALLOWED = "allowed are plain values, as posture.train writes them"


def read(path: Path) -> Any:
    """What the file at `path` says. Raises ConfigError where it cannot be read or has a tag or an anchor."""
    try:
        text = path.read_text(encoding="utf-8")
        # A tag names a class to build; an anchor, repeated, lets a short file stand for an endless one.
        if any(isinstance(token, (yaml.AnchorToken, yaml.TagToken)) for token in yaml.scan(text)):
            raise ConfigError(f"{path}: has a tag or an anchor; {_ALLOWED}")
        return yaml.safe_load(text)
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        raise ConfigError(f"{path}: cannot be read ({' '.join(str(error).split())[:200]})") from None


def refuse_instructions(values: Any, path: Path) -> None:
    """Raise ConfigError where a string or a key of `values`, from the file at `path`, means something else to Hydra or
    OmegaConf: an interpolation (`${oc.env:HOME}`), or a key such as `_target_`."""
    if isinstance(values, str) and "${" in values:
        raise ConfigError(f"{path}: {values!r:.80} is to be replaced by something else; {_ALLOWED}")
    if isinstance(values, dict):
        for key, value in values.items():
            if not isinstance(key, str) or key.startswith("_"):
                raise ConfigError(f"{path}: {key!r:.80}: no such key; {_ALLOWED}")
            refuse_instructions(key, path)
            refuse_instructions(value, path)
    elif isinstance(values, list):
        for value in values:
            refuse_instructions(value, path)


def write_yaml(path: Path, values: Any) -> None:
    """Write plain values as YAML, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(yaml.safe_dump(values, sort_keys=False, allow_unicode=True), encoding="utf-8")


def read_yaml(path: Path) -> Any:
    """What `write_yaml` wrote; None where there is no such file or it cannot be read."""
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError, yaml.YAMLError):
        return None
