"""The Pareto front: plans of one contour that no other plan found beats in all criteria."""

from kerfpath.front._criteria import CRITERIA as CRITERIA
from kerfpath.front._criteria import JOINT_CRITERIA as JOINT_CRITERIA
from kerfpath.front._criteria import criteria_named as criteria_named
from kerfpath.front._front import Front as Front
from kerfpath.front._front import ParetoSet as ParetoSet
from kerfpath.front._front import hypervolume as hypervolume
from kerfpath.front._pareto import pareto as pareto
from kerfpath.front._planned import follows_courses as follows_courses
from kerfpath.front._planned import graph_of_runs as graph_of_runs
from kerfpath.front._planned import plan_run as plan_run
from kerfpath.front._problem import Criterion as Criterion
from kerfpath.front._problem import Evaluation as Evaluation
from kerfpath.front._problem import ParetoProblem as ParetoProblem
from kerfpath.front._search import AHEAD as AHEAD
from kerfpath.front._search import FrontSearch as FrontSearch
from kerfpath.front._search import SearchKind as SearchKind
from kerfpath.front._subproblem import Subproblem as Subproblem
from kerfpath.front._subproblem import SubproblemData as SubproblemData
