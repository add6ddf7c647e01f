"""One run of the planner over a graph that is kept, and the audit of what comes of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from kerfpath._arrays import Array
from kerfpath._told import told
from kerfpath.auditor import audit as full_audit
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.front._runs import Run
from kerfpath.graph import LayeredGraph
from kerfpath.losses import Loss
from kerfpath.options import PlanOptions
from kerfpath.planner import plan
from kerfpath.plans import Plan
from kerfpath.robots import Robot

__all__ = ["Attempts"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Attempts:
    """The task that runs are tried on.

    Parameters
    ----------
    contour, robot, tool, placement, speed, options, graph, cell
        As in `kerfpath.plan`; the runs change some of the options.
    audit : callable, optional
        Returns what is wrong with a plan; default: `kerfpath.audit`, with the cell.
    """

    contour: Contour
    robot: Robot
    tool: Array
    placement: Array
    speed: float | None
    options: PlanOptions
    graph: LayeredGraph
    cell: Cell | None
    audit: Callable[[Plan], Sequence[object]] | None = None

    __repr__ = told

    def of(self, run: Run) -> Plan | str:
        """Return the plan of a run, which has passed its audit, or in a few words why not."""
        try:
            return self._audited(self.planned(run))
        except NoFeasiblePath as broken:
            if windows := broken.lost_by(Loss.WINDOW):
                return f"no pose in the {windows[0]}"
            counts = broken.counts
            most = max(counts, key=counts.__getitem__, default="the seam")
            return f"no edge within {most}"

    def first(self, run: Run) -> Plan | str:
        """Return the same of the run that has all that is allowed.

        Raises
        ------
        NoFeasiblePath
            It has no path, so that no run can have one.
        """
        try:
            return self._audited(self.planned(run))
        except NoFeasiblePath as broken:
            said = (
                f"{broken}; no run can have a plan: this one had all that is allowed. Runs stand "
                "on the grid of the rotation: where kerfpath plan finds a motion by refining it, "
                "choose a finer gamma_step_deg or a lower speed here"
            )
            raise broken.retold(said) from None

    def _audited(self, made: Plan) -> Plan | str:
        wrong = full_audit(made, cell=self.cell) if self.audit is None else self.audit(made)
        return f"audit: {getattr(wrong[0], 'code', wrong[0])}" if wrong else made

    def planned(self, run: Run) -> Plan:
        """Return the plan of a run.

        Raises
        ------
        NoFeasiblePath
            As `kerfpath.plan`.
        """
        return plan(
            self.contour,
            self.robot,
            tool=self.tool,
            placement=self.placement,
            speed=self.speed,
            options=run.applied_to(self.options),
            graph=run.graph(self.graph, self.robot.endless),
            cell=run.cell(self.cell),
        )
