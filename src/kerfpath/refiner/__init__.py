"""Refinement off the grid: gamma and external axes are continuous, postures and turns fixed."""

from kerfpath.refiner._rates import KeptShares as KeptShares
from kerfpath.refiner._refine import Binding as Binding
from kerfpath.refiner._refine import Refinement as Refinement
from kerfpath.refiner._refine import ease as ease
from kerfpath.refiner._refine import promise as promise
from kerfpath.refiner._refine import quicken as quicken
from kerfpath.refiner._refine import refine as refine
