"""Files that a page takes along."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["File"]


class File(NamedTuple):
    """A file to take along: its name, what it is, and its content."""

    name: str
    kind: str
    content: bytes
