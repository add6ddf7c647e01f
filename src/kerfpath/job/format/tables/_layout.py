"""The [layout] table: what may be moved and how far, and the goal of the best placement."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from kerfpath.job.format._values import NotNegative, Number, Text, fault, key
from kerfpath.job.format.tables._table import Table, given

__all__ = ["VARIABLES", "Goal", "LayoutTable", "rising"]

Goal = Literal["speed", "margin", "motion"]
VARIABLES = (
    "x_mm", "y_mm", "z_mm", "yaw_deg", "tilt_x_deg", "tilt_y_deg",
    "base_x_mm", "base_y_mm", "base_z_mm", "base_yaw_deg",
    "mount_deg",
)  # fmt: skip
"""What may vary: offsets of the part, then of the robot's base, then the rotation of the head."""


def rising(value: tuple[float, ...]) -> tuple[float, ...]:
    """Return a range whose lower end is below its upper end.

    Raises
    ------
    PydanticCustomError
        The range is reversed or empty.
    """
    low, high = value
    if not low < high:
        what = "an empty range" if low == high else "a reversed one"
        raise fault("[low, high] with low below high", what, f"write [{high:g}, {low:g}]"
                    if low > high else "leave it out, or widen it")  # fmt: skip
    return value


Span = Annotated[
    tuple[Number, ...],
    Field(strict=False, min_length=2, max_length=2),
    AfterValidator(rising),
]
Millimetres = Annotated[
    Span | None, key("2 numbers, the least and the largest offset in mm", "[-200, 200]")
]
Degrees = Annotated[
    Span | None, key("2 numbers, the least and the largest rotation in deg", "[-30, 30]")
]


class LayoutTable(Table):
    """[layout]: the ranges in which `kerfpath layout` looks for the best placement."""

    goal: Goal = "speed"
    move: Annotated[
        Text, key('"part", or the name of an external axis that carries it', '"part"')
    ] = "part"
    x_mm: Millimetres = None
    y_mm: Millimetres = None
    z_mm: Millimetres = None
    yaw_deg: Degrees = None
    tilt_x_deg: Degrees = None
    tilt_y_deg: Degrees = None
    base_x_mm: Millimetres = None
    base_y_mm: Millimetres = None
    base_z_mm: Millimetres = None
    base_yaw_deg: Degrees = None
    mount_deg: Degrees = None
    standing: Annotated[tuple[Text, ...], key("names of fixtures", '["column"]', strict=False)] = ()
    evaluations: Annotated[
        int, key("a whole number of placements from 8 to 100000", "240", ge=8, le=100_000)
    ] = 240
    seed: Annotated[int, key("a whole number not below 0", "1", ge=0, le=2**31)] = 0
    tolerance_mm: Annotated[NotNegative, key("a number not below 0, in mm", "2")] = 0.0
    tolerance_deg: Annotated[NotNegative, key("a number not below 0, in deg", "0.5")] = 0.0
    map_points: Annotated[int, key("a whole number from 0 (no map) to 101", "15", ge=0, le=101)] = (
        15
    )

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """The given ranges by variable, in the units of the keys."""
        spans = {name: getattr(self, name) for name in given(self, *VARIABLES)}
        return {name: (low, high) for name, (low, high) in spans.items()}
