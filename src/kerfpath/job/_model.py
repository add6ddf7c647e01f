"""The tables and keys of a job file: units, bounds, and the rules between them.

Units are in the names of the keys. Angles `rpy_deg` are roll, pitch and yaw about the fixed axes
x, y and z, R = Rz(yaw) Ry(pitch) Rx(roll), as in URDF. A field's description and example are what
a message about it says was expected and how to write it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, model_validator
from pydantic_core import PydanticCustomError

from kerfpath._arrays import Array
from kerfpath.contour import FrameKind
from kerfpath.errors import InputError
from kerfpath.job._heads import heads, pose
from kerfpath.robots import Robot, acceleration_ratios, postures_named, robot, robot_ids
from kerfpath.search import Method, Metric, ObjectiveKind

__all__ = [
    "FAULT",
    "LARGEST",
    "MOST_NODES",
    "SMALLEST",
    "TABLES",
    "ContourTable",
    "JobFile",
    "PlanTable",
    "ProgramTable",
    "nearest",
]

LARGEST = 1e6
"""No number of a job is larger, in the unit of its key: a kilometre in mm is a slip of the pen."""
SMALLEST = 1e-9
"""What must be positive is at least this: smaller numbers vanish when units are converted."""
MOST_NODES = 1_000_000
"""More nodes than any contour needs, few enough to fit into memory."""
FAULT = "kerfpath"
"""Error type of the rules below that pydantic cannot state itself."""
_LISTED = 12
"""Known names are listed in a message up to this many."""


def nearest(name: str, known: Collection[str]) -> str:
    """Say which of the `known` names are most like `name`, or which there are."""
    within = [k for k in known if name and name.lower() in k.lower()]
    if near := within[:3] or get_close_matches(name, known, n=3, cutoff=0.5):
        return f"nearest: {', '.join(near)}"
    return f"known: {', '.join(known)}" if len(known) <= _LISTED else "none is called like it"


def _key(expected: str, example: str, **bounds: Any) -> Any:
    """Return a field's bounds, with what a message says was expected and how to write it."""
    return Field(description=expected, examples=[example], **bounds)


def _fault(
    expected: str, got: str | None, remedy: str, where: tuple[str | int, ...] = ()
) -> PydanticCustomError:
    """Return an error at the key that `where` leads to from here; `got` None: the value itself."""
    said = {"expected": expected, "got": got, "remedy": remedy, "where": where}
    return PydanticCustomError(FAULT, "expected {expected}, got {got}; {remedy}", said)


def _one_of(what: str, names: Callable[[], Collection[str]], hint: str = "") -> AfterValidator:
    """Return a validator that admits only one of `names`."""

    def check(value: str) -> str:
        if value not in names():
            raise _fault(what, None, f"{nearest(value, names())}{hint}")
        return value

    return AfterValidator(check)


Number = Annotated[float, Field(allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(allow_inf_nan=False, ge=SMALLEST, le=LARGEST)]
NotNegative = Annotated[float, Field(allow_inf_nan=False, ge=0, le=LARGEST)]
Axis = Annotated[int, Field(ge=1, le=6)]
# TOML arrays arrive as lists: not strict about that, while their elements stay strict.
Three = Annotated[tuple[Number, ...], Field(strict=False, min_length=3, max_length=3)]
Six = Annotated[tuple[Number, ...], Field(strict=False, min_length=6, max_length=6)]
SixPositive = Annotated[tuple[Positive, ...], Field(strict=False, min_length=6, max_length=6)]
SixNotNegative = Annotated[tuple[NotNegative, ...], Field(strict=False, min_length=6, max_length=6)]
# One printable line that is not blank.
Text = Annotated[str, Field(pattern=r"^[^\p{C}\p{Zl}\p{Zp}]*\S[^\p{C}\p{Zl}\p{Zp}]*$")]
Identifier = Annotated[
    str,
    _key(
        "a name of letters, digits and _, a letter first, at most 32 characters",
        '"trim_1"',
        pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$",
    ),
]
Head = Annotated[str, _one_of("a cutting head", heads)]
Ratio = Annotated[str, _one_of("a known ratio", acceleration_ratios)]


def _posture(words: str) -> str:
    try:
        postures_named(words)
    except InputError:
        raise _fault(
            "a posture in words of front|rear / up|down / plus|minus",
            None,
            'write, for example, posture = "front/up"',
        ) from None
    return words


Posture = Annotated[str, AfterValidator(_posture)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


def _given(table: _Table, *keys: str) -> list[str]:
    return [key for key in keys if getattr(table, key) is not None]


class RobotTable(_Table):
    """[robot]: which robot, and limits that replace those of the library."""

    model: Annotated[
        str,
        _one_of("a robot of the library", robot_ids, "; 'kerfpath robots' lists all"),
        _key("a robot of the library", '"abb_irb4600_60_205"'),
    ]
    endless: Annotated[
        tuple[Axis, ...] | None, _key("axis numbers from 1 to 6, each once", "[4, 6]", strict=False)
    ] = None
    lower_deg: Annotated[
        Six | None,
        _key("6 numbers, the lower joint limits in deg", "[-180, -90, -180, -400, -125, -400]"),
    ] = None
    upper_deg: Annotated[
        Six | None,
        _key("6 numbers, the upper joint limits in deg", "[180, 150, 75, 400, 120, 400]"),
    ] = None
    velocity_deg_s: Annotated[
        SixPositive | None,
        _key(
            "6 numbers above 0, the largest joint speeds in deg/s", "[175, 175, 175, 250, 250, 360]"
        ),
    ] = None
    acceleration_deg_s2: Annotated[
        SixPositive | None,
        _key(
            "6 numbers above 0, the largest joint accelerations in deg/s^2",
            "[320, 270, 420, 1300, 1400, 2000]",
        ),
    ] = None
    acceleration_ratio: Annotated[
        Ratio | None, _key("a ratio of acceleration to speed, by its name", '"iontec_20_to_70kg"')
    ] = None

    @model_validator(mode="after")
    def _plannable(self) -> RobotTable:
        """Require every limit that planning needs, known or given: nothing is assumed silently."""
        known = robot(self.model)
        if len(set(self.endless or ())) < len(self.endless or ()):
            raise _fault("each axis once", "one twice", "remove it", ("endless",))
        if len(_given(self, "acceleration_deg_s2", "acceleration_ratio")) == 2:
            raise _fault(
                "acceleration_deg_s2 or acceleration_ratio",
                "both",
                "remove one",
                ("acceleration_ratio",),
            )
        limits = {"lower_deg": known.lower, "upper_deg": known.upper}
        for key, value in {**limits, "velocity_deg_s": known.velocity}.items():
            if value is None and getattr(self, key) is None:
                raise _fault(
                    f"6 numbers, as the library does not know those of {self.model}",
                    "none",
                    "add them from its data sheet",
                    (key,),
                )
        if known.acceleration is None and not _given(
            self, "acceleration_deg_s2", "acceleration_ratio"
        ):
            raise _fault(
                f"joint accelerations, as the library does not know those of {self.model}",
                "none",
                "add acceleration_deg_s2 = [6 numbers], or, to assume a typical ratio to the "
                f'speeds, acceleration_ratio = "{known.acceleration_ratio}"',
                ("acceleration_deg_s2",),
            )
        try:
            self.resolve()  # limits given may contradict those of the library
        except InputError as error:
            raise _fault(
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

    head: Annotated[Head | None, _key("a cutting head, by its name", '"laser-head-straight"')] = (
        None
    )
    xyz_mm: Annotated[
        Three | None, _key("3 numbers, the tip's position in the flange in mm", "[0, 0, 350]")
    ] = None
    rpy_deg: Annotated[
        Three | None, _key("3 numbers, the tip's roll, pitch and yaw in deg", "[0, 45, 0]")
    ] = None

    @model_validator(mode="after")
    def _one_tip(self) -> ToolTable:
        given = _given(self, "xyz_mm", "rpy_deg")
        if self.head is not None and given:
            raise _fault("head alone", "both", f"remove {given[0]} or head", (given[0],))
        if self.head is None and not given:
            raise _fault(
                "a cutting head",
                "none",
                f"add head ({', '.join(heads())}), or xyz_mm and rpy_deg of the tip",
                ("head",),
            )
        if len(given) == 1:
            other = "rpy_deg" if given == ["xyz_mm"] else "xyz_mm"
            raise _fault(f"{other} together with {given[0]}", "nothing", "add it", (other,))
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
        raise _fault("the part's CAD file", None, f"{why}; give its path relative to the job file")
    return value


class PartTable(_Table):
    """[part]: the CAD file, and where the part is in the robot base."""

    file: Annotated[
        Text, AfterValidator(_existing), _key("the path of the part's CAD file", '"b_pillar.step"')
    ]
    unit: Literal["mm", "cm", "m", "in"] | None = None
    xyz_mm: Annotated[
        Three, _key("3 numbers, the part's position in the robot base in mm", "[1450, -600, 450]")
    ]
    rpy_deg: Annotated[
        Three,
        _key("3 numbers, the part's roll, pitch and yaw in the robot base in deg", "[0, 0, 90]"),
    ]

    def resolve(self) -> Array:
        """Return T_base_part, (4, 4), m."""
        return pose(self.xyz_mm, self.rpy_deg)


class ContourTable(_Table):
    """[[contour]]: which loop of the part to cut, how fast, and how finely it is sampled."""

    pick: Annotated[Text, _key("the name of a loop in the part", '"trim"')]
    name: Annotated[Text | None, _key("a name that no other contour has", '"trim 2"')] = None
    speed_m_min: Annotated[Positive, _key("a number above 0, in m/min", "9")]
    spacing_mm: Annotated[Positive | None, _key("a number above 0, in mm", "2")] = None
    count: Annotated[
        int | None, _key(f"a whole number of nodes, 2 to {MOST_NODES}", "200", ge=2, le=MOST_NODES)
    ] = None
    tolerance_mm: Annotated[Positive | None, _key("a number above 0, in mm", "0.05")] = None
    axis_tolerance_deg: Annotated[Positive | None, _key("a number above 0, in deg", "1")] = None

    @model_validator(mode="after")
    def _one_sampling(self) -> ContourTable:
        ways = ("spacing_mm", "count", "tolerance_mm")
        given = _given(self, *ways)
        if not given:
            raise _fault(
                "one of spacing_mm, count and tolerance_mm",
                "none",
                "add, for example, spacing_mm = 2",
                ways[:1],
            )
        if len(given) > 1:
            raise _fault(
                "one of spacing_mm, count and tolerance_mm",
                " and ".join(given),
                "keep one",
                (given[-1],),
            )
        if self.axis_tolerance_deg is not None and self.tolerance_mm is None:
            raise _fault(
                "axis_tolerance_deg only with tolerance_mm",
                f"it with {given[0]}",
                "remove one",
                ("axis_tolerance_deg",),
            )
        return self


class PlanTable(_Table):
    """[plan]: what is searched, and which motion is best."""

    gamma_step_deg: Annotated[
        Positive, _key("a number above 0, at most 360, in deg", "1", le=360)
    ] = 1.0
    objective: ObjectiveKind = "sum"
    metric: Metric = "manhattan"
    method: Method = "paper"
    frames: FrameKind = "rotation-minimising"
    posture: Posture | None = None
    eta_velocity: Annotated[Positive, _key("a number above 0, at most 1", "0.95", le=1)] = 1.0
    eta_acceleration: Annotated[Positive, _key("a number above 0, at most 1", "0.9", le=1)] = 1.0
    weights: Annotated[
        SixNotNegative | None, _key("6 numbers not below 0, in 1/rad", "[1, 1, 1, 1, 1, 1]")
    ] = None


class ProgramTable(_Table):
    """[program]: the robot program, its language, names and process values."""

    language: Literal["rapid"] = "rapid"
    name: Identifier | None = None
    retract_mm: Annotated[Positive, _key("a number above 0, in mm", "50")] = 50.0
    zone_mm: Annotated[NotNegative, _key("a number not below 0, in mm", "0.3")] = 0.3
    laser_output: Identifier = "doLaser"
    lead_time_s: Annotated[NotNegative, _key("a number not below 0, in s", "0.02")] = 0.02
    work_object: Identifier = "wPart"
    tool_name: Identifier = "tLaser"


class JobFile(_Table):
    """The whole job file: cell, contours, process and objective."""

    robot: RobotTable
    tool: ToolTable
    part: PartTable
    contour: Annotated[tuple[ContourTable, ...], Field(strict=False, min_length=1)]
    plan: PlanTable = PlanTable()
    program: ProgramTable = ProgramTable()

    @model_validator(mode="after")
    def _names_differ(self) -> JobFile:
        seen: set[str] = set()
        for i, table in enumerate(self.contour):
            name = table.name or table.pick
            if name in seen:
                raise _fault(
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
    "program": ProgramTable,
}
"""The model of each table of the file."""


def _radians(degrees: tuple[float, ...] | None) -> Array | None:
    return None if degrees is None else np.radians(degrees)
