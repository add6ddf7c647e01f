"""Motion of the joints as a controller runs a program, also between the targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kerfpath._arrays import Array
from kerfpath._repr import short_repr
from kerfpath.auditor import ENCLOSED, rates_along
from kerfpath.execution._course import ToolCourse
from kerfpath.execution._wrist import joints_with_wrist, require_wrist
from kerfpath.post import PLAIN, Controller, JointMove, LinearMove, Program
from kerfpath.robots import Robot, base_in_part

__all__ = ["Executed", "Peak", "executed", "from_stop_to_stop", "run_along"]

WHERE = (0.1, 0.5, 0.9)
"""Shares of each smooth stretch at which the joints are sampled."""
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
    course : ToolCourse
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
    course: ToolCourse
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
        poses = self.course.poses(self.course.time)
        return float(np.linalg.norm(poses[:, :3, 3] - self.course.T[:, :3, 3], axis=1).max())

    def _peak(self, shares: Array) -> Peak:
        size = np.abs(shares)
        size = np.where(np.isnan(size), np.inf, size)
        m, joint = divmod(int(np.argmax(size)), size.shape[1])
        return Peak(float(size[m, joint]), joint, float(self.time[m]))


def executed(program: Program, *, controller: Controller = PLAIN) -> tuple[Executed, ...]:
    """Return every run of straight and circular moves of a program, as it is executed.

    The motion is that of `ToolCourse`, at the programmed speeds throughout: neither speeding up
    from the stop nor slowing down for a limit is modelled. The joints follow it exactly; external
    axes move evenly from target to target, in zones like the tip. Velocities and accelerations are
    sampled three times in each smooth stretch, together with bounds that hold everywhere; see
    `kerfpath.auditor.rates_along`. Torques are those at the samples.

    Parameters
    ----------
    program : Program
    controller : Controller
        For a language it is `language(name).controller(settings)`.

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
) -> Executed:
    """Return the run of moves from the target of the first, where the robot is stopped, to a stop.

    Parameters
    ----------
    moves : sequence of LinearMove
        Three or more, each with the joints at its target.
    robot : Robot
    T_base_part, T_flange_tip : (4, 4) m
    controller, section
        As in `executed` and `Executed`.

    Raises
    ------
    InputError
        As `executed`.
    """
    robot.require_no_free_joint("the motion between the nodes")
    course = ToolCourse.of(moves[0].T_part_tip, moves[1:], controller)
    borders = course.borders
    long = np.diff(borders)
    seen = long > min(RESOLVED, long.max() / 2)
    begin, long = borders[:-1][seen], long[seen]
    time = (begin[:, None] + long[:, None] * np.array(WHERE)).ravel()
    step = np.repeat(STEP * long, len(WHERE))
    targets = np.array([move.q for move in moves])
    wrist = controller.orientation == "wrist"
    joints = _by_wrist if wrist else _by_pose
    before, q, after = (
        joints(robot, course, time + sign * step, targets, T_base_part, T_flange_tip)
        for sign in (-1, 0, 1)
    )
    T = course.poses(time)
    if wrist:
        reached = ~np.isnan(q).any(axis=1)
        T[reached] = np.linalg.inv(T_base_part) @ robot.forward(q[reached]) @ T_flange_tip
    velocity, acceleration = robot.speed_limits()
    v, a = (after - before) / (2 * step[:, None]), (after - 2 * q + before) / step[:, None] ** 2
    run = Executed(
        section=section,
        course=course,
        time=time,
        planned=np.interp(time, course.time, np.cumsum([0.0, *(m.duration for m in moves[1:])])),
        q=q,
        T=T,
        velocity_share=v / velocity,
        acceleration_share=a / acceleration,
        torque_share=_torque_share(robot, q, v, a),
        velocity_bound=np.inf,
        acceleration_bound=np.inf,
        sampled=_sampled(robot, controller),
        controller=controller,
    )
    fast, sharp = run.peak_velocity.share, run.peak_acceleration.share
    if run.sampled or not np.isfinite(max(fast, sharp)):
        return run
    middles = (borders[1:] + borders[:-1]) / 2
    bounds = rates_along(
        robot,
        course.pieces(targets[:, robot.family.joints :]),
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
    robot: Robot, course: ToolCourse, time: Array, targets: Array, T_base_part: Array,
    T_flange_tip: Array,
) -> Array:  # fmt: skip
    """Return the joints (m, n) at times (m,) that are close to those at the targets (K, n)."""
    arm, x, seen = _alone(robot, course, time, targets, T_base_part)
    near = np.stack([np.interp(time, course.time, joint) for joint in targets.T], axis=1)
    q = arm.nearest(seen @ np.linalg.inv(T_flange_tip), near[:, : arm.joints])
    return np.concatenate([q, x], axis=1)


def _by_wrist(
    robot: Robot, course: ToolCourse, time: Array, targets: Array, T_base_part: Array,
    T_flange_tip: Array,
) -> Array:  # fmt: skip
    """Return the joints (m, n) at times (m,), with even motion of the wrist between targets."""
    arm, x, seen = _alone(robot, course, time, targets, T_base_part)
    require_wrist(arm)
    near = course.blended(targets[:, : arm.joints], time)
    q = joints_with_wrist(arm, seen[:, :3, 3], near, T_flange_tip)
    return np.concatenate([q, x], axis=1)


def _alone(
    robot: Robot, course: ToolCourse, time: Array, targets: Array, T_base_part: Array
) -> tuple[Robot, Array, Array]:
    """Return the arm, its external axes (m, E) at times, and the poses of the tip that it sees.

    The poses are in the robot base, wherever external axes carry it.
    """
    arm = robot.alone()
    x = course.blended(targets[:, arm.joints :], time)
    base = base_in_part(robot.externals, x)
    return arm, x, np.linalg.inv(base) @ T_base_part @ course.poses(time)


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
