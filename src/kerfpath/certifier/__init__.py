"""Certificates: a proved lower bound on the cost of any motion along a contour."""

from kerfpath.certifier.bound import Certified as Certified
from kerfpath.certifier.bound import SharedWork as SharedWork
from kerfpath.certifier.bound import certify as certify
from kerfpath.certifier.cells import foldable as foldable
from kerfpath.certifier.infeasibility import MotionTest as MotionTest
from kerfpath.certifier.infeasibility import closed_node as closed_node
from kerfpath.certifier.stages import compile_bound as compile_bound
