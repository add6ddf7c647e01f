"""The data of layout.json, key by key: `kerfpath.study` writes them, the page and the command read.

Keys of a class whose `total` is False are there only where there is something to say. Offsets are
in the unit at the end of each variable's name; values are in `unit` of the goal.
"""

from __future__ import annotations

from typing import Literal, TypedDict

__all__ = ["ContourSide", "LayoutEntry", "LayoutMap", "MapSquare", "TriedPlacement", "promise"]

Goal = Literal["speed", "margin", "motion"]


class _Reason(TypedDict, total=False):
    """Why a placement is infeasible, and where; `progress` says how far its test got."""

    reason: str
    contour: str
    node: int
    nodes: int
    progress: float


class _Shipped(_Reason):
    """The placement as the job has it."""

    status: str
    value: float | None


class _Best(TypedDict):
    """The best placement; `gain` over the job's own is a share, `numbers` are keys of the job."""

    offsets: dict[str, float]
    value: float
    gain: float | None
    numbers: dict[str, object]


class TriedPlacement(_Reason):
    """A placement that was tried.

    `bound` is the best that it may still come to, `estimate` about what it comes to over continuous
    gamma.
    """

    offsets: dict[str, float]
    status: str
    stage: str
    bound: float | None
    value: float | None
    estimate: float | None


class ContourSide(TypedDict, total=False):
    """The value of one contour in one placement, and what binds it."""

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
    """Infeasible placements for the same status and contour, with the most common node."""

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
    """Placements over two variables, or over the only one, where `y` is empty."""

    variables: list[str]
    x: list[float]
    y: list[float]
    cells: list[MapSquare]


class LayoutEntry(TypedDict):
    """All of layout.json.

    With `off_grid` values are those of plans over continuous gamma, of as many placements as there
    were `exact_searches`, and `open_bound` is the best estimate of those that are only `estimated`;
    `estimate_error` are the least and the largest share of its estimate that a plan came to.
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
    """Return what a placement is worth as far as is known: value, or bound or estimate."""
    if placement["value"] is not None:
        return placement["value"]
    known = [v for v in (placement["bound"], placement["estimate"]) if v is not None]
    return (max if goal == "motion" else min)(known, default=None)
