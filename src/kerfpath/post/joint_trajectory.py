"""A program as a ROS message in memory, with the same checks as the file."""

from __future__ import annotations

from collections.abc import Sequence

from kerfpath.plans import Plan
from kerfpath.post.build import build_program
from kerfpath.post.program import Program
from kerfpath.post.ros import Message, RosSettings, message
from kerfpath.post.writer import post_and_read


def joint_trajectory(
    source: Program | Sequence[Plan], settings: RosSettings | None = None, *, strict: bool = False
) -> Message:
    """Return the fields of a trajectory_msgs/JointTrajectory, as `post(..., "ros")` writes them.

    Arguments and errors are those of `post`. The message does not contain what is switched: that
    is in the events file, which only `post` returns.
    """
    program = source if isinstance(source, Program) else build_program(source)
    settings = settings or RosSettings()
    post_and_read(program, "ros", settings, strict=strict)
    return message(program, settings)
