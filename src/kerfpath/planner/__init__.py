"""plan(): graph, search and refinement; the fastest speed; relaxations where there is no path."""

from kerfpath.planner.coarse import coarse_places as coarse_places
from kerfpath.planner.external_motion import external_course as external_course
from kerfpath.planner.external_motion import graph_over_courses as graph_over_courses
from kerfpath.planner.fastest import FastestSpeed as FastestSpeed
from kerfpath.planner.fastest import fastest_speed as fastest_speed
from kerfpath.planner.fastest import relaxations as relaxations
from kerfpath.planner.fastest import require_rates_alone as require_rates_alone
from kerfpath.planner.folding import folds as folds
from kerfpath.planner.layers import ClearanceMap as ClearanceMap
from kerfpath.planner.layers import clearance_map as clearance_map
from kerfpath.planner.layers import layered_graph as layered_graph
from kerfpath.planner.layers import longest_step as longest_step
from kerfpath.planner.layers import node_interval as node_interval
from kerfpath.planner.layers import samples_of as samples_of
from kerfpath.planner.planning import best_motion as best_motion
from kerfpath.planner.planning import plan as plan
from kerfpath.planner.planning import plan_in_pieces as plan_in_pieces
from kerfpath.planner.planning import refined_motion as refined_motion
from kerfpath.planner.planning import with_bound as with_bound
from kerfpath.planner.refinements import warm_start as warm_start
from kerfpath.planner.statements import FINER as FINER
from kerfpath.planner.statements import ON_THIS_GRID as ON_THIS_GRID
from kerfpath.planner.statements import at_least as at_least
from kerfpath.planner.statements import at_most as at_most
from kerfpath.planner.turned import turned as turned
