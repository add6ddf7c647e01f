"""Coarse samples of the joints that poses leave free, and the best ways through them.

A few nodes are sampled at every place of a coarse grid of these joints (external axes, elbow), at
coarse gamma and in all postures. Dynamic programming finds the best way through these samples
within the velocity limits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.errors import NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.kernels.courses import CoarseLayer, Nearby, best_steps
from kerfpath.planner.layers import layered_graph
from kerfpath.planner.task import Task
from kerfpath.robots import Robot

FEW_NODES, NODES = 9, 41
"""Least and most sampled nodes; in between, the axes have time for one step from node to node."""
STEP = {"m": 0.15, "rad": np.radians(12)}
"""m and rad: steps of the axes, unless these give more than `MOST_PLACES`."""
MOST_PLACES = 1500
"""Most places of the grid."""
GAMMA_STEP = {1: np.radians(12), 2: np.radians(20), 3: np.radians(24)}
"""rad: step of gamma by the number of axes."""
FARTHEST = 2
"""Most steps of the grid that an axis moves from one sampled node to the next."""
TURN = np.radians(40)
"""rad: most change of gamma from one sampled node to the next."""

ELSEWHERE = np.radians(60)
"""rad: two ends are apart if gamma differs by this, or an axis by more than `FARTHEST` steps."""
DEARER = 0.1
"""Most relative cost of another end above that of the best."""
ROUNDS = 16
"""Most ways tried to find one whose samples are all clear in the cell."""
ABOUT = 2
"""Steps of the grid around a colliding place within which all samples are checked."""


class Style(NamedTuple):
    """Objective of a course: prices of squared speed and of the moves of the axes.

    With external axes, courses to `ends` different ends are looked for.
    """

    square: float
    axes: float
    ends: int = 1


End = int | tuple[int, int, int] | None
"""End of a way: a place; a place, gamma and posture; or None for the best end."""


class Reached(NamedTuple):
    """Cost of reaching each sample (X, m, P) of the last node; predecessors (M, X, m, P)."""

    value: Array
    back: Ints


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coarse:
    """The coarse samples of a task.

    Parameters
    ----------
    nodes : (M,) int
        The nodes that have samples.
    places : (X, E) rad or m
        The grid of the axes.
    counts : tuple of int
        Number of values of each axis in the grid.
    graph : LayeredGraph
        All samples within limits and margins; its variants are the places.
    closed : (N,) bool
        Vertices of the graph that are known not to be clear; updated during the search.
    """

    nodes: Ints
    places: Array
    counts: tuple[int, ...]
    graph: LayeredGraph
    closed: Bools

    __repr__ = short_repr

    @property
    def cells(self) -> Ints:
        """Index of the value of each axis at the places, (X, E)."""
        places = np.arange(len(self.places))
        return np.stack(np.unravel_index(places, self.counts), axis=-1).astype(np.int64)

    def steps_from(self, place: int, robot: Robot) -> Ints:
        """Return the distance of all places from one of them, in steps of each axis, (X, E)."""
        cells = self.cells
        far = np.abs(cells - cells[place])
        around = np.minimum(far, np.array(self.counts) - far)
        return np.asarray(np.where(robot.endless[robot.free], around, far))


def coarse_places(robot: Robot) -> Array:
    """Return a coarse grid (X, E) of values of the joints that a pose leaves free, rad or m."""
    return _grid(robot)[0]


def sampled(task: Task) -> Coarse:
    """Return the coarse samples of the joints that the poses of a task leave free."""
    robot, options, K = task.robot, task.settings, len(task.contour)
    places, counts = _grid(robot)
    takes = steps_of(robot, counts) / robot.speed_limits()[0][robot.free]
    slowest = takes.max() or np.inf  # no axis moves: the fewest nodes allowed
    many = int(np.clip(task.dt * (K - 1) / slowest, min(K, FEW_NODES), min(K, NODES)))
    nodes = np.unique(np.round(np.linspace(0, K - 1, many)).astype(np.int64))
    hard = options.comfort.hard if options.comfort is not None else None
    graph = layered_graph(
        task.contour,
        robot,
        tool=task.setup.tool,
        placement=task.setup.placement,
        options=replace(
            options, gamma_step=GAMMA_STEP[len(counts)], tilt=None, comfort=hard, retract=None
        ),
        nodes=nodes,
        external=np.broadcast_to(places, (K, *places.shape)),
    )
    return Coarse(
        nodes=nodes,
        places=places,
        counts=counts,
        graph=graph,
        closed=np.zeros(len(graph.q), np.bool_),
    )


def _grid(robot: Robot) -> tuple[Array, tuple[int, ...]]:
    """Return a grid (X, E) of the free joints, rad or m, and the number of values of each."""
    free, limits = robot.free, robot.joint_limits()
    bounds = list(zip(limits.lower[free], limits.upper[free], strict=True))
    endless = robot.endless[free]
    wanted = [
        (2 * np.pi if turns else upper - lower) / STEP[robot.units[i]]
        for i, (lower, upper), turns in zip(free, bounds, endless, strict=True)
    ]
    moving = max(1, sum(count > 0 for count in wanted))
    share = min(1.0, (MOST_PLACES / np.prod(np.add(wanted, 1))) ** (1 / moving))
    counts = tuple(int(np.ceil((count + 1) * share)) if count else 1 for count in wanted)
    grids = [
        np.linspace(-np.pi, np.pi, count, endpoint=False)
        if turns
        else np.linspace(lower, upper, count)
        if count > 1
        else np.array([(lower + upper) / 2])
        for (lower, upper), turns, count in zip(bounds, endless, counts, strict=True)
    ]
    places = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, len(grids))
    return places, counts


def clear_way(
    coarse: Coarse,
    task: Task,
    style: Style,
    clear: Callable[[Array], Bools],
    known: Reached,
    end: End,
) -> Ints:
    """Return the places (M,) of the best way whose samples are clear, or of the last way tried.

    `known` is the result of `reached` with the vertices known to be closed so far.
    """
    graph = coarse.graph
    way = _way_to(known, end)
    for _ in range(ROUNDS):
        hit = np.flatnonzero(~clear(graph.q[_vertices(coarse, way)]))
        if not hit.size:
            break
        looked = []
        for k in hit:
            own = np.arange(graph.start[k], graph.start[k + 1])
            about = np.all(coarse.steps_from(way[k, 0], task.robot) <= ABOUT, axis=1)
            looked.append(own[about[graph.variant[own]] & ~coarse.closed[own]])
        at = np.concatenate(looked)
        coarse.closed[at] = ~clear(graph.q[at])
        try:
            way = _way_to(reached(coarse, task, style), end)
        except NoFeasiblePath:
            break
    return way[:, 0]


def _vertices(coarse: Coarse, way: Ints) -> Ints:
    """Return the vertex of the graph (M,) that a way has at each sampled node."""
    graph = coarse.graph
    found = []
    for k, (place, sample, posture) in enumerate(way.tolist()):
        own = slice(graph.start[k], graph.start[k + 1])
        same = (graph.variant[own] == place) & (graph.sample[own] == sample)
        same &= graph.posture[own] == posture
        found.append(int(graph.start[k]) + int(np.flatnonzero(same)[-1]))
    return np.array(found)


def _way_to(known: Reached, end: End) -> Ints:
    """Return the place, gamma and posture (M, 3) of each sampled node on the best way.

    The way leads to `end` if that is reached, else to the best end.
    """
    value, back = known
    if end is not None and np.isfinite(value[end]).any():
        there = np.full_like(value, np.inf)
        there[end] = value[end]
        value = there
    at = int(np.argmin(value))
    path = [at]
    for k in range(len(back) - 1, 0, -1):
        at = int(back[k].flat[at])
        path.append(at)
    return np.stack(np.unravel_index(path[::-1], value.shape), axis=1).astype(np.int64)


def reached(coarse: Coarse, task: Task, style: Style) -> Reached:
    """Return the cost of reaching each sample (X, m, P) of the last node, and the predecessors.

    Raises
    ------
    NoFeasiblePath
        No sample is reached.
    """
    robot, graph, count = task.robot, coarse.graph, len(coarse.nodes)
    before = _layer(coarse, robot, 0)
    value = np.where(before.ok, 0.0, np.inf)
    back = np.full((count, *value.shape), -1, np.int64)
    for k in range(1, count):
        here, after = _layer(coarse, robot, k), np.empty(value.shape)
        parts = int(coarse.nodes[k] - coarse.nodes[k - 1])
        best_steps(before, value, here, _nearby(coarse, task, parts, style), after, back[k])
        if not np.isfinite(after).any():
            raise NoFeasiblePath(
                _stuck(coarse, robot, k),
                node=int(coarse.nodes[k - 1]),
                proved=False,
                counts=graph.counts(k),
            )
        before, value = here, after
    if not np.isfinite(value).any():
        raise NoFeasiblePath(
            _stuck(coarse, robot, 0), node=-1, proved=False, counts=graph.counts(0)
        )
    return Reached(value, back)


def apart(coarse: Coarse, robot: Robot, value: Array, count: int) -> list[End]:
    """Return up to `count` samples of the last node that are far from each other, the best first.

    They cost little more than the best, by `value` (X, m, P).
    """
    samples = value.shape[1]
    left, most = value.copy(), (1 + DEARER) * value.min()
    ends: list[End] = []
    while len(ends) < count and np.isfinite(least := left.min()) and least <= most:
        place, gamma, posture = (int(i) for i in np.unravel_index(np.argmin(left), left.shape))
        ends.append((place, gamma, posture))
        near = np.all(coarse.steps_from(place, robot) <= FARTHEST, axis=1)
        turn = np.abs(np.arange(samples) - gamma)
        beside = np.minimum(turn, samples - turn) * 2 * np.pi / samples < ELSEWHERE
        left[near[:, None] & beside, posture] = np.inf
    return ends


def _layer(coarse: Coarse, robot: Robot, k: int) -> CoarseLayer:
    """Return the solved joints at every sample of a node, on one turn each."""
    graph = coarse.graph
    own = slice(graph.start[k], graph.start[k + 1])
    shape = len(coarse.places), len(graph.gamma), robot.postures
    q, ok = np.zeros((*shape, len(robot.solved))), np.zeros(shape, np.bool_)
    at = graph.variant[own], graph.sample[own], graph.posture[own]
    q[at], ok[at] = graph.q[own][:, robot.solved], ~coarse.closed[own]
    return CoarseLayer(q=q, ok=ok)


def _nearby(coarse: Coarse, task: Task, parts: int, style: Style) -> Nearby:
    """Return the places from which steps to each place may come within `parts` intervals."""
    robot, options = task.robot, task.settings
    free, solved, counts = robot.free, robot.solved, coarse.counts
    velocity = options.eta_v * robot.speed_limits()[0]
    reach = [range(-FARTHEST, FARTHEST + 1) if n > 1 else range(1) for n in counts]
    moves = np.stack(np.meshgrid(*reach, indexing="ij"), axis=-1).reshape(-1, len(counts))
    there = coarse.cells[:, None] + moves
    endless = robot.endless[free]
    there = np.where(endless, there % counts, there)
    inside = ((there >= 0) & (there < counts)).all(axis=2)
    index = np.ravel_multi_index(np.moveaxis(there, 2, 0), counts, mode="clip")
    span = velocity * task.dt * parts
    weight = span * (1 / velocity if options.weights is None else options.weights)
    steps = steps_of(robot, coarse.counts) / span[free]
    share, square = np.abs(moves) * steps, style.square * parts
    cost = style.axes * (weight[free] * share).sum(axis=1) + square * (share**2).sum(axis=1)
    # The middles of two cells are one step farther apart than their nearest edges.
    cost = np.where((share - steps <= 1).all(axis=1), cost, np.inf)
    limits = robot.joint_limits()
    wide = limits.upper - limits.lower > 2 * np.pi
    samples = len(coarse.graph.gamma)
    return Nearby(
        place=np.where(inside, index, -1),
        cost=cost,
        turns=min((samples - 1) // 2, int(np.ceil(TURN * samples / (2 * np.pi)))),
        span=span[solved],
        wraps=(robot.endless | wide)[solved],
        weight=weight[solved],
        square=square,
    )


def steps_of(robot: Robot, counted: tuple[int, ...]) -> Array:
    """Return the step (E,) of each axis in the grid, rad or m."""
    free, limits = robot.free, robot.joint_limits()
    counts = np.array(counted)
    span = np.where(robot.endless[free], 2 * np.pi, (limits.upper - limits.lower)[free])
    between = np.where(robot.endless[free], counts, np.maximum(counts - 1, 1))
    return np.asarray(span / between)


def _stuck(coarse: Coarse, robot: Robot, k: int) -> str:
    """Return text on where the way through the samples ends, and the likely reason."""
    names, graph = robot.free_names, coarse.graph
    if graph.start[k + 1] == graph.start[k]:
        where = f"node {coarse.nodes[k]} is out of reach at every sampled value of {names}"
        loss = graph.main_loss(k)
        return f"{where}; most candidates are lost by {loss}" if loss else where
    return (
        f"no motion of the arm and {names} was found from node {coarse.nodes[k - 1]} to node "
        f"{coarse.nodes[k]} within the velocity limits; only samples of {names} were tried, which "
        "proves nothing about the values between them"
    )
