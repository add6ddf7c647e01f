"""The Pareto set: plans of one contour of which none is better than another in every criterion."""

from kerfpath.front._adaptive import reach_of as reach_of
from kerfpath.front._attempt import Attempts as Attempts
from kerfpath.front._collection import AHEAD as AHEAD
from kerfpath.front._collection import Collection as Collection
from kerfpath.front._collection import Reached as Reached
from kerfpath.front._collection import Search as Search
from kerfpath.front._criteria import Judge as Judge
from kerfpath.front._criteria import judge_of as judge_of
from kerfpath.front._pareto import pareto as pareto
from kerfpath.front._runs import Run as Run
from kerfpath.front._runs import RunData as RunData
from kerfpath.front._set import Front as Front
from kerfpath.front._set import ParetoSet as ParetoSet
from kerfpath.front._set import hypervolume as hypervolume
