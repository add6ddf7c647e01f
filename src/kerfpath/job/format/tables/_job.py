"""The complete job file: every table, and the rules between tables."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field, ValidationInfo, model_validator

from kerfpath.errors import InputError
from kerfpath.job.format._values import fault, fault_in_words, folder_of
from kerfpath.job.format.tables._cell import CellTable, FixtureTable, HeadTable, PairTable
from kerfpath.job.format.tables._comfort import ComfortTable
from kerfpath.job.format.tables._contour import ContourTable
from kerfpath.job.format.tables._cut import (
    CornersTable,
    LeadTable,
    MicroJointsTable,
    PickTable,
    SmoothAxesTable,
)
from kerfpath.job.format.tables._external import ExternalTable
from kerfpath.job.format.tables._layout import LayoutTable
from kerfpath.job.format.tables._part import PartTable
from kerfpath.job.format.tables._plan import PlanTable
from kerfpath.job.format.tables._program import AuditTable, ProgramTable
from kerfpath.job.format.tables._robot import RobotTable
from kerfpath.job.format.tables._sequence import SequenceTable
from kerfpath.job.format.tables._table import Table, require_distinct
from kerfpath.job.format.tables._tool import ToolTable
from kerfpath.options import EXACT_OR_BETTER
from kerfpath.robots import postures_named

__all__ = ["REPEATED", "TABLES", "JobFile"]


class JobFile(Table):
    """The complete job file: robot, tool, part, contours, plan options, cell and program."""

    robot: RobotTable
    tool: ToolTable
    part: PartTable
    contour: Annotated[tuple[ContourTable, ...], Field(strict=False, min_length=1)]
    plan: PlanTable = PlanTable()
    cell: CellTable | None = None
    sequence: SequenceTable | None = None
    comfort: ComfortTable = ComfortTable()
    layout: LayoutTable = LayoutTable()
    audit: AuditTable = AuditTable()
    program: ProgramTable = ProgramTable()

    @model_validator(mode="after")
    def _names_differ(self) -> JobFile:
        names = [table.name or table.pick for table in self.contour]
        keys = ["name" if table.name else "pick" for table in self.contour]
        require_distinct(names, "contour", "contour", keys)
        return self

    @model_validator(mode="after")
    def _one_for_every_joint(self, info: ValidationInfo) -> JobFile:
        home = None if self.sequence is None else self.sequence.home_deg
        given = {("plan", "weights"): self.plan.weights, ("sequence", "home_deg"): home}
        arm, more = self.robot.joints(folder_of(info)), len(self.robot.axes(folder_of(info)))
        for where, numbers in given.items():
            joints = arm + more * (where[1] == "weights")
            if numbers is not None and len(numbers) != joints:
                axes = f", {more} of them for external axes" if joints > arm else ""
                expected = f"{joints} numbers, one for every joint{axes}"
                raise fault(expected, f"{len(numbers)}", "give as many", where)
        return self

    @model_validator(mode="after")
    def _posture_fits(self, info: ValidationInfo) -> JobFile:
        if self.plan.posture is not None:
            try:
                postures_named(self.plan.posture, self.robot.resolve(folder_of(info)).kinematics)
            except InputError as error:
                raise fault_in_words(f"{error}", ("plan", "posture")) from None
        return self

    @model_validator(mode="after")
    def _best_is_chosen(self) -> JobFile:
        """Require [sequence] where a start or a direction is to be chosen."""
        if self.sequence is not None:
            return self
        for i, table in enumerate(self.contour):
            for name in ("start", "direction"):
                if getattr(table, name) == "best":
                    raise fault(
                        f'[sequence] with {name} = "best"',
                        "none",
                        f"add [sequence], or write another {name}",
                        ("contour", i, name),
                    )
        return self

    @model_validator(mode="after")
    def _cell_fits(self) -> JobFile:
        """Refuse options that cannot be combined with a cell, at their key."""
        if self.cell is None:
            return self
        if (method := self.plan.method) not in EXACT_OR_BETTER:
            expected = 'method = "continuous" or "exact" with [cell]'
            raise fault(expected, f'"{method}"', "change one", ("plan", "method"))
        if self.cell.links == "description" and self.robot.urdf is None:
            raise fault(
                'links = "description" only with urdf in [robot]',
                "none",
                'write links = "capsules"',
                ("cell", "links"),
            )
        return self

    @model_validator(mode="after")
    def _standing_are_fixtures(self) -> JobFile:
        fixtures = [] if self.cell is None else [fixture.name for fixture in self.cell.fixture]
        for i, name in enumerate(self.layout.standing):
            if name not in fixtures:
                raise fault(
                    "the name of a fixture",
                    f'"{name}"',
                    f"there are {', '.join(fixtures) or 'none'}",
                    ("layout", "standing", i),
                )
        return self

    @model_validator(mode="after")
    def _movable(self) -> JobFile:
        """Require that a layout moves the part, or an external axis that carries it."""
        name = self.layout.move
        carriers = [axis.name for axis in self.robot.external if axis.carries == "part"]
        if name != "part" and name not in carriers:
            hint = "vary base_x_mm, base_y_mm, base_z_mm or base_yaw_deg to move the robot"
            raise fault(
                f"one of {', '.join(map(repr, ('part', *carriers)))}",
                f'"{name}"',
                hint if any(axis.name == name for axis in self.robot.external) else "name one",
                ("layout", "move"),
            )
        return self

    @model_validator(mode="after")
    def _clearance_is_measured(self) -> JobFile:
        """Refuse a cost of clearance where the planner would not measure it."""
        here = ("comfort", "clearance_band_mm")
        if self.comfort.clearance_band_mm is None:
            return self
        if self.cell is None:
            expected = "[cell] with clearance_band_mm, as clearance is measured in the cell"
            raise fault(expected, "none", "add [cell], or remove clearance_band_mm", here)
        return self


TABLES: dict[str, type[BaseModel]] = {
    "robot": RobotTable,
    "tool": ToolTable,
    "part": PartTable,
    "contour": ContourTable,
    "contour.pick_all": PickTable,
    "contour.lead_in": LeadTable,
    "contour.lead_out": LeadTable,
    "contour.micro_joints": MicroJointsTable,
    "contour.corners": CornersTable,
    "contour.smooth_axes": SmoothAxesTable,
    "plan": PlanTable,
    "cell": CellTable,
    "cell.head": HeadTable,
    "cell.fixture": FixtureTable,
    "robot.external": ExternalTable,
    "cell.pair": PairTable,
    "sequence": SequenceTable,
    "comfort": ComfortTable,
    "layout": LayoutTable,
    "audit": AuditTable,
    "program": ProgramTable,
}
"""The model of each table of the file."""
REPEATED = ("contour", "cell.fixture", "cell.pair", "robot.external")
"""Tables that a file may have several of."""
