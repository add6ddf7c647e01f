"""The [tool] table: the cutting head or the pose of its tip, and the load on the flange."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import model_validator

from kerfpath._arrays import Array
from kerfpath.dynamics import Load
from kerfpath.errors import InputError
from kerfpath.job.format._poses import heads, pose
from kerfpath.job.format._values import (
    Head,
    NotNegative,
    Number,
    Three,
    fault,
    fault_in_words,
    key,
)
from kerfpath.job.format.tables._table import Table, given

__all__ = ["ToolTable"]


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
