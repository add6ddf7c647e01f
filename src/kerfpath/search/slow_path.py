"""A path for speeds far below the one asked for, by first-order recursions alone.

The exact search for the least interval remembers edges. If nodes must be far apart in time, the
velocity limits leave nearly all edges and it takes minutes; a recursion over vertices does not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath.errors import NoFeasiblePath
from kerfpath.limits import AccelerationLimit, VelocityLimit
from kerfpath.losses import Loss, Reason
from kerfpath.search.least_interval import (
    LeastInterval,
    binding,
    first_guess,
    sampled_steps,
)
from kerfpath.search.problem import (
    SearchProblem,
    require_joined,
)
from kerfpath.search.shortest import LayeredPath, find_shortest

LAYERS_SAMPLED = 16
"""Layers sampled to estimate the number of edges."""
ROUNDING = 1e-9
"""Relative slack of an interval, so that a path that needs exactly this interval passes."""


def velocity_allows(problem: SearchProblem, dt: float) -> bool:
    """Return whether some path keeps (5), at any acceleration, with `dt` s from node to node."""
    try:
        find_shortest(_first_order(problem, dt))
    except NoFeasiblePath:
        return False
    return True


def require_steps(problem: SearchProblem) -> None:
    """Raise NoFeasiblePath if no path keeps the largest steps of a problem, however slowly."""
    if not np.isfinite(problem.most).any():
        return
    free = VelocityLimit(bound=np.full(len(problem.weights), np.inf))
    slow = _first_order(problem, problem.dt)
    try:
        find_shortest(replace(slow, limits=replace(slow.limits, velocity=free)))
    except NoFeasiblePath as broken:
        k = broken.node + 1
        raise NoFeasiblePath(
            f"no path leads from node {broken.node} to node {k} without a change of posture, which "
            "no straight move makes",
            proved=True,
            node=broken.node,
            counts={Reason(Loss.LEAP): sum(broken.counts.values())},
        ) from None


def find_slow_path(problem: SearchProblem) -> LeastInterval:
    """Return the shortest path that keeps (5) in the least interval in which any path does.

    Its `dt` is the interval in which that path keeps (6), too. Another path may keep both in less,
    but none in less than the least interval for (5) alone.

    Raises
    ------
    NoFeasiblePath
        A layer is empty, or closed vertices, shut edges and the largest steps of the problem leave
        no path; the message says where.
    """
    require_joined(problem.layers)
    require_steps(problem)
    v = problem.limits.velocity.usable
    quickest, dt = None, first_guess(problem.layers, v)
    while quickest is None:
        try:
            quickest = find_shortest(_slowest_step(problem, dt))
        except NoFeasiblePath:
            dt *= 2
    least = quickest.cost * (1 + ROUNDING) or dt
    path: LayeredPath = find_shortest(_first_order(problem, least))
    return binding(problem.layers, path.index, v, problem.limits.acceleration)


def edges_allowed(problem: SearchProblem, dt: float) -> float:
    """Return an estimate, from samples, of the edges that keep (5) with `dt` s between nodes."""
    sizes = np.diff(problem.start)
    most = problem.limits.velocity.per_interval(dt)
    looked_at, kept = 0, 0
    for steps in sampled_steps(problem.layers, LAYERS_SAMPLED):
        for step in steps:
            kept += int((step <= most).all(axis=1).sum())
            looked_at += len(step)
    return float((sizes[:-1] * sizes[1:]).sum()) * kept / max(looked_at, 1)


def _first_order(problem: SearchProblem, dt: float) -> SearchProblem:
    """Return the problem of the shortest path under the velocity limits at an interval."""
    free = AccelerationLimit(bound=np.full(len(problem.weights), np.inf))
    return replace(
        problem.free(),
        dt=dt,
        limits=replace(problem.limits, acceleration=free),
        metric="manhattan",
        objective="sum",
        weights=1 / problem.limits.velocity.usable,
        method="paper",
    )


def _slowest_step(problem: SearchProblem, dt: float) -> SearchProblem:
    """Return the problem of the path whose longest step takes the least time, s."""
    return replace(_first_order(problem, dt), metric="chebychev", objective="max")
