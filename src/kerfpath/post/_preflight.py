"""What a program must pass before it is written: one check for all languages."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array
from kerfpath.post._languages import Language
from kerfpath.post._languages import language as find_language
from kerfpath.post._program import (
    Comment,
    JointMove,
    LaserOff,
    LaserOn,
    LinearMove,
    Program,
    Section,
    Wait,
)

__all__ = ["ProgramIssue", "preflight"]

LARGEST_JOINT_STEP = np.pi
"""From half a turn on (rad), "the short way" no longer says which way a joint turns."""
LARGEST_ORIENTATION_STEP = np.pi / 2
"""Turn of the tool (rad) between linear targets that every controller interpolates alike."""
LOWEST_SHARE = 0.01
"""Smallest share of the full speed of a joint move: controllers count it in percent."""
LONGEST_WAIT = 60.0
"""s; a longer one is a mistake in its unit."""
LIMIT_NOISE = 1e-9
"""Excess over a joint limit (rad) that is rounding."""


@dataclass(frozen=True, slots=True)
class ProgramIssue:
    """One thing that is wrong with a program, or that its user has to know.

    Parameters
    ----------
    level : {"error", "warning"}
        An error forbids writing the program.
    code : str
        What kind of issue it is.
    message : str
        What was expected, what came, and what to do.
    place : str
        Where in the program.
    """

    level: Literal["error", "warning"]
    code: str
    message: str
    place: str

    def __str__(self) -> str:
        return f"{self.place}: {self.message}"


def preflight(program: Program, language: str = "rapid") -> list[ProgramIssue]:
    """Return everything that speaks against running `program`; empty = nothing known.

    Raises
    ------
    InputError
        An unknown language.
    """
    rules = find_language(language)
    issues = [issue for section in program.sections for issue in _numbers(section, rules)]
    # Speeds and zones are named by their formatted values: only finite ones can be.
    if not issues:
        issues += _names(program, rules)
    issues += _robot(program, rules)
    for section in program.sections:
        issues += _laser(section, rules)
        issues += _waits(section)
        issues += _motion(program, section, rules)
        issues += _limits(program, section)
    if not program.air_checked and any(isinstance(step, JointMove) for step in program.steps):
        issues.append(
            ProgramIssue(
                "warning",
                "air-moves",
                "the moves to and between contours have not been checked for collisions; run them "
                "at low speed first",
                "program",
            )
        )
    return issues


def _robot(program: Program, rules: Language) -> Iterator[ProgramIssue]:
    if refusal := rules.refusal(program.robot):
        yield ProgramIssue("error", "wrong-robot", refusal, "program")
    if not program.sections:
        yield ProgramIssue("error", "empty", "there is no contour to cut", "program")


def _names(program: Program, rules: Language) -> Iterator[ProgramIssue]:
    seen: dict[str, str] = {}
    for name, what in rules.declared(program):
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
            yield ProgramIssue(
                "error",
                "name-identifier",
                f"{name!r} must be a letter followed by letters, digits and _",
                what,
            )
        elif len(name) > rules.longest_name:
            yield ProgramIssue(
                "error",
                "name-length",
                f"{name!r} has {len(name)} characters, at most {rules.longest_name} are allowed",
                what,
            )
        elif rules.is_reserved(name):
            yield ProgramIssue(
                "error", "name-reserved", f"{name!r} is reserved in {rules.name}; rename it", what
            )
        elif (other := seen.get(name.lower())) is not None:
            yield ProgramIssue(
                "error", "name-collision", f"{name!r} is also the name of {other}; rename it", what
            )
        seen[name.lower()] = what


def _numbers(section: Section, rules: Language) -> Iterator[ProgramIssue]:
    for number, step in enumerate(section.steps):
        place = f"{section.name}, step {number}"
        if isinstance(step, LinearMove) and not rules.slowest <= step.speed < np.inf:
            yield ProgramIssue(
                "error",
                "speed",
                f"the speed must be at least {rules.slowest * 1e3:g} mm/s, "
                f"got {step.speed * 1e3:g} mm/s",
                place,
            )
        if isinstance(step, JointMove) and not LOWEST_SHARE <= step.speed <= 1:
            yield ProgramIssue(
                "error",
                "speed",
                f"the share of the full speed must lie between {LOWEST_SHARE:g} and 1, "
                f"got {step.speed:g}",
                place,
            )
        if isinstance(step, LinearMove | JointMove) and not 0 <= step.zone < np.inf:
            yield ProgramIssue(
                "error",
                "zone",
                f"the zone must be 0 mm (stop) or more, got {step.zone * 1e3:g} mm",
                place,
            )
        if isinstance(step, LaserOn | LaserOff) and not 0 <= step.lead_time <= rules.longest_lead:
            yield ProgramIssue(
                "error",
                "lead-time",
                f"the lead time must lie between 0 and {rules.longest_lead:g} s, "
                f"got {step.lead_time:g} s",
                place,
            )


def _waits(section: Section) -> Iterator[ProgramIssue]:
    """Check that waits are of a sensible length, and where the robot stands."""
    stopped = False
    for number, step in enumerate(section.steps):
        if isinstance(step, JointMove | LinearMove):
            stopped = step.zone == 0
        if not isinstance(step, Wait):
            continue
        place = f"{section.name}, step {number}"
        if not 0 < step.time <= LONGEST_WAIT:
            yield ProgramIssue(
                "error",
                "wait",
                f"a wait must last more than 0 s and at most {LONGEST_WAIT:g} s, got "
                f"{step.time:g} s",
                place,
            )
        if not stopped:
            yield ProgramIssue("error", "wait", "a wait must follow a move that stops", place)


def _laser(section: Section, rules: Language) -> Iterator[ProgramIssue]:
    """Check that the laser is only on between its switches, along linear moves, and off after."""
    on, last = False, None
    for number, step in enumerate(section.steps):
        if isinstance(step, Comment | Wait):
            continue
        place = f"{section.name}, step {number}"
        if isinstance(step, LaserOn | LaserOff):
            if not isinstance(last, LinearMove) or on == isinstance(step, LaserOn):
                yield ProgramIssue(
                    "error",
                    "laser-order",
                    "the laser must be switched on and off in turn, each right after a linear move",
                    place,
                )
            on = isinstance(step, LaserOn)
        elif on and isinstance(step, JointMove):
            yield ProgramIssue("error", "laser-order", "a joint move with the laser on", place)
        last = step
    if on:
        yield ProgramIssue("error", "laser-order", "the laser is still on at the end", section.name)


def _motion(program: Program, section: Section, rules: Language) -> Iterator[ProgramIssue]:
    """Check the straight moves of a section: steps, zones, turning speed, lead times."""
    moves = [step for step in section.steps if isinstance(step, JointMove | LinearMove)]
    poses = [_tip(program, move) for move in moves]
    places = [f"{section.name}, move {number}" for number in range(len(moves))]
    lengths, too_fast = [], 0
    for k in range(1, len(moves)):
        before, move = moves[k - 1], moves[k]
        lengths.append(float(np.linalg.norm(poses[k][:3, 3] - poses[k - 1][:3, 3])))
        if not isinstance(move, LinearMove):
            continue
        step = np.abs(move.q - before.q)
        joint = int(np.argmax(step))
        if step[joint] >= LARGEST_JOINT_STEP:
            yield ProgramIssue(
                "error",
                "joint-step",
                f"joint {joint + 1} turns {np.degrees(step[joint]):.1f} deg in one linear move, "
                f"expected less than {np.degrees(LARGEST_JOINT_STEP):g} deg; use finer nodes",
                places[k],
            )
        turn = Rotation.from_matrix(poses[k - 1][:3, :3].T @ poses[k][:3, :3]).magnitude()
        if turn >= LARGEST_ORIENTATION_STEP:
            yield ProgramIssue(
                "error",
                "orientation-step",
                f"the tool turns {np.degrees(turn):.1f} deg in one linear move, expected less "
                f"than {np.degrees(LARGEST_ORIENTATION_STEP):g} deg; use finer nodes",
                places[k],
            )
        too_fast += int(turn * move.speed > rules.turning_speed * lengths[-1])
    if too_fast:
        yield ProgramIssue(
            "warning",
            "turning-speed",
            f"in {too_fast} linear moves the tool turns faster than "
            f"{np.degrees(rules.turning_speed):g} deg/s; the controller will slow the tip down",
            section.name,
        )
    near = [min(lengths[max(k - 1, 0) : k + 1], default=np.inf) for k in range(len(moves))]
    overlaps = sum(move.zone > gap / 2 for move, gap in zip(moves, near, strict=True))
    if overlaps:
        yield ProgramIssue(
            "warning",
            "zone-overlap",
            f"at {overlaps} of {len(moves)} targets the zone is larger than half the distance to a "
            "neighbour; the controller will reduce it",
            section.name,
        )
    yield from _late_switches(section, lengths)


def _late_switches(section: Section, lengths: list[float]) -> Iterator[ProgramIssue]:
    number, speed = -1, 0.0
    for step in section.steps:
        if isinstance(step, JointMove | LinearMove):
            number, speed = number + 1, step.speed
        elif isinstance(step, LaserOn | LaserOff) and number >= 1 and speed > 0:
            duration = lengths[number - 1] / speed
            if step.lead_time > duration:
                yield ProgramIssue(
                    "warning",
                    "short-lead",
                    f"the laser is to be switched {step.lead_time * 1e3:g} ms ahead, but the move "
                    f"there lasts only {duration * 1e3:.1f} ms; it is switched as that move begins",
                    f"{section.name}, move {number}",
                )


def _limits(program: Program, section: Section) -> Iterator[ProgramIssue]:
    limits = program.robot.joint_limits()
    words = program.robot.reasons()[2:]
    number = -1
    for step in section.steps:
        if not isinstance(step, JointMove | LinearMove):
            continue
        number += 1
        sums = limits.rows @ step.q
        below = np.concatenate([limits.lower - step.q, limits.row_lower - sums])
        above = np.concatenate([step.q - limits.upper, sums - limits.row_upper])
        below[:6][limits.endless] = above[:6][limits.endless] = -np.inf
        for i, excess in enumerate(np.stack([below, above], axis=1).ravel()):
            if excess > LIMIT_NOISE:
                yield ProgramIssue(
                    "error",
                    "axis-limit",
                    f"{words[i]}: {np.degrees(excess):.3f} deg beyond its limit",
                    f"{section.name}, move {number}",
                )


def _tip(program: Program, move: JointMove | LinearMove) -> Array:
    """Return the tip pose of a target in the part frame, (4, 4) m."""
    if isinstance(move, LinearMove):
        return move.T_part_tip
    T_base_tip = program.robot.forward(move.q) @ program.T_flange_tip
    return np.asarray(np.linalg.solve(program.T_base_part, T_base_tip))
