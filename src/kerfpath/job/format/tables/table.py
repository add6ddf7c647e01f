"""The base class of all tables of a job file, and the rules that they share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict

from kerfpath.job.format.values import (
    JointsNotNegative,
    NotNegative,
    Positive,
    fault,
    key,
)
from kerfpath.setting import Setting, keys, settings


class Table(BaseModel):
    """A table: frozen, strict about the types of its values, without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    def si(self, kind: type) -> dict[str, Any]:
        """Return the settings of a class by their names, in SI; the table was made from them."""
        known = settings(kind).items()
        return {
            name: each.si(getattr(self, each.key)) for name, each in known if each.takes is not None
        }


def fields_of(kind: type) -> dict[str, Any]:
    """Return the keys of a table for the settings of a class: types with bounds, and defaults."""
    return {name: _field(each) for name, each in keys(kind).items()}


NOT_NEGATIVE: dict[Any, Any] = {
    float: NotNegative,
    tuple[float, ...]: JointsNotNegative,
    float | Literal["auto"]: NotNegative | Literal["auto"],
}
"""What a key takes, if that is not negative; no number of a setting is."""


def _field(setting: Setting) -> tuple[Any, Any]:
    """Return the type of a key, with its bounds and the words of its messages, and its default."""
    kind = NOT_NEGATIVE.get(setting.takes, setting.takes)
    if setting.above == 0:
        kind = Positive
    if setting.in_jobs is None:
        kind = kind | None
    if setting.example:
        limits = {"ge": setting.least, "le": setting.most, "lt": setting.below}
        numbers = setting.takes in (float, int)
        bounds = {name: limit for name, limit in limits.items() if numbers and limit is not None}
        kind = Annotated[kind, key(setting.expected(), setting.example, **bounds)]
    return kind, setting.in_jobs


def given(table: Table, *keys: str) -> list[str]:
    """Return the optional keys that the table has."""
    return [key for key in keys if getattr(table, key) is not None]


def require_one(table: Table, keys: Sequence[str], expected: str, example: str) -> None:
    """Require one of several optional keys.

    Raises
    ------
    PydanticCustomError
        At the first of them, if none or several are given.
    """
    found = given(table, *keys)
    if len(found) != 1:
        got, remedy = ("both", "remove one") if found else ("none", f"add, for example, {example}")
        raise fault(expected, got, remedy, (keys[0],))


def require_distinct(
    names: Sequence[str | None], what: str, table: str, keys: Sequence[str]
) -> None:
    """Require that no two tables have the same name; None is no name.

    Raises
    ------
    PydanticCustomError
        At the key of the second table of that name.
    """
    for i, name in enumerate(names):
        if name is not None and name in names[:i]:
            expected, got = f"a name that no other {what} has", f'"{name}" again'
            raise fault(expected, got, "give one of them another name", (table, i, keys[i]))
