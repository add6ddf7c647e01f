"""The [tool] and [cell] tables: the cutting head, the bodies of the cell and their distances."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from kerfpath.arrays import Array
from kerfpath.cell import MESHES
from kerfpath.dynamics import Load
from kerfpath.errors import InputError
from kerfpath.job.format.tables.table import (
    Head,
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
    heads,
    key,
    pose,
    require_distinct,
    require_one,
)

# -----------------------------------------------------------------------------
# The [tool] table: the cutting head or the pose of its tip, and the load on the flange.


class ToolTable(Table):
    """[tool]: a shipped cutting head, or the tip in the flange; and the load on the flange."""

    head: Annotated[Head | None, key("a cutting head, by its name", '"laser-head-straight"')] = None
    xyz_mm: Annotated[
        Three | None, key("3 numbers, the tip's position in the flange in mm", "[0, 0, 350]")
    ] = None
    rpy_deg: Annotated[
        Three | None, key("3 numbers, the tip's roll, pitch and yaw in deg", "[0, 45, 0]")
    ] = None

    mass_kg: Annotated[
        NotNegative | None, key("a number not below 0, the load on the flange in kg", "25")
    ] = None
    centre_mm: Annotated[
        Three | None, key("3 numbers, the load's centre of mass in the flange in mm", "[0, 0, 120]")
    ] = None
    inertia_kg_m2: Annotated[
        tuple[Number, ...] | None,
        key(
            "6 numbers, the load's inertia xx, yy, zz, xy, xz and yz about its centre of mass, "
            "along the flange's axes, in kg m^2",
            "[0.4, 0.5, 0.3, 0, 0, 0]",
            strict=False,
            min_length=6,
            max_length=6,
        ),
    ] = None

    @model_validator(mode="after")
    def _one_tip(self) -> ToolTable:
        found = given(self, "xyz_mm", "rpy_deg")
        if self.head is not None and found:
            got = f"it with {found[0]}"
            raise fault("head alone", got, f"remove {found[0]} or head", (found[0],))
        if self.head is None and not found:
            raise fault(
                "a cutting head",
                "none",
                f"add head ({', '.join(heads())}), or xyz_mm and rpy_deg of the tip",
                ("head",),
            )
        if len(found) == 1:
            other = "rpy_deg" if found == ["xyz_mm"] else "xyz_mm"
            raise fault(f"{other} together with {found[0]}", "nothing", "add it", (other,))
        return self

    @model_validator(mode="after")
    def _possible_load(self) -> ToolTable:
        """Require all values of the load that torques need, once one of them is given."""
        found = given(self, "centre_mm", "inertia_kg_m2")
        if self.mass_kg is None and found:
            raise fault(f"mass_kg with {found[0]}", "none", "add mass_kg", ("mass_kg",))
        if self.mass_kg and self.centre_mm is None:
            raise fault(
                f"the centre of mass of {self.mass_kg:g} kg in the flange, in mm",
                "none",
                "add centre_mm",
                ("centre_mm",),
            )
        try:
            self.load()
        except InputError as error:
            said = str(error).removeprefix("load tensor: ")
            raise fault_in_words(f"{said}; correct it", ("inertia_kg_m2",)) from None
        return self

    def load(self) -> Load | None:
        """Return the load on the flange; None if the job does not give one."""
        if self.mass_kg is None:
            return None
        centre, tensor = self.centre_mm, None
        if self.inertia_kg_m2 is not None:
            xx, yy, zz, xy, xz, yz = self.inertia_kg_m2
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return Load(
            mass=self.mass_kg,
            centre=None if centre is None else np.array(centre) / 1000,
            tensor=tensor,
        )

    def resolve(self) -> Array:
        """Return T_flange_tip, (4, 4), m."""
        if self.head is not None:
            return pose(*heads()[self.head])
        assert self.xyz_mm is not None
        assert self.rpy_deg is not None
        return pose(self.xyz_mm, self.rpy_deg)


# -----------------------------------------------------------------------------
# The [cell] table: the bodies of the cell, and the near-miss distance of each pair of them.

Unit = Literal["mm", "cm", "m", "in"]
ThreePositive = Annotated[tuple[Positive, ...], Field(strict=False, min_length=3, max_length=3)]
TwoPositive = Annotated[tuple[Positive, ...], Field(strict=False, min_length=2, max_length=2)]
Pair = Annotated[tuple[Text, ...], Field(strict=False, min_length=2, max_length=2)]


def unit_of(table: HeadTable | FixtureTable) -> None:
    """Require a unit for a mesh, which does not state it, and none without a file.

    Raises
    ------
    PydanticCustomError
        At the key `unit`.
    """
    if table.file is None and table.unit is not None:
        raise fault("unit only with file", "no file", "remove unit", ("unit",))
    if table.file is not None and table.file.lower().endswith(MESHES) and table.unit is None:
        raise fault(
            "the unit of the mesh, which does not state it",
            "none",
            'add, for example, unit = "mm"',
            ("unit",),
        )


SOLIDS = (*MESHES, ".step", ".stp")
"""Suffixes of files with a solid."""


def _solid_file(value: str) -> str:
    if not value.lower().endswith(SOLIDS):
        known = ", ".join(SOLIDS)
        raise fault(f"a mesh or STEP file ({known})", None, "export the solid as one")
    return value


SolidFile = Annotated[
    Text,
    AfterValidator(_solid_file),
    AfterValidator(existing("a mesh or STEP file")),
]
SOLID_FILE = key("the path of a mesh (STL, OBJ, PLY) or STEP file", '"clamp.stl"')


class HeadTable(Table):
    """[cell.head]: a solid from a file, or sizes that replace those of the generic head."""

    file: Annotated[SolidFile | None, SOLID_FILE] = None
    unit: Annotated[Unit | None, key("the unit of the file's numbers", '"mm"')] = None
    xyz_mm: Annotated[
        Three | None, key("3 numbers, the file's origin in the flange in mm", "[0, 0, 0]")
    ] = None
    rpy_deg: Annotated[
        Three | None, key("3 numbers, roll, pitch and yaw in the flange in deg", "[0, 0, 0]")
    ] = None
    nozzle_length_mm: Annotated[Positive | None, key("a number above 0, in mm", "60")] = None
    nozzle_radii_mm: Annotated[
        TwoPositive | None,
        key("2 numbers above 0, the radii at the nozzle's end and at the body, in mm", "[2.5, 16]"),
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
    """[[cell.fixture]]: a box, a cylinder or a file's solid, at rest or on an external axis."""

    name: Annotated[Text, key("a name that no other body has", '"table"')]
    size_mm: Annotated[
        ThreePositive | None, key("3 numbers above 0, the edges of a box in mm", "[1000, 800, 50]")
    ] = None
    cylinder_mm: Annotated[
        TwoPositive | None,
        key("2 numbers above 0, the diameter and height of a cylinder in mm", "[120, 600]"),
    ] = None
    file: Annotated[SolidFile | None, SOLID_FILE] = None
    unit: Annotated[Unit | None, key("the unit of the file's numbers", '"mm"')] = None
    xyz_mm: Annotated[
        Three,
        key(
            "3 numbers, the centre or the file's origin in the robot base in mm",
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
        what = "one of size_mm (a box), cylinder_mm and file (a mesh or STEP)"
        keys = ("size_mm", "cylinder_mm", "file")
        require_one(self, keys, what)
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
        require_one(self, ("near_miss_mm", "allowed"), what)
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
