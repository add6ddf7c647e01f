"""The order of cutting and the transfer moves in plan.json."""

from __future__ import annotations

import base64
import binascii
import json
import math
import zlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import UnionType
from typing import (
    Annotated,
    Any,
    NotRequired,
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

from kerfpath.arrays import Array, floats
from kerfpath.certificate import Certificate, Stage
from kerfpath.dynamics import Load
from kerfpath.errors import InputError
from kerfpath.job.plan_file.layout import (
    ArrayData,
    BrokenData,
    CertificateData,
    ContourData,
    DynamicsData,
    ExternalData,
    LimitsData,
    MoveData,
    PlanData,
    PlanDocument,
    SequenceData,
    StageData,
)
from kerfpath.options import PlanOptions
from kerfpath.robots import ExternalAxis, Robot
from kerfpath.sequence import PartPlan
from kerfpath.setting import settings
from kerfpath.transfer import TransferMove
from kerfpath.urdf import ChainInertia

# -----------------------------------------------------------------------------
# Check a plan.json against its layout: every key and every value, as strictly as JSON allows.

SCHEMA = 9
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
        twice in an object; a value has another type (true or "1.0" for a number); or a number is
        not finite or too large.
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
        said = f"expected distinct names, got {_shown(twice[0])} twice"
        raise InputError(f"{path}: contours: {said}; plan the job again")
    return cast(PlanDocument, data)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"the key {_shown(twice)} is twice in one object")
    return table


def _no_number(word: str) -> Any:
    raise ValueError(f"expected a number, got {word}")


def _problem(error: ValidationError) -> str:
    """Return the first problem: where, what was expected, what came."""
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
    """Return a value in JSON notation, shortened."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > LARGEST_NUMBER:
        return "a number of more than 12 digits"
    text = json.dumps(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


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
    stages = [
        {
            name: None if (part := getattr(stage, name)) is None else _packed(part, kind)
            for name, kind in TYPES.items()
        }
        for stage in certificate.stages
    ]
    return {"bound": certificate.bound, "stages": cast(list[StageData], stages)}


def read_certificate(data: CertificateData) -> Certificate:
    """Return the certificate of such an entry.

    Raises
    ------
    InputError
        An array differs from its stated type or size, or from the number of cells of its stage.
    """
    return Certificate(
        bound=data["bound"],
        stages=tuple(_stage(s, each) for s, each in enumerate(data["stages"])),
    )


def _stage(number: int, data: StageData) -> Stage:
    where = f"certificate, stage {number}"
    arrays: dict[str, NDArray[np.generic] | None] = {}
    for name, kind in TYPES.items():
        packed = cast(ArrayData | None, data[name])  # type: ignore[literal-required]  # one of TYPES
        arrays[name] = None if packed is None else _unpacked(packed, kind, f"{where}: {name}")
    C = arrays["node"].shape[:1] if arrays["node"] is not None else ()
    for name, part in arrays.items():
        if part is not None and name != "multipliers" and part.shape[:1] != C:
            raise InputError(f"{where}: expected {name} for {C} nodes, got the shape {part.shape}")
    return Stage(**arrays)  # type: ignore[arg-type]  # each of its type


def _packed(part: NDArray[np.generic], kind: str) -> ArrayData:
    raw = np.ascontiguousarray(part, dtype=kind).tobytes()
    return {
        "type": kind,
        "shape": list(part.shape),
        "zlib_base64": base64.b64encode(zlib.compress(raw, 6)).decode(),
    }


def _unpacked(data: ArrayData, kind: str, where: str) -> NDArray[np.generic]:
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
# Limits on torque and jerk in plan.json.


def dynamics_entry(robot: Robot) -> LimitsData:
    """Return the keys that limits on torque and jerk add to those of the arm's joints."""
    entry: LimitsData = {}  # type: ignore[typeddict-item]  # some keys of it, to be added
    if robot.jerk is not None:
        entry["jerk_rad_s3"] = [float(x) if np.isfinite(x) else None for x in robot.jerk]
    load, own = robot.load, robot.inertia
    if load is None or own is None or robot.torque is None:
        return entry
    entry["dynamics"] = {
        "torque_nm": robot.torque.tolist(),
        "gravity_m_s2": robot.gravity.tolist(),
        "mass_kg": own.mass.tolist(),
        "centre_m": own.centre.tolist(),
        "inertia_kg_m2": own.tensor.tolist(),
        "load_mass_kg": load.mass,
        "load_centre_m": None if load.centre is None else load.centre.tolist(),
        "load_inertia_kg_m2": None if load.tensor is None else load.tensor.tolist(),
    }
    return entry


def with_dynamics(entry: LimitsData, robot: Robot) -> Robot:
    """Return the arm with the limits on torque and jerk of such an entry.

    Raises
    ------
    InputError
        The load or the masses are not possible.
    """
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
    limited = replace(robot, inertia=own).with_limits(torque=said["torque_nm"])
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
        ExternalData(
            name=axis.name,
            kind=axis.kind,
            carries=axis.carries,
            unit=axis.unit,
            axis=axis.axis.tolist(),
            point_m=axis.point.tolist(),
            step=axis.step,
            lower=float(limits.lower[i]),
            upper=float(limits.upper[i]),
            velocity=float(velocity[i]),
            acceleration=float(acceleration[i]),
            endless=bool(robot.endless[i]),
        )
        for i, axis in enumerate(robot.externals, robot.family.joints)
    ]


def add_externals(entries: list[ExternalData], robot: Robot) -> Robot:
    """Return the arm with the external axes of such entries."""
    for entry in entries:
        axis = ExternalAxis(
            name=entry["name"],
            kind=entry["kind"],
            carries=entry["carries"],
            axis=np.array(entry["axis"]),
            point=np.array(entry["point_m"]),
            step=entry["step"],
        )
        robot = robot.with_external(
            axis,
            lower=entry["lower"],
            upper=entry["upper"],
            velocity=entry["velocity"],
            acceleration=entry["acceleration"],
            endless=entry["endless"],
        )
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


def read_moves(entry: SequenceData | None, robot: Robot) -> tuple[TransferMove, ...]:
    """Return the moves of such an entry.

    Raises
    ------
    InputError
        Joints and times do not fit together, or external axes are missing.
    """
    if entry is None:
        return ()
    return tuple(
        TransferMove(
            q=floats(joints(move, "q", robot), "corners of a move", (None, None)),
            time=floats(move["time_s"], "time_s of a move", (len(move["q_rad"]),)),
            clear=bool(move["clear"]),
        )
        for move in entry["moves"]
    )


def _move_entry(move: TransferMove, robot: Robot) -> MoveData:
    n = robot.family.joints
    entry: MoveData = {
        "clear": move.clear,
        "time_s": move.time.tolist(),
        "q_rad": move.q[:, :n].tolist(),
    }
    if robot.externals:
        entry["external_q"] = move.q[:, n:].tolist()
    return entry
