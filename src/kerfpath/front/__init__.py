"""The Pareto set: plans of one contour of which none is better than another in every criterion."""

from kerfpath.front._pareto import Search as Search
from kerfpath.front._pareto import pareto as pareto
from kerfpath.front._runs import Run as Run
from kerfpath.front._set import ParetoSet as ParetoSet
from kerfpath.front._set import hypervolume as hypervolume
