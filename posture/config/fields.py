"""Field types shared by several commands."""

import unicodedata
from typing import Annotated

from pydantic import AfterValidator, Field

Share = Annotated[float, Field(gt=0, le=1)]
Small = Annotated[float, Field(ge=1e-9, le=1)]
Tolerance = Annotated[float, Field(gt=0, le=2)]


def _valid_path(text: str) -> str:
    if any(unicodedata.category(character) in ("Cc", "Cs") for character in text):
        raise ValueError(f"{ascii(text)} is not a path: it has control characters or is not valid text")
    if not text.strip():
        raise ValueError("a path must not be empty; null means the default folder")
    if len(text.encode()) > 4000 or any(len(part.encode()) > 255 for part in text.split("/")):
        raise ValueError("a path has at most 4000 bytes, and each of its parts 255")
    return text


PathText = Annotated[str, AfterValidator(_valid_path)]
"""A path that a file system allows, whether or not it exists."""
