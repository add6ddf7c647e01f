"""A way around obstacles by OMPL's RRT-Connect, and its shortening."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from kerfpath._arrays import Array
from kerfpath._extras import require_extra

__all__ = ["find_way_around"]

SEED = 1
"""Of the random samples: the same question gives the same way."""
RANGE = 0.1
"""Longest branch as a share of the time that the whole range of a joint takes."""
SHORTCUTS = 60
"""Tries to shorten a way."""


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
    lower, upper : (n,) rad
        Bounds.
    scale : (n,) s/rad
        Makes the joints comparable: time to turn by a rad.
    clear : callable
        Whether joint vectors (1, n) are clear.
    passable : callable
        Whether straight motions through joint vectors (2, n) are.
    seconds : float s
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
        """OMPL asks here whether a motion is clear."""

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
