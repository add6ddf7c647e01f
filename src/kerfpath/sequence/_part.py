"""A whole part: a plan for every contour, their order, and the moves through the air between."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from kerfpath._arrays import Bools, floats, scalar
from kerfpath.air import AirMove, End, backed_off
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.planner import plan
from kerfpath.plans import Plan
from kerfpath.robots import Robot
from kerfpath.sequence._moves import Moves
from kerfpath.sequence._order import Order, best_order

__all__ = ["PartPlan", "order_plans", "plan_part"]

BACK_BY = (0.0, 0.1, 0.4, 0.7, 1.0)
"""Shares of the retract between which the joints are taken to run straight."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PartPlan:
    """The plans of a part's contours in the order of cutting, and the moves between them.

    Parameters
    ----------
    plans : tuple of Plan
        In the order of cutting; endless joints unrolled from contour to contour.
    moves : tuple of AirMove
        One between each plan and the next, from backed off to backed off; with a home one before
        the first and one behind the last, too.
    order : Order
        What has been proved about the order.
    chosen : tuple of (int, int)
        Which contour each plan is of, and which of its candidates.
    retract, approach_speed : float m, m/s
        How far the tool backs off before and after each contour, and how fast.
    pierce_time : float s
        Of each contour.
    """

    plans: tuple[Plan, ...]
    moves: tuple[AirMove, ...]
    order: Order
    chosen: tuple[tuple[int, int], ...]
    retract: float
    approach_speed: float
    pierce_time: float

    @property
    def cutting_time(self) -> float:
        """Time on the contours, s."""
        return float(sum(p.time[-1] - p.time[0] for p in self.plans))

    @property
    def air_time(self) -> float:
        """Time of the moves through the air, approach and retract included, s."""
        down_and_up = 2 * len(self.plans) * self.retract / self.approach_speed
        return sum(move.duration for move in self.moves) + down_and_up

    @property
    def piercing_time(self) -> float:
        """Time that the beam takes to go through, s."""
        return len(self.plans) * self.pierce_time

    @property
    def cycle_time(self) -> float:
        """All of it, s."""
        return self.cutting_time + self.air_time + self.piercing_time


def plan_part(
    contours: Sequence[Contour | Sequence[Contour]],
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    speed: float | Sequence[float | None] | None = None,
    home: ArrayLike | None = None,
    cell: Cell | None = None,
    before: Sequence[tuple[int, int]] = (),
    heat_spacing: float = 0.0,
    given_order: bool = False,
    retract: float = 0.05,
    approach_speed: float = 0.1,
    air_speed: float = 1.0,
    pierce_time: float = 0.0,
    seconds: float = 10.0,
    progress: Callable[[int], None] | None = None,
    **options: Any,
) -> PartPlan:
    """Return plans for all contours of a part, cut in the order that takes the least time.

    Every candidate is planned; then as `order_plans`.

    Parameters
    ----------
    contours : sequence of Contour, or of sequences of Contour
        Candidates of each: other starts, directions, leads.
    robot, tool, placement, cell, **options
        As in `kerfpath.plan`, for every contour.
    speed : float m/s, or one for each contour
    home, before, heat_spacing, given_order, retract, approach_speed, air_speed, pierce_time,
    seconds
        As in `order_plans`.
    progress : callable, optional
        Called with the number of candidates planned since the last call.

    Raises
    ------
    NoFeasiblePath
        A contour none of whose candidates has a plan; no order; no way between two contours.
    InputError
        As `kerfpath.plan` and `order_plans`.
    """
    groups = [[c] if isinstance(c, Contour) else list(c) for c in contours]
    speeds = list(speed) if isinstance(speed, Sequence) else [speed] * len(groups)
    if not groups or not all(groups) or len(speeds) != len(groups):
        raise InputError(
            "plan_part: expected one contour at least, candidates for each, and one speed or one "
            f"for each; got {len(groups)} contours and {len(speeds)} speeds"
        )
    options |= {"tool": tool, "placement": placement, "cell": cell}
    plans = []
    for candidates, fast in zip(groups, speeds, strict=True):
        made, broken = [], None
        for contour in candidates:
            try:
                laid_on = None if contour.time is not None else fast
                made.append(plan(contour, robot, speed=laid_on, **options))
            except NoFeasiblePath as error:
                broken = broken or error
            if progress is not None:
                progress(1)
        if not made:
            assert broken is not None
            raise broken
        plans.append(made)
    return order_plans(
        plans,
        home=home,
        cell=cell,
        before=before,
        heat_spacing=heat_spacing,
        given_order=given_order,
        retract=retract,
        approach_speed=approach_speed,
        air_speed=air_speed,
        pierce_time=pierce_time,
        seconds=seconds,
    )


def order_plans(
    candidates: Sequence[Sequence[Plan]],
    *,
    home: ArrayLike | None = None,
    cell: Cell | None = None,
    before: Sequence[tuple[int, int]] = (),
    heat_spacing: float = 0.0,
    given_order: bool = False,
    retract: float = 0.05,
    approach_speed: float = 0.1,
    air_speed: float = 1.0,
    pierce_time: float = 0.0,
    seconds: float = 10.0,
) -> PartPlan:
    """Return one plan of each contour's candidates, in the order that takes the least time.

    Order, candidates and moves between them are chosen together. A move is first taken to be
    straight, which no way around beats; those that the best order uses are then planned in the
    cell, until it uses none that has not been.

    Parameters
    ----------
    candidates : sequence of sequences of Plan
        Those of each contour; all of one robot.
    home : (n,) rad, optional
        Where the robot comes from and goes back to.
    cell : Cell, optional
        Moves, and backing off before and after each contour, are clear in it.
    before : sequence of (i, j)
        Contour i is cut before contour j; see `inner_first`.
    heat_spacing : float m
        Contours nearer to each other than this are not cut one right after the other.
    given_order : bool
        Keep the order of `candidates`; `before` must agree with it.
    retract, approach_speed : float m, m/s
        How far and how fast the tool backs off along its axis.
    air_speed : float
        Share of the full speed of the moves between contours: they take their least time by it.
    pierce_time : float s
    seconds : float s
        How long the solver of the order, and each search for a way around, may take.

    Raises
    ------
    NoFeasiblePath
        No candidate of a contour that the tool can reach and leave; no order; no way between two.
    InputError
        Lengths or times that are not positive.
    """
    retract = scalar(retract, "retract", unit="m", above=0.0)
    approach_speed = scalar(approach_speed, "approach_speed", unit="m/s", above=0.0)
    heat_spacing = scalar(heat_spacing, "heat_spacing", unit="m", above=-1e-300)
    pierce_time = scalar(pierce_time, "pierce_time", unit="s", above=-1e-300)
    air_speed = scalar(air_speed, "air_speed", above=0.0)
    places = _reachable(candidates, cell, retract)
    plans = [candidates[i][c] for i, c in places]
    group = np.array([i for i, _ in places])
    if given_order:
        before = [*before, *((i, i + 1) for i in range(len(candidates) - 1))]
    air = Moves(plans, group, cell, retract, seconds, air_speed)
    air.forbid(_too_warm([c[0].contour for c in candidates], heat_spacing)[np.ix_(group, group)])
    if home is not None:
        air.home = floats(home, "home", (plans[0].robot.joints,))
    own = np.array([p.time[-1] - p.time[0] for p in plans])
    own += pierce_time + 2 * retract / approach_speed
    while True:
        order = best_order(
            group, own, air.between, first=air.first, last=air.last, before=before, seconds=seconds
        )
        if not air.look_at(order.candidates):
            break
    return PartPlan(
        **air.unrolled(order.candidates),
        order=order,
        chosen=tuple(places[k] for k in order.candidates.tolist()),
        retract=retract,
        approach_speed=approach_speed,
        pierce_time=pierce_time,
    )


def _reachable(
    candidates: Sequence[Sequence[Plan]], cell: Cell | None, retract: float
) -> list[tuple[int, int]]:
    """Return contour and candidate of each plan that the tool can go down to and leave again."""
    places: list[tuple[int, int]] = []
    for i, made in enumerate(candidates):
        broken, found = None, len(places)
        for c, one in enumerate(made):
            try:
                _require_clear_ends(one, cell, retract)
                places.append((i, c))
            except NoFeasiblePath as error:
                broken = broken or error
        if broken is not None and len(places) == found:
            raise broken
    return places


def _require_clear_ends(made: Plan, cell: Cell | None, retract: float) -> None:
    """Raise NoFeasiblePath where the tool cannot go down to a cut or back from it."""
    ends: tuple[tuple[End, int], ...] = (("start", 0), ("end", len(made.q) - 1))
    for end, node in ends:
        try:
            way = np.array([backed_off(made, end, part * retract) for part in BACK_BY])
        except InputError as broken:
            raise NoFeasiblePath(str(broken), proved=True, node=node) from broken
        if cell is None:
            continue
        if not cell.clear_through(way):
            raise NoFeasiblePath(
                f"contour {made.name!r}: the tool is not clear while it backs off node {node} by "
                f"{retract * 1e3:g} mm",
                proved=True,
                node=node,
            )


def _too_warm(contours: Sequence[Contour], spacing: float) -> Bools:
    """Say which contours (G, G) are nearer to each other than `spacing` (m)."""
    near = np.zeros((len(contours), len(contours)), bool)
    if spacing <= 0:
        return near
    for i, j in combinations(range(len(contours)), 2):
        apart, _ = cKDTree(contours[i].points).query(contours[j].points)
        near[i, j] = near[j, i] = np.asarray(apart).min() < spacing
    return near
