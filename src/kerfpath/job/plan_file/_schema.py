"""Check a plan.json against its layout: every key and every value, as strictly as JSON allows."""

from __future__ import annotations

import json
from collections import Counter
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

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError, create_model

from kerfpath.errors import InputError
from kerfpath.job.plan_file._layout import BrokenData, ContourData, PlanData, PlanDocument

__all__ = ["SCHEMA", "read_document"]

SCHEMA = 9
"""Version of the layout of plan.json; it grows if readers of the old one would misread the file."""
LARGEST = 1e12
"""Largest number of a plan, in SI; not even the sum of all counts is larger."""
SHOWN = 60
"""Most characters of a wrong value that a message shows."""

Real = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Whole = Annotated[int, Field(ge=-LARGEST, le=LARGEST)]


class _Entry(BaseModel):
    """An object of the file: strict about types, without unknown keys."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


def _strict(kind: Any) -> Any:
    """Return the strict form of a type: numbers within bounds, objects without other keys."""
    if kind in (float, int):
        return Real if kind is float else Whole
    if kind == ContourData:
        planned = _model(PlanData, weights_per_rad=list[Real])  # a plan's own are always there
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


def _model(kind: Any, **instead: Any) -> type[_Entry]:
    """Return the model of a TypedDict, with other types `instead` of those of some keys."""
    keys: dict[str, Any] = {}
    for name, hint in get_type_hints(kind, include_extras=True).items():
        optional = get_origin(hint) is NotRequired
        value = instead.get(name) or _strict(get_args(hint)[0] if optional else hint)
        # A field called "schema" would hide a method of the model.
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
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > LARGEST:
        return "a number of more than 12 digits"
    text = json.dumps(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."
