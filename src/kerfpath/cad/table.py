"""Read tables of points and axes (CSV, TSV and similar), with or without a header."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import (
    breadth_first_order,
    connected_components,
    minimum_spanning_tree,
)
from scipy.spatial import cKDTree
from scipy.spatial.distance import pdist, squareform
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.cad.build import kind_of_points, loop_of, part_without_faces, trace_of_points
from kerfpath.cad.curves import vector_area
from kerfpath.cad.part import Part
from kerfpath.cad.units import GIVE_AXIS, LARGEST, MM, NO_UNIT, UNITS_MM
from kerfpath.errors import InputError
from kerfpath.text import lower, number, text_lines

# -----------------------------------------------------------------------------
# Read tables from text: delimiters, comments, decimal commas and numbers.

COMMENTS = ("#", "%", "//")
BLANK = " \t"


@dataclass(frozen=True, slots=True, kw_only=True)
class TableCells:
    """The cells of a table, and the line number of each row."""

    lines: Sequence[int]
    rows: Sequence[Sequence[str]]
    has_decimal_comma: bool

    __repr__ = short_repr

    def is_numbers(self, row: int) -> bool:
        """Return whether all cells of a row are numbers, so that it is no header."""
        try:
            for cell in self.rows[row]:
                _number(cell, self.has_decimal_comma)
        except ValueError:
            return False
        return True

    def is_number(self, row: int, column: int) -> bool:
        """Return whether a cell is a number."""
        try:
            _number(self.rows[row][column], self.has_decimal_comma)
        except (ValueError, IndexError):
            return False
        return True

    def without_header(self) -> TableCells:
        """Return the table without its first row."""
        return TableCells(
            lines=self.lines[1:], rows=self.rows[1:], has_decimal_comma=self.has_decimal_comma
        )

    def require_width(self, columns: int) -> None:
        """Raise InputError if a row has another number of cells."""
        for line, row in zip(self.lines, self.rows, strict=True):
            if len(row) != columns:
                raise InputError(f"line {line}: expected {columns} columns, got {len(row)}")

    def number(self, row: int, column: int, name: str) -> float:
        """Return a cell as a finite number; `name` is the name of its column.

        Raises
        ------
        InputError
            A cell that is not a finite number (the message has line and column).
        """
        where, cell = f"line {self.lines[row]}, column {name}", self.rows[row][column]
        try:
            value = _number(cell, self.has_decimal_comma)
        except ValueError:
            raise InputError(f"{where}: expected a number, got {cell[:40]!r}") from None
        if not np.isfinite(value):
            raise InputError(f"{where}: expected a finite number, got {cell[:40]!r}")
        return value


def cells_of(content: bytes, expected: str) -> TableCells:
    """Return the cells of a table, split at the delimiter of its first line.

    Raises
    ------
    InputError
        Not text, no rows (the message lists the `expected` columns), quotes that span lines.
    """
    numbered = [
        (number, line)
        for number, line in enumerate(text_lines(_text(content)), start=1)
        if line.strip(BLANK) and not line.lstrip(BLANK).startswith(COMMENTS)
    ]
    if not numbered:
        raise InputError(f"holds no rows; expected columns {expected}")
    delimiter = next((d for d in (";", "\t", "|", ",") if d in numbered[0][1]), None)
    lines = [number for number, _ in numbered]
    if delimiter is None:
        rows = [re.split(f"[{BLANK}]+", line.strip(BLANK)) for _, line in numbered]
    else:
        try:
            rows = [
                [cell.strip(BLANK) for cell in row]
                for row in csv.reader((line for _, line in numbered), delimiter=delimiter)
            ]
        except csv.Error as error:
            raise InputError(f"cannot be split into columns ({error})") from None
        if len(rows) != len(lines):
            raise InputError("a quoted cell runs over several lines; remove its quotes")
    return TableCells(lines=lines, rows=rows, has_decimal_comma=delimiter in (";", "\t", "|"))


def _text(content: bytes) -> str:
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        return content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"line {line}: expected text in UTF-8; save the table as UTF-8") from None


def _number(cell: str, has_decimal_comma: bool) -> float:
    if has_decimal_comma and "," in cell:
        if "." in cell:
            raise ValueError(cell)
        cell = cell.replace(",", ".")
    return number(cell)


# -----------------------------------------------------------------------------
# Points and axes in the columns of a table.

POSITION = ("x", "y", "z")
NORMAL = ("nx", "ny", "nz")
AXIS = ("axis_x", "axis_y", "axis_z")
QUATERNION = ("qx", "qy", "qz", "qw")
ANGLES = {("a", "b", "c"): "ZYX", ("w", "p", "r"): "xyz"}
"""Angles (deg) of a pose, in the order of scipy: of KUKA, about z, y, x as turned, and of FANUC,
about x, y, z as fixed."""
NAME = "contour"
KNOWN = (
    *POSITION,
    *NORMAL,
    *AXIS,
    *QUATERNION,
    *(name for names in ANGLES for name in names),
    NAME,
)
AXES: tuple[tuple[str, ...], ...] = (AXIS, NORMAL, QUATERNION, *ANGLES)
"""Columns that give the tool axis, those that are used first first."""
UNUSED = "-"
"""Name of a column that is not used."""
UNIT = re.compile(r"[_\[( ]\s*([a-z]+)\s*[\])]?$")
"""The unit at the end of the name of a column."""
UNNAMED = {6: POSITION + NORMAL, 7: POSITION + QUATERNION}
"""Columns of a table without a header, by their number."""
EXPECTED = (
    "x y z, then nx ny nz (outward normal), axis_x axis_y axis_z (tool axis), or a pose, its z the "
    "tool axis: qx qy qz qw, or in deg a b c (KUKA) or w p r (FANUC)"
)
JUMP, FAR = 5.0, 20.0
"""Multiples of the usual step: after an empty line a longer one begins another run; without one it
is said that it is cut."""
UNSORTED, JUDGED = 3.0, 400
"""How much longer a line than the shortest tree that joins its points is said; of how many of
them."""
Ends = Literal["open", "closed"]
"""Whether points in no order are sorted along an open or a closed curve."""
MOST_SORTED = 100_000
"""Most points that are sorted."""
NEIGHBOURS = 12
"""Nearest points among which the shortest tree is sought."""
RING = 1.5
"""Multiple of the longest step that the ends of points along a closed curve are apart at most."""
CLEAR = 1.2
"""Multiple of the steps beside a point within which no point of another stretch may be."""
UNIT_QUATERNION = 1e-2
"""Largest deviation of a quaternion's length from one: rounded digits pass, other columns fail."""


def read_table(
    path: Path,
    content: bytes,
    unit: str | None,
    gap: float,
    *,
    axis: Array | None = None,
    columns: Mapping[str, str] | Sequence[str] | None = None,
    sort: Ends | None = None,
) -> Part:
    """Return the contours of a table of points, one per name in its column `contour`.

    `axis` (3,) is the tool axis of tables without columns for it; `columns` and `sort` are as in
    `cad.read`.

    Raises
    ------
    InputError
        Anything wrong with a row (its line is named), unknown columns, or no known unit.
    """
    names, declared, table = _rows(cells_of(content, EXPECTED), columns, axis is not None)
    if not (unit or declared):
        raise InputError(f"{NO_UNIT}, or x_mm in the header")
    notes = []
    if unit and declared and unit != declared:
        notes.append(f"unit {unit} as given; the header says {declared}")
    if unknown := [name for name in names if name not in (*KNOWN, UNUSED)]:
        notes.append(f"columns not used: {', '.join(unknown)}")
    points, normals = _numbers(names, table, UNITS_MM[unit or declared], axis)
    loops = []
    runs = _contours(names, table, points)
    if NAME not in names:
        notes += _notes_on_jumps(table, points, runs)
    for name, chosen in runs:
        lines = np.array(table.lines)[chosen]
        along, out = points[chosen], normals[chosen]
        if sort is not None:
            try:
                order = order_along(along, out, sort)
            except InputError as error:
                raise InputError(f"contour {name!r}: {error}") from None
            along, out, lines = along[order], out[order], lines[order]
            notes.append(f"contour {name!r}: points sorted along the cut, {sort}")
        trace, repaired = trace_of_points(along, out, lines, gap / MM)
        notes += [f"contour {name!r}: {what}" for what in repaired]
        if sort is None and (times := _times_as_long(along)) > UNSORTED:
            notes.append(
                f"contour {name!r}: the line through its points as listed is {times:.0f} times as "
                "long as the shortest that joins them all; if they are in no order, as probes "
                "may write them, give sort, open or closed (in [part] of a job, or --sort)"
            )
        kind = kind_of_points(trace)
        loops.append(
            loop_of(name=name, face=name, kind=kind, trace=trace, surface="points", gap=gap)
        )
    return part_without_faces(path, unit or declared, loops, gap=gap, notes=notes)


def _rows(
    table: TableCells, given: Mapping[str, str] | Sequence[str] | None, has_axis: bool
) -> tuple[tuple[str, ...], str, TableCells]:
    """Return the names of the columns, the unit that they state, and the rows under them."""
    if isinstance(given, Mapping):
        table = _renamed(table, given)
    elif given is not None:
        return _in_order(table, [str(name) for name in given], has_axis)
    columns, unit = _header(table, has_axis)
    if columns:
        table = table.without_header()
    elif (count := len(table.rows[0])) in UNNAMED or (has_axis and count == len(POSITION)):
        columns = UNNAMED.get(count, POSITION)
    elif count == len(POSITION):
        raise InputError(
            f"line {table.lines[0]}: has points without tool axes (x y z); {GIVE_AXIS}; and, as no "
            "header states it, the unit of its numbers: --unit mm"
        )
    else:
        raise InputError(
            f"line {table.lines[0]}: without a header expected 6 columns (x y z nx ny nz) or 7 "
            f"(x y z qx qy qz qw), got {count}; name them with columns"
        )
    if not table.rows:
        raise InputError("holds a header but no rows of points")
    table.require_width(len(columns))
    return columns, unit, table


def _renamed(table: TableCells, given: Mapping[str, str]) -> TableCells:
    """Return the table with the columns of its header renamed to the names known here."""
    header = [cell.strip("\"' ") for cell in table.rows[0]]
    chosen: dict[int, str] = {}
    for name, theirs in given.items():
        if name not in KNOWN:
            raise InputError(f"columns: expected names of {' '.join(KNOWN)}, got {name!r}")
        places = [k for k, cell in enumerate(header) if lower(cell) == lower(str(theirs))]
        if len(places) != 1:
            raise InputError(
                f"line {table.lines[0]}: expected one column {theirs!r} for {name}, "
                f"got {' '.join(header)}"
            )
        chosen[places[0]] = name
    row = []
    for k, cell in enumerate(header):
        unit = UNIT.search(lower(cell))
        if k not in chosen:
            row.append(f"{cell} ({UNUSED})" if lower(cell) in KNOWN else cell)
        elif unit and unit[1] in UNITS_MM and chosen[k] in POSITION:
            row.append(f"{chosen[k]}_{unit[1]}")
        else:
            row.append(chosen[k])
    return replace(table, rows=[row, *table.rows[1:]])


def _in_order(
    table: TableCells, names: Sequence[str], has_axis: bool
) -> tuple[tuple[str, ...], str, TableCells]:
    """Return the given names of the columns, no unit, and the rows without a header."""
    if unknown := [name for name in names if name not in (*KNOWN, UNUSED)]:
        raise InputError(
            f"columns: expected names of {' '.join(KNOWN)}, or {UNUSED}, got {unknown[0]!r}"
        )
    _require_columns([name for name in names if name != UNUSED], has_axis)
    if not table.is_number(0, names.index("x")):
        table = table.without_header()
    if not table.rows:
        raise InputError("holds a header but no rows of points")
    table.require_width(len(names))
    return tuple(names), "", table


def _require_columns(columns: Sequence[str], has_axis: bool) -> None:
    for name in columns:
        if columns.count(name) > 1:
            raise InputError(f"the header names the column {name!r} twice")
    has_axes = has_axis or any(set(axes) <= set(columns) for axes in AXES)
    if not (set(POSITION) <= set(columns) and has_axes):
        raise InputError(
            f"expected columns {EXPECTED}; got {' '.join(columns)}; say which they are, columns = "
            '{ x = "Pos X" } in [part] of a job or --columns "x=Pos X", and, if none is an axis, '
            f"{GIVE_AXIS}"
        )


def _header(table: TableCells, has_axis: bool) -> tuple[tuple[str, ...], str]:
    """Return the names of the columns and their unit, or nothing if the first row is numbers."""
    if table.is_numbers(0):
        return (), ""
    columns, units = [], []
    for cell in table.rows[0]:
        name = lower(cell).strip("\"' ")
        parts = re.fullmatch(r"([xyz])\s*[_\[( ]\s*([a-z]+)\s*[\])]?", name)
        angle = re.fullmatch(r"([abcwpr])\s*[_\[( ]\s*(?:deg|°)\s*[\])]?", name)
        columns.append(parts[1] if parts else angle[1] if angle else name)
        units += [parts[2]] if parts else []
    _require_columns(columns, has_axis)
    if len(set(units)) > 1 or (units and (len(units) != 3 or units[0] not in UNITS_MM)):
        raise InputError(
            f"the header's units are {', '.join(units)}; expected one for x, y and z, "
            f"of {', '.join(UNITS_MM)}"
        )
    return tuple(columns), units[0] if units else ""


def _numbers(
    columns: Sequence[str], table: TableCells, mm: float, axis: Array | None
) -> tuple[Array, Array]:
    """Return points (K, 3) mm and outward unit normals (K, 3), by `axis` if no columns have it."""
    at = {name: k for k, name in enumerate(columns)}
    given = [names for names in AXES if set(names) <= set(at)]
    axes = next((names for names in given if axis is None or names not in ANGLES), ())
    wanted = [at[name] for name in (*POSITION, *axes)]
    values = np.array(
        [
            [table.number(k, column, columns[column]) for column in wanted]
            for k in range(len(table.rows))
        ]
    )
    points, directions = values[:, :3] * mm, values[:, 3:]
    if (far := np.flatnonzero((np.abs(points) > LARGEST).any(axis=1))).size:
        raise InputError(
            f"line {table.lines[far[0]]}: a point further than {LARGEST / 1e6:g} km from the "
            "origin; check the unit"
        )
    if not axes:
        assert axis is not None
        return points, np.tile(-axis / np.linalg.norm(axis), (len(points), 1))
    if axes in ANGLES:
        poses = Rotation.from_euler(ANGLES[axes], directions, degrees=True)
        return points, -poses.as_matrix()[:, :, 2]
    size = np.abs(directions).max(axis=1)
    if (zero := np.flatnonzero(size == 0)).size:
        raise InputError(f"line {table.lines[zero[0]]}: {' '.join(axes)} are all 0; no direction")
    directions = directions / size[:, None]  # no square overflows
    length = np.linalg.norm(directions, axis=1)
    if axes == QUATERNION:
        if (off := np.flatnonzero(np.abs(length * size - 1) > UNIT_QUATERNION)).size:
            raise InputError(
                f"line {table.lines[off[0]]}: a quaternion of length "
                f"{(length * size)[off[0]]:.3g}, expected 1; check the columns"
            )
        x, y, z, w = (directions / length[:, None]).T
        z_axis = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], 1)
        return points, -z_axis
    return points, directions / (length if axes == NORMAL else -length)[:, None]


def _contours(columns: Sequence[str], table: TableCells, points: Array) -> list[tuple[str, slice]]:
    """Return each contour's name and rows."""
    return list(_by_name(columns.index(NAME), table) if NAME in columns else _runs(table, points))


def _runs(table: TableCells, points: Array) -> Iterator[tuple[str, slice]]:
    """Yield runs of points: an empty line or a comment before a jump begins another one.

    Where every line is followed by an empty one, these say nothing.
    """
    apart = np.diff(table.lines) > 1
    ends = np.flatnonzero(apart & (_steps(points) > JUMP)) + 1
    if not ends.size or 2 * apart.sum() > len(apart):
        yield NAME, slice(len(table.rows))
        return
    borders = [0, *ends.tolist(), len(points)]
    for k, (first, last) in enumerate(pairwise(borders), start=1):
        yield f"run{k}", slice(first, last)


def _steps(points: Array) -> Array:
    """Return the steps (K-1,) from point to point, as multiples of their median."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    usual = float(np.median(steps)) if len(steps) else 0.0
    return steps / usual if usual > 0 else np.zeros(len(steps))


def order_along(points: Array, normals: Array, ends: Ends) -> Ints:
    """Return the order of points (K, 3) along the curve that they lie on, if it is clear.

    The shortest tree that joins points which are close enough along a curve is the curve itself. An
    open curve begins at the end that is listed first; a closed one at the first point, runs
    counter-clockwise about the mean normal, and repeats its first point.

    Raises
    ------
    InputError
        Fewer than four points, a branch, two stretches as close as neighbours, ends that are close
        (open) or far apart (closed).
    """
    kept = np.sort(np.unique(points, axis=0, return_index=True)[1])
    count = len(kept)
    if count < 4:
        raise InputError(f"sort: expected at least 4 points apart, got {count}")
    if count > MOST_SORTED:
        raise InputError(f"sort: expected at most {MOST_SORTED} points, got {count}")
    at = points[kept]
    apart, other = map(np.asarray, cKDTree(at).query(at, k=min(NEIGHBOURS, count)))
    one = np.repeat(np.arange(count), other.shape[1])
    joined = csr_array((apart.ravel(), (one, other.ravel())), shape=(count, count))
    tree = minimum_spanning_tree(joined)
    tree = tree + tree.T
    parts = connected_components(tree, directed=False)
    if parts[0] > 1:
        place = _at(at[np.flatnonzero(parts[1] == parts[1][-1])[0]])
        raise InputError(f"sort: a group of points at {place} lies apart; name it as a contour")
    degree = np.diff(tree.indptr)
    if (bad := np.flatnonzero(degree > 2)).size:
        raise InputError(
            f"sort: the points branch at {_at(at[bad[0]])}, so their order is not clear; measure "
            "more points there, or sort them"
        )
    tip = int(np.flatnonzero(degree == 1)[0])
    order: Ints = np.asarray(
        breadth_first_order(tree, tip, directed=False, return_predecessors=False), dtype=np.int64
    )
    line = at[order]
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    gap = float(np.linalg.norm(line[0] - line[-1]))
    is_ring = gap <= RING * steps.max()
    if is_ring != (ends == "closed"):
        said = "close as neighbours" if is_ring else "far apart"
        raise InputError(
            f"sort: the ends of the curve, {_at(line[0])} and {_at(line[-1])}, are {gap:.4g} mm "
            f'apart, as {said}; write sort = "{"closed" if is_ring else "open"}", or measure more '
            "points between them"
        )
    around = np.concatenate([[gap if is_ring else 0.0], steps, [gap if is_ring else 0.0]])
    reach = CLEAR * np.maximum(around[:-1], around[1:])
    i, j = cKDTree(line).query_pairs(float(reach.max()), output_type="ndarray").T
    between = np.abs(i - j)
    if is_ring:
        between = np.minimum(between, count - between)
    close = np.linalg.norm(line[i] - line[j], axis=1) <= np.maximum(reach[i], reach[j])
    if (bad := np.flatnonzero(close & (between > 2))).size:
        raise InputError(
            f"sort: two stretches are as close as neighbours at {_at(line[i[bad[0]]])}, so the "
            "order of the points is not clear; measure more points there, or sort them"
        )
    order = np.asarray(kept[order], dtype=np.int64)
    if is_ring:
        order = np.roll(order, -int(np.argmin(order)))
        if vector_area(points[order]) @ normals.mean(axis=0) < 0:
            order = np.roll(order[::-1], 1)
        order = np.append(order, order[0])
    elif order[0] > order[-1]:
        order = order[::-1]
    return order


def _at(point: Array) -> str:
    return ", ".join(f"{x:.6g}" for x in point) + " mm"


def _times_as_long(points: Array) -> float:
    """Return the length of the line through points (K, 3) as a multiple of their shortest tree.

    Points along a line keep their order if only some of them are taken.
    """
    some = np.unique(points[:: -(-len(points) // JUDGED)], axis=0, return_index=True)[1]
    along = points[:: -(-len(points) // JUDGED)][np.sort(some)]
    tree = float(minimum_spanning_tree(squareform(pdist(along))).sum())
    return float(np.linalg.norm(np.diff(along, axis=0), axis=1).sum()) / tree if tree > 0 else 1.0


def _notes_on_jumps(
    table: TableCells, points: Array, runs: Sequence[tuple[str, slice]]
) -> list[str]:
    """Return what is said of runs, and of the longest step far beyond the usual inside one."""
    notes = []
    if len(runs) > 1:
        notes.append(f"{len(runs)} runs of points, separated by empty lines or comments")
    steps = _steps(points)
    steps[[chosen.stop - 1 for _, chosen in runs[:-1]]] = 0.0
    far = int(np.argmax(steps)) if len(steps) else 0
    if len(steps) and steps[far] > FAR:
        size = float(np.linalg.norm(points[far + 1] - points[far]))
        notes.append(
            f"line {table.lines[far + 1]}: {size:.4g} mm from the point before, {steps[far]:.0f} "
            "times the usual step, is cut; if another contour begins there, put an empty line "
            "before it, or name contours in a column contour"
        )
    return notes


def _by_name(column: int, table: TableCells) -> Iterator[tuple[str, slice]]:
    """Yield the contours that a column names."""
    first, seen = 0, set()
    for name, group in groupby(row[column] for row in table.rows):
        last = first + len(list(group))
        if not name or name in seen:
            what = f"rows of contour {name!r} are separated" if name else "no name of a contour"
            raise InputError(f"line {table.lines[first]}: {what}; put its rows together")
        seen.add(name)
        yield name, slice(first, last)
        first = last
