"""The [part] and [[contour]] tables: drawing, loops, speeds, operations and sampling."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field, field_validator, model_validator

from kerfpath.arrays import Array, freeze, short_repr
from kerfpath.cad import EDGE_TURN, GAP, LEAST_EDGE_TURN, SUFFIXES, UNITS_MM, Loop, Machine, Part
from kerfpath.cad import read as read_drawing
from kerfpath.errors import InputError
from kerfpath.job.format.tables.process import Word
from kerfpath.job.format.tables.table import (
    MOST_NODES,
    NotNegative,
    Number,
    Positive,
    Table,
    Text,
    Three,
    existing,
    fault,
    fault_in_words,
    given,
    key,
    one_of,
    pose,
    require_one,
)
from kerfpath.operations import LeadShape, Side
from kerfpath.progress import Progress, no_progress

# -----------------------------------------------------------------------------
# The drawing of a job: its file and how to read it.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawing:
    """A drawing and how to read it.

    Parameters
    ----------
    file : Path
        The CAD file; it existed when the job was read.
    unit : str or None
        Length unit that overrides the CAD file's own.
    gap : float m
        Largest gap between the ends of two curves that a loop bridges.
    edge_turn : float m
        Distance from sharp edges within which the beam turns, see `kerfpath.cad.read`.
    outer_towards : (3,) or None
        Direction that the outer sides of its sheets face, part frame, see `kerfpath.cad.read`.
    axis : (3,) or None
        Tool axis for a drawing without one, part frame.
    columns : mapping or sequence of str, or None
        Meaning of the columns of a table of points, see `kerfpath.cad.read`.
    sort : "open", "closed" or None
        Whether points of a table are sorted along a curve, see `kerfpath.cad.read`.
    beam : str or sequence of str, or None
        How a program of a robot switches the beam, see `kerfpath.cad.read`.
    section : (3,) or None
        Normal of the planes that cut a mesh, see `kerfpath.cad.read`.
    section_at : tuple of float, m
        Distance of each of them along the normal.
    machine : Machine or None
        The rotary axes of the machine whose program it is, see `kerfpath.cad.read`.
    drawing_frame : "leave_out", "cut" or None
        What to do with a drawing frame in a DXF, see `kerfpath.cad.read`.
    lines : Path or None
        A table of points in the part frame, whose contours are loops of the part, too.
    accept_left_out : bool
        Whether geometry that may have to be cut may be left out.
    """

    file: Path
    unit: str | None = None
    gap: float = GAP
    edge_turn: float = EDGE_TURN
    outer_towards: Array | None = None
    axis: Array | None = None
    columns: Mapping[str, str] | Sequence[str] | None = None
    sort: Literal["open", "closed"] | None = None
    beam: str | Sequence[str] | None = None
    section: Array | None = None
    section_at: tuple[float, ...] = ()
    machine: Machine | None = None
    drawing_frame: Literal["leave_out", "cut"] | None = None
    lines: Path | None = None
    accept_left_out: bool = False

    __repr__ = short_repr

    def read(self, progress: Progress = no_progress) -> Part:
        """Return the part in the drawing.

        `progress` is called with the current step and the number of faces.

        Raises
        ------
        InputError
            The drawing or the table of lines cannot be read, or both name a loop alike.
        """
        part = read_drawing(
            self.file,
            unit=self.unit,
            gap=self.gap,
            edge_turn=self.edge_turn,
            outer_towards=self.outer_towards,
            axis=self.axis,
            columns=self.columns,
            sort=self.sort,
            beam=self.beam,
            section=self.section,
            section_at=self.section_at,
            machine=self.machine,
            drawing_frame=self.drawing_frame,
            progress=progress,
        )
        if self.lines is None:
            return part
        added = read_drawing(self.lines, gap=self.gap)
        known = {loop.name for loop in part.loops}
        if both := [loop.name for loop in added.loops if loop.name in known]:
            raise InputError(
                f"{self.lines}: the drawing has a loop {both[0]!r}, too; rename the contour"
            )
        notes = (f"{self.lines.name}: {note}" for note in added.notes)
        return replace(part, loops=(*part.loops, *added.loops), notes=(*part.notes, *notes))


# -----------------------------------------------------------------------------
# The tables inside [[contour]]: which loops are picked, and the operations on them.

Range = Annotated[tuple[Positive, ...], Field(strict=False, min_length=2, max_length=2)]


class PickTable(Table):
    """[contour.pick_all]: every loop that meets all of these conditions becomes a contour."""

    kind: Annotated[
        Literal["inner", "outer", "open"] | None,
        key('"inner" for holes, "outer" for trims, "open" for open lines', '"inner"'),
    ] = None
    face: Annotated[Text | None, key("the name of a face or skin", '"skin"')] = None
    side: Annotated[
        Literal["outer", "inner", "edge", "blind", "sunk"] | None,
        key("a side of the sheet", '"outer"'),
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

    length_mm: Annotated[NotNegative, key("a number not below 0, in mm; 0: no lead", "4")]
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


# -----------------------------------------------------------------------------
# The [part] table: the CAD file, and where the part is.


class MachineTable(Table):
    """[part.machine]: the rotary axes of the machine whose program the drawing is."""

    head: Annotated[
        Text | None,
        key("the axes that carry the tool, the one that carries the other first", '"CB"'),
    ] = None
    table: Annotated[
        Text | None,
        key("the axes that carry the part, the one that carries the other first", '"AC"'),
    ] = None
    tcp: Annotated[
        bool | None,
        key("whether the control keeps the tip at X, Y, Z while axes turn (true, false)", "true"),
    ] = None
    rollover: Annotated[
        bool | None, key("whether axes take the shorter way to an angle (true or false)", "true")
    ] = None
    reversed: Annotated[Text | None, key("axes that count against ISO 841", '"A"')] = None
    pivot_mm: Annotated[
        NotNegative | None,
        key("the distance of the tip from the axes of the head, in mm, without tcp", "150"),
    ] = None
    centre_mm: Annotated[
        Three,
        key("3 numbers, where the axes of the table meet, in mm, without tcp", "[0, 0, -30]"),
    ] = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _is_machine(self) -> MachineTable:
        try:
            self.machine()
        except InputError as error:
            raise fault_in_words(str(error), ("head",)) from None
        return self

    def machine(self) -> Machine:
        """Return the machine."""
        x, y, z = np.divide(self.centre_mm, 1000).tolist()
        return Machine(
            head=self.head or "",
            table=self.table or "",
            tcp=self.tcp,
            rollover=self.rollover,
            reversed=self.reversed or "",
            pivot=None if self.pivot_mm is None else self.pivot_mm / 1000,
            centre=(x, y, z),
        )


class PartTable(Table):
    """[part]: the CAD file, and where the part is in the robot base."""

    file: Annotated[
        Text,
        AfterValidator(existing("the part's CAD file")),
        key("the path of the part's CAD file", '"b_pillar.step"'),
    ]
    unit: Annotated[
        str | None,
        one_of(f"a length unit ({', '.join(UNITS_MM)})", lambda: UNITS_MM),
        key("a length unit", '"mm"'),
    ] = None
    gap_mm: Annotated[
        Positive, key("the largest gap between two curve ends that a loop bridges, in mm", "0.05")
    ] = GAP * 1000
    edge_turn_mm: Annotated[
        Positive,
        key(
            "the distance from a sharp edge within which the beam turns, from "
            f"{LEAST_EDGE_TURN * 1000:g} mm up",
            "2",
            ge=LEAST_EDGE_TURN * 1000,
        ),
    ] = EDGE_TURN * 1000
    outer_towards: Annotated[
        Three | None,
        key("3 numbers, the direction that its outer sides face, in the part", "[0, 0, 1]"),
    ] = None
    axis: Annotated[
        Three | None,
        key("3 numbers, the tool axis for a drawing without one, in the part", "[0, 0, -1]"),
    ] = None
    columns: Annotated[
        dict[str, Text] | list[Text] | None,
        key(
            "the columns of a table of points: its own names for them, or a list in order",
            '{ x = "Pos X", y = "Pos Y", z = "Pos Z" }',
        ),
    ] = None
    sort: Annotated[
        Literal["open", "closed"] | None,
        key("the curve along which points in no order are sorted", '"closed"'),
    ] = None
    beam: Annotated[
        Text | list[Text] | None,
        key(
            "the output of a robot program that is on while it cuts, the two statements that "
            "switch on and off, or the speed of its cuts",
            '"$OUT[5]"',
        ),
    ] = None
    section: Annotated[
        Three | None,
        key("3 numbers, the normal of the planes that cut a mesh, in the part", "[0, 0, 1]"),
    ] = None
    section_mm: Annotated[
        tuple[Number, ...],
        key("distances of these planes along their normal, in mm", "[20, 40]", strict=False),
    ] = ()
    machine: MachineTable | None = None
    drawing_frame: Annotated[
        Literal["leave_out", "cut"] | None,
        key("what to do with a rectangle around all else in a DXF", '"leave_out"'),
    ] = None
    lines: Annotated[
        Text | None,
        AfterValidator(existing("a table of points")),
        key("the path of a table of points with more lines to cut, in the part", '"lines.csv"'),
    ] = None
    left_out: Annotated[
        Literal["refuse", "accept"],
        key("what to do if something to cut may be left out of the drawing", '"accept"'),
    ] = "refuse"
    switched_off: Annotated[
        tuple[Text, ...],
        key("names of contours that are not cut for now", '["slot"]', strict=False),
    ] = ()
    placed_by: Annotated[
        Literal["origin", "centre"],
        key("the point of the part at xyz_mm: its origin, or the centre of its box", '"centre"'),
    ] = "origin"
    frame: Annotated[
        Text | None,
        key("the coordinate system of the drawing that xyz_mm and rpy_deg place", '"FIXTURE"'),
    ] = None
    xyz_mm: Annotated[
        Three, key("3 numbers, the part's position in the robot base in mm", "[1450, -600, 450]")
    ]
    rpy_deg: Annotated[
        Three,
        key("3 numbers, the part's roll, pitch and yaw in the robot base in deg", "[0, 0, 90]"),
    ]

    @model_validator(mode="after")
    def _one_place(self) -> PartTable:
        if self.frame is not None and self.placed_by == "centre":
            raise fault("frame or placed_by", "both", "remove one", ("placed_by",))
        if (self.section is None) != (not self.section_mm):
            missing = "section_mm" if self.section else "section"
            raise fault("section and section_mm", "one", f"add {missing}", (missing,))
        return self

    @property
    def may_say_speeds(self) -> bool:
        """Whether the drawing is the program of a machine, in which feeds may be the speeds."""
        return SUFFIXES.get(Path(self.file).suffix.lower()) == "NC program"

    def drawing(self, folder: Path) -> Drawing:
        """Return the drawing; its path is relative to `folder`."""
        return Drawing(
            file=folder / self.file,
            unit=self.unit,
            gap=self.gap_mm / 1000,
            edge_turn=self.edge_turn_mm / 1000,
            outer_towards=_direction(self.outer_towards),
            axis=_direction(self.axis),
            columns=self.columns,
            sort=self.sort,
            beam=self.beam,
            section=_direction(self.section),
            section_at=tuple(height / 1000 for height in self.section_mm),
            machine=None if self.machine is None else self.machine.machine(),
            drawing_frame=self.drawing_frame,
            lines=None if self.lines is None else folder / self.lines,
            accept_left_out=self.left_out == "accept",
        )

    def resolve(self, drawing: Drawing) -> Array:
        """Return T_base_part, (4, 4), m; the drawing is read unless its origin is placed.

        Raises
        ------
        InputError
            The drawing cannot be read, or has no such coordinate system.
        """
        placed = pose(self.xyz_mm, self.rpy_deg)
        if self.frame is not None:
            T_part_placed = drawing.read().frame(self.frame)
        elif self.placed_by == "centre":
            T_part_placed = np.eye(4)
            T_part_placed[:3, 3] = drawing.read().bounding_box.mean(axis=0)
        else:
            return placed
        return freeze(placed @ np.linalg.inv(T_part_placed))


def _direction(value: tuple[float, ...] | None) -> Array | None:
    return None if value is None else np.array(value, dtype=float)


# -----------------------------------------------------------------------------
# The [[contour]] tables: which loops are cut, how fast, and how finely sampled.

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
    technique: Annotated[
        Word | None, key("a technique of the chart that [process] names", '"small-hole"')
    ] = None
    speed_m_min: Annotated[Positive | None, key("a number above 0, in m/min", "9")] = None
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
    kerf_mm: Annotated[NotNegative | None, key("a number not below 0, in mm", "0.2")] = None
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

    @field_validator("lead_in", "lead_out")
    @classmethod
    def _none_of_no_length(cls, lead: LeadTable | None) -> LeadTable | None:
        return None if lead is None or lead.length_mm == 0 else lead

    @model_validator(mode="after")
    def _one_pick(self) -> ContourTable:
        what = "pick (a loop's name) or [contour.pick_all]"
        require_one(self, ("pick", "pick_all"), what)
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
