"""What a job expects in a plan.json or a program: its plans and moves, or its program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.auditor import Check, chain_of, retract_checks, window_checks
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.execution import ToolMotion, lengths_of
from kerfpath.job.audit_report import check, count
from kerfpath.job.format import Candidate, Job, PreparedJob, divide_nodes
from kerfpath.job.plan_file import PlanFile
from kerfpath.job.program_file import ReadCut, branch_of, follow_poses
from kerfpath.options import PlanOptions
from kerfpath.plans import Plan, TransferMove, path_cost
from kerfpath.post import (
    ZONE_STEP,
    CircularMove,
    JointMove,
    LinearMove,
    Program,
    ReadProgram,
    Rules,
    Step,
    build_program,
    may_replace,
    read_as_written,
)
from kerfpath.retime import feed, retime
from kerfpath.robots import Robot
from kerfpath.sequence import Order, PartPlan
from kerfpath.tolerances import SAME_PLACE
from kerfpath.transfer import back_off, least_times
from kerfpath.windows import GammaWindow

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
    arm = robot.arm
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
# What a job expects in a file of either kind.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExpectedContour:
    """A contour that a job expects to be cut.

    Parameters
    ----------
    name : str
    candidates : tuple of Candidate
        The ways to cut it.
    options : PlanOptions
        Options of its plan, with its windows of gamma.
    """

    name: str
    candidates: tuple[Candidate, ...]
    options: PlanOptions

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Expected:
    """What a job expects in a plan.json or a program.

    Parameters
    ----------
    job : Job
        Robot, tool, placement, options, [program], [sequence] and tolerances.
    contours : tuple of ExpectedContour
        In the order of the job.
    cell : Cell or None
    inner_first : tuple of (int, int)
        Pairs of contours (from 0) of which the first is to be cut before the second.
    """

    job: Job
    contours: tuple[ExpectedContour, ...]
    cell: Cell | None = None
    inner_first: tuple[tuple[int, int], ...] = ()

    __repr__ = short_repr

    @classmethod
    def of(cls, prepared: PreparedJob) -> Expected:
        """Return what a prepared job expects."""
        return cls(
            job=prepared.job,
            contours=tuple(
                ExpectedContour(name=c.task.name, candidates=c.candidates, options=c.options)
                for c in prepared.contours
            ),
            cell=prepared.cell,
            inner_first=prepared.inner_first,
        )

    @property
    def names(self) -> list[str]:
        """The names of the contours."""
        return [contour.name for contour in self.contours]


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


def expect_plans(expected: Expected, file: PlanFile) -> tuple[list[ExpectedPlan], list[Check]]:
    """Return the expected plan for each plan of a file, and the checks of its contours."""
    names = expected.names
    members = [[p for p in file.plans if file.contours[p.name] == name] for name in names]
    found: dict[str, ExpectedPlan] = {}
    for number, plans in enumerate(members):
        for each in _of_contour(expected, number, plans, file.picked):
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
    expected: Expected, number: int, plans: Sequence[Plan], picked: frozenset[str]
) -> list[ExpectedPlan]:
    """Return the expected plans of one contour: a single one, or its pieces."""
    if not plans:
        return []
    name, job = expected.names[number], expected.job
    if len(plans) == 1 and plans[0].name == name:
        (made,) = plans
        candidate = _nearest(expected.contours[number].candidates, made, job.options.refine_parts)
        if candidate is None:
            counts = sorted({len(c.nodes) for c in expected.contours[number].candidates})
            row = _node_count(made, " or ".join(map(str, counts)))
            return [ExpectedPlan(name=name, number=number, checks=(row,))]
        own, parts = _divided(candidate, made, job.options.refine_parts)
        shown = made.name in picked
        return [_expected_plan(expected, number, made, own, candidate.dt, parts, picked=shown)]
    words = [f"{name}, piece {k + 1} of {len(plans)}" for k in range(len(plans))]
    by_name = {p.name: p for p in plans}
    if len(plans) == 1 or job.options.interruptions == "none" or set(by_name) != set(words):
        row = count("once", "plans of a contour that is cut once", len(plans))
        return [ExpectedPlan(name=p.name, number=number, checks=(row,)) for p in plans]
    return _pieces(expected, number, [by_name[word] for word in words])


def _pieces(expected: Expected, number: int, plans: Sequence[Plan]) -> list[ExpectedPlan]:
    """Return the expected plans of the pieces of a contour, in the order along it."""
    job = expected.job

    def off(candidate: Candidate) -> float:
        ends = [candidate.path.at(p.contour.s[[0, -1]])[0] for p in plans]
        return max(
            float(np.linalg.norm(p.contour.points[[0, -1]] - end, axis=1).max())
            for p, end in zip(plans, ends, strict=True)
        )

    candidate = min(expected.contours[number].candidates, key=off)
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
        found.append(_expected_plan(expected, number, p, own, candidate.dt, parts, picked=False))
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


def _expected_plan(
    expected: Expected, number: int, made: Plan, own: Candidate, dt: float, parts: int,
    *, picked: bool,
) -> ExpectedPlan:  # fmt: skip
    """Return the plan that has the joints of a plan and all else of the job.

    Its nodes are those of its `own` candidate, which may be a piece, or divide each interval of
    `dt` (s) into `parts`.
    """
    job, nodes = expected.job, own.nodes
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
        settings=_options(expected, number, dt, made.settings, picked=picked),
        feed=None,
    )
    if job.options.feed == "dip" and made.feed is not None and not picked:
        plan = _dipping(plan, dt, made.time)
    plan = recompute(plan)
    requested = job.options.retract
    room = retract_checks(plan, None if requested == made.settings.retract else requested)
    rows = (place, *_postures(job, plan), *room)
    drawing = own.drawing_checks(plan.contour, job.tolerances.path)
    return ExpectedPlan(
        name=made.name, number=number, plan=plan, path=own.path, checks=rows, drawing=(*drawing,)
    )


def _options(
    expected: Expected, number: int, dt: float, said: PlanOptions, *, picked: bool
) -> PlanOptions:
    """Return the plan options of the job; a picked plan may have lower shares of the limits."""
    job, requested = expected.job, expected.contours[number].options
    # [program] may have been edited since: the current retract is checked separately.
    options = replace(requested.resolve(job.robot, dt), retract=said.retract)
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
    tau = retime(plan.increments, dt, limits, q=plan.q)
    time, found = np.concatenate([[0.0], np.cumsum(tau)]), np.diff(said)
    if said[0] == 0 and (np.abs(found - tau) <= RETIMED * tau).all():
        time, tau = said, found
    dips = feed(tau, dt, plan.increments, limits, np.diff(plan.contour.s), q=plan.q)
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


def expect_sequence(
    expected: Expected, plans: Sequence[Plan], moves: Sequence[TransferMove], at_least: float
) -> PartPlan | None:
    """Return the plans and moves as the job asks for them, in the times that the moves need.

    The claim about other orders (`at_least` s) is not checked.
    """
    if expected.job.sequence is None:
        return None
    program, limits = expected.job.program, plans[0].settings
    candidates = np.arange(len(plans))
    part = PartPlan(
        plans=tuple(plans),
        moves=tuple(
            TransferMove(
                q=m.q,
                time=least_times(plans[0].robot, m.q, limits.eta_v, limits.eta_a)
                / (program.air_speed or 1.0),
                clear=expected.cell is not None,
            )
            for m in moves
        ),
        order=Order(candidates=candidates, duration=0.0, at_least=at_least),
        chosen=(),
        retract=program.retract,
        approach_speed=program.approach_speed,
        pierce_time=program.pierce_times([plan.name for plan in plans]),
    )
    order = Order(candidates=candidates, duration=part.cycle_time, at_least=at_least)
    return replace(part, order=order)


# -----------------------------------------------------------------------------
# The program that a job asks for along the paths that were read from a program.

REACH = 4.0
"""Distance (m) that no tip has from an axis: the lever of rounded joint angles."""
POINT = 1e-5
"""Tolerance (m) of a target beside the cut against the job, beyond its digits."""
ANGLE = np.radians(0.02)
"""Tolerance of the tool's orientation there, rad."""
SAME_BRANCH = 0.2
"""Largest difference (rad) of joints for the same pose, as digits cause near a singularity."""
SAME_SPEED = 1e-3
"""Largest relative difference of the speeds in one arc."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetNodes:
    """The nodes that a job asks for along a cut, and the node of each target.

    Parameters
    ----------
    nodes : Contour
        The K nodes, with their kinds.
    time : (K,) s
        When each is reached at the requested speed.
    at : (m,) int
        The node of each target of the cut.
    off : (m,) m
        Distance of each target from its node.
    alone : (m,) bool
        Whether a target is not at the next node, or for an arc not at a later one.
    """

    nodes: Contour
    time: Array
    at: Ints
    off: Array
    alone: Bools

    __repr__ = short_repr

    @property
    def complete(self) -> bool:
        """Whether every node has its target, or lies on an arc between two."""
        return not self.alone.any() and self.at[-1] == len(self.nodes) - 1


def nodes_at_targets(job: Job, candidate: Candidate, cut: ReadCut, s: Array) -> TargetNodes:
    """Return the nodes that the job asks for along a cut, by the arc lengths s (m,) of its targets.

    With refine_parts, intervals are divided if there are more targets than nodes.
    """
    nodes, dt, parts = candidate.nodes, candidate.dt, job.options.refine_parts
    targets = cut.ends
    if parts > 1 and _on_parts(nodes.s, s[targets], parts):
        nodes, dt = divide_nodes(candidate.path, nodes, parts), dt / parts
    if len(targets) == len(nodes):
        at = np.arange(len(nodes))
    else:
        at = np.abs(nodes.s[None] - s[targets][:, None]).argmin(axis=1)
    arc = np.array([move.kind == "circular" for move in cut.targets])
    step = np.diff(at, prepend=-1)
    left_out = _left_out(job, nodes, dt, at, ~arc)
    kept = np.ones(len(nodes), dtype=bool)
    for last in np.flatnonzero(left_out).tolist():
        kept[at[last - 1] + 1 : at[last]] = False
    return TargetNodes(
        nodes=nodes if kept.all() else _only(nodes, kept),
        time=dt * np.flatnonzero(kept).astype(np.float64),
        at=np.cumsum(kept)[at] - 1,
        off=np.linalg.norm(cut.T_part_tip[targets, :3, 3] - nodes.points[at], axis=1),
        alone=np.where(arc, step < 1, (step != 1) & ~left_out),
    )


def _on_parts(s: Array, targets: Array, parts: int) -> bool:
    """Return whether targets, at arc lengths (m,) m, are at parts of the intervals of nodes s."""
    if len(targets) > len(s):
        return True
    at = np.interp(targets, s, np.arange(len(s)))
    return bool(np.abs(at - np.round(at)).max() > 1 / (2 * parts))


def _left_out(job: Job, nodes: Contour, dt: float, at: Ints, straight: Bools) -> Bools:
    """Return which moves, each to the node `at` (m,), may leave out nodes, as they are too short.

    The nodes are `dt` (s) apart, and the laser does not change there. How far they are from the
    path with the targets alone is audited.
    """
    program = job.program
    found = np.zeros(len(at), dtype=bool)
    if program.thin_tolerance <= 0:
        return found
    controller = program.rules.controller
    micro = [kind == "micro joint" for kind in nodes.kinds]
    for j in (np.flatnonzero(straight[1:] & (np.diff(at) > 1)) + 1).tolist():
        one = len(set(micro[at[j - 1] : at[j]])) == 1
        found[j] = one and may_replace(controller, dt, int(at[j] - at[j - 1]))
    return found


def _only(nodes: Contour, kept: Bools) -> Contour:
    """Return the contour through some of its nodes."""
    return Contour(
        nodes.points[kept], nodes.axes[kept], s=nodes.s[kept], kind=nodes.kind[kept],
        name=nodes.name,
    )  # fmt: skip


def expect_program(
    job: Job, cuts: Sequence[tuple[ReadCut, TargetNodes, Plan]], home: Array
) -> ReadProgram:
    """Return the job's program along the paths of these cuts, as it would be read back.

    The paths, and with [sequence] the corners of the moves between them, are those that were read;
    they are audited separately. All else follows from the job: speeds, zones, waits, switches, and
    distance and direction of the retract.

    Raises
    ------
    InputError
        There is no such program: joints leave the path, or the tool cannot back off.
    """
    rules, options = job.program.rules, job.program
    plans = [whole_cut(job, cut, requested, plan) for cut, requested, plan in cuts]
    moves = _moves(job, [cut for cut, _, _ in cuts], plans, home)
    # Arcs are added below, where they were read; nodes left out are no nodes of the plans.
    program = build_program(plans, options, moves=moves, arc_tolerance=None, thin_tolerance=0.0)
    sections = []
    for section, (cut, requested, _) in zip(program.sections, cuts, strict=True):
        steps = [
            replace(step, q=_same_pose(program, step.q, cut.approach, rules))
            if isinstance(step, JointMove)
            else step
            for step in section.steps
        ]
        if options.zone == "auto":
            steps = _with_read(steps, cut, requested, "zone", share=ZONE_STEP, more=POINT)
        if job.compensation is not None:
            steps = _with_read(steps, cut, requested, "speed", share=SAME_SPEED)
        if options.arc_tolerance is not None:
            steps = _with_arcs(steps, cut, requested)
        sections.append(replace(section, steps=tuple(steps)))
    program = replace(program, sections=tuple(sections))
    return read_as_written(program, options.robot_language, options.language_settings)


def whole_cut(job: Job, cut: ReadCut, requested: TargetNodes, plan: Plan) -> Plan:
    """Return the plan of a cut with every node that the job asks for, along arcs, too."""
    targets, at = cut.ends, requested.at
    K = len(requested.nodes)
    T, q = np.empty((K, 4, 4)), np.empty((K, cut.q.shape[1]))
    T[at], q[at] = cut.T_part_tip[targets], cut.q[targets]
    flange = np.linalg.inv(plan.T_flange_tip)
    for j, move in enumerate(cut.targets):
        first, last = at[max(j - 1, 0)], at[j]
        if move.T_part_via is not None and last - first > 1:
            inner = slice(first + 1, last)
            s = requested.nodes.s[first : last + 1]
            parts = ((s - s[0]) / (s[-1] - s[0]))[1:-1]
            T[inner] = ToolMotion.through(T[[first, last]], [move.T_part_via]).poses(parts)
            q[inner] = follow_poses(plan.robot, plan.T_base_part @ T[inner] @ flange, q[first])
    time, s = requested.time, requested.nodes.s
    if job.compensation is not None:
        s = lengths_of(requested.nodes, T[:, :3, 3])
    if job.options.feed != "constant":  # it may be slower, which is checked separately
        time = np.interp(np.arange(K), at, _as_fast(cut, s[at]))
    return replace(
        plan,
        contour=Contour(T[:, :3, 3], T[:, :3, 2], s=s, kind=requested.nodes.kind, name=plan.name),
        q=q,
        gamma=np.zeros(K),
        time=time,
        posture=np.full(K, branch_of(plan.robot, q[0])),
        turn=np.zeros(q.shape, dtype=np.int64),
    )


def _as_fast(cut: ReadCut, s: Array) -> Array:
    """Return when (s) the targets of a cut are reached at the speeds of the text, from 0 on."""
    took = [
        float(cut.took[a:b].sum()) if np.isnan(cut.speed[a]) else float(way / cut.speed[a])
        for a, b, way in zip(cut.ends[:-1], cut.ends[1:], np.diff(s), strict=True)
    ]
    return np.append(0.0, np.cumsum(took))


def _moves(
    job: Job, cuts: Sequence[ReadCut], plans: Sequence[Plan], home: Array
) -> list[TransferMove]:
    """Return the moves between cuts with the corners that were read, and the job's home."""
    if job.sequence is None:
        return []
    # Each approach but the first begins where the cut before it ends.
    corners = [
        [*cut.approach[number > 0 : -1], back_off(plan, "start", job.program.retract)]
        for number, (cut, plan) in enumerate(zip(cuts, plans, strict=True))
    ]
    backs = [back_off(plan, "end", job.program.retract) for plan in plans]
    ways = [[back, *way] for back, way in zip(backs, corners[1:], strict=False)]
    if job.home is not None:
        there = job.home
        # At the end, an endless joint is at home on any turn that the motion has reached.
        end = home[-1] if len(home) else backs[-1]
        turns = np.round((end - there) / (2 * np.pi)) * job.robot.endless
        ways = [[there, *corners[0][1:]], *ways, [backs[-1], *home[:-1], there + 2 * np.pi * turns]]
    return [
        TransferMove(q=np.array(way), time=np.arange(len(way), dtype=float), clear=True)
        for way in ways
    ]


def _same_pose(program: Program, requested: Array, approach: Array, rules: Rules) -> Array:
    """Return the nearest joints that were read (m, n) if they bring the tool to the requested pose.

    Near a singularity, the digits of a pose leave a larger error in the joints than in the pose.
    """
    read = min(approach, key=lambda q: float(np.abs(requested - q).max()))
    T = program.robot.forward(np.array([requested, read])) @ program.T_flange_tip
    left = len(requested) * rules.angle_step
    off = np.linalg.norm(T[0, :3, 3] - T[1, :3, 3])
    turned = np.linalg.norm(T[0, :3, :3] - T[1, :3, :3]) / np.sqrt(2)
    near = off <= POINT + rules.point_step + REACH * left and turned <= ANGLE + left
    near = near and np.abs(requested - read)[program.robot.free].max(initial=0) <= POINT
    return read if near and np.abs(requested - read).max() <= SAME_BRANCH else requested


def _with_read(
    steps: Sequence[Step], cut: ReadCut, requested: TargetNodes, name: Literal["zone", "speed"],
    *, share: float, more: float = 0.0,
) -> list[Step]:  # fmt: skip
    """Return the steps of a cut with the zones or speeds that were read, if they are nearly alike.

    They may differ by a share of the value that the job asks for, and by `more`: zones are rounded
    to steps, and digits of targets may lead to the next step; between moved targets, speeds depend
    on the places of nodes that were left out.
    """
    path = [k for k, step in enumerate(steps) if isinstance(step, LinearMove)]
    found = list(steps)
    for k, move in zip((path[node] for node in requested.at), cut.targets, strict=True):
        step = found[k]
        assert isinstance(step, LinearMove)
        said, asked = getattr(move, name), getattr(step, name)
        if said and abs(said - asked) <= share * asked + more:
            found[k] = replace(step, **{name: said})
    return found


def _with_arcs(steps: Sequence[Step], cut: ReadCut, requested: TargetNodes) -> list[Step]:
    """Return the steps of a cut with the arcs that were read, if there may be an arc."""
    path = [k for k, step in enumerate(steps) if isinstance(step, LinearMove)]
    found, done = list(steps[: path[0] + 1]), path[0] + 1
    for j, move in enumerate(cut.targets[1:], 1):
        first, last = path[requested.at[j - 1] + 1], path[requested.at[j]]
        run = [step for step in steps[first : last + 1] if isinstance(step, LinearMove)]
        found += steps[done:first]
        done = last + 1
        arc = move.T_part_via is not None and _is_one(run)
        found += [_arc(run, move.T_part_via)] if arc else run
    return [*found, *steps[done:]]


def _is_one(run: Sequence[LinearMove]) -> bool:
    """Return whether linear moves may be one arc: no stop, no switch, and one speed."""
    speeds = [move.speed for move in run]
    through = all(move.zone > 0 and not move.switches for move in run[:-1])
    return through and max(speeds) - min(speeds) <= SAME_SPEED * speeds[0]


def _arc(run: Sequence[LinearMove], T_part_via: Array | None) -> CircularMove:
    end, via = run[-1], run[(len(run) - 1) // 2]
    assert T_part_via is not None
    return CircularMove(
        T_part_via=T_part_via,
        q_via=via.q,
        T_part_tip=end.T_part_tip,
        q=end.q,
        speed=run[0].speed,
        duration=sum(move.duration for move in run),
        zone=end.zone,
        switches=end.switches,
    )


# -----------------------------------------------------------------------------
# Check that a program keeps gamma inside the windows of its job.

OUTSIDE = 1e-5
"""Tolerance of targets outside a window, rad, beyond their digits."""


def check_pins(
    job: Job,
    cut: ReadCut,
    requested: TargetNodes,
    plan: Plan,
    windows: Sequence[GammaWindow],
) -> list[Check]:
    """Return the check of a cut's windows of gamma, at the nodes that the job asks for.

    Empty if the tool axis may be tilted, as a text does not state the nominal axis.
    """
    if not windows or job.options.tilt is not None:
        return []
    whole = whole_cut(job, cut, requested, plan)
    settings = replace(whole.settings, gamma_windows=tuple(windows))
    pinned = replace(whole, contour=requested.nodes, settings=settings)
    tool = job.robot.forward(pinned.q) @ job.tool
    # Digits of three angles, or of the four numbers of a quaternion.
    return window_checks(pinned, tool, slack=OUTSIDE + 4 * job.program.rules.angle_step)
