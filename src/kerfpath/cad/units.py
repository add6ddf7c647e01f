"""Length units, and the tolerance within which ends of curves meet."""

from __future__ import annotations

from kerfpath.arrays import require_one_of

MM = 1e-3
"""OCCT and this package work in mm; every length that leaves the package is in m."""
GAP = 5e-5
"""Distance (m) between the ends of two curves that a loop bridges by default: half a kerf."""
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


def require_unit(unit: str | None) -> None:
    """Raise InputError for a unit that is not known; None passes."""
    if unit is not None:
        require_one_of(unit, "unit", UNITS_MM)
