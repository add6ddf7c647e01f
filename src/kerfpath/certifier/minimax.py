"""The bound of the objective "max" (15): the least cost of the costliest step of any motion.

A motion that costs at most c has no step that costs more. `MotionTest` proves, as for any other
limit, that no motion has only such steps, near the costliest step of the plan. The largest c for
which this is proved is a lower bound on the cost.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kerfpath.arrays import Array
from kerfpath.certifier.infeasibility import MotionTest
from kerfpath.certifier.stages import Steps
from kerfpath.effort import current_effort
from kerfpath.kernels.metric import rho
from kerfpath.plans import Plan
from kerfpath.progress import Progress

NODES_AROUND_STEP = 12
"""Nodes on either side of the costliest step that are tested: with more, cells stay too coarse."""
CLOSE = 0.5
"""Precision of the largest proved cost, as a share of the gap asked for."""
SHARES = (0.5, 0.75, 0.9, 0.95)
"""Shares of the cost that are tried in this order if that of the gap stays undecided: costs that
are far too low are quickly proved to be impossible."""
ROUNDED = 1e-15
"""Relative rounding error of a quotient."""


def largest_step_bound(
    plan: Plan, steps: Steps, gap: float, spent: Callable[[], bool], progress: Progress
) -> tuple[float, int]:
    """Return a lower bound on the costliest step of any motion, and the number of tests.

    Parameters
    ----------
    plan : Plan
        With the objective "max".
    steps : Steps
        Bounds (5) and (6), weights and metric.
    gap : float
        Value of (cost - bound) / cost at which it stops.
    spent : callable
        Returns whether the time is over, so that no further test begins.
    progress : Progress
    """
    middle = int(np.argmax([rho(u, steps.weight, steps.metric) for u in plan.increments]))
    part = slice(max(middle - NODES_AROUND_STEP, 0), middle + NODES_AROUND_STEP + 2)
    test = MotionTest(plan.robot, plan.frames[part], plan.T_flange_tip, plan.settings.postures)
    effort = current_effort()
    low, high, cost = 0.0, plan.cost, (1 - gap) * plan.cost
    ladder = iter(share * plan.cost for share in SHARES if share < 1 - gap)
    tests = failed = 0
    close = CLOSE * gap * plan.cost
    while not spent() and failed < effort.minimax_undecided and high - low > close:
        progress("certificate", int(1000 * low / plan.cost), 1000)
        tests += 1
        if test.closed_to(_capped(steps, cost), effort.minimax_pairs) is not None:
            low = cost
            if tests == 1:
                break
        else:
            high, failed = cost, failed + 1
        climbed = next(ladder, high) if failed <= 1 else high
        cost = climbed if climbed < high else (low + high) / 2
    return low, tests


def _capped(steps: Steps, cost: float) -> Steps:
    """Return the steps with a largest cost, which also bounds the increment of each joint."""
    alone: Array = np.divide(
        cost, steps.weight, out=np.full_like(steps.weight, np.inf), where=steps.weight > 0
    )
    farthest = np.minimum(steps.velocity, alone * (1 + ROUNDED))
    return replace(steps, velocity=farthest, most=cost)
