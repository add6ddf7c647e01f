"""Results of several methods for many cuts: how often feasible, how far from the optimum."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import mean, median

from benchmarks._figures import Sheet

__all__ = ["PROVED", "Outcome", "sheet"]

PROVED = "exact"
"""The method whose costs are the yardstick, and whose failures are proofs."""

COLUMNS = (
    "robot",
    "method",
    "cuts",
    "feasible",
    "missed",
    "beyond the grid",
    "excess mean %",
    "median %",
    "worst %",
    "over by > 0.1 %",
    "median s",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """The result of one method for one cut.

    Parameters
    ----------
    robot : str
    index : int
        Number of the cut of this robot.
    method : str
    seconds : float
    cost : float or None
        Objective (14) of a motion that keeps (5) and (6); None if the method found none.
    """

    robot: str
    index: int
    method: str
    seconds: float
    cost: float | None


def sheet(outcomes: Iterable[Outcome], methods: Sequence[str]) -> Sheet:
    """Return the table: a row for each robot and method, and for all robots together.

    "missed" counts cuts that have a path on the grid, but for which the method found no feasible
    motion; "beyond the grid" counts feasible motions where the grid is proved to have none. The
    excess over the proved optimum of the grid is taken over the cuts where both are feasible.
    """
    by = {(o.robot, o.index, o.method): o for o in outcomes}
    robots = list(dict.fromkeys(key[0] for key in by))
    groups = {name: [name] for name in robots} | ({"all": robots} if len(robots) > 1 else {})
    rows = [
        (title, *_row(by, names, method)) for title, names in groups.items() for method in methods
    ]
    return Sheet(columns=COLUMNS, rows=rows, words=2)


def _row(
    by: Mapping[tuple[str, int, str], Outcome], robots: Sequence[str], method: str
) -> tuple[str, ...]:
    got = [o for (robot, _, name), o in by.items() if robot in robots and name == method]
    if not got:
        return (method, "0", *["-"] * (len(COLUMNS) - 3))
    pairs = [(o.cost, by[o.robot, o.index, PROVED].cost) for o in got]
    excess = [100 * (c / best - 1) for c, best in pairs if c is not None and best is not None]
    missed = sum(c is None and best is not None for c, best in pairs)
    beyond = sum(c is not None and best is None for c, best in pairs)
    return (
        method,
        str(len(got)),
        str(sum(c is not None for c, _ in pairs)),
        str(missed),
        str(beyond),
        *(f"{of(excess):.2f}" if excess else "-" for of in (mean, median, max)),
        f"{sum(e > 0.1 for e in excess)} of {len(excess)}",
        f"{median(o.seconds for o in got):.3g}",
    )
