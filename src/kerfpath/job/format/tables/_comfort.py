"""The [comfort] table: margins to singularities, limits and bodies, and penalties beyond them."""

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
"""Margin of the joints to their limits, in deg, unless the table sets another. The digits of a
program move a joint by some thousandths of a degree, near a singularity by some hundredths."""

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
"""For each band of `kerfpath.Comfort`: the unit of its keys, and the factor to SI."""


class ComfortTable(Table):
    """[comfort]: margins that are kept, and bands beyond them in which a node has a penalty."""

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
        """Require that a cost and its band are given together."""
        for name, (unit, _) in UNITS.items():
            keys = f"{name}_band_{unit}", f"{name}_cost"
            for one, other in (keys, keys[::-1]):
                if getattr(self, one) is not None and getattr(self, other) is None:
                    raise fault(f"{other} with {one}", "none", f"add {other}", (one,))
        return self

    def resolve(self, usual: Mapping[str, float] | None = None) -> Comfort | None:
        """Return the margins and bands of the table, in SI; None if there are none.

        `usual` has default margins by measure, in the unit of its keys, where the table sets none.
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
