"""The [plan] table: what is searched, and which motion is best."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from kerfpath.contour import FrameKind
from kerfpath.job.format._values import JointsNotNegative, NotNegative, Positive, fault, key
from kerfpath.job.format.tables._table import Table, given
from kerfpath.planner import FeedKind
from kerfpath.search import Closure, Method, Metric, ObjectiveKind
from kerfpath.tilt import Tilt

__all__ = ["PlanTable"]


PLAIN = {
    "method": "exact",
    "closure": "free",
    "rotation_deg": None,
    "objective": "sum",
    "interruptions": "none",
    "refine_parts": 1,
    "tilt_deg": None,
}
"""What keys of [plan] must be where another key cannot do with anything else."""
NEEDS = {
    'feed = "dip"': (
        "method", "closure", "rotation_deg", "objective", "interruptions", "refine_parts",
    ),
    'interruptions = "fewest"': ("method", "closure", "rotation_deg", "tilt_deg"),
    'closure = "periodic"': ("method",),
    "rotation_deg": ("method",),
    "tilt_deg": ("refine_parts",),
}  # fmt: skip
"""Of a key, or a value of it: which others must then be plain."""


def _toml(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else f"{value}"


class PlanTable(Table):
    """[plan]: what is searched, and which motion is best."""

    gamma_step_deg: Annotated[
        Positive, key("a number above 0, at most 360, in deg", "1", le=360)
    ] = 1.0
    objective: ObjectiveKind = "sum"
    metric: Metric = "manhattan"
    method: Method = "exact"
    closure: Closure = "free"
    rotation_deg: Annotated[NotNegative | None, key("a number not below 0, in deg", "360")] = None
    interruptions: Literal["none", "fewest"] = "none"
    least_piece_mm: Annotated[Positive | None, key("a number above 0, in mm", "20")] = None
    frames: FrameKind = "rotation-minimising"
    tilt_deg: Annotated[
        Annotated[Positive, Field(lt=90)] | None, key("a number above 0, below 90, in deg", "3")
    ] = None
    tilt_steps: Annotated[int | None, key("a whole number from 1 to 10", "2", ge=1, le=10)] = None
    tilt_cost_per_deg: Annotated[NotNegative | None, key("a number not below 0", "0.01")] = None
    posture: Annotated[str | None, key("a posture in words", '"front/up"')] = None
    feed: FeedKind = "constant"
    refine: Annotated[bool | None, key("true or false", "true")] = None
    refine_parts: Annotated[
        int, key("a whole number of parts from 1 to 100", "4", ge=1, le=100)
    ] = 1
    eta_velocity: Annotated[Positive, key("a number above 0, at most 1", "0.95", le=1)] = 1.0
    eta_acceleration: Annotated[Positive, key("a number above 0, at most 1", "0.9", le=1)] = 1.0
    weights: Annotated[
        JointsNotNegative | None,
        key("a number not below 0 for every joint, in 1/rad", "[1, 1, 1, 1, 1, 1]"),
    ] = None

    @model_validator(mode="after")
    def _goes_together(self) -> PlanTable:
        """Refuse what the planner cannot do together, at its key."""
        for why, others in NEEDS.items():
            one, _, value = why.partition(" = ")
            asked = getattr(self, one)
            if asked is None or (value and _toml(asked) != value):
                continue
            for name in others:
                if (got := getattr(self, name)) != (plain := PLAIN[name]):
                    expected = f"{name} = {_toml(plain)}" if plain else f"no {name}"
                    raise fault(f"{expected} with {why}", _toml(got), "change one", (name,))
        if self.least_piece_mm is not None and self.interruptions == "none":
            expected = 'interruptions = "fewest" with least_piece_mm'
            raise fault(expected, "none", "add it, or remove the length", ("least_piece_mm",))
        for name in given(self, "tilt_steps", "tilt_cost_per_deg"):
            if self.tilt_deg is None:
                raise fault(f"tilt_deg with {name}", "none", "add tilt_deg", (name,))
        return self

    def tilt(self) -> Tilt | None:
        """Return the tolerance of the tool axis; None where the table asks for none."""
        if self.tilt_deg is None:
            return None
        return Tilt(
            cone=float(np.radians(self.tilt_deg)),
            steps=self.tilt_steps or 1,
            cost=float(np.degrees(self.tilt_cost_per_deg or 0.0)),
        )
