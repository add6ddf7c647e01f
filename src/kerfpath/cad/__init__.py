"""Read drawings: their named loops, and each loop as a contour.

Names are loaded on first use, as the process that translates a file needs none of them.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kerfpath.cad._departure import Departure as Departure
    from kerfpath.cad._departure import departure_from as departure_from
    from kerfpath.cad._left_out import LeftOut as LeftOut
    from kerfpath.cad._measured import read_measured as read_measured
    from kerfpath.cad._part import Loop as Loop
    from kerfpath.cad._part import Part as Part
    from kerfpath.cad._read import read as read
    from kerfpath.cad._units import GAP as GAP
    from kerfpath.cad._units import UNITS_MM as UNITS_MM

_HOME = {
    "Departure": "_departure",
    "GAP": "_units",
    "LeftOut": "_left_out",
    "Loop": "_part",
    "Part": "_part",
    "UNITS_MM": "_units",
    "departure_from": "_departure",
    "read": "_read",
    "read_measured": "_measured",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'kerfpath.cad' has no attribute {name!r}")
    value = getattr(import_module(f"kerfpath.cad.{_HOME[name]}"), name)
    globals()[name] = value
    return value
