"""The [[robot.external]] tables: rails, tables and tilts that move with the robot."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from kerfpath.job.format._values import Number, Positive, Three, fault, key
from kerfpath.job.format.tables._table import Table, given
from kerfpath.robots import ExternalAxis, Robot

__all__ = ["External", "ExternalTable"]

KEYS = {
    "linear": ("lower_mm", "upper_mm", "velocity_mm_s", "acceleration_mm_s2", "step_mm", "home_mm"),
    "rotary": (
        "lower_deg", "upper_deg", "velocity_deg_s", "acceleration_deg_s2", "step_deg", "home_deg",
    ),
}  # fmt: skip
"""Keys of each kind: range, speed, acceleration, step of a grid, home."""
EXAMPLES = {
    "lower_mm": "-2000", "upper_mm": "2000", "velocity_mm_s": "1000", "acceleration_mm_s2": "1500",
    "lower_deg": "-180", "upper_deg": "180", "velocity_deg_s": "120", "acceleration_deg_s2": "200",
}  # fmt: skip


class ExternalTable(Table):
    """[[robot.external]]: one external axis; of those of one side the first carries the next."""

    name: Annotated[
        str,
        key(
            "a name of letters, digits and _, a letter first, at most 16 characters",
            '"rail"',
            pattern=r"^[A-Za-z][A-Za-z0-9_]{0,15}$",
        ),
    ]
    kind: Annotated[Literal["linear", "rotary"], key("a kind of axis", '"linear"')]
    carries: Annotated[Literal["robot", "part"], key("what it moves", '"robot"')]
    axis: Annotated[Three, key("its direction in the robot base, three numbers", "[0, 1, 0]")]
    point_mm: Annotated[
        Three | None,
        key("a point of its axis in the robot base, three numbers in mm", "[1200, 0, 500]"),
    ] = None
    endless: Annotated[bool, key("true or false", "true")] = False
    lower_mm: Annotated[Number | None, key("a number, in mm", "-2000")] = None
    upper_mm: Annotated[Number | None, key("a number, in mm", "2000")] = None
    lower_deg: Annotated[Number | None, key("a number, in deg", "-180")] = None
    upper_deg: Annotated[Number | None, key("a number, in deg", "180")] = None
    velocity_mm_s: Annotated[Positive | None, key("a number above 0, in mm/s", "1000")] = None
    velocity_deg_s: Annotated[Positive | None, key("a number above 0, in deg/s", "120")] = None
    acceleration_mm_s2: Annotated[Positive | None, key("a number above 0, in mm/s^2", "1500")] = (
        None
    )
    acceleration_deg_s2: Annotated[Positive | None, key("a number above 0, in deg/s^2", "200")] = (
        None
    )
    step_mm: Annotated[Positive | None, key("a number above 0, in mm", "100")] = None
    step_deg: Annotated[Positive | None, key("a number above 0, in deg", "10")] = None
    home_mm: Annotated[Number | None, key("a number, in mm", "0")] = None
    home_deg: Annotated[Number | None, key("a number, in deg", "0")] = None

    @model_validator(mode="after")
    def _whole(self) -> ExternalTable:
        """Require every limit, in the unit of the kind, and no key of the other kind."""
        other = "rotary" if self.kind == "linear" else "linear"
        for name in given(self, *KEYS[other]):
            own = KEYS[self.kind][KEYS[other].index(name)]
            raise fault(f"{own} of a {self.kind} axis", "it", f"write {own}", (name,))
        if not any(self.axis):
            raise fault("a direction", "[0, 0, 0]", "give the one it moves along", ("axis",))
        if self.kind == "linear" and self.point_mm is not None:
            raise fault("point_mm only of a rotary axis", "it", "remove it", ("point_mm",))
        if self.kind == "rotary" and self.point_mm is None:
            said = "a point of its axis in the robot base"
            raise fault(said, "none", "add, for example, point_mm = [1200, 0, 500]", ("point_mm",))
        if self.endless and self.kind == "linear":
            raise fault("false of a linear axis", "true", "remove it", ("endless",))
        lower, upper, *_ = KEYS[self.kind]
        for name in KEYS[self.kind][:4]:
            free = self.endless and name in (lower, upper)
            if free and getattr(self, name) is not None:
                raise fault(f"no {name} of an endless axis", "it", "remove one", (name,))
            if not free and getattr(self, name) is None:
                hint = f"add, for example, {name} = {EXAMPLES[name]}"
                raise fault("every limit of the axis", f"no {name}", hint, (name,))
        low, high, home = self._value(0), self._value(1), self._value(5)
        if low is not None and high is not None and not low <= high:
            said = f"{high:g} below {low:g}"
            raise fault(f"{upper} not below {lower}", said, "swap them", (upper,))
        if home is not None and low is not None and high is not None and not low <= home <= high:
            name = KEYS[self.kind][5]
            raise fault(f"a home from {low:g} to {high:g}", f"{home:g}", "move it", (name,))
        return self

    def _value(self, number: int) -> float | None:
        """Return the number at one of the keys of its kind."""
        value: float | None = getattr(self, KEYS[self.kind][number])
        return value

    @property
    def factor(self) -> float:
        """What a number of its keys times is, in m or rad."""
        return 1e-3 if self.kind == "linear" else float(np.pi / 180)

    @property
    def home(self) -> float:
        """Where it stands when the robot is at home, m or rad: at zero, or nearest to it."""
        if self._value(5) is not None:
            return self.factor * (self._value(5) or 0.0)
        low, high = self._value(0), self._value(1)
        nearest = 0.0 if low is None or high is None else min(max(0.0, low), high)
        return self.factor * nearest

    def on(self, robot: Robot) -> Robot:
        """Return the robot with this axis more."""
        lower, upper, velocity, acceleration, step = (
            None if (value := self._value(i)) is None else self.factor * value for i in range(5)
        )
        axis: dict[str, Any] = {"axis": self.axis}
        if self.point_mm is not None:
            axis["point"] = np.array(self.point_mm) / 1000
        assert velocity is not None
        assert acceleration is not None
        return robot.with_external(
            ExternalAxis(name=self.name, kind=self.kind, carries=self.carries, step=step, **axis),
            lower=-np.pi if lower is None else lower,
            upper=np.pi if upper is None else upper,
            velocity=velocity,
            acceleration=acceleration,
            endless=self.endless,
        )


External = Annotated[tuple[ExternalTable, ...], Field(strict=False, max_length=3)]
