"""CAD in: what a STEP file holds, its loops by name, and each loop as a contour."""

from kerfpath.cad._part import Loop, Part
from kerfpath.cad._step import read_step

__all__ = ["Loop", "Part", "read_step"]
