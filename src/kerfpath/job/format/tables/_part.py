"""The [part] table: the CAD file, and where the part is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, model_validator

from kerfpath._arrays import Array, freeze
from kerfpath.cad import GAP, UNITS_MM
from kerfpath.job.format._drawing import Drawing
from kerfpath.job.format._poses import pose
from kerfpath.job.format._values import Positive, Text, Three, existing, fault, key, one_of
from kerfpath.job.format.tables._table import Table

__all__ = ["PartTable"]


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
    left_out: Annotated[
        Literal["refuse", "accept"],
        key("what to do if something to cut may be left out of the drawing", '"accept"'),
    ] = "refuse"
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
        return self

    def drawing(self, folder: Path) -> Drawing:
        """Return the drawing; its path is relative to `folder`."""
        return Drawing(
            file=folder / self.file,
            unit=self.unit,
            gap=self.gap_mm / 1000,
            outer_towards=_direction(self.outer_towards),
            axis=_direction(self.axis),
            columns=self.columns,
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
