"""The base class of all tables of a job file, and the rules that they share."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import BaseModel, ConfigDict

from kerfpath.job.format._values import fault

__all__ = ["Table", "given", "require_distinct", "require_one"]


class Table(BaseModel):
    """A table: frozen, strict about the types of its values, without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


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
