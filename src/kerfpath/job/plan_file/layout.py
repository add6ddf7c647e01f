"""The layout of a plan.json: every key and the type of its value, SI, the unit in the name.

The file is written as these types and checked against them, see `_schema`.
"""

from __future__ import annotations

from typing import Any, Literal, NotRequired, TypedDict

from kerfpath.auditor import Level, Unit

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


class ExternalData(TypedDict):
    """An external axis and its limits, in its unit, per s and s^2."""

    name: str
    kind: Literal["linear", "rotary"]
    carries: Literal["robot", "part"]
    unit: Literal["m", "rad"]
    axis: Row
    point_m: Row
    step: float | None
    lower: float
    upper: float
    velocity: float
    acceleration: float
    endless: bool


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


class LimitsData(TypedDict):
    """The limits of the arm's joints that were used."""

    lower_rad: Row
    upper_rad: Row
    endless: list[bool]
    velocity_rad_s: Row
    acceleration_rad_s2: Row
    acceleration_source: str
    couplings: list[CouplingData]
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


class CertificateData(TypedDict):
    """The certificate that proves a bound."""

    bound: float
    stages: list[StageData]


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
    criteria: CriteriaData
    feed: FeedData | None
    counts: dict[str, int]
    audit: AuditData
    nodes: NodesData


class ClosedData(TypedDict):
    """Where no motion passes at any gamma: node and joint from 0, and the limit of the joint."""

    node: int
    joint: int | None
    limit: Literal["velocity", "acceleration", "pose"]


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
