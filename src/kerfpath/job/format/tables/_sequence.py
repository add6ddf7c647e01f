"""The [sequence] table: the order of cutting, and the moves between the contours."""

from __future__ import annotations

from typing import Annotated, Literal

from kerfpath.job.format._values import Joints, NotNegative, Positive, key
from kerfpath.job.format.tables._table import Table

__all__ = ["SequenceTable"]


class SequenceTable(Table):
    """[sequence]: with it, the moves between contours are planned and audited, too."""

    order: Annotated[
        Literal["given", "best"], key("the order of the file, or the fastest order", '"best"')
    ] = "best"
    inner_first: Annotated[bool, key("true or false", "true")] = True
    heat_spacing_mm: Annotated[NotNegative, key("a number not below 0, in mm", "40")] = 0.0
    home_deg: Annotated[
        Joints | None, key("one number for every joint, in deg", "[0, -20, 10, 0, 60, 0]")
    ] = None
    seconds: Annotated[Positive, key("a number above 0, in s", "10")] = 10.0
