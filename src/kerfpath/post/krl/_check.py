"""Issues that only KRL has: the controller's frames, turns beyond Turn, the short way."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kerfpath._arrays import Array
from kerfpath.post._external import said
from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import JointMove, Program
from kerfpath.post.krl._axes import axes_from_joints, joints_from_axes
from kerfpath.post.krl._settings import AXES, KrlSettings
from kerfpath.robots import Robot

__all__ = ["check"]

HOME = np.radians([[0.0, -90.0, 90.0, 0.0, 0.0, 0.0]])
"""Axes at which the lower arm is upright and the rest points ahead."""
FLANGE = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Orientation of the controller's flange there: z ahead, x down."""
FRAME = 1e-6
"""Largest difference (m and sine) of a description's frames from the controller's."""
TURN_DEG = 360.0
"""Largest axis value, either way, that Turn with its one bit for each axis can express."""
HALF_TURN_DEG = 180.0 - 1e-3
"""An endless axis that should turn farther in one motion turns the other way."""


def check(program: Program, settings: KrlSettings) -> Iterator[ProgramIssue]:
    """Yield what KRL cannot express of a program, or a KUKA controller cannot do."""
    yield from _check_frames(program.robot)
    moves = program.moves
    places = [
        f"{s.name}, move {number}" for s in program.sections for number in range(len(s.moves))
    ]
    q = np.array([move.q for move in moves])
    axes_deg = np.degrees(axes_from_joints(program.robot, q))
    beyond = (np.abs(axes_deg) > TURN_DEG) & ~program.robot.endless[:6]
    axes_deg = np.hstack([axes_deg, said(program.robot, q)])
    for k, i in np.argwhere(beyond).tolist():
        message = f"A{i + 1} = {axes_deg[k, i]:.1f} deg cannot be expressed by Status and Turn"
        fix = "only an endless axis may pass 360 deg; set endless, or limit the axis"
        yield ProgramIssue("error", "turn", f"{message}; {fix}", places[k])
    for k, move in enumerate(moves):
        if isinstance(move, JointMove) and move.zone > 0:
            message = "a joint move cannot have a zone given as a length; give it no zone"
            yield ProgramIssue("error", "zone", message, places[k])
        if isinstance(move, JointMove) and k > 0:
            yield from _check_short_way(program, axes_deg[k] - axes_deg[k - 1], places[k])


def _check_frames(robot: Robot) -> Iterator[ProgramIssue]:
    """Check that the robot's base and flange are $ROBROOT and the controller's flange."""
    g = robot.geometry
    T = robot.alone().forward(joints_from_axes(robot, HOME))[0]
    point = np.array([g["a1"] + g["c3"] + g["c4"], g["b"], g["c1"] + g["c2"] - g["a2"]])
    off = max(np.abs(T[:3, 3] - point).max(), np.abs(T[:3, :3] - FLANGE).max())
    if off > FRAME:
        yield ProgramIssue(
            "error",
            "frames",
            f"base or flange of {robot.id!r} are not the controller's: at A1 to A6 = 0, -90, 90, "
            f"0, 0, 0 deg the flange must be at {np.round(point * 1e3, 3).tolist()} mm, with z "
            "ahead and x down; choose those links of the description",
            "program",
        )


def _check_short_way(program: Program, step_deg: Array, place: str) -> Iterator[ProgramIssue]:
    """Check the joint moves of endless axes, which turn by less than half a turn in a motion.

    Another way is an error if the transfer moves have been checked for collisions.
    """
    names = [*AXES, *(axis.name for axis in program.robot.externals)]
    for i in np.flatnonzero(program.robot.endless & (np.abs(step_deg) > HALF_TURN_DEG)).tolist():
        short = (step_deg[i] + 180.0) % 360.0 - 180.0
        yield ProgramIssue(
            "error" if program.air_checked else "warning",
            "short-way",
            f"{names[i]} is endless and would turn the short way, by {short:.1f} deg, not by "
            f"{step_deg[i]:.1f} deg as planned",
            place,
        )
