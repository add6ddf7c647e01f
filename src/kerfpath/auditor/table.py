"""The result of an audit: the table of checks, and the issues among them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from kerfpath.arrays import Array, Ints, counted, short_repr

Unit = Literal["m", "rad", "m^3", "s", "share", "count"]
Level = Literal["error", "warning"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One line of the audit's table.

    Parameters
    ----------
    code : str
        Stable name of the check, such as "tip-at-nodes".
    title : str
        The checked quantity in words.
    value, limit : float
        Worst value found and allowed value, in `unit`.
    unit : {"m", "rad", "m^3", "s", "share", "count"}
    node : int
        Node of the worst value (for a check between nodes: the node before it).
    level : {"error", "warning"}
        Severity of a failure.
    advice : str
        What to do about a failure.
    """

    code: str
    title: str
    value: float
    limit: float
    unit: Unit
    node: int
    level: Level = "error"
    advice: str = ""

    __repr__ = short_repr

    @property
    def ok(self) -> bool:
        """Whether the value keeps the limit; False for NaN."""
        return self.value <= self.limit

    def issue(self) -> Issue:
        """Return the issue for a failure of this check."""
        message = (
            f"{self.title}: {format_value(self.value, self.unit)} at node {self.node}, "
            f"allowed {format_value(self.limit, self.unit)}"
        )
        if self.advice:
            message += f"; {self.advice}"
        return Issue(level=self.level, code=self.code, message=message, node=self.node)


@dataclass(frozen=True, slots=True, kw_only=True)
class Issue:
    """A failed check: its severity, its code, what was found, and at which node."""

    level: Level
    code: str
    message: str
    node: int

    __repr__ = short_repr

    def __str__(self) -> str:
        return f"{self.level}: {self.message} [{self.code}]"


class Issues(list[Issue]):
    """The issues of an audit: a list, which is empty if nothing failed, and prints the verdict."""

    @property
    def passed(self) -> bool:
        """Whether no check failed that is more than a warning."""
        return all(issue.level != "error" for issue in self)

    def __repr__(self) -> str:
        warned = f", with {counted(len(self), 'warning')}" if self else ""
        lines = [f"audit passed{warned}" if self.passed else "audit FAILED", *map(str, self)]
        return "\n  ".join(lines)

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        """Print the verdict in IPython, which would print the list otherwise."""
        printer.text(repr(self))


def check_worst(
    code: str,
    title: str,
    values: Array,
    limit: float,
    unit: Unit,
    nodes: Ints | None = None,
    *,
    level: Level = "error",
    advice: str = "",
) -> Check:
    """Return the check of the largest of `values`; NaN counts as worst."""
    i = int(np.argmax(np.where(np.isnan(values), np.inf, values)))
    return Check(
        code=code,
        title=title,
        value=float(values[i]),
        limit=limit,
        unit=unit,
        node=i if nodes is None else int(nodes[i]),
        level=level,
        advice=advice,
    )


def worst_of(tables: Iterable[Iterable[Check]]) -> list[Check]:
    """Return the worst row of each check over several tables; its node is the table's number."""
    worst: dict[str, Check] = {}
    for number, table in enumerate(tables):
        for check in table:
            known = worst.get(check.code)
            if known is None or not check.value <= known.value:
                worst[check.code] = replace(check, node=number)
    return list(worst.values())


def format_value(value: float, unit: Unit) -> str:
    """Return a value with its unit for display: mm, degrees, per cent or a number."""
    if unit == "m":
        return f"{value * 1e3:.4g} mm"
    if unit == "rad":
        return f"{np.degrees(value):.4g} deg"
    if unit == "s":
        return f"{value:.4g} s"
    if unit == "m^3":
        return f"{value:.4g} m^3"
    return f"{value * 100:.4g} %" if unit == "share" else f"{value:g}"
