"""The [robot] and [[robot.external]] tables: the robot, its limits, and the axes that carry it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo, model_validator
from pydantic_core import PydanticCustomError

from kerfpath.acceleration_table import AccelerationTable
from kerfpath.arrays import Array
from kerfpath.errors import InputError
from kerfpath.execution import Response, read_response, response, response_from
from kerfpath.job.format.tables.table import (
    FAULT,
    Axis,
    Joints,
    JointsPositive,
    Lengths,
    NotNegative,
    Number,
    Positive,
    Ratio,
    Signs,
    Table,
    Text,
    Three,
    example,
    existing,
    fault,
    fault_in_words,
    folder_of,
    given,
    key,
    one_of,
    pose,
    require_distinct,
)
from kerfpath.robots import (
    FAMILIES,
    Arm,
    ExternalAxis,
    KnownAxis,
    Robot,
    Travel,
    acceleration_ratios,
    acceleration_table_of,
    described_axes,
    external_axes,
    robot,
    robot_ids,
)
from kerfpath.urdf import Description, read_urdf

# -----------------------------------------------------------------------------
# The [[robot.external]] tables: rails, turntables and tilts that move with the robot.
#
# A table describes its axis completely, or adds what is not known of an axis of the library or of
# a description.

KEYS = {
    "linear": ("lower_mm", "upper_mm", "velocity_mm_s", "acceleration_mm_s2", "step_mm", "home_mm"),
    "rotary": (
        "lower_deg", "upper_deg", "velocity_deg_s", "acceleration_deg_s2", "step_deg", "home_deg",
    ),
}  # fmt: skip
"""Keys of each kind: range, speed, acceleration, step of a grid, home."""
FACTORS = {"linear": 1e-3, "rotary": float(np.pi / 180)}
"""Factor from the unit of these keys to m or rad."""
NAME = r"^[A-Za-z][A-Za-z0-9_]{0,15}$"
WHOLE = ("kind", "carries", "axis", "point_mm", "xyz_mm", "rpy_deg")
"""Keys that define an axis and its place; a joint of a description has all of them."""


class ExternalTable(Table):
    """[[robot.external]]: one external axis; of those on one side, each carries the next."""

    model: Annotated[
        str | None,
        one_of("an axis of the library", external_axes, "; 'kerfpath robots' lists all"),
        key("an axis of the library", '"kuka_dkp400.tilt"'),
    ] = None
    joint: Annotated[Text | None, key("a joint of the description", '"rail_joint"')] = None
    name: Annotated[
        str | None,
        key(
            "a name of letters, digits and _, a letter first, at most 16 characters",
            '"rail"',
            pattern=NAME,
        ),
    ] = None
    kind: Annotated[Literal["linear", "rotary"] | None, key("a kind of axis", '"linear"')] = None
    carries: Annotated[Literal["robot", "part"] | None, key("what it moves", '"robot"')] = None
    axis: Annotated[
        Three | None, key("3 numbers, its direction in the robot base", "[0, 1, 0]")
    ] = None
    point_mm: Annotated[
        Three | None,
        key("3 numbers, a point of its axis in the robot base in mm", "[1200, 0, 500]"),
    ] = None
    xyz_mm: Annotated[
        Three | None,
        key("3 numbers, the position of the product in the robot base in mm", "[1600, 0, 0]"),
    ] = None
    rpy_deg: Annotated[
        Three | None,
        key("3 numbers, roll, pitch and yaw of the product in the robot base in deg", "[0, 0, 90]"),
    ] = None
    endless: Annotated[bool | None, key("true or false", "true")] = None
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
        """Require all that is not known of the axis; joints of a description are checked later."""
        if self.joint is None:
            self.resolve()
            return self
        for name in given(self, "model", *WHOLE):
            expected = f"no {name} with joint"
            raise fault(expected, "both", f"remove {name} or joint", (name,))
        return self

    @property
    def called(self) -> str | None:
        """Its name: the given one, or the one in the library or the description."""
        if self.name is None and self.model is not None:
            return external_axes()[self.model].axis.name
        return self.name or self.joint

    @property
    def home(self) -> float | None:
        """Its value when the robot is at home, m or rad; None if it is not given."""
        if self.home_mm is not None:
            return FACTORS["linear"] * self.home_mm
        return None if self.home_deg is None else FACTORS["rotary"] * self.home_deg

    def resolve(self, described: KnownAxis | None = None) -> tuple[ExternalAxis, Travel]:
        """Return the axis and its travel, m and rad; `described` is its joint in the description.

        Raises
        ------
        PydanticCustomError
            At the key: it is missing, does not fit such an axis, or its range is reversed.
        """
        known = described or (self._own() if self.model is None else self._placed())
        kind, free = known.axis.kind, known.endless if self.endless is None else self.endless
        self._require_kind(kind, free)
        factor, (lower, upper, *_) = FACTORS[kind], KEYS[kind]
        limits = (known.lower, known.upper, known.velocity, known.acceleration)
        values: list[float | None] = [getattr(self, name) for name in KEYS[kind][:5]]
        for name, value, there in zip(KEYS[kind], values, limits, strict=False):
            if value is None and there is None and not (free and name in (lower, upper)):
                hint = f"add, for example, {example(ExternalTable, name)}"
                raise fault("every limit of the axis", f"no {name}", hint, (name,))
        low, high, velocity, acceleration, step = (
            None if value is None else factor * value for value in values
        )
        if not re.match(NAME, str(self.called)):
            expected = "a name of letters, digits and _, a letter first, at most 16 characters"
            raise fault(expected, f'"{self.called}"', 'add, for example, name = "rail"', ("joint",))
        try:
            axis, travel = known.completed(
                name=self.name,
                lower=low,
                upper=high,
                velocity=velocity,
                acceleration=acceleration,
                endless=self.endless,
                step=step,
            )
        except InputError as error:
            about = error.parameter or "joint"
            where = next((name for name in KEYS[kind] if name.startswith(about)), "joint")
            raise fault_in_words(f"{error}", (where,)) from None
        ends, home = (travel["lower"], travel["upper"]), self.home
        least, most = (f"{end / factor:g}" for end in ends)
        if not ends[0] <= ends[1]:
            raise fault(
                f"{upper} not below {lower}", f"{most} below {least}", "swap them", (upper,)
            )
        if home is not None and not free and not ends[0] <= home <= ends[1]:
            said = f"a home from {least} to {most}"
            raise fault(said, f"{home / factor:g}", "move it", (KEYS[kind][5],))
        return axis, travel

    def _own(self) -> KnownAxis:
        """Return the axis that the table describes completely, without its limits."""
        for name in ("name", "kind", "carries", "axis"):
            if getattr(self, name) is None:
                said = f"{ExternalTable.model_fields[name].description}"
                hint = f"add, for example, {example(ExternalTable, name)}"
                raise fault(said, "nothing", hint, (name,))
        for name in given(self, "xyz_mm", "rpy_deg"):
            raise fault(f"{name} only with model", "it without model", f"remove {name}", (name,))
        assert self.name is not None
        assert self.kind is not None
        assert self.carries is not None
        axis = ExternalAxis(
            name=self.name,
            kind=self.kind,
            carries=self.carries,
            axis=self._direction(),
            point=self._point(self.kind),
        )
        return KnownAxis(axis=axis, source="the job")

    def _placed(self) -> KnownAxis:
        """Return the axis of the library at the place of its product, or as it was measured."""
        known = external_axes()[self.model or ""]
        kind = known.axis.kind
        for name in given(self, "kind", "carries"):
            raise fault(f"no {name} with model", "both", f"remove {name}", (name,))
        measured, placed = given(self, "axis", "point_mm"), given(self, "xyz_mm", "rpy_deg")
        if kind == "linear" and self.xyz_mm is not None:
            expected, got = "xyz_mm only for a rotary axis", "it for a linear axis"
            raise fault(expected, got, "remove xyz_mm", ("xyz_mm",))
        if measured and placed:
            ways = "axis and point_mm, or xyz_mm and rpy_deg"
            raise fault(ways, "both", "remove one pair", (placed[0],))
        if measured:
            axis = replace(known.axis, axis=self._direction(), point=self._point(kind))
            return replace(known, axis=axis)
        for name in ("xyz_mm", "rpy_deg"):
            if getattr(self, name) is None and not (kind == "linear" and name == "xyz_mm"):
                expected = "the place of the product, or its axis as measured"
                hint = f"add, for example, {example(ExternalTable, name)}"
                raise fault(expected, "neither", hint, (name,))
        return known.placed(pose(self.xyz_mm or (0, 0, 0), self.rpy_deg or (0, 0, 0)))

    def _direction(self) -> Array:
        if self.axis is None or not any(self.axis):
            got = "none" if self.axis is None else "[0, 0, 0]"
            raise fault(
                "the direction of the axis", got, "add, for example, axis = [0, 1, 0]", ("axis",)
            )
        return np.array(self.axis)

    def _point(self, kind: str) -> Array:
        if kind == "rotary" and self.point_mm is None:
            said = "a point of its axis in the robot base"
            raise fault(said, "none", "add, for example, point_mm = [1200, 0, 500]", ("point_mm",))
        return np.array(self.point_mm or (0, 0, 0)) / 1000

    def _require_kind(self, kind: str, free: bool) -> None:
        """Require no key of the other kind, and no range of an axis that has none."""
        other = "rotary" if kind == "linear" else "linear"
        for name in given(self, *KEYS[other]):
            own = KEYS[kind][KEYS[other].index(name)]
            raise fault(f"{own} for a {kind} axis", name, f"write {own}", (name,))
        if kind == "linear" and self.point_mm is not None:
            expected, got = "point_mm only for a rotary axis", "it for a linear axis"
            raise fault(expected, got, "remove point_mm", ("point_mm",))
        if kind == "linear" and self.endless:
            raise fault("false for a linear axis", "true", "remove endless", ("endless",))
        for name in given(self, *KEYS[kind][:2]) if free else ():
            remedy = f"remove {name} or endless" if self.endless else "write endless = false, too"
            raise fault(f"no {name} for an endless axis", "one", remedy, (name,))


def axes_of(
    tables: Sequence[ExternalTable], described: Sequence[KnownAxis]
) -> list[tuple[ExternalAxis, Travel]]:
    """Return all axes of a job and their travel: those of its description first, in their order.

    Raises
    ------
    PydanticCustomError
        A joint is not in the description or is named twice; or as `ExternalTable.resolve`.
    """
    rows = {table.joint: i for i, table in enumerate(tables) if table.joint is not None}
    joints = [known.axis.name for known in described]
    for i, table in enumerate(tables):
        if table.joint is not None and (table.joint not in joints or rows[table.joint] != i):
            there = f"there are {', '.join(joints)}" if joints else "it has none"
            expected = "a joint of the description that carries robot or part, named once"
            raise fault(expected, f'"{table.joint}"', there, ("external", i, "joint"))
    found = []
    for known in described:
        at = rows.get(known.axis.name)
        table = ExternalTable(joint=known.axis.name) if at is None else tables[at]
        try:
            found.append(table.resolve(known))
        except PydanticCustomError as error:
            raise _inside(error, known.axis.name, at) from None
    return found + [table.resolve() for table in tables if table.joint is None]


def require_in_order(tables: Sequence[ExternalTable]) -> None:
    """Require that the axes of one product are in its order and at one place.

    Raises
    ------
    PydanticCustomError
        At the second of two axes that are not.
    """
    order = list(external_axes())
    for i, table in enumerate(tables):
        for first in tables[:i]:
            if table.model is None or first.model is None:
                continue
            one, two = (each.model.split(".")[0] for each in (first, table) if each.model)
            if one != two or first.model == table.model:  # the same axis again is another product
                continue
            if order.index(first.model) > order.index(table.model):
                expected = f'"{table.model}" before "{first.model}", which it carries'
                got = "the reverse order"
                raise fault(expected, got, "swap the tables", ("external", i, "model"))
            for name in ("xyz_mm", "rpy_deg"):
                there, here = getattr(first, name), getattr(table, name)
                if None not in (there, here) and there != here:
                    expected = f'{list(there)}, as for "{first.model}" of the same product'
                    raise fault(expected, f"{list(here)}", "correct one", ("external", i, name))


def _inside(error: PydanticCustomError, joint: str, i: int | None) -> PydanticCustomError:
    """Return the error with the place of the joint's table, or that the joint needs a table."""
    if i is None:
        said = f'joint "{joint}": {error.message()}, in [[robot.external]] with joint = "{joint}"'
        return fault_in_words(said, ("urdf",))
    context = error.context or {}
    where = ("external", i, *context["where"])
    return PydanticCustomError(FAULT, error.message_template, {**context, "where": where})


External = Annotated[tuple[ExternalTable, ...], Field(strict=False, max_length=3)]


# -----------------------------------------------------------------------------
# The [robot] table: which robot, and limits that replace the known ones.

LIBRARY = "library"
"""Value of `acceleration_table` that asks for the table of the library."""


def table_or_library(value: str, info: ValidationInfo) -> str:
    """Require a file, unless the table of the library is asked for."""
    if value == LIBRARY:
        return value
    return existing("library, or the file of a table of accelerations")(value, info)


CONTROLLER = ("manufacturer", "axis_3", "axis_3_deg")
SOURCES = {
    "model": (),
    "urdf": ("base", "tip", "mount", "part", "packages", "snap_deg", "srdf", *CONTROLLER),
    "kinematics": ("geometry_mm", "sign", "offset_deg", *CONTROLLER),
}
"""The three ways to name the robot, and the keys that belong to each."""
LIMITS = ("lower_deg", "upper_deg", "velocity_deg_s", "acceleration_deg_s2")
KEY_OF = {
    "lower": "lower_deg", "velocity": "velocity_deg_s", "acceleration": "acceleration_deg_s2",
    "jerk": "jerk_deg_s3", "snap": "snap_deg", "packages": "packages", "axis_3": "axis_3",
    "axis_3_limits": "axis_3_deg",
}  # fmt: skip
"""The key for each parameter of `Robot.from_urdf` that its errors are about."""


# -----------------------------------------------------------------------------
# The [robot.response] table: how the joints follow what the controller commands.


class ResponseTable(Table):
    """[robot.response]: how the joints follow what the controller commands."""

    source: Annotated[Text | None, key("a response of the library, assumed or ideal", '"real"')] = (
        None
    )
    file: Annotated[
        Text | None,
        AfterValidator(existing("the file of a response")),
        key("the path of a file that kerfpath fit wrote", '"response.toml"'),
    ] = None
    sigma_ms: Annotated[
        JointsPositive | None,
        key("numbers above 0, the lag of every joint or of all, in ms", "[30, 29, 21, 17, 20, 26]"),
    ] = None
    sigma_range_ms: Annotated[
        tuple[Positive, Positive] | None,
        key("2 numbers above 0, the least and the largest lag, in ms", "[15, 35]", strict=False),
    ] = None

    @model_validator(mode="after")
    def _one_source(self) -> ResponseTable:
        found = given(self, "source", "file", "sigma_ms")
        if len(found) != 1:
            got = " and ".join(found) or "none"
            remedy = "remove all but one" if found else 'add, for example, source = "assumed"'
            where = found[-1] if found else "source"
            raise fault("one of source, file and sigma_ms", got, remedy, (where,))
        if self.sigma_range_ms is not None and self.sigma_ms is None:
            raise fault(
                "sigma_range_ms only with sigma_ms", "it alone", "remove it", ("sigma_range_ms",)
            )
        return self

    def resolve(self, model: str | None, folder: Path) -> Response:
        """Return the response of a robot of the library, or of none of it.

        Raises
        ------
        InputError
            Its parameter is the key at fault.
        """
        if self.file is not None:
            return read_response(folder / self.file)
        if self.source is not None:
            return response(model, self.source)
        more = {} if self.sigma_range_ms is None else {"sigma_range_ms": list(self.sigma_range_ms)}
        return response_from({"sigma_ms": list(self.sigma_ms or ())} | more, "the job")


class RobotTable(Table):
    """[robot]: the robot, and limits that replace or complete its known limits."""

    model: Annotated[
        str | None,
        one_of("a robot of the library", robot_ids, "; 'kerfpath robots' lists all"),
        key("a robot of the library", '"abb_irb4600_60_205"'),
    ] = None
    urdf: Annotated[
        Text | None,
        AfterValidator(existing("the robot's description")),
        key("the path of the robot's description", '"arm.urdf"'),
    ] = None
    srdf: Annotated[
        Text | None, AfterValidator(existing("the SRDF")), key("the path of its SRDF", '"arm.srdf"')
    ] = None
    base: Annotated[Text | None, key("a link of the description", '"base_link"')] = None
    tip: Annotated[Text | None, key("a link of the description", '"tool0"')] = None
    mount: Annotated[Text | None, key("a link of the description", '"carriage"')] = None
    part: Annotated[Text | None, key("a link of the description", '"table"')] = None
    packages: Annotated[
        dict[str, Text] | None,
        key("a table of folders by package name", '{ arm_description = "meshes" }'),
    ] = None
    snap_deg: Annotated[NotNegative | None, key("a number from 0 to 1, in deg", "0.006", le=1)] = (
        None
    )
    kinematics: Annotated[
        Literal["opw", "ur", "five", "srs"] | None, key("a family of arms", '"five"')
    ] = None
    geometry_mm: Annotated[
        Lengths | None,
        key("the lengths of the arm by name, in mm", "{ a1 = 300, a2 = -100, b = 0, c1 = 700 }"),
    ] = None
    sign: Annotated[
        Signs | None, key("1 or -1 for every joint", "[1, 1, 1, 1, 1]", strict=False)
    ] = None
    offset_deg: Annotated[
        Joints | None, key("an angle for every joint, in deg", "[0, 0, -90, 0, 0]")
    ] = None
    manufacturer: Annotated[Text | None, key("the maker of the robot's controller", '"ABB"')] = None
    axis_3: Annotated[
        Literal["serial", "horizontal"] | None,
        key("what axis 3 of the controller measures", '"horizontal"'),
    ] = None
    axis_3_deg: Annotated[
        tuple[Number, Number] | None,
        key(
            "the two limits of axis 3 as its controller shows them, in deg",
            "[-60, 65]",
            strict=False,
        ),
    ] = None
    floor: Annotated[bool, key("true or false", "true")] = True
    floor_mm: Annotated[Number, key("the height of the floor in the robot base, in mm", "-600")] = (
        0.0
    )
    endless: Annotated[
        tuple[Axis, ...] | None, key("axis numbers from 1 to 7, each once", "[4, 6]", strict=False)
    ] = None
    lower_deg: Annotated[
        Joints | None,
        key("a lower limit for every joint, in deg", "[-180, -90, -180, -400, -125, -400]"),
    ] = None
    upper_deg: Annotated[
        Joints | None,
        key("an upper limit for every joint, in deg", "[180, 150, 75, 400, 120, 400]"),
    ] = None
    velocity_deg_s: Annotated[
        JointsPositive | None,
        key("numbers above 0, the largest joint speeds in deg/s", "[175, 175, 175, 250, 250, 360]"),
    ] = None
    acceleration_deg_s2: Annotated[
        JointsPositive | None,
        key(
            "numbers above 0, the largest joint accelerations in deg/s^2",
            "[320, 270, 420, 1300, 1400, 2000]",
        ),
    ] = None
    jerk_deg_s3: Annotated[
        JointsPositive | None,
        key(
            "numbers above 0, the largest joint jerks in deg/s^3",
            "[3000, 3000, 4000, 13000, 14000, 20000]",
        ),
    ] = None
    torque_nm: Annotated[
        JointsPositive | None,
        key(
            "numbers above 0, the largest joint torques in N m",
            "[3000, 3000, 1500, 400, 400, 200]",
        ),
    ] = None
    gravity_m_s2: Annotated[
        Three | None, key("3 numbers, gravity in the robot base in m/s^2", "[0, 0, 9.81]")
    ] = None
    acceleration_ratio: Annotated[
        Ratio | None, key("a ratio of acceleration to speed, by its name", '"iontec_20_to_70kg"')
    ] = None
    acceleration_table: Annotated[
        Text | None,
        AfterValidator(table_or_library),
        key(
            '"library", or the path of a CSV file of accelerations over joints 2 and 3',
            '"library"',
        ),
    ] = None
    elbow_step_deg: Annotated[
        Positive | None, key("a number above 0, the step of the free joint of seven, in deg", "10")
    ] = None
    response: ResponseTable | None = None
    external: External = ()

    @model_validator(mode="after")
    def _axes_differ(self) -> RobotTable:
        names = [table.called for table in self.external]
        keys = [
            "name" if table.name else "model" if table.model else "joint" for table in self.external
        ]
        require_distinct(names, "external axis", "external", keys)
        require_in_order(self.external)
        return self

    @model_validator(mode="after")
    def _plannable(self, info: ValidationInfo) -> RobotTable:
        """Require every limit that planning needs, known or given: nothing is assumed silently."""
        self._require_one_source()
        folder = folder_of(info)
        try:
            self._require_for_each_joint(self.joints(folder))
            known = self._known(folder)
        except InputError as error:
            where = KEY_OF.get(error.parameter, "urdf" if self.urdf else "geometry_mm")
            said = f"{error}".removeprefix(f"{error.parameter}: ")
            raise fault_in_words(said, (where,)) from None
        if len(given(self, "acceleration_deg_s2", "acceleration_ratio")) == 2:
            expected = "acceleration_deg_s2 or acceleration_ratio"
            raise fault(expected, "both", "remove one", ("acceleration_ratio",))
        holder = (
            f"the library does not know those of {self.model}"
            if self.model
            else f"{self.urdf} does not state them"
            if self.urdf
            else "lengths do not determine them"
        )
        for name, value in zip(LIMITS, (known.lower, known.upper, known.velocity), strict=False):
            if value is None and getattr(self, name) is None:
                raise fault(
                    f"{known.joints} numbers, as {holder}",
                    "none",
                    "add them from the robot's data sheet",
                    (name,),
                )
        if self.elbow_step_deg is not None and known.family.given is None:
            raise fault(
                "elbow_step_deg only for an arm with seven axes",
                f"{known.joints} axes",
                "remove it",
                ("elbow_step_deg",),
            )
        if known.acceleration is None and not given(
            self, "acceleration_deg_s2", "acceleration_ratio"
        ):
            remedy = f"add acceleration_deg_s2 = [{known.joints} numbers]"
            every = acceleration_ratios().items()
            if ratios := [name for name, each in every if len(each) == known.joints]:
                ratio = known.acceleration_ratio or ratios[0]
                remedy += f', or, to assume a typical ratio, acceleration_ratio = "{ratio}"'
            expected = f"joint accelerations, as {holder}"
            raise fault(expected, "none", remedy, ("acceleration_deg_s2",))
        self._require_table(known, folder)
        try:
            self._arm(folder)  # given limits may contradict known ones
        except InputError as error:
            raise fault(
                "lower_deg below upper_deg",
                f"reversed limits ({error})",
                "correct one of them",
                ("upper_deg" if self.upper_deg else "lower_deg",),
            ) from None
        try:
            whole = self.resolve(folder)
        except InputError as error:
            where = "external" if self.external else "urdf"
            raise fault_in_words(f"{error}", (where,)) from None
        try:
            self.response_in(folder).require_for(whole)
        except InputError as error:
            said = f"{error}".removeprefix("response: ")
            raise fault_in_words(said, ("response",)) from None
        return self

    def _require_table(self, known: Robot, folder: Path) -> None:
        """Require that the table of accelerations can be read and fits the robot."""
        if self.acceleration_table is None:
            return
        if self.acceleration_table == LIBRARY and self.model is None:
            raise fault(
                "a table of the library only for a model of it",
                "another robot",
                "give the path of a CSV file",
                ("acceleration_table",),
            )
        try:
            self._with_table(self._with_accelerations(known), folder)
        except InputError as error:
            raise fault_in_words(f"{error}", ("acceleration_table",)) from None

    def _require_one_source(self) -> None:
        """Require exactly one way to name the robot, and no key of another way."""
        sources = given(self, *SOURCES)
        if len(sources) != 1:
            raise fault(
                "one of model (a robot of the library), urdf (its description) and kinematics "
                "(with the lengths of its arm)",
                " and ".join(sources) or "nothing",
                "remove all but one"
                if sources
                else 'add, for example, model = "abb_irb4600_60_205"',
                (sources[-1] if sources else "model",),
            )
        (source,) = sources
        foreign = {name for names in SOURCES.values() for name in names} - set(SOURCES[source])
        for name in given(self, *sorted(foreign)):
            owners = " or ".join(s for s, names in SOURCES.items() if name in names)
            raise fault(f"{name} only with {owners}", f"it with {source}", "remove one", (name,))
        if self.kinematics and not self.geometry_mm:
            lengths = ", ".join(f"{name} = 0" for name in FAMILIES[self.kinematics].lengths)
            raise fault(
                f'the lengths of an arm of kinematics "{self.kinematics}"',
                "none",
                f"add geometry_mm = {{ {lengths} }} with the true lengths",
                ("geometry_mm",),
            )

    def _require_for_each_joint(self, n: int) -> None:
        """Require as many numbers as the robot has joints, and no axis beyond them."""
        for name in given(self, *LIMITS, "jerk_deg_s3", "torque_nm", "sign", "offset_deg"):
            if (got := len(getattr(self, name))) != n:
                raise fault(f"{n} numbers, one for every joint", f"{got}", "give as many", (name,))
        axes = self.endless or ()
        if len(set(axes)) < len(axes):
            raise fault("each axis once", "one twice", "remove the second", ("endless",))
        if max(axes, default=1) > n:
            raise fault(f"axis numbers from 1 to {n}", f"{max(axes)}", "remove it", ("endless",))
        ratio = self.acceleration_ratio
        if ratio is not None and (count := len(acceleration_ratios()[ratio])) != n:
            raise fault(
                f"a ratio for {n} joints",
                f"one for {count}",
                "give acceleration_deg_s2 instead",
                ("acceleration_ratio",),
            )

    @model_validator(mode="after")
    def _one_floor(self) -> RobotTable:
        if not self.floor and "floor_mm" in self.model_fields_set:
            raise fault("floor_mm only with a floor", "floor = false", "remove one", ("floor_mm",))
        return self

    def height_of_floor(self) -> float | None:
        """Return the height of the floor in the robot base, m; None where there is none."""
        return self.floor_mm / 1000 if self.floor else None

    def response_in(self, folder: Path) -> Response:
        """Return how the joints follow what is commanded: as the table says, else as is known."""
        if self.response is None:
            return response(self.model)
        return self.response.resolve(self.model, folder)

    def resolve(self, folder: Path, *, bodies: bool = False) -> Robot:
        """Return the robot with this table's limits; `bodies` adds those of its description."""
        found = self._arm(folder, bodies=bodies)
        for axis, travel in self.axes(folder):
            found = found.with_external(axis, **travel)
        return found

    def axes(self, folder: Path) -> list[tuple[ExternalAxis, Travel]]:
        """Return the external axes of the description and of the tables, with their travel."""
        read = None if self.urdf is None else self._description(folder)
        return axes_of(self.external, () if read is None else described_axes(read))

    def _arm(self, folder: Path, *, bodies: bool = False) -> Robot:
        """Return the robot without its external axes."""
        changed = self._with_accelerations(self._known(folder, bodies=bodies))
        changed = self._with_table(changed, folder)
        if self.elbow_step_deg is not None:
            changed = changed.with_elbow_step(float(np.radians(self.elbow_step_deg)))
        return changed

    def _with_accelerations(self, known: Robot) -> Robot:
        """Return a known robot with the limits of the table, constant ones."""
        changed = known.with_limits(**self._limits(known.joints))
        if self.acceleration_ratio is None:
            return changed
        return changed.with_acceleration_ratio(self.acceleration_ratio)

    def _with_table(self, robot: Robot, folder: Path) -> Robot:
        """Return the robot with the accelerations by configuration that are asked for."""
        name = self.acceleration_table
        if name is None:
            return robot
        if name == LIBRARY:
            return robot.with_limits(acceleration_table=acceleration_table_of(robot.id))
        return robot.with_limits(acceleration_table=AccelerationTable.from_csv(folder / name))

    def _known(self, folder: Path, *, bodies: bool = False) -> Robot:
        """Return the robot of the library, of the given lengths, or of the description."""
        if self.model is not None:
            return robot(self.model)
        limits = None if self.axis_3_deg is None else np.radians(self.axis_3_deg)
        maker = self.manufacturer or ""
        if self.urdf is not None:
            return Robot.from_urdf(
                folder / self.urdf,
                **self._chain(folder),
                externals=None,
                meshes=bodies,
                manufacturer=maker,
                axis_3=self.axis_3 or "",
                axis_3_limits=limits,
                **self._limits(self.joints(folder)),
            )
        assert self.kinematics is not None
        assert self.geometry_mm is not None
        family = FAMILIES[self.kinematics]
        unknown = sorted(set(self.geometry_mm) - set(family.lengths))
        if unknown:
            raise InputError(
                f"expected lengths {', '.join(family.lengths)}, got {unknown[0]}; remove it"
            )
        arm = Arm(
            kinematics=self.kinematics,
            geometry={name: mm / 1000 for name, mm in self.geometry_mm.items()},
            sign=np.array(self.sign or 1.0, dtype=float),
            offset=np.radians(self.offset_deg or 0.0),
        )
        made = Robot(id=f"{self.kinematics} arm by its lengths", manufacturer=maker, arm=arm)
        return made.with_axis_3(self.axis_3 or "", limits)

    def joints(self, folder: Path) -> int:
        """Return the number of joints without external axes."""
        if self.urdf is not None:
            return len(self._description(folder).joints)
        return robot(self.model).joints if self.model else FAMILIES[self.kinematics or ""].joints

    def _description(self, folder: Path) -> Description:
        """Return the description without bodies, its angles snapped as those of the arm."""
        chain = self._chain(folder)
        snap = chain.pop("snap") or 0.0
        return read_urdf(folder / (self.urdf or ""), **chain, meshes=False, snap=snap)

    def _chain(self, folder: Path) -> dict[str, Any]:
        """Return the arguments of the reader that select the chain of the description."""
        return {
            "base": self.base,
            "tip": self.tip,
            "mount": self.mount,
            "part": self.part,
            "packages": {name: folder / place for name, place in (self.packages or {}).items()},
            "snap": None if self.snap_deg is None else float(np.radians(self.snap_deg)),
        }

    def _limits(self, n: int) -> dict[str, Any]:
        axes = self.endless
        return {
            "lower": _radians(self.lower_deg),
            "upper": _radians(self.upper_deg),
            "velocity": _radians(self.velocity_deg_s),
            "acceleration": _radians(self.acceleration_deg_s2),
            "jerk": _radians(self.jerk_deg_s3),
            "torque": self.torque_nm,
            "endless": None if axes is None else np.isin(np.arange(1, n + 1), axes),
        }


def _radians(degrees: tuple[float, ...] | None) -> Array | None:
    return None if degrees is None else np.radians(degrees)
