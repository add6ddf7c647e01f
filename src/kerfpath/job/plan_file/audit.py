"""Audit a plan.json against its job, or by itself if no job is given."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.spatial import cKDTree

from kerfpath import __version__
from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.auditor import BOUND, Check, chain_of, retract_checks, transfer_checks, worst_of
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.job.as_run import as_run
from kerfpath.job.audit_report import (
    AuditReport,
    check,
    check_order,
    collision_note,
    count,
    count_at,
)
from kerfpath.job.format import (
    AuditTable,
    Candidate,
    Job,
    JobFile,
    PreparedJob,
    divide_nodes,
    prepare,
    read_job,
    tolerances_of,
)
from kerfpath.job.plan_file.layout import NodesData, PlanData
from kerfpath.job.plan_file.reading import PlanFile, read_plan_file, table_of
from kerfpath.job.plan_file.writing import plan_document, plan_entry
from kerfpath.options import EXACT_OR_BETTER, PlanOptions
from kerfpath.plans import Plan, path_cost
from kerfpath.retime import feed, retime
from kerfpath.robots import Robot
from kerfpath.sequence import Order, PartPlan
from kerfpath.tolerances import SAME_PLACE
from kerfpath.transfer import End, TransferMove, back_off, least_time

# -----------------------------------------------------------------------------
# Compute what follows from the joints of a plan: gamma, tilt, posture, turns, and cost.

SAME_VALUE = 1e-7
"""Tolerance, relative or absolute below 1 (m, rad, s); two machines agree far better."""
SAME_POSTURE = 1e-5
"""Error of an inverse near a singularity, rad; postures are much farther apart."""
NO_TILT = 1e-9
"""Tilt, rad, below which it is attributed to rounding."""


def recompute(plan: Plan) -> Plan:
    """Return the plan with everything that its joints, contour and settings decide.

    Values of the plan that agree are kept to the last digit: an angle near pi may be written as one
    near -pi, and at a singularity several postures fit the joints.
    """
    tilt, gamma = _rotation(plan)
    made = replace(
        plan,
        tilt=tilt,
        gamma=gamma,
        posture=_posture(plan.robot, plan.q, plan.posture),
        turn=_turn(plan.robot, plan.q, plan.turn),
    )
    return replace(made, cost=_cost(made))


def _rotation(plan: Plan) -> tuple[Array, Array]:
    """Return lead and lean (K, 2) and gamma (K,) of the joints, by the audit's kinematics."""
    tip = chain_of(plan.robot).forward(plan.q) @ plan.T_flange_tip
    tilt = np.zeros((len(plan.q), 2))
    if plan.settings.tilt is not None:
        along = plan.contour.along @ plan.T_base_part[:3, :3].T
        nominal = plan.contour.axes @ plan.T_base_part[:3, :3].T
        cross = np.cross(nominal, tip[:, :3, 2])
        sine = np.linalg.norm(cross, axis=1)
        angle = np.arctan2(sine, (nominal * tip[:, :3, 2]).sum(axis=1))
        turn = cross * (angle / np.maximum(sine, 1e-300))[:, None]
        tilt[:, 0] = (turn * np.cross(nominal, along)).sum(axis=1)
        tilt[:, 1] = (turn * along).sum(axis=1)
        tilt[np.abs(tilt) < NO_TILT] = 0.0
    if not plan.robot.family.free_rotation:
        return tilt, np.zeros(len(plan.q))
    frames = replace(plan, tilt=tilt).frames
    x = tip[:, :3, 0]
    gamma = np.arctan2((x * frames[:, :3, 1]).sum(axis=1), (x * frames[:, :3, 0]).sum(axis=1))
    off = np.remainder(plan.gamma - gamma + np.pi, 2 * np.pi) - np.pi
    agrees = (np.abs(off) <= SAME_VALUE) & (np.abs(plan.gamma) <= np.pi + SAME_VALUE)
    return tilt, np.where(agrees, plan.gamma, gamma)


def _posture(robot: Robot, q: Array, said: Ints) -> Ints:
    """Return the postures (K,) of joints q (K, n); those `said` where they fit, too.

    At a singularity, where no posture gives the joints back, any may be right.
    """
    arm = robot.alone()
    q = np.ascontiguousarray(q[:, : arm.joints])
    solved, reach = arm.inverse_all(np.ascontiguousarray(arm.forward(q)), arm.given_of(q))
    off = np.abs(np.remainder(solved - q[:, None] + np.pi, 2 * np.pi) - np.pi)
    fits = reach & (np.where(reach[..., None], off, np.inf).max(axis=2) < SAME_POSTURE)
    row = np.arange(len(q))
    known = (said >= 0) & (said < arm.postures)
    kept = known & (fits[row, np.where(known, said, 0)] | ~fits.any(axis=1))
    return np.where(kept, said, np.argmax(fits, axis=1))


def _turn(robot: Robot, q: Array, said: Ints) -> Ints:
    """Return the turns (K, n) from (-pi, pi] to joints q (K, n); free joints have none."""
    turn = np.ceil((q - np.pi) / (2 * np.pi)).astype(np.int64)
    kept = np.abs(q - 2 * np.pi * said) <= np.pi + SAME_VALUE
    turn = np.where(kept, said, turn)
    turn[:, robot.free] = 0
    return turn


def _cost(plan: Plan) -> float:
    """Return the objective of a plan; the penalty of clearance is the plan's, within its bounds."""
    s = plan.settings
    cost = path_cost(plan.increments, s.weights, s.metric, s.objective, plan.node_cost)
    band = None if s.comfort is None else s.comfort.clearance
    if band is not None and band.cost:
        most = band.cost * (len(plan.q) if s.objective == "sum" else 1)
        if cost * (1 - SAME_VALUE) <= plan.cost <= cost + most:
            return plan.cost
    return cost


# -----------------------------------------------------------------------------
# The plans that a plan.json should have: its joints, with all else from the job.

RETIMED = 1e-3
"""Share of an interval by which times of a reduced feed may differ: they are a local optimum."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExpectedPlan:
    """The plan that is expected for one contour, or piece, of a plan.json.

    Parameters
    ----------
    name : str
        Name of the plan in the file.
    number : int
        Number of its contour in the job, from 0; -1 for none.
    plan : Plan or None
        The joints of the file with all else from the job; None if the two do not fit.
    path : Contour or None
        The path that its nodes were sampled from.
    checks : tuple of Check
        Whether contour, nodes and joints fit the job.
    drawing : tuple of Check
        Checks of rounded corners against the drawing; the file has a record of them.
    """

    name: str
    number: int
    plan: Plan | None = None
    path: Contour | None = None
    checks: tuple[Check, ...] = ()
    drawing: tuple[Check, ...] = ()


def expect_plans(prepared: PreparedJob, file: PlanFile) -> tuple[list[ExpectedPlan], list[Check]]:
    """Return the expected plan for each plan of a file, and the checks of its contours."""
    names = prepared.names
    members = [[p for p in file.plans if file.contours[p.name] == name] for name in names]
    found: dict[str, ExpectedPlan] = {}
    for number, plans in enumerate(members):
        for each in _of_contour(prepared, number, plans, file.picked):
            found[each.name] = each
    foreign = [p.name for p in file.plans if p.name not in found]
    for name in foreign:
        row = count("contour", "contours that the job does not ask for", 1)
        found[name] = ExpectedPlan(name=name, number=-1, checks=(row,))
    missing = [
        name
        for name, plans in zip(names, members, strict=True)
        if not plans and name not in file.missing
    ]
    which = f": {', '.join(missing)}" if missing else ""
    rows = [
        count("contours", f"contours of the job that the plan lacks{which}", len(missing)),
        count("contour", "contours that the job does not ask for", len(foreign)),
    ]
    return [found[p.name] for p in file.plans], rows


def _of_contour(
    prepared: PreparedJob, number: int, plans: Sequence[Plan], picked: frozenset[str]
) -> list[ExpectedPlan]:
    """Return the expected plans of one contour: a single one, or its pieces."""
    if not plans:
        return []
    name, job = prepared.names[number], prepared.job
    if len(plans) == 1 and plans[0].name == name:
        (made,) = plans
        candidate = _nearest(prepared.contours[number].candidates, made, job.options.refine_parts)
        if candidate is None:
            counts = sorted({len(c.nodes) for c in prepared.contours[number].candidates})
            row = _node_count(made, " or ".join(map(str, counts)))
            return [ExpectedPlan(name=name, number=number, checks=(row,))]
        own, parts = _divided(candidate, made, job.options.refine_parts)
        shown = made.name in picked
        return [_expected(prepared, number, made, own, candidate.dt, parts, picked=shown)]
    words = [f"{name}, piece {k + 1} of {len(plans)}" for k in range(len(plans))]
    by_name = {p.name: p for p in plans}
    if len(plans) == 1 or job.options.interruptions == "none" or set(by_name) != set(words):
        row = count("once", "plans of a contour that is cut once", len(plans))
        return [ExpectedPlan(name=p.name, number=number, checks=(row,)) for p in plans]
    return _pieces(prepared, number, [by_name[word] for word in words])


def _pieces(prepared: PreparedJob, number: int, plans: Sequence[Plan]) -> list[ExpectedPlan]:
    """Return the expected plans of the pieces of a contour, in the order along it."""
    job = prepared.job

    def off(candidate: Candidate) -> float:
        ends = [candidate.path.at(p.contour.s[[0, -1]])[0] for p in plans]
        return max(
            float(np.linalg.norm(p.contour.points[[0, -1]] - end, axis=1).max())
            for p, end in zip(plans, ends, strict=True)
        )

    candidate = min(prepared.contours[number].candidates, key=off)
    whole, found, at = candidate.nodes, [], 0
    for p in plans:
        last = int(np.argmin(np.abs(whole.s - p.contour.s[-1])))
        last = len(whole) - 1 if p is plans[-1] else min(max(last, at + 1), len(whole) - 1)
        if at >= last:
            row = count("pieces", "pieces that do not begin where the piece before them ends", 1)
            found.append(ExpectedPlan(name=p.name, number=number, checks=(row,)))
            continue
        part = replace(whole.part(at, last, job.options.frames), name=p.name)
        path = candidate.path.between(float(whole.s[at]), float(whole.s[last]))
        own, parts = _divided(Candidate(path=path, nodes=part), p, job.options.refine_parts)
        found.append(_expected(prepared, number, p, own, candidate.dt, parts, picked=False))
        at = last
    return found


def _nearest(candidates: Sequence[Candidate], made: Plan, parts: int) -> Candidate | None:
    """Return the candidate with as many nodes as a plan, or so divided, that is nearest to it."""
    K = len(made.contour)

    def off(candidate: Candidate) -> float:
        every = (K - 1) // (len(candidate.nodes) - 1)
        return float(np.abs(made.contour.points[::every] - candidate.nodes.points).max())

    fitting = [c for c in candidates if K in (len(c.nodes), (len(c.nodes) - 1) * parts + 1)]
    return min(fitting, key=off, default=None)


def _divided(candidate: Candidate, made: Plan, parts: int) -> tuple[Candidate, int]:
    """Return the candidate with its intervals divided as those of the plan, and into how many."""
    if parts == 1 or len(made.contour) != (len(candidate.nodes) - 1) * parts + 1:
        return candidate, 1
    return replace(candidate, nodes=divide_nodes(candidate.path, candidate.nodes, parts)), parts


def _expected(
    prepared: PreparedJob, number: int, made: Plan, own: Candidate, dt: float, parts: int,
    *, picked: bool,
) -> ExpectedPlan:  # fmt: skip
    """Return the plan that has the joints of a plan and all else of the job.

    Its nodes are those of its `own` candidate, which may be a piece, or divide each interval of
    `dt` (s) into `parts`.
    """
    job, nodes = prepared.job, own.nodes
    if len(nodes) != len(made.contour):
        row = _node_count(made, str(len(nodes)))
        return ExpectedPlan(name=made.name, number=number, checks=(row,))
    if made.q.shape[1] != job.robot.joints:
        row = count("joints", f"joints, where the robot has {job.robot.joints}", made.q.shape[1])
        return ExpectedPlan(name=made.name, number=number, checks=(row,))
    far = np.linalg.norm(made.contour.points - nodes.points, axis=1)
    worst = int(np.argmax(far))
    title = "distance of the nodes from those of the job"
    place = check("place", title, far[worst], SAME_PLACE, "m", worst)
    plan = replace(
        made,
        contour=replace(nodes, time=None),
        robot=job.robot,
        T_flange_tip=job.tool,
        T_base_part=job.placement,
        time=dt / parts * np.arange(len(nodes), dtype=float),
        settings=_options(prepared, number, dt, made.settings, picked=picked),
        feed=None,
    )
    if job.options.feed == "dip" and made.feed is not None and not picked:
        plan = _dipping(plan, dt, made.time)
    plan = recompute(plan)
    requested = job.options.retract
    room = retract_checks(plan, None if requested == made.settings.retract else requested)
    rows = (place, *_postures(job, plan), *room)
    drawing = prepared.contours[number].drawing_checks(own, plan.contour, job.tolerances.path)
    return ExpectedPlan(
        name=made.name, number=number, plan=plan, path=own.path, checks=rows, drawing=(*drawing,)
    )


def _options(
    prepared: PreparedJob, number: int, dt: float, said: PlanOptions, *, picked: bool
) -> PlanOptions:
    """Return the plan options of the job; a picked plan may have lower shares of the limits."""
    job, task = prepared.job, prepared.contours[number].task
    # [program] may have been edited since: the current retract is checked separately.
    options = replace(task.asked(job.options).resolve(job.robot, dt), retract=said.retract)
    if not picked:
        return options
    return replace(
        options,
        objective=said.objective,
        metric=said.metric,
        weights=said.weights,
        eta_v=min(options.eta_v, said.eta_v),
        eta_a=min(options.eta_a, said.eta_a),
        method="continuous" if said.method == "continuous" else "exact",
        feed="constant",
        refine=said.refine,
    )


def _dipping(plan: Plan, dt: float, said: Array) -> Plan:
    """Return the plan in the least time within its limits; with the given times if they agree."""
    limits = plan.settings.limits(plan.robot)
    tau = retime(plan.increments, dt, limits)
    time, found = np.concatenate([[0.0], np.cumsum(tau)]), np.diff(said)
    if said[0] == 0 and (np.abs(found - tau) <= RETIMED * tau).all():
        time, tau = said, found
    dips = feed(tau, dt, plan.increments, limits, np.diff(plan.contour.s))
    return replace(plan, time=time, feed=dips)


def _postures(job: Job, made: Plan) -> list[Check]:
    allowed = job.options.postures
    if allowed is None:
        return []
    other = np.flatnonzero(~np.isin(made.posture, list(allowed)))
    node = int(other[0]) if other.size else 0
    return [count("posture", "nodes in a posture that the job does not allow", len(other), node)]


def _node_count(made: Plan, expected: str) -> Check:
    said = f"wrong number of nodes: expected {expected}, found {len(made.contour)}"
    return count("nodes", said, 1)


# -----------------------------------------------------------------------------
# Check the order of cutting against the job.


def check_sequence(
    prepared: PreparedJob, done: Sequence[int], paths: Sequence[Contour]
) -> list[Check]:
    """Return the checks of an order of cutting; their node is the number of the cut.

    Parameters
    ----------
    prepared : PreparedJob
    done : sequence of int
        Number of the contour of each cut in the job, in the order of cutting; pieces of one
        contour follow each other with the same number.
    paths : sequence of Contour
        The nodes of each cut.
    """
    sequence = prepared.job.sequence
    rows = check_order(sequence, prepared.inner_first, done)
    rows.append(
        count_at("pieces", "pieces cut after a later piece of their contour", _early(done, paths))
    )
    if sequence is not None and sequence.heat_spacing_mm > 0:
        warm = _too_warm(prepared, done, paths, sequence.heat_spacing_mm / 1000)
        rows.append(count_at("heat-spacing", "contours cut right after one that is too near", warm))
    return rows


def _early(done: Sequence[int], paths: Sequence[Contour]) -> list[int]:
    """Return the pieces that are cut after one that lies farther along the same contour."""
    return [
        k
        for k, (i, path) in enumerate(zip(done, paths, strict=True))
        if any(j == i and other.s[0] > path.s[0] for j, other in zip(done[:k], paths, strict=False))
    ]


def _too_warm(
    prepared: PreparedJob, done: Sequence[int], paths: Sequence[Contour], spacing: float
) -> list[int]:
    """Return the cuts that follow one nearer than `spacing` (m), by the first candidate of each."""
    whole = {i for i in done if list(done).count(i) == 1}
    first = {i: prepared.contours[i].candidates[0].nodes for i in whole}
    shapes = [first.get(i, path) for i, path in zip(done, paths, strict=True)]
    found = []
    for k, (one, two) in enumerate(pairwise(shapes)):
        apart, _ = cKDTree(one.points).query(two.points)
        if np.asarray(apart).min() < spacing:
            found.append(k + 1)
    return found


# -----------------------------------------------------------------------------
# Audit the transfer moves of a plan.json against the job.

SAME_CORNER = 1e-6
"""Rounding tolerance, rad, between an end of a move and the end of the retract."""
FARTHEST = 1e3
"""Joint value, rad, that no joint ever has."""
SHARES = np.linspace(0.0, 1.0, 9)
"""Shares of the retract at which approach and retract are checked for collisions."""


def check_moves(
    prepared: PreparedJob, plans: Sequence[Plan], moves: Sequence[TransferMove]
) -> list[Check]:
    """Return the worst of each check over all moves; its node is the number of the move.

    Each must lead from the retract of one cut to the approach of the next, or home, within the
    limits, not faster than the robot can, and free of collisions, as must approach and retract.
    """
    sequence, robot = prepared.job.sequence, prepared.job.robot
    if sequence is None:
        return [count("moves", "moves that the job does not ask for", len(moves))] if moves else []
    homes = 2 if prepared.job.home is not None else 0
    wanted = len(plans) - 1 + homes
    rows = [count("moves", "missing or surplus moves", abs(len(moves) - wanted))]
    odd = [m for m in moves if m.q.shape[1] != robot.joints or len(m.q) < 2]
    far = [m for m in moves if not np.abs(m.q).max(initial=0.0) < FARTHEST]
    rows.append(count("corners", "moves without two corners of the robot's joints", len(odd)))
    rows.append(count("air-limits", "moves with corners beyond any joint's range", len(far)))
    if len(moves) != wanted or odd or far:
        return rows
    try:
        ways = [(_approach(prepared, p, "start"), _approach(prepared, p, "end")) for p in plans]
    except InputError as error:
        return [*rows, count("retract", f"ends of cuts without a possible retract: {error}", 1)]
    o, cell = prepared.job.options, prepared.cell
    tables = [
        transfer_checks(robot, m.q, m.time, cell=cell, eta_v=o.eta_v, eta_a=o.eta_a) for m in moves
    ]
    for table, move, ends in zip(tables, moves, _ends(prepared, ways), strict=True):
        table += _fits(prepared, move, ends)
    rows += worst_of(tables)
    if cell is not None:
        ups = [
            [c for c in transfer_checks(robot, way, np.arange(len(way)) * 1e3, cell=cell)
             if c.code.startswith("collision")]
            for pair in ways for way in pair
        ]  # fmt: skip
        rows += [_way_row(row) for row in worst_of(ups)]
    return rows


def expect_sequence(
    prepared: PreparedJob, plans: Sequence[Plan], moves: Sequence[TransferMove], at_least: float
) -> PartPlan | None:
    """Return the plans and moves as the job asks for them, in the times that the moves need.

    The claim about other orders (`at_least` s) is not checked.
    """
    if prepared.job.sequence is None:
        return None
    program = prepared.job.program
    candidates = np.arange(len(plans))
    part = PartPlan(
        plans=tuple(plans),
        moves=tuple(
            TransferMove(q=m.q, time=_times(plans[0], m.q), clear=prepared.cell is not None)
            for m in moves
        ),
        order=Order(candidates=candidates, duration=0.0, at_least=at_least),
        chosen=(),
        retract=program.retract,
        approach_speed=program.approach_speed,
        pierce_time=program.pierce_time,
    )
    order = Order(candidates=candidates, duration=part.cycle_time, at_least=at_least)
    return replace(part, order=order)


def _times(first: Plan, q: Array) -> Array:
    """Return when the corners of a planned move are reached in the least time, s."""
    velocity, acceleration = first.robot.speed_limits()
    eta_v, eta_a = first.settings.eta_v, first.settings.eta_a
    took = least_time(np.diff(q, axis=0), eta_v * velocity, eta_a * acceleration)
    return np.concatenate([[0.0], np.cumsum(np.maximum(took, 1e-9))])


def _approach(prepared: PreparedJob, plan: Plan, end: End) -> Array:
    """Return joints (9, n) rad along the approach or the retract of a cut, from the cut on."""
    retract = prepared.job.program.retract
    return np.array([back_off(plan, end, float(share) * retract) for share in SHARES])


def _ends(prepared: PreparedJob, ways: Sequence[tuple[Array, Array]]) -> list[tuple[Array, Array]]:
    """Return where each move begins and ends, (n,) rad each."""
    home = prepared.job.home
    starts, ends = [way[0][-1] for way in ways], [way[1][-1] for way in ways]
    if home is not None:
        starts, ends = [*starts, home], [home, *ends]
        return list(zip(ends, starts, strict=True))
    return list(zip(ends[:-1], starts[1:], strict=True))


def _fits(prepared: PreparedJob, move: TransferMove, ends: tuple[Array, Array]) -> list[Check]:
    """Compare the ends of a move with those of the cuts and home, and its start time with zero.

    In the last move, endless joints may be at home on another turn.
    """
    first, last = np.abs(move.q[0] - ends[0]), np.abs(move.q[-1] - ends[1])
    home = prepared.job.home
    if home is not None and np.array_equal(ends[1], home):
        whole = 2 * np.pi * np.round(last / (2 * np.pi))
        last = np.where(prepared.job.robot.endless, np.abs(last - whole), last)
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
# Compare a plan.json with the values that follow from its job and its joints.

CLAIMS = {
    r"kerfpath$": "the version that wrote the file",
    r"(proof|optimal|grid_cost|bound|gap)$": "claims about motions that are not in the file",
    r"certificate(/|$)": "the proof of a bound, which the audit checks separately",
    r"counts(/|$)": "poses that were dropped in planning",
    r"audit/checks/\d+/(title|advice|node)$": "words and places of the audit made in planning",
    r"sequence/(optimal|at_least_s)$": "claims about orders that are not in the file",
}
"""Places that are not compared, and what they hold; none of them defines the motion."""
DISTANCE = 1e-6
"""Accuracy of distances between convex solids, m; those of a record may differ by it."""
SHOWN = 60
"""Most characters of a value that a message shows."""
PROGRAM = ("program", "audit", "layout")
"""Tables of a job that do not define the motion."""


@dataclass(frozen=True, slots=True)
class _Difference:
    """One value that differs: where, and what both sides have."""

    path: tuple[str | int, ...]
    expected: Any
    found: Any

    @property
    def node(self) -> int:
        """The node that it belongs to; 0 where it belongs to all."""
        node = self.path[1 + (self.path[0] == "nodes")] if len(self.path) > 2 else 0
        return node if isinstance(node, int) and self.path[0] == "nodes" else 0

    def __str__(self) -> str:
        where = ".".join(str(step) for step in self.path)
        return f"{where}: expected {_shown(self.expected)}, found {_shown(self.found)}"


def compare_values(
    expected: Any, found: Any, whose: str, under: tuple[str | int, ...] = ()
) -> list[Check]:
    """Return a check for each kind of place at which `found` differs from what is expected.

    The title has the first difference of the kind; without any, a single check passes.

    Parameters
    ----------
    expected, found : JSON values
    whose : str
        Whose values are expected, in words.
    under : tuple
        Place of both values in the document.
    """
    groups: dict[tuple[str, ...], list[_Difference]] = {}
    for each in _differences(expected, found, under):
        kind = tuple(step for step in each.path if isinstance(step, str))
        groups.setdefault(kind, []).append(each)
    checks = []
    for alike in groups.values():
        first = alike[0]
        many = "" if len(alike) == 1 else f" (and {len(alike) - 1} more such)"
        checks.append(
            count(
                "agrees", f"values that differ from {whose}: {first}{many}", len(alike), first.node
            )
        )
    return checks or [count("agrees", f"values that differ from {whose}", 0)]


def compare_jobs(job: Job, source: Mapping[str, Any]) -> list[Check]:
    """Return the checks of the job that a plan.json repeats, compared by the values it means.

    Tables that do not define the motion have a separate check.
    """
    title = "values of the job in the plan that differ from the job"
    if _same(job.source, source):
        return [count("job", title, 0)]
    context = {"folder": job.path.parent}
    try:
        then = JobFile.model_validate(source, context=context).model_dump(mode="json")
    except (ValidationError, ValueError, TypeError, OverflowError) as error:
        said = " ".join(str(error).split())[:SHOWN]
        return [count("job", f"{title}: it is not a valid job ({said}...)", 1)]
    now = JobFile.model_validate(job.source, context=context).model_dump(mode="json")
    found = list(_differences(now, then, ("job",)))
    rows = []
    for code, mine in (
        ("job", [each for each in found if each.path[1] not in PROGRAM]),
        ("job-program", [each for each in found if each.path[1] in PROGRAM]),
    ):
        many = f" (and {len(mine) - 1} more)" if len(mine) > 1 else ""
        rows.append(count(code, f"{title}: {mine[0]}{many}" if mine else title, len(mine)))
    return rows


def _differences(one: Any, two: Any, path: tuple[str | int, ...]) -> Iterator[_Difference]:
    where = "/".join(str(step) for step in path)
    if any(re.match(pattern, where) for pattern in CLAIMS):
        return
    if isinstance(one, dict) and isinstance(two, dict):
        for key in sorted(one.keys() | two.keys()):
            if key not in one or key not in two:
                a, b = (side.get(key, _Absent) for side in (one, two))
                yield _Difference((*path, key), a, b)
            else:
                yield from _differences(one[key], two[key], (*path, key))
    elif isinstance(one, list | tuple) and isinstance(two, list | tuple):
        if len(one) != len(two):
            yield _Difference((*path,), f"{len(one)} of them", f"{len(two)} of them")
            return
        numbers = _numbers(one), _numbers(two)
        if numbers[0] is not None and numbers[1] is not None:
            yield from _far(*numbers, path)
            return
        for i, (a, b) in enumerate(zip(one, two, strict=True)):
            yield from _differences(a, b, (*path, i))
    elif _is_number(one) and _is_number(two):
        if not abs(one - two) <= _allowed(path, one):
            yield _Difference(path, one, two)
    elif type(one) is not type(two) or one != two:
        yield _Difference(path, one, two)


def _far(
    one: NDArray[np.float64] | None, two: NDArray[np.float64] | None, path: tuple[str | int, ...]
) -> Iterator[_Difference]:
    """Yield the numbers of two arrays that differ, the largest difference first."""
    assert one is not None
    assert two is not None
    if one.shape != two.shape:
        yield _Difference(path, f"{one.shape} numbers", f"{two.shape} numbers")
        return
    off = np.abs(one - two) / np.maximum(1.0, np.abs(one))
    far = np.argwhere(~(off <= SAME_VALUE))
    for index in far[np.argsort([-off[tuple(i)] for i in far], kind="stable")]:
        at = tuple(int(i) for i in index)
        yield _Difference((*path, *at), float(one[at]), float(two[at]))


def _allowed(path: tuple[str | int, ...], value: float) -> float:
    """Return how far a number may be from `value`."""
    if path[:2] == ("audit", "checks") and path[-1] == "value":
        return DISTANCE
    return SAME_VALUE * max(1.0, abs(value))


def _numbers(values: Any) -> NDArray[np.float64] | None:
    """Return an array of numbers, of any depth; None if it holds anything else."""
    try:
        found = np.array(values)
    except ValueError:  # rows of unlike lengths
        return None
    return found.astype(np.float64) if found.dtype.kind in "iuf" and found.size else None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _same(one: Any, two: Any) -> bool:
    """Return whether two documents are the same, types included."""
    if type(one) is not type(two):
        return False
    if isinstance(one, dict):
        return one.keys() == two.keys() and all(_same(one[key], two[key]) for key in one)
    if isinstance(one, list):
        return len(one) == len(two) and all(map(_same, one, two))
    return bool(one == two)


class _Absent:
    """Marks a value that one of the two documents lacks."""


def _shown(value: Any) -> str:
    text = "nothing" if value is _Absent else str(value)
    text = "".join(c if c.isprintable() else "?" for c in text)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


# -----------------------------------------------------------------------------
# Audit a plan.json against its job, or by itself if no job is given.

JOB, FILE = "those of the job and the joints", "those of the joints"
OWN_NODES = ("gamma_rad", "lead_lean_rad", "posture", "turn")
"""Columns of nodes that follow from the joints."""
AIR = "air"
"""Name of the table of the moves."""


def audit_file(plan_file: Path, job_file: Path | None = None) -> AuditReport:
    """Audit every contour of a plan.json.

    With a job, only the job defines what is required and allowed; values that the plan repeats, or
    that follow from its joints, must agree. Without one, limits, tool, placement and speed are
    those of the plan, and only values that follow from its joints are compared.

    Parameters
    ----------
    plan_file : Path
    job_file : Path, optional

    Raises
    ------
    InputError
        A file cannot be read.
    """
    if job_file is not None:
        return PlanAudit.of(job_file).audited(plan_file)
    return _by_itself(read_plan_file(plan_file))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanAudit:
    """The audit of plan.json files of one job, whose drawing and cell are read once.

    Parameters
    ----------
    prepared : PreparedJob
    """

    prepared: PreparedJob

    __repr__ = short_repr

    @classmethod
    def of(cls, job_file: Path) -> PlanAudit:
        """Return the audit of a job's plans.

        Raises
        ------
        InputError
            The job, its drawing or its cell cannot be read.
        """
        return cls(prepared=prepare(read_job(job_file)))

    def audited(self, plan_file: Path) -> AuditReport:
        """Audit every contour of a plan.json against the job.

        Raises
        ------
        InputError
            The file cannot be read.
        """
        prepared, file = self.prepared, read_plan_file(plan_file)
        job, cell, entries = prepared.job, prepared.cell, file.entries
        expected, rows = expect_plans(prepared, file)
        tables: dict[str, list[Check]] = {file.path.name: rows}
        judged: list[PlanData] = []
        for each in expected:
            table = tables.setdefault(each.name, [])
            table += each.checks
            if each.plan is None:
                continue
            made = job.tolerances.checks(each.plan, reference=each.path, cell=cell)
            made += each.drawing
            table += as_run(job, each.plan, each.path or each.plan.contour).checks
            entry = _entry(each.plan, entries[each.name], made, file)
            judged.append(entry)
            table += made
            table += _claims(each.plan)
            table += compare_values(entry, entries[each.name], JOB)
        rows += compare_jobs(job, file.job)
        paths = [p.contour for p in file.plans]
        rows += check_sequence(prepared, [each.number for each in expected], paths)
        rows += self._whole(file, judged, expected)
        plans = [each.plan for each in expected if each.plan is not None]
        if len(plans) == len(expected) and plans:
            tables.setdefault(AIR, []).extend(check_moves(prepared, plans, file.moves))
        note = collision_note(cell, moves_too=job.sequence is not None)
        return AuditReport(
            tables={name: table for name, table in tables.items() if table},
            missing=file.missing,
            note=f"{note} {_list_claims(file, tables)}".strip(),
        )

    def _whole(
        self, file: PlanFile, judged: Sequence[PlanData], expected: Sequence[ExpectedPlan]
    ) -> list[Check]:
        """Compare the parts of the file beside its contours: robot, limits, cell, sequence."""
        prepared, job, data = self.prepared, self.prepared.job, file.data
        plans = [each.plan for each in expected if each.plan is not None]
        part = None
        if job.sequence is not None and data["sequence"] is not None and plans:
            part = expect_sequence(prepared, plans, file.moves, data["sequence"]["at_least_s"])
        own: Mapping[str, object] = data
        whole: Mapping[str, object] = plan_document(
            job.robot, job.tool, job.placement, judged, {}, prepared.cell, part
        )
        rows = []
        for key in whole.keys() - {"job", "contours", "kerfpath", "schema"}:
            if key == "sequence" and len(plans) < len(expected):
                continue  # a contour is refused already, and its times are not known
            rows += [row for row in compare_values(whole[key], own[key], JOB, (key,)) if not row.ok]
        if job.sequence is not None and data["sequence"] is None:
            rows.append(count("moves", "missing moves between contours", 1))
        return rows or compare_values({}, {}, JOB)


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
    tolerances = table_of(file, "audit", AuditTable, tolerances_of)
    tables = {}
    for p in file.plans:
        own, said = recompute(p), file.entries[p.name]
        made = tolerances.checks(own)
        entry = _entry(own, said, made, file)
        follow = {key: value for key, value in entry["nodes"].items() if key in OWN_NODES}
        entry["audit"], entry["nodes"] = said["audit"], cast(NodesData, said["nodes"] | follow)
        tables[p.name] = [*made, *_claims(own), *compare_values(entry, said, FILE)]
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
