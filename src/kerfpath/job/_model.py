"""The tables and keys of a job file: units, bounds, and the rules between them.

Units are in the names of the keys. Angles `rpy_deg` are roll, pitch and yaw about the fixed axes
x, y and z, R = Rz(yaw) Ry(pitch) Rx(roll), as in URDF. A field's description and example are what
a message about it says was expected and how to write it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, model_validator

from kerfpath._arrays import Array
from kerfpath.contour import FrameKind
from kerfpath.errors import InputError
from kerfpath.job._heads import heads, pose
from kerfpath.job._keys import (
    MOST_NODES,
    Axis,
    Head,
    Identifier,
    NotNegative,
    Positive,
    Posture,
    Ratio,
    Six,
    SixNotNegative,
    SixPositive,
    Text,
    Three,
    fault,
    key,
    one_of,
)
from kerfpath.planner import FeedKind
from kerfpath.robots import Robot, acceleration_ratios, robot, robot_ids
from kerfpath.search import Closure, Method, Metric, ObjectiveKind

__all__ = ["TABLES", "AuditTable", "ContourTable", "JobFile", "PlanTable", "ProgramTable"]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


def _given(table: _Table, *keys: str) -> list[str]:
    return [key for key in keys if getattr(table, key) is not None]


class RobotTable(_Table):
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
        if len(_given(self, "acceleration_deg_s2", "acceleration_ratio")) == 2:
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
        if known.acceleration is None and not _given(
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


class ToolTable(_Table):
    """[tool]: a shipped cutting head, or where the tip is in the flange."""

    head: Annotated[Head | None, key("a cutting head, by its name", '"laser-head-straight"')] = None
    xyz_mm: Annotated[
        Three | None, key("3 numbers, the tip's position in the flange in mm", "[0, 0, 350]")
    ] = None
    rpy_deg: Annotated[
        Three | None, key("3 numbers, the tip's roll, pitch and yaw in deg", "[0, 45, 0]")
    ] = None

    @model_validator(mode="after")
    def _one_tip(self) -> ToolTable:
        given = _given(self, "xyz_mm", "rpy_deg")
        if self.head is not None and given:
            raise fault("head alone", "both", f"remove {given[0]} or head", (given[0],))
        if self.head is None and not given:
            raise fault(
                "a cutting head",
                "none",
                f"add head ({', '.join(heads())}), or xyz_mm and rpy_deg of the tip",
                ("head",),
            )
        if len(given) == 1:
            other = "rpy_deg" if given == ["xyz_mm"] else "xyz_mm"
            raise fault(f"{other} together with {given[0]}", "nothing", "add it", (other,))
        return self

    def resolve(self) -> Array:
        """Return T_flange_tip, (4, 4), m."""
        if self.head is not None:
            return pose(*heads()[self.head])
        assert self.xyz_mm is not None
        assert self.rpy_deg is not None
        return pose(self.xyz_mm, self.rpy_deg)


def _existing(value: str, info: ValidationInfo) -> str:
    """Require the file in the folder of the job."""
    folder: Path = info.context["folder"] if info.context else Path()
    try:
        is_file, is_there = (folder / value).is_file(), (folder / value).exists()
    except (OSError, ValueError):  # a name that the file system cannot hold
        is_file = is_there = False
    if not is_file:
        why = "it is not a file" if is_there else f"it is not in {folder}"
        raise fault("the part's CAD file", None, f"{why}; give its path relative to the job file")
    return value


class PartTable(_Table):
    """[part]: the CAD file, and where the part is in the robot base."""

    file: Annotated[
        Text, AfterValidator(_existing), key("the path of the part's CAD file", '"b_pillar.step"')
    ]
    unit: Literal["mm", "cm", "m", "in"] | None = None
    xyz_mm: Annotated[
        Three, key("3 numbers, the part's position in the robot base in mm", "[1450, -600, 450]")
    ]
    rpy_deg: Annotated[
        Three,
        key("3 numbers, the part's roll, pitch and yaw in the robot base in deg", "[0, 0, 90]"),
    ]

    def resolve(self) -> Array:
        """Return T_base_part, (4, 4), m."""
        return pose(self.xyz_mm, self.rpy_deg)


class ContourTable(_Table):
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
        given = _given(self, *ways)
        if not given:
            raise fault(
                "one of spacing_mm, count and tolerance_mm",
                "none",
                "add, for example, spacing_mm = 2",
                ways[:1],
            )
        if len(given) > 1:
            raise fault(
                "one of spacing_mm, count and tolerance_mm",
                " and ".join(given),
                "keep one",
                (given[-1],),
            )
        if self.axis_tolerance_deg is not None and self.tolerance_mm is None:
            raise fault(
                "axis_tolerance_deg only with tolerance_mm",
                f"it with {given[0]}",
                "remove one",
                ("axis_tolerance_deg",),
            )
        return self


_PLAIN = {
    "method": "exact",
    "closure": "free",
    "rotation_deg": None,
    "objective": "sum",
    "interruptions": "none",
}
"""What feed = "dip" needs of the other keys of [plan], and the first three interruptions."""


class PlanTable(_Table):
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
    refine: bool | None = None
    refine_parts: Annotated[
        int, key("a whole number of parts from 1 to 100", "4", ge=1, le=100)
    ] = 1
    eta_velocity: Annotated[Positive, key("a number above 0, at most 1", "0.95", le=1)] = 1.0
    eta_acceleration: Annotated[Positive, key("a number above 0, at most 1", "0.9", le=1)] = 1.0
    weights: Annotated[
        SixNotNegative | None, key("6 numbers not below 0, in 1/rad", "[1, 1, 1, 1, 1, 1]")
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
                    expected = f'{name} = "{plain}"' if plain else f"no {name}"
                    raise fault(f"{expected} with {why}", f"{value!r}", "change one", (name,))
        return self


class ProgramTable(_Table):
    """[program]: the robot program, its language, names and process values."""

    language: Literal["rapid"] = "rapid"
    name: Identifier | None = None
    retract_mm: Annotated[Positive, key("a number above 0, in mm", "50")] = 50.0
    zone_mm: Annotated[NotNegative, key("a number not below 0, in mm", "0.3")] = 0.3
    laser_output: Identifier = "doLaser"
    lead_time_s: Annotated[NotNegative, key("a number not below 0, in s", "0.02")] = 0.02
    work_object: Identifier = "wPart"
    tool_name: Identifier = "tLaser"


class AuditTable(_Table):
    """[audit]: how far the tool may leave the path between the nodes."""

    path_tolerance_mm: Annotated[Positive, key("a number above 0, in mm", "0.1")] = 0.1
    axis_tolerance_deg: Annotated[Positive, key("a number above 0, in deg", "1")] = 1.0


class JobFile(_Table):
    """The whole job file: cell, contours, process and objective."""

    robot: RobotTable
    tool: ToolTable
    part: PartTable
    contour: Annotated[tuple[ContourTable, ...], Field(strict=False, min_length=1)]
    plan: PlanTable = PlanTable()
    audit: AuditTable = AuditTable()
    program: ProgramTable = ProgramTable()

    @model_validator(mode="after")
    def _names_differ(self) -> JobFile:
        seen: set[str] = set()
        for i, table in enumerate(self.contour):
            name = table.name or table.pick
            if name in seen:
                raise fault(
                    "a name that no other contour has",
                    f'"{name}" again',
                    "give one of them another name",
                    ("contour", i, "name" if table.name else "pick"),
                )
            seen.add(name)
        return self


TABLES: dict[str, type[BaseModel]] = {
    "robot": RobotTable,
    "tool": ToolTable,
    "part": PartTable,
    "contour": ContourTable,
    "plan": PlanTable,
    "audit": AuditTable,
    "program": ProgramTable,
}
"""The model of each table of the file."""


def _radians(degrees: tuple[float, ...] | None) -> Array | None:
    return None if degrees is None else np.radians(degrees)
