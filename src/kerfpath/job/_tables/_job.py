"""The whole job file: every table, and the rules between tables."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field, model_validator

from kerfpath.job._keys import fault
from kerfpath.job._tables._comfort import ComfortTable
from kerfpath.job._tables._contour import ContourTable
from kerfpath.job._tables._part import PartTable
from kerfpath.job._tables._plan import PlanTable
from kerfpath.job._tables._program import AuditTable, ProgramTable
from kerfpath.job._tables._robot import RobotTable
from kerfpath.job._tables._table import Table
from kerfpath.job._tables._tool import ToolTable

__all__ = ["TABLES", "JobFile"]


class JobFile(Table):
    """The whole job file: cell, contours, process and objective."""

    robot: RobotTable
    tool: ToolTable
    part: PartTable
    contour: Annotated[tuple[ContourTable, ...], Field(strict=False, min_length=1)]
    plan: PlanTable = PlanTable()
    comfort: ComfortTable = ComfortTable()
    audit: AuditTable = AuditTable()
    program: ProgramTable = ProgramTable()

    @model_validator(mode="after")
    def _names_differ(self) -> JobFile:
        seen: set[str] = set()
        for i, table in enumerate(self.contour):
            name = table.name or table.pick
            if name in seen:
                raise fault(
                    "a name that no other contour has",
                    f'"{name}" again',
                    "give one of them another name",
                    ("contour", i, "name" if table.name else "pick"),
                )
            seen.add(name)
        return self

    @model_validator(mode="after")
    def _costs_are_known(self) -> JobFile:
        """Refuse costs where the planner would not know them."""
        asked = self.comfort.resolve()
        if asked and asked.costs and self.plan.feed == "dip" and self.plan.refine is not False:
            expected = 'refine = false with feed = "dip" and costs in [comfort]'
            raise fault(expected, "none", "add it, or remove the costs", ("plan", "feed"))
        return self


TABLES: dict[str, type[BaseModel]] = {
    "robot": RobotTable,
    "tool": ToolTable,
    "part": PartTable,
    "contour": ContourTable,
    "plan": PlanTable,
    "comfort": ComfortTable,
    "audit": AuditTable,
    "program": ProgramTable,
}
"""The model of each table of the file."""
