"""The fastest constant speed along a contour, and the relaxations that give a path."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import scalar
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.graph import LayeredGraph
from kerfpath.options import GraphKeywords, Interpolation, PlanOptions, with_keywords
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.external_motion import along_a_course, faster_motions
from kerfpath.planner.impossible import binding_nodes, impossible_share
from kerfpath.planner.layers import longest_step, node_interval, require_even
from kerfpath.planner.quickest import QuickMotion, quick_motions
from kerfpath.planner.task import Task, planning_task
from kerfpath.robots import Robot
from kerfpath.search import (
    LeastInterval,
    Relaxations,
    SearchProblem,
    find_least_interval,
    find_relaxations,
)
from kerfpath.setup import Setup


class SpeedKeywords(GraphKeywords, total=False):
    """The options that `fastest_speed` takes as keywords."""

    eta_v: float
    eta_a: float
    interpolation: Interpolation
    refine: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class FastestSpeed:
    """Largest constant cutting speed at which a path exists, and the limit that binds.

    Parameters
    ----------
    speed : float m/s
    joint : int
        The joint that binds, 0-based.
    node : int
        The node where it binds.
    limit : {"velocity", "acceleration"}
        The limit of the joint that binds.
    on_grid : float m/s, optional
        Largest speed on the grid, if a higher one was found off it.
    ceiling : float m/s, optional
        Speed from which on it is proved that no motion keeps the limits at the nodes, at any gamma,
        posture and turn.
    """

    speed: float
    joint: int
    node: int
    limit: Literal["velocity", "acceleration"]
    on_grid: float | None = None
    ceiling: float | None = None

    @classmethod
    def of(cls, contour: Contour, least: LeastInterval) -> FastestSpeed:
        """Return the speed along a contour that has a least node interval."""
        speed = longest_step(contour) / least.dt
        return cls(speed=speed, joint=least.joint, node=least.node, limit=least.limit)


def fastest_speed(
    contour: Contour,
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    options: PlanOptions | None = None,
    cell: Cell | None = None,
    graph: LayeredGraph | None = None,
    external: ArrayLike | None = None,
    progress: Callable[[int], None] | None = None,
    ceiling: bool = False,
    enough: float | None = None,
    explore: bool = True,
    **keywords: Unpack[SpeedKeywords],
) -> FastestSpeed:
    """Return the largest constant speed at which a path exists: exact on the graph, or off it.

    On the layered graph this is a second-order minimax problem. The speed is that of `plan`, which
    counts for the longest step between two nodes, and `plan` finds a motion at it, too. A contour
    with its own times, as of `Contour.resample` with `dt`, is slower where it has a share of the
    speed; all its times change by the same factor.

    Parameters
    ----------
    contour, robot, tool, placement, cell, graph, external, progress
        As in `plan`. Without `external`, external axes and the elbow of a seven-axis arm follow the
        gentlest course.
    options : PlanOptions, optional
        Only gamma_step, frames, tilt, postures, comfort, eta_v, eta_a, interpolation and refine
        matter, which are also keywords. The grid quantises the acceleration, so `refine` moves
        gamma and external axes off it, from the fastest path and from others, to faster motions
        that are clear, can be followed between the nodes, and keep the margins of `comfort`, which
        may have no costs here. The result is the best motion found, not proved to be the best.
    ceiling : bool
        Whether to prove, with a limited amount of work, from which speed on there is no motion at
        all, on the grid or off it; see `FastestSpeed.ceiling`.
    enough : float m/s, optional
        Off the grid the search may stop once it has reached this speed.
    explore : bool
        Whether to explore all valleys at last. Without, the speed may be some per cent lower, after
        a fraction of the time.

    Raises
    ------
    NoFeasiblePath
        A node has no admissible pose, or no path is clear in the cell.
    InputError
        Limits that are not known, limits on torque or jerk, nodes unevenly spaced, values out of
        range, or costs of comfort.
    """
    require_rates_alone(robot, "the fastest speed")
    if contour.time is None:
        require_even(contour, np.diff(contour.s), "m")
    else:  # all times changed so that the longest step is made at 1 m/s
        slower = longest_step(contour) / node_interval(contour, None)
        contour = replace(contour, time=contour.time * slower)
    asked = with_keywords(options, keywords, SpeedKeywords)
    if enough is not None:
        enough = scalar(enough, "enough", unit="m/s", above=0.0)
    comfort = asked.comfort
    if comfort is not None and comfort.costs:
        raise InputError("comfort: the fastest speed takes no costs; give margins only")
    task = planning_task(
        contour,
        Setup.of(robot, tool, placement, cell),
        PlanOptions(**{name: getattr(asked, name) for name in SpeedKeywords.__annotations__}),
        speed=1.0 if contour.time is None else None,
        graph=graph,
        external=external,
        progress=progress,
    )
    finder = CollisionFreeSearch(task)
    along = along_a_course(task, finder.clear, at_any_speed=True)
    found, nodes = _fastest(task, along.whole(), finder, enough, explore)
    if not ceiling:
        return found
    interval = longest_step(contour) / found.speed
    share = impossible_share(along, interval, nodes)
    return found if share is None else replace(found, ceiling=found.speed / share)


def require_rates_alone(robot: Robot, what: str) -> None:
    """Raise InputError if the torque or the jerk of a robot is limited; `what` needs them free."""
    for name, limit in (("torque", robot.torque_limit()), ("jerk", robot.jerk_limit())):
        if limit is not None:
            raise InputError(
                f"{what}: takes limits on velocity and acceleration only, but the robot has limits "
                f"on {name}; use the robot without them"
            )


def _fastest(
    task: Task, along: Task, finder: CollisionFreeSearch, enough: float | None, explore: bool
) -> tuple[FastestSpeed, list[int]]:
    """Return the largest speed, on the grid or with `refine` off it, and the nodes where it binds.

    The first node is that of the speed. `along` is the task along the first course of its external
    axes.
    """
    there = finder.of(along)
    if not (task.settings.refine and task.robot.family.free_rotation):
        least = there.find(find_least_interval, along.problem.free())
        found = FastestSpeed.of(task.contour, least)
        return found, [found.node]
    motions, step = list[QuickMotion](), longest_step(task.contour)
    fixed = task.placed or not task.robot.free.size or task.settings.method != "continuous"
    ways = quick_motions(along, there, explore=explore)
    for quick in ways if fixed else _over_courses(task, finder, ways):
        motions.append(quick)
        if enough is not None and step / quick.dt >= enough:
            break
    found = FastestSpeed(
        speed=step / quick.dt,
        joint=quick.at.joint,
        node=quick.at.node,
        limit=quick.at.limit,
        on_grid=step / quick.on_grid if quick.dt < quick.on_grid else None,
    )
    return found, binding_nodes(motions)


def _over_courses(
    task: Task, finder: CollisionFreeSearch, ways: Iterator[QuickMotion]
) -> Iterator[QuickMotion]:
    """Yield ever faster motions: the first two along one course, then those along others."""
    for best in islice(ways, 2):
        yield best
    yield from faster_motions(task, finder, best)


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

    Arguments are as in `plan`. Call it after a `NoFeasiblePath` whose node has poses.

    Raises
    ------
    NoFeasiblePath
        A layer of the graph is empty.
    InputError
        Limits that are not known, limits on torque or jerk, or values out of range.
    """
    require_rates_alone(robot, "relaxations")
    problem = SearchProblem(
        q=graph.q,
        start=graph.start,
        dt=node_interval(contour, speed),
        limits=PlanOptions(eta_v=eta_v, eta_a=eta_a).limits(robot),
        endless=robot.endless,
    )
    return find_relaxations(problem)
