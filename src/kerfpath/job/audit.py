"""Audit a plan.json or a program against its job."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any, cast

import numpy as np
from scipy.spatial import cKDTree

from kerfpath import __version__
from kerfpath.arrays import Array, Bools, lengths_along, short_repr
from kerfpath.auditor import (
    BOUND,
    MOST_ROUNDED,
    Check,
    Rounding,
    rounding_of,
    transfer_checks,
    worst_of,
)
from kerfpath.cell import Cell
from kerfpath.contour import KINDS, Contour, angle_between
from kerfpath.crew import Crew
from kerfpath.effort import thread_count
from kerfpath.errors import InputError
from kerfpath.execution import Correction, from_stop_to_stop, lengths_of, run_along
from kerfpath.job.as_run import as_programmed, checks_of_unknown, run_judged
from kerfpath.job.audit_report import (
    SAME_TIME,
    AuditReport,
    check,
    check_order,
    collision_note,
    count,
    count_at,
)
from kerfpath.job.comparison import compare, compare_jobs
from kerfpath.job.expected import (
    SAME_VALUE,
    Expected,
    ExpectedContour,
    ExpectedPlan,
    TargetNodes,
    check_pins,
    expect_plans,
    expect_program,
    expect_sequence,
    nodes_at_targets,
    recompute,
)
from kerfpath.job.format import (
    Candidate,
    Job,
    Tolerances,
    prepare,
    read_job,
)
from kerfpath.job.laser_and_gas import BeamProcess, check_laser_and_gas, check_power, without_power
from kerfpath.job.plan_file import (
    NodesData,
    PlanData,
    PlanFile,
    plan_document,
    plan_entry,
    read_plan_file,
)
from kerfpath.job.program_file import (
    ReadCut,
    add_tips,
    check_sheet,
    divide_arcs,
    in_language_of,
    program_on_disk,
    read_cuts,
    with_sheet,
)
from kerfpath.options import EXACT_OR_BETTER
from kerfpath.plans import Plan, Proof, TransferMove
from kerfpath.post import (
    CircularMove,
    Controller,
    LinearMove,
    ReadProgram,
    Rules,
    languages,
    unsafe_paths,
    unsafe_restarts,
)
from kerfpath.robots import Robot
from kerfpath.sequence import are_many
from kerfpath.tolerances import SAME_POINT
from kerfpath.transfer import End, back_off, least_times

# -----------------------------------------------------------------------------
# Check the order of cutting against the job.

SAME_REST = 0.01
"""s: the order counts these times in 1 us, one rounding for each candidate and move."""


def check_sequence(
    expected: Expected, done: Sequence[int], paths: Sequence[Contour], rests: Array | None
) -> list[Check]:
    """Return the checks of an order of cutting; their node is the number of the cut.

    Parameters
    ----------
    expected : Expected
    done : sequence of int
        Number of the contour of each cut in the job, in the order of cutting; pieces of one
        contour follow each other with the same number.
    paths : sequence of Contour
        The nodes of each cut.
    rests : (G, G) s or None
        Time from the end of each cut to the beginning of every later one; None if not known.
    """
    sequence = expected.job.sequence
    rows = check_order(sequence, expected.inner_first, done)
    rows.append(
        count_at("pieces", "pieces cut after a later piece of their contour", _early(done, paths))
    )
    if sequence is not None and sequence.heat_spacing_mm > 0:
        near = _near(expected, done, paths, sequence.heat_spacing_mm / 1000)
        if sequence.heat_time_s == 0:
            warm, what = np.flatnonzero(np.diagonal(near, 1)), "right"
        elif rests is None:
            return [*rows, count("heat-spacing", "times between near contours not known", 1)]
        else:
            soon = np.argwhere(np.triu(near & (rests < sequence.heat_time_s - SAME_REST), 1))
            warm, what = np.unique(soon[:, 1]) - 1, f"within {sequence.heat_time_s:g} s"
        title = f"contours cut {what} after one that is too near"
        rows.append(count_at("heat-spacing", title, (warm + 1).tolist()))
    return rows


def _early(done: Sequence[int], paths: Sequence[Contour]) -> list[int]:
    """Return the pieces that are cut after one that lies farther along the same contour."""
    return [
        k
        for k, (i, path) in enumerate(zip(done, paths, strict=True))
        if any(j == i and other.s[0] > path.s[0] for j, other in zip(done[:k], paths, strict=False))
    ]


def _near(
    expected: Expected, done: Sequence[int], paths: Sequence[Contour], spacing: float
) -> Bools:
    """Return which cuts (G, G) are nearer than `spacing` (m), by the first candidate of each."""
    whole = {i for i in done if list(done).count(i) == 1}
    first = {i: expected.contours[i].candidates[0].nodes for i in whole}
    shapes = [first.get(i, path) for i, path in zip(done, paths, strict=True)]
    near, trees = np.zeros((len(shapes),) * 2, np.bool_), [cKDTree(each.points) for each in shapes]
    for i, j in combinations(range(len(shapes)), 2):
        apart, _ = trees[i].query(shapes[j].points)
        near[i, j] = near[j, i] = np.asarray(apart).min() < spacing
    return near


def _rests(
    expected: Expected, plans: Sequence[Plan], moves: Sequence[TransferMove]
) -> Array | None:
    """Return the times (G, G) s between cuts by their moves, if they are asked for and known."""
    sequence = expected.job.sequence
    if sequence is None or not sequence.heat_time_s:
        return None
    homes = 2 if expected.job.home is not None else 0
    part = expect_sequence(expected, plans, moves, 0.0) if plans else None
    is_whole = len(moves) == len(plans) - 1 + homes
    return replace(part, moves=tuple(moves)).rests if part is not None and is_whole else None


# -----------------------------------------------------------------------------
# Audit the transfer moves of a plan.json against the job.

SAME_CORNER = 1e-6
"""Rounding tolerance, rad, between an end of a move and the end of the retract."""
FARTHEST = 1e3
"""Joint value, rad, that no joint ever has."""
SHARES = np.linspace(0.0, 1.0, 9)
"""Shares of the retract at which approach and retract are checked for collisions."""


def check_moves(
    expected: Expected, plans: Sequence[Plan], moves: Sequence[TransferMove]
) -> list[Check]:
    """Return the worst of each check over all moves; its node is the number of the move.

    Each must lead from the retract of one cut to the approach of the next, or home, within the
    limits, not faster than the robot can, and free of collisions, as must approach and retract.
    """
    sequence, robot = expected.job.sequence, expected.job.robot
    own = sum(m is not None for p in plans for m in (p.approach, p.retreat))
    if sequence is None:
        surplus = len(moves) + own
        return [count("moves", "moves that the job does not ask for", surplus)] if surplus else []
    homes = 2 if expected.job.home is not None else 0
    wanted = len(plans) - 1 + homes
    rows = [count("moves", "missing or surplus moves", abs(len(moves) - wanted) + own)]
    odd = [m for m in moves if m.q.shape[1] != robot.joints or len(m.q) < 2]
    far = [m for m in moves if not np.abs(m.q).max(initial=0.0) < FARTHEST]
    rows.append(count("corners", "moves without two corners of the robot's joints", len(odd)))
    rows.append(count("air-limits", "moves with corners beyond any joint's range", len(far)))
    if len(moves) != wanted or odd or far:
        return rows
    try:
        ways = [(_approach(expected, p, "start"), _approach(expected, p, "end")) for p in plans]
    except InputError as error:
        return [*rows, count("retract", f"ends of cuts without a possible retract: {error}", 1)]
    o, cell = expected.job.options, expected.cell
    tables = [
        transfer_checks(robot, m.q, m.time, cell=cell, eta_v=o.eta_v, eta_a=o.eta_a) for m in moves
    ]
    for table, move, ends in zip(tables, moves, _ends(expected, ways), strict=True):
        table += _fits(expected, move, ends)
    rows += worst_of(tables)
    if cell is not None:
        ups = [
            [c for c in transfer_checks(robot, way, np.arange(len(way)) * 1e3, cell=cell)
             if c.code.startswith("collision")]
            for pair in ways for way in pair
        ]  # fmt: skip
        rows += [_way_row(row) for row in worst_of(ups)]
    return rows


def _approach(expected: Expected, plan: Plan, end: End) -> Array:
    """Return joints (9, n) rad along the approach or the retract of a cut, from the cut on."""
    retract = expected.job.program.retract
    return np.array([back_off(plan, end, float(share) * retract) for share in SHARES])


def _ends(expected: Expected, ways: Sequence[tuple[Array, Array]]) -> list[tuple[Array, Array]]:
    """Return where each move begins and ends, (n,) rad each."""
    home = expected.job.home
    starts, ends = [way[0][-1] for way in ways], [way[1][-1] for way in ways]
    if home is not None:
        starts, ends = [*starts, home], [home, *ends]
        return list(zip(ends, starts, strict=True))
    return list(zip(ends[:-1], starts[1:], strict=True))


def _fits(expected: Expected, move: TransferMove, ends: tuple[Array, Array]) -> list[Check]:
    """Compare the ends of a move with those of the cuts and home, and its start time with zero.

    In the last move, endless joints may be at home on another turn.
    """
    first, last = np.abs(move.q[0] - ends[0]), np.abs(move.q[-1] - ends[1])
    home = expected.job.home
    if home is not None and np.array_equal(ends[1], home):
        whole = 2 * np.pi * np.round(last / (2 * np.pi))
        last = np.where(expected.job.robot.endless, np.abs(last - whole), last)
    off = max(float(first.max()), float(last.max()))
    begins = abs(float(move.time[0]))
    return [
        check(
            "air-ends", "distance of a move's ends from the cuts and home", off, SAME_CORNER, "rad"
        ),
        check("air-begins", "time at the start of a move", begins, 1e-9, "s"),
    ]


def _way_row(row: Check) -> Check:
    title = f"in approach and retract: {row.title}"
    return replace(row, code=f"approach-{row.code}", title=title, node=row.node // 2)


# -----------------------------------------------------------------------------
# Check the joint limits of a program as a controller runs its text, with rounded corners.

SOME_ZONE = 1.0
"""Zone, m, for a text that gives no length; any value except zero."""
SHORTEST = 1e-9
"""Least duration of a move, s."""


def check_run(job: Job, cut: ReadCut, made: Plan, path: Contour, digits: Rounding) -> list[Check]:
    """Return the checks of a cut's motion along a path, by its own zones and speeds.

    The checks allow for the digits of the text, which over short intervals add accelerations.
    """
    chosen, controller = job.program.robot_language, job.program.rules.controller
    if not chosen.zones:
        return [*checks_of_unknown(job, f"{chosen.name} has no zones")]
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
    velocity = job.robot.velocity_limits()
    acceleration = job.robot.acceleration_at(made.q[1:-1])
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
CLIMB = 0.05
"""Weight of distances along the path against those from it, in the search for a place on it."""


def _checked(
    job: Job, cell: Cell | None, cuts: Sequence[tuple[Candidate, ReadCut]]
) -> list[tuple[list[Check], tuple[TargetNodes, Plan] | None]]:
    """Return what `check_cut` finds for each cut; very many are shared with other processes.

    Not with a cell, which cannot be sent to them.
    """
    share = are_many(len(cuts)) and cell is None
    with Crew(thread_count() - 1 if share else 0, __name__) as crew:
        return crew.each(partial(_check_one, job, cell), cuts)


def _check_one(
    job: Job, cell: Cell | None, one: tuple[Candidate, ReadCut]
) -> tuple[list[Check], tuple[TargetNodes, Plan] | None]:
    return check_cut(job, *one, cell)


def check_cut(
    job: Job, candidate: Candidate, cut: ReadCut, cell: Cell | None
) -> tuple[list[Check], tuple[TargetNodes, Plan] | None]:
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
    found, moved = nodes_at_targets(job, candidate, cut, s), job.compensation is not None
    way = np.diff(s)
    if moved and (np.diff(found.at) > 0).all():
        s = s.copy()
        s[cut.ends] = found.nodes.s[found.at]
        way = np.diff(lengths_of(reference.at_nodes(s), cut.T_part_tip[:, :3, 3]))
    took = np.where(np.isnan(cut.speed), cut.took, way / cut.speed)
    made = _plan(job, candidate.nodes.name, cut, s, np.append(0.0, np.cumsum(took)))
    allowed, tilt = job.tolerances, job.options.tilt
    if tilt is not None:
        allowed = replace(allowed, axis=allowed.axis + tilt.cone)
    digits = _rounding(cut, made, job.program.rules)
    # Moved targets are judged by what they execute, and by their distance from the drawing.
    between = None if moved else reference
    rows += allowed.checks(made, reference=between, cell=cell, rounding=digits)
    rows += _process_checks(job, candidate, cut, made, digits.time)
    rows += _postures(job, cut, digits.q)
    rows += check_run(job, cut, made, reference, digits)
    rows += _at_targets(job, cut, found, allowed)
    alone = int(np.argmax(found.alone))
    said = "targets that skip a node of the job, or are not at a new one"
    rows.append(count("every-node", said, found.alone.sum(), int(cut.ends[alone])))
    return rows, (found, made) if found.complete else None


def _at_targets(job: Job, cut: ReadCut, found: TargetNodes, allowed: Tolerances) -> Iterator[Check]:
    """Yield the checks of the places of targets: at their nodes, or how far moved from them."""
    nodes, targets = found.nodes, cut.T_part_tip[cut.ends]
    points, most, of = nodes.points[found.at], allowed.path, "nodes of the job"
    if job.compensation is not None:
        turned = angle_between(nodes.axes[found.at], targets[:, :3, 2])
        k = int(np.argmax(turned))
        said = "angle of the tool axis at the targets to that of the nodes of the job"
        yield check("target-axis", said, turned[k], allowed.axis, "rad", int(cut.ends[k]))
        of += ", with the compensation of the job"
    if isinstance(job.compensation, Correction):
        points = points + job.compensation.displacement_at(nodes)[found.at]
    elif job.compensation is not None:
        most, of = job.most_moved, "nodes of the job, moved by compensation"
    off = np.linalg.norm(targets[:, :3, 3] - points, axis=1)
    k = int(np.argmax(off))
    yield check(
        "nodes", f"distance of the targets from the {of}", off[k], most, "m", int(cut.ends[k])
    )


def _along(cut: ReadCut, reference: Contour) -> tuple[Array, Array]:
    """Return arc lengths (K,) m of the nodes on the contour, and distances (2,) m of its ends.

    If the contour passes the same place twice, the share of the length decides.
    """
    points = cut.T_part_tip[:, :3, 3]
    way = lengths_along(points)
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
    settings = replace(job.options, tilt=None, closure="free")
    if job.compensation is not None:  # moved targets may use the limits in full
        settings = replace(settings, eta_v=1.0, eta_a=1.0)
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
        settings=settings,
        cost=0.0,
        proof=Proof(optimal=False, statement="read from a program"),
        counts={},
    )


def _rounding(cut: ReadCut, made: Plan, rules: Rules) -> Rounding:
    """Return the rounding of joints and times of a cut by the digits of a language.

    Where the text states speeds, a time is that of a stretch between two rounded points.
    """
    jointed = all(move.T_part_tip is None for move in cut.moves)
    length = np.linalg.norm(np.diff(cut.T_part_tip[:, :3, 3], axis=0), axis=1)
    moved = 0.0 if jointed else 2 * np.sqrt(3.0) * rules.point_step
    longer = moved / np.maximum(length, SAME_POINT)
    time = np.where(np.isnan(cut.speed), 0.0, rules.speed_step / 2 / cut.speed + longer)
    return rounding_of(made, rules.point_step, rules.angle_step, time, jointed=jointed)


def _process_checks(
    job: Job, candidate: Candidate, cut: ReadCut, made: Plan, digits: Array
) -> list[Check]:
    """Compare speeds, switches and waits with those of the job."""
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
    process = BeamProcess.of(job.program.of(candidate.nodes.name))
    expected = np.full(len(cut.lead_times), process.lead_time)
    expected[:1] = process.start_lead
    lead = np.abs(cut.lead_times - expected)
    wait = abs(float(cut.waits.sum()) - process.start_wait)
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


def _postures(job: Job, cut: ReadCut, left: Array) -> list[Check]:
    """Count the targets whose words for posture and turn do not fit the joints there.

    Digits leave joints uncertain by `left` (K, n) rad: that near to a change of a word, both words
    are right.
    """
    moves, q = (*cut.moves, cut.group.path[-1]), np.vstack([cut.q, cut.q_out])
    left = np.vstack([left, left[-1:]])
    worded = [k for k in (*cut.ends.tolist(), len(cut.moves)) if moves[k].posture]
    words_of, settings = job.program.robot_language.posture, job.program.language_settings
    if not worded or words_of is None:
        return []
    ways = [q[worded] + sign * left[worded] for sign in (0, -1, 1)]
    expected = zip(*(words_of(job.robot, way, settings) for way in ways), strict=True)
    wrong = [
        k
        for k, words in zip(worded, expected, strict=True)
        if len(moves[k].posture) != len(words[0])
        or any(said not in right for said, *right in zip(moves[k].posture, *words, strict=True))
    ]
    said = "targets whose posture or turn differs from the motion"
    return [count("posture", said, len(wrong), wrong[0] if wrong else 0)]


# -----------------------------------------------------------------------------
# Audit a plan.json against its job, or by itself if no job is given.

JOB, FILE = "those of the job and the joints", "those of the joints"
OWN_NODES = ("gamma_rad", "lead_lean_rad", "posture", "turn")
"""Columns of nodes that follow from the joints."""
AIR = "air"
"""Name of the table of the moves."""


def audit_file(file: Path, job_file: Path | None = None) -> AuditReport:
    """Audit every contour of a plan.json, or every cut of a program.

    With a job, only the job defines what is required and allowed; values that the file repeats, or
    that follow from its joints, must agree. The joints of a program follow from the robot's
    kinematics, and are audited like those of a plan. Without a job, limits, tool, placement and
    speed are those of the plan.json, and only values that follow from its joints are compared.

    Parameters
    ----------
    file : Path
        The plan.json, or the main file of the program.
    job_file : Path, optional
        The job that it was made for.

    Raises
    ------
    InputError
        A file cannot be read, a line of a program was not written by kerfpath, or programs of such
        a job cannot be audited.
    """
    if job_file is not None:
        return Audit.of(job_file).audited(file)
    return _by_itself(read_plan_file(file))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Audit:
    """The audit of plan.json files and programs of one job, whose drawing and cell are read once.

    Parameters
    ----------
    expected : Expected
    """

    expected: Expected

    __repr__ = short_repr

    @classmethod
    def of(cls, job_file: Path) -> Audit:
        """Return the audit of a job's files.

        Raises
        ------
        InputError
            The job, its drawing or its cell cannot be read.
        """
        return cls(expected=Expected.of(prepare(read_job(job_file))))

    def audited(self, file: Path) -> AuditReport:
        """Audit a plan.json, or the program whose main file this is.

        Raises
        ------
        InputError
            As `audit_file`.
        """
        if file.suffix.lower() == ".json":
            return self.plan_file(file)
        job = self.expected.job
        if job.options.interruptions != "none":
            raise InputError(
                f"{job.path}: programs of jobs with interruptions cannot be compared with the "
                "drawing yet; audit the plan.json"
            )
        job = in_language_of(file, job)
        audit = Audit(expected=replace(self.expected, job=job))
        report = audit.program(program_on_disk(file, job), file.name)
        rows, note = check_sheet(file, job.program.remarks)
        tables, places = dict(report.tables), dict(report.places)
        for row in rows:
            there = places[file.name]
            tables[file.name] = [*tables[file.name], replace(row, node=len(there))]
            places[file.name] = (*there, f"{with_sheet(file).name}, line {row.node}")
        note = f"{report.note} {note}".strip()
        return replace(report, tables=tables, places=places, note=note)

    def plan_file(self, path: Path) -> AuditReport:
        """Audit every contour of a plan.json."""
        expected, file = self.expected, read_plan_file(path)
        job, cell, entries = expected.job, expected.cell, file.entries
        planned, rows = expect_plans(expected, file)
        tables: dict[str, list[Check]] = {file.path.name: rows}
        judged: list[PlanData] = []
        for each in planned:
            table = tables.setdefault(each.name, [])
            table += each.checks
            if each.plan is None:
                continue
            made = job.tolerances.checks(each.plan, reference=each.path, cell=cell)
            made += each.drawing
            drawn = each.path or each.plan.contour
            table += as_programmed(job, each.plan, drawn, cell).checks
            entry = _entry(each.plan, entries[each.name], made, file)
            judged.append(entry)
            table += made
            table += _claims(each.plan)
            table += compare(entry, entries[each.name], of=JOB)
        rows += compare_jobs(job, file.job)
        paths = [p.contour for p in file.plans]
        plans = [each.plan for each in planned if each.plan is not None]
        rests = _rests(expected, plans, file.moves) if len(plans) == len(planned) else None
        rows += check_sequence(expected, [each.number for each in planned], paths, rests)
        rows += self._whole(file, judged, planned)
        if len(plans) == len(planned) and plans:
            tables.setdefault(AIR, []).extend(check_moves(expected, plans, file.moves))
        note = collision_note(cell, moves_too=job.sequence is not None)
        return AuditReport(
            tables={name: table for name, table in tables.items() if table},
            missing=file.missing,
            note=f"{note} {_list_claims(file, tables)}".strip(),
        )

    def program(self, read: ReadProgram, name: str) -> AuditReport:
        """Audit every cut of a program that was read, in the language of the job."""
        job, contours, cell = self.expected.job, self.expected.contours, self.expected.cell
        names = self.expected.names
        read = add_tips(read, job)
        cuts, home = read_cuts(read, job)
        closest = [_closest(cut, contours) for cut in cuts]
        options = [job.program.of(name) for name in names]
        tables: dict[str, list[Check]] = {}
        places: dict[str, tuple[str, ...]] = {name: tuple(step.place for step in read.steps)}
        tool = job.tool if read.T_flange_tip is None else read.T_flange_tip
        placed = job.placement if read.T_base_part is None else read.T_base_part
        off = max(np.abs(tool - job.tool).max(), np.abs(placed - job.placement).max())
        tables[name] = [
            check("frames", "distance of tool and part from the job's", off, SAME_FRAME, "m"),
            *check_laser_and_gas(
                read, job.robot, [BeamProcess.of(options[which]) for _, which, _ in closest]
            ),
            _check_paths(read),
        ]
        done: list[int] = []
        starts: list[str] = []
        followed: list[tuple[ReadCut, TargetNodes, Plan]] = []
        # Arcs are divided at nodes of their contour.
        near = [
            (contours[which].candidates[c], divide_arcs(cut, contours[which].candidates[c].dt, job))
            for cut, (apart, which, c) in zip(cuts, closest, strict=True)
            if apart < NEAR
        ]
        checked = zip(near, _checked(job, cell, near), strict=True)
        for cut, (apart, which, _) in zip(cuts, closest, strict=True):
            title = _new_title(f"{cut.name} ({names[which]})" if apart < NEAR else cut.name, tables)
            places[title] = tuple(move.place for move in cut.moves)
            if apart >= NEAR:
                said = "distance from the nearest contour of the job"
                tables[title] = [check("contour", said, apart, NEAR, "m")]
                continue
            (_, cut), (tables[title], along) = next(checked)
            places[title] = tuple(move.place for move in (*cut.moves, cut.group.path[-1]))
            if not np.isnan(cut.q).any():
                moves = _moves(cut, job.program.rules.controller)
                tables[title] += check_power(job, options[which], cut.group, moves, cut.ends)
            tables[title].append(count("once", "earlier cuts of this contour", done.count(which)))
            done.append(which)
            starts.append(cut.moves[0].place)
            if along is not None:
                followed.append((cut, *along))
                windows = contours[which].options.gamma_windows
                tables[title] += check_pins(job, cut, *along, windows)
        steps = [places[name].index(start) for start in starts]
        tables[name] += [
            row if row.ok else replace(row, node=steps[row.node])
            for row in check_order(job.sequence, self.expected.inner_first, done)
        ]
        if followed:
            tables[name] += _as_expected(job, followed, home, read)
        tables[_new_title("air", tables)] = _air(
            job, cuts, home, cell if job.sequence is not None else None
        )
        missing = tuple(name for i, name in enumerate(names) if i not in done)
        notes = collision_note(cell, moves_too=job.sequence is not None), *_notes(read)
        note = " ".join(filter(None, notes))
        return AuditReport(tables=tables, missing=missing, note=note, places=places)

    def _whole(
        self, file: PlanFile, judged: Sequence[PlanData], planned: Sequence[ExpectedPlan]
    ) -> list[Check]:
        """Compare the parts of the file beside its contours: robot, limits, cell, sequence."""
        expected, job, data = self.expected, self.expected.job, file.data
        plans = [each.plan for each in planned if each.plan is not None]
        part = None
        if job.sequence is not None and data["sequence"] is not None and plans:
            part = expect_sequence(expected, plans, file.moves, data["sequence"]["at_least_s"])
        own: Mapping[str, object] = data
        whole: Mapping[str, object] = plan_document(
            job.robot, job.tool, job.placement, judged, {}, expected.cell, part
        )
        rows = []
        for key in whole:  # in the order of the file, so that a report is always the same
            if key in ("job", "contours", "kerfpath", "schema"):
                continue  # compared elsewhere, or not at all
            if key == "sequence" and len(plans) < len(planned):
                continue  # a contour is refused already, and its times are not known
            asked, said = whole[key], own[key]
            if key == "limits":
                for name in (job.program.language, file.program("job").language):
                    asked, said = (_expressible(each, job.robot, name) for each in (asked, said))
            found = compare(asked, said, of=JOB, under=(key,))
            rows += [row for row in found if not row.ok]
        if job.sequence is not None and data["sequence"] is None:
            rows.append(count("moves", "missing moves between contours", 1))
        return rows or compare({}, {}, of=JOB)


def _expressible(limits: Any, robot: Robot, name: str) -> Any:
    """Return the data of limits as a language bounds them, which a job plans within.

    A plan that was made for another language may have wider or narrower ones; its joints are
    checked with those of the job.
    """
    if (language := languages().get(name)) is None:
        return limits
    lower, upper = language.expressible(robot, limits["lower_rad"], limits["upper_rad"])
    return dict(limits) | {"lower_rad": lower.tolist(), "upper_rad": upper.tolist()}


def _entry(plan: Plan, said: PlanData, made: Sequence[Check], file: PlanFile) -> PlanData:
    """Return the plan.json entry that a contour should have, with the record of its audit.

    The record of another version of kerfpath is not compared.
    """
    name = said["contour"]
    picked, shown = plan.name in file.picked, "certificate" in said
    entry = plan_entry(plan, name, made, picked=picked, certificate=shown)
    if file.data["kerfpath"] != __version__:
        entry["audit"]["checks"] = said["audit"]["checks"]
    return entry


def _claims(plan: Plan) -> list[Check]:
    """Check the claims about other motions, as far as they can be checked."""
    before, rows = plan.proof.grid_cost, []
    if before is not None:
        title = "cost above that of the path it was refined from"
        rows.append(
            check("grid-cost", title, plan.cost - before * (1 + SAME_VALUE), SAME_VALUE, "count")
        )
    if plan.settings.method not in EXACT_OR_BETTER:
        title = "claims of optimality that its method cannot prove"
        rows.append(count("optimal", title, plan.proof.optimal))
    return rows


def _list_claims(file: PlanFile, tables: Mapping[str, Sequence[Check]]) -> str:
    """Return the note on the bounds that are proved again, and on claims that are not verified."""
    proved = [
        name for name, table in tables.items() if any(c.code == BOUND and c.ok for c in table)
    ]
    said = [f"Proved again: the bound of {', '.join(proved)}."] if proved else []
    best = [p.name for p in file.plans if p.proof.optimal]
    claims = [f"that {', '.join(best)} is best of its grid"] if best else []
    bounded = [
        p.name for p in file.plans if p.proof.bound is not None and p.proof.certificate is None
    ]
    claims += [f"the bound of {', '.join(bounded)}"] if bounded else []
    if file.data["sequence"] is not None and file.data["sequence"]["optimal"]:
        claims.append("that no order takes less")
    if claims:
        said.append(f"Claimed, not verified: {' and '.join(claims)}.")
    if any(p.name in bounded and p.settings.objective == "sum" for p in file.plans):
        said.append("With certificate = true in [plan], plan.json keeps the proof of a bound.")
    return " ".join(said)


def _by_itself(file: PlanFile) -> AuditReport:
    """Audit a plan.json without its job."""
    tables, tolerances = {}, file.tolerances
    for p in file.plans:
        own, said = recompute(p), file.entries[p.name]
        made = tolerances.checks(own)
        entry = _entry(own, said, made, file)
        follow = {key: value for key, value in entry["nodes"].items() if key in OWN_NODES}
        entry["audit"], entry["nodes"] = said["audit"], cast(NodesData, said["nodes"] | follow)
        tables[p.name] = [*made, *_claims(own), *compare(entry, said, of=FILE)]
    if not file.plans and not file.missing:
        tables[file.path.name] = [count("contours", "missing plans: the file has none", 1)]
    if file.moves and file.plans:
        robot = file.plans[0].robot
        tables[AIR] = worst_of(transfer_checks(robot, m.q, m.time) for m in file.moves)
    note = (
        "Limits, tool, placement and speed were taken from the plan itself; give its job with "
        "--job to audit against the job."
    )
    collisions = (
        "The plan was made free of collisions in a cell, which was not checked again: give its "
        "job with --job."
        if file.in_cell
        else collision_note(None)
    )
    note = f"{note} {collisions} {_list_claims(file, tables)}".strip()
    return AuditReport(tables=tables, missing=file.missing, note=note)


# -----------------------------------------------------------------------------
# Audit a program on disk: compare the motion that its text means with the job.

NEAR = 5e-3
"""Median distance (m) from a contour of the job beyond which a cut is not of that contour."""
SAME_FRAME = 1e-6
"""Tolerance (m, sine) of tool and part against those of the job."""


def _check_paths(read: ReadProgram) -> Check:
    """Return the check of all paths through a program, also without answers and after pauses."""
    found = unsafe_paths(read)
    row = count("paths", "steps that are not safe on some path, after a missing answer", len(found))
    return replace(row, advice=str(found[0])) if found else row


def _notes(read: ReadProgram) -> Iterator[str]:
    """Yield where a program must not be begun or continued after everything went off, and marks."""
    if found := unsafe_restarts(read):
        more = f" (and {len(found) - 1} more such stretches)" if len(found) > 1 else ""
        yield f"After a stop begin a contour at its first line: {found[0]}{more}."
    if read.marked:
        yield (
            f"{', '.join(read.marked)}: a byte order mark is at the beginning, which the "
            "controller may not read; save as UTF-8 without it."
        )


def _new_title(title: str, tables: Mapping[str, object]) -> str:
    """Return a title that no table has yet, so that a repeated cut does not hide the first."""
    return title if title not in tables else _new_title(f"{title}, again", tables)


def _as_expected(
    job: Job, followed: Sequence[tuple[ReadCut, TargetNodes, Plan]], home: Array, read: ReadProgram
) -> list[Check]:
    """Compare a program with the one that the job would have along the same paths."""
    try:
        expected = add_tips(expect_program(job, followed, home), job)
    except InputError as error:
        said = f"the program of the job cannot be made along these paths ({error})"
        return [count("asked", said, 1)]
    return compare(expected, without_power(read), of="the job", rules=(job.program.rules,))


def _closest(cut: ReadCut, contours: Sequence[ExpectedContour]) -> tuple[float, int, int]:
    """Return the distance (m) of a cut from the contour that it follows best, and the candidate.

    Points at the same share of the length are compared.
    """
    points = cut.T_part_tip[:, :3, 3]
    way = lengths_along(points)
    some = np.unique(np.linspace(0, len(points) - 1, 100).round().astype(int))
    found = []
    for i, contour in enumerate(contours):
        for c, path in enumerate(candidate.path for candidate in contour.candidates):
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
    rows = transfer_checks(job.robot, q, least_times(job.robot, q), cell=cell)
    return [row for row in rows if row.code != "air-time"]
