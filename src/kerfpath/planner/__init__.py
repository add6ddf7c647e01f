"""plan(): graph, search and refinement; the fastest speed; relaxations where there is no path."""

from kerfpath.planner._best import best_motion as best_motion
from kerfpath.planner._certified import with_bound as with_bound
from kerfpath.planner._coarse import coarse_places as coarse_places
from kerfpath.planner._courses import external_course as external_course
from kerfpath.planner._draft import draft as draft
from kerfpath.planner._fastest import FastestSpeed as FastestSpeed
from kerfpath.planner._fastest import fastest_speed as fastest_speed
from kerfpath.planner._fastest import relaxations as relaxations
from kerfpath.planner._fastest import require_rates_alone as require_rates_alone
from kerfpath.planner._graph import layered_graph as layered_graph
from kerfpath.planner._graph import longest_step as longest_step
from kerfpath.planner._graph import node_interval as node_interval
from kerfpath.planner._graph import samples_of as samples_of
from kerfpath.planner._map import ClearanceMap as ClearanceMap
from kerfpath.planner._map import clearance_map as clearance_map
from kerfpath.planner._over_courses import graph_over_courses as graph_over_courses
from kerfpath.planner._pieces import plan_in_pieces as plan_in_pieces
from kerfpath.planner._plan import plan as plan
from kerfpath.planner._words import FINER as FINER
from kerfpath.planner._words import ON_THIS_GRID as ON_THIS_GRID
from kerfpath.planner._words import at_least as at_least
from kerfpath.planner._words import at_most as at_most
