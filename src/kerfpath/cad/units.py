"""Suffixes of drawings, length units, and the tolerance within which ends of curves meet."""

from __future__ import annotations

import numpy as np

from kerfpath.arrays import Array, require_one_of

MM = 1e-3
"""OCCT and this package work in mm; every length that leaves the package is in m."""
GAP = 5e-5
"""Distance (m) between the ends of two curves that a loop bridges by default: half a kerf."""
EDGE_TURN = 1e-3
"""Distance (m) before and behind a sharp edge within which the beam turns by default: the thickness
of a thin sheet."""
LEAST_EDGE_TURN = 2e-4
"""m: no less, as a kerf is no narrower."""
LARGEST = 1e7
"""mm: no drawing reaches farther; larger numbers are damaged or have a wrong unit."""

UNITS_MM = {
    "um": 1e-3,
    "mm": 1.0,
    "cm": 10.0,
    "dm": 100.0,
    "m": 1000.0,
    "km": 1e6,
    "mil": 0.0254,
    "in": 25.4,
    "ft": 304.8,
}
"""Length units by the name that users give, in mm."""
GIVE_UNIT = (
    f"give that of its numbers ({', '.join(UNITS_MM)}): "
    'unit = "mm" in [part] of a job, or --unit mm'
)
"""What to do where a file states no length unit that is known."""
NO_UNIT = f"states no length unit; {GIVE_UNIT}"
"""What is said of a file without a unit."""
GIVE_AXIS = "give the tool axis: axis = [0, 0, -1] in [part] of a job, or --axis 0 0 -1"
"""What to do where a drawing of lines or points has no tool axis."""
SUFFIXES = {
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
    ".cnc": "NC program",
    ".gcode": "NC program",
    ".h": "NC program",
    ".mpf": "NC program",
    ".nc": "NC program",
    ".ngc": "NC program",
    ".spf": "NC program",
    ".tap": "NC program",
    ".ls": "robot program",
    ".mod": "robot program",
    ".modx": "robot program",
    ".script": "robot program",
    ".src": "robot program",
    ".stl": "mesh",
    ".obj": "mesh",
    ".ply": "mesh",
}
"""The kind of drawing by the suffix of its file, in lower case."""
LEAST_SIZE, MOST_SIZE = 0.005, 20.0
"""Sizes (m) between which a part may be; beyond them its unit is asked for."""
LIKELY = ("mm", "in", "m", "cm", "um")
"""Units that may be meant where that of a drawing is unlikely, the most usual first."""
LIKELY_SIZE = 0.02, 6.0
"""Sizes (m) of a part in a unit that may be meant."""


def require_unit(unit: str | None) -> None:
    """Raise InputError for a unit that is not known; None passes."""
    if unit is not None:
        require_one_of(unit, "unit", UNITS_MM)


def unit_question(unit: str, bounding_box: Array) -> str | None:
    """Return a question about the unit of a drawing, if its part is too large or small to be cut.

    Parameters
    ----------
    unit : str
        The unit of the numbers in the file, one of `UNITS_MM`.
    bounding_box : (2, 3) m
        Least and greatest coordinates in that unit.
    """
    size = float((bounding_box[1] - bounding_box[0]).max())
    if not size > 0 or LEAST_SIZE <= size <= MOST_SIZE:
        return None
    number = size / (UNITS_MM[unit] * MM)
    said = f"unit? the part is {_length(size)} long in the unit of the file ({unit})"
    for other in LIKELY:
        meant = number * UNITS_MM[other] * MM
        if other != unit and LIKELY_SIZE[0] <= meant <= LIKELY_SIZE[1]:
            said += f', and {_length(meant)} in {other}; set unit = "{other}" if that is meant'
            break
    else:
        said += "; set the unit that is meant"
    return f'{said}, or unit = "{unit}" if it is right (in [part] of a job, or --unit)'


def _length(value: float) -> str:
    """Return a length in the unit in which it is read easily."""
    return f"{value:g} m" if value >= 1 else f"{np.round(value * 1e3, 6):g} mm"
