"""The [tool] table: the cutting head, or where its tip is."""

from __future__ import annotations

from typing import Annotated

from pydantic import model_validator

from kerfpath._arrays import Array
from kerfpath.job.format._poses import heads, pose
from kerfpath.job.format._values import Head, Three, fault, key
from kerfpath.job.format.tables._table import Table, given

__all__ = ["ToolTable"]


class ToolTable(Table):
    """[tool]: a shipped cutting head, or where the tip is in the flange."""

    head: Annotated[Head | None, key("a cutting head, by its name", '"laser-head-straight"')] = None
    xyz_mm: Annotated[
        Three | None, key("3 numbers, the tip's position in the flange in mm", "[0, 0, 350]")
    ] = None
    rpy_deg: Annotated[
        Three | None, key("3 numbers, the tip's roll, pitch and yaw in deg", "[0, 45, 0]")
    ] = None

    @model_validator(mode="after")
    def _one_tip(self) -> ToolTable:
        found = given(self, "xyz_mm", "rpy_deg")
        if self.head is not None and found:
            raise fault("head alone", "both", f"remove {found[0]} or head", (found[0],))
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

    def resolve(self) -> Array:
        """Return T_flange_tip, (4, 4), m."""
        if self.head is not None:
            return pose(*heads()[self.head])
        assert self.xyz_mm is not None
        assert self.rpy_deg is not None
        return pose(self.xyz_mm, self.rpy_deg)
