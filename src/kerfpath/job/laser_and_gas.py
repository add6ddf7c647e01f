"""Check laser, gas and power of a program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from kerfpath.arrays import Array, Ints
from kerfpath.auditor import Check, Unit
from kerfpath.execution import executed_speeds, lit_of, shares_of
from kerfpath.job.audit_report import SAME_TIME, check, count, count_at
from kerfpath.job.format import Job
from kerfpath.post import (
    GASES,
    SAME_POWER,
    Gas,
    LinearMove,
    ProgramOptions,
    ReadGroup,
    ReadMove,
    ReadPower,
    ReadProgram,
    ReadSection,
    ReadStep,
    ReadWait,
    Signal,
    groups_of,
    laser_start,
    waits_at_start,
)
from kerfpath.robots import Robot
from kerfpath.transfer import least_time

# -----------------------------------------------------------------------------
# Laser and gas, by a state machine over all steps of a program in running order.
#
# Times follow from the text: a move along the path takes its length divided by its speed, or the
# stated time; a joint move takes the least time within the limits. A switch acts its lead time
# before the tip arrives. The source answers after the job's lead time, and then the beam is on,
# or off.

LIT: tuple[Signal, ...] = ("laser", *GASES)
"""The signals that are on or off."""
ENDLESS = 60.0
"""Assumed duration, s, of a move whose speed or limits are not known."""

What = Literal["air", "approach", "start", "cut", "end", "retract"]
_Found = tuple[float, int]
"""A value and the step of the program that it is of."""
_Times = list[tuple[float, float, int]]
"""From when to when (s) something is on, and the step of the program that switched it so."""
WORDS: dict[What, str] = {
    "air": "laser on in a transfer move, or while the robot waits there",
    "approach": "laser on during the approach",
    "start": "laser on at the start for longer than the pierce",
    "cut": "laser on while the robot waits in the cut",
    "end": "laser on while the robot waits at the end of the cut",
    "retract": "laser on during the retract",
}
"""Where the beam must not be on, and the title of the check."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamProcess:
    """Requirements of the job on beam and gas.

    Parameters
    ----------
    lead_time : float s
        Lead time of the laser.
    start_lead : float s
        That at a start: 0 where partners were asked, because the robot stands.
    start_wait : float s
        How long the robot waits at a start.
    pierce_time : float s
        How long the beam may be on there.
    gas_lead : float s or None
        How long before the start the gas is to flow; None: the program does not switch it.
    gas : {"gas", "gas_2"}
        Which gas flows.
    stops : bool
        Whether the job asks for a stop at every node.
    """

    lead_time: float
    start_lead: float
    start_wait: float
    pierce_time: float
    gas_lead: float | None
    gas: Gas
    stops: bool

    @classmethod
    def of(cls, options: ProgramOptions) -> BeamProcess:
        """Return the requirements of [program], as far as its language can express them."""
        gas, ahead = options.gas_lead, options.robot_language.ahead
        lead_time = options.lead_time if ahead else 0.0
        laser, wait = laser_start(options)
        start_lead = min(laser.lead_time, lead_time)
        return cls(
            lead_time=lead_time,
            start_lead=start_lead,
            start_wait=wait,
            pierce_time=wait + start_lead - lead_time,
            gas_lead=gas if gas is None or ahead else 0.0,
            gas=options.gas,
            stops=options.zone == 0,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Span:
    """What the robot does from one time (s) to another, and the step of the program."""

    what: What
    start: float
    end: float
    step: int
    process: BeamProcess
    waits: bool = False
    move: ReadMove | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Event:
    """A switch, the time (s) when it acts, and the step of the program."""

    time: float
    signal: Signal
    on: bool
    step: int


def check_laser_and_gas(
    read: ReadProgram, robot: Robot, processes: Sequence[BeamProcess]
) -> list[Check]:
    """Return the checks of beam and gas over a whole program; their node is its step.

    Parameters
    ----------
    read : ReadProgram
        The program, with the tip poses of its path.
    robot : Robot
    processes : sequence of BeamProcess
        That of each cut in the order of the program, at least one.
    """
    spans, events = _timeline(read, robot, processes)
    process = processes[-1]
    beam = _on(events, "laser", shift=process.lead_time)
    rows = [
        _row(f"beam-{what}", WORDS[what], _wrongly(spans, beam, what), SAME_TIME, "s")
        for what in WORDS
    ]
    said = "stop points in the cut with the laser on"
    stops = _row("beam-stop", said, _stops(spans, beam), 0, "count")
    rows.append(replace(stops, level="warning") if process.stops else stops)
    said = "changes of the file in the cut with the laser on"
    rows.append(_row("beam-file", said, _borders(spans, beam), 0, "count"))
    said = "switches of the laser that change nothing"
    rows.append(_row("beam-twice", said, _idle(events), 0, "count"))
    for signal in LIT:
        left = [event for event in events if event.signal == signal][-1:]
        found = [(float(event.on), event.step) for event in left]
        rows.append(_row(f"{signal}-at-the-end", f"{signal} on at the end", found, 0, "count"))
    return rows + _gas(spans, events, beam, switched=process.gas_lead is not None)


def _row(code: str, title: str, found: Sequence[_Found], limit: float, unit: Unit) -> Check:
    """Return a check of the largest of values with their steps; counts are summed."""
    value, step = max(found, default=(0.0, 0), key=lambda one: (one[0], -one[1]))
    if unit == "count":
        value = float(sum(one for one, _ in found))
    return check(code, title, value, limit, unit, step)


def _timeline(
    read: ReadProgram, robot: Robot, processes: Sequence[BeamProcess]
) -> tuple[list[_Span], list[_Event]]:
    """Return what a program does and switches over time, from 0 on.

    What comes behind the last cut has its process.
    """
    steps = {id(step): k for k, step in enumerate(read.steps)}
    spans: list[_Span] = []
    events: list[_Event] = []
    clock, q, T = 0.0, None, None
    for number, group in enumerate(groups_of(read)):
        process = processes[min(number, len(processes) - 1)]
        waits: dict[int, list[ReadWait]] = {}
        for behind, wait in group.waits:
            waits.setdefault(behind, []).append(wait)
        moves = [*group.joint, *group.path]
        for k, move in enumerate(moves):
            at = k - len(group.joint) + 1  # how many moves of the path are done
            took = _took(move, robot, q, T)
            what = _what(at, len(group.path))
            spans.append(
                _Span(what=what, start=clock, end=clock + took, step=steps[id(move)],
                      process=process, move=move)
            )  # fmt: skip
            clock += took
            for switch in move.switches:
                if switch.signal == "power":  # see check_power
                    continue
                time = clock - switch.lead_time
                events.append(
                    _Event(time=time, signal=switch.signal, on=switch.on, step=steps[id(move)])
                )
            if move.kind == "joint":
                q, T = move.q, None
            else:
                T = move.T_part_tip
            for wait in waits.get(at, []):  # those before the path behind its last joint move
                stands = _stands(at, len(group.path))
                spans.append(
                    _Span(what=stands, start=clock, end=clock + wait.time, step=steps[id(wait)],
                          process=process, waits=True)
                )  # fmt: skip
                clock += wait.time
    return spans, sorted(events, key=lambda event: event.time)


def _what(at: int, count: int) -> What:
    """Return the kind of a move after which `at` of `count` moves of the path are done."""
    if at < 1:
        return "air"
    if at == 1:
        return "approach"
    return "retract" if at == count else "cut"


def _stands(at: int, count: int) -> What:
    """Return where the robot waits after `at` of `count` moves of the path."""
    if at < 1 or at == count:
        return "air"
    if at == 1:
        return "start"
    return "end" if at == count - 1 else "cut"


def _took(move: ReadMove, robot: Robot, q: object, T: object) -> float:
    """Return how long (s) a move takes that begins at joints q or a tip pose T."""
    if move.duration is not None:
        return move.duration
    if move.kind == "joint":
        known = robot.velocity is not None and robot.acceleration is not None
        if not known or q is None or move.q is None or not move.speed:
            return ENDLESS
        way = np.abs(move.q - np.asarray(q))[None]
        return float(least_time(way, *robot.speed_limits())[0]) / move.speed
    if T is None or move.T_part_tip is None or not move.speed:
        return ENDLESS
    way = move.T_part_tip[:3, 3] - np.asarray(T)[:3, 3]
    return float(np.linalg.norm(way)) / move.speed


def _on(events: Sequence[_Event], signal: Signal, *, shift: float) -> _Times:
    """Return from when to when (s) a signal is on, and the step that switched it so."""
    found: _Times = []
    since: tuple[float, int] | None = None
    for event in events:
        if event.signal != signal:
            continue
        if event.on and since is None:
            since = (event.time + shift, event.step)
        elif not event.on and since is not None:
            found.append((since[0], event.time + shift, since[1]))
            since = None
    if since is not None:
        found.append((since[0], np.inf, since[1]))
    return found


def _overlap(start: float, end: float, on: _Times) -> float:
    """Return for how long (s) of a span something is on."""
    return sum(max(min(end, off) - max(start, one), 0.0) for one, off, _ in on)


def _wrongly(spans: Sequence[_Span], beam: _Times, what: What) -> list[_Found]:
    """Return for how long (s) the beam is on where it must not be, and the step there.

    A beam that begins in one span and ends in the next is counted in each.
    """
    found = []
    pierced = 0.0
    for span in spans:
        pierced = 0.0 if span.what in ("air", "approach") else pierced
        if span.what != what or (what == "cut" and not span.waits):
            continue
        on = _overlap(span.start, span.end, beam)
        if what == "start":
            pierced += on
            on = max(pierced - span.process.pierce_time, 0.0)
        found.append((on, span.step))
    return found


def _stops(spans: Sequence[_Span], beam: _Times) -> list[_Found]:
    """Return the inner targets of cuts where the robot stops and the beam stays on."""
    moves = [span for span in spans if span.move is not None]
    stops = [a for a, b in pairwise(moves) if a.what == b.what == "cut"]
    # A switch at the stop itself may act slightly before or after it.
    return [
        (1.0, span.step)
        for span in stops
        if span.move is not None and span.move.zone == 0 and _through(span.end, beam)
    ]


def _borders(spans: Sequence[_Span], beam: _Times) -> list[_Found]:
    """Return where a cut continues in another file while the beam is on."""
    moves = [span for span in spans if span.move is not None]
    return [
        (1.0, b.step)
        for a, b in pairwise(moves)
        if b.what == "cut" or (b.what == "retract" and a.what == "cut")
        if a.move is not None and b.move is not None and a.move.file != b.move.file
        if _through(a.end, beam)
    ]


def _through(time: float, on: _Times) -> bool:
    return any(one < time - SAME_TIME and time + SAME_TIME < off for one, off, _ in on)


def _idle(events: Sequence[_Event]) -> list[_Found]:
    """Return the switches that change nothing: another is missing, or acts too early or late."""
    state = dict.fromkeys(LIT, False)
    found = []
    for event in events:
        if state[event.signal] == event.on:
            found.append((1.0, event.step))
        state[event.signal] = event.on
    return found


def _gas(
    spans: Sequence[_Span], events: Sequence[_Event], beam: _Times, *, switched: bool
) -> list[Check]:
    """Return the checks that the gas flows before and with the beam, and nowhere else."""
    if not switched:
        found = [(1.0, event.step) for event in events if event.signal in GASES]
        return [_row("gas", "gas switches that the job does not ask for", found, 0, "count")]
    spread = [(max(on, 0.0), off, step) for on, off, step in beam if off < np.inf]
    begins = np.array([span.start for span in spans])
    without, late, idle = list[_Found](), list[_Found](), list[_Found]()
    for name in GASES:
        gas = _on(events, name, shift=0.0)
        for on, off, step in spread:
            amid = max(int(np.searchsorted(begins, (on + off) / 2, side="right")) - 1, 0)
            if spans[amid].process.gas == name:
                without.append((off - on - _overlap(on, off, gas), step))
        mine = [span for span in spans if span.process.gas == name]
        starts = [(span, span.process.gas_lead or 0.0) for span in mine if span.what == "approach"]
        late += [(lead - _overlap(s.end - lead, s.end, gas), s.step) for s, lead in starts]
        # The gas may also start at the beginning of the approach.
        ahead = [(min(s.end - lead, s.start), s.end, s.step) for s, lead in starts]
        for span in spans:
            if span.what in ("air", "approach", "retract") or span.process.gas != name:
                allowed = _overlap(span.start, span.end, _both(gas, ahead))
                idle.append((_overlap(span.start, span.end, gas) - allowed, span.step))
    return [
        _row("gas", "laser on without gas", without, SAME_TIME, "s"),
        _row("gas-lead", "delay of the gas before the start", late, SAME_TIME, "s"),
        _row("gas-idle", "gas on where it is not asked for", idle, SAME_TIME, "s"),
    ]


def _both(one: _Times, two: _Times) -> _Times:
    """Return the times when both are on."""
    found = [(max(a, c), min(b, d), step) for a, b, step in one for c, d, _ in two]
    return [(start, end, step) for start, end, step in found if end > start]


# -----------------------------------------------------------------------------
# The power along a cut: that of the job, and the check of the one in a program.

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
