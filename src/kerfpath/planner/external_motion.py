"""Courses of external axes and elbows, and the best plan along the most promising ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.optimize import lsq_linear

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.kernels.metric import increments, wrap
from kerfpath.options import PlanOptions
from kerfpath.planner.attempt import Attempt, unheard
from kerfpath.planner.coarse import (
    Coarse,
    End,
    Style,
    apart,
    clear_way,
    coarse_places,
    reached,
    sampled,
    steps_of,
)
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.continuous import claimed, clear_motion, plan_continuous
from kerfpath.planner.layers import layered_graph
from kerfpath.planner.quickest import QuickMotion, faster_motion
from kerfpath.planner.task import Task, planning_task
from kerfpath.plans import Plan
from kerfpath.robots import Robot
from kerfpath.setup import Setup

# -----------------------------------------------------------------------------
# Smooth courses of external axes and elbows, from a search over coarse samples of these joints.
#
# Rails and tables are slow compared with the arm, and a grid of their values would quantise their
# acceleration. The same holds for the free joint of a seven-axis arm, treated as one of them.
# So the best ways through coarse samples are found, and a course is the smoothest curve that
# stays near one. Gamma is planned again along the course, and both are refined together by the
# true kinematics.

SLOW, SLOWLY = 1e-6, 1e6
"""Speed (m/s) and interval between nodes (s) so slow that no limit binds."""
GENTLE = Style(1e6, 1.0)
"""Style without a speed asked for: only the least speeds of the axes count."""
STYLES = (Style(1.0, 1.0), Style(8.0, 1.0), Style(1.0, 8.0))
"""Styles of the courses that are tried."""
VALLEYS = 5
"""Most local optima of the free joint at the last node in which courses end."""


def external_course(
    contour: Contour,
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    speed: float | None = None,
    options: PlanOptions | None = None,
    cell: Cell | None = None,
) -> Array:
    """Return the most promising course (K, E) rad or m of the joints that a pose leaves free.

    Arguments are as in `kerfpath.plan`; without a speed it is the gentlest course.

    Raises
    ------
    NoFeasiblePath
        There is no way through the samples of the axes; the message names the node where it ends.
    """
    free = speed is None and contour.time is None
    asked = options or PlanOptions()
    task = planning_task(
        contour,
        Setup.of(robot, tool, placement, cell),
        asked,
        speed=SLOW if free else speed,
    )
    return next(courses(task, (GENTLE,) if free else STYLES, CollisionFreeSearch(task).clear))


def along_a_course(
    task: Task, clear: Callable[[Array], Bools], *, at_any_speed: bool = False
) -> Task:
    """Return the task along the most promising course, if its robot has one to choose.

    A task that already has a course or a graph is returned unchanged, and so is one that searches a
    grid of the axes. `clear` is as in `courses`.

    Raises
    ------
    NoFeasiblePath
        As `external_course`.
    """
    if not task.robot.free.size or task.placed or task.settings.method != "continuous":
        return task
    if at_any_speed:
        return task.along(next(courses(replace(task, dt=SLOWLY), (GENTLE,), clear)))
    return task.along(next(courses(task, clear=clear)))


def courses(
    task: Task,
    styles: tuple[Style, ...] = STYLES,
    clear: Callable[[Array], Bools] = lambda q: np.ones(len(q), np.bool_),
) -> Iterator[Array]:
    """Yield courses (K, E) rad or m of the joints that poses leave free, the most promising first.

    `clear` takes joint vectors (B, n) and returns which are clear, (B,). Ways lead through clear
    samples as far as a few rounds of checking the samples on and around them can achieve it.

    Raises
    ------
    NoFeasiblePath
        There is no way through the samples; the message names the node where it ends.
    """
    coarse, robot = sampled(task), task.robot
    known: list[Array] = []
    for style in styles:
        try:
            found = reached(coarse, task, style)
        except NoFeasiblePath:
            if not known:
                raise
            continue
        for end in _ends(coarse, robot, found.value, style, valleys=style is styles[0]):
            path = clear_way(coarse, task, style, clear, found, end)
            course = _smooth(coarse, robot, path, len(task.contour))
            if not any(np.allclose(course, other, atol=1e-3) for other in known):
                known.append(course)
                yield course


def _ends(coarse: Coarse, robot: Robot, value: Array, style: Style, *, valleys: bool) -> list[End]:
    """Return the ends of courses, the best first; None: the best end of all.

    With `valleys`, a free joint of the arm itself gets several local optima as ends, because the
    coarse samples hardly distinguish their costs.
    """
    if robot.externals:
        return [None, *apart(coarse, robot, value, style.ends)[1:]]
    if not valleys:
        return [None]
    least = value.min(axis=(1, 2))
    beside = np.pad(least, 1, mode="wrap" if robot.endless[robot.free[0]] else "edge")
    lowest = np.isfinite(least) & (least <= beside[:-2]) & (least <= beside[2:])
    places = np.flatnonzero(lowest)
    return [None, *places[np.argsort(least[places], kind="stable")][1:VALLEYS].tolist()]


def _smooth(coarse: Coarse, robot: Robot, path: Ints, K: int) -> Array:
    """Return the smoothest course (K, E) within half a step of the places of a way."""
    free, limits = robot.free, robot.joint_limits()
    lower, upper = limits.lower[free], limits.upper[free]
    endless, steps = robot.endless[free], steps_of(robot, coarse.counts)
    x = coarse.places[path]
    x = np.vstack([x[:1], x[:1] + np.cumsum(increments(x, endless), axis=0)])
    course = np.empty((K, x.shape[1]))
    for i in range(x.shape[1]):
        low, high = x[:, i] - steps[i] / 2, x[:, i] + steps[i] / 2
        if not endless[i]:
            low, high = np.maximum(low, lower[i]), np.minimum(high, upper[i])
        eased = _eased(low, high, coarse.nodes)
        course[:, i] = CubicSpline(coarse.nodes, eased)(np.arange(K)) if len(x) > 1 else eased[0]
        if not endless[i]:
            course[:, i] = np.clip(course[:, i], lower[i], upper[i])
    return np.where(endless, wrap(course), course)


def _eased(low: Array, high: Array, nodes: Ints) -> Array:
    """Return the values (M,) between low and high with the least changes of speed, uneven nodes."""
    if len(nodes) < 3 or (high - low).max() <= 0:
        return (low + high) / 2
    h = np.diff(nodes).astype(float)
    change, rows = np.zeros((len(h) - 1, len(nodes))), np.arange(len(h) - 1)
    change[rows, rows] = 1 / h[:-1]
    change[rows, rows + 1] = -1 / h[:-1] - 1 / h[1:]
    change[rows, rows + 2] = 1 / h[1:]
    room = np.maximum(high - low, 1e-9)
    found = lsq_linear(change, np.zeros(len(change)), bounds=(low, low + room))
    return np.asarray(np.clip(found.x, low, high))


# -----------------------------------------------------------------------------
# Plans with free courses: planned along the most promising courses; the best is taken.

GAMMA_STEP = np.radians(3)
"""rad: step of gamma; few samples are enough, as the refinement moves gamma and axes together."""
SAME_OPTIMUM = 1e-3
"""Relative difference of costs up to which two motions count as the same optimum."""
SAME_COURSE = 1e-3
"""rad or m: largest distance of two courses that count as one."""
ENDS, MOST_NODES = 4, 1600
"""Most ends of the cheapest courses; and the ends times the nodes, which bounds them further."""
RUNGS = (1.25, 1.06)
"""Multiples of the speed reached at which faster courses are looked for."""


def best_external_motion(attempt: Attempt) -> Plan:
    """Return the best motion found of all joints together, if poses leave some joints free.

    A tolerance of the tool axis is searched along the course of the best motion with the nominal
    axis, or along all courses if there is no such motion.

    Raises
    ------
    NoFeasiblePath
        No motion was found; the message says where the best try ended. Nothing is proved about
        other courses.
    """
    plans = _plans(attempt.task, attempt.finder, attempt.begin)
    return min(plans, key=lambda plan: plan.cost)


def graph_over_courses(
    contour: Contour,
    setup: Setup,
    options: PlanOptions,
    *,
    speed: float | None,
    progress: Callable[[int], None] | None = None,
) -> LayeredGraph:
    """Return the layered graph along the courses of the plans found.

    Each is the course of a refined plan, that of the best plan first; a path may change between
    courses where the limits of the axes allow it. Arguments are as in `kerfpath.plan`.

    Raises
    ------
    NoFeasiblePath
        No plan is found, see `best_external_motion`.
    """
    task = planning_task(contour, setup, options, speed=speed)
    plans = _plans(task, CollisionFreeSearch(task), unheard)
    ways: list[Array] = []
    for made in sorted(plans, key=lambda plan: plan.cost):
        if not any(np.allclose(made.course, other, atol=SAME_COURSE) for other in ways):
            ways.append(made.course)
    return layered_graph(
        contour,
        setup.robot,
        tool=setup.tool,
        placement=setup.placement,
        options=options,
        external=np.stack(ways, axis=1),
        progress=progress,
    )


def _plans(task: Task, finder: CollisionFreeSearch, begin: Callable[[str], None]) -> list[Plan]:
    """Return the plans found along the courses, at least one.

    Raises
    ------
    NoFeasiblePath
        As `best_external_motion`.
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
    task: Task, finder: CollisionFreeSearch, best: QuickMotion
) -> Iterator[QuickMotion]:
    """Yield successively faster motions along the most promising courses at higher speeds."""
    rung = 0
    while rung < len(RUNGS):
        at = replace(task, dt=best.dt / RUNGS[rung])
        try:
            made = _along(courses(at, clear=finder.clear), at, finder, unheard).best
        except NoFeasiblePath:
            made = None
        faster = best if made is None else faster_motion(task, finder, made, best)
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
    task: Task,
    finder: CollisionFreeSearch,
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
        same = best is not None and abs(made.cost - best.cost) <= SAME_OPTIMUM * best.cost
        if same and len(tried.plans) >= least and task.robot.family.given is None:
            break  # two courses led to one optimum; not for elbows, whose courses have mirror twins
    return tried


def _nominal(task: Task, finder: CollisionFreeSearch, begin: Callable[[str], None]) -> Plan | None:
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


def _unproved(task: Task, broken: NoFeasiblePath) -> NoFeasiblePath:
    names = task.robot.free_names
    said = (
        f"{broken}; only the most promising courses of {names} were tried, which proves nothing "
        "about others"
    )
    numbers = {getattr(reason, "which", None) for reason in broken.counts}
    for number, axis in enumerate(task.robot.externals, task.robot.family.joints + 1):
        said += f"; joint {number} is {axis.name}" if number in numbers else ""
    return NoFeasiblePath(said, proved=False, node=broken.node, counts=broken.counts)
