"""What came of one contour of a job."""

from __future__ import annotations

from dataclasses import dataclass, replace

from kerfpath.auditor import Check
from kerfpath.cad import Departure, Part, departure_from
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.job._task import ContourTask
from kerfpath.planner import ClearanceMap, FastestSpeed
from kerfpath.plans import Plan
from kerfpath.search import Relaxations

__all__ = ["Cut"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cut:
    """What came of one contour of a job, or of one piece of it.

    Parameters
    ----------
    contour : str
        What the job calls the contour.
    task : ContourTask
    drawn : Contour
        The loop as drawn, densely sampled, part frame.
    nodes : Contour
        Its nodes, part frame.
    graph : LayeredGraph
    plan : Plan or None
        None when no feasible path was found.
    broken : NoFeasiblePath or None
        Why there is no plan.
    fastest : FastestSpeed or None
        Where there is no plan but a slower one exists: up to which speed.
    relaxations : Relaxations or None
        With it: the least change of each limit that would do at the speed asked.
    checks : tuple of Check
        The audit's table; empty without a plan.
    clearance : ClearanceMap or None
        How clear every pose is in the cell, where the job asks for the map.
    departure : Departure or None
        How far the nodes leave the CAD curve; measured once it is settled what is cut.
    picked : bool
        Whether the plan is one of a Pareto set, which aims at something else than the job does.
    """

    contour: str
    task: ContourTask
    drawn: Contour
    nodes: Contour
    graph: LayeredGraph
    plan: Plan | None = None
    broken: NoFeasiblePath | None = None
    fastest: FastestSpeed | None = None
    relaxations: Relaxations | None = None
    checks: tuple[Check, ...] = ()
    clearance: ClearanceMap | None = None
    departure: Departure | None = None
    picked: bool = False

    @property
    def passed(self) -> bool:
        """True when there is a plan and its audit finds no error."""
        return self.plan is not None and not any(
            c.level == "error" and not c.ok for c in self.checks
        )

    def measured(self, part: Part, loop: Departure | None) -> Cut:
        """Return the cut with the departure of its nodes.

        Parameters
        ----------
        part : Part
        loop : Departure or None
            That of the loop as drawn, where operations moved it: the nodes are then measured from
            the path as cut.
        """
        nodes = self.nodes if self.plan is None else self.plan.contour
        found = (
            part.departure(self.task.pick, nodes)
            if loop is None
            else departure_from(self.drawn, nodes, loop)
        )
        return replace(self, departure=found)

    @property
    def failure(self) -> str:
        """Why there is no plan, and what would help; empty where there is one."""
        if self.broken is None:
            return ""
        if self.fastest is None:
            return str(self.broken)
        least = self.relaxations
        ways = [
            f"{name} {share:.4g}"
            for name, share in (
                ("eta_velocity", None if least is None else least.eta_v),
                ("eta_acceleration", None if least is None else least.eta_a),
            )
            if share is not None
        ]
        node = self.nodes.points[self.fastest.node] * 1000
        return (
            f"{self.broken}; a path exists up to {self.fastest.speed * 60:.4g} m/min, where the "
            f"{self.fastest.limit} of joint {self.fastest.joint + 1} binds at node "
            f"{self.fastest.node}, {' '.join(f'{v:.1f}' for v in node)} mm"
            f"{'; or from ' + ' or from '.join(ways) + ' on' if ways else ''}"
        )
