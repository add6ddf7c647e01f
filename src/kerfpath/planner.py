"""plan(): from a contour and a robot to a plan, through the layered graph and the search."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, as_pose, floats, freeze, scalar
from kerfpath.contour import Contour, FrameKind
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph, build, gamma_grid
from kerfpath.plans import Plan, Proof, Settings
from kerfpath.robots import Robot
from kerfpath.search import (
    Closure,
    LeastInterval,
    Method,
    Metric,
    ObjectiveKind,
    Relaxations,
    least_interval,
    least_relaxations,
    shortest_path,
)

__all__ = [
    "FastestSpeed",
    "fastest_speed",
    "layered_graph",
    "node_interval",
    "plan",
    "relaxations",
]

UNEVEN = 0.01
"""Largest relative difference of node distances that still counts as evenly spaced."""


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
    _require_no_empty_layer(contour, graph)
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
            eta_v=eta_v,
            eta_a=eta_a,
            closure=closure,
        )
    except NoFeasiblePath as broken:
        raise NoFeasiblePath(
            f"contour {contour.name!r}: {broken}{_bracket(broken)}",
            proved=broken.proved,
            node=broken.node,
            back=broken.back,
            counts=broken.counts,
        ) from None
    vertex = graph.start[:-1] + path.index
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
        cost=path.cost,
        proof=_proof(method, path.optimal),
        counts=graph.counts(),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FastestSpeed:
    """The largest constant cutting speed at which a path exists on the graph, and what binds.

    Parameters
    ----------
    speed : float m/s
    joint : int
        The joint that binds, 0-based.
    node : int
        The node where it binds.
    limit : {"velocity", "acceleration"}
        Which of its limits binds there.
    """

    speed: float
    joint: int
    node: int
    limit: Literal["velocity", "acceleration"]

    @classmethod
    def of(cls, contour: Contour, least: LeastInterval) -> FastestSpeed:
        """Return what a least node interval is as a speed along a contour."""
        spacing = contour.length / (len(contour) - 1)
        return cls(speed=spacing / least.dt, joint=least.joint, node=least.node, limit=least.limit)


def fastest_speed(
    contour: Contour,
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    gamma_step: float = np.pi / 180,
    frames: FrameKind = "rotation-minimising",
    postures: Sequence[int] | None = None,
    eta_v: float = 1.0,
    eta_a: float = 1.0,
    graph: LayeredGraph | None = None,
    progress: Callable[[int], None] | None = None,
) -> FastestSpeed:
    """Return the largest constant speed at which a path exists on the graph, exactly.

    A second-order minimax problem on the layered graph; arguments as in `plan`.

    Raises
    ------
    NoFeasiblePath
        Some node has no admissible pose at all.
    InputError
        Limits that are not known, nodes unevenly spaced, values out of range.
    """
    velocity, acceleration = robot.speed_limits()
    _require_even(contour, np.diff(contour.s), "m")
    graph = graph or layered_graph(
        contour,
        robot,
        tool=tool,
        placement=placement,
        gamma_step=gamma_step,
        frames=frames,
        postures=postures,
        progress=progress,
    )
    _require_no_empty_layer(contour, graph)
    least = least_interval(
        graph.q,
        graph.start,
        velocity=velocity,
        acceleration=acceleration,
        endless=robot.endless,
        eta_v=eta_v,
        eta_a=eta_a,
    )
    return FastestSpeed.of(contour, least)


def relaxations(
    contour: Contour,
    robot: Robot,
    graph: LayeredGraph,
    speed: float | None = None,
    *,
    eta_v: float = 1.0,
    eta_a: float = 1.0,
) -> Relaxations:
    """Return the least eta_v, eta_a and node interval, each on its own, with which a path exists.

    Arguments as in `plan`; what to ask after a `NoFeasiblePath` whose node has poses.
    """
    velocity, acceleration = robot.speed_limits()
    return least_relaxations(
        graph.q,
        graph.start,
        dt=node_interval(contour, speed),
        velocity=velocity,
        acceleration=acceleration,
        endless=robot.endless,
        eta_v=eta_v,
        eta_a=eta_a,
    )


def layered_graph(
    contour: Contour,
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    gamma_step: float = np.pi / 180,
    frames: FrameKind = "rotation-minimising",
    postures: Sequence[int] | None = None,
    progress: Callable[[int], None] | None = None,
) -> LayeredGraph:
    """Return the layered graph that `plan` searches; arguments as there."""
    H = np.ascontiguousarray(as_pose(placement, "placement") @ contour.frames(frames))
    return build(
        H,
        robot,
        T_flange_tip=as_pose(tool, "tool"),
        gamma=gamma_grid(gamma_step),
        postures=postures,
        progress=progress,
    )


def node_interval(contour: Contour, speed: float | None) -> float:
    """Return the time between neighbouring nodes, s, from the speed (m/s) or the contour's times.

    Raises
    ------
    InputError
        No speed at all, or two; a speed that is not positive; nodes unevenly spaced.
    """
    if contour.time is not None:
        if speed is not None:
            raise InputError(
                f"speed: contour {contour.name!r} carries its own times; give no speed, or "
                "resample it by spacing"
            )
        _require_even(contour, np.diff(contour.time), "s")
        return float(contour.time[-1] - contour.time[0]) / (len(contour) - 1)
    if speed is None:
        raise InputError(f"speed: contour {contour.name!r} carries no times, give a speed in m/s")
    speed = scalar(speed, "speed", unit="m/s", above=0.0)
    _require_even(contour, np.diff(contour.s), "m")
    return contour.length / (len(contour) - 1) / speed


def _require_even(contour: Contour, steps: Array, unit: str) -> None:
    low, high = float(steps.min()), float(steps.max())
    if high - low > UNEVEN * high:
        raise InputError(
            f"contour {contour.name!r}: nodes must be evenly spaced, but their steps run from "
            f"{low:.6g} to {high:.6g} {unit}; resample it first, for example with "
            f"contour.resample(count={len(contour)})"
        )


def _require_no_empty_layer(contour: Contour, graph: LayeredGraph) -> None:
    empty = np.flatnonzero(np.diff(graph.start) == 0)
    if empty.size:
        k = int(empty[0])
        counts = graph.counts(k)
        told = ", ".join(f"{word}: {number}" for word, number in counts.items())
        raise NoFeasiblePath(
            f"contour {contour.name!r}: no admissible pose at node {k} of {len(contour)} "
            f"({empty.size} such nodes); of {sum(counts.values())} candidates there, {told}",
            proved=True,
            node=k - 1,
            back=int(empty[-1]) + 1,
            counts=counts,
        )


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
