"""What the server says for one to decide by, see README.md beside this file."""

from __future__ import annotations

from typing import Literal

from kerfpath.studio._messages import Cycle
from kerfpath.studio._numbers import Message

__all__ = ["KeptEntry", "KeptMessage"]


class KeptEntry(Message):
    """A job that is kept to be compared."""

    id: int
    name: str
    revision: int
    metric: str
    objective: str
    contours: list[str]
    cycle: Cycle | None
    settled: bool


class KeptMessage(Message):
    """The jobs that are kept to be compared."""

    type: Literal["kept"] = "kept"
    plans: list[KeptEntry]
