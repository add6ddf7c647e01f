"""Read drawings: their named loops, and each loop as a contour.

Names are loaded on first use, as the process that translates a file needs none of them.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kerfpath.cad.departure import Departure as Departure
    from kerfpath.cad.departure import departure_from as departure_from
    from kerfpath.cad.left_out import LeftOut as LeftOut
    from kerfpath.cad.machine import Machine as Machine
    from kerfpath.cad.part import Loop as Loop
    from kerfpath.cad.part import Part as Part
    from kerfpath.cad.reading import read as read
    from kerfpath.cad.reading import read_measured as read_measured
    from kerfpath.cad.sharp_edges import EdgeTurn as EdgeTurn
    from kerfpath.cad.sides import Triangles as Triangles
    from kerfpath.cad.units import EDGE_TURN as EDGE_TURN
    from kerfpath.cad.units import GAP as GAP
    from kerfpath.cad.units import LEAST_EDGE_TURN as LEAST_EDGE_TURN
    from kerfpath.cad.units import SUFFIXES as SUFFIXES
    from kerfpath.cad.units import UNITS_MM as UNITS_MM
    from kerfpath.cad.units import unit_question as unit_question

_HOME = {
    "Departure": "departure",
    "EDGE_TURN": "units",
    "EdgeTurn": "sharp_edges",
    "GAP": "units",
    "LEAST_EDGE_TURN": "units",
    "LeftOut": "left_out",
    "Loop": "part",
    "Machine": "machine",
    "Part": "part",
    "SUFFIXES": "units",
    "Triangles": "sides",
    "UNITS_MM": "units",
    "departure_from": "departure",
    "read": "reading",
    "read_measured": "reading",
    "unit_question": "units",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'kerfpath.cad' has no attribute {name!r}")
    value = getattr(import_module(f"kerfpath.cad.{_HOME[name]}"), name)
    globals()[name] = value
    return value
