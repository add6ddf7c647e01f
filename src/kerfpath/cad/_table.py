"""Read tables of points and axes: CSV, TSV and the like, with or without a header."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from kerfpath._arrays import Array, freeze
from kerfpath.cad._part import Kind, Part, loop_of
from kerfpath.cad._sample import Points
from kerfpath.cad._units import LARGEST, MM, UNITS_MM
from kerfpath.errors import InputError

__all__ = ["read_table"]

POSITION = ("x", "y", "z")
NORMAL = ("nx", "ny", "nz")
AXIS = ("axis_x", "axis_y", "axis_z")
QUATERNION = ("qx", "qy", "qz", "qw")
NAME = "contour"
UNNAMED = {6: POSITION + NORMAL, 7: POSITION + QUATERNION}
"""What the columns are where no header says, by their number."""
EXPECTED = (
    "x y z, then nx ny nz (outward normal), axis_x axis_y axis_z (tool axis) or qx qy qz qw (pose, "
    "its z the tool axis)"
)
COMMENTS = ("#", "%", "//")
REPEATED = 1e-6
"""Points that follow each other closer than this, mm, are one: they leave no direction."""
TURNED = float(np.radians(2.0))
"""Axes at one point that differ by less are one axis."""
FLIP = float(np.radians(90.0))
"""An axis that turns by more from one point to the next has flipped."""
UNIT_QUATERNION = 1e-2
"""How far a quaternion's length may be from one: rounded digits pass, other columns fail."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rows:
    """The cells of a table, the line each row stands in, and what the columns are."""

    columns: tuple[str, ...]
    unit: str
    lines: Sequence[int]
    cells: Sequence[Sequence[str]]
    has_decimal_comma: bool


def read_table(path: Path, content: bytes, unit: str | None, gap: float) -> Part:
    """Return the contours of a table of points, one per name in its column `contour`.

    Raises
    ------
    InputError
        Anything wrong with a row (its line is named), columns that are not known, no unit known.
    """
    try:
        rows = _rows(_text(content))
        if not (unit or rows.unit):
            raise InputError(
                f"states no length unit; say it with unit= one of {', '.join(UNITS_MM)}, "
                "or in the header, as x_mm"
            )
        notes = []
        if unit and rows.unit and unit != rows.unit:
            notes.append(f"unit {unit} as asked; the header says {rows.unit}")
        known = (*POSITION, *NORMAL, *AXIS, *QUATERNION, NAME)
        if unknown := [name for name in rows.columns if name not in known]:
            notes.append(f"columns not used: {', '.join(unknown)}")
        points, normals = _numbers(rows, UNITS_MM[unit or rows.unit])
        loops = []
        for name, chosen in _contours(rows):
            lines = np.array(rows.lines)[chosen]
            trace, told = _trace(points[chosen], normals[chosen], lines, gap / MM)
            notes += [f"contour {name!r}: {what}" for what in told]
            kind = _kind(trace)
            loops.append(
                loop_of(name=name, face=name, kind=kind, trace=trace, surface="points", gap=gap)
            )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    boxes = np.array([loop.bounding_box for loop in loops])
    return Part(
        path=path,
        unit=unit or rows.unit,
        bounding_box=freeze(np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])),
        faces=0,
        loops=tuple(loops),
        notes=tuple(notes),
        _gap=gap,
    )


def _text(content: bytes) -> str:
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        return content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"line {line}: expected text in UTF-8; save the table as UTF-8") from None


def _rows(text: str) -> _Rows:
    """Return the cells of a table, split by what its first line is split by."""
    numbered = [
        (number, line)
        for number, line in enumerate(re.split(r"\r\n|\r|\n", text), start=1)
        if line.strip() and not line.lstrip().startswith(COMMENTS)
    ]
    if not numbered:
        raise InputError(f"holds no rows; expected columns {EXPECTED}")
    delimiter = next((d for d in (";", "\t", ",") if d in numbered[0][1]), None)
    has_decimal_comma = delimiter in (";", "\t")
    lines = [number for number, _ in numbered]
    if delimiter is None:
        cells = [line.split() for _, line in numbered]
    else:
        try:
            cells = [
                [cell.strip() for cell in row]
                for row in csv.reader((line for _, line in numbered), delimiter=delimiter)
            ]
        except csv.Error as error:
            raise InputError(f"cannot be split into columns ({error})") from None
        if len(cells) != len(lines):
            raise InputError("a quoted cell runs over several lines; remove its quotes")
    columns, unit = _header(cells[0], has_decimal_comma)
    if columns:
        cells, lines = cells[1:], lines[1:]
    elif (count := len(cells[0])) in UNNAMED:
        columns = UNNAMED[count]
    else:
        raise InputError(
            f"line {lines[0]}: without a header expected 6 columns (x y z nx ny nz) or 7 (x y z "
            f"qx qy qz qw), got {count}"
        )
    if not cells:
        raise InputError("holds a header but no rows of points")
    for number, row in zip(lines, cells, strict=True):
        if len(row) != len(columns):
            raise InputError(f"line {number}: expected {len(columns)} columns, got {len(row)}")
    return _Rows(
        columns=columns, unit=unit, lines=lines, cells=cells, has_decimal_comma=has_decimal_comma
    )


def _header(cells: Sequence[str], has_decimal_comma: bool) -> tuple[tuple[str, ...], str]:
    """Return the names of the columns and their unit, nothing if the cells are numbers."""
    if all(_is_number(cell, has_decimal_comma) for cell in cells):
        return (), ""
    columns, units = [], []
    for cell in cells:
        name = cell.lower().strip("\"' ")
        parts = re.fullmatch(r"([xyz])\s*[_\[( ]\s*([a-z]+)\s*[\])]?", name)
        columns.append(parts[1] if parts else name)
        units += [parts[2]] if parts else []
    for name in columns:
        if columns.count(name) > 1:
            raise InputError(f"the header names the column {name!r} twice")
    has_axes = any(set(axes) <= set(columns) for axes in (NORMAL, AXIS, QUATERNION))
    if not (set(POSITION) <= set(columns) and has_axes):
        raise InputError(f"expected columns {EXPECTED}; got {' '.join(columns)}")
    if len(set(units)) > 1 or (units and (len(units) != 3 or units[0] not in UNITS_MM)):
        raise InputError(
            f"the header's units are {', '.join(units)}; expected one for x, y and z, "
            f"of {', '.join(UNITS_MM)}"
        )
    return tuple(columns), units[0] if units else ""


def _is_number(cell: str, has_decimal_comma: bool) -> bool:
    try:
        _number(cell, has_decimal_comma)
    except ValueError:
        return False
    return True


def _number(cell: str, has_decimal_comma: bool) -> float:
    if has_decimal_comma and "," in cell:
        if "." in cell:
            raise ValueError(cell)
        cell = cell.replace(",", ".")
    if "_" in cell:  # which Python takes between digits
        raise ValueError(cell)
    return float(cell)


def _numbers(rows: _Rows, mm: float) -> tuple[Array, Array]:
    """Return points (K, 3) mm and outward unit normals (K, 3)."""
    at = {name: k for k, name in enumerate(rows.columns)}
    axes = next(a for a in (AXIS, NORMAL, QUATERNION) if set(a) <= set(at))
    wanted = [at[name] for name in (*POSITION, *axes)]
    values = np.empty((len(rows.cells), len(wanted)))
    for k, (line, row) in enumerate(zip(rows.lines, rows.cells, strict=True)):
        for j, column in enumerate(wanted):
            where = f"line {line}, column {rows.columns[column]}"
            try:
                values[k, j] = _number(row[column], rows.has_decimal_comma)
            except ValueError:
                raise InputError(f"{where}: expected a number, got {row[column][:40]!r}") from None
            if not np.isfinite(values[k, j]):
                raise InputError(f"{where}: expected a finite number, got {row[column]!r}")
    points, directions = values[:, :3] * mm, values[:, 3:]
    if (far := np.flatnonzero((np.abs(points) > LARGEST).any(axis=1))).size:
        raise InputError(
            f"line {rows.lines[far[0]]}: a point further than {LARGEST / 1e6:g} km from the "
            "origin; check the unit"
        )
    size = np.abs(directions).max(axis=1)
    if (zero := np.flatnonzero(size == 0)).size:
        raise InputError(f"line {rows.lines[zero[0]]}: {' '.join(axes)} are all 0; no direction")
    directions = directions / size[:, None]  # no square overflows
    length = np.linalg.norm(directions, axis=1)
    if axes == QUATERNION:
        if (off := np.flatnonzero(np.abs(length * size - 1) > UNIT_QUATERNION)).size:
            raise InputError(
                f"line {rows.lines[off[0]]}: a quaternion of length {(length * size)[off[0]]:.3g}, "
                "expected 1; check the columns"
            )
        x, y, z, w = (directions / length[:, None]).T
        z_axis = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], 1)
        return points, -z_axis
    return points, directions / (length if axes == NORMAL else -length)[:, None]


def _contours(rows: _Rows) -> Iterator[tuple[str, slice]]:
    """Yield each contour's name and rows."""
    if NAME not in rows.columns:
        yield NAME, slice(len(rows.cells))
        return
    column = rows.columns.index(NAME)
    first, seen = 0, set()
    for name, group in groupby(row[column] for row in rows.cells):
        last = first + len(list(group))
        if not name or name in seen:
            what = f"rows of contour {name!r} stand apart" if name else "no name of a contour"
            raise InputError(f"line {rows.lines[first]}: {what}; put its rows together")
        seen.add(name)
        yield name, slice(first, last)
        first = last


def _trace(points: Array, normals: Array, lines: Array, gap: float) -> tuple[Points, list[str]]:
    """Return the points without repeated ones, closed if they end where they began."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    turns = _angle(normals[:-1], normals[1:])
    told = []
    again = steps <= REPEATED
    if (bad := np.flatnonzero(again & (turns > TURNED))).size:
        raise InputError(
            f"line {lines[bad[0] + 1]}: the same point as line {lines[bad[0]]} with another axis; "
            "a contour cannot turn on the spot"
        )
    if again.any():
        first = int(np.argmax(again)) + 1
        told.append(f"{again.sum()} repeated points left out, the first in line {lines[first]}")
        keep = np.concatenate([[True], ~again])
        points, normals, lines = points[keep], normals[keep], lines[keep]
    if len(points) < 2:
        raise InputError(f"line {lines[0]}: a contour needs at least 2 points, got {len(points)}")
    for k, angle in enumerate(_angle(normals[:-1], normals[1:])):
        if angle > FLIP:
            raise InputError(
                f"line {lines[k + 1]}: the axis turns by {np.degrees(angle):.0f} deg from line "
                f"{lines[k]}; turn it round, or add points between"
            )
    is_closed = len(points) > 3 and float(np.linalg.norm(points[-1] - points[0])) <= gap
    if is_closed:
        if _angle(normals[-1:], normals[:1])[0] > TURNED:
            raise InputError(
                f"line {lines[-1]}: ends where it began, line {lines[0]}, but with another axis"
            )
        points, normals = points[:-1], normals[:-1]
    return Points(points=points, normals=normals, is_closed=is_closed), told


def _kind(trace: Points) -> Kind:
    """Return how a closed line runs about its mean normal: an outer one counter-clockwise."""
    if not trace.is_closed:
        return "open"
    area = np.cross(trace.points, np.roll(trace.points, -1, axis=0)).sum(axis=0)
    return "outer" if area @ trace.normals.mean(axis=0) >= 0 else "inner"


def _angle(a: Array, b: Array) -> Array:
    sine = np.linalg.norm(np.cross(a, b), axis=1)
    return np.asarray(np.arctan2(sine, (a * b).sum(axis=1)))
