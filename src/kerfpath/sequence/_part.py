"""A whole part: a plan for every contour, their order, and the transfer moves between."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypedDict, TypeVar, Unpack, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from kerfpath._arrays import Array, Bools, Ints, floats, not_negative, scalar
from kerfpath._repr import short_repr
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.options import PlanKeywords, PlanOptions, with_keywords
from kerfpath.planner import plan, with_bound
from kerfpath.plans import Plan
from kerfpath.robots import Robot
from kerfpath.sequence._candidates import (
    MorePlans,
    more_reachable,
    reachable,
    unused_postures,
)
from kerfpath.sequence._moves import HOME, PATIENCE, MoveTimes
from kerfpath.sequence._order import Order, best_order
from kerfpath.transfer import TransferMove

__all__ = [
    "PartPlan",
    "distances_between",
    "longest_search",
    "order_candidates",
    "order_plans",
    "plan_part",
]

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PartPlan:
    """The plans of a part's contours in the order of cutting, and the moves between them.

    Parameters
    ----------
    plans : tuple of Plan
        In the order of cutting; endless joints unrolled from contour to contour.
    moves : tuple of TransferMove
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
    moves: tuple[TransferMove, ...]
    order: Order
    chosen: tuple[tuple[int, int], ...]
    retract: float
    approach_speed: float
    pierce_time: float

    __repr__ = short_repr

    @property
    def cutting_time(self) -> float:
        """Time on the contours, s."""
        return float(sum(p.time[-1] - p.time[0] for p in self.plans))

    @property
    def air_time(self) -> float:
        """Time of the transfer moves, approach and retract included, s."""
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


class OrderKeywords(TypedDict, total=False):
    """The keywords of `order_plans` that say what is asked of the order and of the moves."""

    home: ArrayLike | None
    cell: Cell | None
    before: Sequence[tuple[int, int]]
    heat_spacing: float
    given_order: bool
    retract: float
    approach_speed: float
    air_speed: float
    pierce_time: float
    seconds: float


class PartKeywords(OrderKeywords, PlanKeywords, total=False):
    """The keywords of `plan_part`."""


def plan_part(
    contours: Sequence[Contour | Sequence[Contour]],
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    speed: float | Sequence[float | None] | None = None,
    options: PlanOptions | None = None,
    progress: Callable[[int], None] | None = None,
    **keywords: Unpack[PartKeywords],
) -> PartPlan:
    """Return plans for all contours of a part, cut in the order that takes the least time.

    Every candidate is planned; then as `order_plans`. Where that finds no way to or from a contour,
    the first of its candidates is planned in every other of the `postures`, too. What is chosen is
    certified.

    Parameters
    ----------
    contours : sequence of Contour, or of sequences of Contour
        Candidates of each: other starts, directions, leads.
    robot, tool, placement, options
        As in `kerfpath.plan`, for every contour; so are its keywords.
    speed : float m/s, or one for each contour
    progress : callable, optional
        Called with the number of candidates planned since the last call.
    home, cell, before, heat_spacing, given_order, retract, approach_speed, air_speed, pierce_time,
    seconds
        As in `order_plans`; the plans are clear in the cell, too.

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
    of_order = keywords.keys() & OrderKeywords.__annotations__.keys()
    order = cast(OrderKeywords, {k: v for k, v in keywords.items() if k in of_order})
    rest = {k: v for k, v in keywords.items() if k not in of_order}
    asked = with_keywords(options, rest, PartKeywords)
    wanted = replace(asked, certify=None)  # of all candidates one is chosen first

    def planned(i: int, contour: Contour, options: PlanOptions) -> Plan:
        return plan(
            contour, robot, tool=tool, placement=placement, options=options,
            speed=None if contour.time is not None else speeds[i], cell=order.get("cell"),
        )  # fmt: skip

    tried: list[list[Plan]] = []
    for i, candidates in enumerate(groups):
        tried.append([])
        broken = None
        for contour in candidates:
            try:
                tried[i].append(planned(i, contour, wanted))
            except NoFeasiblePath as error:
                broken = broken or error
            if progress is not None:
                progress(1)
        if broken is not None and not tried[i]:
            raise broken

    def in_posture(i: int, posture: int) -> Plan:
        return planned(i, groups[i][0], replace(wanted, postures=(posture,)))

    postures = [wanted.postures] * len(groups)
    found = order_candidates(tried, lambda made: made, in_posture, postures, **order)
    return replace(found, plans=tuple(with_bound(made, asked.certify) for made in found.plans))


def order_candidates(
    tried: Sequence[list[T]],
    plan_of: Callable[[T], Plan],
    in_posture: Callable[[int, int], T | None],
    postures: Sequence[Sequence[int] | None],
    progress: Callable[[int, int, int], None] = lambda contour, done, total: None,
    **order: Unpack[OrderKeywords],
) -> PartPlan:
    """Order candidates as `order_plans`, and plan contours in other postures where it asks for it.

    Parameters
    ----------
    tried : sequence of lists
        What was made of the candidates of each contour, a plan each; what is made in other
        postures is added to it.
    plan_of : callable
        Returns the plan of one of them.
    in_posture : callable
        Plans a contour in one posture, by their numbers; returns None, or raises NoFeasiblePath,
        where it cannot be cut so.
    postures : sequence of sequences of int, or None
        Those that each contour may be cut in; None: all.
    progress : callable
        Called with the number of a contour, how many other postures of it are done, and how many
        there are.
    order
        The other keywords of `order_plans`.
    """

    def more(i: int) -> list[Plan]:
        made = len(tried[i])
        unused = unused_postures([plan_of(one) for one in tried[i]], postures[i])
        for k, posture in enumerate(unused):
            progress(i, k, len(unused))
            with suppress(NoFeasiblePath):
                one = in_posture(i, posture)
                tried[i] += [] if one is None else [one]
        return [plan_of(one) for one in tried[i][made:]]

    return order_plans([[plan_of(one) for one in each] for each in tried], more=more, **order)


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
    more: Callable[[int], Sequence[Plan]] = lambda contour: (),
) -> PartPlan:
    """Return one plan of each contour's candidates, in the order that takes the least time.

    Order, candidates and moves between them are chosen together. A move is first taken to be
    straight, which no way around beats; those that the best order uses are then planned in the
    cell, until it uses none that has not been. A move that no way is found for is not made. Where
    no order is left without it, the contours that it joins are asked for `more` plans, once.

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
        How long the solver of the order, and each search for a way around, may take; searches
        that find none end after `longest_search(seconds)` in all.
    more : callable, optional
        Given the number of a contour, further plans of it, in other postures: its candidates from
        then on, numbered after the others.

    Raises
    ------
    NoFeasiblePath
        No candidate of a contour that the tool can reach and leave; no order; no way between two,
        which are named, with what is in the way and what was tried.
    InputError
        Lengths or times that are not positive.
    """
    retract = scalar(retract, "retract", unit="m", above=0.0)
    approach_speed = scalar(approach_speed, "approach_speed", unit="m/s", above=0.0)
    heat_spacing = not_negative(heat_spacing, "heat_spacing", unit="m")
    pierce_time = not_negative(pierce_time, "pierce_time", unit="s")
    air_speed = scalar(air_speed, "air_speed", above=0.0)
    every = [list(made) for made in candidates]
    further = MorePlans(every, more)
    places = reachable(every, cell, retract, further)
    if given_order:
        before = [*before, *((i, i + 1) for i in range(len(every) - 1))]
    warm = _too_warm([c[0].contour for c in every], heat_spacing)
    air: MoveTimes | None = None
    while True:
        plans = [every[i][c] for i, c in places]
        group = np.array([i for i, _ in places])
        air = (
            MoveTimes(plans, group, cell, retract, seconds, air_speed)
            if air is None
            else air.extended(plans, group)
        )
        air.forbid(warm[np.ix_(group, group)])
        if home is not None and air.home is None:
            air.home = floats(home, "home", (plans[0].robot.joints,))
        own = np.array([p.time[-1] - p.time[0] for p in plans])
        own += pierce_time + 2 * retract / approach_speed
        found = _settle_order(air, group, own, before, seconds)
        if not isinstance(found, NoFeasiblePath):
            order = found
            break
        contours = sorted({int(group[c]) for leg in air.failed for c in leg if c != HOME})
        fresh = more_reachable(every, cell, retract, further, contours) if air.failed else []
        if not fresh:
            raise further.mentioned_in(found)
        places += fresh
    made, moves = air.unrolled(order.candidates)
    return PartPlan(
        plans=made,
        moves=moves,
        order=order,
        chosen=tuple(places[k] for k in order.candidates.tolist()),
        retract=retract,
        approach_speed=approach_speed,
        pierce_time=pierce_time,
    )


def longest_search(seconds: float) -> float:
    """Return how long searches for ways around that find none may take in all, s.

    Before other postures are asked for, and once more with them.
    """
    return 2 * PATIENCE * seconds


def _settle_order(
    air: MoveTimes, group: Ints, own: Array, before: Sequence[tuple[int, int]], seconds: float
) -> Order | NoFeasiblePath:
    """Return the best order whose moves all have a way, or why none is found."""
    failed = len(air.failed)
    while len(air.failed) - failed < PATIENCE:
        try:
            order = best_order(
                group, own, air.between,
                first=air.first, last=air.last, before=before, seconds=seconds,
            )  # fmt: skip
        except NoFeasiblePath as none:
            return air.why_no_order(none)
        if not air.look_at(order.candidates):
            return order
    return air.why_no_order(None)


def _too_warm(contours: Sequence[Contour], spacing: float) -> Bools:
    """Say which contours (G, G) are nearer to each other than `spacing` (m)."""
    if spacing <= 0:
        return np.zeros((len(contours), len(contours)), bool)
    return distances_between(contours) < spacing


def distances_between(contours: Sequence[Contour]) -> Array:
    """Return how far apart the nodes of each two contours are, (G, G) m; infinite of one alone."""
    apart = np.full((len(contours), len(contours)), np.inf)
    trees = [cKDTree(contour.points) for contour in contours]
    for i, j in combinations(range(len(contours)), 2):
        apart[i, j] = apart[j, i] = np.min(trees[i].query(contours[j].points)[0])
    return apart
