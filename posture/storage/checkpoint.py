"""Checkpoint files that show whether they are whole.

A checkpoint is torch's own file, a zip archive, and its archive comment is the SHA-256 of all bytes before the comment. The
digest is thus replaced together with what it vouches for, and torch.load and any zip tool read the file as before. It tells
of damage, not of who wrote a file; that nothing in one can execute code is torch's `weights_only`.
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
_ALLOWED = "allowed are whole files as posture.train saves them"


def save(content: dict[str, Any], path: Path) -> None:
    """Write a checkpoint so that at any moment the old file or the new one is there, whole, with its digest."""
    import torch

    file = io.BytesIO()
    torch.save(content, file)
    with replacing(path) as temporary:
        temporary.write_bytes(sealed(file.getvalue()))


def load(path: Path, device: str) -> dict[str, Any]:
    """Read a checkpoint onto `device`; nothing in it can execute code. Raises ConfigError unless it is one, and whole."""
    whole = _read(path)
    body, comment = whole[:-_COMMENT], whole[-_COMMENT:]
    if not whole:
        raise ConfigError(f"{path}: is empty; {_ALLOWED}")
    if not whole.startswith(b"PK"):
        raise ConfigError(f"{path}: not a checkpoint; {_ALLOWED}")
    if not comment.startswith(_LABEL):
        raise ConfigError(f"{path}: does not end in a digest, so it was cut short or saved by something else; {_ALLOWED}")
    if comment != _LABEL + hashlib.sha256(body).hexdigest().encode():
        raise ConfigError(f"{path}: is damaged, its digest is of other bytes; {_ALLOWED}")
    import torch

    try:
        with warnings.catch_warnings(action="ignore"):  # a refusal is one line
            content = torch.load(io.BytesIO(whole), weights_only=True, map_location=device)
    except Exception as error:  # torch raises whatever the bytes happen to provoke
        raise ConfigError(f"{path}: holds more than tensors and plain values ({type(error).__name__}); {_ALLOWED}") from None
    if not isinstance(content, dict):
        raise ConfigError(f"{path}: holds no named tensors; {_ALLOWED}")
    return content


def sealed(archive: bytes) -> bytes:
    """A zip archive without a comment, with its digest as comment."""
    # The last two bytes of an archive are the length of its comment.
    body = archive[:-2] + _COMMENT.to_bytes(2, "little")
    return body + _LABEL + hashlib.sha256(body).hexdigest().encode()


def _read(path: Path) -> bytes:
    try:
        if not stat.S_ISREG(path.stat().st_mode):  # reading a pipe would wait, and a device might never end
            raise ConfigError(f"{path}: not a file; {_ALLOWED}")
        return path.read_bytes()
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such checkpoint") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
