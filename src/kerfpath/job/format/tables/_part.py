"""The [part] table: the CAD file, and where the part is."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator

from kerfpath._arrays import Array
from kerfpath.job.format._poses import pose
from kerfpath.job.format._values import Text, Three, existing, key
from kerfpath.job.format.tables._table import Table

__all__ = ["PartTable"]


class PartTable(Table):
    """[part]: the CAD file, and where the part is in the robot base."""

    file: Annotated[
        Text,
        AfterValidator(existing("the part's CAD file")),
        key("the path of the part's CAD file", '"b_pillar.step"'),
    ]
    unit: Literal["mm", "cm", "m", "in"] | None = None
    xyz_mm: Annotated[
        Three, key("3 numbers, the part's position in the robot base in mm", "[1450, -600, 450]")
    ]
    rpy_deg: Annotated[
        Three,
        key("3 numbers, the part's roll, pitch and yaw in the robot base in deg", "[0, 0, 90]"),
    ]

    def resolve(self) -> Array:
        """Return T_base_part, (4, 4), m."""
        return pose(self.xyz_mm, self.rpy_deg)
