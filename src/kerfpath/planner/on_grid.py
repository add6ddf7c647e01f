"""Plan on the grid of gamma by the exact search; if it has no path, slower or off the grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import sqrt
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from kerfpath import refiner
from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.certifier import MotionTest
from kerfpath.compiling import finish_compiling
from kerfpath.contour import Contour
from kerfpath.effort import current_effort
from kerfpath.errors import InputError, NoFeasiblePath, Relaxation
from kerfpath.graph import LayeredGraph
from kerfpath.kernels.courses import CoarseLayer, Nearby, best_steps
from kerfpath.limits import rates_of
from kerfpath.options import PlanOptions
from kerfpath.planner.attempt import Attempt, Strategy, first_plan
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.layers import layered_graph
from kerfpath.planner.quickest import QuickMotion, quick_motions, slow_motions
from kerfpath.planner.statements import (
    ON_THIS_GRID,
    at_least,
    at_most,
    limits_named,
    plan_off_grid,
    plan_slowed,
    plan_slowly,
    refine_plan,
)
from kerfpath.planner.task import Task
from kerfpath.plans import Plan, Proof, on_turns
from kerfpath.refiner import refine
from kerfpath.robots import Robot, posture_name
from kerfpath.search import SearchProblem, find_shortest, velocity_allows
from kerfpath.tolerances import LIMIT_MARGIN

# -----------------------------------------------------------------------------
# Proofs that a task has no motion at any gamma, posture and turn.

MOST_NODES = 5_000
"""Most nodes whose cells are all held in memory at once: some 200 MB."""
BINDS, APART = 0.9, 3
"""Share of the limits, in speed, from which they bind at a node; and distance in nodes that further
binding nodes keep."""
FAR, CLOSE = 300.0, 1.02
"""Largest factor on the speed that is tried to find an impossible speed; and the factor to which
the impossible speed is then narrowed down."""


def motion_test(task: Task) -> MotionTest | None:
    """Return the test of a task for motions at any gamma; None if nothing can be proved.

    Other constraints of a plan (cell, comfort, closure, rotation limits) only leave fewer motions.
    """
    asked = task.settings
    if not task.robot.encloses or asked.tilt is not None or len(task.contour) > MOST_NODES:
        return None
    finish_compiling()
    frames = task.setup.placement @ task.contour.frames(asked.frames)
    return MotionTest(task.robot, frames, task.setup.tool, asked.postures)


def at_any_gamma(broken: NoFeasiblePath, task: Task) -> NoFeasiblePath:
    """Return the answer of a search without a path, with whether it is proved at every gamma."""
    test = motion_test(task)
    if test is None or task.settings.feed == "dip":
        return broken
    limits = task.problem.limits
    closed = test.closed(limits, task.dt) or test.closed(limits, task.dt, broken.node + 1)
    if closed is None:
        return broken.with_message(f"{broken}; whether there is a motion off the grid is undecided")
    return broken.with_message(f"{broken}; proved for every rotation: {closed}", closed=closed)


def with_relaxation(broken: NoFeasiblePath, task: Task, quick: QuickMotion) -> NoFeasiblePath:
    """Return an answer without a path, with the lower speed or higher limits that would suffice.

    They are those of the quickest motion found, which is slower than asked for; the figures are
    rounded so that they hold as printed.
    """
    limits = task.problem.limits
    v, a = rates_of(quick.plan.increments, np.full(len(task.contour) - 1, task.dt))
    shares = (
        float((np.abs(rates) / limit.usable).max(initial=0.0))
        for rates, limit in ((v, limits.velocity), (a, limits.acceleration))
    )
    fast, sharp = (float(at_least(max(1.0, share * (1 + LIMIT_MARGIN)))) for share in shares)
    needed = Relaxation(speed=float(at_most(task.dt / quick.dt)), velocity=fast, acceleration=sharp)
    limits_said = " and ".join(
        f"{value:g} times the {what}"
        for value, what in ((fast, "velocities"), (sharp, "accelerations"))
        if value > 1
    )
    said = f"a motion was found at {needed.speed:g} of the speed, and at the speed asked for with "
    return broken.with_message(f"{broken}; {said}{limits_said}", relaxation=needed)


def impossible_share(task: Task, reached: float, nodes: Sequence[int]) -> float | None:
    """Return an interval, as a share of `reached` s, that is too short for any motion at any gamma.

    This is proved, and holds for every shorter interval, too; None if nothing is proved. `nodes`
    are those where limits bind a motion with the interval `reached`, the most binding one first.
    """
    test = motion_test(task)
    if test is None:
        return None
    limits = task.problem.limits

    def impossible(times: float, around: int | None) -> bool:
        """Return whether no motion is this many times as fast, tested around a node or at all."""
        return test.closed(limits, reached / times, around) is not None

    low, high = 1.0, 2.0
    while not any(impossible(high, around) for around in (*nodes[:1], None)):
        low, high = high, high * high
        if high > FAR:
            return None
    for node in nodes:
        # The part around another node may be closed at a lower speed, too.
        least = low if node == nodes[0] else 1.0
        if not impossible(high / CLOSE, node):
            continue
        high /= CLOSE
        while high > CLOSE * least:
            middle = sqrt(least * high)
            if impossible(middle, node):
                high = middle
            else:
                least = middle
    return 1 / high


def binding_nodes(motions: Sequence[QuickMotion]) -> list[int]:
    """Return nodes where limits bind successively quicker motions, that of the quickest first.

    They are the binding node of each motion, and nodes where limits nearly bind the quickest one,
    at most `Effort.binding_nodes`, not close to each other.
    """
    plan = motions[-1].plan
    velocity = np.abs(plan.velocity_share).max(axis=1) / plan.settings.eta_v
    acceleration = np.abs(plan.acceleration_share).max(axis=1) / plan.settings.eta_a
    used = np.zeros(len(plan.q))
    used[1:] = velocity
    used[1:-1] = np.maximum(used[1:-1], np.sqrt(acceleration))
    used[used < BINDS * used.max()] = 0.0
    near = np.argsort(-used, kind="stable")[: np.count_nonzero(used)]
    nodes: list[int] = []
    for node in [*(motion.at.node for motion in reversed(motions)), *near.tolist()]:
        if all(abs(node - other) > APART for other in nodes):
            nodes.append(node)
    return nodes[: current_effort().binding_nodes]


# -----------------------------------------------------------------------------
# Coarse samples of the joints that poses leave free, and the best ways through them.
#
# A few nodes are sampled at every place of a coarse grid of these joints (external axes, elbow),
# at coarse gamma and in all postures. Dynamic programming finds the best way through these
# samples within the velocity limits.

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


# -----------------------------------------------------------------------------
# Warm start: an existing plan, adapted to new options; fast, not optimal.

FIRST = np.radians(2.0)
"""rad: first change of gamma; larger steps fail more often than they gain."""
PROGRAMS = 2
"""Most convex programs of a draft: a tenth of those to the best motion, for most of the gain after
a change of weights."""


def warm_start(made: Plan, options: PlanOptions, *, dt: float) -> Plan | None:
    """Return a motion near an existing one that keeps the limits of new options and costs less.

    It stays in the posture and near the gamma of the existing motion; `plan` searches everywhere.

    Parameters
    ----------
    made : Plan
        The existing motion, at constant speed, over continuous gamma.
    options : PlanOptions
        New options: other weights, eta, metric or objective; the rest as in `made`.
    dt : float s
        New time from node to node.

    Returns
    -------
    Plan or None
        None if no such motion is found, or if these options need a full plan.
    """
    constant = made.feed is None and options.feed == "constant" and made.contour.time is None
    free = made.robot.family.free_rotation and options.method == "continuous"
    if not (constant and free and options.closure == made.settings.closure):
        return None
    # The refinement computes the cost under the new options.
    start = replace(
        made,
        settings=replace(options.resolve(made.robot, dt), certify=None),
        time=dt * np.arange(len(made.q), dtype=float),
        proof=Proof(optimal=False, statement="a draft: the previous motion, moved"),
    )
    try:
        found = refine(start, first=FIRST, most=PROGRAMS)
    except InputError:
        return None
    return found.plan if found.done else None


# -----------------------------------------------------------------------------
# Refine again from random starts, to leave a local optimum.

CHANGES = (0.05, 0.1, 0.2, 0.4)
"""Largest change of gamma of each start, rad, in this order."""
WAVES = 4
"""Number of cosines in a change; the slower ones are larger."""
SEED = 16
"""Fixed, so that the same motion always gets the same starts."""


def refine_from_random_starts(begun: Plan, finder: CollisionFreeSearch) -> Plan:
    """Return the best of a motion and its refinements from random changes of its gamma.

    If (6) binds at many nodes, there are many narrow local optima. Each change is made to the best
    motion so far. The result keeps every limit and is clear.
    """
    rng, best = np.random.default_rng(SEED), begun
    for size in CHANGES:
        change = _smooth(rng, len(best.q), size)
        if best.settings.closure == "periodic":
            change -= np.linspace(change[0], change[-1], len(change))
        again = refiner.refine(replace(best, gamma=best.gamma + change), first=size)
        if again.done and again.plan.cost < best.cost and finder.is_clear(again.plan):
            claim = f"refined again from a change of gamma at random: cost {again.plan.cost:.6g}"
            statement = f"{begun.proof.statement}; {claim}"
            best = replace(again.plan, proof=replace(begun.proof, statement=statement))
    return best


def _smooth(rng: np.random.Generator, nodes: int, size: float) -> Array:
    """Return a random sum of slow cosines (K,) whose largest absolute value is `size`."""
    t, change = np.linspace(0, np.pi, nodes), np.zeros(nodes)
    for m in range(WAVES):
        change += rng.normal() / (1 + m) * np.cos(m * t + rng.uniform(0, 2 * np.pi))
    return np.asarray(size * change / np.abs(change).max())


# -----------------------------------------------------------------------------
# Very many nodes: a subsample is planned first, and its motion is the start for all of them.

EVERY = 5, 4, 6, 3, 7
"""One of this many nodes is kept: the first number that divides the intervals, else the first."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SubsampledTask:
    """A task with every few nodes of another task, at the same speed.

    Parameters
    ----------
    task : Task
        The subsampled task; it lacks the last few nodes if the intervals do not divide evenly.
    whole : Task
        The other task, with all nodes.
    nodes : (M,) int
        The nodes of `whole` that are kept.
    """

    task: Task
    whole: Task
    nodes: Ints

    __repr__ = short_repr

    def at_all_nodes(self, made: Plan) -> Plan | None:
        """Return the motion at all nodes, with gamma and external axes interpolated by splines.

        It need not keep the limits; beyond the last kept node it goes on at the same rate. None if
        the posture changes on the way.
        """
        task, at = self.whole, np.arange(len(self.whole.contour))
        if np.ptp(made.posture):
            return None
        q = np.stack([np.interp(at, self.nodes, joint) for joint in made.unwrapped.T], axis=1)
        free = np.column_stack([np.unwrap(made.gamma), made.unwrapped[:, task.robot.free]])
        spline, end = CubicSpline(self.nodes, free), self.nodes[-1]
        free = spline(np.minimum(at, end)) + spline(end, 1) * np.maximum(at - end, 0)[:, None]
        gamma, q[:, task.robot.free] = free[:, 0], free[:, 1:]
        claim = Proof(optimal=False, statement="found over continuous rotation")
        return Plan(
            contour=task.contour,
            robot=task.robot,
            T_flange_tip=task.setup.tool,
            T_base_part=task.setup.placement,
            q=q,
            gamma=gamma,
            posture=np.repeat(made.posture[:1], len(at)),
            turn=on_turns(task.robot, q)[1],
            time=task.times,
            settings=task.settings,
            cost=made.cost,
            proof=claim,
            counts=made.counts,
        )


def subsampled(task: Task) -> SubsampledTask | None:
    """Return a task with every few of very many nodes; None if it has fewer.

    It is also None with a tilt or a grid of external axes, with a periodic closure whose intervals
    do not divide evenly, and if one of the kept nodes has no pose. The graph of all nodes is not
    built for it.
    """
    last, axes = len(task.contour) - 1, len(task.robot.free)
    if last < current_effort().subsampled_from / (1 + axes) or task.settings.tilt is not None:
        return None
    if axes and task.external is None:
        return None
    even = [every for every in EVERY if last % every == 0]
    if task.settings.closure == "periodic" and not even:
        return None
    every = (even or EVERY)[0]
    nodes = np.arange(0, last + 1, every)
    whole, few = task.contour, task.at_nodes(nodes)
    if (np.diff(few.graph.start) == 0).any():
        return None
    contour = Contour(
        whole.points[nodes],
        whole.axes[nodes],
        closed=whole.closed and bool(even),
        s=whole.s[nodes],
        x=whole.frames(task.settings.frames)[nodes, :3, 0],
        name=whole.name,
    )
    few = replace(few, problem=replace(few.problem, dt=every * task.dt))
    x = None if task.external is None else task.external[nodes]
    thin = replace(task.on(few), contour=contour, external=x)
    return SubsampledTask(task=thin, whole=task, nodes=nodes)


# -----------------------------------------------------------------------------
# Plan on the grid of gamma by the exact search; if it has no path, slower or off the grid.

HOPELESS = 4.0
"""If no path on the grid keeps the velocities in this multiple of the node interval, no motion is
as quick as asked for, and the exact fastest path is not worth minutes."""
TOO_SLOW, NEARLY = 2.0, 1.15
"""Multiples of the node interval above which a proof that there is no motion is tried before the
next search: for the fastest path on the grid, and for quicker motions."""


def plan_on_grid(
    task: Task, finder: CollisionFreeSearch, begin: Callable[[str], None], *, refine: bool
) -> Plan:
    """Return the plan of the first strategy of `ON_GRID` that has one; it is refined if `refine`.

    Raises
    ------
    NoFeasiblePath
        A node has no pose, or no strategy has a plan.
    """
    return first_plan(Attempt(task=task, finder=finder, begin=begin, refine=refine), ON_GRID)


def best_path(attempt: Attempt) -> Plan | None:
    """Plan along the best path of the graph, and refine it if the attempt may leave the grid."""
    attempt.task = task = attempt.task.whole()
    attempt.begin("search")
    try:
        path = attempt.finder.find(find_shortest, task.problem)
    except NoFeasiblePath as none:
        attempt.failure = _said_of_grid(none, task)
        return None
    proof = _proof(task.problem, path.optimal, attempt.finder)
    made = task.plan(path.index, path.cost, proof)
    if not attempt.refine:
        return made
    attempt.begin("refinement")
    return refine_plan(task, attempt.finder, made)


def slowed_path(attempt: Attempt) -> Plan | None:
    """Plan with a reduced feed where the limits need it, if the feed may be reduced."""
    if attempt.task.settings.feed != "dip":
        return None
    try:
        return plan_slowed(attempt.task, attempt.finder, refine=attempt.refine)
    except NoFeasiblePath as none:
        attempt.failure = _said_of_grid(none, attempt.task)
        return None


def path_off_grid(attempt: Attempt) -> Plan | None:
    """Refine the best path without acceleration limits until it keeps them."""
    asked = attempt.task.settings
    if asked.feed == "dip" or asked.closure != "free" or not attempt.refine:
        return None
    attempt.begin("refinement")
    found = plan_off_grid(attempt.task, attempt.finder)
    if found is None or found.done:
        return None if found is None else found.plan
    assert attempt.failure is not None, "the search of the grid found no path"
    attempt.failure = attempt.failure.with_message(
        f"{attempt.failure}; off the grid {found.statement}"
    )
    return None


def quickest_motion(attempt: Attempt) -> Plan | None:
    """Refine a motion that is at least as quick as asked for; else prove that there is none."""
    if attempt.task.settings.feed == "dip" or not attempt.refine:
        return None
    assert attempt.failure is not None, "the search of the grid found no path"
    return _from_quickest(attempt.task, attempt.finder, attempt.failure, attempt.begin)


ON_GRID: tuple[Strategy, ...] = (best_path, slowed_path, path_off_grid, quickest_motion)
"""The strategies on the grid of gamma, in the order in which they are tried."""


def _said_of_grid(none: NoFeasiblePath, task: Task) -> NoFeasiblePath:
    """Return the failure of a search of the grid with the contour named, and where paths end."""
    where = f"{ON_THIS_GRID} " if task.robot.family.free_rotation else ""
    return none.with_message(f"contour {task.contour.name!r}: {where}{none}{_bracket(none, task)}")


def _from_quickest(
    task: Task, finder: CollisionFreeSearch, broken: NoFeasiblePath, begin: Callable[[str], None]
) -> Plan:
    """Return the refinement of a motion that is at least as quick as asked for.

    Unless some motions are nearly as quick, a proof that there is none at all is tried first.

    Raises
    ------
    NoFeasiblePath
        No motion was found; the message says what is proved, and with which lower speed or higher
        limits a motion was found.
    """
    asked = task.settings
    # The search for quickest motions supports no closure, torque, jerk or cost of clearance. On a
    # grid of external axes its first motion may take minutes: the long steps between samples leave
    # the arm nearly every edge, and the exact search for the fastest path keeps each as a state.
    priced = asked.comfort is not None and asked.comfort.prices_clearance
    held = task.problem.limits
    unknown = held.torque is not None or held.jerk is not None
    on_a_grid = task.robot.free.size and task.external is None
    if asked.closure == "periodic" or priced or unknown or on_a_grid:
        raise _judged(broken, task, begin) from None
    judged, best = None, None
    begin("search for the quickest motion")
    hopeless = not velocity_allows(task.problem, HOPELESS * task.dt)
    motions = slow_motions if hopeless else quick_motions
    try:
        for tried, best in enumerate(motions(task, finder)):
            made = plan_slowly(task, best, finder) if best.is_enough(task.dt) else None
            if made is not None:
                return made
            far = best.dt > (TOO_SLOW, NEARLY)[tried > 0] * task.dt
            if judged is None and far:
                judged = _judged(broken, task, begin)
                if judged.closed is not None:
                    break
    except NoFeasiblePath:  # not at any speed
        best = None
    if judged is None:
        judged = _judged(broken, task, begin)
    if best is None or asked.rotation is not None:
        raise judged
    raise with_relaxation(judged, task, best)


def _judged(broken: NoFeasiblePath, task: Task, begin: Callable[[str], None]) -> NoFeasiblePath:
    """Return the answer without a path, with whether it is proved at every gamma."""
    begin("search for a proof that no motion exists")
    return at_any_gamma(broken, task)


def _bracket(broken: NoFeasiblePath, task: Task) -> str:
    """Return text on the node from which paths reach the end, and the posture change needed."""
    if broken.back is None:
        return ""
    said = f"; from the back, paths reach the end from node {broken.back} on"
    said = said if broken.back > broken.node + 1 else ""
    if broken.reached is None or broken.leaving is None:
        return said
    before, after = (
        {int(mu) for mu in task.graph.posture[task.graph.start[node] + vertices]}
        for node, vertices in ((broken.node, broken.reached), (broken.back, broken.leaving))
    )
    if before & after:
        return said
    names = (", ".join(posture_name(mu) for mu in sorted(group)) for group in (before, after))
    return f"{said}; the posture would have to change from {' to '.join(names)}"


def _proof(problem: SearchProblem, optimal: bool, finder: CollisionFreeSearch) -> Proof:
    if optimal:
        claim = finder.claimed(f"the best path on this graph under {limits_named(problem)}")
    elif problem.method == "known":
        claim = "no claim: the known technique tests neither velocity nor acceleration"
    else:
        claim = "no claim: the acceleration test of the paper's procedure is greedy"
    return Proof(optimal=optimal, statement=claim)
