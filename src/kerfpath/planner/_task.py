"""A planning task with everything in it cast and checked, and the plans that answer it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Ints, as_pose, freeze
from kerfpath._repr import short_repr
from kerfpath.certifier import closed_node
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.kernels.metric import increments, wrap
from kerfpath.options import PlanOptions
from kerfpath.planner._graph import (
    layered_graph,
    node_interval,
    require_no_empty_layer,
    samples_of,
    within_margins,
)
from kerfpath.plans import Plan, Proof, path_cost
from kerfpath.robots import Robot
from kerfpath.search import ContinuousPath, GammaSamples, SearchProblem
from kerfpath.tilt import Tilt

__all__ = ["PlanningTask", "task_of"]

MOST_EMPTY = 8
"""Nodes without a pose that are looked at for a proof that they have none at any gamma."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanningTask:
    """One contour for one robot, its settings and its layered graph.

    Parameters
    ----------
    contour : Contour
    robot : Robot
    T_flange_tip, T_base_part : (4, 4) m
    settings : PlanOptions
        With the weights that are used.
    graph : LayeredGraph
        No layer of it is empty.
    problem : SearchProblem
        What is asked of a path through it, at the speed asked for.
    """

    contour: Contour
    robot: Robot
    T_flange_tip: Array
    T_base_part: Array
    settings: PlanOptions
    graph: LayeredGraph
    problem: SearchProblem

    __repr__ = short_repr

    @property
    def dt(self) -> float:
        """Time from node to node at the speed asked for, s."""
        return self.problem.dt

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
            T_flange_tip=self.T_flange_tip,
            T_base_part=self.T_base_part,
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
        """How the vertices of the graph lie on circles of gamma."""
        return samples_of(self.graph)

    def plan_between(self, path: ContinuousPath, proof: Proof) -> Plan:
        """Return the plan of a path between the samples, its joints interpolated as the path's.

        With a periodic closure gamma is moved along the path so that it ends where it begins.
        """
        graph, s, near = self.graph, self.settings, path.one
        gamma = graph.gamma[graph.sample[near]] + path.share * 2 * np.pi / len(graph.gamma)
        if s.closure == "periodic":
            gamma = gamma - np.linspace(0.0, wrap(gamma[-1] - gamma[0]), len(gamma))
        made = Plan(
            contour=self.contour,
            robot=self.robot,
            T_flange_tip=self.T_flange_tip,
            T_base_part=self.T_base_part,
            q=path.q,
            gamma=gamma,
            tilt=graph.tilt[graph.variant[near]],
            posture=graph.posture[near].astype(np.int64),
            turn=graph.turn[near].astype(np.int64),
            time=self.times,
            settings=s,
            cost=0.0,
            proof=proof,
            counts=graph.counts(),
        )
        dq = made.increments
        return replace(made, cost=path_cost(dq, s.weights, s.metric, s.objective, made.node_cost))

    def part(self, first: int, last: int, name: str) -> PlanningTask:
        """Return the task of nodes first to last alone."""
        part = self.contour.part(first, last, self.settings.frames)
        vertices = slice(self.graph.start[first], self.graph.start[last + 1])
        graph = self.graph.part(first, last)
        return replace(
            self,
            contour=replace(part, name=name),
            graph=graph,
            problem=replace(
                self.problem,
                q=graph.q,
                start=graph.start,
                vertex_cost=self.problem.vertex_cost[vertices],
            ),
        )


def task_of(
    contour: Contour,
    robot: Robot,
    options: PlanOptions,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    speed: float | None = None,
    graph: LayeredGraph | None = None,
    progress: Callable[[int], None] | None = None,
) -> PlanningTask:
    """Return the task that the arguments of `kerfpath.plan` pose; errors as there."""
    T_flange_tip, T_base_part = as_pose(tool, "tool"), as_pose(placement, "placement")
    dt = node_interval(contour, speed)
    if options.closure == "periodic" and not contour.closed:
        raise InputError(f"closure: contour {contour.name!r} is open and cannot be periodic")
    options = options.resolve(robot, dt)
    if graph is None:
        graph = layered_graph(
            contour,
            robot,
            tool=T_flange_tip,
            placement=T_base_part,
            options=replace(options, comfort=None, retract=None, floor=None),
            progress=progress,
        )
    _require_fitting(graph, contour, robot, options.tilt)
    periodic = options.closure == "periodic"
    graph = within_margins(graph, robot, options, T_flange_tip, periodic=periodic)
    try:
        require_no_empty_layer(contour, graph)
    except NoFeasiblePath as empty:
        frames = T_base_part @ contour.frames(options.frames)
        raise _at_any_gamma(empty, graph, robot, frames, T_flange_tip, options) from None
    return PlanningTask(
        contour=contour,
        robot=robot,
        T_flange_tip=T_flange_tip,
        T_base_part=T_base_part,
        settings=options,
        graph=graph,
        problem=SearchProblem(
            q=graph.q,
            start=graph.start,
            dt=dt,
            limits=options.limits(robot),
            endless=robot.endless,
            vertex_cost=_vertex_cost(graph, options, robot, T_flange_tip),
            weights=options.weights,
            metric=options.metric,
            objective=options.objective,
            closure=options.closure,
            rotation=options.rotation,
            method="exact" if options.method == "continuous" else options.method,
            posture=graph.posture if options.method == "known" else None,
        ),
    )


def _at_any_gamma(
    empty: NoFeasiblePath,
    graph: LayeredGraph,
    robot: Robot,
    frames: Array,
    tool: Array,
    options: PlanOptions,
) -> NoFeasiblePath:
    """Return that nodes are without a pose, and whether one of them is so at every gamma."""
    if not robot.encloses or options.tilt is not None:
        return empty
    nodes = np.flatnonzero(np.diff(graph.start) == 0)[:MOST_EMPTY]
    closed = closed_node(robot, frames, tool, nodes, options.postures)
    if closed is None:
        return empty.with_message(f"{empty}; whether it has one off the grid is undecided")
    return empty.with_message(f"{empty}; proved for every rotation: {closed}", closed=closed)


def _require_fitting(
    graph: LayeredGraph, contour: Contour, robot: Robot, tilt: Tilt | None
) -> None:
    """Raise InputError where a graph is not one of this contour, robot and tilt."""
    if len(graph.start) != len(contour) + 1:
        raise InputError(
            f"graph: has {len(graph.start) - 1} layers, but the contour has {len(contour)} nodes"
        )
    tilts = np.zeros((1, 2)) if tilt is None else tilt.samples()
    if not np.array_equal(graph.tilt, np.repeat(tilts, len(graph.tilt) // len(tilts), axis=0)):
        raise InputError("graph: it was built with another tilt than is planned with")
    if graph.q.shape[1] != robot.joints:
        raise InputError(
            f"graph: its vertices have {graph.q.shape[1]} joints, but the robot has {robot.joints}"
        )


def _vertex_cost(
    graph: LayeredGraph, options: PlanOptions, robot: Robot, tool: Array
) -> Array | None:
    """Return what the vertices cost (N,); None where they cost nothing."""
    tilt, comfort, costs = options.tilt, options.comfort, []
    if tilt is not None and tilt.cost:
        costs.append(tilt.price(graph.tilt)[graph.variant])
    if comfort is not None and any(band.cost for band in comfort.bands.values()):
        costs.append(comfort.price(robot, graph.q, tool))
    return freeze(np.sum(costs, axis=0)) if costs else None
