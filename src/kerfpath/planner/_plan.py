"""plan(): from a contour and a robot to a plan, through the layered graph and the search."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from kerfpath import refiner
from kerfpath.cell import Cell
from kerfpath.contour import Contour, FrameKind
from kerfpath.errors import NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.kernels.metric import increments
from kerfpath.planner._clear import clear_search, only_if_clear, require_same_cell
from kerfpath.planner._task import Task, refined, task_of
from kerfpath.plans import Plan, Proof, path_cost
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
    cell: Cell | None = None,
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
    cell : Cell, optional
        The plan is clear in it, at the nodes and on straight joint motions between them: the best
        of all clear ones, though only what the search wants to use is checked. Exact method only.
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
    task = task_of(
        contour,
        robot,
        tool=tool,
        placement=placement,
        speed=speed,
        gamma_step=gamma_step,
        frames=frames,
        postures=postures,
        method=method,
        objective=objective,
        metric=metric,
        weights=weights,
        eta_v=eta_v,
        eta_a=eta_a,
        closure=closure,
        graph=graph,
        progress=progress,
    )
    clear = ""
    try:
        if cell is None:
            path = shortest_path(
                **task.limits,
                **task.aim,
                posture=task.graph.posture,
                method=method,
                closure=closure,
            )
        else:
            require_same_cell(task, cell)
            path, clear = clear_search(task, cell)
    except NoFeasiblePath as broken:
        off_grid = _off_grid(task) if refine and closure == "free" and cell is None else None
        if off_grid is not None and off_grid.done:
            return off_grid.plan
        tried = "" if off_grid is None else f"; off the grid {off_grid.statement}"
        raise NoFeasiblePath(
            f"contour {contour.name!r}: {broken}{_bracket(broken)}{tried}",
            proved=broken.proved,
            node=broken.node,
            back=broken.back,
            counts=broken.counts,
        ) from None
    made = task.plan(path.index, path.cost, _proof(method, path.optimal, clear))
    if not refine:
        return made
    return refined(made) if cell is None else only_if_clear(refined(made), made, cell)


def _off_grid(task: Task) -> Refinement | None:
    """Refine the path that asks for the least time, where that is not far from what it has.

    The grid quantises the acceleration: of a path that breaks (6) because gamma can only step, the
    continuous one close by may not.
    """
    least = least_interval(**task.limits)
    if least.dt > TOO_SLOW * task.dt:
        return None
    settings = task.settings
    dq = increments(task.graph.q[task.graph.start[:-1] + least.index], task.robot.endless)
    cost = path_cost(dq, settings.weights, settings.metric, settings.objective)
    claim = Proof(optimal=False, statement="the fastest path on this graph")
    return refiner.refine(task.plan(least.index, cost, claim))


def _bracket(broken: NoFeasiblePath) -> str:
    if broken.back is None or broken.back <= broken.node + 1:
        return ""
    return f"; from the back, paths reach the end from node {broken.back} on"


def _proof(method: Method, optimal: bool, clear: str) -> Proof:
    if optimal:
        claim = "the best path on this graph under the velocity and acceleration limits"
        claim += f", {clear}" if clear else ""
    elif method == "known":
        claim = "no claim: the known technique tests neither velocity nor acceleration"
    else:
        claim = "no claim: the acceleration test of the paper's procedure is greedy"
    return Proof(optimal=optimal, statement=claim)
