"""A planner for COMPAS FAB, in its own Python or over a pipe: see `kerfpath.compas.client`."""

from kerfpath.extras import require_extra

require_extra("compas", "the planner of COMPAS FAB")

from kerfpath.compas.client import KerfpathClient as KerfpathClient
from kerfpath.compas.client import KerfpathPlanner as KerfpathPlanner
from kerfpath.compas.client import Process as Process
