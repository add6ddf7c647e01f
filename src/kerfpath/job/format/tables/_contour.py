"""The [[contour]] tables: which loops are cut, how fast, and how finely sampled."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from kerfpath.job.format._values import MOST_NODES, NotNegative, Number, Positive, Text, fault, key
from kerfpath.job.format.tables._cut import (
    CornersTable,
    LeadTable,
    MicroJointsTable,
    PickTable,
    SmoothAxesTable,
)
from kerfpath.job.format.tables._table import Table, given, require_one
from kerfpath.operations import Side

__all__ = ["ContourTable"]


SHAPES = ("overlap_mm", "lead_in", "lead_out", "micro_joints", "corners")
"""Keys that add features to a contour; sampling by spacing_mm or time_step_ms keeps their ends."""
WIDEST_DEG = 359.999
"""Widest window of gamma."""
Window = Annotated[list[Number], Field(min_length=4, max_length=4)]
SAMPLINGS = ("spacing_mm", "time_step_ms", "count", "tolerance_mm")


class ContourTable(Table):
    """[[contour]]: a loop of the part to cut, its speed, its sampling and its operations."""

    pick: Annotated[Text | None, key("the name of a loop in the part", '"trim"')] = None
    pick_all: PickTable | None = None
    name: Annotated[Text | None, key("a name that no other contour has", '"trim 2"')] = None
    speed_m_min: Annotated[Positive, key("a number above 0, in m/min", "9")]
    spacing_mm: Annotated[Positive | None, key("a number above 0, in mm", "2")] = None
    time_step_ms: Annotated[Positive | None, key("a number above 0, in ms", "20")] = None
    count: Annotated[
        int | None, key(f"a whole number of nodes, 2 to {MOST_NODES}", "200", ge=2, le=MOST_NODES)
    ] = None
    tolerance_mm: Annotated[Positive | None, key("a number above 0, in mm", "0.05")] = None
    axis_tolerance_deg: Annotated[Positive | None, key("a number above 0, in deg", "1")] = None
    start: Literal["drawn", "smoothest", "best"] = "drawn"
    start_mm: Annotated[
        NotNegative | None, key("a number not below 0, in mm along the loop", "120")
    ] = None
    direction: Literal["drawn", "reversed", "best"] = "drawn"
    candidates: Annotated[
        int, key('a whole number of starts from 2 to 100, for start = "best"', "4", ge=2, le=100)
    ] = 4
    scrap: Side = "right"
    kerf_mm: Annotated[Positive | None, key("a number above 0, in mm", "0.2")] = None
    bevel_deg: Annotated[Number, key("a number from -60 to 60, in deg", "20", ge=-60, le=60)] = 0.0
    overlap_mm: Annotated[Positive | None, key("a number above 0, in mm", "2")] = None
    lead_in: LeadTable | None = None
    lead_out: LeadTable | None = None
    micro_joints: MicroJointsTable | None = None
    corners: CornersTable | None = None
    smooth_axes: SmoothAxesTable | None = None
    gamma_windows: Annotated[
        list[Window] | None,
        key("a list of windows, each [from_mm, to_mm, low_deg, high_deg]", "[[20, 35, -10, 10]]"),
    ] = None

    @property
    def moves_the_path(self) -> bool:
        """Whether points or tool axes of the cut differ from the drawn loop."""
        rounded = self.corners is not None and self.corners.round_mm is not None
        return bool(self.kerf_mm or self.bevel_deg or self.smooth_axes or rounded)

    @model_validator(mode="after")
    def _one_pick(self) -> ContourTable:
        what = "pick (a loop's name) or [contour.pick_all]"
        require_one(self, ("pick", "pick_all"), what, 'pick = "trim"')
        if self.pick_all is not None and self.name is not None:
            raise fault("name only with pick", "it with pick_all", "remove name", ("name",))
        return self

    @model_validator(mode="after")
    def _one_sampling(self) -> ContourTable:
        ways = f"one of {', '.join(SAMPLINGS[:-1])} and {SAMPLINGS[-1]}"
        found = given(self, *SAMPLINGS)
        if not found:
            raise fault(ways, "none", "add, for example, spacing_mm = 2", SAMPLINGS[:1])
        if len(found) > 1:
            raise fault(ways, " and ".join(found), "keep one", (found[-1],))
        if self.axis_tolerance_deg is not None and self.tolerance_mm is None:
            raise fault(
                "axis_tolerance_deg only with tolerance_mm",
                f"it with {found[0]}",
                "remove one",
                ("axis_tolerance_deg",),
            )
        features = given(self, *SHAPES)
        if features and found[0] not in SAMPLINGS[:2]:
            raise fault(
                f"spacing_mm or time_step_ms with {features[0]}, as they keep the ends of features",
                found[0],
                "write, for example, spacing_mm = 1",
                (found[0],),
            )
        if self.start != "drawn" and self.start_mm is not None:
            raise fault("start or start_mm", "both", "remove one", ("start_mm",))
        return self

    @model_validator(mode="after")
    def _windows_can_be(self) -> ContourTable:
        for number, (first, last, low, high) in enumerate(self.gamma_windows or ()):
            at = ("gamma_windows", number)
            got = f"[{first:g}, {last:g}, {low:g}, {high:g}]"
            if last < first:
                expected = "from_mm not above to_mm (write two windows across the start)"
                raise fault(expected, got, "swap them", at)
            if max(abs(low), abs(high)) > 360:
                raise fault("low_deg and high_deg from -360 to 360", got, "correct it", at)
            if max(abs(high - low), (high - low) % 360) > WIDEST_DEG:
                what = "an interval of gamma of less than a full circle"
                raise fault(what, got, "narrow it, or remove it", at)
        if self.gamma_windows and "best" in (self.start, self.direction):
            which = "start" if self.start == "best" else "direction"
            said = f'{which} other than "best" with gamma_windows, as they are measured along it'
            raise fault(said, '"best"', "set a start and a direction, or remove them", (which,))
        return self
