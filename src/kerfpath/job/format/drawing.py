"""The drawing of a job: its file and how to read it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from kerfpath.arrays import Array, short_repr
from kerfpath.cad import EDGE_TURN, GAP, Machine, Part
from kerfpath.cad import read as read_drawing
from kerfpath.errors import InputError
from kerfpath.progress import Progress, no_progress


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawing:
    """A drawing and how to read it.

    Parameters
    ----------
    file : Path
        The CAD file; it existed when the job was read.
    unit : str or None
        Length unit that overrides the CAD file's own.
    gap : float m
        Largest gap between the ends of two curves that a loop bridges.
    edge_turn : float m
        Distance from sharp edges within which the beam turns, see `kerfpath.cad.read`.
    outer_towards : (3,) or None
        Direction that the outer sides of its sheets face, part frame, see `kerfpath.cad.read`.
    axis : (3,) or None
        Tool axis for a drawing without one, part frame.
    columns : mapping or sequence of str, or None
        Meaning of the columns of a table of points, see `kerfpath.cad.read`.
    sort : "open", "closed" or None
        Whether points of a table are sorted along a curve, see `kerfpath.cad.read`.
    beam : str or sequence of str, or None
        How a program of a robot switches the beam, see `kerfpath.cad.read`.
    section : (3,) or None
        Normal of the planes that cut a mesh, see `kerfpath.cad.read`.
    section_at : tuple of float, m
        Distance of each of them along the normal.
    machine : Machine or None
        The rotary axes of the machine whose program it is, see `kerfpath.cad.read`.
    drawing_frame : "leave_out", "cut" or None
        What to do with a drawing frame in a DXF, see `kerfpath.cad.read`.
    lines : Path or None
        A table of points in the part frame, whose contours are loops of the part, too.
    accept_left_out : bool
        Whether geometry that may have to be cut may be left out.
    """

    file: Path
    unit: str | None = None
    gap: float = GAP
    edge_turn: float = EDGE_TURN
    outer_towards: Array | None = None
    axis: Array | None = None
    columns: Mapping[str, str] | Sequence[str] | None = None
    sort: Literal["open", "closed"] | None = None
    beam: str | Sequence[str] | None = None
    section: Array | None = None
    section_at: tuple[float, ...] = ()
    machine: Machine | None = None
    drawing_frame: Literal["leave_out", "cut"] | None = None
    lines: Path | None = None
    accept_left_out: bool = False

    __repr__ = short_repr

    def read(self, progress: Progress = no_progress) -> Part:
        """Return the part in the drawing.

        `progress` is called with the current step and the number of faces.

        Raises
        ------
        InputError
            The drawing or the table of lines cannot be read, or both name a loop alike.
        """
        part = read_drawing(
            self.file,
            unit=self.unit,
            gap=self.gap,
            edge_turn=self.edge_turn,
            outer_towards=self.outer_towards,
            axis=self.axis,
            columns=self.columns,
            sort=self.sort,
            beam=self.beam,
            section=self.section,
            section_at=self.section_at,
            machine=self.machine,
            drawing_frame=self.drawing_frame,
            progress=progress,
        )
        if self.lines is None:
            return part
        added = read_drawing(self.lines, gap=self.gap)
        known = {loop.name for loop in part.loops}
        if both := [loop.name for loop in added.loops if loop.name in known]:
            raise InputError(
                f"{self.lines}: the drawing has a loop {both[0]!r}, too; rename the contour"
            )
        notes = (f"{self.lines.name}: {note}" for note in added.notes)
        return replace(part, loops=(*part.loops, *added.loops), notes=(*part.notes, *notes))
