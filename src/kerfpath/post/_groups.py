"""The contours of a program that was read: joint moves, and the path after them."""

from __future__ import annotations

from dataclasses import dataclass, field

from kerfpath._repr import short_repr
from kerfpath.post._read import ReadHandshake, ReadMove, ReadProgram, ReadStep, ReadWait

__all__ = ["ReadGroup", "groups_of"]


@dataclass(slots=True)
class ReadGroup:
    """Joint moves and the moves of the path after them; no path after the last contour.

    Parameters
    ----------
    name : str
        Name of the routine in which its path begins.
    joint, path : list of ReadMove
    waits : list of (int, ReadWait)
        After how many moves of the path the robot waits, and how long.
    handshakes : list of (int, ReadHandshake)
        After how many moves of the path a partner is asked or awaited.
    """

    name: str = ""
    joint: list[ReadMove] = field(default_factory=list)
    path: list[ReadMove] = field(default_factory=list)
    waits: list[tuple[int, ReadWait]] = field(default_factory=list)
    handshakes: list[tuple[int, ReadHandshake]] = field(default_factory=list)

    __repr__ = short_repr


def groups_of(read: ReadProgram) -> list[ReadGroup]:
    """Return the contours of a program, each of which may extend over several routines."""
    groups: list[ReadGroup] = []
    for section in read.sections:
        for step in section.steps:
            joint = isinstance(step, ReadMove) and step.kind == "joint"
            if not groups or (joint and groups[-1].path):
                groups.append(ReadGroup())
            if not groups[-1].path:
                groups[-1].name = section.name
            _add(groups[-1], step)
    return groups


def _add(group: ReadGroup, step: ReadStep) -> None:
    if isinstance(step, ReadWait):
        group.waits.append((len(group.path), step))
    elif isinstance(step, ReadHandshake):
        group.handshakes.append((len(group.path), step))
    elif step.kind == "joint":
        group.joint.append(step)
    else:
        group.path.append(step)
