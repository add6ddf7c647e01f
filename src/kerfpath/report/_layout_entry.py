"""The data of layout.json: `kerfpath.study` writes them, the page and the command read them.

Classes with ``total=False`` have optional keys. Offsets are in the unit at the end of each
variable's name; values are in the `unit` of the goal.
"""

from __future__ import annotations

from typing import Literal, TypedDict

__all__ = ["ContourSide", "LayoutEntry", "LayoutMap", "MapSquare", "TriedPlacement", "promise"]

Goal = Literal["speed", "margin", "motion"]


class _Reason(TypedDict, total=False):
    """The reason why a placement is infeasible, and where; `progress` is how far its test got."""

    reason: str
    contour: str
    node: int
    nodes: int
    progress: float


class _Shipped(_Reason):
    """The placement of the job itself."""

    status: str
    value: float | None


class _Best(TypedDict):
    """The best placement.

    `gain` over the job's placement is a share; `numbers` has keys of the job and their new values.
    """

    offsets: dict[str, float]
    value: float
    gain: float | None
    numbers: dict[str, object]


class TriedPlacement(_Reason):
    """A placement that was tried.

    `bound` is a value that it cannot beat, `estimate` its approximate value over continuous gamma.
    """

    offsets: dict[str, float]
    status: str
    stage: str
    bound: float | None
    value: float | None
    estimate: float | None


class ContourSide(TypedDict, total=False):
    """The value of one contour in one placement, and the limit that binds."""

    value: float
    at_least: float
    fastest_m_min: float
    joint: int
    limit: str
    node: int


class _Contour(TypedDict):
    """A contour in the job's placement and in the best one."""

    name: str
    before: ContourSide | None
    after: ContourSide | None


class _Tally(TypedDict):
    """Count of infeasible placements with the same status and contour; `node` is the commonest."""

    status: str
    contour: str | None
    count: int
    node: int | None
    reason: str


class MapSquare(_Reason):
    """One placement of the map."""

    status: str
    bound: float | None
    value: float | None
    estimate: float | None


class LayoutMap(TypedDict):
    """Placements over two variables; `y` is empty if there is only one variable."""

    variables: list[str]
    x: list[float]
    y: list[float]
    cells: list[MapSquare]


class LayoutEntry(TypedDict):
    """All of layout.json.

    With `off_grid`, values are those of plans over continuous gamma, for `exact_searches`
    placements. `open_bound` is then the best estimate of the placements that have only an estimate
    (`estimated`), and `estimate_error` the least and the largest ratio of a plan's value to its
    estimate.
    """

    schema: int
    kerfpath: str
    job: str
    goal: Goal
    off_grid: bool
    unit: str
    ranges: dict[str, tuple[float, float]]
    default_ranges: bool
    standing: list[str]
    tolerance: dict[str, float]
    seed: int
    evaluations: int
    feasible: bool
    shipped: _Shipped
    best: _Best | None
    contours: list[_Contour]
    proved: bool
    open_bound: float | None
    statuses: dict[str, int]
    stages: dict[str, int]
    exact_searches: int
    estimated: int
    estimate_error: list[float] | None
    reasons: list[_Tally]
    nearest: TriedPlacement | None
    evolved: int
    tried: list[TriedPlacement]
    map: LayoutMap | None


def promise(goal: Goal, placement: TriedPlacement | MapSquare) -> float | None:
    """Return the value of a placement, else the tighter one of bound and estimate, else None."""
    if placement["value"] is not None:
        return placement["value"]
    known = [v for v in (placement["bound"], placement["estimate"]) if v is not None]
    return (max if goal == "motion" else min)(known, default=None)
