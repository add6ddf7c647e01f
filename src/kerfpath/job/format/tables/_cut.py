"""The tables inside [[contour]]: which loops are picked, and the operations on them."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from kerfpath.cad import Loop, Part
from kerfpath.job.format._values import NotNegative, Positive, Text, Three, fault, key
from kerfpath.job.format.tables._table import Table, given
from kerfpath.operations import LeadShape

__all__ = ["CornersTable", "LeadTable", "MicroJointsTable", "PickTable", "SmoothAxesTable"]

Range = Annotated[tuple[Positive, ...], Field(strict=False, min_length=2, max_length=2)]


class PickTable(Table):
    """[contour.pick_all]: every loop that meets all of these conditions becomes a contour."""

    kind: Annotated[
        Literal["inner", "outer", "open"] | None,
        key('"inner" for holes, "outer" for trims, "open" for open lines', '"inner"'),
    ] = None
    face: Annotated[Text | None, key("the name of a face or skin", '"skin"')] = None
    side: Annotated[
        Literal["outer", "inner", "edge"] | None, key("a side of the sheet", '"outer"')
    ] = None
    diameter_mm: Annotated[
        Range | None, key("2 numbers above 0, from and to, in mm", "[8, 12]")
    ] = None
    length_mm: Annotated[
        Range | None, key("2 numbers above 0, from and to, in mm", "[20, 400]")
    ] = None
    layer: Annotated[Text | None, key("the name of a layer of a DXF or STEP", '"CUT"')] = None
    colour: Annotated[Text | None, key("a colour of a DXF or STEP", '"red"')] = None
    near_mm: Annotated[
        Three | None, key("3 numbers, a point of the part in mm", "[120, 40, 70]")
    ] = None

    @model_validator(mode="after")
    def _something(self) -> PickTable:
        if not self.model_fields_set:
            raise fault("a condition", "none", 'add, for example, kind = "inner"', ("kind",))
        return self

    def loops(self, part: Part) -> tuple[Loop, ...]:
        """Return the loops of a part that meet all conditions."""
        return part.pick(
            kind=self.kind, face=self.face, side=self.side, layer=self.layer, colour=self.colour,
            diameter=_metres(self.diameter_mm), length=_metres(self.length_mm),
            near=None if self.near_mm is None else np.divide(self.near_mm, 1000),
        )  # fmt: skip


def _metres(mm: tuple[float, ...] | None) -> tuple[float, float] | None:
    return None if mm is None else (mm[0] / 1000, mm[1] / 1000)


class LeadTable(Table):
    """[contour.lead_in], [contour.lead_out]: a line or an arc on the scrap side."""

    length_mm: Annotated[Positive, key("a number above 0, in mm", "4")]
    shape: LeadShape = "line"
    angle_deg: Annotated[NotNegative, key("a number from 0 to 180, in deg", "45", le=180)] = 45.0
    fan_mm: Annotated[Positive | None, key("a number above 0, in mm", "3")] = None
    speed_share: Annotated[
        Positive, key("a share of the speed, above 0, at most 1", "0.4", le=1)
    ] = 1.0

    @model_validator(mode="after")
    def _line_or_arc(self) -> LeadTable:
        if self.shape == "line" and self.angle_deg > 90:
            raise fault(
                'angle_deg up to 90 with shape = "line"',
                f"{self.angle_deg:g}",
                'lower it, or write shape = "arc"',
                ("angle_deg",),
            )
        return self


class MicroJointsTable(Table):
    """[contour.micro_joints]: stretches that are not cut through."""

    width_mm: Annotated[Positive, key("a number above 0, in mm", "0.4")]
    count: Annotated[int, key("a whole number from 1 to 1000", "3", ge=1, le=1000)]


class CornersTable(Table):
    """[contour.corners]: corners are rounded, cut with a loop, or cut at a lower speed."""

    round_mm: Annotated[
        Positive | None,
        key("a number above 0, the distance of the arc from the corner, in mm", "0.05"),
    ] = None
    loop_mm: Annotated[
        Positive | None, key("a number above 0, the radius of a loop, in mm", "2")
    ] = None
    slow_share: Annotated[
        Positive | None, key("a share of the speed, above 0 and below 1", "0.5", lt=1)
    ] = None
    slow_mm: Annotated[NotNegative, key("a number not below 0, in mm", "1")] = 1.0
    ramp_mm: Annotated[Positive, key("a number above 0, in mm", "2")] = 2.0

    @model_validator(mode="after")
    def _one_treatment(self) -> CornersTable:
        ways = given(self, "round_mm", "loop_mm")
        if len(ways) == 2:
            raise fault("round_mm or loop_mm", "both", "remove one", ("loop_mm",))
        if not ways and self.slow_share is None:
            raise fault(
                "round_mm, loop_mm or slow_share", "none", "add, for example, round_mm = 0.05",
                ("round_mm",),
            )  # fmt: skip
        return self


class SmoothAxesTable(Table):
    """[contour.smooth_axes]: tool axes averaged along the path, within a bound."""

    distance_mm: Annotated[Positive, key("a number above 0, in mm", "5")]
    limit_deg: Annotated[Positive, key("a number above 0, in deg", "5", le=90)]
