"""What the report is told about one contour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from kerfpath.auditor import Check
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.graph import LayeredGraph
from kerfpath.plans import Plan

__all__ = ["ContourSection"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContourSection:
    """One contour of a report: what was searched, what came of it, and what the audit says.

    Parameters
    ----------
    name : str
        What the report calls the contour.
    graph : LayeredGraph
        The layered graph that was searched.
    path : Contour
        The nodes, in the part frame.
    plan : Plan or None
        None when no feasible path was found.
    checks : sequence of Check
        The audit's table; empty when the audit was not run.
    failure : str
        Why there is no plan, in words.
    broken_at : int, optional
        First node that no admissible path reaches (one after `NoFeasiblePath.node`), 0-based.

    Raises
    ------
    InputError
        Graph and path differ in their number of nodes, or the plan does not divide their intervals.
    """

    name: str
    graph: LayeredGraph
    path: Contour
    plan: Plan | None = None
    checks: Sequence[Check] = ()
    failure: str = ""
    broken_at: int | None = None

    def __post_init__(self) -> None:
        nodes = {"graph": len(self.graph.reason), "path": len(self.path)}
        if self.plan is not None:
            nodes["plan"] = len(self.plan.q)
            if self.plan.robot.external is not None:
                raise InputError(
                    f"section {self.name!r}: a report does not show a "
                    f"{self.plan.robot.external.kind} yet"
                )
        intervals = {count - 1 for count in nodes.values()}
        if any(count % min(intervals) for count in intervals) or len(self.path) != nodes["graph"]:
            told = ", ".join(f"{name} {count}" for name, count in nodes.items())
            raise InputError(
                f"section {self.name!r}: expected the same nodes throughout, got {told}"
            )

    @property
    def errors(self) -> list[Check]:
        """Failed checks that forbid the program."""
        return [c for c in self.checks if not c.ok and c.level == "error"]

    @property
    def warnings(self) -> list[Check]:
        """Failed checks that do not forbid the program."""
        return [c for c in self.checks if not c.ok and c.level != "error"]
