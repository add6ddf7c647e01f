"""The [plan] table: the search, the objective and the limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from kerfpath.certificate import USUAL, Certify
from kerfpath.comfort import Comfort
from kerfpath.contour import FrameKind
from kerfpath.job.format.tables.cell import Table, given
from kerfpath.job.format.values import JointsNotNegative, NotNegative, Positive, fault, key
from kerfpath.options import (
    EXACT_OR_BETTER,
    BetweenNodes,
    FeedKind,
    Interruptions,
    OptionConflict,
    PlanMethod,
    PlanOptions,
)
from kerfpath.robots import Robot, postures_named
from kerfpath.search import Closure, Metric, ObjectiveKind
from kerfpath.tilt import Tilt

# -----------------------------------------------------------------------------
# Messages that advise Python arguments, translated into the keys of a job.

IN_KEYS = {
    "lower= and upper=": "lower_deg and upper_deg",
    "velocity=": "velocity_deg_s",
    "(rad, rad/s)": "(deg, deg/s)",
    "snap=5e-06": "snap_deg = 0.0003",
    "snap=5e-05": "snap_deg = 0.003",
    "snap=0.0005": "snap_deg = 0.03",
    "snap=0.005": "snap_deg = 0.3",
    "snap=0": "snap_deg = 0",
    'packages={"NAME": "FOLDER"}, or read only the kinematics with meshes=False': (
        'packages = { NAME = "FOLDER" }'
    ),
    "choose base= or tip=": "choose base or tip",
    "axis_3_limits=": "axis_3_deg",
}
"""Python arguments in messages about descriptions, and the keys of a job in their place."""


def in_keys(said: str, words: Mapping[str, str] = IN_KEYS) -> str:
    """Return a message with keys of a job file in place of Python arguments."""
    for python, ours in words.items():
        said = said.replace(python, ours)
    return said


# -----------------------------------------------------------------------------
# The [plan] table: the search, the objective and the limits.

KEYS = {
    "eta_v": "eta_velocity",
    "eta_a": "eta_acceleration",
    "gamma_step": "gamma_step_deg",
    "least_piece": "least_piece_mm",
    "postures": "posture",
    "rotation": "rotation_deg",
    "tilt": "tilt_deg",
    "comfort clearance": "clearance_band_mm",
    "comfort costs": "costs in [comfort]",
}
"""Keys of the options whose key has another name, or a unit."""


def said_in_keys(conflict: OptionConflict, table: PlanTable) -> tuple[tuple[str, str], str]:
    """Return the key of two options in conflict, and the message in the words of a job."""
    key = KEYS.get(conflict.option, conflict.option)
    expected = f"no {key}" if conflict.expected is None else f"{key} = {_toml(conflict.expected)}"
    beside = [
        KEYS[name] if name in KEYS else f"{name} = {_toml(value)}"
        for name, value in conflict.beside.items()
    ]
    got = getattr(table, key)
    standing = [
        each for each in (key, *conflict.beside) if KEYS.get(each, each) in table.model_fields_set
    ]
    at = KEYS.get(standing[0], standing[0]) if standing else key
    said = f"expected {expected} with {' and '.join(beside)}, got {_toml(got)}; change one"
    if "comfort clearance" in conflict.beside:
        return ("comfort", KEYS["comfort clearance"]), said
    return ("plan", at), said


def _toml(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return " or ".join(map(_toml, value))
    return f'"{value}"' if isinstance(value, str) else f"{value}"


class PlanTable(Table):
    """[plan]: the search, the objective and the limits of every plan."""

    gamma_step_deg: Annotated[
        Positive, key("a number above 0, at most 360, in deg", "1", le=360)
    ] = 2.0
    objective: ObjectiveKind = "sum"
    metric: Metric = "manhattan"
    method: PlanMethod = "continuous"
    closure: Closure = "free"
    rotation_deg: Annotated[NotNegative | None, key("a number not below 0, in deg", "360")] = None
    interruptions: Interruptions = "none"
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
    between_nodes: BetweenNodes = "kept"
    eta_velocity: Annotated[Positive, key("a number above 0, at most 1", "0.95", le=1)] = 1.0
    eta_acceleration: Annotated[Positive, key("a number above 0, at most 1", "0.9", le=1)] = 1.0
    weights: Annotated[
        JointsNotNegative | None,
        key("a number not below 0 for every joint, in 1/rad", "[1, 1, 1, 1, 1, 1]"),
    ] = None
    certify: Annotated[bool, key("true or false", "true")] = True
    certify_gap_percent: Annotated[
        Positive | None, key("a number above 0, at most 100, in per cent", "0.5", le=100)
    ] = None
    certify_seconds: Annotated[Positive | None, key("a number above 0, in s", "10")] = None
    certificate: Annotated[bool, key("true or false", "false")] = False

    @model_validator(mode="after")
    def _what_is_certified_is_asked_for(self) -> PlanTable:
        more = given(self, "certify_gap_percent", "certify_seconds")
        if self.certificate:
            more.append("certificate")
        if more and not self.certify:
            expected, got = f"no {more[0]} with certify = false", _toml(getattr(self, more[0]))
            raise fault(expected, got, "remove one", (more[0],))
        return self

    @model_validator(mode="after")
    def _tilt_is_asked_for(self) -> PlanTable:
        for name in given(self, "tilt_steps", "tilt_cost_per_deg"):
            if self.tilt_deg is None:
                raise fault(f"tilt_deg with {name}", "none", "add tilt_deg", (name,))
        return self

    def resolve(
        self,
        robot: Robot,
        comfort: Comfort | None,
        *,
        retract: float | None = None,
        floor: float | None = None,
    ) -> PlanOptions:
        """Return the plan options of the table, [comfort], [program] and [robot], in SI.

        Raises
        ------
        OptionConflict
            Two options conflict.
        """
        words, angle, piece = self.posture, self.rotation_deg, self.least_piece_mm
        return PlanOptions(
            gamma_step=float(np.radians(self.gamma_step_deg)),
            frames=self.frames,
            tilt=self.tilt(),
            postures=None if words is None else tuple(postures_named(words, robot.kinematics)),
            method=self.method,
            objective=self.objective,
            metric=self.metric,
            weights=self.weights,  # type: ignore[arg-type]  # cast there
            eta_v=self.eta_velocity,
            eta_a=self.eta_acceleration,
            closure=self.closure,
            rotation=None if angle is None else np.where(robot.endless, np.radians(angle), np.inf),
            feed=self.feed,
            refine=self.method in EXACT_OR_BETTER if self.refine is None else self.refine,
            refine_parts=self.refine_parts,
            between_nodes=self.between_nodes,
            interruptions=self.interruptions,
            least_piece=None if piece is None else piece / 1000,
            comfort=comfort,
            retract=retract,
            floor=floor,
            certify=self.certified(),
        )

    def certified(self) -> Certify | None:
        """Return how far plans are certified; None if they are not."""
        if not self.certify:
            return None
        percent = self.certify_gap_percent
        return Certify(
            gap=USUAL.gap if percent is None else percent / 100,
            seconds=self.certify_seconds,
            keep=self.certificate,
        )

    def tilt(self) -> Tilt | None:
        """Return the tolerance of the tool axis; None where the table asks for none."""
        if self.tilt_deg is None:
            return None
        return Tilt(
            cone=float(np.radians(self.tilt_deg)),
            steps=self.tilt_steps or 1,
            cost=float(np.degrees(self.tilt_cost_per_deg or 0.0)),
        )
