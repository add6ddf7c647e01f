"""Smooth courses of external axes and elbows, from a search over coarse samples of these joints.

Rails and tables are slow compared with the arm, and a grid of their values would quantise their
acceleration. The same holds for joint 3 of a seven-axis arm, which is treated as one of them. So
the best ways through coarse samples are found, and a course is the smoothest curve that stays near
one. Gamma is planned again along the course, and both are refined together by the true kinematics.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.optimize import lsq_linear

from kerfpath._arrays import Array, Bools, Ints
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.kernels.metric import increments, wrap
from kerfpath.options import PlanOptions
from kerfpath.planner._clear import ClearSearch
from kerfpath.planner._coarse import (
    Coarse,
    End,
    Style,
    apart,
    clear_way,
    reached,
    sampled,
    steps_of,
)
from kerfpath.planner._task import PlanningTask, task_of
from kerfpath.robots import Robot

__all__ = ["STYLES", "along_a_course", "courses", "external_course"]

SLOW, SLOWLY = 1e-6, 1e6
"""Speed (m/s) and interval between nodes (s) so slow that no limit binds."""
GENTLE = Style(1e6, 1.0)
"""Style without a speed asked for: only the least speeds of the axes count."""
STYLES = (Style(1.0, 1.0), Style(8.0, 1.0), Style(1.0, 8.0))
"""Styles of the courses that are tried."""
VALLEYS = 5
"""Most local optima of joint 3 at the last node in which courses end."""


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
    task = task_of(
        contour, robot, asked, tool=tool, placement=placement, speed=SLOW if free else speed
    )
    return next(courses(task, (GENTLE,) if free else STYLES, ClearSearch(task, cell).clear))


def along_a_course(
    task: PlanningTask, clear: Callable[[Array], Bools], *, at_any_speed: bool = False
) -> PlanningTask:
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
    task: PlanningTask,
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
