"""Whether a task has a motion at all, at any gamma, posture and turn."""

from __future__ import annotations

from kerfpath.certifier import MotionTest
from kerfpath.errors import NoFeasiblePath
from kerfpath.planner._task import PlanningTask

__all__ = ["at_any_gamma", "motion_test"]

MOST_NODES = 5_000
"""Nodes up to which cells of all of them are held at once: some 200 MB."""


def motion_test(task: PlanningTask) -> MotionTest | None:
    """Return the test of a task for motions at any gamma; None where nothing can be proved.

    What else a plan keeps (a cell, comfort, a closure, a limit on the rotation) only leaves fewer.
    """
    asked = task.settings
    if not task.robot.encloses or asked.tilt is not None or len(task.contour) > MOST_NODES:
        return None
    frames = task.T_base_part @ task.contour.frames(asked.frames)
    return MotionTest(task.robot, frames, task.T_flange_tip, asked.postures)


def at_any_gamma(broken: NoFeasiblePath, task: PlanningTask) -> NoFeasiblePath:
    """Return what a search found to be broken, and whether it is so at every gamma."""
    test = motion_test(task)
    if test is None or task.settings.feed == "dip":
        return broken
    closed = test.closed(task.problem.limits, task.dt)
    if closed is None:
        return broken.with_message(f"{broken}; whether there is a motion off the grid is undecided")
    return broken.with_message(f"{broken}; proved for every rotation: {closed}", closed=closed)
