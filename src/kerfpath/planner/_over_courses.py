"""A plan of arm and external axes: along the courses that promise most, the best one refined."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kerfpath._arrays import Array
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.planner._clear import ClearSearch
from kerfpath.planner._continuous import claimed, clear_motion, plan_continuous
from kerfpath.planner._courses import courses
from kerfpath.planner._task import PlanningTask
from kerfpath.plans import Plan
from kerfpath.robots import Robot

__all__ = ["plan_over_courses", "require_arm_alone"]

GAMMA_STEP = np.radians(3)
"""rad: the refinement moves gamma and axes together, so that few samples lead to it."""
SAME = 1e-3
"""Relative difference of costs up to which two motions count as the same optimum."""


def plan_over_courses(
    task: PlanningTask, finder: ClearSearch, begin: Callable[[str], None]
) -> Plan:
    """Return the best motion found of arm and external axes together.

    Raises
    ------
    NoFeasiblePath
        None was found; says where the best of the tries ended. It proves nothing of other courses.
    """
    begin("search for a course of the external axes")
    best: Plan | None = None
    failed: list[NoFeasiblePath] = []
    open_: list[Array] = []
    for course in courses(task, clear=finder.clear):
        few = task.along(course).sampled(max(task.settings.gamma_step, GAMMA_STEP))
        there = finder.of(few)
        try:
            found = clear_motion(few, there, begin, thorough=False)
        except NoFeasiblePath as broken:
            failed.append(broken)
            continue
        if found is not None:
            made = replace(claimed(found, there), settings=task.settings)
            same = best is not None and abs(made.cost - best.cost) <= SAME * best.cost
            best = made if best is None or made.cost < best.cost else best
            if same:  # two courses have led to one optimum
                break
        else:
            open_.append(course)
    if best is not None:
        return best
    for course in open_[:1]:
        whole = task.along(course)
        try:
            return plan_continuous(whole, finder.of(whole), begin)
        except NoFeasiblePath as broken:
            failed.append(broken)
    raise _unproved(task, max(failed, key=lambda broken: broken.node))


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
    return NoFeasiblePath(said, proved=False, node=broken.node, counts=broken.counts)
