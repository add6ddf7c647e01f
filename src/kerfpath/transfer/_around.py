"""Find a way around obstacles by OMPL's RRT-Connect, and shorten it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from kerfpath._arrays import Array
from kerfpath._extras import require_extra

__all__ = ["find_way_around"]

SEED = 1
"""Seed of the random samples: the same arguments give the same way."""
RANGE = 0.1
"""Longest branch of the tree, as a share of the diagonal of the scaled joint ranges."""
SHORTCUTS = 60
"""Number of attempts to shorten a way."""


def find_way_around(
    ends: Array,
    lower: Array,
    upper: Array,
    scale: Array,
    *,
    clear: Callable[[Array], bool],
    passable: Callable[[Array], bool],
    seconds: float,
) -> Array | None:
    """Return corners (m, n) of a clear way between ends (2, n), or None if none is found in time.

    Parameters
    ----------
    ends : (2, n) rad
        First and last joint vector.
    lower, upper : (n,) rad
        Bounds of the joints.
    scale : (n,) s/rad
        Scale that makes the joints comparable: time to turn by one rad.
    clear : callable
        Returns whether joint vectors (1, n) are clear.
    passable : callable
        Returns whether the straight motion between joint vectors (2, n) is clear.
    seconds : float s
        Time limit of the search.

    Raises
    ------
    InputError
        OMPL is not installed.
    """
    require_extra("cells", "ways around obstacles")
    from ompl import base, geometric, util  # loaded where it is needed: half a second

    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(SEED)
    n = len(scale)
    space, bounds = base.RealVectorStateSpace(n), base.RealVectorBounds(n)
    for i in range(n):
        bounds.setLow(i, float(lower[i] * scale[i]))
        bounds.setHigh(i, float(upper[i] * scale[i]))
    space.setBounds(bounds)
    info = base.SpaceInformation(space)

    def joints(*states: Any) -> Array:
        return np.array([state[0:n] for state in states]) / scale

    class Motions(base.MotionValidator):  # type: ignore[misc]  # ompl has no types
        """The check of motions that OMPL calls."""

        def checkMotion(self, one: Any, two: Any) -> bool:  # OMPL's name
            return passable(joints(one, two))

    motions = Motions(info)  # held here: OMPL does not keep it alive
    info.setStateValidityChecker(lambda state: clear(joints(state)))
    info.setMotionValidator(motions)
    info.setup()
    problem, (start, goal) = base.ProblemDefinition(info), (info.allocState(), info.allocState())
    for state, q in ((start, ends[0]), (goal, ends[1])):
        for i in range(n):
            state[i] = float(q[i] * scale[i])
    problem.setStartAndGoalStates(start, goal)
    planner = geometric.RRTConnect(info)
    planner.setProblemDefinition(problem)
    planner.setRange(RANGE * float(np.linalg.norm((upper - lower) * scale)))
    planner.setup()
    planner.solve(base.timedPlannerTerminationCondition(float(seconds)))
    if not problem.hasExactSolution():
        return None
    path = problem.getSolutionPath()
    shorten = geometric.PathSimplifier(info)
    shorten.reduceVertices(path)
    shorten.partialShortcutPath(path, SHORTCUTS, SHORTCUTS)
    shorten.reduceVertices(path)
    return np.vstack([ends[:1], joints(*path.getStates())[1:-1], ends[1:]])
