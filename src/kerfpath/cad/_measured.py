"""Read tables of measured points: points of the part as measured in the robot base."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from kerfpath._arrays import Array, freeze
from kerfpath.cad._cells import TableCells, cells_of
from kerfpath.cad._read import content_of
from kerfpath.cad._units import MM, UNITS_MM
from kerfpath.errors import InputError

__all__ = ["read_measured"]

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
        name = cell.lower().strip("\"' ")
        parts = re.fullmatch(r"(\w+_[xyz])\s*[_\[(]\s*([a-z]+)\s*[\])]?", name)
        if parts and parts[1] in COLUMNS and parts[2] in UNITS_MM:
            name, mm[parts[1]] = parts[1], UNITS_MM[parts[2]]
        elif name != "point":
            raise InputError(f"line {table.lines[0]}: expected columns {EXPECTED}, got {cell!r}")
        columns.append(name)
    if sorted(set(columns) - {"point"}) != sorted(COLUMNS) or len(set(columns)) < len(columns):
        raise InputError(f"line {table.lines[0]}: expected each of the columns {EXPECTED} once")
    return columns, mm
