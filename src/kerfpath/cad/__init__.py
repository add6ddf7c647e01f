"""CAD in: what a drawing holds, its loops by name, and each loop as a contour."""

from kerfpath.cad._departure import Departure, departure_from
from kerfpath.cad._measured import read_measured
from kerfpath.cad._part import Loop, Part
from kerfpath.cad._read import read

__all__ = ["Departure", "Loop", "Part", "departure_from", "read", "read_measured"]
