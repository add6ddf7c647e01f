"""Plans with free courses: planned along the most promising courses; the best is taken."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.options import PlanOptions
from kerfpath.planner._clear import ClearSearch
from kerfpath.planner._coarse import Style, coarse_places
from kerfpath.planner._continuous import claimed, clear_motion, plan_continuous
from kerfpath.planner._courses import STYLES, courses
from kerfpath.planner._graph import layered_graph
from kerfpath.planner._quickest import QuickMotion, quicker
from kerfpath.planner._task import PlanningTask, task_of
from kerfpath.plans import Plan
from kerfpath.robots import Robot

__all__ = ["faster_motions", "graph_over_courses", "plan_over_courses"]

GAMMA_STEP = np.radians(3)
"""rad: step of gamma; few samples are enough, as the refinement moves gamma and axes together."""
SAME = 1e-3
"""Relative difference of costs up to which two motions count as the same optimum."""
ALIKE = 1e-3
"""rad or m: largest distance of two courses that count as one."""
ENDS, MOST_NODES = 4, 1600
"""Most ends of the cheapest courses; and the ends times the nodes, which bounds them further."""
RUNGS = (1.25, 1.06)
"""Multiples of the speed reached at which quicker courses are looked for."""


def plan_over_courses(
    task: PlanningTask, finder: ClearSearch, begin: Callable[[str], None]
) -> Plan:
    """Return the best motion found of all joints together, if poses leave some joints free.

    A tolerance of the tool axis is searched along the course of the best motion with the nominal
    axis, or along all courses if there is no such motion.

    Raises
    ------
    NoFeasiblePath
        No motion was found; the message says where the best try ended. Nothing is proved about
        other courses.
    """
    return min(_plans(task, finder, begin), key=lambda plan: plan.cost)


def graph_over_courses(
    contour: Contour,
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    speed: float | None,
    options: PlanOptions,
    cell: Cell | None,
    progress: Callable[[int], None] | None = None,
) -> LayeredGraph:
    """Return the layered graph along the courses of the plans found.

    Each is the course of a refined plan, that of the best plan first; a path may change between
    courses where the limits of the axes allow it. Arguments are as in `kerfpath.plan`.

    Raises
    ------
    NoFeasiblePath
        No plan is found, see `plan_over_courses`.
    """
    task = task_of(contour, robot, options, tool=tool, placement=placement, speed=speed)
    plans = _plans(task, ClearSearch(task, cell), lambda what: None)
    ways: list[Array] = []
    for made in sorted(plans, key=lambda plan: plan.cost):
        if not any(np.allclose(made.course, other, atol=ALIKE) for other in ways):
            ways.append(made.course)
    return layered_graph(
        contour,
        robot,
        tool=tool,
        placement=placement,
        options=options,
        external=np.stack(ways, axis=1),
        progress=progress,
    )


def _plans(task: PlanningTask, finder: ClearSearch, begin: Callable[[str], None]) -> list[Plan]:
    """Return the plans found along the courses, at least one.

    Raises
    ------
    NoFeasiblePath
        As `plan_over_courses`.
    """
    begin(f"search for a course of {task.robot.free_names}")
    places = coarse_places(task.robot)
    if len(places) == 1:  # none moves
        still = task.along(np.repeat(places, len(task.contour), axis=0))
        return [plan_continuous(still, finder.of(still), begin)]
    nominal = _nominal(task, finder, begin)
    known = None if nominal is None else nominal.course
    cheapest = Style(0.0, 1.0, int(np.clip(MOST_NODES // len(task.contour), 1, ENDS)))
    # The cheapest style is for external axes; it does not suit the elbow of a seven-axis arm.
    styles = (*STYLES[:1], cheapest, *STYLES[1:]) if task.robot.externals else STYLES
    ways = courses(task, styles, finder.clear) if known is None else iter([known])
    tried = _along(ways, task, finder, begin, nominal, least=1 + cheapest.ends)
    if tried.plans:
        return tried.plans
    failed = tried.failed
    for course in tried.open[:1]:
        whole = task.along(course)
        try:
            return [plan_continuous(whole, finder.of(whole), begin)]
        except NoFeasiblePath as broken:
            failed.append(broken)
    raise _unproved(task, max(failed, key=lambda broken: broken.node))


def faster_motions(
    task: PlanningTask, finder: ClearSearch, best: QuickMotion
) -> Iterator[QuickMotion]:
    """Yield successively quicker motions along the most promising courses at higher speeds."""
    rung = 0
    while rung < len(RUNGS):
        at = replace(task, dt=best.dt / RUNGS[rung])
        try:
            made = _along(courses(at, clear=finder.clear), at, finder, lambda what: None).best
        except NoFeasiblePath:
            made = None
        faster = best if made is None else quicker(task, finder, made, best)
        rung = rung + 1 if faster is best else 0
        if faster is not best:
            best = faster
            yield best


class _Tried(NamedTuple):
    """Results of some courses: plans, failures with their reason, and courses with neither."""

    plans: list[Plan]
    failed: list[NoFeasiblePath]
    open: list[Array]

    @property
    def best(self) -> Plan | None:
        """The best of the plans; None if there is none."""
        return min(self.plans, key=lambda plan: plan.cost, default=None)


def _along(
    ways: Iterator[Array],
    task: PlanningTask,
    finder: ClearSearch,
    begin: Callable[[str], None],
    known: Plan | None = None,
    least: int = 1,
) -> _Tried:
    """Return the motions along some courses, with axes and gamma refined.

    After `least` motions, it stops when a motion has the same optimum as the best one before.
    """
    tried = _Tried([] if known is None else [known], [], [])
    for course in ways:
        few = task.along(course).sampled(max(task.settings.gamma_step, GAMMA_STEP))
        there = finder.of(few)
        try:
            found = clear_motion(few, there, begin, thorough=False)
        except NoFeasiblePath as broken:
            tried.failed.append(broken)
            continue
        if found is None:
            tried.open.append(course)
            continue
        made, best = replace(claimed(found, there), settings=task.settings), tried.best
        tried.plans.append(made)
        same = best is not None and abs(made.cost - best.cost) <= SAME * best.cost
        if same and len(tried.plans) >= least and task.robot.family.given is None:
            break  # two courses led to one optimum; not for elbows, whose courses have mirror twins
    return tried


def _nominal(task: PlanningTask, finder: ClearSearch, begin: Callable[[str], None]) -> Plan | None:
    """Return the best motion with the nominal tool axis; None without a tilt or a motion."""
    if task.settings.tilt is None:
        return None
    rigid = task.with_settings(replace(task.settings, tilt=None))
    there = finder.of(rigid)
    try:
        made = _along(courses(rigid, clear=there.clear), rigid, there, begin).best
    except NoFeasiblePath:
        return None
    return None if made is None else replace(made, settings=task.settings)


def _unproved(task: PlanningTask, broken: NoFeasiblePath) -> NoFeasiblePath:
    names = task.robot.free_names
    said = (
        f"{broken}; only the most promising courses of {names} were tried, which proves nothing "
        "about others"
    )
    numbers = {getattr(reason, "which", None) for reason in broken.counts}
    for number, axis in enumerate(task.robot.externals, task.robot.family.joints + 1):
        said += f"; joint {number} is {axis.name}" if number in numbers else ""
    return NoFeasiblePath(said, proved=False, node=broken.node, counts=broken.counts)
