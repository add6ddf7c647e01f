"""STL files, binary and text, as solids; the file does not say its unit, so the caller must."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from kerfpath._arrays import Array
from kerfpath.cell._mesh import Mesh, welded
from kerfpath.errors import InputError

__all__ = ["UNITS", "read_stl"]

UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
"""Metres in each unit."""
SAME = 1e-6
"""Vertices closer than this share of the body's size are one: single precision tells no more."""

_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def read_stl(path: str | Path, unit: str) -> Mesh:
    """Return the solid in an STL file whose numbers are in `unit`: mm, cm, m or in.

    Raises
    ------
    InputError
        An unknown unit, a file that cannot be read or is cut short, or what `Mesh` refuses.
    """
    path = Path(path)
    if unit not in UNITS:
        raise InputError(
            f"{path.name}: an STL file does not say its unit; expected one of "
            f"{', '.join(UNITS)}, got {unit!r}"
        )
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    corners = _corners(data, path.name) * UNITS[unit]
    if not len(corners):
        raise InputError(f"{path.name}: the mesh is empty, it holds no triangle")
    if not np.isfinite(corners).all():
        raise InputError(f"{path.name}: a vertex is not a finite number; export the mesh again")
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    vertices, triangles = welded(
        corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), SAME * size
    )
    return Mesh(vertices=vertices, triangles=triangles, name=path.name)


def _corners(data: bytes, name: str) -> Array:
    """Return the corners (F, 3, 3) of every triangle, in the file's own unit."""
    if len(data) >= 84:
        count = int.from_bytes(data[80:84], "little")
        if len(data) == 84 + count * _RECORD.itemsize:
            return np.frombuffer(data, _RECORD, count, 84)["corners"].astype(np.float64)
    if not data.lstrip()[:5].lower() == b"solid":
        raise InputError(f"{name}: neither a text STL nor a whole binary one; export it again")
    if b"endsolid" not in data.lower():
        raise InputError(f"{name}: the text STL is cut short, 'endsolid' is missing")
    try:
        numbers = np.array(_VERTEX.findall(data), dtype=np.float64)
    except ValueError:
        raise InputError(f"{name}: a vertex is not three numbers") from None
    if len(numbers) % 3:
        raise InputError(f"{name}: {len(numbers)} vertices do not make whole triangles")
    return numbers.reshape(-1, 3, 3)
