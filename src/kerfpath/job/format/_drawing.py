"""The drawing of a job: its file, and how it is read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from kerfpath._arrays import Array
from kerfpath._repr import short_repr
from kerfpath.cad import GAP, Part
from kerfpath.cad import read as read_drawing

__all__ = ["Drawing"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawing:
    """A drawing, and how it is read.

    Parameters
    ----------
    file : Path
        The CAD file, there when the job was read.
    unit : str or None
        Length unit that overrides the CAD file's own.
    gap : float m
        Distance between the ends of two curves that a loop bridges.
    outer_towards : (3,) or None
        Where the outer sides of its sheets face, see `kerfpath.cad.read`.
    axis : (3,) or None
        The tool axis of a drawing that has none, in the part.
    columns : mapping or sequence of str, or None
        What the columns of a table are, see `kerfpath.cad.read`.
    accept_left_out : bool
        Whether something that may have been to cut may be left out.
    """

    file: Path
    unit: str | None = None
    gap: float = GAP
    outer_towards: Array | None = None
    axis: Array | None = None
    columns: Mapping[str, str] | Sequence[str] | None = None
    accept_left_out: bool = False

    __repr__ = short_repr

    def read(self) -> Part:
        """Return the part that it holds.

        Raises
        ------
        InputError
            It cannot be read.
        """
        return read_drawing(
            self.file,
            unit=self.unit,
            gap=self.gap,
            outer_towards=self.outer_towards,
            axis=self.axis,
            columns=self.columns,
        )
