"""The power along a cut: that of the job, and the check of the one in a program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kerfpath.arrays import Array, Ints
from kerfpath.auditor import Check
from kerfpath.execution import executed_speeds, lit_of, shares_of
from kerfpath.job.audit_report import SAME_TIME, check, count, count_at
from kerfpath.job.format import Job
from kerfpath.post import (
    SAME_POWER,
    LinearMove,
    ProgramOptions,
    ReadGroup,
    ReadMove,
    ReadPower,
    ReadProgram,
    ReadSection,
    ReadStep,
    laser_start,
    waits_at_start,
)

SLACK = 0.01
"""Share of the full power by which a program's power may leave the curve beyond its steps, because
the digits of its speeds and targets move the borders between them."""


def without_power(read: ReadProgram) -> ReadProgram:
    """Return a program without all that sets its power."""

    def bare(step: ReadStep) -> ReadStep:
        if not isinstance(step, ReadMove) or all(s.signal != "power" for s in step.switches):
            return step
        return replace(step, switches=tuple(s for s in step.switches if s.signal != "power"))

    def rest(section: ReadSection) -> ReadSection:
        steps = tuple(bare(step) for step in section.steps if not isinstance(step, ReadPower))
        return replace(section, steps=steps)

    return replace(read, sections=tuple(rest(section) for section in read.sections))


def check_power(
    job: Job, options: ProgramOptions, group: ReadGroup, moves: Sequence[LinearMove], ends: Ints
) -> list[Check]:
    """Return the checks of the power along a cut of a program.

    Parameters
    ----------
    job : Job
    options : ProgramOptions
        Those of the contour.
    group : ReadGroup
        The cut with its approach and retract.
    moves : sequence of LinearMove
        The move to the start of the cut, and those of the cut, as its text says them.
    ends : (m,) int
        Node of the target of each.
    """
    path, law = group.path, options.power
    switched = [(k, s) for k, move in enumerate(path) for s in move.switches]
    switched = [(k, s) for k, s in switched if s.signal == "power"]
    if law is None:
        many = len(switched) + len(group.powers)
        what = "settings of the power that the job does not ask for"
        return [count("power", what, many)] if many else []
    odd = [node_of(ends, at) for at, _ in group.powers if at not in (0, 1, len(path) - 1)]
    speed = executed_speeds(
        moves,
        job.robot,
        options,
        T_base_part=job.placement,
        T_flange_tip=job.tool,
    )
    said, slope = _in_moves(group)
    full = max(move.speed for move in moves[1:])
    cut = said[1:-1] + slope[1:-1] * speed.mean
    off = np.where(lit_of(path[:-1]), np.abs(cut - law.at(shares_of(moves, speed.mean))), 0.0)
    if law.follows == "steps":
        wrong = (np.abs(cut - law.nearest(cut)) > SAME_POWER) | (slope[1:-1] > 0)
    else:
        same = np.abs(slope[1:-1] * full - law.proportional) <= SAME_POWER
        wrong = ~same | (said[1:-1] > 0)
    k = int(np.argmax(off))
    lead = options.lead_time if options.robot_language.ahead else 0.0
    late = [abs(s.lead_time - lead) for _, s in switched]
    late += [abs(power.lead_time - lead) for _, power in group.powers if power.per_speed]
    return [
        check(
            "power",
            "difference of the power from that by the speed of the job",
            off[k],
            law.tolerance + SLACK,
            "share",
            int(ends[k]),
        ),
        count_at("power-steps", "moves whose power is not of the job's steps or line",
                 [int(ends[i]) for i in np.flatnonzero(wrong)]),
        count_at("power-standing", "settings of the power where the robot moves", odd),
        check("power-pierce", "difference of a stage of the pierce from the job's",
              _off_stages(options, group), SAME_POWER, "share"),
        check("power-lead", "difference of the power's lead time from the job's",
              max(late, default=0.0), SAME_TIME, "s"),
        check("power-off", "power while the tool backs off",
              max(said[-1], slope[-1] * full), 0.0, "share", int(ends[-1])),
    ]  # fmt: skip


def node_of(ends: Ints, at: int) -> int:
    """Return the node at which the robot is after `at` moves of the path."""
    return int(ends[min(max(at - 1, 0), len(ends) - 1)])


def _in_moves(group: ReadGroup) -> Array:
    """Return the share of the power in each of m moves of the path, and for each m/s, (2, m)."""
    now, found = (0.0, 0.0), []
    for k, move in enumerate(group.path):
        for at, power in group.powers:
            now = (power.share, power.per_speed) if at == k else now
        found.append(now)
        for switch in move.switches:
            now = now if switch.share is None else (switch.share, 0.0)
    return np.array(found).T


def _off_stages(options: ProgramOptions, group: ReadGroup) -> float:
    """Return by how much a share of the power differs in the stages of the pierce; 1 if times do.

    Waits at one power are one stage.
    """
    asked = [share for share, _ in options.pierce]
    waits = waits_at_start(options, laser_start(options)[1]) if asked else []
    said = [(_at(group, wait.line), wait.time) for at, wait in group.waits if at == 1]
    expected, found = _merged(list(zip(asked, waits, strict=True))), _merged(said)
    if not asked:
        return 0.0
    if len(expected) != len(found):
        return 1.0
    pairs = list(zip(expected, found, strict=True))
    if any(abs(one[1] - two[1]) > SAME_TIME for one, two in pairs):
        return 1.0
    return max(abs(one[0] - two[0]) for one, two in pairs)


def _merged(stages: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return stages (share, s), those at one power that follow each other as one."""
    found: list[tuple[float, float]] = []
    for share, time in stages:
        if found and abs(found[-1][0] - share) <= SAME_POWER:
            found[-1] = (share, found[-1][1] + time)
        else:
            found.append((share, time))
    return found


def _at(group: ReadGroup, line: int) -> float:
    """Return the share of the full power where the robot waits at the start, at a line."""
    now = 0.0
    for at, power in group.powers:
        if at == 0 or (at == 1 and power.line < line):
            now = power.share + power.per_speed
    return now
