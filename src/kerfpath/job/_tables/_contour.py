"""The [[contour]] tables: which loops are cut, how fast, and how finely."""

from __future__ import annotations

from typing import Annotated

from pydantic import model_validator

from kerfpath.job._keys import MOST_NODES, Positive, Text, fault, key
from kerfpath.job._tables._table import Table, given

__all__ = ["ContourTable"]


class ContourTable(Table):
    """[[contour]]: which loop of the part to cut, how fast, and how finely it is sampled."""

    pick: Annotated[Text, key("the name of a loop in the part", '"trim"')]
    name: Annotated[Text | None, key("a name that no other contour has", '"trim 2"')] = None
    speed_m_min: Annotated[Positive, key("a number above 0, in m/min", "9")]
    spacing_mm: Annotated[Positive | None, key("a number above 0, in mm", "2")] = None
    count: Annotated[
        int | None, key(f"a whole number of nodes, 2 to {MOST_NODES}", "200", ge=2, le=MOST_NODES)
    ] = None
    tolerance_mm: Annotated[Positive | None, key("a number above 0, in mm", "0.05")] = None
    axis_tolerance_deg: Annotated[Positive | None, key("a number above 0, in deg", "1")] = None

    @model_validator(mode="after")
    def _one_sampling(self) -> ContourTable:
        ways = ("spacing_mm", "count", "tolerance_mm")
        found = given(self, *ways)
        if not found:
            raise fault(
                "one of spacing_mm, count and tolerance_mm",
                "none",
                "add, for example, spacing_mm = 2",
                ways[:1],
            )
        if len(found) > 1:
            raise fault(
                "one of spacing_mm, count and tolerance_mm",
                " and ".join(found),
                "keep one",
                (found[-1],),
            )
        if self.axis_tolerance_deg is not None and self.tolerance_mm is None:
            raise fault(
                "axis_tolerance_deg only with tolerance_mm",
                f"it with {found[0]}",
                "remove one",
                ("axis_tolerance_deg",),
            )
        return self
