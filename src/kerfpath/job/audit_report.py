"""The report on an audit of a plan.json or of a program: its rows, and what both check alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from kerfpath.arrays import short_repr
from kerfpath.auditor import Check, Level, Unit, format_value
from kerfpath.cell import Cell, caveats
from kerfpath.job.format import SequenceTable

NOT_CHECKED = "Collisions are not checked: simulate the program in the cell before running it."
"""The note for a job without a [cell]."""
SAME_TIME = 2e-3
"""Tolerance (s) of lead times and waits against the job; controllers round them."""


def check(
    code: str, title: str, value: float, limit: float, unit: Unit, node: int = 0,
    *, level: Level = "error", advice: str = "",
) -> Check:  # fmt: skip
    """Return a row, with plain Python numbers."""
    return Check(
        code=code, title=title, value=float(value), limit=float(limit), unit=unit, node=node,
        level=level, advice=advice,
    )  # fmt: skip


def count(code: str, title: str, found: float, node: int = 0, *, advice: str = "") -> Check:
    """Return a row that counts faults, of which none is allowed."""
    return check(code, title, found, 0, "count", node, advice=advice)


def count_at(code: str, title: str, found: Sequence[int]) -> Check:
    """Return a row that counts faults by their nodes, or by the numbers of their cuts."""
    return count(code, title, len(found), found[0] if found else 0)


def check_order(
    sequence: SequenceTable | None, inner_first: Sequence[tuple[int, int]], done: Sequence[int]
) -> list[Check]:
    """Return the checks of which contour is cut before which; their node is the number of the cut.

    `done` has the number of the contour of each cut in the job, in the order of cutting.
    """
    early = [k for k, i in enumerate(done) if any(a == i and j in done[:k] for a, j in inner_first)]
    given = sequence is None or sequence.order == "given"
    turned = [k + 1 for k, (a, b) in enumerate(pairwise(done)) if given and b < a]
    return [
        count_at("inner-first", "contours cut after the contour around them", early),
        count_at("order", "contours cut after one that comes later in the job", turned),
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditReport:
    """The result of the audit of a plan.json or of a program.

    Parameters
    ----------
    tables : dict of str to list of Check
        The table of each contour that has a plan, or of each cut of a program.
    missing : tuple of str
        Names of the contours without one.
    note : str
        What was checked for collisions, and what was not.
    places : dict of str to tuple of str
        For a program: file and line of the target of each node.
    """

    tables: dict[str, list[Check]]
    missing: tuple[str, ...]
    note: str
    places: dict[str, tuple[str, ...]] = field(default_factory=dict)

    __repr__ = short_repr

    @property
    def passed(self) -> bool:
        """True if every contour has a plan and no check found an error."""
        return not self.missing and all(
            check.ok or check.level == "warning"
            for checks in self.tables.values()
            for check in checks
        )

    def place(self, name: str, check: Check) -> str:
        """Return where a check of a table failed: a node, or in a program the file and line."""
        lines = self.places.get(name, ())
        return f"{lines[check.node]}" if check.node < len(lines) else f"node {check.node}"

    def sentence(self, name: str, check: Check) -> str:
        """Return one sentence: where a check of a table failed, what was found, what is allowed."""
        if check.unit == "count" and check.limit == 0:
            found = f"{check.title}: {check.value:g}, expected none"
        else:
            value, limit = (format_value(x, check.unit) for x in (check.value, check.limit))
            found = f"{check.title}: {value}, allowed {limit}"
        advice = f"; {check.advice}" if check.advice else ""
        return f"{self.place(name, check)}: {found}{advice}"


def collision_note(cell: Cell | None, *, moves_too: bool = False) -> str:
    """Return the note on what was checked for collisions, and what was not."""
    if cell is None:
        return NOT_CHECKED
    about = f" (approximate: {', '.join(cell.approximate)})" if cell.approximate else ""
    checked = (
        f"Collisions are checked along the contours, among {len(cell.bodies)} bodies of the "
        f"cell{about}; the moves to and between contours are "
        f"{'checked, too' if moves_too else 'not checked'}."
    )
    return " ".join([checked, *caveats(cell)])
