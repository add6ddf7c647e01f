"""The run of a job: plan and audit every contour, and put them in order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from kerfpath.arrays import Array
from kerfpath.auditor import Check, bound_checks, transfer_checks, worst_of
from kerfpath.cad import Part
from kerfpath.certifier import SharedWork
from kerfpath.crew import ALONE, Crew
from kerfpath.effort import thread_count
from kerfpath.errors import NoFeasiblePath
from kerfpath.job.format import Candidate, CutRequest, Job, PreparedJob, prepare
from kerfpath.job.run.contour import (
    advised,
    audited,
    audited_in,
    cut_in_posture,
    moved_into_reach,
    plan_candidate,
    unplanned,
    with_checks,
)
from kerfpath.job.run.foresee import both_sides, require_foreseen
from kerfpath.job.run.remedy import Remedy
from kerfpath.job.run.results import CutResult, JobResult
from kerfpath.planner import turned, with_bound
from kerfpath.plans import Plan, TransferMove
from kerfpath.progress import Progress, StopEarly, may_stop, no_progress, unstopped
from kerfpath.sequence import (
    PlannedCuts,
    are_many,
    cheapest_posture,
    common_postures,
    effort_for,
    on_turns_of,
    order_candidates,
    rejoined,
)

# -----------------------------------------------------------------------------
# The order in which the contours of a job are cut, and the transfer moves between them.


def order_cuts(
    prepared: PreparedJob,
    tried: Sequence[Sequence[tuple[CutResult, ...]]],
    progress: Progress,
    crew: Crew = ALONE,
) -> JobResult:
    """Return one cut (or its pieces) of each contour's candidates, in the requested order.

    The result has the moves between them if the job asks for moves and every contour has a plan, or
    the job accepts a program without the others. Cuts without a path are the last ones.

    Parameters
    ----------
    prepared : PreparedJob
    tried : sequence of sequences of tuples of CutResult
        The result of each candidate of each contour: one cut, or its pieces. Plans that are not
        audited yet are once they are chosen. Contours at the end may lack: they are not planned,
        and there is no order.
    progress : callable
    crew : Crew, optional
        Processes that share the audits.
    """
    job = prepared.job
    result = JobResult(job=job, cuts=(), mesh=prepared.part.mesh(), cell=prepared.cell)
    passed = [[cuts for cuts in each if all(cut.may_pass for cut in cuts)] for each in tried]
    missing = [
        each[0][0]
        for fine, each in zip(passed, tried, strict=True)
        if not fine and all(cut.broken is not None for cuts in each for cut in cuts)
    ]
    complete = all(passed) or (
        job.accepts_incomplete and 0 < sum(map(bool, passed)) == len(passed) - len(missing)
    )
    left = tuple(request.task.name for request in prepared.contours[len(tried) :])
    if job.sequence is None or left or not complete:
        first = (_first_that_passes(prepared, each, progress) for each in tried)
        every = tuple(cut for cuts in first for cut in cuts)
        return replace(result, cuts=every, not_planned=left)
    units, owner, before = _units(passed, prepared.inner_first)

    requests = [prepared.contours[i] for i in owner]
    # Picked plans and pieces are not planned in other postures.
    others = [
        () if r.run is not None or owner.count(i) > 1 else r.options.postures
        for r, i in zip(requests, owner, strict=True)
    ]
    served = [
        () if r.run is not None or owner.count(i) > 1 or job.robot.free.size
        else units[u][0].graph.postures_throughout.tolist()
        for u, (r, i) in enumerate(zip(requests, owner, strict=True))
    ]  # fmt: skip
    planned = [[int(_plan(one).posture[0]) for one in unit] for unit in units]

    def in_given_order(stuck: NoFeasiblePath) -> JobResult:
        every = [[(one,) for one in unit] or tried[i] for unit, i in zip(units, owner, strict=True)]
        first = (_first_that_passes(prepared, each, progress) for each in every)
        cuts = tuple(cut for cuts in first for cut in cuts)
        # A contour without a plan that passes is a failure of its own.
        return replace(result, cuts=(*cuts, *missing), stuck=stuck if all(units) else None)

    try:
        part = order_candidates(
            units,
            _JobCuts(prepared, units, crew, progress),
            others,
            common_postures(served, others, planned),
            progress=progress,
            home=job.home,
            cell=prepared.cell,
            before=before,
            heat_spacing=job.sequence.heat_spacing_mm / 1000,
            heat_time=job.sequence.heat_time_s,
            given_order=job.sequence.order == "given",
            retract=job.program.retract,
            air_speed=job.program.air_speed or 1.0,
            approach_speed=job.program.approach_speed,
            pierce_time=job.program.pierce_times([r.task.name for r in requests]),
            seconds=job.sequence.seconds,
            turns_within=job.turns_within,
        )
    except StopEarly:
        said = "stopped before an order was found"
        return in_given_order(NoFeasiblePath(said, proved=False, node=-1))
    except NoFeasiblePath as stuck:
        return in_given_order(stuck)
    chosen = [units[unit][candidate] for unit, candidate in part.chosen]
    cuts = [_as_ordered(prepared, *each) for each in zip(chosen, part.plans, strict=True)]
    o = job.options
    rows = (
        transfer_checks(job.robot, m.q, m.time, cell=prepared.cell, eta_v=o.eta_v, eta_a=o.eta_a)
        for m in part.moves
    )
    return replace(result, cuts=(*cuts, *missing), part=part, air=tuple(worst_of(rows)))


class _JobCuts(PlannedCuts[CutResult]):
    """How the cuts of a job are planned for an order; numbers of contours are those of units."""

    def __init__(
        self,
        prepared: PreparedJob,
        units: Sequence[Sequence[CutResult]],
        crew: Crew,
        progress: Progress,
    ) -> None:
        self._prepared, self._crew, self._progress = prepared, crew, progress
        self._first = [unit[0] for unit in units]

    def plan_of(self, one: CutResult) -> Plan:
        return _plan(one)

    def in_posture(self, contour: int, posture: int, *, quick: bool) -> CutResult | None:
        return cut_in_posture(self._prepared, self._first[contour], posture, quick=quick)

    def with_plan(self, one: CutResult, plan: Plan) -> CutResult | None:
        is_whole = len(plan.q) == len(one.candidate.nodes)  # its intervals are not divided
        return replace(one, plan=plan, checks=()) if is_whole else None

    def settled(self, ones: Sequence[CutResult]) -> list[CutResult | None]:
        found = self._crew.each(
            partial(audited_in, self._prepared.job, self._prepared.cell),
            ones,
            lambda one: self._progress(f"{one.request.task.name}: audit", 0, 0),
        )
        return [done if done.passed else None for done in found]


def _first_that_passes(
    prepared: PreparedJob, candidates: Sequence[tuple[CutResult, ...]], progress: Progress
) -> tuple[CutResult, ...]:
    """Return the cuts of the first candidate that pass their audit, else those of the first one.

    They are audited even if the searches are to end early.
    """
    done = list[tuple[CutResult, ...]]()
    with unstopped():
        for cuts in candidates:
            done.append(tuple(audited(prepared, cut, progress) for cut in cuts))
            if all(cut.passed for cut in done[-1]):
                return done[-1]
    return done[0]


def _units(
    passed: Sequence[Sequence[tuple[CutResult, ...]]], inner_first: Sequence[tuple[int, int]]
) -> tuple[list[list[CutResult]], list[int], list[tuple[int, int]]]:
    """Return the units to order, the contour of each, and the pairs in a required order.

    A unit is the candidates of a contour that are cut in one go, or a single piece. A contour
    without any has no unit.
    """
    units: list[list[CutResult]] = []
    owner: list[int] = []
    pieces: list[tuple[int, int]] = []
    for i, fine in enumerate(passed):
        whole = [cuts[0] for cuts in fine if len(cuts) == 1]
        new = [whole] if whole else [[piece] for piece in (fine[0] if fine else ())]
        pieces += pairwise(range(len(units), len(units) + len(new)))
        units += new
        owner += [i] * len(new)
    members = [[u for u, i in enumerate(owner) if i == k] for k in range(len(passed))]
    inner = [(a, b) for i, j in inner_first for a in members[i] for b in members[j]]
    return units, owner, inner + pieces


def _as_ordered(prepared: PreparedJob, cut: CutResult, made: Plan) -> CutResult:
    """Return a cut with its plan on the turns that the order has chosen.

    It is audited again only if joints with limits are on other turns, where their margins differ.
    """
    limited = ~made.robot.endless
    if np.array_equal(made.q[:, limited], _plan(cut).q[:, limited]):
        return replace(cut, plan=made)
    return with_checks(prepared.job, prepared.cell, cut, made)


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
    a Pareto set has other options. Where a check of `progress.stopped_by` raises `StopEarly`, the
    result has the plans found by then, and names the contours that are not planned.
    """

    def stoppable(what: str, done: int, total: int, /) -> None:
        may_stop()
        progress(what, done, total)

    with _crew_of(prepared) as crew:
        return _run_by(crew, prepared, progress, stoppable)


def _crew_of(prepared: PreparedJob) -> Crew:
    """Return processes beside this one for very many contours, with a thread each.

    There are none with a cell, which cannot be sent to them.
    """
    share = are_many(len(prepared.contours)) and prepared.cell is None
    return Crew(thread_count() - 1 if share else 0, __name__)


def _run_by(
    crew: Crew, prepared: PreparedJob, progress: Progress, stoppable: Progress
) -> JobResult:
    """Plan and audit every contour of a prepared job as `run_prepared` does."""
    tried, count = list[list[tuple[CutResult, ...]]](), len(prepared.contours)
    with suppress(StopEarly), effort_for(count):
        posture = _posture_of_all(prepared, stoppable)
        for contour in prepared.contours:
            may_stop()
            if count > 1:
                progress("contours", len(tried), count)
            found = [_planned(prepared, contour, c, posture, progress) for c in contour.candidates]
            tried.append(
                [tuple(advised(prepared, cut, progress) for cut in cuts) for cuts in found]
            )
    with effort_for(count):
        result = order_cuts(prepared, tried, stoppable, crew)
    return finished(prepared, result, stoppable, crew)


def _posture_of_all(prepared: PreparedJob, progress: Progress) -> int | None:
    """Return the posture in which all contours are planned first if they are very many, else None.

    The order of cutting keeps to one posture nearly throughout, as changes of it take long.
    """
    job, requests = prepared.job, prepared.contours
    if not (are_many(len(requests)) and job.sequence is not None) or job.robot.free.size:
        return None
    if job.options.method != "continuous" or any(each.run is not None for each in requests):
        return None
    cuts = dict[int, CutResult]()

    def cost(contour: int, posture: int) -> float:
        progress("choosing the posture", posture, job.robot.postures)
        request = requests[contour]
        if contour not in cuts:
            cuts[contour] = unplanned(prepared, request, request.candidates[0], no_progress)
        cut = cuts[contour]
        if posture in cut.graph.postures_throughout:
            with suppress(NoFeasiblePath):
                found = cut_in_posture(prepared, cut, posture, quick=True)
                return np.inf if found is None else _plan(found).cost
        return np.inf

    wanted = [request.options.postures for request in requests]
    return cheapest_posture(len(requests), wanted, job.robot.postures, cost)


def _planned(
    prepared: PreparedJob,
    request: CutRequest,
    candidate: Candidate,
    posture: int | None,
    progress: Progress,
) -> tuple[CutResult, ...]:
    """Plan a candidate in the posture of all contours where that is possible, else in any.

    Without a posture of all, it is planned in its best one.
    """
    asked = request.options.postures
    if posture is None or not (asked is None or posture in asked):
        return plan_candidate(prepared, request, candidate, progress)
    cut = unplanned(prepared, request, candidate, progress)
    if posture in cut.graph.postures_throughout:
        with suppress(NoFeasiblePath):
            found = cut_in_posture(prepared, cut, posture, quick=True)
            if found is not None:
                return (found,)
    return plan_candidate(prepared, request, candidate, progress, graph_of=lambda *_: cut.graph)


def finished(
    prepared: PreparedJob, result: JobResult, progress: Progress, crew: Crew = ALONE
) -> JobResult:
    """Return the result with bounds, advice, warnings, and the departures of its nodes.

    Processes of a `crew` share the bounds.
    """
    if are_many(len(result.cuts)):
        nodes = [len(plan.q) for plan in result.plans]

        def begin(cut: CutResult) -> None:
            with suppress(StopEarly):  # the bound itself ends early, and says so
                progress(f"{cut.name}: certificate", 0, 0)

        cuts = tuple(crew.each(partial(_certified_alone, nodes), result.cuts, begin))
    else:
        work = shared_work(result.cuts)
        cuts = tuple(certified(cut, progress, work) for cut in result.cuts)
    moves = dict[str, Remedy]()
    with suppress(StopEarly):
        moves = moved_into_reach(prepared, cuts)
    cuts = tuple(
        replace(cut, advice=moves[cut.contour]) if cut.contour in moves else cut for cut in cuts
    )
    doubts = both_sides(prepared.part, [each.task.pick for each in prepared.contours])
    return measured(prepared, replace(result.with_cuts(cuts), doubts=tuple(doubts)))


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


def shared_work(cuts: Sequence[CutResult]) -> SharedWork:
    """Return the work that the bounds of a job's cuts share."""
    asked = [cut for cut in cuts if cut.request.options.certify and not cut.kept]
    return SharedWork([len(cut.plan.q) for cut in asked if cut.plan is not None])


def _certified_alone(nodes: Sequence[int], cut: CutResult) -> CutResult:
    """Return a cut with its bound, of an equal share of the work of plans of so many `nodes`.

    What others leave of theirs is not used, so that the order does not matter.
    """
    return certified(cut, no_progress, SharedWork(nodes))


def certified(cut: CutResult, progress: Progress, work: SharedWork | None = None) -> CutResult:
    """Return a cut with the bound of its plan, if one is asked for; a motion that is kept has one.

    Its `work` may be shared with the bounds of other cuts. It is audited if plan.json is to keep
    its certificate.
    """
    asked = cut.request.options.certify
    if cut.plan is None or asked is None:
        return cut

    def named(what: str, done: int, total: int, /) -> None:
        share = f", {100 * done // total} %" if total else ""
        progress(f"{cut.name}: {what}{share}", 0, 0)

    made = cut.plan if cut.kept else with_bound(cut.plan, asked, work=work, progress=named)
    if not asked.keep:
        return replace(cut, plan=made)
    named("audit of the certificate", 0, 0)
    return replace(cut, plan=made, checks=(*cut.checks, *bound_checks(made)))


# -----------------------------------------------------------------------------
# A job that is run again: some contours are planned anew, the others keep their motions.


def run_again(
    prepared: PreparedJob,
    before: Sequence[Plan],
    moves: Sequence[TransferMove],
    kept: Mapping[str, CutResult],
    progress: Progress,
) -> JobResult:
    """Plan the contours of a job again that do not keep the motion that they had.

    The order stays. A contour that is planned again is turned about the beam for short moves from
    and to its neighbours, and is on the turns that it was on. Moves between motions that are kept
    are kept, too, if they pass their audit.

    Parameters
    ----------
    prepared : PreparedJob
        Its contours, with one candidate each, in the order of cutting.
    before : sequence of Plan
        The plan that each contour had.
    moves : sequence of TransferMove
        The moves that were between them; none if there were none.
    kept : mapping of str to CutResult
        The cuts that keep their motion, by contour.
    progress : callable
    """
    job, cuts = prepared.job, list[CutResult]()
    for i, request in enumerate(prepared.contours):
        progress("contours", i, len(before))
        if request.task.name in kept:
            cuts.append(kept[request.task.name])
            continue
        found = cuts[-1].plan if cuts else None
        behind = job.home if not cuts else before[i - 1].q[-1] if found is None else found.q[-1]
        ahead = before[i + 1].q[0] if i + 1 < len(before) else job.home
        cuts.append(_planned_again(prepared, request, before[i], behind, ahead, progress))
    result = JobResult(job=job, cuts=tuple(cuts), mesh=prepared.part.mesh(), cell=prepared.cell)
    have = [cut.plan for cut in cuts if cut.plan is not None]
    complete = len(have) == len(cuts) or (job.accepts_incomplete and have)
    if job.sequence is not None and complete:
        same = moves if len(have) == len(cuts) else ()
        try:
            result = _with_moves(prepared, result, same, job.sequence.seconds)
        except NoFeasiblePath as stuck:
            result = replace(result, stuck=stuck)
    return finished(prepared, result, progress)


def _planned_again(
    prepared: PreparedJob,
    request: CutRequest,
    was: Plan,
    behind: Array | None,
    ahead: Array | None,
    progress: Progress,
) -> CutResult:
    """Return the cut of a contour that is planned again, turned towards joints (n,) rad.

    They are those that the tool comes from and goes to; None where that is not known.
    """
    (cut,) = plan_candidate(prepared, request, request.candidates[0], progress)
    cut = advised(prepared, cut, progress)
    if cut.plan is None:
        return cut
    ends = [q for q in (behind, ahead) if q is not None]
    other = turned(cut.plan, ends[0], ends[-1], prepared.cell) if ends else None
    for made in (other, cut.plan):
        if made is not None:
            done = replace(cut, plan=on_turns_of(made, was))
            done = audited(prepared, done, progress)
            if done.passed:
                break
    return done


def _with_moves(
    prepared: PreparedJob, result: JobResult, moves: Sequence[TransferMove], seconds: float
) -> JobResult:
    """Return the result with the moves between its cuts; those between kept ones are kept.

    `seconds` (s) is the time limit of each search for a way around.

    Raises
    ------
    NoFeasiblePath
        There is no way between two cuts.
    """
    job, cell = prepared.job, prepared.cell
    cuts = [cut for cut in result.cuts if cut.plan is not None]
    still = [bool(cut.kept) for cut in cuts]
    if job.home is not None:
        still = [True, *still, True]

    def checks(move: TransferMove) -> list[Check]:
        o = job.options
        return transfer_checks(
            job.robot, move.q, move.time, cell=cell, eta_v=o.eta_v, eta_a=o.eta_a
        )

    same = len(moves) == len(still) - 1
    usable = {
        k: move
        for k, move in enumerate(moves if same else ())
        if still[k] and still[k + 1] and all(row.ok for row in checks(move))
    }
    part = rejoined(
        result.plans,
        usable,
        home=job.home,
        cell=cell,
        retract=job.program.retract,
        air_speed=job.program.air_speed or 1.0,
        approach_speed=job.program.approach_speed,
        pierce_time=job.program.pierce_times([cut.name for cut in cuts]),
        seconds=seconds,
    )
    return replace(result, part=part, air=tuple(worst_of(map(checks, part.moves))))
