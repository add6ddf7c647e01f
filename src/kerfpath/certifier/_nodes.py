"""Nodes of a stage: those where the plan changes direction."""

from __future__ import annotations

from heapq import heapify, heappush, heapreplace
from itertools import pairwise

import numpy as np

from kerfpath._arrays import Ints
from kerfpath.kernels.metric import rho
from kerfpath.plans import Plan, path_cost
from kerfpath.search import METRIC_CODES

__all__ = ["between", "turning_nodes"]


def turning_nodes(plan: Plan, share: float, longest: int) -> Ints:
    """Return nodes (M,) such that straight steps between them cost about as much as the plan.

    Parameters
    ----------
    plan : Plan
    share : float
        Largest share of the plan's cost that the straight steps may lose.
    longest : int
        Most intervals that a step spans.
    """
    asked, dq = plan.settings, plan.increments
    metric, last = METRIC_CODES[asked.metric], len(dq)
    q = np.vstack([np.zeros(dq.shape[1]), np.cumsum(dq, axis=0)])
    each = [path_cost(step[None], asked.weights, asked.metric, "sum") for step in dq]
    upto = np.concatenate([[0.0], np.cumsum(each)])

    def lost(a: int, b: int) -> float:
        """Return the cost that a straight step from node a to b loses."""
        return float(upto[b] - upto[a] - rho(q[b] - q[a], asked.weights, metric))

    ends = np.unique(np.append(np.arange(0, last, longest), last)).tolist()
    steps = [(-lost(a, b), a, b) for a, b in pairwise(ends)]
    heapify(steps)
    left = -sum(step[0] for step in steps)
    while left > share * upto[-1]:
        loss, a, b = steps[0]
        if b - a < 2:
            break
        middle = max(range(a + 1, b), key=lambda m: (-lost(a, m) - lost(m, b), -abs(2 * m - a - b)))
        heapreplace(steps, (-lost(a, middle), a, middle))
        heappush(steps, (-lost(middle, b), middle, b))
        left += loss + lost(a, middle) + lost(middle, b)
    return np.array(sorted({node for _, a, b in steps for node in (a, b)}))


def between(nodes: Ints) -> Ints:
    """Return the nodes plus one in the middle of each step that spans several intervals."""
    return np.unique(np.append(nodes, (nodes[:-1] + nodes[1:]) // 2))
