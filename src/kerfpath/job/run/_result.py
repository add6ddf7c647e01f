"""What came of a job, and of each of its contours."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from kerfpath._arrays import Array, Ints
from kerfpath._repr import short_repr
from kerfpath.auditor import Check
from kerfpath.cad import Departure, Part, departure_from
from kerfpath.cell import Cell
from kerfpath.errors import NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.job.as_run import AsRun
from kerfpath.job.format import Candidate, CutRequest, Job
from kerfpath.job.run._remedy import Remedy
from kerfpath.planner import ClearanceMap, FastestSpeed
from kerfpath.plans import Plan
from kerfpath.sequence import PartPlan
from kerfpath.transfer import TransferMove

__all__ = ["CutResult", "JobResult"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CutResult:
    """What came of one contour of a job, or of one piece of it.

    Parameters
    ----------
    request : CutRequest
        What was asked for.
    candidate : Candidate
        The path that is cut and its nodes, or a stretch of it.
    graph : LayeredGraph
    plan : Plan or None
        None when no feasible path was found.
    broken : NoFeasiblePath or None
        Why there is no plan.
    fastest : FastestSpeed or None
        Where there is no plan but a slower one exists: up to which speed.
    advice : Remedy or None
        With it: speeds and shares of the limits that open the way.
    checks : tuple of Check
        The audit's table; empty without a plan.
    clearance : ClearanceMap or None
        How clear every pose is in the cell, where the job asks for the map.
    departure : Departure or None
        How far the nodes leave the CAD curve; measured once it is settled what is cut.
    as_run : AsRun
        The plan as its program has it run, corners rounded; no plan file keeps it, as it is about
        the program.
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
        """What the job calls the contour."""
        return self.request.task.name

    @property
    def name(self) -> str:
        """What it is called itself; a piece has a number, too."""
        return self.contour if self.plan is None else self.plan.name

    @property
    def picked(self) -> bool:
        """Whether the plan is one of a Pareto set, which aims at something else than the job."""
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
            That of the loop as drawn, where operations moved it: the nodes are then measured from
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
        """Why there is no plan, and what would help; empty where there is one."""
        if self.broken is None:
            return ""
        return f"{self.broken}; {self.remedy}" if self.remedy else str(self.broken)

    @property
    def remedy(self) -> str:
        """What would open the way, in words; empty where nothing is known to."""
        return "" if self.advice is None else str(self.advice)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JobResult:
    """What came of a job: every cut, in order, its cell, and the part's mesh for pictures.

    With [sequence]: the moves between the cuts and their audit, or why there is no way.
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
        """True when every contour has a plan that passes its audit, and every move too."""
        moves = self.stuck is None and all(check.ok for check in self.air)
        return moves and all(cut.passed for cut in self.cuts)

    def with_cuts(self, cuts: tuple[CutResult, ...]) -> JobResult:
        """Return the same with other results of its cuts, in the same order."""
        if self.part is None:
            return replace(self, cuts=cuts)
        plans = tuple(cut.plan for cut in cuts if cut.plan is not None)
        return replace(self, cuts=cuts, part=replace(self.part, plans=plans))

    @property
    def moves(self) -> tuple[TransferMove, ...]:
        """The moves between the cuts; none without [sequence], or where there is no way."""
        return () if self.part is None else self.part.moves

    @property
    def plans(self) -> tuple[Plan, ...]:
        """The plans there are, in the order of cutting."""
        return tuple(cut.plan for cut in self.cuts if cut.plan is not None)
