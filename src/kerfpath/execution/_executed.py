"""What the joints do in a program as a controller runs it, between the targets too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kerfpath._arrays import Array
from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.execution._course import ToolCourse
from kerfpath.post import JointMove, LinearMove, Program, Section

__all__ = ["Executed", "Peak", "executed"]

WHERE = (0.1, 0.5, 0.9)
"""Shares of each smooth stretch at which the joints are looked at."""
STEP = 0.05
"""Share of it by which they are looked at before and after, for their rates."""


class Peak(NamedTuple):
    """The largest share of a limit, of which joint (counted from 0), and at which time, s."""

    share: float
    joint: int
    time: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Executed:
    """One run of straight and circular moves, from stop to stop, at the programmed speeds.

    Parameters
    ----------
    section : str
        Of the program.
    course : ToolCourse
    time : (m,) s
        Where the joints were looked at, from the start of the run.
    q : (m, n) rad
        NaN where the posture of the targets does not reach.
    velocity_share, acceleration_share : (m, n)
        Signed, of the full limit of each joint. Where one is above 1 in size, the robot cannot run
        at the programmed speed: a controller slows down.
    """

    section: str
    course: ToolCourse
    time: Array
    q: Array
    velocity_share: Array
    acceleration_share: Array

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
    def missed(self) -> float:
        """The largest distance, m, by which the tip passes a target."""
        poses = self.course.poses(self.course.time)
        return float(np.linalg.norm(poses[:, :3, 3] - self.course.T[:, :3, 3], axis=1).max())

    def _peak(self, shares: Array) -> Peak:
        size = np.abs(shares)
        if np.isnan(size).any():
            m, joint = divmod(int(np.flatnonzero(np.isnan(size).ravel())[0]), size.shape[1])
            return Peak(np.inf, joint, float(self.time[m]))
        m, joint = divmod(int(np.argmax(size)), size.shape[1])
        return Peak(float(size[m, joint]), joint, float(self.time[m]))


def executed(program: Program, *, turning_speed: float = np.inf) -> tuple[Executed, ...]:
    """Return every run of straight and circular moves of a program, as it is executed.

    The motion is that of `ToolCourse`, at the programmed speeds throughout: neither speeding up
    from the stop nor slowing down for a limit is modelled. The joints follow it exactly. Their
    velocities and accelerations are looked at three times in each stretch that is smooth, which is
    a matter of sampling, and proves nothing.

    Parameters
    ----------
    program : Program
    turning_speed : float rad/s
        How fast the controller turns the tool at most in linear moves, see `post.Rules`.

    Raises
    ------
    InputError
        A robot whose limits of velocity and acceleration are not known, or an external axis.
    """
    if program.robot.external is not None:
        raise InputError("executed: expected a robot without an external axis")
    return tuple(
        _run(program, section, moves, turning_speed)
        for section in program.sections
        for moves in _runs(section)
    )


def _runs(section: Section) -> list[list[LinearMove]]:
    """Return the moves of a section from stop to stop; each list begins where the robot stands."""
    found: list[list[LinearMove]] = []
    run: list[LinearMove] = []
    for move in section.moves:
        if isinstance(move, JointMove):
            run = []
            continue
        run.append(move)
        if move.zone == 0:
            found += [run] if len(run) > 2 else []
            run = [move]
    return found


def _run(program: Program, section: Section, moves: list[LinearMove], turning: float) -> Executed:
    robot, base = program.robot, program.T_base_part
    T_tip_flange = np.linalg.inv(program.T_flange_tip)
    course = ToolCourse.of(moves[0].T_part_tip, moves[1:], turning)
    borders = course.borders
    long = np.diff(borders)
    time = (borders[:-1, None] + long[:, None] * np.array(WHERE)).ravel()
    step = np.repeat(STEP * long, len(WHERE))
    planned = np.array([move.q for move in moves])
    near = np.stack([np.interp(time, course.time, joint) for joint in planned.T], axis=1)
    before, q, after = (
        robot.nearest(base @ course.poses(time + sign * step) @ T_tip_flange, near)
        for sign in (-1, 0, 1)
    )
    velocity, acceleration = robot.speed_limits()
    return Executed(
        section=section.name,
        course=course,
        time=time,
        q=q,
        velocity_share=(after - before) / (2 * step[:, None]) / velocity,
        acceleration_share=(after - 2 * q + before) / step[:, None] ** 2 / acceleration,
    )
