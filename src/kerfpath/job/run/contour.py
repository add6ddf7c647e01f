"""One contour of a job: its plan or the plans of its pieces, and their audit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar

import numpy as np

from kerfpath.arrays import Array
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.front import Subproblem, follows_courses, graph_of_runs, plan_run
from kerfpath.graph import LayeredGraph
from kerfpath.job.as_run import as_programmed, kept_between_nodes
from kerfpath.job.format import Candidate, CutRequest, Job, PreparedJob, divide_nodes
from kerfpath.job.run.remedy import Remedy, find_remedy, move_into_reach, opens_without_windows
from kerfpath.job.run.results import CutResult
from kerfpath.options import PlanOptions
from kerfpath.planner import (
    best_motion,
    clearance_map,
    plan,
    plan_in_pieces,
)
from kerfpath.plans import Plan
from kerfpath.progress import (
    Progress,
    StopEarly,
    may_stop,
    no_progress,
    shown_by,
    unstopped,
)
from kerfpath.refiner import refine
from kerfpath.sequence import are_many

_T = TypeVar("_T")
GraphOf = Callable[[Job, Contour, Callable[[int], None]], LayeredGraph]
"""Returns the graph of a job's nodes, and calls its third argument with counts of solved nodes."""


def cut_candidate(
    prepared: PreparedJob,
    request: CutRequest,
    candidate: Candidate,
    progress: Progress,
    *,
    graph_of: GraphOf | None = None,
) -> tuple[CutResult, ...]:
    """Plan and audit a candidate; return one cut, or one for each piece if it is interrupted.

    Plans are not certified yet, because one candidate is chosen first, and a cut without a plan
    has no advice yet, see `advised`. `graph_of` may return a graph that was kept; by default the
    joints that a plan folds are folded in it.
    """
    cuts = plan_candidate(prepared, request, candidate, progress, graph_of=graph_of)
    return tuple(audited(prepared, cut, progress) for cut in cuts)


def plan_candidate(
    prepared: PreparedJob,
    request: CutRequest,
    candidate: Candidate,
    progress: Progress,
    *,
    graph_of: GraphOf | None = None,
) -> tuple[CutResult, ...]:
    """Plan a candidate as `cut_candidate` does; a plan in one piece is not audited yet.

    Its limits between the nodes are kept with the audit, which takes longer than the plan: that is
    for the chosen candidates alone, see `audited`.
    """
    options = replace(request.options, certify=None)
    job, cell = replace(prepared.job, options=options), prepared.cell
    name = phase = request.task.name

    def begin(what: str) -> None:
        nonlocal phase
        phase = f"{name}: {what}"
        progress(phase, 0, 0)

    def show(done: int, total: int) -> None:
        progress(phase, done, total)

    solved = _counting(name, len(candidate.nodes), progress)
    run, asked = request.run, request.task.asked(prepared.job.options)
    if not follows_courses(job.robot, asked):
        folded_at = None if run is not None else candidate.dt
        graph = (
            job.graph(candidate.nodes, folded_at=folded_at, progress=solved)
            if graph_of is None
            else graph_of(job, candidate.nodes, solved)
        )
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
            with shown_by(show):
                plans: tuple[Plan, ...] = (planned(plan) if run is None else follow(run),)
        except NoFeasiblePath:
            if job.options.interruptions == "none" or not graph.has_poses_throughout:
                raise
            plans = planned(plan_in_pieces)
    except NoFeasiblePath as broken:
        return (replace(whole, broken=broken),)
    return _cuts_of(prepared, whole, plans, begin)


def _counting(what: str, total: int, progress: Progress) -> Callable[[int], None]:
    """Return what is called with counts of solved nodes, and shows how many of all are done."""
    done = 0

    def solved(count: int) -> None:
        nonlocal done
        may_stop()
        done += count
        progress(what, done, total)

    progress(what, 0, total)
    return solved


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
    return _cuts_of(prepared, whole, plans, begin)


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


def cut_in_posture(
    prepared: PreparedJob, cut: CutResult, posture: int, *, quick: bool
) -> CutResult | None:
    """Return the candidate of a cut with a plan cut in one posture; None where its audit fails.

    If `quick`, it is given up where it would be planned on the grid, and not audited until it is
    `settled`; of very many contours no wider searches follow.

    Raises
    ------
    NoFeasiblePath
        It cannot be cut in this posture.
    """
    request, candidate = cut.request, cut.candidate
    job = replace(prepared.job, options=replace(request.options, postures=(posture,), certify=None))
    graph = job.graph(candidate.nodes) if job.robot.free.size else cut.graph.in_postures((posture,))
    if quick and job.options.method == "continuous":
        made = best_motion(
            candidate.nodes, job.setup_in(prepared.cell), _at_nodes(job), speed=candidate.speed,
            graph=graph, thorough=not are_many(len(prepared.contours)),
        )  # fmt: skip
    else:
        made = plan(
            candidate.nodes, job.robot, tool=job.tool, placement=job.placement,
            speed=candidate.speed, options=_at_nodes(job), cell=prepared.cell,
            graph=None if job.robot.free.size else graph,
        )  # fmt: skip
    other = _without_plan(cut)
    if job.robot.free.size:
        other = CutResult(request=request, candidate=candidate, graph=graph)
    if quick:
        return replace(other, plan=made)
    other = _audited(prepared.job, prepared.cell, other, made)
    return other if other.passed else None


def unplanned(
    prepared: PreparedJob, request: CutRequest, candidate: Candidate, progress: Progress
) -> CutResult:
    """Return the cut of a candidate without a plan, with its graph of all postures.

    The robot has no free joints.
    """
    solved = _counting(request.task.name, len(candidate.nodes), progress)
    job = replace(prepared.job, options=replace(request.options, certify=None))
    graph = job.graph(candidate.nodes, folded_at=candidate.dt, progress=solved)
    return _whole(
        job, request, candidate, graph, prepared.cell,
        lambda what: progress(f"{request.task.name}: {what}", 0, 0),
    )  # fmt: skip


def _without_plan(cut: CutResult) -> CutResult:
    """Return a cut with no plan; its graph has all postures that the job allows, for the report."""
    return CutResult(
        request=cut.request, candidate=cut.candidate, graph=cut.graph, clearance=cut.clearance
    )


def cut_as_before(
    prepared: PreparedJob, request: CutRequest, made: Plan, progress: Progress, *, picked: bool
) -> CutResult:
    """Return the cut of a contour with the motion of an earlier run, and its audit."""
    candidate, name = request.candidates[0], request.task.name
    job = replace(prepared.job, options=replace(request.options, certify=None))
    external = None
    if follows_courses(job.robot, request.task.asked(prepared.job.options)):
        external = course_of_plans(job, candidate.nodes, [made])
    progress(f"{name}: kept", 0, 0)
    graph = job.graph(candidate.nodes, external=external)
    whole = _whole(
        job, request, candidate, graph, prepared.cell,
        lambda what: progress(f"{name}: {what}", 0, 0),
    )  # fmt: skip
    cut = with_checks(
        job, prepared.cell, replace(whole, kept="picked" if picked else "planned"), made
    )
    return replace(cut, as_run=as_programmed(prepared.job, made, candidate.path, prepared.cell))


def moved_into_reach(prepared: PreparedJob, cuts: Sequence[CutResult]) -> dict[str, Remedy]:
    """Return the advice to move the part, by contour, for cuts that have nodes without poses."""
    far = {cut.contour: cut.request for cut in cuts if cut.lacks_poses and cut.advice is None}
    if not far:
        return {}
    every = sorted(prepared.contours, key=lambda each: each.task.name not in far)
    nodes = [(each.candidates[0].nodes, each.options) for each in every]
    move = move_into_reach(prepared.job, nodes)
    return dict.fromkeys(far, Remedy(other_method=False, move=move)) if move else {}


def audited(prepared: PreparedJob, cut: CutResult, progress: Progress = no_progress) -> CutResult:
    """Return a cut with its audit, the limits between its nodes kept if the job asks for that.

    It is finished even if the searches are to end early. Without a plan, or with an audit, the cut
    is returned as it is.
    """
    if cut.plan is None or cut.audited:
        return cut
    progress(f"{cut.request.task.name}: audit", 0, 0)
    return audited_in(prepared.job, prepared.cell, cut)


def audited_in(job: Job, cell: Cell | None, cut: CutResult) -> CutResult:
    """Return a cut with its audit as `audited` does, by the job and its cell alone."""
    if cut.plan is None or cut.audited:
        return cut
    with unstopped():
        return _audited(job, cell, _without_plan(cut), cut.plan)


def advised(prepared: PreparedJob, cut: CutResult, progress: Progress) -> CutResult:
    """Return a cut without a plan with advice on what would make it feasible, if that is known.

    The advice is to leave out windows of gamma, and a speed or shares of the limits that are
    enough; where nodes have no pose, see `moved_into_reach`. A lower speed helps if every node has
    poses. It need not help with periodic closure or a limited rotation of endless axes; a reduced
    feed has tried it already; and with torque or jerk limits it is not known. No speed is looked
    for in these cases.
    """
    options, graph = replace(cut.request.options, certify=None), cut.graph
    job, cell, run = replace(prepared.job, options=options), prepared.cell, cut.request.run
    if run is not None:
        graph, cell = run.graph(graph, job.robot.endless), run.cell(cell)
    plain = options.closure == "free" and options.rotation is None
    plain = plain and job.robot.dynamics.load is None and job.robot.limits.jerk is None
    constant = options.feed == "constant"
    broken = cut.broken
    if broken is None:
        return cut
    with suppress(StopEarly):
        progress(f"{cut.request.task.name}: looking for a remedy", 0, 0)
        if run is None and opens_without_windows(job, cut.request, cut.candidate, cell):
            cut = replace(cut, advice=Remedy(other_method=False, without_windows=True))
        if not (graph.has_poses_throughout and plain and constant):
            return cut
        found = find_remedy(job, cut.request, cut.candidate, graph, cell, broken.relaxation)
        if found is not None:
            free = cut.advice is not None
            advice = replace(found[0], without_windows=free)
            cut = replace(cut, advice=advice, fastest=found[1])
    return cut


def _cuts_of(
    prepared: PreparedJob, whole: CutResult, plans: Sequence[Plan], begin: Callable[[str], None]
) -> tuple[CutResult, ...]:
    """Return the cut of the plan of a contour, or of each of its pieces, which are audited."""
    if len(plans) == 1:
        return (replace(whole, plan=plans[0]),)
    begin("audit")
    with unstopped():
        return tuple(_audited(prepared.job, prepared.cell, whole, made) for made in plans)


def _audited(job: Job, cell: Cell | None, whole: CutResult, made: Plan) -> CutResult:
    """Return the cut of one plan, at finer intervals if the job asks for them, and its audit."""
    candidate, graph = whole.candidate, whole.graph
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
    cut = with_checks(job, cell, replace(whole, candidate=candidate, graph=graph), made)
    return replace(cut, as_run=as_programmed(job, made, candidate.path, cell, kept))


def with_checks(job: Job, cell: Cell | None, cut: CutResult, made: Plan) -> CutResult:
    """Return a cut with a plan and the audit of that plan; how it runs is not looked at again."""
    tolerances, candidate = job.tolerances, cut.candidate
    checks = tolerances.checks(made, reference=candidate.path, cell=cell)
    checks += candidate.drawing_checks(made.contour, tolerances.path)
    return replace(cut, plan=made, checks=tuple(checks))


def _divided(made: Plan, path: Contour, parts: int) -> Plan:
    """Return the plan on nodes that divide its intervals, if one keeps the limits there."""
    found = refine(made, nodes=divide_nodes(path, made.contour, parts))
    if found.done:
        return found.plan
    claim = f"at {parts} parts of an interval {found.statement}"
    return replace(made, proof=made.proof.also(claim))
