"""Circular moves in place of linear ones, where a path runs along arcs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from kerfpath._arrays import Array, scalar
from kerfpath.post._program import CircularMove, LinearMove, Program, Section, Step

__all__ = ["circle_through", "with_arcs"]

FEWEST = 3
"""Linear moves that a circular one replaces at least."""
LONGEST = np.radians(150.0)
"""Sweep of one circular move: none of the controllers wants half a circle at once."""
MOST_TURN = np.radians(80.0)
"""How far the tool may turn in one: beyond, controllers do not all take the same way."""
SAME_SPEED = 1e-3
"""Relative difference of speeds that one move may have."""
SMALLEST, LARGEST = 1e-3, 10.0
"""Radii (m) that are written as arcs."""


def with_arcs(program: Program, tolerance: float, *, angle: float = np.radians(0.2)) -> Program:
    """Return the program with circular moves where its linear ones run along an arc.

    Between two targets the tool is taken to turn evenly along the arc, as controllers do; where
    the plan turns it otherwise, moves stay linear. A move at whose end something is switched, or
    where the robot stops or changes its speed, ends an arc.

    Parameters
    ----------
    program : Program
    tolerance : float m
        How far arcs may leave the targets that they replace, and the straight lines between them.
    angle : float rad
        How far the tool may be turned from the targets that an arc replaces.

    Raises
    ------
    InputError
        A tolerance that is not above 0.
    """
    tolerance = scalar(tolerance, "tolerance", unit="m", above=0.0)
    angle = scalar(angle, "angle", unit="rad", above=0.0)
    return replace(
        program,
        sections=tuple(
            replace(section, steps=tuple(_steps(section, tolerance, angle)))
            for section in program.sections
        ),
    )


def _steps(section: Section, tolerance: float, angle: float) -> Iterator[Step]:
    """Yield the steps of a section, each arc as long as may be from where the last one ended."""
    steps, k = section.steps, 0
    while k < len(steps):
        start, step = steps[k - 1] if k else None, steps[k]
        run = _run(steps, k) if type(start) in (LinearMove, CircularMove) else []
        arc = None
        if isinstance(start, LinearMove) and len(run) >= FEWEST:
            arc, count = _longest(start, run, tolerance, angle)
        if arc is None:
            yield step
            k += 1
        else:
            yield arc
            k += count


def _run(steps: Sequence[Step], first: int) -> list[LinearMove]:
    """Return the linear moves from `first` on that one move could be."""
    run: list[LinearMove] = []
    for step in steps[first:]:
        if type(step) is not LinearMove:
            break
        if run and abs(step.speed - run[0].speed) > SAME_SPEED * run[0].speed:
            break
        run.append(step)
        if step.switches or step.zone == 0:
            break
    return run


def _longest(
    start: LinearMove, run: Sequence[LinearMove], tolerance: float, angle: float
) -> tuple[CircularMove | None, int]:
    """Return the arc that replaces the most moves of a run, by bisection, and their number."""
    found, good, bad = None, FEWEST - 1, len(run) + 1
    while bad - good > 1:
        count = min(2 * good, (good + bad) // 2) if found is None else (good + bad) // 2
        arc = _arc(start, run[:count], tolerance, angle)
        if arc is None:
            bad = count
        else:
            found, good = arc, count
    return found, good


def _arc(
    start: LinearMove, moves: Sequence[LinearMove], tolerance: float, angle: float
) -> CircularMove | None:
    """Return the circular move that replaces `moves` (K,), or None."""
    T = np.array([start.T_part_tip, *(move.T_part_tip for move in moves)])
    points = T[:, :3, 3]
    middle = int(np.argmin(np.abs(np.linalg.norm(points - points[0], axis=1)
                                  - np.linalg.norm(points - points[-1], axis=1))))  # fmt: skip
    circle = circle_through(points[0], points[middle], points[-1])
    if circle is None or not SMALLEST <= circle[2] <= LARGEST:
        return None
    centre, normal, radius = circle
    arm = points - centre
    height = arm @ normal
    off = np.hypot(height, np.linalg.norm(arm - np.outer(height, normal), axis=1) - radius)
    x = arm[0] / radius
    turned = np.unwrap(np.arctan2(arm @ np.cross(normal, x), arm @ x))
    steps = np.diff(turned)
    sagitta = radius * (1 - np.cos(steps / 2))
    if not (steps > 0).all() or turned[-1] > LONGEST or max(off.max(), sagitta.max()) > tolerance:
        return None
    rotations = Rotation.from_matrix(T[:, :3, :3])
    if (rotations[0].inv() * rotations[-1]).magnitude() > MOST_TURN:
        return None
    even = Slerp([0.0, 1.0], rotations[[0, -1]])(np.clip(turned / turned[-1], 0, 1))
    if np.asarray((even.inv() * rotations).magnitude()).max() > angle:
        return None
    end, via = moves[-1], moves[middle - 1]
    return CircularMove(
        T_part_via=via.T_part_tip,
        q_via=via.q,
        T_part_tip=end.T_part_tip,
        q=end.q,
        speed=moves[0].speed,
        duration=sum(move.duration for move in moves),
        zone=end.zone,
        switches=end.switches,
    )


def circle_through(a: Array, b: Array, c: Array) -> tuple[Array, Array, float] | None:
    """Return centre, unit normal and radius of the circle through three points (3,), m.

    None where they lie on one line. Seen against the normal it runs counter-clockwise from a by b.
    """
    u, v = b - a, c - a
    normal = np.cross(u, v)
    size = float(normal @ normal)
    if size <= (1e-9 * float(u @ u + v @ v)) ** 2:
        return None
    centre = a + (np.cross(normal, u) * (v @ v) + np.cross(v, normal) * (u @ u)) / (2 * size)
    return centre, normal / np.sqrt(size), float(np.linalg.norm(a - centre))
