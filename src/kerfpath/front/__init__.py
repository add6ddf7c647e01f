"""The Pareto front: plans of one contour that no other plan found beats in all criteria."""

from kerfpath.front.criteria import CRITERIA as CRITERIA
from kerfpath.front.criteria import JOINT_CRITERIA as JOINT_CRITERIA
from kerfpath.front.criteria import criteria_named as criteria_named
from kerfpath.front.problem import CourseData as CourseData
from kerfpath.front.problem import Criterion as Criterion
from kerfpath.front.problem import Evaluation as Evaluation
from kerfpath.front.problem import ParetoProblem as ParetoProblem
from kerfpath.front.problem import Subproblem as Subproblem
from kerfpath.front.problem import SubproblemData as SubproblemData
from kerfpath.front.problem import course_data as course_data
from kerfpath.front.problem import course_from as course_from
from kerfpath.front.problem import follows_courses as follows_courses
from kerfpath.front.problem import graph_of_runs as graph_of_runs
from kerfpath.front.problem import plan_run as plan_run
from kerfpath.front.search import AHEAD as AHEAD
from kerfpath.front.search import Front as Front
from kerfpath.front.search import FrontSearch as FrontSearch
from kerfpath.front.search import ParetoSet as ParetoSet
from kerfpath.front.search import SearchKind as SearchKind
from kerfpath.front.search import hypervolume as hypervolume
from kerfpath.front.search import pareto as pareto
