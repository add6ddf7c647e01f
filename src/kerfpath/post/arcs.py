"""Paths of programs: zones, times, frames of controllers, and arcs in place of straight moves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation, Slerp

from kerfpath.arrays import Array, freeze, scalar, short_repr
from kerfpath.errors import InputError
from kerfpath.post.program import (
    CircularMove,
    JointMove,
    LinearMove,
    Move,
    Program,
    ProgramIssue,
    Step,
    Wait,
)
from kerfpath.robots import Robot
from kerfpath.transfer import least_time

# -----------------------------------------------------------------------------
# Widths of the zones of a path, in which a controller rounds the corner at a node.
#
# Where the zones of neighbouring nodes meet half way, and the tool runs through each at constant
# acceleration, the motion is a quadratic B-spline with the nodes as its control points: its
# velocity and acceleration are the differences that (5) and (6) bound, between the nodes too. In
# narrower zones the same turn takes less time, and the joints accelerate more than planned.

Zone = float | Literal["auto"]
SHARE = 0.49
"""Zone as a share of the distance to the next node: zones that meet are too large for UR."""
STEPS = 64
"""Steps per octave: zones are rounded down by up to 1.1 %, so that a program has few of them."""
ZONE_STEP = 2 ** (1 / STEPS) - 1
"""This step as a share of a zone."""
DIGIT = 1e-6
"""Zones are also rounded down to this (m), as languages write them."""


def zones_at(points: Array, zone: Zone, error: float) -> list[float]:
    """Return the zone (m) at each node except the first; 0 at the last, where the robot stops.

    Parameters
    ----------
    points : (K, 3) m
        The nodes.
    zone : float m or "auto"
        Radius. It is halved where nodes are close, until zones do not overlap. "auto": just short
        of half way to the next node.
    error : float m
        Largest distance by which the tip may miss a node with "auto", on a parabola.
    """
    if zone == 0:
        return [0.0] * (len(points) - 1)
    steps = np.diff(points, axis=0)
    gaps = np.linalg.norm(steps, axis=1)
    room = np.minimum(gaps[:-1], gaps[1:])
    if zone != "auto":
        room /= 2
        halvings = np.ceil(np.maximum(np.log2(zone / room), 0.0))
        return [*(zone * 0.5**halvings).tolist(), 0.0]
    turn = np.linalg.norm(np.diff(steps / gaps[:, None], axis=0), axis=1)
    widest = np.minimum(SHARE * room, 4 * error / np.maximum(turn, 1e-12))
    largest = widest.max(initial=0.0)
    lower = np.ceil(STEPS * np.log2(largest / widest) - 1e-9)
    zones = np.minimum(largest * 2 ** (-lower / STEPS), widest)
    return [*np.maximum(np.floor(zones / DIGIT) * DIGIT, DIGIT).tolist(), 0.0]


# -----------------------------------------------------------------------------
# When each step of a program ends, for languages that write times.

SHORTEST_CRUISE = 1e-3
"""Shortest time (s) that is written for a joint move."""
TICK = 0.01
"""Step (s) in which some controllers count times."""
TICK_NOISE = 1e-4
"""Largest difference (s) of a time from a multiple of it."""
SHORTEST = 1e-6
"""Shortest duration (s) of a move that can be written."""


def timetable(program: Program) -> list[tuple[Move | Wait, float]]:
    """Return each move and wait with the time (s) at which it ends; the first target is at 0.

    Waits and moves take their planned times. A joint move is straight, from stop to stop; without a
    planned time it takes the least time within the joint limits, divided by its share of the full
    speed.

    Raises
    ------
    InputError
        The joint limits are not known.
    """
    steps = [step for step in program.steps if isinstance(step, JointMove | LinearMove | Wait)]
    ways = np.diff(np.array([move.q for move in program.moves]), axis=0)
    least = iter([0.0, *least_time(ways, *program.robot.speed_limits()).tolist()])
    took = []
    for step in steps:
        full = 0.0 if isinstance(step, Wait) else next(least)
        if isinstance(step, JointMove):
            took.append(full / step.speed if step.duration is None or not full else step.duration)
        else:
            took.append(step.time if isinstance(step, Wait) else step.duration)
    return list(zip(steps, np.cumsum(took).tolist(), strict=True))


def cruises(program: Program) -> dict[Move, float]:
    """Return how long planned joint moves take (s) at constant speed.

    Without acceleration, that is the way of the slowest joint by its share of its full speed.
    """
    if program.robot.velocity is None:
        return {}
    return {
        move: float((np.abs(move.q - before.q) / program.robot.velocity).max() / move.speed)
        for before, move in pairwise(program.moves)
        if isinstance(move, JointMove) and move.duration is not None
    }


def air_times(program: Program) -> list[float | None]:
    """Return how long each move takes (s), from `timetable`; None if that is not known.

    It is None for the first move, for moves along the path, and if the limits are not known.
    """
    if program.robot.velocity is None or program.robot.acceleration is None:
        return [None] * len(program.moves)
    steps, ends = zip(*timetable(program), strict=True)
    took = np.diff(ends, prepend=ends[0]).tolist()
    return [
        time if isinstance(step, JointMove) and k > 0 else None
        for k, (step, time) in enumerate(zip(steps, took, strict=True))
        if not isinstance(step, Wait)
    ]


def not_whole(time: float) -> bool:
    """Return whether a time (s) is not a multiple of `TICK`."""
    return abs(time - TICK * round(time / TICK)) > TICK_NOISE


def check_times(program: Program, settings: object = None) -> Iterator[ProgramIssue]:
    """Yield what prevents writing times: unknown limits, no start, a move without a duration."""
    try:
        program.robot.speed_limits()
    except InputError as error:
        yield ProgramIssue("error", "joint-speed", str(error), "program")
    if not isinstance(next(iter(program.moves), None), JointMove):
        message = "times start at a first joint move, but there is none"
        yield ProgramIssue("error", "start", message, "program")
    for section in program.sections:
        for number, move in enumerate(section.moves):
            took = move.duration if isinstance(move, LinearMove) else 1.0
            if not SHORTEST <= took < np.inf:
                message = f"the move takes {took:g} s, expected at least {SHORTEST:g} s"
                yield ProgramIssue("error", "duration", message, f"{section.name}, move {number}")


# -----------------------------------------------------------------------------
# Distances between the poses of many targets, and orientations without jumps.

UNIT = 1e-6
"""Largest error of the length of a quaternion: eight printed decimals pass."""


def pose_of(position: ArrayLike, wxyz: ArrayLike) -> Array | None:
    """Return the pose (4, 4) at a position (3,) m; None where the quaternion (4,) is not unit."""
    quaternion = np.asarray(wxyz, dtype=np.float64)
    if abs(np.linalg.norm(quaternion) - 1) > UNIT:
        return None
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    T[:3, 3] = position
    return freeze(T)


def distances(one: Array, two: Array) -> tuple[Array, Array]:
    """Return distances (m) and angles (rad) between poses (K, 4, 4)."""
    off = np.linalg.norm(one[:, :3, 3] - two[:, :3, 3], axis=1)
    between = np.swapaxes(one[:, :3, :3], 1, 2) @ two[:, :3, :3]
    return off, np.asarray(Rotation.from_matrix(between).magnitude())


def quaternions(T: Array) -> Array:
    """Return unit quaternions (K, 4), w first, of poses (K, 4, 4).

    The first has w >= 0; each other has the sign that brings it closer to the one before.
    """
    wxyz = Rotation.from_matrix(T[:, :3, :3]).as_quat(canonical=True, scalar_first=True)
    turned = (wxyz[1:] * wxyz[:-1]).sum(axis=1) < 0
    sign = np.cumprod(np.concatenate([np.ones(min(len(T), 1)), np.where(turned, -1.0, 1.0)]))
    return np.asarray(wxyz * sign[:, None])


def rotation_vectors(T: Array) -> Array:
    """Return axis times angle (K, 3) rad of poses (K, 4, 4).

    Angles go up to 2 pi, by the signs of `quaternions`, so that vectors do not jump at pi.
    """
    wxyz = quaternions(T)
    sine = np.linalg.norm(wxyz[:, 1:], axis=1)
    angle = 2 * np.arctan2(sine, wxyz[:, 0])
    scale = np.divide(angle, sine, out=np.full(len(T), 2.0), where=sine > 0)
    return np.asarray(wxyz[:, 1:] * scale[:, None])


# -----------------------------------------------------------------------------
# Frames of several controllers: the world at axis 2, the flange, positions with three angles.

Order = Literal["xyz", "XYZ", "ZYX"]


def world(robot: Robot) -> Array:
    """Return the pose (4, 4) m of the controller's world, on axis 1 at the height of axis 2."""
    T = np.eye(4)
    T[2, 3] = robot.geometry["c1"]
    return freeze(np.asarray(robot.T_base_foot @ T))


def faceplate(robot: Robot) -> Array:
    """Return the pose (4, 4) m of the model's own flange in the robot's flange."""
    return freeze(np.asarray(np.linalg.inv(robot.T_end_flange), dtype=np.float64))


def controller_frames(program: Program) -> tuple[Array, Array]:
    """Return the poses (4, 4) m of part and tool in the controller's world and flange."""
    robot = program.robot
    part = np.linalg.inv(world(robot)) @ program.T_base_part
    tool = np.linalg.inv(faceplate(robot)) @ program.T_flange_tip
    return np.asarray(part), np.asarray(tool)


def euler(T: ArrayLike, order: Order) -> Array:
    """Return poses (K, 4, 4) m as X, Y, Z in mm and three angles in deg, (K, 6).

    The angles are about the axes of `order`, one after the other: fixed axes for small letters,
    axes turned by the angles before for capitals.
    """
    poses = np.asarray(T, dtype=np.float64).reshape(-1, 4, 4)
    turned = Rotation.from_matrix(poses[:, :3, :3])
    angles = turned.as_euler(order, degrees=True, suppress_warnings=True)
    return np.hstack([poses[:, :3, 3] * 1e3, angles])


def from_euler(values: ArrayLike, order: Order) -> Array:
    """Return poses (K, 4, 4) m from X, Y, Z in mm and three angles in deg, (K, 6); see `euler`."""
    rows = np.asarray(values, dtype=np.float64).reshape(-1, 6)
    T = np.tile(np.eye(4), (len(rows), 1, 1))
    T[:, :3, :3] = Rotation.from_euler(order, rows[:, 3:], degrees=True).as_matrix()
    T[:, :3, 3] = rows[:, :3] * 1e-3
    return freeze(T)


# -----------------------------------------------------------------------------
# The joint motion along an arc that is to replace straight moves, and its limits.

MARGIN = 0.01
"""Share of a limit that arcs leave unused, for rounding in the text and other node times."""
NEAR = np.radians(5.0)
"""An arc farther than this (rad) from the planned joints is on another branch."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stretch:
    """Moves of a path, with the moves that join them to the motion before and after.

    Parameters
    ----------
    before, after : (q (n,) rad, dt s) or None
        The node before the first with the time since it, and the node after the last with the time
        to it; None where the robot is stopped.
    q : (m + 1, n) rad
        Joints planned from the first node to the last.
    dt : (m,) s
    """

    before: tuple[Array, float] | None
    after: tuple[Array, float] | None
    q: Array
    dt: Array

    __repr__ = short_repr

    def joined(self, q: Array, dt: Array) -> tuple[Array, Array]:
        """Return joints and time steps from `before` to `after`, through q (m + 1, n) in dt."""
        if self.before is not None:
            q, dt = np.vstack([self.before[0], q]), np.append(self.before[1], dt)
        if self.after is not None:
            q, dt = np.vstack([q, self.after[0]]), np.append(dt, self.after[1])
        return q, dt


@dataclass(frozen=True, slots=True, eq=False)
class ArcLimits:
    """Limits of position, velocity and acceleration that the joints keep along an arc.

    A limit is kept if an arc stays `MARGIN` below it or uses no more of it than planned there.

    Parameters
    ----------
    program : Program
        Program with the robot and the frames.
    eta_v, eta_a : float
        Share of the velocity and acceleration limits that may be used.
    """

    program: Program
    eta_v: float = 1.0
    eta_a: float = 1.0

    def along(self, poses: Array, stretch: Stretch) -> Array | None:
        """Return the joints (m + 1, n) rad along an arc, or None if they exceed a limit.

        Parameters
        ----------
        poses : (m, 4, 4) m
            Tip poses in the part frame, at even times after the first node.
        stretch : Stretch
            The moves that the arc is to replace.
        """
        program, planned = self.program, stretch.q
        T = program.T_base_part @ poses @ np.linalg.inv(program.T_flange_tip)
        found = program.robot.arm.nearest(T, planned[1:])
        if not np.abs(found - planned[1:]).max() < NEAR:  # also catches NaN
            return None
        q = np.vstack([planned[:1], found])
        even = np.full(len(poses), stretch.dt.sum() / len(poses))
        ours = self._shares(*stretch.joined(q, even))
        theirs = self._shares(*stretch.joined(planned, stretch.dt))
        for share, plan, eta in zip(ours, theirs, (self.eta_v, self.eta_a), strict=True):
            if (share > np.maximum(eta * (1 - MARGIN), plan)).any():
                return None
        limits = program.robot.joint_limits()
        beyond = np.maximum(limits.lower - q, q - limits.upper)[:, ~limits.endless]
        sums = q @ limits.rows.T
        beyond = np.hstack([beyond, np.maximum(limits.row_lower - sums, sums - limits.row_upper)])
        return None if (beyond > 0).any() else q

    def _shares(self, q: Array, dt: Array) -> tuple[Array, Array]:
        """Return shares of the velocity (m, n) and acceleration (m - 1, n) limits."""
        robot = self.program.robot
        velocity, acceleration = robot.velocity_limits(), robot.acceleration_at(q[1:-1])
        rate = np.diff(q, axis=0) / dt[:, None]
        change = np.diff(rate, axis=0) / ((dt[1:] + dt[:-1]) / 2)[:, None]
        return np.abs(rate) / velocity, np.abs(change) / acceleration


# -----------------------------------------------------------------------------
# Replace linear moves by circular ones where a path runs along arcs.

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
