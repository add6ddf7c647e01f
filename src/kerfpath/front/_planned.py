"""One run of the planner, on the grid of gamma or over continuous gamma in the same windows.

External axes follow the courses of the best plans on the grid, and may leave them off the grid.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kerfpath._arrays import Array, freeze
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.front._subproblem import Subproblem
from kerfpath.graph import LayeredGraph
from kerfpath.kernels.metric import turns_of
from kerfpath.options import PlanOptions
from kerfpath.planner import best_motion, graph_over_courses, layered_graph, plan
from kerfpath.plans import Plan, on_turns
from kerfpath.robots import Robot

__all__ = ["follows_courses", "graph_of_runs", "plan_run"]


def follows_courses(robot: Robot, options: PlanOptions) -> bool:
    """Return whether runs on the grid use courses of the free joints instead of a grid of them."""
    return bool(robot.free.size) and options.method == "continuous"


def graph_of_runs(
    contour: Contour,
    robot: Robot,
    *,
    tool: Array,
    placement: Array,
    speed: float | None,
    options: PlanOptions,
    cell: Cell | None,
    progress: Callable[[int], None] | None = None,
) -> LayeredGraph:
    """Return the layered graph that all runs of a front share.

    Arguments are as in `kerfpath.plan`; the options are those of the front, not of one run.

    Raises
    ------
    NoFeasiblePath
        No course of the external axes leads to a plan.
    InputError
        As `kerfpath.plan`.
    """
    if not follows_courses(robot, options):
        return layered_graph(
            contour, robot, tool=tool, placement=placement, options=options, progress=progress
        )
    asked = replace(options, feed="constant", certify=None)
    return graph_over_courses(
        contour, robot, tool=tool, placement=placement, speed=speed, options=asked, cell=cell,
        progress=progress,
    )  # fmt: skip


def plan_run(
    run: Subproblem,
    contour: Contour,
    robot: Robot,
    *,
    tool: Array,
    placement: Array,
    speed: float | None,
    options: PlanOptions,
    graph: LayeredGraph,
    cell: Cell | None,
    phase: Callable[[str], None] | None = None,
) -> Plan:
    """Return the plan of a run.

    On the grid, windows remove vertices. Over continuous gamma they also become joint limits, so
    that the motion between samples stays in them; where they leave a node without a vertex, a
    course of the external axes is searched within them. A plan over continuous gamma keeps the
    run's shares of the limits, but states those of `options`, which apply to other moves and to its
    proof.

    Parameters
    ----------
    run : Subproblem
    contour, robot, tool, placement, speed, cell, phase
        As in `kerfpath.plan`.
    options : PlanOptions
        Options of the front; the run replaces some of them.
    graph : LayeredGraph
        The graph of the contour with all its vertices.

    Raises
    ------
    NoFeasiblePath
        As `kerfpath.plan`; over continuous gamma also where no motion is found, or a window cannot
        become a joint limit.
    InputError
        As `kerfpath.plan`.
    """
    asked, graph = run.applied_to(options), run.graph(graph, robot.endless)
    cell, arm = run.cell(cell), robot
    windowed = run.windowed(robot.endless) if run.continuous else []
    if windowed:
        _require_ranges(asked, windowed)
        arm, graph = _narrowed(robot, graph, run.window, windowed, asked)
        cell = cell and replace(cell, endless=arm.endless)
    empty = run.continuous and robot.externals and not np.diff(graph.start).all()
    made = (best_motion if run.continuous else plan)(
        contour, arm, tool=tool, placement=placement, speed=speed, options=asked, cell=cell,
        graph=None if empty else graph, phase=phase,
    )  # fmt: skip
    if not run.continuous:
        return made
    limits = replace(made.settings, eta_v=options.eta_v, eta_a=options.eta_a)
    return replace(_widened(made, robot) if windowed else made, settings=limits)


def _require_ranges(options: PlanOptions, windowed: list[int]) -> None:
    """Raise NoFeasiblePath where turning windows into joint limits would change other terms too."""
    why = ""
    comfort = options.comfort
    if comfort is not None and comfort.limits is not None and comfort.limits.cost:
        why = "comfort has a penalty close to joint limits, which a window would move"
    elif options.rotation is not None and np.isfinite(options.rotation[windowed]).any():
        why = "the rotation of a joint with a window is limited"
    if why:
        raise NoFeasiblePath(f"windows hold on the grid only: {why}", proved=False, node=-1)


def _narrowed(
    robot: Robot, graph: LayeredGraph, window: Array, windowed: list[int], options: PlanOptions
) -> tuple[Robot, LayeredGraph]:
    """Return the robot with joint limits at the windows, and the graph on the turns within them.

    Where a margin is kept from limits, the limits lie beyond the windows by that margin.
    """
    band = None if options.comfort is None else options.comfort.limits
    margin = 0.0 if band is None else band.margin
    limits = robot.joint_limits()
    lower, upper, endless = limits.lower.copy(), limits.upper.copy(), robot.endless.copy()
    q, turn = graph.q.copy(), graph.turn.copy()
    for joint in windowed:
        low, high = window[joint]
        if endless[joint]:
            q[:, joint] = low + (q[:, joint] - low) % (2 * np.pi)
            turn[:, joint] = turns_of(q[:, joint])
            lower[joint], upper[joint], endless[joint] = low - margin, high + margin, False
        else:
            lower[joint] = max(lower[joint], low - margin)
            upper[joint] = min(upper[joint], high + margin)
    arm = robot.with_limits(lower=lower, upper=upper, endless=endless)
    return arm, replace(graph, q=freeze(q), turn=freeze(turn))


def _widened(made: Plan, robot: Robot) -> Plan:
    """Return a plan of the robot with narrowed limits as a plan of the original robot."""
    q, turn = on_turns(robot, made.q)
    return replace(made, robot=robot, q=q, turn=turn)
