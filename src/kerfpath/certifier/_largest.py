"""The bound of the objective "max" (15): what the costliest step of any motion costs at least.

A motion that costs at most c has no step that costs more. That no motion has such steps only is
proved as for any other limit (`_nopath`), about the costliest step of the plan; the largest c for
which it is proved bounds the cost from below.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kerfpath._arrays import Array
from kerfpath.certifier._nopath import MotionTest
from kerfpath.certifier._steps import Steps
from kerfpath.kernels.metric import rho
from kerfpath.plans import Plan
from kerfpath.progress import Progress

__all__ = ["largest_step_bound"]

ABOUT = 12
"""Nodes on either side of the costliest step that are looked at: of more, cells stay too coarse."""
CLOSE = 0.5
"""Share of the gap asked for to which the largest cost that is proved is found."""
SHARES = (0.5, 0.75, 0.9, 0.95)
"""Shares of the cost that are tried upwards where that of the gap stays undecided: what is far too
little is quickly proved to be."""
FAILED, MOST_PAIRS = 3, 3_000_000
"""Costs that may stay undecided before it is left at what is proved; and pairs of steps after which
one does."""
ROUNDED = 1e-15
"""Share of a quotient that rounding may cost."""


def largest_step_bound(
    plan: Plan, steps: Steps, gap: float, spent: Callable[[], bool], progress: Progress
) -> tuple[float, int]:
    """Return a lower bound on the costliest step of any motion along a contour, and the tests.

    Parameters
    ----------
    plan : Plan
        With the objective "max".
    steps : Steps
        Bounds (5) and (6), weights and metric.
    gap : float
        (cost - bound) / cost that is enough.
    spent : callable
        Whether no further test is to be begun.
    progress : Progress
    """
    middle = int(np.argmax([rho(u, steps.weight, steps.metric) for u in plan.increments]))
    part = slice(max(middle - ABOUT, 0), middle + ABOUT + 2)
    test = MotionTest(plan.robot, plan.frames[part], plan.T_flange_tip, plan.settings.postures)
    low, high, cost = 0.0, plan.cost, (1 - gap) * plan.cost
    ladder = iter(share * plan.cost for share in SHARES if share < 1 - gap)
    tests = failed = 0
    while not spent() and failed < FAILED and high - low > CLOSE * gap * plan.cost:
        progress("certificate", int(1000 * low / plan.cost), 1000)
        tests += 1
        if test.closed_to(_capped(steps, cost), most_pairs=MOST_PAIRS) is not None:
            low = cost
            if tests == 1:
                break
        else:
            high, failed = cost, failed + 1
        climbed = next(ladder, high) if failed <= 1 else high
        cost = climbed if climbed < high else (low + high) / 2
    return low, tests


def _capped(steps: Steps, cost: float) -> Steps:
    """Return the steps that cost at most so much: no joint goes farther than that alone lets it."""
    alone: Array = np.divide(
        cost, steps.weight, out=np.full_like(steps.weight, np.inf), where=steps.weight > 0
    )
    farthest = np.minimum(steps.velocity, alone * (1 + ROUNDED))
    return replace(steps, velocity=farthest, most=cost)
