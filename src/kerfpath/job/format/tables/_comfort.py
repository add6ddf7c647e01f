"""The [comfort] table: what the arm is to keep away from, and what coming near costs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from kerfpath.comfort import Band, Comfort
from kerfpath.job.format._values import NotNegative, Positive, fault, key
from kerfpath.job.format.tables._table import Table

__all__ = ["LIMITS_MARGIN", "ComfortTable"]

LIMITS_MARGIN = 0.1
"""deg: what joints keep from their limits unless the table says otherwise. The digits of a
program move a joint by some thousandths, and by tens of them near a singularity."""

Angle = Annotated[
    Annotated[Positive, Field(lt=90)] | None, key("a number above 0, below 90, in deg", "5")
]
Room = Annotated[Positive | None, key("a number above 0, in deg", "5")]
RoomOrNone = Annotated[NotNegative | None, key("a number not below 0, in deg", "0.1")]
Length = Annotated[Positive | None, key("a number above 0, in mm", "50")]
Volume = Annotated[Positive | None, key("a number above 0, in m^3", "0.05")]
Cost = Annotated[NotNegative | None, key("a number not below 0", "1")]

DEGREE = float(np.radians(1.0))
UNITS = {
    "wrist": ("deg", DEGREE),
    "elbow": ("deg", DEGREE),
    "shoulder": ("mm", 1e-3),
    "limits": ("deg", DEGREE),
    "manipulability": ("m3", 1.0),
    "clearance": ("mm", 1e-3),
}
"""Of each band of `kerfpath.Comfort`: the unit of its keys, and what that is in SI."""


class ComfortTable(Table):
    """[comfort]: margins that are kept, and bands beyond them in which a node costs something."""

    wrist_margin_deg: Angle = None
    wrist_band_deg: Angle = None
    wrist_cost: Cost = None
    elbow_margin_deg: Angle = None
    elbow_band_deg: Angle = None
    elbow_cost: Cost = None
    shoulder_margin_mm: Length = None
    shoulder_band_mm: Length = None
    shoulder_cost: Cost = None
    limits_margin_deg: RoomOrNone = None
    limits_band_deg: Room = None
    limits_cost: Cost = None
    manipulability_margin_m3: Volume = None
    manipulability_band_m3: Volume = None
    manipulability_cost: Cost = None
    clearance_band_mm: Length = None
    clearance_cost: Cost = None

    @model_validator(mode="after")
    def _goes_together(self) -> ComfortTable:
        """Require a cost and the band that it falls over of each other."""
        for name, (unit, _) in UNITS.items():
            keys = f"{name}_band_{unit}", f"{name}_cost"
            for one, other in (keys, keys[::-1]):
                if getattr(self, one) is not None and getattr(self, other) is None:
                    raise fault(f"{other} with {one}", "none", f"add {other}", (one,))
        return self

    def resolve(self, usual: Mapping[str, float] | None = None) -> Comfort | None:
        """Return what the table asks for, in SI; None where it asks for nothing.

        `usual` has margins by measure, in the unit of its keys, of which the table says nothing.
        """
        bands = {}
        for name, (unit, si) in UNITS.items():
            # The margin of clearance is the near-miss distance of the cell.
            margin = getattr(self, f"{name}_margin_{unit}", None)
            margin = (usual or {}).get(name) if margin is None else margin
            width = getattr(self, f"{name}_band_{unit}")
            if margin or width is not None:
                bands[name] = Band(
                    margin=(margin or 0.0) * si,
                    width=(width or 0.0) * si,
                    cost=getattr(self, f"{name}_cost") or 0.0,
                )
        return Comfort(**bands) if bands else None
