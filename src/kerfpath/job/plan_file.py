"""plan.json: its layout, and how plans are written to it and read back, strictly checked."""

from __future__ import annotations

import base64
import binascii
import json
import math
import re
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
from pathlib import Path
from types import UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    NotRequired,
    TypedDict,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError, create_model

from kerfpath import __version__
from kerfpath.acceleration_table import AccelerationTable
from kerfpath.arrays import Array, floats, short_repr
from kerfpath.auditor import BOUND, Check, Level, Unit
from kerfpath.cell import Cell, caveats
from kerfpath.certificate import Branch, Certificate, Stage
from kerfpath.comfort import MEASURES
from kerfpath.contour import KINDS, Contour
from kerfpath.dynamics import Load
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.job.format import AuditTable, ProgramTable, Tolerances, contours_of, sheet_of
from kerfpath.options import PlanOptions
from kerfpath.planner import FastestSpeed
from kerfpath.plans import Explored, Feed, Plan, Proof, TransferMove
from kerfpath.post import ProgramOptions, require_one_set
from kerfpath.robots import Arm, Coupling, ExternalAxis, Robot, RobotLimits
from kerfpath.sequence import PartPlan
from kerfpath.setting import settings
from kerfpath.text import NOT_TEXT, named
from kerfpath.urdf import ChainInertia, KinematicChain

# -----------------------------------------------------------------------------
# The layout: every key and the type of its value, SI, the unit in the name.

Row = list[float]
Rows = list[Row]
Kind = Literal["cut", "pierce", "lead-in", "micro joint", "overlap", "lead-out", "loop", "corner"]


class ChainData(TypedDict):
    """The joint frames of a robot that is known by its description."""

    origins: list[Rows]
    axes: Rows
    end: Rows


class RobotData(TypedDict):
    """A robot: which, and its geometry."""

    id: str
    manufacturer: str
    model: str
    kinematics: str
    geometry_m: dict[str, float]
    sign: Row
    offset_rad: Row
    axis_3: str
    T_base_foot: Rows
    T_end_flange: Rows
    chain: ChainData | None


class AxisData(TypedDict):
    """An external axis."""

    name: str
    kind: Literal["linear", "rotary"]
    carries: Literal["robot", "part"]
    unit: Literal["m", "rad"]
    axis: Row
    point_m: Row
    step: float | None


class TravelData(TypedDict):
    """The limits of an external axis, in its unit, per s and s^2."""

    lower: float
    upper: float
    velocity: float
    acceleration: float
    endless: bool


class ExternalData(AxisData, TravelData):
    """An external axis and its limits."""


class CouplingData(TypedDict):
    """A limit of several joints together."""

    row: Row
    lower_rad: float
    upper_rad: float
    note: str


class DynamicsData(TypedDict):
    """The torque limits that were used, and the masses that load the joints."""

    torque_nm: Row
    gravity_m_s2: Row
    mass_kg: Row
    centre_m: list[Row]
    inertia_kg_m2: list[list[Row]]
    load_mass_kg: float
    load_centre_m: Row | None
    load_inertia_kg_m2: list[Row] | None


class AccelerationTableData(TypedDict):
    """Acceleration limits of joints over joints 2 and 3, by the number of the joint."""

    joint_2_rad: Row
    joint_3_rad: Row
    limits_rad_s2: dict[str, list[Row]]
    source: str


class LimitsData(TypedDict):
    """The limits of the arm's joints that were used."""

    lower_rad: Row
    upper_rad: Row
    endless: list[bool]
    velocity_rad_s: Row
    acceleration_rad_s2: Row
    acceleration_source: str
    couplings: list[CouplingData]
    acceleration_table: NotRequired[AccelerationTableData]
    jerk_rad_s3: NotRequired[list[float | None]]
    dynamics: NotRequired[DynamicsData]


class NearestData(TypedDict):
    """The least value of a measure of comfort along the plan, and its node."""

    least: float | None
    unit: str
    node: int


class CriteriaData(TypedDict):
    """The criteria of a plan, joint by joint; those of external axes are separate."""

    displacement_rad: Row
    external_displacement: NotRequired[Row]
    largest_increment_rad: Row
    external_largest_increment: NotRequired[Row]
    range_rad: Row
    external_range: NotRequired[Row]
    peak_velocity_share: Row
    peak_acceleration_share: Row
    reversals: NotRequired[list[int]]
    nearest: dict[str, NearestData]


class FeedData(TypedDict):
    """Where the feed is reduced, and the limit that binds there."""

    full: float
    slowest: float
    node: int
    joint: int
    limit: Literal["velocity", "acceleration"] | None


class CheckData(TypedDict):
    """A row of the audit."""

    code: str
    title: str
    value: float
    limit: float
    unit: Unit
    node: int
    level: Level
    advice: str
    ok: bool


class AuditData(TypedDict):
    """The audit made when the contour was planned."""

    passed: bool
    checks: list[CheckData]


class NodesData(TypedDict):
    """The nodes of a plan, a row each."""

    s_m: Row
    time_s: Row
    points_m: Rows
    axes: Rows
    kind: list[Kind]
    speed_share: Row
    x: Rows | None
    q_rad: Rows
    external_q: NotRequired[Rows]
    gamma_rad: Row
    lead_lean_rad: Rows | None
    posture: list[int]
    turn: list[list[int]]


class ArrayData(TypedDict):
    """An array: its numbers, its shape, and its bytes row by row, compressed."""

    type: str
    shape: list[int]
    zlib_base64: str


class StageData(TypedDict):
    """A stage of a certificate: cells and a potential over them, see `kerfpath.certificate`."""

    node: ArrayData
    posture: ArrayData
    level: ArrayData
    index: ArrayData
    lift: ArrayData
    value: ArrayData
    dual: ArrayData
    multipliers: ArrayData | None


class BranchData(TypedDict):
    """A part of the motions, as in `kerfpath.certificate.Branch`."""

    stages: list[StageData]
    y: ArrayData | None
    multipliers: ArrayData | None
    node: int
    posture: int
    gamma: float


class CertificateData(TypedDict):
    """The certificate that proves a bound."""

    bound: float
    stages: list[StageData]
    branches: NotRequired[list[BranchData]]


class ExploredData(TypedDict):
    """What the search followed and dropped, see `kerfpath.plans.Explored`."""

    valleys: dict[str, int]
    all_valleys: bool
    screened: int
    refined: int
    dearer: int
    alike: int
    left: int
    dropped: NotRequired[int]
    unfollowed: NotRequired[int]


class PlanData(TypedDict):
    """A contour, or a piece of one, that has a plan: its results, and beside them its options."""

    name: str
    contour: str
    feasible: bool
    picked: NotRequired[bool]
    closed: bool
    external_weights_per: NotRequired[Row]
    dt: float
    cost: float
    optimal: bool
    proof: str
    grid_cost: float | None
    bound: float | None
    gap: float | None
    certificate: NotRequired[CertificateData]
    approach: NotRequired[MoveData]
    retreat: NotRequired[MoveData]
    explored: NotRequired[ExploredData]
    criteria: CriteriaData
    feed: FeedData | None
    counts: dict[str, int]
    audit: AuditData
    nodes: NodesData


class ClosedData(TypedDict):
    """Where no motion passes at any gamma: node and joint from 0, and the limit of the joint."""

    node: int
    joint: int | None
    limit: Literal["velocity", "acceleration", "pose", "both"]


class RelaxationData(TypedDict):
    """Factors on the request with which a motion was found: less speed, or higher limits."""

    speed: float
    velocity: float
    acceleration: float


class BrokenData(TypedDict):
    """A contour without a plan, and why."""

    name: str
    feasible: bool
    reason: str
    proved: bool
    proved_for: NotRequired[Literal["every gamma", "grid", "undecided"]]
    closed: NotRequired[ClosedData | None]
    relaxation: NotRequired[RelaxationData | None]
    last_node_reached: int
    counts: dict[str, int]
    fastest_speed_m_s: float | None


ContourData = PlanData | BrokenData


class MoveData(TypedDict):
    """A transfer move."""

    clear: bool
    time_s: Row
    q_rad: Rows
    external_q: NotRequired[Rows]


class SequenceData(TypedDict):
    """The order of cutting and the moves between the contours."""

    optimal: bool
    duration_s: float
    at_least_s: float
    cycle_s: float
    cutting_s: float
    air_s: float
    piercing_s: float
    retract_m: float
    moves: list[MoveData]


class PlanDocument(TypedDict):
    """The complete file; `job` is the parsed job file, `cell` a record that no reader relies on."""

    schema: int
    kerfpath: str
    job: dict[str, Any]
    robot: RobotData
    external_axes: list[ExternalData]
    T_flange_tip: Rows
    T_base_part: Rows
    limits: LimitsData
    cell: dict[str, object] | None
    contours: list[ContourData]
    sequence: SequenceData | None


# -----------------------------------------------------------------------------
# Check a plan.json against its layout: every key and every value, as strictly as JSON allows.

SCHEMA = 10
"""Version of the layout of plan.json; it grows if readers of the old one would misread the file."""
LARGEST_NUMBER = 1e12
"""Largest number of a plan, in SI; not even the sum of all counts is larger."""
SHOWN = 60
"""Most characters of a wrong value that a message shows."""

Real = Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
Whole = Annotated[int, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]


class _Entry(BaseModel):
    """An object of the file: strict about types, without unknown keys."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


def _strict(kind: Any) -> Any:
    """Return the strict form of a type: numbers within bounds, objects without other keys."""
    if kind in (float, int):
        return Real if kind is float else Whole
    if kind == ContourData:
        options = {each.data: _strict(each.json) for each in settings(PlanOptions).values()}
        options["weights_per_rad"] = list[Real]  # a plan's own are always there
        planned = _model(PlanData, **options)
        return Annotated[
            Annotated[planned, Tag("planned")] | Annotated[_model(BrokenData), Tag("broken")],
            Discriminator(_is_planned),
        ]
    if is_typeddict(kind):
        return _model(kind)
    inner = tuple(_strict(each) for each in get_args(kind))
    if get_origin(kind) in (Union, UnionType):
        return Union[inner]  # noqa: UP007  # of as many as there are
    return get_origin(kind)[inner] if get_origin(kind) in (list, dict) else kind


def _model(kind: Any, **more: Any) -> type[_Entry]:
    """Return the model of a TypedDict with `more` keys, whose types are strict already."""
    # A field called "schema" would hide a method of the model.
    keys: dict[str, Any] = {f"{name}_": (hint, Field(alias=name)) for name, hint in more.items()}
    for name, hint in get_type_hints(kind, include_extras=True).items():
        optional = get_origin(hint) is NotRequired
        value = _strict(get_args(hint)[0] if optional else hint)
        keys[f"{name}_"] = (value, Field(None if optional else ..., alias=name))
    return create_model(kind.__name__, __base__=_Entry, **keys)


def _is_planned(entry: Any) -> str:
    return "broken" if isinstance(entry, dict) and entry.get("feasible") is False else "planned"


_Document = _model(PlanDocument)


def read_document(path: Path) -> PlanDocument:
    """Return the content of a plan.json, with every key and the type of every value checked.

    Raises
    ------
    InputError
        The file does not exist, is not JSON or has another schema; a key is unknown, missing or
        twice in an object; a value has another type (true or "1.0" for a number); a number is not
        finite or too large; or a text has a control character or one without a glyph.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give a plan.json") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a plan.json: {' '.join(str(error).split())}") from None
    try:
        data = json.loads(text, object_pairs_hook=_once, parse_constant=_no_number)
        _require_text(json.dumps(data, ensure_ascii=False))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not a plan.json: {' '.join(str(error).split())}") from None
    if (
        not isinstance(data, dict)
        or type(data.get("schema")) is not int
        or data["schema"] != SCHEMA
    ):
        got = data.get("schema") if isinstance(data, dict) else type(data).__name__
        raise InputError(
            f"{path}: expected a plan.json with schema {SCHEMA}, got {_shown(got)}; plan the job "
            "again"
        )
    try:
        _Document.model_validate(data)
    except ValidationError as error:
        raise InputError(f"{path}: {_problem(error)}; plan the job again") from None
    for name, table in data["job"].items():
        if name != "contour" and not isinstance(table, dict):
            said = f"job.{name}: expected a table, got {_shown(table)}"
            raise InputError(f"{path}: {said}; plan the job again")
    twice = [name for name, n in Counter(e["name"] for e in data["contours"]).items() if n > 1]
    if twice:
        said = f"expected distinct names, got {_shown(twice[0])} twice"
        raise InputError(f"{path}: contours: {said}; plan the job again")
    return cast(PlanDocument, data)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"the key {_shown(twice)} is twice in one object")
    return table


CONTROL = re.compile(r"\\(?:[bfnrt]|u....)")
"""A control character in JSON, which escapes it."""


def _require_text(said: str) -> None:
    """Require that every text of a document, written as JSON, is one line of text."""
    odd = NOT_TEXT.search(said) or CONTROL.search(said.replace(r"\\", ""))
    if odd is not None:
        character = json.loads(f'"{odd[0]}"')
        raise ValueError(f"expected texts of one line, got {named(character)}")


def _no_number(word: str) -> Any:
    raise ValueError(f"expected a number, got {word}")


def _problem(error: ValidationError) -> str:
    """Return the first problem: where, what was expected, what came."""
    first = error.errors(include_url=False)[0]
    where = ".".join(str(step) for step in first["loc"] if step not in ("planned", "broken"))
    if first["type"] == "missing":
        return f"the key {where} is missing"
    if first["type"] == "extra_forbidden":
        return f"the key {where} is not known"
    what = first["msg"].removeprefix("Input should be ")
    return f"{where}: expected {what}, got {_shown(first['input'])}"


def _shown(value: object) -> str:
    """Return a value in JSON notation, shortened."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > LARGEST_NUMBER:
        return "a number of more than 12 digits"
    text = json.dumps(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


# -----------------------------------------------------------------------------
# Objects and their entries: a key is the name of an attribute, with its unit.

UNIT = re.compile(r"_(m|rad|rad_s|rad_s2|s)$")


@cache
def _attributes(kind: Any) -> dict[str, str]:
    """Return the attribute for each key that an entry must have, `kind` its TypedDict."""
    hints = get_type_hints(kind, include_extras=True).items()
    return {key: UNIT.sub("", key) for key, hint in hints if get_origin(hint) is not NotRequired}


def _written(kind: Any, one: Any) -> Any:
    """Return the entry of an object; None of None."""
    if one is None:
        return None
    values = {key: getattr(one, name) for key, name in _attributes(kind).items()}
    return {key: x.tolist() if isinstance(x, np.ndarray) else x for key, x in values.items()}


def _read(kind: Any, entry: Any) -> dict[str, Any]:
    """Return the attributes of an object from its entry."""
    return {name: entry[key] for key, name in _attributes(kind).items()}


# -----------------------------------------------------------------------------
# Certificates in plan.json: their arrays, packed.

TYPES: Mapping[str, str] = {
    "node": "<i4",
    "posture": "<i1",
    "level": "<i1",
    "index": "<i4",
    "lift": "<i1",
    "value": "<f8",
    "dual": "<f4",
    "multipliers": "<f8",
}
"""Number type of each array of a stage, little-endian; its bytes are row by row."""
LARGEST_ARRAY = 1 << 30
"""Size of the largest array that is unpacked, in bytes."""


def certificate_entry(certificate: Certificate) -> CertificateData:
    """Return the plan.json entry of a certificate."""
    entry: CertificateData = {
        "bound": certificate.bound,
        "stages": [_stage_entry(stage) for stage in certificate.stages],
    }
    if certificate.branches:
        kind = TYPES["multipliers"]
        entry["branches"] = [
            {
                "stages": [_stage_entry(stage) for stage in branch.stages],
                "y": _packed(branch.y, kind),
                "multipliers": _packed(branch.multipliers, kind),
                "node": branch.node,
                "posture": branch.posture,
                "gamma": branch.gamma,
            }
            for branch in certificate.branches
        ]
    return entry


def _stage_entry(stage: Stage) -> StageData:
    entry = {name: _packed(getattr(stage, name), kind) for name, kind in TYPES.items()}
    return cast(StageData, entry)


def read_certificate(data: CertificateData) -> Certificate:
    """Return the certificate of such an entry.

    Raises
    ------
    InputError
        An array differs from its stated type or size, or from the number of cells of its stage.
    """
    return Certificate(
        bound=data["bound"],
        stages=_stages("certificate", data["stages"]),
        branches=tuple(
            _branch(f"certificate, branch {number}", each)
            for number, each in enumerate(data.get("branches", ()))
        ),
    )


def _branch(where: str, data: BranchData) -> Branch:
    kind = TYPES["multipliers"]
    y, nu = (
        _unpacked(packed, kind, f"{where}: {name}")
        for name, packed in (("y", data["y"]), ("multipliers", data["multipliers"]))
    )
    return Branch(
        stages=_stages(where, data["stages"]),
        y=cast(Array | None, y),
        multipliers=cast(Array | None, nu),
        node=data["node"],
        posture=data["posture"],
        gamma=data["gamma"],
    )


def _stages(where: str, data: list[StageData]) -> tuple[Stage, ...]:
    return tuple(_stage(f"{where}, stage {number}", each) for number, each in enumerate(data))


def _stage(where: str, data: StageData) -> Stage:
    arrays: dict[str, NDArray[np.generic] | None] = {}
    for name, kind in TYPES.items():
        packed = cast(ArrayData | None, data[name])  # type: ignore[literal-required]  # one of TYPES
        arrays[name] = _unpacked(packed, kind, f"{where}: {name}")
    C = arrays["node"].shape[:1] if arrays["node"] is not None else ()
    for name, part in arrays.items():
        if part is not None and name != "multipliers" and part.shape[:1] != C:
            raise InputError(f"{where}: expected {name} for {C} nodes, got the shape {part.shape}")
    return Stage(**arrays)  # type: ignore[arg-type]  # each of its type


def _packed(part: NDArray[np.generic] | None, kind: str) -> ArrayData | None:
    if part is None:
        return None
    raw = np.ascontiguousarray(part, dtype=kind).tobytes()
    return {
        "type": kind,
        "shape": list(part.shape),
        "zlib_base64": base64.b64encode(zlib.compress(raw, 6)).decode(),
    }


def _unpacked(data: ArrayData | None, kind: str, where: str) -> NDArray[np.generic] | None:
    if data is None:
        return None
    if data["type"] != kind:
        raise InputError(f"{where}: expected numbers of type {kind}, got {data['type']!r}")
    shape = data["shape"]
    size = math.prod(shape) * np.dtype(kind).itemsize
    if min(shape, default=0) < 0 or size > LARGEST_ARRAY:
        raise InputError(f"{where}: expected the shape of an array, got {shape}")
    try:
        packed = base64.b64decode(data["zlib_base64"], validate=True)
        opened = zlib.decompressobj()
        raw = opened.decompress(packed, size + 1)
    except (binascii.Error, ValueError, zlib.error) as error:
        raise InputError(f"{where}: cannot be unpacked ({error})") from None
    if len(raw) != size or not opened.eof or opened.unused_data:
        raise InputError(f"{where}: expected {size} bytes of shape {shape}, got another number")
    return np.frombuffer(raw, dtype=kind).reshape(shape)


# -----------------------------------------------------------------------------
# Limits that depend on the configuration, and limits on torque and jerk, in plan.json.


def dynamics_entry(robot: Robot) -> LimitsData:
    """Return the keys that a table, torques and jerks add to the limits of the arm's joints."""
    entry: LimitsData = {}  # type: ignore[typeddict-item]  # some keys of it, to be added
    if (table := robot.limits.acceleration_table) is not None:
        entry["acceleration_table"] = {
            "joint_2_rad": table.joint_2.tolist(),
            "joint_3_rad": table.joint_3.tolist(),
            "limits_rad_s2": {str(joint): of.tolist() for joint, of in table.limits.items()},
            "source": table.source,
        }
    if robot.limits.jerk is not None:
        entry["jerk_rad_s3"] = [float(x) if np.isfinite(x) else None for x in robot.limits.jerk]
    load, own = robot.dynamics.load, robot.dynamics.inertia
    if load is None or own is None or robot.limits.torque is None:
        return entry
    entry["dynamics"] = {
        "torque_nm": robot.limits.torque.tolist(),
        "gravity_m_s2": robot.dynamics.gravity.tolist(),
        "mass_kg": own.mass.tolist(),
        "centre_m": own.centre.tolist(),
        "inertia_kg_m2": own.tensor.tolist(),
        "load_mass_kg": load.mass,
        "load_centre_m": None if load.centre is None else load.centre.tolist(),
        "load_inertia_kg_m2": None if load.tensor is None else load.tensor.tolist(),
    }
    return entry


def with_dynamics(entry: LimitsData, robot: Robot) -> Robot:
    """Return the arm with the table and the limits on torque and jerk of such an entry.

    Raises
    ------
    InputError
        The table, the load or the masses are not possible.
    """
    if (rows := entry.get("acceleration_table")) is not None:
        if not all(joint.isdecimal() for joint in rows["limits_rad_s2"]):
            raise InputError(
                "acceleration_table: expected the numbers of joints, got "
                f"{', '.join(rows['limits_rad_s2'])}"
            )
        table = AccelerationTable(
            joint_2=np.array(rows["joint_2_rad"]),
            joint_3=np.array(rows["joint_3_rad"]),
            limits={int(joint): np.array(of) for joint, of in rows["limits_rad_s2"].items()},
            source=rows["source"],
        )
        robot = replace(robot, limits=replace(robot.limits, acceleration_table=table))
    jerk = entry.get("jerk_rad_s3")
    if jerk is not None:
        robot = robot.with_limits(jerk=[np.inf if value is None else value for value in jerk])
    said: DynamicsData | None = entry.get("dynamics")
    if said is None:
        return robot
    own = ChainInertia(
        mass=np.array(said["mass_kg"]),
        centre=np.array(said["centre_m"]),
        tensor=np.array(said["inertia_kg_m2"]),
    )
    load = Load(
        mass=said["load_mass_kg"],
        centre=said["load_centre_m"],  # type: ignore[arg-type]  # cast by __post_init__
        tensor=said["load_inertia_kg_m2"],  # type: ignore[arg-type]  # cast by __post_init__
    )
    known = replace(robot, dynamics=replace(robot.dynamics, inertia=own))
    limited = known.with_limits(torque=said["torque_nm"])
    return limited.with_load(load, gravity=said["gravity_m_s2"])


# -----------------------------------------------------------------------------
# External axes in plan.json: their values are separate from the arm's, in their own units.


def apart(name: str, values: Array, robot: Robot) -> dict[str, object]:
    """Return values (..., n) of the joints; external axes are separate and in their own units."""
    n = robot.family.joints
    entry: dict[str, object] = {f"{name}_rad": values[..., :n].tolist()}
    if robot.externals:
        entry[f"external_{name}"] = values[..., n:].tolist()
    return entry


def joints(entry: Mapping[str, Any], name: str, robot: Robot) -> Array:
    """Return values (..., n) of the joints from an entry that `apart` has made.

    Raises
    ------
    InputError
        There are too few or too many values of external axes.
    """
    own = np.array(entry[f"{name}_rad"], dtype=float)
    if not robot.externals:
        return own
    others = np.array(entry.get(f"external_{name}", ()), dtype=float)
    if others.shape != (*own.shape[:-1], len(robot.externals)):
        raise InputError(
            f"external_{name}: expected {len(robot.externals)} numbers for each of {name}_rad, got "
            f"the shape {others.shape}"
        )
    return np.concatenate([own, others], axis=-1)


def external_entries(robot: Robot) -> list[ExternalData]:
    """Return the plan.json entries of the robot's external axes."""
    if not robot.externals:
        return []
    limits, (velocity, acceleration) = robot.joint_limits(), robot.speed_limits()
    return [
        {
            **cast(AxisData, _written(AxisData, axis)),
            "lower": float(limits.lower[i]),
            "upper": float(limits.upper[i]),
            "velocity": float(velocity[i]),
            "acceleration": float(acceleration[i]),
            "endless": bool(robot.endless[i]),
        }
        for i, axis in enumerate(robot.externals, robot.family.joints)
    ]


def add_externals(entries: list[ExternalData], robot: Robot) -> Robot:
    """Return the arm with the external axes of such entries."""
    for entry in entries:
        own = _read(AxisData, entry)
        del own["unit"]  # that of its kind
        robot = robot.with_external(ExternalAxis(**own), **_read(TravelData, entry))
    return robot


# -----------------------------------------------------------------------------
# The order of cutting and the transfer moves in plan.json.


def sequence_entry(part: PartPlan) -> SequenceData:
    """Return the plan.json entry of a part's order, times and moves."""
    robot = part.plans[0].robot
    return {
        "optimal": part.order.optimal,
        "duration_s": part.order.duration,
        "at_least_s": part.order.at_least,
        "cycle_s": part.cycle_time,
        "cutting_s": part.cutting_time,
        "air_s": part.air_time,
        "piercing_s": part.piercing_time,
        "retract_m": part.retract,
        "moves": [_move_entry(move, robot) for move in part.moves],
    }


def _move_entry(move: TransferMove, robot: Robot) -> MoveData:
    entry = {"clear": move.clear, "time_s": move.time.tolist(), **apart("q", move.q, robot)}
    return cast(MoveData, entry)


def read_moves(entry: SequenceData | None, robot: Robot) -> tuple[TransferMove, ...]:
    """Return the moves of such an entry.

    Raises
    ------
    InputError
        Joints and times do not fit together, or external axes are missing.
    """
    return () if entry is None else tuple(_read_move(move, robot) for move in entry["moves"])


def _read_move(move: MoveData, robot: Robot) -> TransferMove:
    return TransferMove(
        q=floats(joints(move, "q", robot), "corners of a move", (None, None)),
        time=floats(move["time_s"], "time_s of a move", (len(move["q_rad"]),)),
        clear=bool(move["clear"]),
    )


# -----------------------------------------------------------------------------
# Read a plan.json: its plans and moves, with the type of every value checked.

_M = TypeVar("_M", bound=BaseModel)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanFile:
    """A plan.json that was read back.

    Parameters
    ----------
    path : Path
    job : dict
        The parsed job file; empty if the plan was not made from one.
    plans : tuple of Plan
        One for each contour, in the order of cutting.
    missing : tuple of str
        Names of the contours that have no plan.
    failed : tuple of str
        Names of the contours whose plan failed its audit when it was made.
    moves : tuple of TransferMove
        The transfer moves between them; empty if none were planned.
    contours : dict of str to str
        Name in the job of the contour of each plan; a plan may be that of a piece.
    in_cell : bool
        Whether the motions were planned and audited clear of collisions.
    picked : frozenset of str
        Names of the contours whose plan was picked from a Pareto set.
    data : dict
        The complete document.
    """

    path: Path
    job: Mapping[str, Any]
    plans: tuple[Plan, ...]
    missing: tuple[str, ...]
    failed: tuple[str, ...]
    contours: dict[str, str]
    moves: tuple[TransferMove, ...]
    in_cell: bool
    picked: frozenset[str]
    data: PlanDocument

    __repr__ = short_repr

    @property
    def entries(self) -> dict[str, PlanData]:
        """The entry of each contour, or piece, that has a plan, by its name."""
        return {entry["name"]: entry for entry in planned_entries(self.data)}

    @property
    def tolerances(self) -> Tolerances:
        """The tolerances of its job."""
        return self.table("audit", AuditTable).resolve()

    def program(self, stem: str, **changes: str) -> ProgramOptions:
        """Return the [program] of its job, with keys replaced; `stem` is the name by default."""
        allowed = self.tolerances.path
        table = self.table("program", ProgramTable, **changes)
        try:
            own = contours_of(self.job)
            return table.resolve(stem, allowed, sheet_of(self.job), own)
        except (ValidationError, LookupError, TypeError, AttributeError) as error:
            said = " ".join(str(error).split())
            raise InputError(f"{self.path}: its [process] table is not valid ({said})") from None

    def table(self, name: str, model: type[_M], **changes: str) -> _M:
        """Return a table of its job, with keys replaced.

        Raises
        ------
        InputError
            The table is not valid.
        """
        table: Any = self.job.get(name, {})
        try:
            return model.model_validate({**table, **changes})
        except (ValidationError, TypeError) as error:
            said = " ".join(str(error).split())
            raise InputError(f"{self.path}: its [{name}] table is not valid ({said})") from None


def read_plan_file(path: str | Path) -> PlanFile:
    """Return the plans of a plan.json.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    file : PlanFile
        Its `plans` in the order of cutting, and the rest of the file.

    Raises
    ------
    InputError
        The file does not exist, is not JSON or has another schema; a key is missing, unknown or
        twice in an object; a value has the wrong type; or files beside it are left of an earlier
        run.
    """
    path = Path(path)
    data = read_document(path)
    require_one_set(path)
    try:
        robot = add_externals(data["external_axes"], _read_robot(data["robot"], data["limits"]))
        entries = planned_entries(data)
        return PlanFile(
            path=path,
            job=data["job"],
            plans=tuple(
                _read_plan(e, robot, data["T_flange_tip"], data["T_base_part"]) for e in entries
            ),
            contours={e["name"]: e["contour"] for e in entries},
            missing=tuple(e["name"] for e in data["contours"] if not e["feasible"]),
            failed=tuple(e["name"] for e in entries if not e["audit"]["passed"]),
            moves=read_moves(data["sequence"], robot),
            in_cell=data["cell"] is not None,
            picked=frozenset(e["name"] for e in entries if e.get("picked", False)),
            data=data,
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except KeyError as error:
        raise InputError(f"{path}: the key {error} is missing; plan the job again") from None
    except (TypeError, ValueError) as error:  # rows of different lengths, which no schema forbids
        said = " ".join(str(error).split())
        raise InputError(
            f"{path}: a value has the wrong type ({said}); plan the job again"
        ) from None


def planned_entries(data: PlanDocument) -> list[PlanData]:
    """Return the entries of the contours that have a plan."""
    return [cast(PlanData, entry) for entry in data["contours"] if entry["feasible"]]


def _read_robot(robot: RobotData, limits: LimitsData) -> Robot:
    """Return the arm, which casts and checks its arrays itself."""
    own = _read(RobotData, robot) | _read(LimitsData, limits)
    own["chain"] = KinematicChain(**_read(ChainData, robot["chain"])) if robot["chain"] else None
    own["couplings"] = tuple(Coupling(**_read(CouplingData, c)) for c in limits["couplings"])
    arm = Arm(**{each.name: own.pop(each.name) for each in fields(Arm)})
    within = {each.name: own.pop(each.name) for each in fields(RobotLimits) if each.name in own}
    return with_dynamics(limits, Robot(arm=arm, limits=RobotLimits(**within), **own))


def _read_plan(entry: PlanData, robot: Robot, tool: Any, placement: Any) -> Plan:
    nodes: Mapping[str, Any] = entry["nodes"]
    certificate = entry.get("certificate")
    approach, retreat = entry.get("approach"), entry.get("retreat")
    weights = {"weights_per_rad": joints(entry, "weights_per", robot).tolist()}
    return Plan(
        contour=Contour(
            nodes["points_m"],
            nodes["axes"],
            closed=entry["closed"],
            s=nodes["s_m"],
            kind=np.array([KINDS.index(word) for word in nodes["kind"]]),
            speed_share=nodes["speed_share"],
            x=nodes["x"],
            name=entry["name"],
        ),
        robot=robot,
        T_flange_tip=tool,
        T_base_part=placement,
        q=joints(nodes, "q", robot),
        gamma=nodes["gamma_rad"],
        tilt=nodes["lead_lean_rad"],
        posture=nodes["posture"],
        turn=nodes["turn"],
        time=nodes["time_s"],
        settings=PlanOptions.from_data(entry | weights),
        cost=entry["cost"],
        proof=Proof(
            optimal=entry["optimal"],
            statement=entry["proof"],
            grid_cost=entry["grid_cost"],
            bound=entry["bound"],
            gap=entry["gap"],
            certificate=None if certificate is None else read_certificate(certificate),
            explored=Explored(**entry["explored"]) if "explored" in entry else None,
        ),
        counts=entry["counts"],
        feed=None if entry["feed"] is None else Feed(**entry["feed"]),
        approach=None if approach is None else _read_move(approach, robot),
        retreat=None if retreat is None else _read_move(retreat, robot),
    )


# -----------------------------------------------------------------------------
# Write plan.json, which has everything about the plans of a job for other programs.

_NUMBERS = re.compile(r"\[\s+([-+.\deE,\s]+?)\s+\]")


def plan_text(document: PlanDocument) -> str:
    """Return the text of a plan.json; the same document gives the same bytes."""
    text = json.dumps(document, indent=1, allow_nan=False)
    # One row of numbers per line, so that people can read it and a diff shows a node.
    return _NUMBERS.sub(lambda m: "[" + re.sub(r"\s+", " ", m[1]) + "]", text) + "\n"


def plan_document(
    robot: Robot,
    tool: Array,
    placement: Array,
    contours: Sequence[ContourData],
    job: Mapping[str, Any],
    cell: Cell | None = None,
    part: PartPlan | None = None,
) -> PlanDocument:
    """Return the content of a plan.json.

    Parameters
    ----------
    robot : Robot
        The robot, with the limits used.
    tool, placement : (4, 4) m
        T_flange_tip and T_base_part.
    contours : sequence of dict
        From `plan_entry` and `broken_entry`.
    job : mapping
        The job file as read.
    cell : Cell, optional
        The cell in which the motions were planned and audited.
    part : PartPlan, optional
        The moves between the contours, and what is proved about their order.
    """
    return {
        "schema": SCHEMA,
        "kerfpath": __version__,
        "job": dict(job),
        "robot": _robot_entry(robot),
        "external_axes": external_entries(robot),
        "T_flange_tip": tool.tolist(),
        "T_base_part": placement.tolist(),
        "limits": _limits_entry(robot),
        "cell": None if cell is None else _cell_entry(cell),
        "contours": list(contours),
        "sequence": None if part is None else sequence_entry(part),
    }


def plan_entry(
    plan: Plan,
    contour: str,
    checks: Sequence[Check],
    *,
    picked: bool = False,
    certificate: bool = False,
) -> PlanData:
    """Return the plan.json entry of a planned and audited contour, or of a piece of it.

    `picked` marks a plan of a Pareto set, which has its own objective, weights and eta. With
    `certificate` the entry has the certificate of the plan's bound, if there is one; without it,
    the audit has no row about the bound.
    """
    criteria, settings, proof = plan.criteria, plan.settings, plan.proof
    shown = proof.certificate if certificate else None
    checks = [c for c in checks if shown is not None or c.code != BOUND]
    entry = {
        "name": plan.name,
        "contour": contour,
        "feasible": True,
        **({"picked": True} if picked else {}),
        "closed": plan.contour.closed,
        **settings.to_data(),
        **apart("weights_per", settings.weights, plan.robot),
        "dt": plan.dt,
        "cost": plan.cost,
        "optimal": proof.optimal,
        "proof": proof.statement,
        "grid_cost": proof.grid_cost,
        "bound": proof.bound,
        "gap": proof.gap,
        **({} if shown is None else {"certificate": certificate_entry(shown)}),
        **({} if plan.approach is None else {"approach": _move_entry(plan.approach, plan.robot)}),
        **({} if plan.retreat is None else {"retreat": _move_entry(plan.retreat, plan.robot)}),
        **({} if proof.explored is None else {"explored": asdict(proof.explored)}),
        "criteria": {
            **apart("displacement", criteria.displacement, plan.robot),
            **apart("largest_increment", criteria.largest_increment, plan.robot),
            **apart("range", criteria.range, plan.robot),
            "peak_velocity_share": criteria.peak_velocity.tolist(),
            "peak_acceleration_share": criteria.peak_acceleration.tolist(),
            "reversals": criteria.reversals.tolist(),
            "nearest": {
                name: {"least": least if np.isfinite(least) else None, "unit": MEASURES[name].unit}
                | {"node": node}
                for name, (least, node) in criteria.nearest.items()
            },
        },
        "feed": _written(FeedData, plan.feed),
        "counts": dict(plan.counts),
        "audit": {
            "passed": all(c.ok or c.level == "warning" for c in checks),
            "checks": [_written(CheckData, each) for each in checks],
        },
        "nodes": {
            "s_m": plan.contour.s.tolist(),
            "time_s": plan.time.tolist(),
            "points_m": plan.contour.points.tolist(),
            "axes": plan.contour.axes.tolist(),
            "kind": list(plan.contour.kinds),
            "speed_share": plan.contour.speed_share.tolist(),
            "x": None if plan.contour.x is None else plan.contour.x.tolist(),
            **apart("q", plan.q, plan.robot),
            "gamma_rad": plan.gamma.tolist(),
            "lead_lean_rad": plan.tilt.tolist() if plan.tilt.any() else None,
            "posture": plan.posture.tolist(),
            "turn": plan.turn.tolist(),
        },
    }
    return cast(PlanData, entry)


def broken_entry(name: str, broken: NoFeasiblePath, fastest: FastestSpeed | None) -> BrokenData:
    """Return the plan.json entry of a contour without a feasible path."""
    return {
        "name": name,
        "feasible": False,
        "reason": str(broken),
        "proved": broken.proved,
        "proved_for": broken.scope,
        "closed": _written(ClosedData, broken.closed),
        "relaxation": _written(RelaxationData, broken.relaxation),
        "last_node_reached": broken.node,
        "counts": broken.counts,
        "fastest_speed_m_s": None if fastest is None else fastest.speed,
    }


def _robot_entry(robot: Robot) -> RobotData:
    entry = _written(RobotData, robot)
    chain = _written(ChainData, robot.chain)
    return cast(RobotData, entry | {"geometry_m": dict(robot.geometry), "chain": chain})


def _limits_entry(robot: Robot) -> LimitsData:
    alone = robot.alone()
    couplings = [_written(CouplingData, each) for each in alone.couplings]
    entry = _written(LimitsData, alone) | {"couplings": couplings} | dynamics_entry(alone)
    return cast(LimitsData, entry)


def _cell_entry(cell: Cell) -> dict[str, object]:
    """Return a record of the pairs kept apart and how far; the cell itself is that of the job."""
    return {
        "bodies": [
            {
                "name": b.name,
                "kind": b.kind,
                "frame": b.frame,
                "moves_with": cell.chain.moves_with(b.frame),
                "approximate": b.approximate,
                "holds_the_real_one": b.holds,
            }
            for b in cell.bodies
        ],
        "near_miss_m": [
            {
                "between": list(pair),
                "at_least": float(required),
                "asked": float(asked),
                "overlap_by_design": float(depth),
            }
            for pair, asked, required, depth in zip(
                cell.pair_names, cell.asked, cell.required, cell.depth, strict=True
            )
        ],
        "not_judged": [{"between": list(pair), "why": why} for pair, why in cell.unjudged.items()],
        "not_proved": list(caveats(cell)),
    }
