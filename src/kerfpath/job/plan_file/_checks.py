"""Rows of an audit's table."""

from __future__ import annotations

from kerfpath.auditor import Check, Unit

__all__ = ["check", "count"]


def check(code: str, title: str, value: float, limit: float, unit: Unit, node: int = 0) -> Check:
    """Return a row, its numbers as Python's own."""
    return Check(
        code=code, title=title, value=float(value), limit=float(limit), unit=unit, node=node
    )


def count(code: str, title: str, found: float, node: int = 0) -> Check:
    """Return a row that counts what may not be there at all."""
    return check(code, title, found, 0, "count", node)
