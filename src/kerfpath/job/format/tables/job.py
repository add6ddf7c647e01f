"""The job file: the other tables, [plan] to [sequence], and the rules between tables."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from kerfpath.arrays import short_repr
from kerfpath.auditor import Check, Rounding, checks
from kerfpath.cell import Cell
from kerfpath.certificate import Certify
from kerfpath.comfort import Band, Comfort, Reversals
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.job.format.tables.cell import CellTable, ToolTable
from kerfpath.job.format.tables.part import (
    ContourTable,
    PartTable,
)
from kerfpath.job.format.tables.process import CostTable, ProcessTable, checked_pairs
from kerfpath.job.format.tables.robot import RobotTable
from kerfpath.job.format.tables.table import (
    Identifier,
    Joints,
    NotNegative,
    Number,
    Positive,
    Table,
    Text,
    example,
    fault,
    fault_in_words,
    fields_of,
    folder_of,
    given,
    key,
    nearest,
    require_distinct,
)
from kerfpath.names import LONGEST_NAME
from kerfpath.options import (
    CLEARANCE,
    EXACT_OR_BETTER,
    PENALTIES,
    REVERSALS,
    OptionConflict,
    PlanOptions,
)
from kerfpath.plans import Plan
from kerfpath.post import (
    PARTNERS,
    Await,
    LanguageSettings,
    Partner,
    ProgramKeywords,
    ProgramOptions,
    Request,
    languages,
    pierce_stages,
    power_curve,
)
from kerfpath.robots import Robot, postures_named
from kerfpath.setting import documented, keys, setting, settings
from kerfpath.tilt import Tilt

# -----------------------------------------------------------------------------
# The [plan] table: the search, the objective and the limits, as PlanOptions declares them.


class PlanTable(create_model("PlanKeys", __base__=Table, **fields_of(PlanOptions))):  # type: ignore[misc]  # made
    """[plan]: the search, the objective and the limits of every plan."""

    path_tolerance_mm: Annotated[
        Positive | None,
        key("a number above 0, the largest distance of the tool from the path, in mm", "0.2"),
    ] = None

    @model_validator(mode="after")
    def _details_go_with_what_they_are_of(self) -> PlanTable:
        if self.tilt_deg is None and (more := self._given(Tilt)):
            raise fault(f"tilt_deg with {more[0]}", "none", "add tilt_deg", (more[0],))
        if not self.certify and (more := self._given(Certify)):
            expected, got = f"no {more[0]} with certify = false", _toml(getattr(self, more[0]))
            raise fault(expected, got, "remove one", (more[0],))
        return self

    def _given(self, kind: type) -> list[str]:
        """Return the keys of an option's details that the job gives."""
        given = [name for name in keys(kind) if name in self.model_fields_set]
        return [name for name in given if getattr(self, name) is not False]

    @property
    def executed_tolerance(self) -> float | None:
        """Largest distance of the executed tip from the path, m; None if it is only reported."""
        return None if self.path_tolerance_mm is None else self.path_tolerance_mm / 1000

    def resolve(self, robot: Robot, **others: Any) -> PlanOptions:
        """Return the plan options of the table, and `others` of other tables, in SI.

        Raises
        ------
        OptionConflict
            Two options conflict.
        """
        values = self.si(PlanOptions) | {"interpolation": "linear"} | others
        if self.posture is not None:
            values["postures"] = postures_named(self.posture, robot.kinematics)
        if self.rotation_deg is not None:
            values["rotation"] = np.where(robot.endless, values["rotation"], np.inf)
        if self.refine is None:
            values["refine"] = self.method in EXACT_OR_BETTER
        values["tilt"] = None if self.tilt_deg is None else Tilt(**self.si(Tilt))
        values["certify"] = Certify(**self.si(Certify)) if self.certify else None
        return PlanOptions(**values)


# -----------------------------------------------------------------------------
# Options that do not go together, in the words of a job.


def said_in_keys(conflict: OptionConflict, table: PlanTable) -> tuple[tuple[str, str], str]:
    """Return the key of two options in conflict, and the message in the words of a job."""
    names = {CLEARANCE: "clearance_band_mm", PENALTIES: "costs in [comfort]"}
    names[REVERSALS] = "reversals_cost"
    for name, each in settings(PlanOptions).items():
        names[name] = next(iter(each.keys), name)
    key = names[conflict.option]
    expected = f"no {key}" if conflict.expected is None else f"{key} = {_toml(conflict.expected)}"
    beside = " and ".join(
        f"{names[name]} = {_toml(value)}" if isinstance(value, str) else names[name]
        for name, value in conflict.beside.items()
    )
    said = f"expected {expected} with {beside}, got {_toml(getattr(table, key))}; change one"
    for name in (CLEARANCE, REVERSALS):
        if name in conflict.beside:
            return ("comfort", names[name]), said
    of_both = (key, *(names[name] for name in conflict.beside))
    return ("plan", next((each for each in of_both if each in table.model_fields_set), key)), said


def _toml(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return " or ".join(map(_toml, value))
    return f'"{value}"' if isinstance(value, str) else f"{value}"


# -----------------------------------------------------------------------------
# The tolerances of the audit between the nodes, which [audit] sets.


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """Tolerances of the audit between the nodes."""

    path: float = setting(
        0.1,
        "largest distance of the tool tip from the path",
        unit="mm",
        above=0,
        example="0.1",
        key="path_tolerance_mm",
    )
    axis: float = setting(
        1.0,
        "largest angle between the tool axis and the requested one",
        unit="deg",
        above=0,
        example="1",
        key="axis_tolerance_deg",
    )

    __repr__ = short_repr

    def checks(
        self,
        plan: Plan,
        *,
        reference: Contour | None = None,
        cell: Cell | None = None,
        rounding: Rounding | None = None,
    ) -> list[Check]:
        """Return the audit's table of a plan within these tolerances, see `auditor.checks`."""
        return checks(
            plan,
            reference=reference,
            path_tolerance=self.path,
            axis_tolerance=self.axis,
            cell=cell,
            rounding=rounding,
        )


# -----------------------------------------------------------------------------
# The [comfort] table: margins to singularities, limits and bodies, and penalties beyond them.

LIMITS_MARGIN = 0.1
"""Margin of the joints to their limits, in deg, unless the table sets another. The digits of a
program move a joint by some thousandths of a degree, near a singularity by some hundredths."""

Angle = Annotated[
    Annotated[Positive, Field(lt=90)] | None, key("a number above 0, below 90, in deg", "5")
]
Room = Annotated[Positive | None, key("a number above 0, in deg", "5")]
RoomOrNone = Annotated[NotNegative | None, key("a number not below 0, in deg", "0.1")]
Length = Annotated[Positive | None, key("a number above 0, in mm", "50")]
Volume = Annotated[Positive | None, key("a number above 0, in m^3", "0.05")]
Cost = Annotated[NotNegative | None, key("a number not below 0", "1")]
Numbers = Annotated[
    list[Annotated[int, Field(ge=1)]] | None, key("numbers of joints, from 1", "[1, 2, 3]")
]

DEGREE = float(np.radians(1.0))
UNITS = {
    "wrist": ("deg", DEGREE),
    "elbow": ("deg", DEGREE),
    "shoulder": ("mm", 1e-3),
    "limits": ("deg", DEGREE),
    "manipulability": ("m3", 1.0),
    "clearance": ("mm", 1e-3),
}
"""For each band of `kerfpath.Comfort`: the unit of its keys, and the factor to SI."""


class ComfortTable(Table):
    """[comfort]: margins that are kept, and penalties beyond them and for joints that turn back."""

    wrist_margin_deg: Angle = None
    wrist_band_deg: Angle = None
    wrist_cost: Cost = None
    elbow_margin_deg: Angle = None
    elbow_band_deg: Angle = None
    elbow_cost: Cost = None
    shoulder_margin_mm: Length = None
    shoulder_band_mm: Length = None
    shoulder_cost: Cost = None
    limits_margin_deg: RoomOrNone = None
    limits_band_deg: Room = None
    limits_cost: Cost = None
    manipulability_margin_m3: Volume = None
    manipulability_band_m3: Volume = None
    manipulability_cost: Cost = None
    clearance_band_mm: Length = None
    clearance_cost: Cost = None
    reversals_cost: Cost = None
    reversals_joints: Numbers = None

    @model_validator(mode="after")
    def _goes_together(self) -> ComfortTable:
        """Require that a cost and its band are given together."""
        for name, (unit, _) in UNITS.items():
            keys = f"{name}_band_{unit}", f"{name}_cost"
            for one, other in (keys, keys[::-1]):
                if getattr(self, one) is not None and getattr(self, other) is None:
                    raise fault(f"{other} with {one}", "none", f"add {other}", (one,))
        if (joints := self.reversals_joints) is not None:
            here = ("reversals_joints",)
            if self.reversals_cost is None:
                said = "reversals_cost with reversals_joints"
                raise fault(said, "none", "add reversals_cost", here)
            if not 0 < len(set(joints)) == len(joints):
                raise fault("different numbers of joints", str(joints), "name each once", here)
        return self

    def resolve(self, usual: Mapping[str, float] | None = None) -> Comfort | None:
        """Return the margins, bands and costs of the table, in SI; None if there are none.

        `usual` has default margins by measure, in the unit of its keys, where the table sets none.
        """
        asked: dict[str, Any] = {}
        for name, (unit, si) in UNITS.items():
            # The margin of clearance is the near-miss distance of the cell.
            margin = getattr(self, f"{name}_margin_{unit}", None)
            margin = (usual or {}).get(name) if margin is None else margin
            width = getattr(self, f"{name}_band_{unit}")
            if margin or width is not None:
                asked[name] = Band(
                    margin=(margin or 0.0) * si,
                    width=(width or 0.0) * si,
                    cost=getattr(self, f"{name}_cost") or 0.0,
                )
        if self.reversals_cost:
            joints = self.reversals_joints
            own: dict[str, Any] = {} if joints is None else {"joints": tuple(joints)}
            asked["reversals"] = Reversals(cost=self.reversals_cost, **own)
        return Comfort(**asked) if asked else None


# -----------------------------------------------------------------------------
# The [layout] table: what may be moved and how far, and the goal of the best placement.

Goal = Literal["speed", "margin", "motion"]


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


def variable(label: str, what: str, usual: int) -> Any:
    """Return the field of a variable; `usual` is how far it may go to either side by default."""
    expected = f"2 numbers, the least and the largest {what}"
    return Field(None, title=label, description=expected, examples=[f"[-{usual}, {usual}]"])


class LayoutTable(Table):
    """[layout]: the ranges in which `kerfpath layout` looks for the best placement."""

    goal: Goal = "speed"
    move: Annotated[
        Text, key('"part", or the name of an external axis that carries it', '"part"')
    ] = "part"
    x_mm: Span | None = variable("Part x", "offset in mm", 200)
    y_mm: Span | None = variable("Part y", "offset in mm", 200)
    z_mm: Span | None = variable("Part z", "offset in mm", 200)
    yaw_deg: Span | None = variable("Part about z", "rotation in deg", 30)
    tilt_x_deg: Span | None = variable("Part about x", "rotation in deg", 20)
    tilt_y_deg: Span | None = variable("Part about y", "rotation in deg", 20)
    base_x_mm: Span | None = variable("Robot base x", "offset in mm", 200)
    base_y_mm: Span | None = variable("Robot base y", "offset in mm", 200)
    base_z_mm: Span | None = variable("Robot base z", "offset in mm", 200)
    base_yaw_deg: Span | None = variable("Robot base about z", "rotation in deg", 30)
    mount_deg: Span | None = variable("Head about flange", "rotation in deg", 90)
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


VARIABLES = {name: field.title for name, field in LayoutTable.model_fields.items() if field.title}
"""What may vary, in words: offsets of the part, of the robot's base, the rotation of the head."""

# -----------------------------------------------------------------------------
# The [program] and [audit] tables: the robot program, and the tolerances of its audit.

PARTNERS_SAID = f"a list of {', '.join(PARTNERS)}"


class ProgramTable(create_model("ProgramKeys", __base__=Table, **fields_of(ProgramOptions))):  # type: ignore[misc]  # made
    """[program]: the robot program, its language and process values.

    A table [program.LANGUAGE] in it holds the settings of that language.
    """

    model_config = ConfigDict(extra="allow")

    name: Identifier = None
    gas_2: Annotated[
        Text | None, key("the gas that gas_2_output switches, as charts call it", '"O2"')
    ] = None
    request: Annotated[list[Partner] | None, key(PARTNERS_SAID, '["shutter"]')] = None
    wait_for: Annotated[list[Partner] | None, key(PARTNERS_SAID, '["ready"]')] = None
    wait_timeout_s: Annotated[Positive, key("a number from 0 to 600, in s", "5", le=600)] = 5.0
    incomplete: Annotated[
        Literal["refuse", "accept"],
        key("what to do if contours have no path: write no program, or one without", '"accept"'),
    ] = "refuse"
    compensate: Annotated[
        Text | None,
        key('"model", or the path of a file that kerfpath correct wrote', '"model"'),
    ] = None
    compensate_most_mm: Annotated[
        Positive, key("a number above 0, at most 4, in mm", "2", le=4)
    ] = 2.0

    @field_validator("request", "wait_for")
    @classmethod
    def _is_said_once(cls, partners: list[Partner] | None) -> list[Partner] | None:
        if partners and len(set(partners)) < len(partners):
            raise fault("each partner once", repr(partners), "remove the second")
        return partners

    _is_a_curve = field_validator("power_by_speed")(checked_pairs(power_curve))
    _are_stages = field_validator("pierce_stages")(checked_pairs(pierce_stages))

    @model_validator(mode="after")
    def _stages_stand_alone(self) -> ProgramTable:
        if self.pierce_stages is None:
            return self
        given = {"pierce_time_s", "pierce_power"} & self.model_fields_set
        for name in sorted(given):
            raise fault(f"pierce_stages without {name}", "both", "remove one", (name,))
        if self.power_by_speed is None:
            said = "power_by_speed with pierce_stages"
            raise fault(said, "none", "add power_by_speed", ("pierce_stages",))
        return self

    @field_validator("language")
    @classmethod
    def _is_known(cls, name: str) -> str:
        if name not in languages() and name != "none":
            known = [*languages(), "none"]
            raise fault("a robot language, or none", None, f"write one; {nearest(name, known)}")
        return name

    @model_validator(mode="after")
    def _settings_fit(self) -> ProgramTable:
        for name, table in (self.model_extra or {}).items():
            if name not in languages():
                known = [*type(self).model_fields, *languages()]
                raise fault("a key of [program]", "an unknown name", nearest(name, known), (name,))
            _settings(name, table)
        return self

    def settings(self) -> LanguageSettings | None:
        """Return the settings of the language; None without a program."""
        if self.language == "none":
            return None
        return _settings(self.language, (self.model_extra or {}).get(self.language, {}))

    def resolve(
        self,
        stem: str,
        path_tolerance: float,
        remarks: Sequence[str] = (),
        contours: Mapping[str, ProgramKeywords] | None = None,
    ) -> ProgramOptions:
        """Return the options of the program, in SI.

        Parameters
        ----------
        stem : str
            Name of the job file, for a program without a name.
        path_tolerance : float m
            By which corners may be rounded without zone_error_mm.
        remarks : sequence of str
            Lines for the comment at the head of the program.
        contours : mapping of str to dict, optional
            Options that each contour has of its own.
        """
        stem = re.sub(r"[^A-Za-z0-9_]", "_", stem)
        stem = stem if stem[:1].isascii() and stem[:1].isalpha() else f"job_{stem}"
        requests = (Request(partner=partner, on=True) for partner in self.request or ())
        timeout = self.wait_timeout_s
        waits = (Await(partner=partner, timeout=timeout) for partner in self.wait_for or ())
        values = self.si(ProgramOptions)
        values["name"] = self.name or stem[:LONGEST_NAME]
        if self.zone_error_mm is None:
            values["zone_error"] = path_tolerance
        return ProgramOptions(
            settings=self.settings(),
            handshakes=(*requests, *waits),
            remarks=tuple(remarks),
            contours=contours or {},
            **values,
        )


def _settings(name: str, table: Any) -> LanguageSettings:
    """Return the settings that a table [program.LANGUAGE] holds, or raise at its first fault."""
    model = languages()[name].settings
    try:
        return model.model_validate(table)
    except ValidationError as error:
        detail = error.errors(include_url=False)[0]
    at = str(detail["loc"][0]) if detail["loc"] else ""
    if at not in model.model_fields:
        got = "an unknown name" if at else f"{table!r}"
        remedy = nearest(at, list(model.model_fields))
        raise fault(f"a key of [program.{name}]", got, remedy, (name, *([at] if at else [])))
    said, got = model.model_fields[at].description, f"{detail['input']!r}"[:60]
    remedy = f"write, for example, {example(model, at)}"
    raise fault(said or "another value", got, remedy, (name, at))


class AuditTable(create_model("AuditKeys", __base__=Table, **fields_of(Tolerances))):  # type: ignore[misc]  # made
    """[audit]: how far the tool may leave the path between the nodes."""

    def resolve(self) -> Tolerances:
        """Return the tolerances, in SI."""
        return Tolerances(**self.si(Tolerances))


# -----------------------------------------------------------------------------
# The [sequence] table: the order of cutting, and the moves between the contours.


class SequenceTable(Table):
    """[sequence]: with it, the moves between contours are planned and audited, too."""

    order: Annotated[
        Literal["given", "best"], key("the order of the file, or the fastest order", '"best"')
    ] = "best"
    inner_first: Annotated[bool, key("true or false", "true")] = True
    heat_spacing_mm: Annotated[NotNegative, key("a number not below 0, in mm", "40")] = 0.0
    heat_time_s: Annotated[NotNegative, key("a number not below 0, in s", "20")] = 0.0
    home_deg: Annotated[
        Joints | None, key("one number for every joint, in deg", "[0, -20, 10, 0, 60, 0]")
    ] = None
    seconds: Annotated[Positive, key("a number above 0, in s", "10")] = 10.0

    @model_validator(mode="after")
    def _time_for_neighbours(self) -> SequenceTable:
        if self.heat_time_s and not self.heat_spacing_mm:
            remedy = "add heat_spacing_mm, the distance of contours that heat each other"
            raise fault("heat_spacing_mm with heat_time_s", "none", remedy, ("heat_time_s",))
        return self


# -----------------------------------------------------------------------------
# The complete job file: every table, and the rules between tables.


class JobFile(Table):
    """The complete job file: robot, tool, part, contours, plan options, cell and program."""

    robot: RobotTable
    tool: ToolTable
    part: PartTable
    process: ProcessTable | None = None
    contour: Annotated[tuple[ContourTable, ...], Field(strict=False, min_length=1)]
    plan: PlanTable = PlanTable()
    cell: CellTable | None = None
    sequence: SequenceTable | None = None
    comfort: ComfortTable = ComfortTable()
    layout: LayoutTable = LayoutTable()
    audit: AuditTable = AuditTable()
    program: ProgramTable = ProgramTable()
    cost: CostTable | None = None

    @model_validator(mode="after")
    def _names_differ(self) -> JobFile:
        names = [table.name or table.pick for table in self.contour]
        keys = ["name" if table.name else "pick" for table in self.contour]
        require_distinct(names, "contour", "contour", keys)
        return self

    @model_validator(mode="after")
    def _speeds_are_known(self) -> JobFile:
        """Require a speed of each contour, unless the drawing may say it."""
        if self.part.may_say_speeds:
            return self
        for i, table in enumerate(self.contour):
            if table.speed_m_min is None:
                said = str(ContourTable.model_fields["speed_m_min"].description)
                remedy = f"add, for example, {example(ContourTable, 'speed_m_min')}"
                raise fault(said, "nothing", remedy, ("contour", i, "speed_m_min"))
        return self

    @model_validator(mode="after")
    def _process_is_there(self) -> JobFile:
        """Require [process] where a key needs its rows: a technique, a gas or a price."""
        if self.process is not None:
            return self
        for i, table in enumerate(self.contour):
            if table.technique is not None:
                expected, remedy = "[process] with technique", "add [process], or remove technique"
                raise fault(expected, "none", remedy, ("contour", i, "technique"))
        if self.program.gas_2 is not None:
            expected = "[process] with gas_2, whose rows have gases"
            raise fault(expected, "none", "add it, or remove gas_2", ("program", "gas_2"))
        for name in () if self.cost is None else given(self.cost, "gas_per_m3", "power_per_kwh"):
            expected = f"[process] with {name}, whose rows have gas and power"
            raise fault(expected, "none", f"add it, or remove {name}", ("cost", name))
        return self

    @model_validator(mode="after")
    def _one_for_every_joint(self, info: ValidationInfo) -> JobFile:
        home = None if self.sequence is None else self.sequence.home_deg
        given = {("plan", "weights"): self.plan.weights, ("sequence", "home_deg"): home}
        n, more = self.robot.joints(folder_of(info)), len(self.robot.axes(folder_of(info)))
        for where, numbers in given.items():
            joints = n + more * (where[1] == "weights")
            if numbers is not None and len(numbers) != joints:
                axes = f", {more} of them for external axes" if joints > n else ""
                expected = f"{joints} numbers, one for every joint{axes}"
                raise fault(expected, f"{len(numbers)}", "give as many", where)
        return self

    @model_validator(mode="after")
    def _posture_fits(self, info: ValidationInfo) -> JobFile:
        if self.plan.posture is not None:
            try:
                postures_named(self.plan.posture, self.robot.resolve(folder_of(info)).kinematics)
            except InputError as error:
                raise fault_in_words(f"{error}", ("plan", "posture")) from None
        return self

    @model_validator(mode="after")
    def _best_is_chosen(self) -> JobFile:
        """Require [sequence] where a start or a direction is to be chosen."""
        if self.sequence is not None:
            return self
        for i, table in enumerate(self.contour):
            for name in ("start", "direction"):
                if getattr(table, name) == "best":
                    raise fault(
                        f'[sequence] with {name} = "best"',
                        "none",
                        f"add [sequence], or write another {name}",
                        ("contour", i, name),
                    )
        return self

    @model_validator(mode="after")
    def _cell_fits(self) -> JobFile:
        """Refuse options that cannot be combined with a cell, at their key."""
        if self.cell is None:
            return self
        if (method := self.plan.method) not in EXACT_OR_BETTER:
            expected = 'method = "continuous" or "exact" with [cell]'
            raise fault(expected, f'"{method}"', "change one", ("plan", "method"))
        if self.cell.links == "description" and self.robot.urdf is None:
            raise fault(
                'links = "description" only with urdf in [robot]',
                "none",
                'write links = "capsules"',
                ("cell", "links"),
            )
        return self

    @model_validator(mode="after")
    def _standing_are_fixtures(self) -> JobFile:
        fixtures = [] if self.cell is None else [fixture.name for fixture in self.cell.fixture]
        for i, name in enumerate(self.layout.standing):
            if name not in fixtures:
                raise fault(
                    "the name of a fixture",
                    f'"{name}"',
                    f"there are {', '.join(fixtures) or 'none'}",
                    ("layout", "standing", i),
                )
        return self

    @model_validator(mode="after")
    def _movable(self) -> JobFile:
        """Require that a layout moves the part, or an external axis that carries it."""
        name = self.layout.move
        carriers = [axis.name for axis in self.robot.external if axis.carries == "part"]
        if name != "part" and name not in carriers:
            hint = "vary base_x_mm, base_y_mm, base_z_mm or base_yaw_deg to move the robot"
            raise fault(
                f"one of {', '.join(map(repr, ('part', *carriers)))}",
                f'"{name}"',
                hint if any(axis.name == name for axis in self.robot.external) else "name one",
                ("layout", "move"),
            )
        return self

    @model_validator(mode="after")
    def _clearance_is_measured(self) -> JobFile:
        """Refuse a cost of clearance where the planner would not measure it."""
        here = ("comfort", "clearance_band_mm")
        if self.comfort.clearance_band_mm is None:
            return self
        if self.cell is None:
            expected = "[cell] with clearance_band_mm, as clearance is measured in the cell"
            raise fault(expected, "none", "add [cell], or remove clearance_band_mm", here)
        return self


def tables_in(kind: Any, name: str = "") -> Iterator[tuple[str, type[BaseModel]]]:
    """Yield the tables in the type of a key, and those in them, with their dotted names."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        yield name, kind
        for key, field in kind.model_fields.items():
            yield from tables_in(field.annotation, f"{name}.{key}".strip("."))
    for part in get_args(kind):
        yield from tables_in(part, name)


TABLES = {name: table for name, table in tables_in(JobFile) if name}
"""The model of each table of the file."""
REPEATED = (
    "contour",
    "cell.fixture",
    "cell.pair",
    "robot.external",
    "process.row",
    "process.row.pierce",
    "row",
    "row.pierce",
)
"""Tables that a job or a chart may have several of."""
