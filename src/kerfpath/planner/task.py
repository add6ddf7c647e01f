"""Planning task: its checked inputs, its layered graph, and the plans of its paths."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Bools, Ints, freeze, short_repr
from kerfpath.certifier import closed_node
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.kernels.metric import increments, wrap
from kerfpath.kernels.search import NO_REVERSALS, ReversalPrices
from kerfpath.losses import Loss
from kerfpath.options import PlanOptions
from kerfpath.planner.folding import folds
from kerfpath.planner.layers import (
    course_of,
    layered_graph,
    node_interval,
    require_held,
    require_no_empty_layer,
    require_windows_fit,
    samples_of,
    within_margins,
)
from kerfpath.planner.straight_moves import largest_steps
from kerfpath.plans import STILL, Plan, Proof, on_turns, path_cost
from kerfpath.robots import Robot
from kerfpath.search import ContinuousPath, GammaSamples, SearchProblem
from kerfpath.setup import Setup
from kerfpath.windows import with_window_ends

MOST_EMPTY = 8
"""Most nodes without a pose for which a proof is tried that they have none at any gamma."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layered:
    """A layered graph and the search problem on it.

    Parameters
    ----------
    graph : LayeredGraph
    problem : SearchProblem
    """

    graph: LayeredGraph
    problem: SearchProblem

    __repr__ = short_repr

    def at_nodes(self, nodes: Ints) -> Layered:
        """Return the graph of some nodes (M,), ascending, with the same search problem."""
        kept = np.zeros(len(self.graph.start) - 1, np.bool_)
        kept[nodes] = True
        return self._of(self.graph.at_nodes(nodes), np.repeat(kept, np.diff(self.graph.start)))

    def part(self, first: int, last: int) -> Layered:
        """Return the graph of nodes `first` to `last`, with the same search problem."""
        vertices = slice(self.graph.start[first], self.graph.start[last + 1])
        return self._of(self.graph.part(first, last), vertices)

    def _of(self, graph: LayeredGraph, vertices: Bools | slice) -> Layered:
        cost = self.problem.vertex_cost[vertices]
        problem = replace(self.problem, q=graph.q, start=graph.start, vertex_cost=cost)
        return Layered(graph=graph, problem=problem)


@dataclass(frozen=True, kw_only=True, eq=False)  # no slots: the cached property needs a dict
class Task:
    """One contour in one setup, with settings and a layered graph that is built when needed.

    Parameters
    ----------
    contour : Contour
    setup : Setup
    settings : PlanOptions
        Options with the weights that are used.
    dt : float s
        Time from node to node at the speed asked for.
    external : (K, E) rad or m, optional
        Course of the joints that a pose leaves free; None: a grid of their values at every node.
    placed : bool
        Whether the course, or the graph, was given with the task.
    layers : callable
        Builds the layers of some nodes (M,) of a task, or of all nodes if given None; then it
        raises NoFeasiblePath if a layer is empty.
    """

    contour: Contour
    setup: Setup
    settings: PlanOptions
    dt: float
    layers: Callable[[Task, Ints | None], Layered]
    external: Array | None = None
    placed: bool = False

    __repr__ = short_repr

    @property
    def robot(self) -> Robot:
        """The robot of the setup."""
        return self.setup.robot

    @cached_property
    def built(self) -> Layered:
        """The layers of all nodes, built on first access; NoFeasiblePath if one is empty."""
        return self.layers(self, None)

    @property
    def is_built(self) -> bool:
        """Whether the layers of all nodes are built."""
        return "built" in vars(self)

    @property
    def graph(self) -> LayeredGraph:
        """The layered graph of all nodes."""
        return self.built.graph

    @property
    def problem(self) -> SearchProblem:
        """The search problem on the graph, at the speed asked for."""
        return self.built.problem

    def whole(self) -> Task:
        """Return the task with the layers of all nodes built.

        Raises
        ------
        NoFeasiblePath
            A node has no pose.
        """
        return self.on(self.built)

    def with_problem(self, problem: SearchProblem) -> Task:
        """Return the task with another search problem on the same graph."""
        return self.on(Layered(graph=self.graph, problem=problem))

    def on(self, layered: Layered) -> Task:
        """Return the task with a graph that is already built."""

        def layers(task: Task, nodes: Ints | None) -> Layered:
            return layered if nodes is None else layered.at_nodes(nodes)

        return replace(self, dt=layered.problem.dt, layers=layers)

    def sampled(self, step: float) -> Task:
        """Return the task with another step of gamma, rad; its graph is not built yet."""
        return self.with_settings(replace(self.settings, gamma_step=step))

    def with_settings(self, settings: PlanOptions) -> Task:
        """Return the task with other settings; its graph is not built yet."""
        return replace(self, settings=settings, layers=_layers)

    def along(self, external: Array) -> Task:
        """Return the task along another course (K, E) rad or m; its graph is not built yet."""
        return replace(self, external=external, placed=True, layers=_layers)

    def at_nodes(self, nodes: Ints) -> Layered:
        """Return the layers of some nodes (M,), ascending, without building those of all nodes."""
        return self.built.at_nodes(nodes) if self.is_built else self.layers(self, nodes)

    @property
    def times(self) -> Array:
        """Times (K,) of the nodes at the speed asked for, s."""
        return self.dt * np.arange(len(self.contour), dtype=float)

    def cost(self, index: Ints) -> float:
        """Return the objective (14) or (15) of a path through the graph, vertex costs included."""
        s, vertex = self.settings, self.graph.start[:-1] + index
        return path_cost(
            increments(self.graph.q[vertex], self.robot.endless),
            s.weights,
            s.metric,
            s.objective,
            self.problem.vertex_cost[vertex],
        )

    def plan(self, index: Ints, cost: float, proof: Proof) -> Plan:
        """Return the plan of a path through the graph, at the speed asked for."""
        graph = self.graph
        vertex = graph.start[:-1] + index
        return Plan(
            contour=self.contour,
            robot=self.robot,
            T_flange_tip=self.setup.tool,
            T_base_part=self.setup.placement,
            q=graph.q[vertex],
            gamma=graph.gamma[graph.sample[vertex]],
            tilt=graph.tilt[graph.variant[vertex]],
            posture=graph.posture[vertex],
            turn=graph.turn[vertex],
            time=self.times,
            settings=self.settings,
            cost=cost,
            proof=proof,
            counts=graph.counts(),
        )

    @property
    def samples(self) -> GammaSamples:
        """The positions of the vertices of the graph on circles of gamma."""
        return samples_of(self.graph)

    def plan_between(self, path: ContinuousPath, proof: Proof) -> Plan:
        """Return the plan of a path between the samples, with the interpolated joints of the path.

        With a periodic closure gamma is shifted along the path so that it ends where it begins.
        """
        graph, near = self.graph, path.one
        sample = graph.sample[near].astype(np.int64)
        below, above = graph.gamma_at(sample), graph.gamma_at(sample + 1)
        gamma = below + path.share * (above - below)
        posture, tilt = graph.posture[near].astype(np.int64), graph.tilt[graph.variant[near]]
        return self.plan_at(self.closed(gamma), path.q, posture, proof, tilt)

    def closed(self, gamma: Array) -> Array:
        """Return gamma (K,) rad, shifted along the path if it must end where it begins."""
        if self.settings.closure != "periodic":
            return gamma
        return np.asarray(gamma - np.linspace(0.0, wrap(gamma[-1] - gamma[0]), len(gamma)))

    def plan_at(
        self, gamma: Array, q: Array, posture: Ints, proof: Proof, tilt: Array | None = None
    ) -> Plan:
        """Return the plan of a motion with joints near q (K, n) rad, which need not be in reach."""
        s, (wrapped, turn) = self.settings, on_turns(self.robot, q)
        made = Plan(
            contour=self.contour,
            robot=self.robot,
            T_flange_tip=self.setup.tool,
            T_base_part=self.setup.placement,
            q=wrapped,
            gamma=gamma,
            tilt=np.zeros((len(gamma), 2)) if tilt is None else tilt,
            posture=posture,
            turn=turn,
            time=self.times,
            settings=s,
            cost=0.0,
            proof=proof,
            counts=self.graph.counts(),
        )
        dq = made.increments
        return replace(made, cost=path_cost(dq, s.weights, s.metric, s.objective, made.node_cost))

    def part(self, first: int, last: int, name: str) -> Task:
        """Return the task of nodes `first` to `last`, as a contour with another name."""
        part = self.contour.part(first, last, self.settings.frames)
        x = None if self.external is None else self.external[first : last + 1]
        part = replace(part, name=name)
        return replace(self.on(self.built.part(first, last)), contour=part, external=x)


def planning_task(
    contour: Contour,
    setup: Setup,
    options: PlanOptions,
    *,
    speed: float | None = None,
    graph: LayeredGraph | None = None,
    external: ArrayLike | None = None,
    progress: Callable[[int], None] | None = None,
    unfold: Bools | None = None,
) -> Task:
    """Return the task of a contour in a setup; other arguments and errors as in `kerfpath.plan`.

    Nodes without a pose are found only when its graph is built. All joints that may be are folded,
    see `kerfpath.planner.folding`, except joints `unfold` (n,); None: none are.
    """
    robot = setup.robot
    dt = node_interval(contour, speed)
    if options.closure == "periodic" and not contour.closed:
        raise InputError(f"closure: contour {contour.name!r} is open and cannot be periodic")
    options = options.resolve(robot, dt)
    require_held(robot, options)
    require_windows_fit(contour, robot, options)
    x = None if external is None else course_of(external, contour, robot)[:, 0]
    joints = np.zeros(robot.joints, np.bool_)
    if unfold is not None:
        joints = folds(robot, options, dt) & ~unfold
    given = graph is not None
    if graph is not None:
        _require_fitting(graph, contour, robot, options)
        x = _course_in(graph)
        graph = None if (graph.is_folded & ~joints).any() else graph.fold(joints)
    setup = setup.folded(joints)
    return Task(
        contour=contour,
        setup=setup,
        settings=options,
        dt=dt,
        layers=partial(_layers, graph=graph, progress=progress),
        external=x,
        placed=given or external is not None,
    )


def _course_in(graph: LayeredGraph) -> Array | None:
    """Return the course (K, E) along which a graph was built; None if it has a grid or none."""
    x = graph.external
    return x[:, 0] if x is not None and x.shape[1] == 1 else None


def _layers(
    task: Task,
    nodes: Ints | None,
    graph: LayeredGraph | None = None,
    progress: Callable[[int], None] | None = None,
) -> Layered:
    """Build the layers of some nodes (M,) of a task, or of all, from a graph if one is given."""
    contour, robot, options, tool = task.contour, task.robot, task.settings, task.setup.tool
    if graph is None:
        graph = layered_graph(
            contour,
            robot,
            tool=tool,
            placement=task.setup.placement,
            options=replace(options, comfort=None, retract=None, floor=None),
            nodes=nodes,
            external=task.external,
            progress=progress,
        )
    elif nodes is not None:
        graph = graph.at_nodes(nodes)
    # The first and the last of some nodes need not be the ends of the contour.
    whole = nodes is None or (nodes[0] == 0 and nodes[-1] == len(contour) - 1)
    kept = options if whole else replace(options, retract=None)
    periodic = options.closure == "periodic"
    s = contour.s if nodes is None else contour.s[nodes]
    graph = within_margins(graph, robot, kept, tool, s, periodic=periodic)
    try:
        if nodes is None:
            require_no_empty_layer(contour, graph)
    except NoFeasiblePath as empty:
        frames = task.setup.placement @ contour.frames(options.frames)
        raise _at_any_gamma(empty, graph, robot, frames, tool, options) from None
    problem = SearchProblem(
        q=graph.q,
        start=graph.start,
        dt=task.dt,
        limits=options.limits(robot),
        endless=robot.endless,
        vertex_cost=_vertex_cost(graph, options, robot, tool),
        weights=options.weights,
        metric=options.metric,
        objective=options.objective,
        closure=options.closure,
        rotation=options.rotation,
        most=largest_steps(contour, robot) if options.feed == "dip" else None,
        method="exact" if options.method == "continuous" else options.method,
        posture=graph.posture if options.method == "known" else None,
        reversals=reversal_prices(options, robot, task.dt),
    )
    return Layered(graph=graph, problem=problem)


def _at_any_gamma(
    empty: NoFeasiblePath,
    graph: LayeredGraph,
    robot: Robot,
    frames: Array,
    tool: Array,
    options: PlanOptions,
) -> NoFeasiblePath:
    """Return the answer that nodes have no pose, with whether one has none at every gamma."""
    if (kept := empty.lost_by(Loss.PINNED)) and empty.counts[kept[0]]:
        left = empty.counts[kept[0]]
        empty = empty.with_message(f"{empty}; without the windows of gamma {left} would be left")
    if not robot.encloses or options.tilt is not None:
        return empty
    nodes = np.flatnonzero(np.diff(graph.start) == 0)[:MOST_EMPTY]
    closed = closed_node(robot, frames, tool, nodes, options.postures)
    if closed is None:
        return empty.with_message(f"{empty}; whether it has one off the grid is undecided")
    return empty.with_message(f"{empty}; proved for every rotation: {closed}", closed=closed)


def _require_fitting(
    graph: LayeredGraph, contour: Contour, robot: Robot, options: PlanOptions
) -> None:
    """Raise InputError if a graph does not fit the contour, the robot, its tilt or its windows."""
    tilt, windows = options.tilt, options.gamma_windows
    if len(graph.start) != len(contour) + 1:
        raise InputError(
            f"graph: has {len(graph.start) - 1} layers, but the contour has {len(contour)} nodes"
        )
    tilts = np.zeros((1, 2)) if tilt is None else tilt.samples()
    if not np.array_equal(graph.tilt, np.repeat(tilts, len(graph.tilt) // len(tilts), axis=0)):
        raise InputError("graph: it was built with another tilt than the plan has; build it again")
    if len(with_window_ends(graph.gamma, windows)) != len(graph.gamma):
        raise InputError(
            "graph: it was built without the windows of gamma that the plan has; build it again"
        )
    if graph.q.shape[1] != robot.joints:
        raise InputError(
            f"graph: its vertices have {graph.q.shape[1]} joints, but the robot has {robot.joints}"
        )


def _vertex_cost(
    graph: LayeredGraph, options: PlanOptions, robot: Robot, tool: Array
) -> Array | None:
    """Return the costs of the vertices (N,); None if no cost applies."""
    tilt, comfort, costs = options.tilt, options.comfort, []
    if tilt is not None and tilt.cost:
        costs.append(tilt.price(graph.tilt)[graph.variant])
    if comfort is not None and any(band.cost for band in comfort.bands.values()):
        costs.append(comfort.price(robot, graph.q, tool))
    return freeze(np.sum(costs, axis=0)) if costs else None


def reversal_prices(options: PlanOptions, robot: Robot, dt: float) -> ReversalPrices:
    """Return the costs of joints that turn back, for nodes `dt` s apart."""
    if options.comfort is None or not options.comfort.prices_reversals:
        return NO_REVERSALS
    return ReversalPrices(options.comfort.price_of_reversals(robot), STILL * dt)
