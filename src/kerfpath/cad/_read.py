"""Read any drawing: by its suffix, after a look at the file itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import floats, scalar
from kerfpath._extras import require_extra
from kerfpath._repr import short_repr
from kerfpath.apart import call_apart, stand_by
from kerfpath.cad._left_out import nothing_drawn
from kerfpath.cad._part import Part
from kerfpath.cad._units import GAP, require_unit
from kerfpath.errors import InputError
from kerfpath.progress import Progress, no_progress

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

    from kerfpath.cad._shape import NamedShape

__all__ = ["content_of", "read"]

Columns = Mapping[str, str] | Sequence[str]
Direction = tuple[float, float, float]
KEPT = 4
"""Parts that are kept for when a file of the same content is read again, those read last."""


class Wrapping(Protocol):
    """What build123d and CadQuery call a shape."""

    @property
    def wrapped(self) -> Any:
        """The OCP shape."""


def read(
    path: str | PathLike[str] | Wrapping | TopoDS_Shape | Sequence[Wrapping | TopoDS_Shape],
    unit: str | None = None,
    *,
    gap: float = GAP,
    outer_towards: ArrayLike | None = None,
    axis: ArrayLike | None = None,
    columns: Columns | None = None,
    progress: Progress = no_progress,
) -> Part:
    """Return the part that a drawing holds: STEP, IGES, DXF, points, a tool path; or a shape.

    Parameters
    ----------
    path : str, Path or shape
        .step, .stp, .iges, .igs, .dxf; a table: .csv, .tsv or .txt; a tool path: .apt, .aptsource,
        .cl or .cls; a program of a machine: .h, .mpf, .nc, .spf or .tap. Or a shape of OCP in
        memory, what has one as `.wrapped` (build123d, CadQuery), or a list of these: faces, or
        edges. It is copied, and read in this process, where OCCT may crash on what is damaged.
    unit : str, optional
        What the numbers in the file mean, instead of what its header says: um, mm, cm, dm, m, km,
        mil, in or ft. A shape says none: its numbers are taken for mm.
    gap : float m
        Distance between the ends of two curves that a loop bridges; loose faces (IGES) are sewn
        together over it.
    outer_towards : (3,), optional
        Where the outer sides of sheets face, on the whole, in the part. Without it the outer side
        is the one that lies less deep in the part, of a flat sheet the one that faces up.
    axis : (3,), optional
        The tool axis of drawings that have none: lines in space of a DXF, STEP or IGES file, a
        table without axes, or what of a tool path has none.
    columns : mapping of str to str or sequence of str, optional
        Of a table: how its header names x, y, z, nx, ...; or, without a header, what its columns
        are, in their order, "-" for one that is not used.
    progress : callable
        Takes what is being done, and of how many faces; see `kerfpath.progress`.

    Raises
    ------
    InputError
        No such file, another format than its suffix says, a damaged one, nothing to cut in it,
        no length unit known, a direction that is none, or something that does not go with it; no
        shape, an empty one, or one with a point that is not finite.
    """
    require_unit(unit)
    scalar(gap, "gap", unit="m", above=0.0)
    asked = _Asked(
        unit=unit,
        gap=gap,
        outer_towards=_direction(outer_towards, "outer_towards"),
        axis=_direction(axis, "axis"),
        columns=columns,
    )
    if not isinstance(path, str | PathLike):
        if columns is not None:
            raise InputError("shape: columns: expected a table, got a shape")
        return _given(path, asked, progress)
    path = Path(path)
    content = content_of(path, _EXPECTED)
    kind = _KINDS.get(path.suffix.lower())
    if kind is None:
        raise InputError(f"{path}: expected {_EXPECTED} by its suffix, got {path.suffix!r}")
    if not content.strip():
        raise InputError(f"{path}: the file is empty; expected {_EXPECTED}")
    if outer_towards is not None and kind not in ("STEP", "IGES"):
        raise InputError(f"{path}: outer_towards: expected a drawing of sheets, got a {kind}")
    if columns is not None and kind != "table":
        raise InputError(f"{path}: columns: expected a table, got a {kind} file")
    return _drawn(kind, path, content, asked, progress)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Asked:
    """How a drawing is to be read: `read` says of each what it is, the gap in m."""

    unit: str | None
    gap: float
    outer_towards: Direction | None
    axis: Direction | None
    columns: Columns | None

    __repr__ = short_repr


def _direction(value: ArrayLike | None, name: str) -> Direction | None:
    if value is None:
        return None
    x, y, z = floats(value, name, (3,)).tolist()
    if not x * x + y * y + z * z > 0:
        raise InputError(f"{name}: expected a direction, got a vector of length 0")
    return x, y, z


def content_of(path: Path, expected: str) -> bytes:
    """Return the bytes of a file, or raise InputError that says what it is expected to be."""
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise InputError(f"{path}: is no file, which would never end; expected {expected}")
        return path.read_bytes()
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; expected {expected}") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a directory; expected {expected}") from None
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{path}: cannot be read ({why}); expected {expected}") from None


def _drawn(kind: str, path: Path, content: bytes, asked: _Asked, progress: Progress) -> Part:
    """Return the part; each reader is loaded when a file asks for it, as OCCT takes over a second.

    OCCT may crash, so STEP and IGES are translated apart from this process.
    """
    progress(f"reading {path.name}", 0, 0)
    unit, gap = asked.unit, asked.gap
    axis = None if asked.axis is None else np.array(asked.axis)
    if kind == "table":
        from kerfpath.cad._table import read_table

        return read_table(path, content, unit, gap, axis=axis, columns=asked.columns)
    if kind == "tool path":
        from kerfpath.cad._apt import read_apt

        return read_apt(path, content, unit, gap, axis)
    if kind == "NC program":
        from kerfpath.cad._nc import read_nc

        return read_nc(path, content, unit, gap, axis)
    require_extra("cad", f"{path}: reading {kind}")
    if kind == "DXF":
        from kerfpath.cad._dxf import read_dxf

        return read_dxf(path, content, unit, gap, axis)
    stand_by()
    from kerfpath.cad._iges import read_iges
    from kerfpath.cad._shape import occt, uncollected
    from kerfpath.cad._step import read_step

    key = (kind, sha256(content).digest(), unit, gap, asked.outer_towards, asked.axis)
    part = _kept.pop(key, None)
    if part is None:
        translate = read_step if kind == "STEP" else read_iges
        try:
            drawn = call_apart(translate, path.absolute(), unit, gap, size=len(content))
            with occt(), uncollected():
                part = _part_of(path, drawn, asked, progress)
        except InputError as error:
            raise InputError(f"{path}: {_in_words(kind, content, error)}") from None
    _kept[key] = part
    while len(_kept) > KEPT:
        _kept.pop(next(iter(_kept)), None)
    return replace(part, path=path)


def _given(given: object, asked: _Asked, progress: Progress) -> Part:
    """Return the part that a shape in memory is."""
    require_extra("cad", "shape: reading it")
    from kerfpath.cad._given import drawn_of_given
    from kerfpath.cad._shape import occt, uncollected

    try:
        with occt(), uncollected():
            drawn = drawn_of_given(given, asked.unit, asked.gap)
            if not drawn.faces and asked.axis is None:
                raise InputError("it has edges and no face; say the tool axis with axis")
            return _part_of(Path("shape"), drawn, asked, progress)
    except InputError as error:
        raise InputError(f"shape: {error}") from None


def _part_of(path: Path, drawn: NamedShape, asked: _Asked, progress: Progress) -> Part:
    """Return the part that faces, or lines with an axis, make up."""
    from kerfpath.cad._faces import part_of
    from kerfpath.cad._wires import part_of_wires

    if drawn.faces and asked.axis is not None:
        raise InputError("axis: expected a drawing of lines, got one of faces")
    if drawn.faces:
        return part_of(path, drawn, asked.gap, asked.outer_towards, progress)
    if asked.axis is None:
        raise nothing_drawn(drawn.left_out)
    return part_of_wires(path, drawn, asked.gap, np.array(asked.axis))


def _in_words(kind: str, content: bytes, error: InputError) -> InputError:
    """Return what breaks the grammar of a STEP file that cannot be read, else the error itself."""
    from kerfpath.cad._part21 import require_grammar

    try:
        if kind == "STEP" and b"END-ISO-10303-21;" in content:
            require_grammar(content)
    except InputError as broken:
        return broken
    return error


_kept: dict[tuple[object, ...], Part] = {}
_KINDS = {
    ".step": "STEP",
    ".stp": "STEP",
    ".iges": "IGES",
    ".igs": "IGES",
    ".dxf": "DXF",
    ".csv": "table",
    ".tsv": "table",
    ".txt": "table",
    ".apt": "tool path",
    ".aptsource": "tool path",
    ".cl": "tool path",
    ".cls": "tool path",
    ".h": "NC program",
    ".mpf": "NC program",
    ".nc": "NC program",
    ".spf": "NC program",
    ".tap": "NC program",
}
_EXPECTED = f"a drawing ({', '.join(_KINDS)})"
