"""The order in which the cuts of a job are made, and the moves through the air between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from kerfpath._told import told
from kerfpath.auditor import Check, air_checks, worst_of
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.job.format import Job
from kerfpath.job.run._cut import Cut
from kerfpath.plans import Plan
from kerfpath.sequence import PartPlan, inner_first, order_plans

__all__ = ["Ordered", "ordered"]

Tries = Sequence[tuple[Cut, ...]]
"""What came of each candidate of a contour: one cut, or its pieces."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ordered:
    """The cuts that are made, in order, and how the robot gets from one to the next.

    Parameters
    ----------
    cuts : tuple of Cut
    part : PartPlan or None
        The moves between them; None where the job asks for none, or a contour has no plan.
    stuck : NoFeasiblePath or None
        Why there is no order, or no way between two cuts.
    air : tuple of Check
        The audit of the moves, the worst of each check.
    """

    cuts: tuple[Cut, ...]
    part: PartPlan | None = None
    stuck: NoFeasiblePath | None = None
    air: tuple[Check, ...] = ()

    __repr__ = told


def ordered(
    job: Job,
    loops: Sequence[Contour],
    tries: Sequence[Tries],
    cell: Cell | None,
    more: Callable[[int, Sequence[Cut]], Sequence[Cut]],
) -> Ordered:
    """Return one cut (or its pieces) of each contour's candidates, in the order asked for.

    Parameters
    ----------
    job : Job
    loops : sequence of Contour
        The loops as drawn, one for each contour.
    tries : sequence of sequences of tuples of Cut
        What came of the candidates of each.
    cell : Cell or None
    more : callable
        Given the number of a contour and its cuts, further ones in other postures; asked where
        there is no way to those.
    """
    good = [[cuts for cuts in each if all(cut.passed for cut in cuts)] for each in tries]
    if job.sequence is None or not all(good):
        first = [(fine or each)[0] for fine, each in zip(good, tries, strict=True)]
        return Ordered(cuts=tuple(cut for cuts in first for cut in cuts))
    units: list[list[Cut]] = []
    owner: list[int] = []
    pieces: list[tuple[int, int]] = []
    for i, fine in enumerate(good):
        whole = [cuts[0] for cuts in fine if len(cuts) == 1]
        new = [whole] if whole else [[piece] for piece in fine[0]]
        pieces += pairwise(range(len(units), len(units) + len(new)))
        units += new
        owner += [i] * len(new)
    inner = inner_first(loops) if job.sequence.inner_first else []
    members = [[u for u, i in enumerate(owner) if i == k] for k in range(len(loops))]
    before = [(a, b) for i, j in inner for a in members[i] for b in members[j]]
    home = job.sequence.home_deg

    def further(unit: int) -> list[Plan]:
        if owner.count(owner[unit]) > 1:
            return []  # one piece of an interrupted cut follows another in its posture
        fresh = more(owner[unit], units[unit])
        units[unit] += fresh
        return [_plan(cut) for cut in fresh]

    try:
        part = order_plans(
            [[_plan(cut) for cut in unit] for unit in units],
            home=None if home is None else np.radians(home),
            cell=cell,
            before=before + pieces,
            heat_spacing=job.sequence.heat_spacing_mm / 1000,
            given_order=job.sequence.order == "given",
            retract=job.program.retract,
            air_speed=job.program.air_speed or 1.0,
            approach_speed=job.program.approach_speed,
            pierce_time=job.program.pierce_time,
            seconds=job.sequence.seconds,
            more=further,
        )
    except NoFeasiblePath as stuck:
        return Ordered(cuts=tuple(unit[0] for unit in units), stuck=stuck)
    cuts = [
        replace(units[unit][candidate], plan=made)
        for (unit, candidate), made in zip(part.chosen, part.plans, strict=True)
    ]
    return Ordered(cuts=tuple(cuts), part=part, air=_audited(job, part, cell))


def _audited(job: Job, part: PartPlan, cell: Cell | None) -> tuple[Check, ...]:
    """Return the worst of each check over all moves; its node is the number of the move."""
    o = job.options
    tables = (
        air_checks(job.robot, m.q, m.time, cell=cell, eta_v=o.eta_v, eta_a=o.eta_a)
        for m in part.moves
    )
    return tuple(worst_of(tables))


def _plan(cut: Cut) -> Plan:
    """Return the plan of a cut that has passed."""
    assert cut.plan is not None
    return cut.plan
