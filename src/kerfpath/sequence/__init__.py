"""A part with many contours: their order, the start of each, and the transfer moves."""

from kerfpath.sequence.kept import on_turns_of as on_turns_of
from kerfpath.sequence.kept import rejoined as rejoined
from kerfpath.sequence.order import Order as Order
from kerfpath.sequence.order import best_order as best_order
from kerfpath.sequence.order import inner_first as inner_first
from kerfpath.sequence.part import PartPlan as PartPlan
from kerfpath.sequence.part import PlannedCuts as PlannedCuts
from kerfpath.sequence.part import are_many as are_many
from kerfpath.sequence.part import cheapest_posture as cheapest_posture
from kerfpath.sequence.part import common_postures as common_postures
from kerfpath.sequence.part import distances_between as distances_between
from kerfpath.sequence.part import effort_for as effort_for
from kerfpath.sequence.part import longest_search as longest_search
from kerfpath.sequence.part import order_candidates as order_candidates
from kerfpath.sequence.part import order_plans as order_plans
from kerfpath.sequence.part import plan_part as plan_part
