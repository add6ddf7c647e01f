"""Messages about the part that is cut; README.md in this folder defines their keys."""

from __future__ import annotations

from typing import Literal

from kerfpath.studio._numbers import Message, Numbers

__all__ = ["FaceEntry", "LoopEntry", "PartMessage"]


class LoopEntry(Message):
    """A loop of the part, whether or not it is cut."""

    name: str
    face: str
    kind: Literal["outer", "inner", "open"]
    side: Literal["outer", "inner", "edge", ""]
    closed: bool
    length: float
    diameter: float | None
    gap: float
    points: Numbers


class FaceEntry(Message):
    """A run of triangles of the part's mesh, and the face that they belong to."""

    name: str
    triangles: int


class PartMessage(Message):
    """The loops and faces of the drawing that can be picked."""

    type: Literal["part"] = "part"
    revision: int
    loops: list[LoopEntry]
    faces: list[FaceEntry]
    left_out: int
