"""The [plan] table: what is searched, and which motion is best."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import model_validator

from kerfpath.contour import FrameKind
from kerfpath.job._keys import JointsNotNegative, NotNegative, Positive, Posture, fault, key
from kerfpath.job._tables._table import Table
from kerfpath.planner import FeedKind
from kerfpath.search import Closure, Method, Metric, ObjectiveKind

__all__ = ["PlanTable"]


_PLAIN = {
    "method": "exact",
    "closure": "free",
    "rotation_deg": None,
    "objective": "sum",
    "interruptions": "none",
    "refine_parts": 1,
}
"""What feed = "dip" needs of the other keys of [plan], and the first three interruptions."""


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
    frames: FrameKind = "rotation-minimising"
    posture: Posture | None = None
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
        needs = {
            'feed = "dip"': () if self.feed == "constant" else tuple(_PLAIN),
            'interruptions = "fewest"': () if self.interruptions == "none" else tuple(_PLAIN)[:3],
            'closure = "periodic"': () if self.closure == "free" else ("method",),
        }
        for why, keys in needs.items():
            for name in keys:
                value, plain = getattr(self, name), _PLAIN[name]
                if value != plain:
                    expected = f"{name} = {_toml(plain)}" if plain else f"no {name}"
                    raise fault(f"{expected} with {why}", _toml(value), "change one", (name,))
        return self
