"""The [cell] table: the bodies of the cell, and the near-miss distance of each pair of them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from kerfpath.job.format._values import (
    NotNegative,
    Number,
    Positive,
    Text,
    Three,
    existing,
    fault,
    key,
)
from kerfpath.job.format.tables._table import Table, given, require_distinct, require_one

__all__ = ["CellTable", "FixtureTable", "HeadTable", "PairTable"]

Unit = Literal["mm", "cm", "m", "in"]
ThreePositive = Annotated[tuple[Positive, ...], Field(strict=False, min_length=3, max_length=3)]
Pair = Annotated[tuple[Text, ...], Field(strict=False, min_length=2, max_length=2)]


def unit_of(table: HeadTable | FixtureTable) -> None:
    """Require a unit for an STL file, which does not state it, and none without a file.

    Raises
    ------
    PydanticCustomError
        At the key `unit`.
    """
    if table.file is None and table.unit is not None:
        raise fault("unit only with file", "no file", "remove unit", ("unit",))
    if table.file is not None and table.file.lower().endswith(".stl") and table.unit is None:
        raise fault(
            "the unit of the STL file, which does not state it",
            "none",
            'add, for example, unit = "mm"',
            ("unit",),
        )


def _mesh_file(value: str) -> str:
    if not value.lower().endswith((".stl", ".step", ".stp")):
        raise fault("an STL or STEP file (.stl, .step, .stp)", None, "export the solid as one")
    return value


MeshFile = Annotated[
    Text,
    AfterValidator(_mesh_file),
    AfterValidator(existing("an STL or STEP file")),
]
MESH_FILE = key("the path of an STL or STEP file", '"clamp.stl"')


class HeadTable(Table):
    """[cell.head]: a solid from a file, or sizes that replace those of the generic head."""

    file: Annotated[MeshFile | None, MESH_FILE] = None
    unit: Annotated[Unit | None, key("the unit of the file's numbers", '"mm"')] = None
    xyz_mm: Annotated[
        Three | None, key("3 numbers, the file's origin in the flange in mm", "[0, 0, 0]")
    ] = None
    rpy_deg: Annotated[
        Three | None, key("3 numbers, roll, pitch and yaw in the flange in deg", "[0, 0, 0]")
    ] = None
    nozzle_length_mm: Annotated[Positive | None, key("a number above 0, in mm", "60")] = None
    nozzle_radii_mm: Annotated[
        tuple[Positive, ...] | None,
        key(
            "2 numbers above 0, the radii at the nozzle's end and at the body, in mm",
            "[2.5, 16]",
            strict=False,
            min_length=2,
            max_length=2,
        ),
    ] = None
    body_length_mm: Annotated[Positive | None, key("a number above 0, in mm", "140")] = None
    body_radius_mm: Annotated[Positive | None, key("a number above 0, in mm", "40")] = None
    arm_radius_mm: Annotated[Positive | None, key("a number above 0, in mm", "50")] = None

    @model_validator(mode="after")
    def _one_head(self) -> HeadTable:
        """Require sizes of the generic head, or a file and where it is."""
        if self.file is None:
            wrong, why = given(self, "xyz_mm", "rpy_deg"), "only with file"
        else:
            generic = ("nozzle_radii_mm", "body_length_mm", "body_radius_mm", "arm_radius_mm")
            wrong, why = given(self, *generic), "only without file"
        if wrong:
            got = "no file" if self.file is None else "a file"
            raise fault(f"{wrong[0]} {why}", got, f"remove {wrong[0]}", (wrong[0],))
        unit_of(self)
        return self


class FixtureTable(Table):
    """[[cell.fixture]]: a box or a solid from a file, standing still or on an external axis."""

    name: Annotated[Text, key("a name that no other body has", '"table"')]
    size_mm: Annotated[
        ThreePositive | None, key("3 numbers above 0, the edges of a box in mm", "[1000, 800, 50]")
    ] = None
    file: Annotated[MeshFile | None, MESH_FILE] = None
    unit: Annotated[Unit | None, key("the unit of the file's numbers", '"mm"')] = None
    xyz_mm: Annotated[
        Three,
        key(
            "3 numbers, the box's centre or the file's origin in the robot base in mm",
            "[1450, -600, 0]",
        ),
    ] = (0.0, 0.0, 0.0)
    rpy_deg: Annotated[
        Three, key("3 numbers, roll, pitch and yaw in the robot base in deg", "[0, 0, 90]")
    ] = (0.0, 0.0, 0.0)
    on: Annotated[
        Text | None, key("the name of the external axis that it moves with", '"table"')
    ] = None

    @model_validator(mode="after")
    def _one_shape(self) -> FixtureTable:
        what = "one of size_mm (a box) and file (STL or STEP)"
        require_one(self, ("size_mm", "file"), what, "size_mm = [1000, 800, 50]")
        unit_of(self)
        return self


class PairTable(Table):
    """[[cell.pair]]: the near-miss distance of two bodies, or the reason why they may touch."""

    between: Annotated[Pair, key("the names of two bodies", '["nozzle", "clamp"]')]
    near_miss_mm: Annotated[NotNegative | None, key("a number not below 0, in mm", "2")] = None
    allowed: Annotated[
        Text | None, key("why the two may touch, in words", '"the hose rests on it"')
    ] = None

    @model_validator(mode="after")
    def _one_rule(self) -> PairTable:
        what = "one of near_miss_mm (how near they may come) and allowed (why they may touch)"
        require_one(self, ("near_miss_mm", "allowed"), what, "near_miss_mm = 2")
        return self


class CellTable(Table):
    """[cell]: with it, every motion is planned and audited to be free of collisions."""

    near_miss_mm: Annotated[
        NotNegative, key("a number not below 0, the least distance of two bodies, in mm", "5")
    ]
    links: Annotated[
        Literal["capsules", "description"] | None,
        key("the shape of the robot's links", '"capsules"'),
    ] = None
    stand_off_mm: Annotated[Positive, key("a number above 0, in mm", "1")] = 1.0
    share: Annotated[
        Number, key("a share of the stand-off, from 0 to below 1", "0.5", ge=0, lt=1)
    ] = 0.5
    head: HeadTable = HeadTable()
    part: Annotated[bool, key("true or false", "true")] = True
    deviation_mm: Annotated[Positive, key("a number above 0, in mm", "0.2")] = 0.2
    sheet_mm: Annotated[Positive | None, key("a number above 0, in mm", "1.5")] = None
    fixture: Annotated[tuple[FixtureTable, ...], Field(strict=False)] = ()
    pair: Annotated[tuple[PairTable, ...], Field(strict=False)] = ()
    may_touch: Annotated[
        tuple[Pair, ...], key("pairs of names of bodies", '[["arm", "table"]]', strict=False)
    ] = ()
    map: Annotated[bool, key("true or false", "true")] = False

    @model_validator(mode="after")
    def _names_differ(self) -> CellTable:
        names = [table.name for table in self.fixture]
        require_distinct(names, "body", "fixture", ["name"] * len(names))
        if self.sheet_mm is not None and not self.part:
            raise fault("sheet_mm only with the part", "part = false", "remove one", ("sheet_mm",))
        return self
