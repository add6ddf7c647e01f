"""Rows of an audit's table."""

from __future__ import annotations

from kerfpath.auditor import Check, Unit

__all__ = ["check", "count"]


def check(code: str, title: str, value: float, limit: float, unit: Unit, node: int = 0) -> Check:
    """Return a row, with plain Python numbers."""
    return Check(
        code=code, title=title, value=float(value), limit=float(limit), unit=unit, node=node
    )


def count(code: str, title: str, found: float, node: int = 0) -> Check:
    """Return a row that counts faults, of which none is allowed."""
    return check(code, title, found, 0, "count", node)
