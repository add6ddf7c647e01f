"""plan(): from a contour and a robot to a plan, through the layered graph and the search."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from kerfpath import refiner
from kerfpath._arrays import Array, Ints, as_pose, floats, freeze, scalar
from kerfpath.contour import Contour, FrameKind
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.kernels.metric import increments
from kerfpath.planner._graph import layered_graph, node_interval, require_no_empty_layer
from kerfpath.plans import Plan, Proof, Settings, path_cost
from kerfpath.refiner import Refinement
from kerfpath.robots import Robot
from kerfpath.search import Closure, Method, Metric, ObjectiveKind, least_interval, shortest_path

__all__ = ["plan"]

TOO_SLOW = 2.0
"""Multiple of the node interval up to which the fastest path is worth an attempt off the grid."""


def plan(
    contour: Contour,
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    speed: float | None = None,
    gamma_step: float = np.pi / 180,
    frames: FrameKind = "rotation-minimising",
    postures: Sequence[int] | None = None,
    method: Method = "exact",
    objective: ObjectiveKind = "sum",
    metric: Metric = "manhattan",
    weights: ArrayLike | None = None,
    eta_v: float = 1.0,
    eta_a: float = 1.0,
    closure: Closure = "free",
    refine: bool = False,
    graph: LayeredGraph | None = None,
    progress: Callable[[int], None] | None = None,
) -> Plan:
    """Return the best joint motion along the contour at constant speed.

    Parameters
    ----------
    contour : Contour
        Nodes in the part frame, evenly spaced (see `Contour.resample`).
    robot : Robot
        With joint limits, velocities and accelerations.
    tool : (4, 4)
        T_flange_tip, m: tip frame in the flange, z along the beam into the part.
    placement : (4, 4)
        T_base_part, m: part frame in the robot base.
    speed : float m/s
        Speed along the path; left out where the contour carries its own times.
    gamma_step : float rad
        Step of the free rotation about the beam.
    frames : {"rotation-minimising", "tangent"}
        Task frames that gamma is measured in.
    postures : sequence of int, optional
        The postures that may be used; default all. See `kerfpath.robots.postures_named`.
    method, objective, metric, weights, eta_v, eta_a, closure
        As in `shortest_path`; "periodic" closure needs a closed contour.
    refine : bool
        Move gamma off its grid afterwards, see `kerfpath.refine`. Where the grid has no path (it
        quantises acceleration), one is looked for off it.
    graph : LayeredGraph, optional
        The layered graph of this very task, kept from `layered_graph`.
    progress : callable, optional
        Called with the number of nodes whose poses have been solved since the last call.

    Raises
    ------
    NoFeasiblePath
        Says the first node where the path breaks, and what each test removed there.
    InputError
        Limits that are not known, nodes unevenly spaced, values out of range.
    """
    velocity, acceleration = robot.speed_limits()
    T_flange_tip, T_base_part = as_pose(tool, "tool"), as_pose(placement, "placement")
    dt = node_interval(contour, speed)
    if closure == "periodic" and not contour.closed:
        raise InputError(f"closure: contour {contour.name!r} is open and cannot be periodic")
    weight: Array = 1 / (velocity * dt) if weights is None else floats(weights, "weights", (6,))
    settings = Settings(
        gamma_step=scalar(gamma_step, "gamma_step", unit="rad", above=0.0),
        frames=frames,
        method=method,
        objective=objective,
        metric=metric,
        weights=freeze(weight),
        eta_v=scalar(eta_v, "eta_v", above=0.0),
        eta_a=scalar(eta_a, "eta_a", above=0.0),
        closure=closure,
    )
    graph = graph or layered_graph(
        contour,
        robot,
        tool=T_flange_tip,
        placement=T_base_part,
        gamma_step=gamma_step,
        frames=frames,
        postures=postures,
        progress=progress,
    )
    if len(graph.start) != len(contour) + 1:
        raise InputError(
            f"graph: has {len(graph.start) - 1} layers, but the contour has {len(contour)} nodes"
        )
    require_no_empty_layer(contour, graph)

    def on_grid(index: Ints, cost: float, proof: Proof) -> Plan:
        vertex = graph.start[:-1] + index
        return Plan(
            contour=contour,
            robot=robot,
            T_flange_tip=T_flange_tip,
            T_base_part=T_base_part,
            q=graph.q[vertex],
            gamma=graph.gamma[graph.sample[vertex]],
            posture=graph.posture[vertex],
            turn=graph.turn[vertex],
            time=dt * np.arange(len(contour), dtype=float),
            settings=settings,
            cost=cost,
            proof=proof,
            counts=graph.counts(),
        )

    try:
        path = shortest_path(
            graph.q,
            graph.start,
            dt=dt,
            velocity=velocity,
            acceleration=acceleration,
            endless=robot.endless,
            posture=graph.posture,
            weights=weight,
            metric=metric,
            objective=objective,
            method=method,
            closure=closure,
            eta_v=eta_v,
            eta_a=eta_a,
        )
    except NoFeasiblePath as broken:
        tried = ""
        if refine and closure == "free":
            found = _off_grid(graph, robot, settings, dt, on_grid)
            if found is not None and found.done:
                return found.plan
            tried = "" if found is None else f"; off the grid {found.statement}"
        raise NoFeasiblePath(
            f"contour {contour.name!r}: {broken}{_bracket(broken)}{tried}",
            proved=broken.proved,
            node=broken.node,
            back=broken.back,
            counts=broken.counts,
        ) from None
    made = on_grid(path.index, path.cost, _proof(method, path.optimal))
    return _refined(made) if refine else made


def _refined(made: Plan) -> Plan:
    found = refiner.refine(made)
    if found.done:
        return found.plan
    statement = f"{made.proof.statement}; {found.statement}"
    return replace(made, proof=replace(made.proof, statement=statement))


def _off_grid(
    graph: LayeredGraph,
    robot: Robot,
    settings: Settings,
    dt: float,
    on_grid: Callable[[Ints, float, Proof], Plan],
) -> Refinement | None:
    """Refine the path that asks for the least time, where that is not far from what it has.

    The grid quantises the acceleration: of a path that breaks (6) because gamma can only step, the
    continuous one close by may not.
    """
    velocity, acceleration = robot.speed_limits()
    least = least_interval(
        graph.q,
        graph.start,
        velocity=velocity,
        acceleration=acceleration,
        endless=robot.endless,
        eta_v=settings.eta_v,
        eta_a=settings.eta_a,
    )
    if least.dt > TOO_SLOW * dt:
        return None
    claim = Proof(optimal=False, statement="the fastest path on this graph")
    dq = increments(graph.q[graph.start[:-1] + least.index], robot.endless)
    cost = path_cost(dq, settings.weights, settings.metric, settings.objective)
    return refiner.refine(on_grid(least.index, cost, claim))


def _bracket(broken: NoFeasiblePath) -> str:
    if broken.back is None or broken.back <= broken.node + 1:
        return ""
    return f"; from the back, paths reach the end from node {broken.back} on"


def _proof(method: Method, optimal: bool) -> Proof:
    if optimal:
        claim = "the best path on this graph under the velocity and acceleration limits"
    elif method == "known":
        claim = "no claim: the known technique tests neither velocity nor acceleration"
    else:
        claim = "no claim: the acceleration test of the paper's procedure is greedy"
    return Proof(optimal=optimal, statement=claim)
