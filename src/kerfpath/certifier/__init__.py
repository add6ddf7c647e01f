"""Certificates: a proved lower bound on the cost of any motion along a contour."""

from kerfpath.certifier._certify import Certified as Certified
from kerfpath.certifier._certify import certify as certify
from kerfpath.certifier._first_run import compile_bound as compile_bound
from kerfpath.certifier._nopath import MotionTest as MotionTest
from kerfpath.certifier._nopath import closed_node as closed_node
