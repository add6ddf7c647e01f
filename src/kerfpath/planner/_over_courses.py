"""A plan of arm and external axes: along the courses that promise most, the best one refined."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kerfpath._arrays import Array
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.planner._clear import ClearSearch
from kerfpath.planner._continuous import claimed, clear_motion, plan_continuous
from kerfpath.planner._courses import courses
from kerfpath.planner._quickest import QuickMotion, quicker
from kerfpath.planner._task import PlanningTask
from kerfpath.plans import Plan
from kerfpath.robots import Robot

__all__ = ["faster_motions", "plan_over_courses", "require_arm_alone"]

GAMMA_STEP = np.radians(3)
"""rad: the refinement moves gamma and axes together, so that few samples lead to it."""
SAME = 1e-3
"""Relative difference of costs up to which two motions count as the same optimum."""
RUNGS = (1.25, 1.06)
"""Multiples of the speed reached at which courses are looked for that are quicker still."""


def plan_over_courses(
    task: PlanningTask, finder: ClearSearch, begin: Callable[[str], None]
) -> Plan:
    """Return the best motion found of arm and external axes together.

    A tolerance of the tool axis is searched along the course of the best motion at the nominal
    axis; along all courses where there is none.

    Raises
    ------
    NoFeasiblePath
        None was found; says where the best of the tries ended. It proves nothing of other courses.
    """
    begin("search for a course of the external axes")
    nominal = _nominal(task, finder, begin)
    known = None if nominal is None else nominal.external
    ways = courses(task, clear=finder.clear) if known is None else iter([known])
    tried = _along(ways, task, finder, begin, nominal)
    if tried.best is not None:
        return tried.best
    failed = tried.failed
    for course in tried.open[:1]:
        whole = task.along(course)
        try:
            return plan_continuous(whole, finder.of(whole), begin)
        except NoFeasiblePath as broken:
            failed.append(broken)
    raise _unproved(task, max(failed, key=lambda broken: broken.node))


def faster_motions(
    task: PlanningTask, finder: ClearSearch, best: QuickMotion
) -> Iterator[QuickMotion]:
    """Yield ever quicker motions than one, along courses that promise most at higher speeds."""
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
    """What came of some courses: the best motion, why some have none, those with neither."""

    best: Plan | None
    failed: list[NoFeasiblePath]
    open: list[Array]


def _along(
    ways: Iterator[Array],
    task: PlanningTask,
    finder: ClearSearch,
    begin: Callable[[str], None],
    best: Plan | None = None,
) -> _Tried:
    """Return what the arm's motions along some courses come to, with axes and gamma refined."""
    tried = _Tried(best, [], [])
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
        if best is None or made.cost < best.cost:
            tried = tried._replace(best=made)
        if best is not None and abs(made.cost - best.cost) <= SAME * best.cost:
            break  # two courses have led to one optimum
    return tried


def _nominal(task: PlanningTask, finder: ClearSearch, begin: Callable[[str], None]) -> Plan | None:
    """Return the best motion at the nominal tool axis; None without a tolerance or a motion."""
    if task.settings.tilt is None:
        return None
    rigid = task.with_settings(replace(task.settings, tilt=None))
    there = finder.of(rigid)
    try:
        made = _along(courses(rigid, clear=there.clear), rigid, there, begin).best
    except NoFeasiblePath:
        return None
    return None if made is None else replace(made, settings=task.settings)


def require_arm_alone(robot: Robot, what: str) -> None:
    """Raise InputError where a robot has external axes, of what does not know how they move."""
    if robot.externals:
        names = ", ".join(axis.name for axis in robot.externals)
        raise InputError(f"{what}: it does not know yet how external axes move ({names})")


def _unproved(task: PlanningTask, broken: NoFeasiblePath) -> NoFeasiblePath:
    names = ", ".join(axis.name for axis in task.robot.externals)
    said = (
        f"{broken}; along the courses of {names} that promised most, which proves nothing of others"
    )
    numbers = {getattr(reason, "which", None) for reason in broken.counts}
    for number, axis in enumerate(task.robot.externals, task.arm + 1):
        said += f"; joint {number} is {axis.name}" if number in numbers else ""
    return NoFeasiblePath(said, proved=False, node=broken.node, counts=broken.counts)
