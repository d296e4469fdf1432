"""YAML files of plain values, without tags, anchors or interpolations."""

import stat
from pathlib import Path
from typing import Any

import yaml

from posture.config.errors import ConfigError
from posture.storage.atomic import replacing

_ALLOWED = "allowed are plain values, as posture.train writes them"


def read(path: Path) -> Any:
    """The content of a file. Raises ConfigError if it cannot be read, or has a tag or an anchor."""
    try:
        text = _text(path)
        # A tag can name a class to create, and anchors let a short file expand to an endless one.
        if any(isinstance(token, (yaml.AnchorToken, yaml.TagToken)) for token in yaml.scan(text)):
            raise ConfigError(f"{path}: has a tag or an anchor; {_ALLOWED}")
        return yaml.safe_load(text)
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        raise ConfigError(f"{path}: cannot be read ({' '.join(str(error).split())[:200]})") from None


def refuse_instructions(values: Any, path: Path) -> None:
    """Raise ConfigError if `values` hold something that Hydra or OmegaConf would act on: an interpolation such as
    `${oc.env:HOME}`, or a key such as `_target_`. `path` is the file that is named in the error."""
    if isinstance(values, str) and "${" in values:
        raise ConfigError(f"{path}: {values!r:.80} is an interpolation; {_ALLOWED}")
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
    """Write plain values as YAML, atomically."""
    with replacing(path) as temporary:
        temporary.write_text(yaml.safe_dump(values, sort_keys=False, allow_unicode=True), encoding="utf-8")


def read_yaml(path: Path) -> Any:
    """The content of a file that `write_yaml` wrote; None if it does not exist or cannot be read."""
    try:
        return yaml.safe_load(_text(path))
    except (OSError, ValueError, RecursionError, yaml.YAMLError):
        return None


def _text(path: Path) -> str:
    if not stat.S_ISREG(path.stat().st_mode):  # reading a pipe would block, and a device might never end
        raise OSError("not a file")
    return path.read_text(encoding="utf-8")
