"""Issues that only URScript has: blends that meet, and reserved names."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from kerfpath.errors import InputError
from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import LinearMove, Program
from kerfpath.post.urscript._write import URScriptSettings, full_joint_speed

__all__ = ["check", "is_reserved"]

BLEND_ROOM = 1e-6
"""Smallest distance (m) between two blends, for the digits of targets."""
FULL_TURN = 2 * np.pi

KEYWORDS = re.compile(
    "and|break|continue|def|elif|else|end|enter_critical|exit_critical|false|global|goto|halt|if|"
    "in|join|kill|local|not|or|return|run|sec|sync|thread|true|while|xor"
)
"""Keywords, and statements of one word."""
BUILT_IN = re.compile(
    r"(get|set|is|read|write|str|modbus|rpc|rtde|socket|encoder|path_offset|force_mode|"
    r"freedrive_mode|end_\w+_mode|tool_contact|twist|wrench|screw_driving|jog)_\w+|"
    r"(pose|point)_(add|dist|inv|sub|trans)|(move|servo|speed|stop)[cjlp]|"
    r"(enable|disable|reset|request|unlock|start|stop|zero|conveyor|collision|teach)_\w+|"
    r"a?cos|a?sin|a?tan|atan2|binary_list_to_integer|ceil|d2r|eoat_\w+|floor|force|force_mode|"
    r"freedrive_mode|integer_to_binary_list|interpolate_pose|inv|length|log|norm|p|popup|pow|"
    r"powerdown|r2d|random|rotvec2rpy|rpc_factory|rpy2rotvec|size|sleep|sqrt|textmsg|time|"
    r"to_num|to_str|transpose|tcp"
)
"""Names of the controller's own functions, including likely ones of later versions."""


def is_reserved(name: str) -> bool:
    """Return whether URScript or the controller gives `name` another meaning."""
    return any(words.fullmatch(name.lower()) for words in (KEYWORDS, BUILT_IN))


def check(program: Program, settings: URScriptSettings) -> Iterator[ProgramIssue]:
    """Yield issues only of URScript: unknown joint speeds, blends that meet, a signal twice."""
    try:
        full_joint_speed(program.robot)
    except InputError as error:
        yield ProgramIssue("error", "joint-speed", str(error), "program")
    yield from _check_blends(program)
    beyond = max((float(np.abs(move.q).max()) for move in program.moves), default=0.0)
    if beyond > FULL_TURN:
        yield ProgramIssue(
            "warning",
            "turns",
            f"a joint turns to {np.degrees(beyond):.0f} deg; the controller must allow it to turn "
            "beyond 360 deg",
            "program",
        )
    for section in program.sections:
        for k, move in enumerate(section.moves):
            signals = [s.signal for s in getattr(move, "switches", ())]
            if len(signals) > len(set(signals)):
                message = "a signal is switched twice at the end of one move, expected once"
                yield ProgramIssue("error", "switches", message, f"{section.name}, move {k}")


def _check_blends(program: Program) -> Iterator[ProgramIssue]:
    """Check that blends do not meet: the controller skips a move whose blend meets another."""
    moves = program.moves
    if not moves:
        return
    points = program.tips(moves)[:, :3, 3]
    zone = np.array([move.zone for move in moves])
    room = np.linalg.norm(np.diff(points, axis=0), axis=1) - zone[:-1] - zone[1:]
    blended = (zone[:-1] > 0) | (zone[1:] > 0)
    met = np.flatnonzero(blended & (room < BLEND_ROOM))
    if met.size:
        k = int(met[0])
        kind = "a linear" if isinstance(moves[k + 1], LinearMove) else "a joint"
        yield ProgramIssue(
            "error",
            "blend-overlap",
            f"{met.size} moves are no longer than the blends at their ends, the first {kind} move "
            f"of {np.linalg.norm(points[k + 1] - points[k]) * 1e3:.3f} mm between blends of "
            f"{zone[k] * 1e3:g} and {zone[k + 1] * 1e3:g} mm; the controller would skip moves; "
            "lower zone_mm or use fewer nodes",
            "program",
        )
