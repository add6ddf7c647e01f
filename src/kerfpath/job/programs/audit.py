"""Audit a program on disk: compare the motion that its text means with the job."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from kerfpath.arrays import Array, short_repr
from kerfpath.auditor import (
    MOST_ROUNDED,
    Check,
    Rounding,
    Unit,
    rounding_of,
    transfer_checks,
    worst_of,
)
from kerfpath.cell import Cell
from kerfpath.contour import KINDS, Contour
from kerfpath.errors import InputError
from kerfpath.execution import from_stop_to_stop, run_along
from kerfpath.job.as_run import checks_of_unknown, run_judged
from kerfpath.job.audit_report import AuditReport, check, check_order, collision_note, count
from kerfpath.job.format import Candidate, Job, PreparedJob, ProgramOptions, prepare, read_job
from kerfpath.job.programs.expected import TargetNodes, check_pins, expect_program, nodes_at_targets
from kerfpath.job.programs.reading import (
    ReadCut,
    add_tips,
    divide_arcs,
    language_of,
    program_on_disk,
    read_cuts,
)
from kerfpath.plans import Plan, Proof
from kerfpath.post import (
    CircularMove,
    Controller,
    Language,
    LanguageSettings,
    LinearMove,
    ReadMove,
    ReadProgram,
    ReadWait,
    Rules,
    Signal,
    differences,
    groups_of,
)
from kerfpath.robots import Robot
from kerfpath.transfer import least_time
from kerfpath.windows import GammaWindow

# -----------------------------------------------------------------------------
# Check the joint limits of a program as a controller runs its text, with rounded corners.

SOME_ZONE = 1.0
"""Zone, m, for a text that gives no length; any value except zero."""
SHORTEST = 1e-9
"""Least duration of a move, s."""


def check_run(
    job: Job, cut: ReadCut, made: Plan, path: Contour, digits: Rounding, chosen: Language,
    settings: LanguageSettings,
) -> list[Check]:  # fmt: skip
    """Return the checks of a cut's motion along a path, by its own zones and speeds.

    The checks allow for the digits of the text, which over short intervals add accelerations.
    """
    if not chosen.zones:
        return [*checks_of_unknown(job, f"{chosen.name} has no zones")]
    controller = chosen.controller(settings)
    if any(move.zone is None for move in cut.targets) and not controller.rounds_by_itself:
        return [*checks_of_unknown(job, f"the zones of {chosen.name} here are not lengths")]
    runs = [
        run_along(
            part, job.robot, T_base_part=job.placement, T_flange_tip=job.tool,
            controller=controller,
        )
        for part in from_stop_to_stop(_moves(cut, controller))
    ]  # fmt: skip
    if not runs:
        return [*checks_of_unknown(job, "the robot stops at every node")]
    run = max(runs, key=lambda each: each.most)
    dq, dt = np.diff(made.q, axis=0), np.diff(made.time)
    velocity, acceleration = job.robot.speed_limits()
    allowed = (
        (digits.of_velocity(dq, dt) / velocity).max(),
        (digits.of_acceleration(dq, dt) / acceleration).max(initial=0.0),
    )
    fast, sharp, *others = run_judged(job, run, made, path).checks
    more = [min(float(each), MOST_ROUNDED) for each in allowed]
    return [
        replace(fast, limit=fast.limit + more[0]),
        replace(sharp, limit=sharp.limit + more[1]),
        *others,
    ]


def _moves(cut: ReadCut, controller: Controller) -> list[LinearMove]:
    """Return the moves of a cut as in its text; of the first one only the end matters.

    If the text gives no length for a zone, it is that of the controller.
    """
    found: list[LinearMove] = []
    before = int(cut.ends[0])
    for move, node in zip(cut.targets, cut.ends, strict=True):
        T, q = cut.T_part_tip[node], cut.q[node]
        took = max(float(cut.took[before:node].sum()), SHORTEST)
        way = np.diff(cut.T_part_tip[before : node + 1, :3, 3], axis=0)
        speed = move.speed or float(np.linalg.norm(way, axis=1).sum()) / took
        zone = controller.zone(SOME_ZONE, speed) if move.zone is None else move.zone
        if move.T_part_via is None:
            made = LinearMove(T_part_tip=T, q=q, speed=speed, duration=took, zone=zone)
        else:
            made = CircularMove(
                T_part_tip=T, q=q, speed=speed, duration=took, zone=zone,
                T_part_via=move.T_part_via, q_via=q,
            )  # fmt: skip
        found.append(made)
        before = int(node)
    return found


# -----------------------------------------------------------------------------
# The checks of one cut of a program: its path, motion, speeds, nodes and posture.

SAME_SPEED = 0.02
"""Share by which a speed may differ from that of the job, beyond its digits."""
SAME_TIME = 2e-3
"""Tolerance (s) of lead times and waits against the job; controllers round them."""
CLIMB = 0.05
"""Weight of distances along the path against those from it, in the search for a place on it."""


def check_cut(
    job: Job, candidate: Candidate, cut: ReadCut, cell: Cell | None, chosen: Language,
    settings: LanguageSettings,
) -> tuple[list[Check], tuple[TargetNodes, Plan] | None]:  # fmt: skip
    """Return the checks of a cut, and its nodes and plan if it can be compared with the job."""
    unreached = np.flatnonzero(np.isnan(cut.q).any(axis=1))
    if unreached.size:
        said = "targets out of the robot's reach in the posture of the start"
        return [count("reach", said, unreached.size, int(unreached[0]))], None
    reference = candidate.path
    s, ends = _along(cut, reference)
    rows = [check("ends", "distance of the ends from those of the contour", ends.max(), 1e-4, "m")]
    if (np.diff(s) <= 0).any():
        node = int(np.flatnonzero(np.diff(s) <= 0)[0])
        said = "stretches that go back along the contour"
        return [*rows, count("order", said, (np.diff(s) <= 0).sum(), node)], None
    took = np.where(np.isnan(cut.speed), cut.took, np.diff(s) / cut.speed)
    made = _plan(job, candidate.nodes.name, cut, s, np.append(0.0, np.cumsum(took)))
    allowed, tilt = job.tolerances, job.options.tilt
    if tilt is not None:
        allowed = replace(allowed, axis=allowed.axis + tilt.cone)
    rules = chosen.rules(settings)
    digits = _rounding(cut, made, rules)
    rows += allowed.checks(made, reference=reference, cell=cell, rounding=digits)
    rows += _process_checks(job, candidate, cut, made, digits.time, ahead=chosen.ahead)
    rows += _postures(job, cut, chosen, settings, digits.q)
    rows += check_run(job, cut, made, reference, digits, chosen, settings)
    found = nodes_at_targets(job, candidate, cut, s)
    off, alone = int(np.argmax(found.off)), int(np.argmax(found.alone))
    said = "distance of the targets from the nodes of the job"
    rows.append(check("nodes", said, found.off[off], allowed.path, "m", int(cut.ends[off])))
    said = "targets that skip a node of the job, or are not at a new one"
    rows.append(count("every-node", said, found.alone.sum(), int(cut.ends[alone])))
    return rows, (found, made) if found.complete else None


def _along(cut: ReadCut, reference: Contour) -> tuple[Array, Array]:
    """Return arc lengths (K,) m of the nodes on the contour, and distances (2,) m of its ends.

    If the contour passes the same place twice, the share of the length decides.
    """
    points = cut.T_part_tip[:, :3, 3]
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    guess = reference.s[0] + way / way[-1] * reference.length
    # A drawn line with few corners needs samples as close as the nodes of the cut.
    fine = np.linspace(reference.s[0], reference.s[-1], 8 * max(len(reference), len(points)))
    at = np.unique(np.concatenate([reference.s, fine]))
    tree = cKDTree(np.c_[reference.at(at)[0], CLIMB * at])
    near = np.asarray(tree.query(np.c_[points, CLIMB * guess])[1])
    s = at[near]
    for _ in range(3):  # on the chords beside the nearest sample
        before, after = (
            reference.at(np.maximum(s - 1e-5, at[0]))[0],
            reference.at(np.minimum(s + 1e-5, at[-1]))[0],
        )
        chord = after - before
        step = ((points - reference.at(s)[0]) * chord).sum(axis=1) / np.maximum(
            np.linalg.norm(chord, axis=1), 1e-12
        )
        s = np.clip(s + step, at[0], at[-1])
    ends = np.linalg.norm(points[[0, -1]] - reference.points[[0, -1]], axis=1)
    s[0], s[-1] = reference.s[0], reference.s[-1]
    return s, ends


def _plan(job: Job, name: str, cut: ReadCut, s: Array, time: Array) -> Plan:
    """Return the cut in the text as a plan, so that it can be audited as one."""
    K = len(cut.q)
    return Plan(
        contour=Contour(cut.T_part_tip[:, :3, 3], cut.T_part_tip[:, :3, 2], s=s, name=name),
        robot=job.robot,
        T_flange_tip=job.tool,
        T_base_part=job.placement,
        q=cut.q,
        gamma=np.zeros(K),
        posture=np.zeros(K, dtype=np.int64),
        turn=np.zeros(cut.q.shape, dtype=np.int64),
        time=time,
        settings=replace(job.options, tilt=None, closure="free"),
        cost=0.0,
        proof=Proof(optimal=False, statement="read from a program"),
        counts={},
    )


def _rounding(cut: ReadCut, made: Plan, rules: Rules) -> Rounding:
    """Return the rounding of joints and times of a cut by the digits of a language."""
    jointed = all(move.T_part_tip is None for move in cut.moves)
    time = np.where(np.isnan(cut.speed), 0.0, rules.speed_step / 2 / cut.speed)
    return rounding_of(made, rules.point_step, rules.angle_step, time, jointed=jointed)


def _process_checks(
    job: Job, candidate: Candidate, cut: ReadCut, made: Plan, digits: Array, *, ahead: bool
) -> list[Check]:
    """Compare speeds, switches and waits with those of the job.

    If the language cannot switch `ahead` of a target, it must switch at the target.
    """
    s, nodes, path = made.contour.s, candidate.nodes, candidate.path
    middle = (s[1:] + s[:-1]) / 2
    when = candidate.dt * np.arange(len(nodes))
    k = np.clip(np.searchsorted(path.s, middle, side="right") - 1, 0, len(path) - 1)
    wrong = (path.kind[k] != KINDS.index("micro joint")) != cut.laser
    excess = np.diff(np.interp(s, nodes.s, when)) / np.diff(made.time) - 1
    if job.options.feed == "constant":
        excess = np.abs(excess)
    fast = int(np.argmax(excess - digits))
    most = SAME_SPEED + digits[fast]
    node = int(np.argmax(wrong)) if wrong.any() else 0
    lead = np.abs(cut.lead_times - (job.program.lead_time if ahead else 0.0))
    wait = abs(float(cut.waits.sum()) - job.program.pierce_time)
    lengths = np.diff(s)[wrong].sum()
    return [
        check("speed", "difference of the speed from the job's", excess[fast], most, "share", fast),
        check("laser", "length with the laser wrongly on or off", lengths, 1e-6, "m", node),
        count("laser-off", "laser left on at the end", cut.left_on, len(s) - 1),
        check(
            "lead-time",
            "difference of the laser's lead time from the job's",
            lead.max(initial=0),
            SAME_TIME,
            "s",
        ),
        check("pierce", "difference of the wait at the start from the job's", wait, SAME_TIME, "s"),
    ]


def _postures(
    job: Job, cut: ReadCut, chosen: Language, settings: LanguageSettings, left: Array
) -> list[Check]:
    """Count the targets whose words for posture and turn do not fit the joints there.

    Digits leave joints uncertain by `left` (K, n) rad: that near to a change of a word, both words
    are right.
    """
    moves, q = (*cut.moves, cut.group.path[-1]), np.vstack([cut.q, cut.q_out])
    left = np.vstack([left, left[-1:]])
    worded = [k for k in (*cut.ends.tolist(), len(cut.moves)) if moves[k].posture]
    if not worded or chosen.posture is None:
        return []
    ways = [q[worded] + sign * left[worded] for sign in (0, -1, 1)]
    expected = zip(*(chosen.posture(job.robot, way, settings) for way in ways), strict=True)
    wrong = [
        k
        for k, words in zip(worded, expected, strict=True)
        if len(moves[k].posture) != len(words[0])
        or any(said not in right for said, *right in zip(moves[k].posture, *words, strict=True))
    ]
    said = "targets whose posture or turn differs from the motion"
    return [count("posture", said, len(wrong), wrong[0] if wrong else 0)]


# -----------------------------------------------------------------------------
# Check beam and gas of a program with a state machine over all its steps, in running order.
#
# Times follow from the text: a move along the path takes its length divided by its speed, or the
# stated time; a joint move takes the least time within the limits. A switch acts its lead time
# before the tip arrives. The source answers after the job's lead time, and then the beam is on,
# or off.

ENDLESS = 60.0
"""Assumed duration, s, of a move whose speed or limits are not known."""

What = Literal["air", "approach", "start", "cut", "end", "retract"]
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
    pierce_time : float s
    gas_lead : float s or None
        How long before the start the gas is to flow; None: the program does not switch it.
    stops : bool
        Whether the job asks for a stop at every node.
    """

    lead_time: float
    pierce_time: float
    gas_lead: float | None
    stops: bool

    @classmethod
    def of(cls, options: ProgramOptions, *, ahead: bool) -> BeamProcess:
        """Return the requirements of [program], in a language that can switch `ahead` or not."""
        gas = options.gas_lead
        return cls(
            lead_time=options.lead_time if ahead else 0.0,
            pierce_time=options.pierce_time,
            gas_lead=gas if gas is None or ahead else 0.0,
            stops=options.zone == 0,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Span:
    """What the robot does from one time (s) to another, and the step of the program."""

    what: What
    start: float
    end: float
    step: int
    waits: bool = False
    move: ReadMove | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Event:
    """A switch, the time (s) when it acts, and the step of the program."""

    time: float
    signal: Signal
    on: bool
    step: int


def check_laser_and_gas(read: ReadProgram, robot: Robot, process: BeamProcess) -> list[Check]:
    """Return the checks of beam and gas over a whole program; their node is its step.

    Parameters
    ----------
    read : ReadProgram
        The program, with the tip poses of its path.
    robot : Robot
    process : BeamProcess
    """
    spans, events = _timeline(read, robot)
    beam = _on(events, "laser", shift=process.lead_time)
    rows = [
        _row(f"beam-{what}", WORDS[what], _wrongly(spans, beam, what, process), SAME_TIME, "s")
        for what in WORDS
    ]
    said = "stop points in the cut with the laser on"
    stops = _row("beam-stop", said, _stops(spans, beam), 0, "count")
    rows.append(replace(stops, level="warning") if process.stops else stops)
    said = "changes of the file in the cut with the laser on"
    rows.append(_row("beam-file", said, _borders(spans, beam), 0, "count"))
    said = "switches of the laser that change nothing"
    rows.append(_row("beam-twice", said, _idle(events), 0, "count"))
    for signal in ("laser", "gas"):
        left = [event for event in events if event.signal == signal][-1:]
        found = [(float(event.on), event.step) for event in left]
        rows.append(_row(f"{signal}-at-the-end", f"{signal} on at the end", found, 0, "count"))
    return rows + _gas(spans, events, beam, process)


def _row(
    code: str, title: str, found: Sequence[tuple[float, int]], limit: float, unit: Unit
) -> Check:
    """Return a check of the largest of values with their steps; counts are summed."""
    value, step = max(found, default=(0.0, 0), key=lambda one: (one[0], -one[1]))
    if unit == "count":
        value = float(sum(one for one, _ in found))
    return check(code, title, value, limit, unit, step)


def _timeline(read: ReadProgram, robot: Robot) -> tuple[list[_Span], list[_Event]]:
    """Return what a program does and switches over time, from 0 on."""
    steps = {id(step): k for k, step in enumerate(read.steps)}
    spans: list[_Span] = []
    events: list[_Event] = []
    clock, q, T = 0.0, None, None
    for group in groups_of(read):
        waits: dict[int, list[ReadWait]] = {}
        for behind, wait in group.waits:
            waits.setdefault(behind, []).append(wait)
        moves = [*group.joint, *group.path]
        for k, move in enumerate(moves):
            at = k - len(group.joint) + 1  # how many moves of the path are done
            took = _took(move, robot, q, T)
            what = _what(at, len(group.path))
            spans.append(
                _Span(what=what, start=clock, end=clock + took, step=steps[id(move)], move=move)
            )
            clock += took
            for switch in move.switches:
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
                          waits=True)
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


def _on(
    events: Sequence[_Event], signal: Signal, *, shift: float
) -> list[tuple[float, float, int]]:
    """Return from when to when (s) a signal is on, and the step that switched it so."""
    found: list[tuple[float, float, int]] = []
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


def _overlap(start: float, end: float, on: Sequence[tuple[float, float, int]]) -> float:
    """Return for how long (s) of a span something is on."""
    return sum(max(min(end, off) - max(start, one), 0.0) for one, off, _ in on)


def _wrongly(
    spans: Sequence[_Span],
    beam: Sequence[tuple[float, float, int]],
    what: What,
    process: BeamProcess,
) -> list[tuple[float, int]]:
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
            on = max(pierced - process.pierce_time, 0.0)
        found.append((on, span.step))
    return found


def _stops(
    spans: Sequence[_Span], beam: Sequence[tuple[float, float, int]]
) -> list[tuple[float, int]]:
    """Return the inner targets of cuts where the robot stops and the beam stays on."""
    moves = [span for span in spans if span.move is not None]
    stops = [a for a, b in pairwise(moves) if a.what == b.what == "cut"]
    # A switch at the stop itself may act slightly before or after it.
    return [
        (1.0, span.step)
        for span in stops
        if span.move is not None and span.move.zone == 0 and _through(span.end, beam)
    ]


def _borders(
    spans: Sequence[_Span], beam: Sequence[tuple[float, float, int]]
) -> list[tuple[float, int]]:
    """Return where a cut continues in another file while the beam is on."""
    moves = [span for span in spans if span.move is not None]
    return [
        (1.0, b.step)
        for a, b in pairwise(moves)
        if b.what == "cut" or (b.what == "retract" and a.what == "cut")
        if a.move is not None and b.move is not None and a.move.file != b.move.file
        if _through(a.end, beam)
    ]


def _through(time: float, on: Sequence[tuple[float, float, int]]) -> bool:
    return any(one < time - SAME_TIME and time + SAME_TIME < off for one, off, _ in on)


def _idle(events: Sequence[_Event]) -> list[tuple[float, int]]:
    """Return the switches that change nothing: another is missing, or acts too early or late."""
    state = {"laser": False, "gas": False}
    found = []
    for event in events:
        if state[event.signal] == event.on:
            found.append((1.0, event.step))
        state[event.signal] = event.on
    return found


def _gas(
    spans: Sequence[_Span], events: Sequence[_Event], beam: Sequence[tuple[float, float, int]],
    process: BeamProcess,
) -> list[Check]:  # fmt: skip
    """Return the checks that the gas flows before and with the beam, and nowhere else."""
    gas = _on(events, "gas", shift=0.0)
    if process.gas_lead is None:
        found = [(1.0, event.step) for event in events if event.signal == "gas"]
        return [_row("gas", "gas switches that the job does not ask for", found, 0, "count")]
    spread = [(max(on, 0.0), off, step) for on, off, step in beam if off < np.inf]
    without = [(off - on - _overlap(on, off, gas), step) for on, off, step in spread]
    starts = [span for span in spans if span.what == "approach"]
    late = [
        (process.gas_lead - _overlap(span.end - process.gas_lead, span.end, gas), span.step)
        for span in starts
    ]
    # The gas may also start at the beginning of the approach.
    ahead = [(min(span.end - process.gas_lead, span.start), span.end, span.step) for span in starts]
    idle = [
        (_overlap(span.start, span.end, gas) - _overlap(span.start, span.end, _both(gas, ahead)),
         span.step)
        for span in spans
        if span.what in ("air", "approach", "retract")
    ]  # fmt: skip
    return [
        _row("gas", "laser on without gas", without, SAME_TIME, "s"),
        _row("gas-lead", "delay of the gas before the start", late, SAME_TIME, "s"),
        _row("gas-idle", "gas on where it is not asked for", idle, SAME_TIME, "s"),
    ]


def _both(
    one: Sequence[tuple[float, float, int]], two: Sequence[tuple[float, float, int]]
) -> list[tuple[float, float, int]]:
    """Return the times when both are on."""
    found = [(max(a, c), min(b, d), step) for a, b, step in one for c, d, _ in two]
    return [(start, end, step) for start, end, step in found if end > start]


# -----------------------------------------------------------------------------
# Audit a program on disk: compare the motion that its text means with the job.

NEAR = 5e-3
"""Median distance (m) from a contour of the job beyond which a cut is not of that contour."""
SAME_FRAME = 1e-6
"""Tolerance (m, sine) of tool and part against those of the job."""
FOLLOWED = ("postures",)
"""Codes of differences that follow from the path that was read, and are checked with it."""
WHAT = {
    "added": "moves",
    "removed": "moves",
    "targets": "targets beside the cut",
    "joints": "joint targets",
    "external": "external axes",
    "times": "times of moves",
    "zones": "corners and stops",
    "switches": "laser and gas",
    "kinds": "kinds of moves",
}
"""What differs, by the code of the difference."""


def audit_program(path: Path, job_file: Path) -> AuditReport:
    """Audit every cut of a program against its job.

    The joints of its targets follow from the robot's kinematics and are audited like those of a
    plan: against the drawing, the limits and the cell of the job. Frames, speeds, switches and
    waits are compared with those of the job.

    Parameters
    ----------
    path : Path
        The main file of the program.
    job_file : Path
        The job that the program was made for.

    Raises
    ------
    InputError
        A file cannot be read, a line was not written by kerfpath, or programs of such a job cannot
        be audited.
    """
    audit = ProgramAudit.of(job_file)
    chosen, settings = language_of(path, audit.job)
    read = program_on_disk(path, chosen, settings, audit.job.robot)
    return audit.audited(read, chosen, settings, path.name)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProgramAudit:
    """The audit of programs of one job, whose drawing and cell are read once.

    Parameters
    ----------
    job : Job
    contours : tuple of tuples of Candidate
        The ways to cut each contour; their nodes have its name.
    windows : tuple of tuples of GammaWindow
        The windows of gamma of each contour.
    cell : Cell or None
    inner_first : tuple of (int, int)
        Pairs of contours (from 0) of which the first is to be cut before the second.
    """

    job: Job
    contours: tuple[tuple[Candidate, ...], ...]
    windows: tuple[tuple[GammaWindow, ...], ...]
    cell: Cell | None
    inner_first: tuple[tuple[int, int], ...] = ()

    __repr__ = short_repr

    @classmethod
    def of(cls, job_file: Path) -> ProgramAudit:
        """Return the audit of a job's programs.

        Raises
        ------
        InputError
            A file cannot be read, or programs of such a job cannot be audited.
        """
        return cls.by(prepare(read_job(job_file)))

    @classmethod
    def by(cls, prepared: PreparedJob) -> ProgramAudit:
        """Return the audit of a prepared job's programs.

        Raises
        ------
        InputError
            The job has interruptions.
        """
        job = prepared.job
        if job.options.interruptions != "none":
            raise InputError(
                f"{job.path}: programs of jobs with interruptions cannot be compared with the "
                "drawing yet; audit the plan.json"
            )
        return cls(
            job=job,
            contours=tuple(contour.candidates for contour in prepared.contours),
            windows=tuple(contour.options.gamma_windows for contour in prepared.contours),
            cell=prepared.cell,
            inner_first=prepared.inner_first,
        )

    def audited(
        self, read: ReadProgram, chosen: Language, settings: LanguageSettings, name: str
    ) -> AuditReport:
        """Audit every cut of a program that was read."""
        job, contours, cell = self.job, self.contours, self.cell
        names = [candidates[0].nodes.name for candidates in contours]
        read = add_tips(read, job)
        cuts, home = read_cuts(read, job)
        tables: dict[str, list[Check]] = {}
        places: dict[str, tuple[str, ...]] = {name: tuple(step.place for step in read.steps)}
        tool = job.tool if read.T_flange_tip is None else read.T_flange_tip
        placed = job.placement if read.T_base_part is None else read.T_base_part
        off = max(np.abs(tool - job.tool).max(), np.abs(placed - job.placement).max())
        process = BeamProcess.of(job.program, ahead=chosen.ahead)
        tables[name] = [
            check("frames", "distance of tool and part from the job's", off, SAME_FRAME, "m"),
            *check_laser_and_gas(read, job.robot, process),
        ]
        done: list[int] = []
        starts: list[str] = []
        followed: list[tuple[ReadCut, TargetNodes, Plan]] = []
        for cut in cuts:
            apart, which, c = _closest(cut, contours)
            title = _new_title(f"{cut.name} ({names[which]})" if apart < NEAR else cut.name, tables)
            places[title] = tuple(move.place for move in cut.moves)
            if apart >= NEAR:
                said = "distance from the nearest contour of the job"
                tables[title] = [check("contour", said, apart, NEAR, "m")]
                continue
            candidate = contours[which][c]
            cut = divide_arcs(cut, candidate.dt, job)
            places[title] = tuple(move.place for move in (*cut.moves, cut.group.path[-1]))
            tables[title], along = check_cut(job, candidate, cut, cell, chosen, settings)
            tables[title].append(count("once", "earlier cuts of this contour", done.count(which)))
            done.append(which)
            starts.append(cut.moves[0].place)
            if along is not None:
                followed.append((cut, *along))
                pins, rules = self.windows[which], chosen.rules(settings)
                tables[title] += check_pins(job, cut, *along, pins, rules)
        steps = [places[name].index(start) for start in starts]
        tables[name] += [
            row if row.ok else replace(row, node=steps[row.node])
            for row in check_order(job.sequence, self.inner_first, done)
        ]
        tables[name] += _compared(job, followed, home, read, chosen, settings)
        tables[_new_title("air", tables)] = _air(
            job, cuts, home, cell if job.sequence is not None else None
        )
        missing = tuple(name for i, name in enumerate(names) if i not in done)
        note = collision_note(cell, moves_too=job.sequence is not None)
        return AuditReport(tables=tables, missing=missing, note=note, places=places)


def _new_title(title: str, tables: Mapping[str, object]) -> str:
    """Return a title that no table has yet, so that a repeated cut does not hide the first."""
    return title if title not in tables else _new_title(f"{title}, again", tables)


def _compared(
    job: Job, followed: Sequence[tuple[ReadCut, TargetNodes, Plan]], home: Array,
    read: ReadProgram, chosen: Language, settings: LanguageSettings,
) -> list[Check]:  # fmt: skip
    """Compare a program with the one that the job would have along the same paths.

    Each kind of difference is a check, with the number of moves and the place of the largest.
    """
    if not followed:
        return []
    try:
        expected = expect_program(job, followed, home, chosen, settings)
    except InputError as error:
        said = f"the program of the job cannot be made along these paths ({error})"
        return [count("asked", said, 1)]
    rules = chosen.rules(settings)
    expected = add_tips(expected, job)
    found = differences(expected, read, rules=(rules,), names=("the job", "the text"), strict=True)
    places = [step.place for step in read.steps]
    rows = [
        count(
            f"asked-{each.code}",
            f"different from the job, {WHAT.get(each.code, each.code)}: {each.message}"
            + (f" (from {each.said_at})" if each.said_at else ""),
            each.count,
            places.index(each.place) if each.place in places else 0,
        )
        for each in found
        if each.code not in FOLLOWED
    ]
    return rows or [count("asked", "differences from the job", 0)]


def _closest(cut: ReadCut, contours: Sequence[Sequence[Candidate]]) -> tuple[float, int, int]:
    """Return the distance (m) of a cut from the contour that it follows best, and the candidate.

    Points at the same share of the length are compared.
    """
    points = cut.T_part_tip[:, :3, 3]
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    some = np.unique(np.linspace(0, len(points) - 1, 100).round().astype(int))
    found = []
    for i, candidates in enumerate(contours):
        for c, path in enumerate(candidate.path for candidate in candidates):
            s = path.s[0] + way[some] / way[-1] * path.length
            apart = np.linalg.norm(path.at(s)[0] - points[some], axis=1)
            found.append((float(np.median(apart)), i, c))
    return min(found)


def _air(job: Job, cuts: Sequence[ReadCut], home: Array, cell: Cell | None) -> list[Check]:
    """Check the joint moves to, between and after the cuts; the node is the number of the move."""
    starts: list[Array | None] = [None, *(cut.q_out for cut in cuts)]
    corners = [cut.approach for cut in cuts] + [home]
    ways = (
        way if start is None else np.vstack([start[None], way])
        for start, way in zip(starts, corners, strict=True)
    )
    return worst_of(_way_checks(job, way[~np.isnan(way).any(axis=1)], cell) for way in ways)


def _way_checks(job: Job, q: Array, cell: Cell | None) -> list[Check]:
    """Check straight joint motions between corners (m, n) rad in the least time that they need."""
    if len(q) < 2:
        return []
    took = np.maximum(least_time(np.diff(q, axis=0), *job.robot.speed_limits()), 1e-9)
    time = np.append(0.0, np.cumsum(took))
    return [row for row in transfer_checks(job.robot, q, time, cell=cell) if row.code != "air-time"]
