"""The [part] table: the CAD file and its place, and the rule that a file named is there."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, ValidationInfo

from kerfpath._arrays import Array
from kerfpath.job._heads import pose
from kerfpath.job._keys import Text, Three, fault, key
from kerfpath.job._tables._table import Table

__all__ = ["PartTable"]


def _existing(value: str, info: ValidationInfo) -> str:
    """Require the file in the folder of the job."""
    folder: Path = info.context["folder"] if info.context else Path()
    try:
        is_file, is_there = (folder / value).is_file(), (folder / value).exists()
    except (OSError, ValueError):  # a name that the file system cannot hold
        is_file = is_there = False
    if not is_file:
        why = "it is not a file" if is_there else f"it is not in {folder}"
        raise fault("the part's CAD file", None, f"{why}; give its path relative to the job file")
    return value


class PartTable(Table):
    """[part]: the CAD file, and where the part is in the robot base."""

    file: Annotated[
        Text, AfterValidator(_existing), key("the path of the part's CAD file", '"b_pillar.step"')
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
