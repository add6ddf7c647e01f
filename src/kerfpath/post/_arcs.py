"""Replace linear moves by circular ones where a path runs along arcs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from kerfpath._arrays import Array, scalar
from kerfpath.post._arc_motion import ArcLimits, Stretch
from kerfpath.post._program import CircularMove, LinearMove, Program, Step

__all__ = ["circle_through", "with_arcs"]

FEWEST = 3
"""Smallest number of linear moves that a circular move replaces."""
MOST = 1000
"""Largest number of linear moves that a circular move replaces."""
LONGEST = np.radians(150.0)
"""Largest sweep (rad) of one circular move: controllers expect less than half a circle."""
MOST_TURN = np.radians(80.0)
"""Largest turn (rad) of the tool in one; beyond it, controllers may turn it different ways."""
SAME_SPEED = 1e-3
"""Largest relative difference of speeds that are merged into one move."""
SMALLEST, LARGEST = 1e-3, 10.0
"""Smallest and largest radius (m) of arcs."""


def with_arcs(
    program: Program,
    tolerance: float,
    *,
    angle: float = np.radians(0.2),
    eta_v: float = 1.0,
    eta_a: float = 1.0,
) -> Program:
    """Return the program with circular moves where its linear moves run along an arc.

    The tool is assumed to turn evenly along an arc, as controllers do. Moves stay linear where the
    plan turns it otherwise, or where the joints would exceed a limit along the arc, or just before
    or after it. An arc ends where an output is switched, the robot stops, or the speed changes.

    Parameters
    ----------
    program : Program
    tolerance : float m
        Largest distance of an arc from the targets that it replaces, and from the straight lines
        between them.
    angle : float rad
        Largest angle between the tool along an arc and at the targets that the arc replaces.
    eta_v, eta_a : float
        Share of the velocity and acceleration limits that the joints may use.

    Raises
    ------
    InputError
        `tolerance` or `angle` is not above 0, or the joint limits are not known.
    """
    tolerance = scalar(tolerance, "tolerance", unit="m", above=0.0)
    angle = scalar(angle, "angle", unit="rad", above=0.0)
    limits = ArcLimits(program, eta_v=eta_v, eta_a=eta_a)
    return replace(
        program,
        sections=tuple(
            replace(section, steps=tuple(_Arcs(section.steps, tolerance, angle, limits)))
            for section in program.sections
        ),
    )


class _Arcs:
    """The steps of a section, with arcs that are each as long as possible."""

    def __init__(
        self, steps: Sequence[Step], tolerance: float, angle: float, limits: ArcLimits
    ) -> None:
        self._steps, self._tolerance, self._angle = steps, tolerance, angle
        self._limits = limits
        self._before: tuple[Array, float] | None = None
        """The node before the last one done, and the time from there to it."""

    def __iter__(self) -> Iterator[Step]:
        """Yield the steps."""
        steps, k = self._steps, 0
        done: Step | None = None
        while k < len(steps):
            arc: CircularMove | None = None
            if isinstance(done, LinearMove) and len(run := _run(steps, k)) >= FEWEST:
                arc, count = self._longest(done, run, k)
            if arc is None:
                count, before, done = 1, done, steps[k]
                if isinstance(before, LinearMove) and isinstance(done, LinearMove):
                    self._before = None if done.zone == 0 else (before.q, done.duration)
            else:
                done = arc
            yield done
            k += count

    def _longest(
        self, start: LinearMove, run: Sequence[LinearMove], k: int
    ) -> tuple[CircularMove | None, int]:
        """Return the arc that replaces the most moves, found by bisection, and their number."""
        found, good, bad = None, FEWEST - 1, len(run) + 1
        while bad - good > 1:
            count = min(2 * good, (good + bad) // 2) if found is None else (good + bad) // 2
            tried = self._arc(start, run[:count], k)
            if tried is None:
                bad = count
            else:
                found, good = tried, count
        if found is None:
            return None, 1
        arc, q = found
        self._before = None if arc.zone == 0 else (q[-2], arc.duration / good)
        return arc, good

    def _arc(
        self, start: LinearMove, moves: Sequence[LinearMove], k: int
    ) -> tuple[CircularMove, Array] | None:
        """Return the circular move that replaces `moves` and the joints along it, or None."""
        poses = _spread_evenly(start, moves, self._tolerance, self._angle)
        if poses is None:
            return None
        end, after = moves[-1], None
        behind = self._steps[k + len(moves)] if k + len(moves) < len(self._steps) else None
        if end.zone > 0 and isinstance(behind, LinearMove):
            after = (behind.q, behind.duration)
        stretch = Stretch(
            before=self._before,
            after=after,
            q=np.array([start.q, *(move.q for move in moves)]),
            dt=np.array([move.duration for move in moves]),
        )
        q = self._limits.along(poses, stretch)
        if q is None:
            return None
        via = moves[_middle(np.array([start.T_part_tip, *(m.T_part_tip for m in moves)])) - 1]
        arc = CircularMove(
            T_part_via=via.T_part_tip,
            q_via=via.q,
            T_part_tip=end.T_part_tip,
            q=end.q,
            speed=moves[0].speed,
            duration=sum(move.duration for move in moves),
            zone=end.zone,
            switches=end.switches,
        )
        return arc, q


def _run(steps: Sequence[Step], first: int) -> list[LinearMove]:
    """Return the linear moves from `first` on that one move could replace."""
    run: list[LinearMove] = []
    for step in steps[first : first + MOST]:
        if type(step) is not LinearMove:
            break
        if run and abs(step.speed - run[0].speed) > SAME_SPEED * run[0].speed:
            break
        run.append(step)
        if step.switches or step.zone == 0:
            break
    return run


def _middle(T: Array) -> int:
    """Return the index of the pose (m, 4, 4) about as far from the first as from the last."""
    points = T[:, :3, 3]
    ends = np.linalg.norm(points[:, None] - points[[0, -1]], axis=2)
    return int(np.argmin(np.abs(ends[:, 0] - ends[:, 1])))


def _spread_evenly(
    start: LinearMove, moves: Sequence[LinearMove], tolerance: float, angle: float
) -> Array | None:
    """Return poses (m, 4, 4) m spaced evenly along the arc through m moves, or None without one.

    The last pose is the end of the last move.
    """
    T = np.array([start.T_part_tip, *(move.T_part_tip for move in moves)])
    points = T[:, :3, 3]
    circle = circle_through(points[0], points[_middle(T)], points[-1])
    if circle is None or not SMALLEST <= circle[2] <= LARGEST:
        return None
    centre, normal, radius = circle
    arm = points - centre
    height = arm @ normal
    off = np.hypot(height, np.linalg.norm(arm - np.outer(height, normal), axis=1) - radius)
    x = arm[0] / radius
    y = np.cross(normal, x)
    turned = np.unwrap(np.arctan2(arm @ y, arm @ x))
    steps = np.diff(turned)
    sagitta = radius * (1 - np.cos(steps / 2))
    if not (steps > 0).all() or turned[-1] > LONGEST or max(off.max(), sagitta.max()) > tolerance:
        return None
    rotations = Rotation.from_matrix(T[:, :3, :3])
    if (rotations[0].inv() * rotations[-1]).magnitude() > MOST_TURN:
        return None
    turning = Slerp([0.0, 1.0], rotations[[0, -1]])
    even = turning(np.clip(turned / turned[-1], 0, 1))
    if np.asarray((even.inv() * rotations).magnitude()).max() > angle:
        return None
    shares = np.arange(1, len(T)) / len(moves)
    poses = T[1:].copy()
    poses[:, :3, :3] = turning(shares).as_matrix()
    at = (shares * turned[-1])[:, None]
    poses[:, :3, 3] = centre + radius * (np.cos(at) * x + np.sin(at) * y)
    poses[-1] = T[-1]
    return poses


def circle_through(a: Array, b: Array, c: Array) -> tuple[Array, Array, float] | None:
    """Return centre, unit normal and radius of the circle through three points (3,), m.

    Return None if they lie on one line. Seen against the normal, the circle runs counter-clockwise
    from a through b.
    """
    u, v = b - a, c - a
    normal = np.cross(u, v)
    size = float(normal @ normal)
    if size <= (1e-9 * float(u @ u + v @ v)) ** 2:
        return None
    centre = a + (np.cross(normal, u) * (v @ v) + np.cross(v, normal) * (u @ u)) / (2 * size)
    return centre, normal / np.sqrt(size), float(np.linalg.norm(a - centre))
