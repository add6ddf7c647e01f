"""The run of a job: plan and audit every contour, and put them in order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.auditor import Check, bound_checks, transfer_checks, worst_of
from kerfpath.cad import Departure, Part, departure_from
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.front import Subproblem, follows_courses, graph_of_runs, plan_run
from kerfpath.graph import LayeredGraph
from kerfpath.job.as_run import AsRun, as_run, kept_between_nodes
from kerfpath.job.format import Candidate, CutRequest, Job, PreparedJob, divide_nodes, prepare
from kerfpath.job.run.foresee import require_foreseen
from kerfpath.job.run.remedy import Remedy, find_remedy, opens_without_windows
from kerfpath.options import PlanOptions
from kerfpath.planner import (
    ClearanceMap,
    FastestSpeed,
    clearance_map,
    plan,
    plan_in_pieces,
    with_bound,
)
from kerfpath.plans import Plan
from kerfpath.progress import Progress, no_progress
from kerfpath.refiner import refine
from kerfpath.sequence import PartPlan, longest_search, order_candidates
from kerfpath.transfer import TransferMove

# -----------------------------------------------------------------------------
# The results of a job and of each of its contours.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CutResult:
    """The result of one contour of a job, or of one piece of it.

    Parameters
    ----------
    request : CutRequest
        The request for the contour.
    candidate : Candidate
        The path that is cut and its nodes, or a stretch of it.
    graph : LayeredGraph
    plan : Plan or None
        The plan; None if no feasible path was found.
    broken : NoFeasiblePath or None
        Why there is no plan.
    fastest : FastestSpeed or None
        The fastest feasible speed, if there is no plan but a slower one exists.
    advice : Remedy or None
        Speeds and shares of the limits that would make it feasible.
    checks : tuple of Check
        The audit's table; empty without a plan.
    clearance : ClearanceMap or None
        The clearance of every pose in the cell, if the job asks for the map.
    departure : Departure or None
        How far the nodes leave the CAD curve; measured once the candidate is chosen.
    as_run : AsRun
        The plan as a controller runs its program, with rounded corners; not kept in plan files.
    """

    request: CutRequest
    candidate: Candidate
    graph: LayeredGraph
    plan: Plan | None = None
    broken: NoFeasiblePath | None = None
    fastest: FastestSpeed | None = None
    advice: Remedy | None = None
    checks: tuple[Check, ...] = ()
    clearance: ClearanceMap | None = None
    departure: Departure | None = None
    as_run: AsRun = field(default_factory=AsRun)

    __repr__ = short_repr

    @property
    def contour(self) -> str:
        """Name of the contour in the job."""
        return self.request.task.name

    @property
    def name(self) -> str:
        """Name of the cut; that of a piece has its number, too."""
        return self.contour if self.plan is None else self.plan.name

    @property
    def picked(self) -> bool:
        """Whether the plan is one of a Pareto set, with another objective than the job."""
        return self.request.run is not None

    @property
    def passed(self) -> bool:
        """True when there is a plan and its audit finds no error."""
        rows = (*self.checks, *self.as_run.checks)
        return self.plan is not None and not any(c.level == "error" and not c.ok for c in rows)

    def measured(self, part: Part, loop: Departure | None) -> CutResult:
        """Return the cut with the departure of its nodes.

        Parameters
        ----------
        part : Part
        loop : Departure or None
            Departure of the drawn loop if operations moved it; the nodes are then measured from
            the path as cut.
        """
        nodes = self.candidate.nodes if self.plan is None else self.plan.contour
        found = (
            part.departure(self.request.task.pick, nodes)
            if loop is None
            else departure_from(self.candidate.path, nodes, loop)
        )
        return replace(self, departure=found)

    @property
    def failure(self) -> str:
        """Why there is no plan, and what would help; empty if there is one."""
        if self.broken is None:
            return ""
        return f"{self.broken}; {self.remedy}" if self.remedy else str(self.broken)

    @property
    def remedy(self) -> str:
        """What would make the contour feasible, in words; empty if nothing is known to."""
        return "" if self.advice is None else str(self.advice)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JobResult:
    """The result of a job.

    Parameters
    ----------
    job : Job
    cuts : tuple of CutResult
        Every cut, in the order of cutting.
    mesh : (vertices, triangles)
        Mesh of the part, m, for pictures.
    cell : Cell or None
    part : PartPlan or None
        With [sequence]: the order and the moves between the cuts.
    stuck : NoFeasiblePath or None
        With [sequence]: why there is no order or no move.
    air : tuple of Check
        The audit of the moves.
    """

    job: Job
    cuts: tuple[CutResult, ...]
    mesh: tuple[Array, Ints]
    cell: Cell | None = None
    part: PartPlan | None = None
    stuck: NoFeasiblePath | None = None
    air: tuple[Check, ...] = ()

    __repr__ = short_repr

    @property
    def passed(self) -> bool:
        """True if every contour has a plan that passes its audit, and every move passes, too."""
        moves = self.stuck is None and all(check.ok for check in self.air)
        return moves and all(cut.passed for cut in self.cuts)

    def with_cuts(self, cuts: tuple[CutResult, ...]) -> JobResult:
        """Return the result with other results of its cuts, in the same order."""
        if self.part is None:
            return replace(self, cuts=cuts)
        plans = tuple(cut.plan for cut in cuts if cut.plan is not None)
        return replace(self, cuts=cuts, part=replace(self.part, plans=plans))

    @property
    def moves(self) -> tuple[TransferMove, ...]:
        """The moves between the cuts; none without [sequence], or if none were found."""
        return () if self.part is None else self.part.moves

    @property
    def plans(self) -> tuple[Plan, ...]:
        """The plans, in the order of cutting."""
        return tuple(cut.plan for cut in self.cuts if cut.plan is not None)


# -----------------------------------------------------------------------------
# One contour of a job: its plan or the plans of its pieces, and their audit.

_T = TypeVar("_T")
GraphOf = Callable[[Job, Contour, Callable[[int], None]], LayeredGraph]
"""Returns the graph of a job's nodes, and calls its third argument with counts of solved nodes."""


def _build(job: Job, nodes: Contour, solved: Callable[[int], None]) -> LayeredGraph:
    return job.graph(nodes, progress=solved)


def cut_candidate(
    prepared: PreparedJob,
    request: CutRequest,
    candidate: Candidate,
    progress: Progress,
    *,
    graph_of: GraphOf = _build,
) -> tuple[CutResult, ...]:
    """Plan and audit a candidate; return one cut, or one for each piece if it is interrupted.

    Plans are not certified yet, because one candidate is chosen first, and a cut without a plan
    has no advice yet, see `advised`. `graph_of` may return a graph that was kept.
    """
    options = replace(request.options, certify=None)
    job, cell = replace(prepared.job, options=options), prepared.cell
    name, total, done = request.task.name, len(candidate.nodes), 0

    def solved(count: int) -> None:
        nonlocal done
        done += count
        progress(name, done, total)

    def begin(what: str) -> None:
        progress(f"{name}: {what}", 0, 0)

    progress(name, 0, total)
    run, asked = request.run, request.task.asked(prepared.job.options)
    if not follows_courses(job.robot, asked):
        graph = graph_of(job, candidate.nodes, solved)
    elif run is None:
        return _cut_along_courses(replace(prepared, job=job), request, candidate, solved, begin)
    else:
        graph = graph_of_runs(
            candidate.nodes, job.setup_in(cell), asked, speed=candidate.speed, progress=solved
        )
    whole = _whole(job, request, candidate, graph, cell, begin)
    every, kept = graph, cell
    if run is not None:
        graph, kept = run.graph(graph, job.robot.endless), run.cell(cell)

    def planned(by: Callable[..., _T]) -> _T:
        return by(
            candidate.nodes, job.robot, tool=job.tool, placement=job.placement,
            speed=candidate.speed, options=_at_nodes(job), cell=kept, graph=graph, phase=begin,
        )  # fmt: skip

    def follow(run: Subproblem) -> Plan:
        return plan_run(
            run,
            candidate.nodes,
            job.setup_in(cell),
            job.options,
            speed=candidate.speed,
            graph=every,
            phase=begin,
        )

    try:
        try:
            plans: tuple[Plan, ...] = (planned(plan) if run is None else follow(run),)
        except NoFeasiblePath:
            if job.options.interruptions == "none" or not np.diff(graph.start).all():
                raise
            plans = planned(plan_in_pieces)
    except NoFeasiblePath as broken:
        return (replace(whole, broken=broken),)
    begin("audit")
    return tuple(_audited(prepared, whole, made) for made in plans)


def _whole(
    job: Job, request: CutRequest, candidate: Candidate, graph: LayeredGraph, cell: Cell | None,
    begin: Callable[[str], None],
) -> CutResult:  # fmt: skip
    """Return the cut of a candidate that has no plan yet, with the map of its cell if asked for."""
    clearance = None
    if cell is not None and job.cell is not None and job.cell.map:
        begin("map of the cell")
        clearance = clearance_map(graph, cell)
    return CutResult(request=request, candidate=candidate, graph=graph, clearance=clearance)


def _cut_along_courses(
    prepared: PreparedJob,
    request: CutRequest,
    candidate: Candidate,
    solved: Callable[[int], None],
    begin: Callable[[str], None],
) -> tuple[CutResult, ...]:
    """Plan and audit a candidate with external axes; its graph is along the course found."""
    job, cell, nodes = prepared.job, prepared.cell, candidate.nodes

    def planned(by: Callable[..., _T]) -> _T:
        return by(
            nodes, job.robot, tool=job.tool, placement=job.placement, speed=candidate.speed,
            options=_at_nodes(job), cell=cell, phase=begin,
        )  # fmt: skip

    try:
        try:
            plans: tuple[Plan, ...] = (planned(plan),)
        except NoFeasiblePath:
            if job.options.interruptions == "none":
                raise
            plans = planned(plan_in_pieces)
    except NoFeasiblePath as broken:
        try:
            graph = job.graph(nodes, progress=solved)
        except NoFeasiblePath:  # shown with the axes at rest
            graph = job.graph(nodes, external=course_of_plans(job, nodes, ()), progress=solved)
        whole = CutResult(request=request, candidate=candidate, graph=graph)
        return (replace(whole, broken=broken),)
    graph = job.graph(nodes, external=course_of_plans(job, nodes, plans), progress=solved)
    whole = _whole(job, request, candidate, graph, cell, begin)
    begin("audit")
    return tuple(_audited(prepared, whole, made) for made in plans)


def _at_nodes(job: Job) -> PlanOptions:
    """Return the options for planning at the nodes; limits between them are handled afterwards."""
    return replace(job.options, between_nodes="reported")


def course_of_plans(job: Job, nodes: Contour, plans: Sequence[Plan]) -> Array:
    """Return the free joints of plans at every node, (K, E) rad or m.

    At nodes without a plan they are at rest: at zero, or at the limit nearest to it.
    """
    limits, free = job.robot.joint_limits(), job.robot.free
    rest = np.clip(0.0, limits.lower[free], limits.upper[free])
    x = np.tile(rest, (len(nodes), 1))
    for made in plans:
        first = int(np.searchsorted(nodes.s, made.contour.s[0]))
        x[first : first + len(made.q)] = made.course
    return x


def cut_in_posture(prepared: PreparedJob, request: CutRequest, posture: int) -> CutResult | None:
    """Return a contour's first candidate cut in one posture; None where its audit fails.

    Raises
    ------
    NoFeasiblePath
        It cannot be cut in this posture.
    """
    candidate = request.candidates[0]
    job = replace(prepared.job, options=replace(request.options, postures=(posture,), certify=None))
    graph = job.graph(candidate.nodes)
    made = plan(
        candidate.nodes, job.robot, tool=job.tool, placement=job.placement, speed=candidate.speed,
        options=_at_nodes(job), cell=prepared.cell, graph=None if job.robot.free.size else graph,
    )  # fmt: skip
    cut = _audited(prepared, CutResult(request=request, candidate=candidate, graph=graph), made)
    return cut if cut.passed else None


def advised(prepared: PreparedJob, cut: CutResult, progress: Progress) -> CutResult:
    """Return a cut without a plan with advice on what would make it feasible, if that is known.

    The advice is to leave out windows of gamma, and a speed or shares of the limits that are
    enough. A lower speed helps if every node has poses. It need not help with periodic closure or
    a limited rotation of endless axes; a reduced feed has tried it already; and with torque or
    jerk limits it is not known. No speed is looked for in these cases.
    """
    options, graph = replace(cut.request.options, certify=None), cut.graph
    job, cell, run = replace(prepared.job, options=options), prepared.cell, cut.request.run
    if run is not None:
        graph, cell = run.graph(graph, job.robot.endless), run.cell(cell)
    plain = options.closure == "free" and options.rotation is None
    plain = plain and job.robot.dynamics.load is None and job.robot.limits.jerk is None
    constant = options.feed == "constant" and cut.candidate.nodes.time is None
    broken = cut.broken
    if broken is None:
        return cut
    progress(f"{cut.request.task.name}: looking for a remedy", 0, 0)
    if run is None and opens_without_windows(job, cut.request, cut.candidate, cell):
        cut = replace(cut, advice=Remedy(other_method=False, without_windows=True))
    if not (np.diff(graph.start).all() and plain and constant):
        return cut
    found = find_remedy(job, cut.request, cut.candidate, graph, cell, broken.relaxation)
    if found is None:
        return cut
    free = cut.advice is not None
    return replace(cut, advice=replace(found[0], without_windows=free), fastest=found[1])


def _audited(prepared: PreparedJob, whole: CutResult, made: Plan) -> CutResult:
    """Return the cut of one plan, at finer intervals if the job asks for them, and its audit."""
    job, candidate, graph = prepared.job, whole.candidate, whole.graph
    # All postures that the job allows; the search may have used only some of them.
    postures, between = job.options.postures, job.options.between_nodes
    settings = replace(made.settings, postures=postures, between_nodes=between)
    made = replace(made, settings=settings)
    s, nodes = made.contour.s, candidate.nodes
    if len(s) < len(nodes):
        first = int(np.searchsorted(nodes.s, s[0]))
        graph = graph.part(first, first + len(s) - 1)
        path = candidate.path.between(float(s[0]), float(s[-1]))
        candidate = Candidate.at(whole.request.task.speed, path, made.contour)
    if job.options.refine_parts > 1:
        made = _divided(made, candidate.path, job.options.refine_parts)
    kept = None if whole.picked else kept_between_nodes(job, made)
    made = made if kept is None else kept.plan
    checks = job.tolerances.checks(made, reference=candidate.path, cell=prepared.cell)
    checks += candidate.drawing_checks(made.contour, job.tolerances.path)
    cut = replace(whole, candidate=candidate, graph=graph, plan=made, checks=tuple(checks))
    return replace(cut, as_run=as_run(job, made, candidate.path, kept))


def _divided(made: Plan, path: Contour, parts: int) -> Plan:
    """Return the plan on nodes that divide its intervals, if one keeps the limits there."""
    found = refine(made, nodes=divide_nodes(path, made.contour, parts))
    if found.done:
        return found.plan
    statement = f"{made.proof.statement}; at {parts} parts of an interval {found.statement}"
    return replace(made, proof=replace(made.proof, statement=statement))


# -----------------------------------------------------------------------------
# The order in which the contours of a job are cut, and the transfer moves between them.


def order_cuts(
    prepared: PreparedJob,
    tried: Sequence[Sequence[tuple[CutResult, ...]]],
    progress: Progress,
) -> JobResult:
    """Return one cut (or its pieces) of each contour's candidates, in the requested order.

    The result has the moves between them if the job asks for moves and every contour has a plan.

    Parameters
    ----------
    prepared : PreparedJob
    tried : sequence of sequences of tuples of CutResult
        The result of each candidate of each contour: one cut, or its pieces.
    progress : callable
    """
    job = prepared.job
    result = JobResult(job=job, cuts=(), mesh=prepared.part.mesh(), cell=prepared.cell)
    passed = [[cuts for cuts in each if all(cut.passed for cut in cuts)] for each in tried]
    if job.sequence is None or not all(passed):
        first = [(fine or each)[0] for fine, each in zip(passed, tried, strict=True)]
        return replace(result, cuts=tuple(cut for cuts in first for cut in cuts))
    units, owner, before = _units(passed, prepared.inner_first)

    longest = longest_search(job.sequence.seconds)
    progress(f"order and moves, at most {longest:g} s without a solution", 0, 0)
    requests = [prepared.contours[i] for i in owner]
    # Picked plans and pieces are not planned in other postures.
    others = [
        () if r.run is not None or owner.count(i) > 1 else r.options.postures
        for r, i in zip(requests, owner, strict=True)
    ]
    try:
        part = order_candidates(
            units,
            _plan,
            lambda unit, posture: cut_in_posture(prepared, requests[unit], posture),
            others,
            progress=lambda unit, done, total: progress(
                f"{requests[unit].task.name}: other postures", done, total
            ),
            home=job.home,
            cell=prepared.cell,
            before=before,
            heat_spacing=job.sequence.heat_spacing_mm / 1000,
            given_order=job.sequence.order == "given",
            retract=job.program.retract,
            air_speed=job.program.air_speed or 1.0,
            approach_speed=job.program.approach_speed,
            pierce_time=job.program.pierce_time,
            seconds=job.sequence.seconds,
        )
    except NoFeasiblePath as stuck:
        return replace(result, cuts=tuple(unit[0] for unit in units), stuck=stuck)
    cuts = [
        replace(units[unit][candidate], plan=made)
        for (unit, candidate), made in zip(part.chosen, part.plans, strict=True)
    ]
    o = job.options
    audited = (
        transfer_checks(job.robot, m.q, m.time, cell=prepared.cell, eta_v=o.eta_v, eta_a=o.eta_a)
        for m in part.moves
    )
    return replace(result, cuts=tuple(cuts), part=part, air=tuple(worst_of(audited)))


def _units(
    passed: Sequence[Sequence[tuple[CutResult, ...]]], inner_first: Sequence[tuple[int, int]]
) -> tuple[list[list[CutResult]], list[int], list[tuple[int, int]]]:
    """Return the units to order, the contour of each, and the pairs in a required order.

    A unit is the candidates of a contour that are cut in one go, or a single piece.
    """
    units: list[list[CutResult]] = []
    owner: list[int] = []
    pieces: list[tuple[int, int]] = []
    for i, fine in enumerate(passed):
        whole = [cuts[0] for cuts in fine if len(cuts) == 1]
        new = [whole] if whole else [[piece] for piece in fine[0]]
        pieces += pairwise(range(len(units), len(units) + len(new)))
        units += new
        owner += [i] * len(new)
    members = [[u for u, i in enumerate(owner) if i == k] for k in range(len(passed))]
    inner = [(a, b) for i, j in inner_first for a in members[i] for b in members[j]]
    return units, owner, inner + pieces


def _plan(cut: CutResult) -> Plan:
    """Return the plan of a cut that has passed."""
    assert cut.plan is not None
    return cut.plan


# -----------------------------------------------------------------------------
# The run of a job: plan and audit every contour, and put them in order.


def run_job(job: Job, part: Part | None = None, *, progress: Progress = no_progress) -> JobResult:
    """Plan and audit every contour of a job.

    `part` is the part in its drawing, if that is read already. A contour without a feasible path
    does not stop the others; its result has the reason.

    Raises
    ------
    InputError
        The part cannot be read, a loop does not exist, or a contour cannot be sampled; or a fault
        is known before planning, such as a contour below the floor or a reserved name.
    """
    prepared = prepare(job, part)
    require_foreseen(prepared)
    return run_prepared(prepared, progress=progress)


def run_prepared(prepared: PreparedJob, *, progress: Progress = no_progress) -> JobResult:
    """Plan and audit every contour of a prepared job, in the order of its contours.

    Its contours replace those of the job: a touch-up has other paths in them, a plan picked from
    a Pareto set has other options.
    """
    tried = [
        [
            tuple(
                advised(prepared, cut, progress)
                for cut in cut_candidate(prepared, contour, candidate, progress)
            )
            for candidate in contour.candidates
        ]
        for contour in prepared.contours
    ]
    result = order_cuts(prepared, tried, progress)
    cuts = tuple(certified(cut, progress) for cut in result.cuts)
    return measured(prepared, result.with_cuts(cuts))


def measured(prepared: PreparedJob, result: JobResult) -> JobResult:
    """Return the result with the departures of its nodes from the CAD curves."""
    part = prepared.part
    moved = {
        contour.task.name: part.departure(contour.task.pick, contour.loop)
        for contour in prepared.contours
        if contour.leaves_the_loop
    }
    return replace(
        result, cuts=tuple(cut.measured(part, moved.get(cut.contour)) for cut in result.cuts)
    )


def certified(cut: CutResult, progress: Progress) -> CutResult:
    """Return a cut with the bound of its plan, if one is asked for.

    The bound is audited if plan.json is to keep its certificate.
    """
    asked = cut.request.options.certify
    if cut.plan is None or asked is None:
        return cut

    def named(what: str, done: int, total: int, /) -> None:
        share = f", {100 * done // total} %" if total else ""
        progress(f"{cut.name}: {what}{share}", 0, 0)

    made = with_bound(cut.plan, asked, progress=named)
    if not asked.keep:
        return replace(cut, plan=made)
    named("audit of the certificate", 0, 0)
    return replace(cut, plan=made, checks=(*cut.checks, *bound_checks(made)))
