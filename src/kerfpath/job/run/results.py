"""The results of a job and of each of its contours."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.auditor import Check
from kerfpath.cad import Departure, Part, departure_from
from kerfpath.cell import Cell
from kerfpath.errors import NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.job.as_run import AsRun, programmed
from kerfpath.job.format import Candidate, CutRequest, Job
from kerfpath.job.run.remedy import Remedy
from kerfpath.planner import (
    ClearanceMap,
    FastestSpeed,
)
from kerfpath.plans import Plan, TransferMove
from kerfpath.sequence import PartPlan


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
        The audit's table; empty without a plan, or before its audit.
    clearance : ClearanceMap or None
        The clearance of every pose in the cell, if the job asks for the map.
    departure : Departure or None
        How far the nodes leave the CAD curve; measured once the candidate is chosen.
    as_run : AsRun
        The plan as a controller runs its program, with rounded corners; not kept in plan files.
    kept : {"", "planned", "picked"}
        How the motion was found if it is that of an earlier run.
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
    kept: Literal["", "planned", "picked"] = ""

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
        return self.request.run is not None or self.kept == "picked"

    @property
    def lacks_poses(self) -> bool:
        """Whether there is no plan, and some node of the contour has no pose."""
        return self.broken is not None and not self.graph.has_poses_throughout

    @property
    def audited(self) -> bool:
        """Whether there is a plan with its audit."""
        return self.plan is not None and bool(self.checks)

    @property
    def passed(self) -> bool:
        """True when there is a plan and its audit finds no error."""
        rows = (*self.checks, *self.as_run.checks)
        return self.audited and not any(c.level == "error" and not c.ok for c in rows)

    @property
    def may_pass(self) -> bool:
        """True when there is a plan and no audit of it has found an error."""
        return self.passed if self.audited else self.plan is not None

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
        """What would help, and why there is no plan; empty if there is one."""
        if self.broken is None:
            return ""
        return f"{self.remedy}; {self.broken}" if self.remedy else str(self.broken)

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
    not_planned : tuple of str
        Names of the contours that have no cut, as the run was stopped before.
    doubts : tuple of str
        Warnings about the loops that the job picks.
    """

    job: Job
    cuts: tuple[CutResult, ...]
    mesh: tuple[Array, Ints]
    cell: Cell | None = None
    part: PartPlan | None = None
    stuck: NoFeasiblePath | None = None
    air: tuple[Check, ...] = ()
    not_planned: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()

    __repr__ = short_repr

    @property
    def passed(self) -> bool:
        """True if every contour has a plan that passes its audit, and every move passes, too."""
        moves = self.stuck is None and all(check.ok for check in self.air)
        return moves and not self.not_planned and all(cut.passed for cut in self.cuts)

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the contours that have no path."""
        return tuple(cut.name for cut in self.cuts if cut.broken is not None)

    @property
    def may_be_written(self) -> bool:
        """Whether there may be a program.

        Every contour and move has passed, or the job accepts a program without those that have no
        path, and all else has passed.
        """
        if self.not_planned or not (self.missing and self.job.accepts_incomplete):
            return self.passed
        rest = tuple(cut for cut in self.cuts if cut.broken is None)
        return len(rest) > 0 and replace(self, cuts=rest).passed

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

    @property
    def programmed(self) -> tuple[Plan, ...]:
        """The plans as the program cuts them, with targets moved if the job asks for it.

        Raises
        ------
        InputError
            The targets of one cannot be moved.
        """
        made = ((cut.plan, cut.as_run) for cut in self.cuts)
        return tuple(programmed(self.job, plan, run) for plan, run in made if plan is not None)
