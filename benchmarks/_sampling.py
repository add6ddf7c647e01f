"""Gamma by sampling-based planning under an end-effector constraint (Yao and Gupta 2007), by OMPL.

The constraint of the beam leaves two coordinates: the place along the contour, and gamma. In one
posture after another, RRT* grows trees in them, forwards only. Along an edge gamma changes evenly
from node to node; the edge must keep (5) and costs its part of (14). (6) is not a property of an
edge: each path found is smoothed by Gaussian filters of several widths, and the best motion that
also keeps (6) is returned.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from ompl import base, geometric, util
from scipy.ndimage import gaussian_filter1d

from benchmarks._following import Follower, edge_cost
from kerfpath.arrays import Array
from kerfpath.kernels.kinematics import POSTURES

__all__ = ["EDGES", "sampled", "start_generators"]

EDGES = 80_000
"""Number of different edges tried per cut, instead of a time limit, so that runs are repeatable."""
NODES_PER_RADIAN = 7.0
"""Number of nodes that count as one radian of gamma in the search for neighbours."""
RANGE = 40.0
"""Longest edge, in nodes or the equivalent in gamma."""
STARTS = 30
"""Number of start states, at random gamma."""
WIDTHS = (0, 1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 32)
"""Widths of the smoothing filters, nodes; 0 leaves the path alone."""


@cache
def start_generators(seed: int) -> None:
    """Seed OMPL's random generators, which is possible once per process."""
    util.setLogLevel(util.LogLevel.LOG_ERROR)
    util.RNG.setSeed(seed)


class _Edges:
    """The costs of edges, each computed once, and the number that may still be computed."""

    def __init__(self, follower: Follower, posture: int, budget: int) -> None:
        self.task, self.posture, self.left = follower.task, posture, budget
        self.known: dict[tuple[int, float, int, float], float] = {}

    def cost(self, a: Sequence[float], b: Sequence[float]) -> float:
        """Return the cost of an edge from state a to state b, inf if it is not admissible."""
        key = (round(a[0]), a[1] / NODES_PER_RADIAN, round(b[0]), b[1] / NODES_PER_RADIAN)
        if key not in self.known:
            self.left -= 1
            self.known[key] = edge_cost(self.task, self.posture, *key)
        return self.known[key]


class _Motions(base.MotionValidator):  # type: ignore[misc]
    """Admits edges that lead forwards and keep (5)."""

    def __init__(self, space: base.SpaceInformation, edges: _Edges) -> None:
        super().__init__(space)
        self.edges = edges

    def checkMotion(self, a: base.State, b: base.State) -> bool:
        return bool(np.isfinite(self.edges.cost(a, b)))


class _Cost(base.OptimizationObjective):  # type: ignore[misc]
    """The sum (14); edges have a cost in one direction only."""

    def __init__(self, space: base.SpaceInformation, edges: _Edges) -> None:
        super().__init__(space)
        self.edges = edges

    def stateCost(self, state: base.State) -> base.Cost:
        return base.Cost(0.0)

    def motionCost(self, a: base.State, b: base.State) -> base.Cost:
        return base.Cost(self.edges.cost(a, b))

    def motionCostHeuristic(self, a: base.State, b: base.State) -> base.Cost:
        return base.Cost(0.0)

    def isSymmetric(self) -> bool:
        return False


class _End(base.GoalSampleableRegion):  # type: ignore[misc]
    """The last node, at any gamma."""

    def __init__(self, space: base.SpaceInformation, last: int, rng: np.random.Generator) -> None:
        super().__init__(space)
        self.last, self.rng = last, rng
        self.setThreshold(0.25)

    def distanceGoal(self, state: base.State) -> float:
        return float(self.last - round(state[0]))

    def sampleGoal(self, state: base.State) -> None:
        state[0] = float(self.last)
        state[1] = self.rng.uniform(-np.pi, np.pi) * NODES_PER_RADIAN

    def maxSampleCount(self) -> int:
        return 1000


def sampled(follower: Follower, *, seed: int, edges: int = EDGES) -> Array | None:
    """Return the best course of gamma (K,) found that keeps (5) and, if any does, (6); or None.

    The result is the same on every run if `start_generators` was called at the start of the
    process and the calls before were the same.
    """
    rng = np.random.default_rng(seed)
    postures = [mu for mu in range(POSTURES) if follower.admits_throughout(mu)]
    nodes = np.arange(len(follower.task.H))
    tried = [np.empty((0, len(nodes)))]
    for mu in postures:
        states = _path(follower, mu, edges // len(postures), rng)
        if states is not None:
            at, gamma = np.round(states[:, 0]), states[:, 1] / NODES_PER_RADIAN
            tried.append(_smoothed(np.interp(nodes, at, gamma)))
    gamma = np.concatenate(tried)
    if not len(gamma):
        return None
    found = follower.follow(gamma)
    return np.asarray(gamma[np.lexsort((found.cost, found.excess))[0]])


def _path(follower: Follower, posture: int, budget: int, rng: np.random.Generator) -> Array | None:
    """Return the states (S, 2) of the best path in one posture, None if none was found."""
    edges, last = _Edges(follower, posture, budget), len(follower.task.H) - 1
    space = base.RealVectorStateSpace(2)
    bounds = base.RealVectorBounds(2)
    for i, (low, high) in enumerate(((0.0, last), (-2 * np.pi, 2 * np.pi))):
        scale = NODES_PER_RADIAN if i else 1.0
        bounds.setLow(i, low * scale)
        bounds.setHigh(i, high * scale)
    space.setBounds(bounds)
    information = base.SpaceInformation(space)
    information.setStateValidityChecker(lambda state: True)
    information.setMotionValidator(_Motions(information, edges))
    information.setup()
    problem = base.ProblemDefinition(information)
    for gamma in rng.uniform(-np.pi, np.pi, STARTS):
        state = space.allocState()
        state[0], state[1] = 0.0, gamma * NODES_PER_RADIAN
        problem.addStartState(state)
    problem.setGoal(_End(information, last, rng))
    problem.setOptimizationObjective(_Cost(information, edges))
    planner = geometric.RRTstar(information)
    planner.setRange(RANGE)
    planner.setProblemDefinition(problem)
    planner.setup()
    planner.solve(base.PlannerTerminationCondition(lambda: edges.left <= 0))
    if not problem.hasExactSolution():
        return None
    return np.array([[state[0], state[1]] for state in problem.getSolutionPath().getStates()])


def _smoothed(gamma: Array) -> Array:
    """Return a course of gamma (K,) as it is and smoothed, (len(WIDTHS), K)."""
    return np.array([gaussian_filter1d(gamma, w, mode="nearest") if w else gamma for w in WIDTHS])
