"""Plan: the motion of the robot at every node, its criteria, and what is proved about it."""

import warnings

from kerfpath.plans.plan import OF_BOUND as OF_BOUND
from kerfpath.plans.plan import PLACING as PLACING
from kerfpath.plans.plan import STILL as STILL
from kerfpath.plans.plan import Criteria as Criteria
from kerfpath.plans.plan import Explored as Explored
from kerfpath.plans.plan import Feed as Feed
from kerfpath.plans.plan import JointMotion as JointMotion
from kerfpath.plans.plan import Plan as Plan
from kerfpath.plans.plan import Proof as Proof
from kerfpath.plans.plan import TransferMove as TransferMove
from kerfpath.plans.plan import directions as directions
from kerfpath.plans.plan import has_room as has_room
from kerfpath.plans.plan import joint_columns as joint_columns
from kerfpath.plans.plan import node_rates as node_rates
from kerfpath.plans.plan import on_turns as on_turns
from kerfpath.plans.plan import path_cost as path_cost
from kerfpath.plans.plan import reversals as reversals


def __getattr__(name: str) -> object:
    if name != "Settings":
        raise AttributeError(f"module 'kerfpath.plans' has no attribute {name!r}")
    from kerfpath.options import PlanOptions

    warnings.warn(
        "kerfpath.plans.Settings is deprecated; use kerfpath.PlanOptions",
        DeprecationWarning,
        stacklevel=2,
    )
    return PlanOptions
