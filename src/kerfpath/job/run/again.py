"""A job that is run again: some contours are planned anew, the others keep their motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from kerfpath.arrays import Array
from kerfpath.auditor import Check, transfer_checks, worst_of
from kerfpath.errors import NoFeasiblePath
from kerfpath.job.format import CutRequest, PreparedJob
from kerfpath.job.run.contour import advised, audited, plan_candidate
from kerfpath.job.run.job import finished
from kerfpath.job.run.results import CutResult, JobResult
from kerfpath.planner import turned
from kerfpath.plans import Plan, TransferMove
from kerfpath.progress import Progress
from kerfpath.sequence import on_turns_of, rejoined


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
