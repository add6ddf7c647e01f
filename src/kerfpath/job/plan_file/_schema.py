"""What may stand in a plan.json: every key and the type of every value, as strictly as JSON can."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from types import UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError, create_model

from kerfpath.auditor import Level, Unit
from kerfpath.errors import InputError
from kerfpath.options import OptionData

__all__ = ["SCHEMA", "read_document"]

SCHEMA = 5
"""Version of the layout of plan.json; it grows when a reader of the old one would go wrong."""
LARGEST = 1e12
"""No number of a plan is larger, in SI: not even the sum of all it counts."""
SHOWN = 60
"""Characters of a wrong value that a message shows."""

Real = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Whole = Annotated[int, Field(ge=-LARGEST, le=LARGEST)]
Row = list[Real]
Rows = list[Row]
Kind = Literal["cut", "pierce", "lead-in", "micro joint", "overlap", "lead-out", "loop"]


class _Entry(BaseModel):
    """An object of the file: strict about types, without unknown keys."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class _Chain(_Entry):
    origins: list[Rows]
    axes: Rows
    end: Rows


class _Robot(_Entry):
    id: str
    manufacturer: str
    model: str
    kinematics: str
    geometry_m: dict[str, Real]
    sign: Row
    offset_rad: Row
    axis_3: str
    T_base_foot: Rows
    T_end_flange: Rows
    chain: _Chain | None


class _External(_Entry):
    kind: Literal["rail", "positioner"]
    axis: Row
    point_m: Row
    step_m: Real | None = None
    lower_m: Real | None = None
    upper_m: Real | None = None
    velocity_m_s: Real | None = None
    acceleration_m_s2: Real | None = None
    step_rad: Real | None = None
    lower_rad: Real | None = None
    upper_rad: Real | None = None
    velocity_rad_s: Real | None = None
    acceleration_rad_s2: Real | None = None


class _Coupling(_Entry):
    row: Row
    lower_rad: Real
    upper_rad: Real
    note: str


class _Limits(_Entry):
    lower_rad: Row
    upper_rad: Row
    endless: list[bool]
    velocity_rad_s: Row
    acceleration_rad_s2: Row
    acceleration_source: str
    couplings: list[_Coupling]


def _strict(kind: Any) -> Any:
    """Return a type as this file takes it: numbers within bounds, objects without other keys."""
    if kind in (float, int):
        return Real if kind is float else Whole
    if is_typeddict(kind):
        hints = get_type_hints(kind).items()
        keys: dict[str, Any] = {name: (_strict(each), ...) for name, each in hints}
        return create_model(kind.__name__, __base__=_Entry, **keys)
    inner = tuple(_strict(each) for each in get_args(kind))
    if get_origin(kind) in (Union, UnionType):
        return Union[inner]  # noqa: UP007  # of as many as there are
    return get_origin(kind)[inner] if get_origin(kind) in (list, dict) else kind


_Options = _strict(OptionData)
"""Every option of a plan, as `PlanOptions.to_data` writes it."""


class _Nearest(_Entry):
    least: Real | None
    unit: str
    node: Whole


class _Criteria(_Entry):
    displacement_rad: Row
    external_displacement_m: Real | None = None
    external_displacement_rad: Real | None = None
    largest_increment_rad: Row
    external_largest_increment_m: Real | None = None
    external_largest_increment_rad: Real | None = None
    range_rad: Row
    external_range_m: Real | None = None
    external_range_rad: Real | None = None
    peak_velocity_share: Row
    peak_acceleration_share: Row
    nearest: dict[str, _Nearest]


class _Feed(_Entry):
    full: Real
    slowest: Real
    node: Whole
    joint: Whole
    limit: Literal["velocity", "acceleration"] | None


class _Check(_Entry):
    code: str
    title: str
    value: Real
    limit: Real
    unit: Unit
    node: Whole
    level: Level
    advice: str
    ok: bool


class _Audit(_Entry):
    passed: bool
    checks: list[_Check]


class _Nodes(_Entry):
    s_m: Row
    time_s: Row
    points_m: Rows
    axes: Rows
    kind: list[Kind]
    speed_share: Row
    x: Rows | None
    q_rad: Rows
    external_q_m: Row | None = None
    external_q_rad: Row | None = None
    gamma_rad: Row
    lead_lean_rad: Rows | None
    posture: list[Whole]
    turn: list[list[Whole]]


class _Planned(_Options):  # type: ignore[misc,valid-type]
    name: str
    contour: str
    feasible: bool
    picked: bool = False
    closed: bool
    weights_per_rad: Row
    external_weights_per_m: Real | None = None
    external_weights_per_rad: Real | None = None
    dt: Real
    cost: Real
    optimal: bool
    proof: str
    grid_cost: Real | None
    criteria: _Criteria
    feed: _Feed | None
    counts: dict[str, Whole]
    audit: _Audit
    nodes: _Nodes


class _Broken(_Entry):
    name: str
    feasible: bool
    reason: str
    proved: bool
    last_node_reached: Whole
    counts: dict[str, Whole]
    fastest_speed_m_s: Real | None


class _Move(_Entry):
    clear: bool
    time_s: Row
    q_rad: Rows


class _Sequence(_Entry):
    optimal: bool
    duration_s: Real
    at_least_s: Real
    cycle_s: Real
    cutting_s: Real
    air_s: Real
    piercing_s: Real
    retract_m: Real
    moves: list[_Move]


def _is_planned(entry: Any) -> str:
    return "broken" if isinstance(entry, dict) and entry.get("feasible") is False else "planned"


class _Document(_Entry):
    schema_: Whole = Field(alias="schema")
    kerfpath: str
    job: dict[str, Any]
    robot: _Robot
    external_axis: _External | None
    T_flange_tip: Rows
    T_base_part: Rows
    limits: _Limits
    cell: dict[str, Any] | None
    contours: list[
        Annotated[
            Annotated[_Planned, Tag("planned")] | Annotated[_Broken, Tag("broken")],
            Discriminator(_is_planned),
        ]
    ]
    sequence: _Sequence | None


def read_document(path: Path) -> dict[str, Any]:
    """Return what stands in a plan.json, every key known and every value of its type.

    Raises
    ------
    InputError
        No such file, not JSON, another schema, a key unknown, missing or said twice, a value of
        another type (true or "1.0" for a number), a number that is none or too large: in one line.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give a plan.json") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a plan.json: {' '.join(str(error).split())}") from None
    try:
        data = json.loads(text, object_pairs_hook=_once, parse_constant=_no_number)
        json.dumps(data, ensure_ascii=False).encode()  # half a surrogate pair is no text
    except (ValueError, RecursionError) as error:
        said = "".join(c for c in " ".join(str(error).split()) if c.isprintable())
        raise InputError(f"{path}: not a plan.json: {said}") from None
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
    twice = [name for name, n in Counter(e["name"] for e in data["contours"]).items() if n > 1]
    if twice:
        raise InputError(f"{path}: contours: two are called {_shown(twice[0])}; plan the job again")
    return data


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"the key {_shown(twice)} stands twice in one object")
    return table


def _no_number(word: str) -> Any:
    raise ValueError(f"expected a number, got {word}")


def _problem(error: ValidationError) -> str:
    """Say the first thing that is wrong: where, what was expected, what came."""
    first = error.errors(include_url=False)[0]
    where = ".".join(str(step) for step in first["loc"] if step not in ("planned", "broken"))
    where = "".join(c if c.isprintable() else "?" for c in where)
    if first["type"] == "missing":
        return f"the key {where} is missing"
    if first["type"] == "extra_forbidden":
        return f"the key {where} is not known"
    what = first["msg"].removeprefix("Input should be ")
    return f"{where}: expected {what}, got {_shown(first['input'])}"


def _shown(value: object) -> str:
    """Return a value as JSON has it, cut short."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > LARGEST:
        return "a number of more than 12 digits"
    text = json.dumps(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."
