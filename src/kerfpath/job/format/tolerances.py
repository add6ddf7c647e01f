"""Tolerances of the audit between the nodes."""

from __future__ import annotations

from dataclasses import dataclass

from kerfpath.arrays import short_repr
from kerfpath.auditor import Check, Rounding, checks
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.plans import Plan
from kerfpath.setting import documented, setting


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """Tolerances of the audit between the nodes."""

    path: float = setting(
        0.1,
        "largest distance of the tool tip from the path",
        unit="mm",
        above=0,
        example="0.1",
        key="path_tolerance_mm",
    )
    axis: float = setting(
        1.0,
        "largest angle between the tool axis and the requested one",
        unit="deg",
        above=0,
        example="1",
        key="axis_tolerance_deg",
    )

    __repr__ = short_repr

    def checks(
        self,
        plan: Plan,
        *,
        reference: Contour | None = None,
        cell: Cell | None = None,
        rounding: Rounding | None = None,
    ) -> list[Check]:
        """Return the audit's table of a plan within these tolerances, see `auditor.checks`."""
        return checks(
            plan,
            reference=reference,
            path_tolerance=self.path,
            axis_tolerance=self.axis,
            cell=cell,
            rounding=rounding,
        )
