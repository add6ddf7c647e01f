"""The [robot] table: which robot, and limits that replace the known ones."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import model_validator

from kerfpath._arrays import Array
from kerfpath.errors import InputError
from kerfpath.job._keys import Axis, Ratio, Six, SixPositive, fault, key, one_of
from kerfpath.job._tables._table import Table, given
from kerfpath.robots import Robot, acceleration_ratios, robot, robot_ids

__all__ = ["RobotTable"]


class RobotTable(Table):
    """[robot]: which robot, and limits that replace those of the library."""

    model: Annotated[
        str,
        one_of("a robot of the library", robot_ids, "; 'kerfpath robots' lists all"),
        key("a robot of the library", '"abb_irb4600_60_205"'),
    ]
    endless: Annotated[
        tuple[Axis, ...] | None, key("axis numbers from 1 to 6, each once", "[4, 6]", strict=False)
    ] = None
    lower_deg: Annotated[
        Six | None,
        key("6 numbers, the lower joint limits in deg", "[-180, -90, -180, -400, -125, -400]"),
    ] = None
    upper_deg: Annotated[
        Six | None,
        key("6 numbers, the upper joint limits in deg", "[180, 150, 75, 400, 120, 400]"),
    ] = None
    velocity_deg_s: Annotated[
        SixPositive | None,
        key(
            "6 numbers above 0, the largest joint speeds in deg/s", "[175, 175, 175, 250, 250, 360]"
        ),
    ] = None
    acceleration_deg_s2: Annotated[
        SixPositive | None,
        key(
            "6 numbers above 0, the largest joint accelerations in deg/s^2",
            "[320, 270, 420, 1300, 1400, 2000]",
        ),
    ] = None
    acceleration_ratio: Annotated[
        Ratio | None, key("a ratio of acceleration to speed, by its name", '"iontec_20_to_70kg"')
    ] = None

    @model_validator(mode="after")
    def _plannable(self) -> RobotTable:
        """Require every limit that planning needs, known or given: nothing is assumed silently."""
        known = robot(self.model)
        if len(set(self.endless or ())) < len(self.endless or ()):
            raise fault("each axis once", "one twice", "remove it", ("endless",))
        if len(given(self, "acceleration_deg_s2", "acceleration_ratio")) == 2:
            raise fault(
                "acceleration_deg_s2 or acceleration_ratio",
                "both",
                "remove one",
                ("acceleration_ratio",),
            )
        limits = {"lower_deg": known.lower, "upper_deg": known.upper}
        for name, value in {**limits, "velocity_deg_s": known.velocity}.items():
            if value is None and getattr(self, name) is None:
                raise fault(
                    f"6 numbers, as the library does not know those of {self.model}",
                    "none",
                    "add them from its data sheet",
                    (name,),
                )
        if known.acceleration is None and not given(
            self, "acceleration_deg_s2", "acceleration_ratio"
        ):
            raise fault(
                f"joint accelerations, as the library does not know those of {self.model}",
                "none",
                "add acceleration_deg_s2 = [6 numbers], or, to assume a typical ratio to the "
                f'speeds, acceleration_ratio = "{known.acceleration_ratio}"',
                ("acceleration_deg_s2",),
            )
        try:
            self.resolve()  # limits given may contradict those of the library
        except InputError as error:
            raise fault(
                "lower_deg below upper_deg",
                f"reversed limits ({error})",
                "correct one of them",
                ("upper_deg" if self.upper_deg else "lower_deg",),
            ) from None
        return self

    def resolve(self) -> Robot:
        """Return the robot with this table's limits."""
        endless = None if self.endless is None else np.isin(np.arange(1, 7), self.endless)
        changed = robot(self.model).with_limits(
            lower=_radians(self.lower_deg),
            upper=_radians(self.upper_deg),
            velocity=_radians(self.velocity_deg_s),
            acceleration=_radians(self.acceleration_deg_s2),
            endless=endless,
        )
        if self.acceleration_ratio is None:
            return changed
        assert changed.velocity is not None
        return replace(
            changed,
            acceleration=np.multiply(
                acceleration_ratios()[self.acceleration_ratio], changed.velocity
            ),
            acceleration_source=f"assumed: ratio {self.acceleration_ratio} times the speeds",
        )


def _radians(degrees: tuple[float, ...] | None) -> Array | None:
    return None if degrees is None else np.radians(degrees)
