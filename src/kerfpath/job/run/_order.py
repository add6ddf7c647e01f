"""The order in which the contours of a job are cut, and the transfer moves between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from kerfpath.auditor import transfer_checks, worst_of
from kerfpath.errors import NoFeasiblePath
from kerfpath.job.format import PreparedJob
from kerfpath.job.run._contour import cut_in_posture
from kerfpath.job.run._result import CutResult, JobResult
from kerfpath.plans import Plan
from kerfpath.progress import Progress
from kerfpath.sequence import longest_search, order_candidates

__all__ = ["order_cuts"]


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
