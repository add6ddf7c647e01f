"""The data of one contour on the page of a job."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, short_repr
from kerfpath.auditor import Check
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.graph import LayeredGraph
from kerfpath.losses import Loss, Reason
from kerfpath.planner import ClearanceMap
from kerfpath.plans import Plan
from kerfpath.report.executed import ExecutedPath, PowerPath

SPARE = (0.25, 0.5, 1.0)
"""Upper ends of the ranges of clearance that have colours, as shares of the map's band."""


def add_clearance(graph: LayeredGraph, found: ClearanceMap) -> LayeredGraph:
    """Return the graph with the clearances of its candidates among the reasons.

    A candidate that is not clear gets the reason collision; one whose clearance is less than the
    band of the map gets a range of clearances. All turns of a candidate have the same pose, so one
    of them is enough.
    """
    steps = [1e3 * share * found.band for share in (0.0, *SPARE)]
    spare = [Reason(Loss.SPARE, f"{a:g} to {b:g} mm") for a, b in pairwise(steps)][::-1]
    reasons = (graph.reasons[0], *spare, Reason(Loss.COLLISION), *graph.reasons[1:])
    added = len(spare) + 1
    above = np.searchsorted(np.array(SPARE) * found.band, found.lower, side="right")
    layer = np.repeat(np.arange(len(graph.reason)), np.diff(graph.start))
    # The codes are ordered so that the least one is the best of a gamma's variants.
    reason = np.where(graph.reason == 0, 0, graph.reason + added).astype(np.uint8)
    reason[layer, graph.candidate, graph.posture] = np.where(found.clear, len(SPARE) - above, added)
    return replace(graph, reason=reason, reasons=reasons)


class Mark(NamedTuple):
    """A place where a contour fails: node of its map, point in the part (m), and reason."""

    node: float
    point: Array
    words: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContourSection:
    """One contour of a report: the search, its plan or failure, and its audit.

    Parameters
    ----------
    name : str
        Name of the contour in the report.
    graph : LayeredGraph
        The layered graph that was searched.
    path : Contour
        The nodes, in the part frame.
    plan : Plan or None
        None when no feasible path was found.
    checks : sequence of Check
        The audit's table; empty when the audit was not run.
    failure : str
        Reason why there is no plan.
    remedy : str
        Changes that would help.
    clearance : ClearanceMap, optional
        Clearance of each vertex of the graph in the cell.
    broken_at : int, optional
        First node that no admissible path reaches (one after `NoFeasiblePath.node`), 0-based.
    sampling : sequence of (what, value)
        Sampling errors of the nodes, in rows such as ("Chord error", "0.01 mm").
    executed : ExecutedPath, optional
        The path as it is executed.
    power : PowerPath, optional
        The power along it, if the program sets it.

    Raises
    ------
    InputError
        Graph and path differ in their number of nodes, or the plan does not divide their intervals
        into equal numbers of parts.
    """

    name: str
    graph: LayeredGraph
    path: Contour
    plan: Plan | None = None
    checks: Sequence[Check] = ()
    failure: str = ""
    remedy: str = ""
    broken_at: int | None = None
    clearance: ClearanceMap | None = None
    sampling: Sequence[tuple[str, str]] = ()
    executed: ExecutedPath | None = None
    power: PowerPath | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        nodes = {"graph": len(self.graph.reason), "path": len(self.path)}
        if self.plan is not None:
            nodes["plan"] = len(self.plan.q)
        intervals = {count - 1 for count in nodes.values()}
        if any(count % min(intervals) for count in intervals) or len(self.path) != nodes["graph"]:
            counts = ", ".join(f"{name} {count}" for name, count in nodes.items())
            raise InputError(
                f"section {self.name!r}: expected the same nodes throughout, got {counts}"
            )

    @property
    def mapped(self) -> LayeredGraph:
        """The graph, with the clearance of its vertices among the reasons if it is known."""
        return self.graph if self.clearance is None else add_clearance(self.graph, self.clearance)

    @property
    def failed(self) -> bool:
        """True without a plan, or with one that fails its audit."""
        return self.plan is None or bool(self.errors)

    @property
    def parts(self) -> int:
        """Number of parts into which the plan divides each interval."""
        return 1 if self.plan is None else (len(self.plan.q) - 1) // (len(self.path) - 1)

    @property
    def marks(self) -> list[Mark]:
        """Places of failure: the node of the break, or the worst node of each failed check."""
        if self.plan is None:
            if self.broken_at is None or not 0 <= self.broken_at < len(self.path):
                return []
            words = f"path breaks at node {self.broken_at}"
            return [Mark(self.broken_at, self.path.points[self.broken_at], words)]
        points = self.plan.contour.points
        return [
            Mark(check.node / self.parts, points[check.node], f"{check.title}, node {check.node}")
            for check in self.errors
            if 0 <= check.node < len(points)
        ]

    @property
    def errors(self) -> list[Check]:
        """Failed checks that forbid the program."""
        return [c for c in self.checks if not c.ok and c.level == "error"]

    @property
    def warnings(self) -> list[Check]:
        """Failed checks that do not forbid the program."""
        return [c for c in self.checks if not c.ok and c.level != "error"]
