"""Read any drawing, by the suffix of its file, or a shape in memory."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from os import PathLike
from pathlib import Path
from time import thread_time
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, floats, freeze, require_one_of, scalar, short_repr
from kerfpath.cad.machine import Machine
from kerfpath.cad.part import Part, turning_at_edges
from kerfpath.cad.table import Ends, TableCells, cells_of
from kerfpath.cad.units import (
    EDGE_TURN,
    GAP,
    LEAST_EDGE_TURN,
    MM,
    SUFFIXES,
    UNITS_MM,
    require_unit,
    unit_question,
)
from kerfpath.effort import uncollected
from kerfpath.errors import InputError
from kerfpath.extras import require_extra
from kerfpath.isolated import call_apart, seconds_for, stand_by, too_slow
from kerfpath.progress import Progress, no_progress
from kerfpath.text import lower

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

    from kerfpath.cad.shape import NamedShape


Columns = Mapping[str, str] | Sequence[str]
Direction = tuple[float, float, float]
CACHED = 4
"""Number of parts, those read last, that are kept in case a file with the same content is read."""


class Wrapping(Protocol):
    """A shape of build123d or CadQuery."""

    @property
    def wrapped(self) -> Any:
        """The OCP shape."""


def read(
    path: str | PathLike[str] | Wrapping | TopoDS_Shape | Sequence[Wrapping | TopoDS_Shape],
    unit: str | None = None,
    *,
    gap: float = GAP,
    edge_turn: float = EDGE_TURN,
    outer_towards: ArrayLike | None = None,
    axis: ArrayLike | None = None,
    columns: Columns | None = None,
    sort: Ends | None = None,
    beam: str | Sequence[str] | None = None,
    section: ArrayLike | None = None,
    section_at: ArrayLike = (),
    machine: Machine | None = None,
    drawing_frame: Literal["leave_out", "cut"] | None = None,
    progress: Progress = no_progress,
) -> Part:
    """Return the part in a drawing (STEP, IGES, DXF, a table, a mesh, a path) or a shape.

    Parameters
    ----------
    path : str, Path or shape
        .step, .stp, .iges, .igs, .dxf; a table: .csv, .tsv or .txt; a tool path: .apt, .aptsource,
        .cl or .cls; a program of a machine: .cnc, .gcode, .h, .mpf, .nc, .ngc, .spf or .tap; a
        program of a robot: .src (KUKA), .mod or .modx (ABB), .ls (FANUC) or .script (Universal
        Robots); a mesh: .stl, .obj or .ply. Or a shape of OCP in memory, an object with one as
        `.wrapped` (build123d, CadQuery), or a list of these: faces, or edges. A shape is copied and
        read in this process, where OCCT may crash if it is damaged.
    unit : str, optional
        Unit of the numbers in the file, instead of that in its header: um, mm, cm, dm, m, km, mil,
        in or ft. A shape has no unit: its numbers are in mm by default.
    gap : float m
        Largest distance between the ends of two curves that a loop bridges, and over which loose
        faces (IGES) are sewn together.
    edge_turn : float m
        For faces and meshes: distance before and behind a sharp edge within which the beam turns
        from the normal of one wall to that of the other; at least 0.2 mm.
    outer_towards : (3,), optional
        Direction in the part that the outer sides of sheets face on the whole. By default the outer
        side is the one that less of the part hides, or that faces up if the sheet is flat.
    axis : (3,), optional
        Tool axis for drawings without one: lines in space of a DXF, STEP or IGES file, a table
        without axes, or moves of a tool path without one.
    columns : mapping of str to str or sequence of str, optional
        For a table: the names in its header of x, y, z, nx, ...; or, without a header, the columns
        in their order, "-" for one that is not used.
    sort : {"open", "closed"}, optional
        For a table whose points are in no order: they are sorted along the curve that they lie on.
    beam : str or (str, str), optional
        For a program of a robot: the output that is on while it cuts, as "$OUT[5]"; the statements
        that switch the beam on and off; or the speed of its cuts, as "120 mm/s".
    section : (3,), optional
        For a mesh: the normal of parallel planes, whose loops are the contours.
    section_at : (K,) m
        Distance of each of these planes from the origin, along the normal.
    machine : Machine, optional
        For a program of a machine: its rotary axes, where the program moves some.
    drawing_frame : {"leave_out", "cut"}, optional
        For a DXF: what to do with a rectangle around all else. By default it is left out if it
        seems to be a drawing frame, and then said to be what may have to be cut.
    progress : callable
        Called with the current step and the number of faces; see `kerfpath.progress`.

    Raises
    ------
    InputError
        No such file, another format than its suffix says, a damaged file, nothing to cut in it, no
        known length unit, a direction of length zero, or an argument that does not suit the file;
        no shape, an empty one, or one with a point that is not finite.
    """
    require_unit(unit)
    scalar(gap, "gap", unit="m", above=0.0)
    if sort is not None:
        require_one_of(sort, "sort", ("open", "closed"))
    if drawing_frame is not None:
        require_one_of(drawing_frame, "drawing_frame", ("leave_out", "cut"))
    scalar(edge_turn, "edge_turn", unit="m", above=0.0)
    if edge_turn < LEAST_EDGE_TURN:
        raise InputError(f"edge_turn: expected at least {LEAST_EDGE_TURN:g} m, got {edge_turn:g} m")
    options = _ReadOptions(
        unit=unit,
        gap=gap,
        outer_towards=_direction(outer_towards, "outer_towards"),
        axis=_direction(axis, "axis"),
        columns=columns,
        sort=sort,
        beam=_beam(beam),
        section=_direction(section, "section"),
        heights=tuple(floats(section_at, "section_at", (None,)).tolist()),
        machine=machine,
        drawing_frame=drawing_frame,
    )
    if (options.section is None) != (not options.heights):
        raise InputError("section and section_at: expected both, or none of them")
    if not isinstance(path, str | PathLike):
        _require_fit(options, "shape", "", "a shape")
        return turning_at_edges(_read_shape(path, options, progress), edge_turn)
    path = Path(path)
    content = content_of(path, _EXPECTED)
    kind = SUFFIXES.get(path.suffix.lower())
    if kind is None:
        is_job = path.suffix.lower() == ".toml"
        cure = "; the key file in [part] of a job names its drawing" if is_job else ""
        raise InputError(f"{path}: expected {_EXPECTED} by its suffix, got {path.suffix!r}{cure}")
    if not content.strip():
        raise InputError(f"{path}: the file is empty; expected {_EXPECTED}")
    if outer_towards is not None and kind not in ("STEP", "IGES", "mesh"):
        raise InputError(f"{path}: outer_towards: expected a drawing of sheets, got a {kind}")
    has_walls = kind in ("STEP", "IGES", "mesh")
    if edge_turn != EDGE_TURN and not has_walls:
        raise InputError(f"{path}: edge_turn: expected a drawing of faces, got a {kind}")
    _require_fit(options, path, kind, f"a {kind} file")
    part = _read_file(kind, path, content, options, progress)
    part = turning_at_edges(part, edge_turn) if has_walls else part
    question = None if unit is not None else unit_question(part.unit, part.bounding_box)
    return part if question is None else replace(part, notes=(*part.notes, question))


@dataclass(frozen=True, slots=True, kw_only=True)
class _ReadOptions:
    """Arguments of `read`, which describes them."""

    unit: str | None
    gap: float
    outer_towards: Direction | None
    axis: Direction | None
    columns: Columns | None
    sort: Ends | None
    beam: str | tuple[str, str] | None
    section: Direction | None
    heights: tuple[float, ...]
    machine: Machine | None
    drawing_frame: Literal["leave_out", "cut"] | None

    __repr__ = short_repr


_OF_ONE_KIND = {
    "columns": ("table", "a table"),
    "sort": ("table", "a table"),
    "section": ("mesh", "a triangle mesh"),
    "beam": ("robot program", "a program of a robot"),
    "machine": ("NC program", "a program of a machine"),
    "drawing_frame": ("DXF", "a DXF drawing"),
}
"""Options for files of one kind, and that kind in words."""


def _require_fit(options: _ReadOptions, name: object, kind: str, got: str) -> None:
    for option, (needed, expected) in _OF_ONE_KIND.items():
        if getattr(options, option) is not None and kind != needed:
            raise InputError(f"{name}: {option}: expected {expected}, got {got}")


def _beam(value: str | Sequence[str] | None) -> str | tuple[str, str] | None:
    if value is None or (isinstance(value, str) and value.strip()):
        return value
    if not isinstance(value, str) and len(value) == 2 and all(each.strip() for each in value):
        return value[0], value[1]
    raise InputError(
        f"beam: expected the name of an output, or the two statements that switch on and off, got "
        f"{str(value)[:60]!r}"
    )


def _direction(value: ArrayLike | None, name: str) -> Direction | None:
    if value is None:
        return None
    x, y, z = floats(value, name, (3,)).tolist()
    if not x * x + y * y + z * z > 0:
        raise InputError(f"{name}: expected a direction, got a vector of length 0")
    return x, y, z


def content_of(path: Path, expected: str) -> bytes:
    """Return the bytes of a file, or raise InputError with the `expected` kind of file."""
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise InputError(f"{path}: is not a regular file; expected {expected}")
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


def _read_file(
    kind: str, path: Path, content: bytes, options: _ReadOptions, progress: Progress
) -> Part:
    """Return the part; each reader is loaded when it is needed, as OCCT takes over a second."""
    progress(f"reading {path.name}", 0, 0)
    unit, gap = options.unit, options.gap
    axis = None if options.axis is None else np.array(options.axis)
    try:
        if kind == "table":
            from kerfpath.cad.table import read_table

            return read_table(
                path, content, unit, gap, axis=axis, columns=options.columns, sort=options.sort
            )
        if kind == "tool path":
            from kerfpath.cad.apt import read_apt

            return read_apt(path, content, unit, gap, axis)
        if kind == "NC program":
            from kerfpath.cad.nc import read_nc

            return read_nc(path, content, unit, gap, axis, options.machine)
        if kind == "robot program":
            from kerfpath.cad.programs import read_program

            if axis is not None:
                raise InputError("axis: expected a drawing of lines, got a program of a robot")
            return read_program(path, content, unit, gap, options.beam)
        if kind == "mesh":
            from kerfpath.cad.meshes import read_mesh

            if axis is not None:
                raise InputError("axis: expected a drawing of lines, got a mesh")
            normal = None if options.section is None else np.array(options.section)
            towards = None if options.outer_towards is None else np.array(options.outer_towards)
            return read_mesh(path, unit, gap, normal, options.heights, towards)
        require_extra("cad", f"reading {kind}")
        if kind == "DXF":
            from kerfpath.cad.dxf import read_dxf

            with uncollected():
                return read_dxf(path, content, unit, gap, axis, options.drawing_frame)
        return _translated(kind, path, content, options, progress)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _translated(
    kind: str, path: Path, content: bytes, options: _ReadOptions, progress: Progress
) -> Part:
    """Return the part in a STEP or IGES file, translated in another process: OCCT may crash."""
    stand_by()
    from kerfpath.cad.iges import read_iges
    from kerfpath.cad.shape import occt
    from kerfpath.cad.step import read_step, require_grammar

    unit, gap = options.unit, options.gap
    key = (kind, sha256(content).digest(), unit, gap, options.outer_towards, options.axis)
    part = _cache.pop(key, None)
    if part is None:
        translate = read_step if kind == "STEP" else read_iges
        try:
            drawn = call_apart(translate, path.absolute(), unit, gap, size=len(content))
            with occt(), uncollected():
                part = _part_of(
                    path, drawn, options, _patient(progress, len(content)), size=len(content)
                )
        except InputError:
            if kind == "STEP" and b"END-ISO-10303-21;" in content:
                require_grammar(content)  # a fault of the grammar explains the failure better
            raise
    _cache[key] = part
    while len(_cache) > CACHED:
        _cache.pop(next(iter(_cache)), None)
    return replace(part, path=path)


def _read_shape(shape: object, options: _ReadOptions, progress: Progress) -> Part:
    """Return the part in a shape in memory."""
    require_extra("cad", "shape: reading it")
    from kerfpath.cad.in_memory import shape_in_memory
    from kerfpath.cad.shape import occt

    try:
        with occt(), uncollected():
            drawn = shape_in_memory(shape, options.unit, options.gap)
            if not drawn.faces and options.axis is None:
                raise InputError(
                    "it has edges but no face; give the tool axis, for example axis=(0, 0, -1)"
                )
            return _part_of(Path("shape"), drawn, options, progress)
    except InputError as error:
        raise InputError(f"shape: {error}") from None


def _patient(progress: Progress, size: int) -> Progress:
    """Return a `Progress` that raises InputError after the time allowed for a file of `size`."""
    seconds = seconds_for(size)
    until = thread_time() + seconds

    def show(what: str, done: int, total: int) -> None:
        progress(what, done, total)
        if thread_time() > until:
            raise too_slow(seconds)

    return show


def _part_of(
    path: Path,
    drawn: NamedShape,
    options: _ReadOptions,
    progress: Progress,
    size: int | None = None,
) -> Part:
    from kerfpath.cad.from_shape import part_of_shape

    return part_of_shape(
        path, drawn, options.gap, outer_towards=options.outer_towards,
        axis=None if options.axis is None else np.array(options.axis), progress=progress, size=size,
    )  # fmt: skip


_cache: dict[tuple[object, ...], Part] = {}
_EXPECTED = f"a drawing ({', '.join(SUFFIXES)})"


# -----------------------------------------------------------------------------
# Read tables of measured points: points of the part as measured in the robot base.

SIDES = ("nominal", "measured")
COLUMNS = tuple(f"{side}_{axis}" for side in SIDES for axis in "xyz")
EXPECTED = (
    "nominal_x_mm nominal_y_mm nominal_z_mm (in the part) and measured_x_mm measured_y_mm "
    "measured_z_mm (in the robot base)"
)


def read_measured(path: str | Path) -> tuple[Array, Array]:
    """Return the points of a table: nominal (K, 3) m in the part, measured (K, 3) m in the base.

    The first line names the columns with their unit, such as ``nominal_x_mm``, in any order; a
    column ``point`` may hold names. Delimiters, decimal commas and comments are as in tables of
    contours.

    Raises
    ------
    InputError
        No such file, other columns, no unit, or a cell that is not a number (the message has line
        and column).
    """
    path = Path(path)
    content = content_of(path, "a table of measured points")
    try:
        table = cells_of(content, EXPECTED)
        columns, mm = _header(table)
        table = table.without_header()
        table.require_width(len(columns))
        values = np.array(
            [
                [table.number(k, columns.index(name), name) * mm[name] for name in COLUMNS]
                for k in range(len(table.rows))
            ]
        ).reshape(-1, 6)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return freeze(values[:, :3] * MM), freeze(values[:, 3:] * MM)


def _header(table: TableCells) -> tuple[list[str], dict[str, float]]:
    """Return the names of the columns without units, and the unit of each in mm."""
    columns, mm = [], {}
    for cell in table.rows[0]:
        name = lower(cell).strip("\"' ")
        parts = re.fullmatch(r"(\w+_[xyz])\s*[_\[(]\s*([a-z]+)\s*[\])]?", name, re.ASCII)
        if parts and parts[1] in COLUMNS and parts[2] in UNITS_MM:
            name, mm[parts[1]] = parts[1], UNITS_MM[parts[2]]
        elif name != "point":
            raise InputError(f"line {table.lines[0]}: expected columns {EXPECTED}, got {cell!r}")
        columns.append(name)
    if sorted(set(columns) - {"point"}) != sorted(COLUMNS) or len(set(columns)) < len(columns):
        raise InputError(f"line {table.lines[0]}: expected each of the columns {EXPECTED} once")
    return columns, mm
