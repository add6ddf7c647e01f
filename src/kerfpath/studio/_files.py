"""Files for download."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["File"]


class File(NamedTuple):
    """A file for download: its name, media type and content."""

    name: str
    kind: str
    content: bytes
