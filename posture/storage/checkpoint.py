"""Checkpoint files that contain their own digest.

A checkpoint is torch's file, a zip archive, whose archive comment is the SHA-256 of all bytes before the comment. File and
digest are thus replaced together, and torch.load and zip tools can still read the file. The digest detects damage; it does
not prove who wrote the file. torch's `weights_only` prevents a file from executing code.
"""

import hashlib
import io
import stat
import warnings
from pathlib import Path
from typing import Any

from posture.config.errors import ConfigError
from posture.storage.atomic import replacing

_LABEL = b"sha256:"
_COMMENT = len(_LABEL) + 64
_ALLOWED = "allowed are complete files saved by posture.train"


def save(content: dict[str, Any], path: Path) -> None:
    """Write a checkpoint with its digest, atomically."""
    import torch

    file = io.BytesIO()
    torch.save(content, file)
    with replacing(path) as temporary:
        temporary.write_bytes(sealed(file.getvalue()))


def load(path: Path, device: str) -> dict[str, Any]:
    """Read a checkpoint onto `device`; it cannot execute code. Raises ConfigError unless it is a complete checkpoint."""
    whole = _read(path)
    body, comment = whole[:-_COMMENT], whole[-_COMMENT:]
    if not whole:
        raise ConfigError(f"{path}: is empty; {_ALLOWED}")
    if not whole.startswith(b"PK"):
        raise ConfigError(f"{path}: not a checkpoint; {_ALLOWED}")
    if not comment.startswith(_LABEL):
        raise ConfigError(f"{path}: does not end in a digest: it was cut short, or saved by another program; {_ALLOWED}")
    if comment != _LABEL + hashlib.sha256(body).hexdigest().encode():
        raise ConfigError(f"{path}: is damaged: its digest does not match its content; {_ALLOWED}")
    return _tensors(whole, path, device)


def as_policy(content: dict[str, Any]) -> dict[str, Any]:
    """The `content` of a checkpoint with the policy's weights as the actor's: the averages, where it has them."""
    return content | {"actor_state_dict": content["average_state_dict"]} if "average_state_dict" in content else content


def load_unsealed(path: Path) -> dict[str, Any]:
    """Read a checkpoint that another program saved with torch, without a digest; it cannot execute code. Raises ConfigError
    unless it holds only tensors and plain values."""
    return _tensors(_read(path), path, "cpu")


def _tensors(whole: bytes, path: Path, device: str) -> dict[str, Any]:
    import torch

    try:
        with warnings.catch_warnings(action="ignore"):  # a refusal is one line
            content = torch.load(io.BytesIO(whole), weights_only=True, map_location=device)
    except Exception as error:  # torch raises many types
        raise ConfigError(f"{path}: holds more than tensors and plain values ({type(error).__name__}); {_ALLOWED}") from None
    if not isinstance(content, dict):
        raise ConfigError(f"{path}: holds no named tensors; {_ALLOWED}")
    return content


def sealed(archive: bytes) -> bytes:
    """A zip archive that had no comment, with its digest as the comment."""
    # The last two bytes of an archive are the length of its comment.
    body = archive[:-2] + _COMMENT.to_bytes(2, "little")
    return body + _LABEL + hashlib.sha256(body).hexdigest().encode()


def _read(path: Path) -> bytes:
    try:
        if not stat.S_ISREG(path.stat().st_mode):  # reading a pipe would block, and a device might never end
            raise ConfigError(f"{path}: not a file; {_ALLOWED}")
        return path.read_bytes()
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such checkpoint") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
