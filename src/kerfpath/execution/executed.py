"""A program as its controller runs it: the motion of the joints, its time, and its deviation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, lengths_along, short_repr
from kerfpath.auditor import ENCLOSED, rates_along
from kerfpath.comfort import jacobian
from kerfpath.errors import InputError
from kerfpath.execution.tool_motion import ToolMotion
from kerfpath.post import PLAIN, Controller, JointMove, LinearMove, Program
from kerfpath.robots import Robot, base_in_part

# -----------------------------------------------------------------------------
# Joints of a controller that moves the wrist evenly and keeps the tip on its path.

ARM = 3
"""Number of joints that place the tip; as many joints of the wrist follow."""
STEPS = 8
"""Steps of Newton's method, each of which doubles the digits."""
NEAR = 1e-10
"""Distance (m) below which the tip is at its point; rounding leaves 1e-15."""


def require_wrist(robot: Robot) -> None:
    """Raise InputError unless a robot has three joints and a wrist of three."""
    if robot.joints != 2 * ARM:
        raise InputError(
            f"robot {robot.id!r}: orientation 'wrist' is modelled for six joints, got "
            f"{robot.joints}"
        )


def joints_with_wrist(robot: Robot, points: Array, near: Array, tool: Array) -> Array:
    """Return the joints (m, 6) rad that bring the tip to points, (m, 3) m, with the wrist as given.

    It uses Newton's method in the first three joints; NaN where that does not converge.

    Parameters
    ----------
    robot : Robot
    points : (m, 3) m
        Points in the robot base.
    near : (m, 6) rad
        The first three joints close to the solution, the others as they must be.
    tool : (4, 4) m
        T_flange_tip.
    """
    q = near.copy()
    good = ~np.isnan(q).any(axis=1)
    off = np.full(len(q), np.inf)
    for _ in range(STEPS):
        tip = (robot.forward(q[good]) @ tool)[:, :3, 3]
        gap = points[good] - tip
        off[good] = np.linalg.norm(gap, axis=1)
        if (off[good] < NEAR * 1e-4).all():
            break
        J = jacobian(robot, q[good], tool=tool)[:, :3, :ARM]
        step = np.linalg.pinv(J) @ gap[:, :, None]
        q[good, :ARM] += np.clip(step[:, :, 0], -0.5, 0.5)
    return np.asarray(np.where((off < NEAR)[:, None], q, np.nan))


# -----------------------------------------------------------------------------
# Motion of the joints as a controller runs a program, also between the targets.

WHERE = (0.1, 0.5, 0.9)
"""Shares of each smooth stretch at which the joints are sampled."""
LONGEST = 0.02
"""Longest stretch (s): longer ones are sampled in parts."""
TIGHT = 1.02
"""Bounds are refined to this multiple of the sampled peak."""
RESOLVED = 2e-5
"""Shortest stretch (s) that is sampled: in shorter ones, differences of joints are rounding."""
STEP = 0.05
"""Share of a stretch between a sample and the joints before and after it, for the rates."""


class Peak(NamedTuple):
    """The largest share of a limit, its joint (counted from 0), and its time, s."""

    share: float
    joint: int
    time: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Executed:
    """One run of straight and circular moves, from stop to stop, at the programmed speeds.

    Parameters
    ----------
    section : str
        Name of the section of the program.
    robot : Robot
    T_base_part, T_flange_tip : (4, 4) m
    tool_motion : ToolMotion
    time : (m,) s
        Times of the samples, from the start of the run.
    planned : (m,) s
        Planned times of the samples: chords are shorter than the path, so that a run is ahead.
    q : (m, n) rad
        Joints; NaN where the posture of the targets does not reach.
    T : (m, 4, 4) m
        Poses of the tip, in the part.
    velocity_share, acceleration_share : (m, n)
        Signed shares of the full limit of each joint. If one is above 1 in size, the robot cannot
        run at the programmed speed, and a controller slows down.
    torque_share : (m, n) or None
        The same for torques, of rigid links at the samples; None if the robot has no load, see
        `Robot.with_load`.
    velocity_bound, acceleration_bound : float
        Proved bounds: no joint uses a larger share of a limit at any instant, also between samples.
        They are refined to 2 % above the sampled peak, or to the limit if the peak is below it.
        Infinite if nothing is proved: next to a singularity, and if there are only samples.
    sampled : str
        Why there are only samples; empty if the bounds are proved.
    controller : Controller
        The controller that runs it.
    """

    section: str
    robot: Robot
    T_base_part: Array
    T_flange_tip: Array
    tool_motion: ToolMotion
    time: Array
    planned: Array
    q: Array
    T: Array
    velocity_share: Array
    acceleration_share: Array
    torque_share: Array | None = None
    velocity_bound: float
    acceleration_bound: float
    sampled: str = ""
    controller: Controller = PLAIN

    __repr__ = short_repr

    @property
    def reached(self) -> bool:
        """Whether the posture of the targets reaches every sample."""
        return not np.isnan(self.acceleration_share).any()

    @property
    def peak_velocity(self) -> Peak:
        """The largest share of a velocity limit."""
        return self._peak(self.velocity_share)

    @property
    def peak_acceleration(self) -> Peak:
        """The largest share of an acceleration limit."""
        return self._peak(self.acceleration_share)

    @property
    def peak_torque(self) -> Peak | None:
        """The largest share of a torque limit at the samples; nothing is proved between them."""
        return None if self.torque_share is None else self._peak(self.torque_share)

    @property
    def most(self) -> float:
        """The largest share of a limit of velocity or acceleration."""
        return max(self.peak_velocity.share, self.peak_acceleration.share)

    @property
    def missed(self) -> float:
        """The largest distance, m, by which the tip misses a target."""
        poses = self.tool_motion.poses(self.tool_motion.time)
        return float(np.linalg.norm(poses[:, :3, 3] - self.tool_motion.T[:, :3, 3], axis=1).max())

    def _peak(self, shares: Array) -> Peak:
        size = np.abs(shares)
        size = np.where(np.isnan(size), np.inf, size)
        m, joint = divmod(int(np.argmax(size)), size.shape[1])
        return Peak(float(size[m, joint]), joint, float(self.time[m]))


def executed(
    program: Program, *, controller: Controller = PLAIN, bounded: bool = True
) -> tuple[Executed, ...]:
    """Return every run of straight and circular moves of a program, as it is executed.

    The motion is that of `ToolMotion`, at the programmed speeds throughout: neither speeding up
    from the stop nor slowing down for a limit is modelled. The joints follow it exactly; external
    axes move evenly from target to target, in zones like the tip. Velocities and accelerations are
    sampled three times in each smooth stretch, together with bounds that hold everywhere; see
    `kerfpath.auditor.rates_along`. Torques are those at the samples.

    Parameters
    ----------
    program : Program
    controller : Controller
        For a language it is `language(name).controller(settings)`.
    bounded : bool
        Whether bounds are proved, which takes most of the time.

    Raises
    ------
    InputError
        The velocity and acceleration limits of the robot are not known, or the orientation is
        "wrist" and the robot has no wrist of three joints.
    """
    return tuple(
        run_along(
            moves,
            program.robot,
            T_base_part=program.T_base_part,
            T_flange_tip=program.T_flange_tip,
            controller=controller,
            section=section.name,
            bounded=bounded,
        )
        for section in program.sections
        for moves in from_stop_to_stop(section.moves)
    )


def from_stop_to_stop(moves: Sequence[JointMove | LinearMove]) -> list[list[LinearMove]]:
    """Return the runs of straight and circular moves, each with the move to its start first."""
    found: list[list[LinearMove]] = []
    run: list[LinearMove] = []
    for move in moves:
        if isinstance(move, JointMove):
            run = []
            continue
        run.append(move)
        if move.zone == 0:
            found += [run] if len(run) > 2 else []
            run = [move]
    return found


def run_along(
    moves: Sequence[LinearMove],
    robot: Robot,
    *,
    T_base_part: Array,
    T_flange_tip: Array,
    controller: Controller = PLAIN,
    section: str = "",
    bounded: bool = True,
) -> Executed:
    """Return the run of moves from the target of the first, where the robot is stopped, to a stop.

    Parameters
    ----------
    moves : sequence of LinearMove
        Three or more, each with the joints at its target.
    robot : Robot
    T_base_part, T_flange_tip : (4, 4) m
    controller, section, bounded
        As in `executed` and `Executed`.

    Raises
    ------
    InputError
        As `executed`.
    """
    robot.require_no_free_joint("the motion between the nodes")
    motion = ToolMotion.of(moves[0].T_part_tip, moves[1:], controller)
    borders = motion.borders
    parts = np.ceil(np.diff(borders) / LONGEST).astype(int)
    ends = pairwise(borders)
    within = [np.linspace(*of, n, endpoint=False) for of, n in zip(ends, parts, strict=True)]
    begins = np.append(np.concatenate(within), borders[-1])
    long = np.diff(begins)
    seen = long > min(RESOLVED, long.max() / 2)
    begin, long = begins[:-1][seen], long[seen]
    time = (begin[:, None] + long[:, None] * np.array(WHERE)).ravel()
    step = np.repeat(STEP * long, len(WHERE))
    targets = np.array([move.q for move in moves])
    wrist = controller.orientation == "wrist"
    joints = _by_wrist if wrist else _by_pose
    before, q, after = (
        joints(robot, motion, time + sign * step, targets, T_base_part, T_flange_tip)
        for sign in (-1, 0, 1)
    )
    T = motion.poses(time)
    if wrist:
        reached = ~np.isnan(q).any(axis=1)
        T[reached] = np.linalg.inv(T_base_part) @ robot.forward(q[reached]) @ T_flange_tip
    velocity, acceleration = robot.speed_limits()
    v, a = (after - before) / (2 * step[:, None]), (after - 2 * q + before) / step[:, None] ** 2
    run = Executed(
        section=section,
        robot=robot,
        T_base_part=T_base_part,
        T_flange_tip=T_flange_tip,
        tool_motion=motion,
        time=time,
        planned=np.interp(time, motion.time, np.cumsum([0.0, *(m.duration for m in moves[1:])])),
        q=q,
        T=T,
        velocity_share=v / velocity,
        acceleration_share=a / robot.acceleration_at(q),
        torque_share=_torque_share(robot, q, v, a),
        velocity_bound=np.inf,
        acceleration_bound=np.inf,
        sampled=_sampled(robot, controller),
        controller=controller,
    )
    fast, sharp = run.peak_velocity.share, run.peak_acceleration.share
    if not bounded or run.sampled or not np.isfinite(max(fast, sharp)):
        return run
    middles = (borders[1:] + borders[:-1]) / 2
    bounds = rates_along(
        robot,
        motion.pieces(targets[:, robot.family.joints :]),
        np.stack([np.interp(middles, time, joint) for joint in q.T], axis=1),
        T_base_part=T_base_part,
        T_flange_tip=T_flange_tip,
        enough=(_enough(fast) * velocity, _enough(sharp) * acceleration),
    )
    shares = [bound / limit for bound, limit in zip(bounds, (velocity, acceleration), strict=True)]
    return replace(
        run,
        velocity_bound=float(shares[0].max()),
        acceleration_bound=float(shares[1].max()),
    )


def _by_pose(
    robot: Robot, motion: ToolMotion, time: Array, targets: Array, T_base_part: Array,
    T_flange_tip: Array,
) -> Array:  # fmt: skip
    """Return the joints (m, n) at times (m,) that are close to those at the targets (K, n)."""
    x, seen = _externals(robot, motion, time, targets, T_base_part)
    near = np.stack([np.interp(time, motion.time, joint) for joint in targets.T], axis=1)
    q = robot.arm.nearest(seen @ np.linalg.inv(T_flange_tip), near[:, : robot.arm.joints])
    return np.concatenate([q, x], axis=1)


def _by_wrist(
    robot: Robot, motion: ToolMotion, time: Array, targets: Array, T_base_part: Array,
    T_flange_tip: Array,
) -> Array:  # fmt: skip
    """Return the joints (m, n) at times (m,), with even motion of the wrist between targets."""
    x, seen = _externals(robot, motion, time, targets, T_base_part)
    robot = robot.alone()
    require_wrist(robot)
    near = motion.blended(targets[:, : robot.joints], time)
    q = joints_with_wrist(robot, seen[:, :3, 3], near, T_flange_tip)
    return np.concatenate([q, x], axis=1)


def _externals(
    robot: Robot, motion: ToolMotion, time: Array, targets: Array, T_base_part: Array
) -> tuple[Array, Array]:
    """Return the external axes (m, E) at times, and the poses of the tip that the arm sees.

    The poses are in the robot base, wherever external axes carry it.
    """
    x = motion.blended(targets[:, robot.arm.joints :], time)
    base = base_in_part(robot.externals, x)
    return x, np.linalg.inv(base) @ T_base_part @ motion.poses(time)


def _sampled(robot: Robot, controller: Controller) -> str:
    """Return why nothing is proved for a robot and a controller; empty if bounds are proved."""
    if controller.orientation == "wrist":
        return "nothing is proved if the controller moves the wrist by its joints"
    if robot.kinematics not in ENCLOSED:
        return f"nothing is proved for arms of the family {robot.kinematics}"
    return ""


def _torque_share(robot: Robot, q: Array, v: Array, a: Array) -> Array | None:
    """Return the shares (m, n) of the torque limits, NaN out of reach; None without a load."""
    limit = robot.torque_limit()
    if limit is None:
        return None
    there = np.isfinite(q + v + a).all(axis=1)
    shares = np.full(q.shape, np.nan)
    shares[there] = limit.dynamics.torque(q[there], v[there], a[there]) / limit.bound
    return shares


def _enough(seen: float) -> float:
    """Return the share of a limit that a bound need not go below: close, and within the limit."""
    return min(TIGHT * seen, 1.0) if seen < 1 else TIGHT * seen


# -----------------------------------------------------------------------------
# How long a run takes and where it slows down, if its robot keeps every limit.
#
# The path is fixed. The robot follows it at the programmed speed where the joint limits allow,
# else as fast as they allow: time-optimal path parametrisation by reachable sets (Pham and Pham
# 2018). With x the square of the rate at which programmed time passes, and u its derivative by
# that time over two, both limits are linear: q'^2 x <= v^2 and |q' u + q'' x| <= a.

AT_SPEED = 0.995
"""Share of the programmed speed that counts as holding it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Timing:
    """A run as fast as its programmed speeds and the joint limits allow.

    Parameters
    ----------
    seconds : float s
        Time from rest to rest.
    programmed : float s
        Time at the programmed speeds throughout.
    time : (m,) s
        Samples, in programmed time from the start of the run.
    clock : (m,) s
        Time at which the robot passes them.
    share : (m,)
        Share of the programmed speed that the tool has there.
    length : (m,) m
        Distance that the tip has moved up to there.
    """

    seconds: float
    programmed: float
    time: Array
    clock: Array
    share: Array
    length: Array

    __repr__ = short_repr

    @property
    def under_way(self) -> Bools:
        """Whether samples are between the ramps, where the speed is reached and left, (m,)."""
        held = np.flatnonzero(self.share >= AT_SPEED)
        k = np.arange(len(self.share))
        first, last = (held[0], held[-1]) if len(held) else (0, len(k))
        return np.asarray((k >= first) & (k <= last))

    @property
    def held(self) -> float:
        """Share of the length between the ramps on which the programmed speed is held."""
        steps = np.gradient(self.length)[self.under_way]
        fast = self.share[self.under_way] >= AT_SPEED
        return float(steps[fast].sum() / steps.sum()) if steps.sum() > 0 else float(fast.all())

    @property
    def ramps(self) -> tuple[float, float]:
        """Lengths, m, of the ramps to the speed at the start and from it at the end."""
        inside = self.length[self.under_way]
        return float(inside[0] - self.length[0]), float(self.length[-1] - inside[-1])

    @property
    def slowest(self) -> tuple[float, float]:
        """The smallest share of the programmed speed between the ramps, and its place, m."""
        share = np.where(self.under_way, self.share, np.inf)
        k = int(np.argmin(share))
        return float(min(share[k], 1.0)), float(self.length[k])


def timing_of(
    run: Executed, *, eta_v: float = 1.0, eta_a: float = 1.0, speed_share: float = 1.0
) -> Timing:
    """Return how long a run takes if every joint keeps its limits.

    Parameters
    ----------
    run : Executed
    eta_v, eta_a : float
        Share of the velocity and acceleration limits that may be used.
    speed_share : float
        Share of the programmed speed that is not exceeded, above 0 and at most 1; zones stay.

    Raises
    ------
    InputError
        The posture does not reach some samples of the run (NaN).
    """
    velocity, acceleration = run.robot.velocity_limits(), run.robot.acceleration_at(run.q)
    first, second = run.velocity_share * velocity, run.acceleration_share * acceleration
    if not run.reached:
        raise InputError("timing_of: expected a run within reach, got joints that are NaN")
    limits = (eta_v * velocity, eta_a * acceleration)
    rate = fastest_rates(run.time, first, second, limits, speed_share)
    clock = clock_of(run.time, rate)
    gone = lengths_along(run.T[:, :3, 3])
    return Timing(
        seconds=float(clock[-1]),
        programmed=float(run.tool_motion.time[-1]),
        time=run.time,
        clock=clock,
        share=rate,
        length=gone,
    )


def fastest_rates(
    time: Array, first: Array, second: Array, limits: tuple[Array, Array], most: float = 1.0
) -> Array:
    """Return the largest rates (m,) at which programmed time may pass, from rest to rest.

    Parameters
    ----------
    time : (m,) s
        Samples, in programmed time.
    first, second : (m, n)
        Velocities and accelerations of the joints there, at the programmed speed.
    limits : tuple of (n,), (n,) or (m, n)
        Those that the joints may have.
    most : float
        Largest rate.
    """
    steps = np.diff(time)
    room, lean, highest = _rows(first, second, *limits)
    highest = np.minimum(highest, most**2)
    return np.sqrt(_forward(_backward(highest, steps, room, lean), steps, room, lean))


def clock_of(time: Array, rate: Array) -> Array:
    """Return when samples of programmed time (m,) s are passed, s, at these rates (m,)."""
    pace = np.maximum((rate[1:] + rate[:-1]) / 2, 1e-9)
    return np.append(0.0, np.cumsum(np.diff(time) / pace))


def _rows(
    first: Array, second: Array, velocity: Array, acceleration: Array
) -> tuple[Array, Array, Array]:
    """Return room and lean (m, n) of |u + lean x| <= room, and the largest x (m,) of each sample.

    A joint that does not move bounds x alone. Two joints have a common u where
    |lean_1 - lean_2| x <= room_1 + room_2.
    """
    moves = np.abs(first) > 1e-12
    with np.errstate(divide="ignore", invalid="ignore"):
        room = np.where(moves, acceleration / np.abs(first), np.inf)
        lean = np.where(moves, second / first, 0.0)
        alone = np.where(moves, np.inf, acceleration / np.abs(second)).min(axis=1)
        most = np.minimum(alone, ((velocity / np.abs(first)) ** 2).min(axis=1))
        both = room[:, :, None] + room[:, None]
        pair = both / np.abs(lean[:, :, None] - lean[:, None])
    return room, lean, np.minimum(np.minimum(most, pair.min(axis=(1, 2))), 1.0)


def _backward(most: Array, steps: Array, room: Array, lean: Array) -> Array:
    """Return the largest x (m,) from which the end is reached at rest.

    A step leads from x to x + 2 step u, which must lie between zero and the x of the next sample.
    """
    reach = most.copy()
    reach[-1] = 0.0
    rate = 1 / (2 * steps[:, None])
    with np.errstate(divide="ignore"):
        rests = np.where(lean[:-1] > rate, room[:-1] / (lean[:-1] - rate), np.inf).min(axis=1)
        slope = np.where(lean[:-1] < rate, 1 / (rate - lean[:-1]), np.inf)
    for i in range(len(steps) - 1, -1, -1):
        left = ((reach[i + 1] * rate[i] + room[i]) * slope[i]).min()
        reach[i] = min(reach[i], rests[i], left)
    return reach


def _forward(reach: Array, steps: Array, room: Array, lean: Array) -> Array:
    """Return the largest x (m,) that is reached from rest."""
    x = reach.copy()
    x[0] = 0.0
    for i, step in enumerate(steps):
        u = (room[i] - lean[i] * x[i]).min()
        x[i + 1] = min(reach[i + 1], max(x[i] + 2 * step * u, 0.0))
    return x
