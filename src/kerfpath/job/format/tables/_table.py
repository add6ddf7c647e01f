"""What all tables of a job file share."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

__all__ = ["Table", "given"]


class Table(BaseModel):
    """A table: frozen, strict about the kinds of its values, without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


def given(table: Table, *keys: str) -> list[str]:
    """Return those of the optional keys that the table has."""
    return [key for key in keys if getattr(table, key) is not None]
