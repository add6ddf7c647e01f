"""A whole part: a plan for every contour, their order, and the transfer moves between them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Generic, Protocol, TypedDict, TypeVar, Unpack, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from kerfpath.arrays import Array, Bools, Ints, floats, not_negative, scalar, short_repr, spread
from kerfpath.cell import Cell
from kerfpath.certifier import SharedWork
from kerfpath.contour import Contour
from kerfpath.effort import changed_effort, current_effort
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.options import PlanKeywords, PlanOptions, with_keywords
from kerfpath.planner import best_motion, folds, layered_graph, plan, turned, with_bound
from kerfpath.plans import Plan, TransferMove
from kerfpath.progress import Progress, no_progress
from kerfpath.robots import Robot
from kerfpath.sequence.order import Order, best_order
from kerfpath.setup import Setup
from kerfpath.transfer import (
    HOME,
    PATIENCE,
    MoveTimes,
    back_off,
    can_back_off,
    on_near_turns,
    require_clear_ends,
)

# -----------------------------------------------------------------------------
# Parts of many contours, of which less is compared for each.

MANY = 40
"""Contours of a part beyond which they are planned in one common posture alone, without wider
searches; valleys of others are explored only beyond a gap of `WORTH`; and an order stands however
much longer it takes with its candidates in their final form, see `LONGER`: to seek it again gained
0.6 % of 201 contours, and as many audits as before."""
SOME = 5
"""Contours of such a part that are planned in every posture to choose the common one."""
WORTH = 0.1
"""`Effort.worth_exploring` of such parts: what a contour may cost more for want of an exploration
is small beside the moves between hundreds of them, and exploring all takes most of the time."""


@contextmanager
def effort_for(contours: int) -> Iterator[None]:
    """Plan with the effort that each of so many contours is worth, until the block ends."""
    worth = current_effort().worth_exploring
    with changed_effort(worth_exploring=max(WORTH, worth) if are_many(contours) else worth):
        yield


def are_many(contours: int) -> bool:
    """Return whether a part has so many contours that less is compared for each, see `MANY`."""
    return contours > MANY


def cheapest_posture(
    contours: int,
    wanted: Sequence[Sequence[int] | None],
    postures: int,
    cost: Callable[[int, int], float],
) -> int | None:
    """Return the posture in which most of some contours can be cut, and in which they cost least.

    None is returned if none of them can be cut in any.

    Parameters
    ----------
    contours : int
        Number of contours; `SOME` of them are looked at.
    wanted : sequence of sequences of int, or None
        Postures that each contour may be cut in; None: all.
    postures : int
        Number of postures of the arm.
    cost : callable
        Returns the cost of the motion along a contour in a posture, both given by number; infinite
        where there is none.
    """
    some = spread(contours, SOME).tolist()
    best: tuple[int, float, int] | None = None
    for posture in range(postures):
        may = [i for i in some if (asked := wanted[i]) is None or posture in asked]
        found = [each for i in may if np.isfinite(each := cost(i, posture))]
        if found and (best is None or (-len(found), sum(found)) < best[:2]):
            best = (-len(found), sum(found), posture)
    return None if best is None else best[2]


# -----------------------------------------------------------------------------
# Select the candidates that the tool can approach and leave, and plan more where none is left.


def unused_postures(made: Sequence[Plan], wanted: Iterable[int] | None) -> list[int]:
    """Return the wanted postures (None: all) in which no plan of a contour stays."""
    used = {int(one.posture[0]) for one in made if not np.ptp(one.posture)}
    every = range(made[0].robot.postures) if wanted is None else wanted
    return [int(p) for p in every if p not in used]


def common_postures(
    served: Sequence[Iterable[int]],
    wanted: Sequence[Sequence[int] | None],
    planned: Sequence[Iterable[int]],
) -> list[list[int]]:
    """Return the postures in which each contour is planned so that a part may keep to one.

    They are the wanted ones (None: all) in which at least half of the contours can be cut; of more
    than `MANY` contours only the one of them in which most are planned already.

    Parameters
    ----------
    served : sequence of iterables of int
        The postures that have a pose at every node of each contour.
    wanted : sequence of sequences of int, or None
    planned : sequence of iterables of int
        The postures in which each contour has a plan.
    """
    able = [
        {int(p) for p in here if asked is None or p in asked}
        for here, asked in zip(served, wanted, strict=True)
    ]
    often = Counter(p for each in able for p in sorted(each))
    shared = {p for p, n in often.items() if 2 * n >= len(able)}
    if len(able) > MANY and shared:
        have = Counter(p for each in planned for p in set(each))
        shared = {max(sorted(shared), key=lambda p: (have[p], often[p]))}
    return [sorted(each & shared) for each in able]


class MorePlans:
    """Further plans of contours, requested once for each contour, and how many were found."""

    def __init__(self, every: list[list[Plan]], more: Callable[[int], Sequence[Plan]]) -> None:
        self._every, self._more = every, more
        self._got: dict[int, int] = {}

    def of(self, contour: int) -> range:
        """Request further plans of a contour, once; return the numbers of the new candidates."""
        made = self._every[contour]
        first = len(made)
        if contour not in self._got:
            made += self._more(contour)
            self._got[contour] = len(made) - first
        return range(first, len(made))

    def mentioned_in(self, broken: NoFeasiblePath) -> NoFeasiblePath:
        """Return the failure with the further plans that were tried added to its message."""
        tried = [
            f"{self._every[i][0].name!r} in {count} other postures"
            for i, count in self._got.items()
            if count
        ]
        if not tried:
            return broken
        return broken.with_message(f"{broken}; also tried: {', '.join(tried)}")


def reachable(
    every: Sequence[Sequence[Plan]], cell: Cell | None, retract: float, further: MorePlans
) -> list[tuple[int, int]]:
    """Return (contour, candidate) of each plan that the tool can approach and leave."""
    places: list[tuple[int, int]] = []
    for i, made in enumerate(every):
        broken, found = _reachable(made, range(len(made)), cell, retract)
        if broken is not None and not found:
            _, found = _reachable(made, further.of(i), cell, retract)
            if not found:
                raise further.mentioned_in(broken)
        places += [(i, c) for c in found]
    return places


def more_reachable(
    every: Sequence[Sequence[Plan]], cell: Cell | None, retract: float, further: MorePlans,
    contours: Sequence[int],
) -> list[tuple[int, int]]:  # fmt: skip
    """Return (contour, candidate) of each further plan that the tool can approach and leave."""
    return [(i, c) for i in contours for c in _reachable(every[i], further.of(i), cell, retract)[1]]


def _reachable(
    made: Sequence[Plan], which: range, cell: Cell | None, retract: float
) -> tuple[NoFeasiblePath | None, list[int]]:
    """Return the first failure and the candidates that the tool can approach and leave."""
    broken, found = None, []
    for c in which:
        try:
            require_clear_ends(made[c], cell, retract)
            found.append(c)
        except NoFeasiblePath as error:
            broken = broken or error
    return broken, found


# -----------------------------------------------------------------------------
# Plan the whole part.

TURNED, SHORTER = 2, 1e-3
"""How often chosen candidates are turned towards their neighbours at most, and the relative time
that it must save to be done again."""
RIVAL = 0.02
"""Relative extra time up to which the order within one posture is turned towards its neighbours,
too: it may gain more by that than the best one."""
LONGER = 1e-3
"""Relative extra time up to which an order is kept although the final form of its candidates is not
the one that it was found with."""
FEW = 9
"""Nodes of a contour at which a posture needs a pose for the contour to be tried in it."""
TURNING = "turning motions about the beam"
"""What is in progress while candidates are turned."""
T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PartPlan:
    """The plans of a part's contours in the order of cutting, and the moves between them.

    Parameters
    ----------
    plans : tuple of Plan
        Plans in the order of cutting; endless joints are not wrapped from contour to contour.
    moves : tuple of TransferMove
        One move between each plan and the next, from backed off to backed off. With a home
        position there is also one before the first plan and one after the last.
    order : Order
        The order and what is proved about it.
    chosen : tuple of (int, int)
        Contour and candidate of each plan, by number.
    retract, approach_speed : float m, m/s
        How far and how fast the tool backs off before and after each contour.
    pierce_time : float s, or (P,) s
        Time to pierce at each contour, or at that of each plan.
    """

    plans: tuple[Plan, ...]
    moves: tuple[TransferMove, ...]
    order: Order
    chosen: tuple[tuple[int, int], ...]
    retract: float
    approach_speed: float
    pierce_time: float | Sequence[float]

    __repr__ = short_repr

    @property
    def cutting_time(self) -> float:
        """Time on the contours (s)."""
        return float(sum(p.time[-1] - p.time[0] for p in self.plans))

    @property
    def air_time(self) -> float:
        """Time of the transfer moves (s), including approaches and retracts."""
        down_and_up = 2 * len(self.plans) * self.retract / self.approach_speed
        return sum(move.duration for move in self.moves) + down_and_up

    @property
    def piercing_time(self) -> float:
        """Time for piercing at all contours (s)."""
        each = self.pierce_time
        return sum(each) if isinstance(each, Sequence) else len(self.plans) * each

    @property
    def rests(self) -> Array:
        """Time (G, G) s from the end of each contour to the beginning of every later one.

        Its retract and the approach of the other are left out; the lower triangle is zero.
        """
        here = len(self.moves) - len(self.plans) + 1  # with a home, the first move comes from there
        own = np.array([p.time[-1] - p.time[0] for p in self.plans]) + np.array(self.pierce_time)
        down_and_up = 2 * self.retract / self.approach_speed
        took = np.array([m.duration for m in self.moves[here // 2 :]][: len(self.plans) - 1])
        begin = np.append(0.0, np.cumsum(own[:-1] + down_and_up + took))
        end = begin + own + down_and_up
        return np.triu(begin[None] - end[:, None], 1)

    @property
    def cycle_time(self) -> float:
        """Time for cutting, transfer moves and piercing together (s)."""
        return self.cutting_time + self.air_time + self.piercing_time


class OrderKeywords(TypedDict, total=False):
    """The keywords of `order_plans` for the order and the moves."""

    home: ArrayLike | None
    cell: Cell | None
    before: Sequence[tuple[int, int]]
    heat_spacing: float
    heat_time: float
    given_order: bool
    retract: float
    approach_speed: float
    air_speed: float
    pierce_time: float | Sequence[float]
    seconds: float
    turns_within: tuple[ArrayLike, ArrayLike] | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OrderOptions:
    """How contours are ordered, and how the tool moves between them.

    Parameters
    ----------
    home : (n,) rad, optional
        Where the robot comes from and goes back to.
    cell : Cell, optional
        Cell in which moves, approaches and retracts are clear.
    before : sequence of (i, j)
        Contour i is cut before contour j; see `inner_first`.
    heat_spacing : float m
        Contours nearer to each other than this are not cut directly one after the other.
    heat_time : float s
        Instead, they may follow each other after this time, from the end of one to the beginning of
        the other, retract and approach left out; 0: no time is long enough.
    given_order : bool
        Keep the order of the candidates.
    retract, approach_speed : float m, m/s
        How far and how fast the tool backs off along its axis.
    air_speed : float
        Share of the full speed of transfer moves; their least time is divided by it.
    pierce_time : float s, or one for each contour
        Time to pierce.
    seconds : float s
        Work limit of the order solver, see `best_order`, and time limit of each search for a way
        around; searches without a result end after `longest_search(seconds)` in total.
    turns_within : two of (n,) rad, optional
        Least and greatest angles of endless joints that a program can express; infinite of others.
        Joints turn back by whole turns in transfer moves to stay within.

    Raises
    ------
    InputError
        A length, speed or time is out of range.
    """

    home: ArrayLike | None = None
    cell: Cell | None = None
    before: Sequence[tuple[int, int]] = ()
    heat_spacing: float = 0.0
    heat_time: float = 0.0
    given_order: bool = False
    retract: float = 0.05
    approach_speed: float = 0.1
    air_speed: float = 1.0
    pierce_time: float | Sequence[float] = 0.0
    seconds: float = 10.0
    turns_within: tuple[ArrayLike, ArrayLike] | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        _set = object.__setattr__
        _set(self, "retract", scalar(self.retract, "retract", unit="m", above=0.0))
        speed = scalar(self.approach_speed, "approach_speed", unit="m/s", above=0.0)
        _set(self, "approach_speed", speed)
        _set(self, "heat_spacing", not_negative(self.heat_spacing, "heat_spacing", unit="m"))
        _set(self, "heat_time", not_negative(self.heat_time, "heat_time", unit="s"))
        each = self.pierce_time if isinstance(self.pierce_time, Sequence) else [self.pierce_time]
        times = tuple(not_negative(one, "pierce_time", unit="s") for one in each)
        _set(self, "pierce_time", times if isinstance(self.pierce_time, Sequence) else times[0])
        _set(self, "air_speed", scalar(self.air_speed, "air_speed", above=0.0))


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
    """Plan all contours of a part and return them in the order that takes the least time.

    Every candidate is planned, and the plans are ordered by `order_plans`. Where no way to or from
    a contour is found, its first candidate is also planned in each of the other `postures`. Only
    the chosen plans are certified; together their bounds take the work of one, see
    `kerfpath.certifier.SharedWork`.

    Parameters
    ----------
    contours : sequence of Contour, or of sequences of Contour
        The contours, or the candidates of each: other starts, directions, leads.
    robot, tool, placement, options
        As in `kerfpath.plan`, for every contour, as are its other keywords.
    speed : float m/s, or one for each contour
    progress : callable, optional
        Called with the number of candidates planned since the last call.
    home, cell, before, heat_spacing, heat_time, given_order, retract, approach_speed, air_speed,
    pierce_time, seconds
        As in `order_plans`; the plans are also clear in the cell.

    Raises
    ------
    NoFeasiblePath
        No candidate of a contour has a plan, there is no order, or there is no way between two
        contours.
    InputError
        As `kerfpath.plan` and `order_plans`.
    """
    groups = [[c] if isinstance(c, Contour) else list(c) for c in contours]
    speeds = list(speed) if isinstance(speed, Sequence) else [speed] * len(groups)
    if not groups or not all(groups) or len(speeds) != len(groups):
        raise InputError(
            "plan_part: expected at least one contour, candidates for each contour, and one speed "
            f"or one per contour; got {len(groups)} contours and {len(speeds)} speeds"
        )
    of_order = keywords.keys() & OrderKeywords.__annotations__.keys()
    order = cast(OrderKeywords, {k: v for k, v in keywords.items() if k in of_order})
    rest = {k: v for k, v in keywords.items() if k not in of_order}
    asked = with_keywords(options, rest, PartKeywords)
    wanted = replace(asked.on(robot), certify=None)  # only the chosen candidates are certified

    def planned(i: int, contour: Contour, options: PlanOptions) -> Plan:
        with effort_for(len(groups)):
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

    class Cuts(PlannedCuts[Plan]):
        def plan_of(self, one: Plan) -> Plan:
            return one

        def in_posture(self, contour: int, posture: int, *, quick: bool) -> Plan:
            nodes, own = groups[contour][0], replace(wanted, postures=(posture,))
            if not (quick and own.method == "continuous"):
                return planned(contour, nodes, own)
            setup = Setup.of(robot, tool, placement, order.get("cell"))
            at = None if nodes.time is not None else speeds[contour]
            wide = not are_many(len(groups))
            return best_motion(nodes, setup, own, speed=at, thorough=wide)

        def with_plan(self, one: Plan, plan: Plan) -> Plan:
            return plan

        def settled(self, ones: Sequence[Plan]) -> Sequence[Plan]:
            return ones

    postures = [wanted.postures] * len(groups)
    served: list[Iterable[int]] = [()] * len(groups)
    if not robot.free.size:
        for i, candidates in enumerate(groups):
            few = spread(len(candidates[0]), FEW)
            graph = layered_graph(
                candidates[0], robot, tool=tool, placement=placement, options=wanted, nodes=few,
                fold=folds(robot, wanted, 0.0),
            )  # fmt: skip
            served[i] = graph.postures_throughout.tolist()
    planned_in = [[int(made.posture[0]) for made in each] for each in tried]
    common = common_postures(served, postures, planned_in)
    found = order_candidates(tried, Cuts(), postures, common, **order)
    work = SharedWork([len(made.q) for made in found.plans])
    bounded = tuple(with_bound(made, asked.certify, work=work) for made in found.plans)
    return replace(found, plans=bounded)


class PlannedCuts(Protocol[T]):
    """How the candidates of contours are planned, for `order_candidates`."""

    def plan_of(self, one: T) -> Plan:
        """Return the plan of a candidate."""
        ...

    def in_posture(self, contour: int, posture: int, *, quick: bool) -> T | None:
        """Plan a contour in one posture, both given by number, quickly or thoroughly.

        Returns None or raises NoFeasiblePath where that is not possible.
        """
        ...

    def with_plan(self, one: T, plan: Plan) -> T | None:
        """Return a candidate with its plan turned about the beam; None if it must not be."""
        ...

    def settled(self, ones: Sequence[T]) -> Sequence[T | None]:
        """Return candidates that an order has chosen in their final form.

        It is None where one may not be used.
        """
        ...


class _Candidates(Generic[T]):
    """The candidates of each contour, and those among them that are in their final form."""

    def __init__(
        self, tried: Sequence[list[T]], cuts: PlannedCuts[T], order: OrderKeywords
    ) -> None:
        self.tried, self._cuts, self._keywords = tried, cuts, order
        self._order = OrderOptions(**order)
        self._given, self._final = [len(each) for each in tried], list[T]()

    @property
    def plans(self) -> list[list[Plan]]:
        """The plans of the candidates of each contour."""
        return [[self._cuts.plan_of(one) for one in each] for each in self.tried]

    def add(
        self,
        contour: int,
        wanted: Iterable[int] | None,
        progress: Progress,
        *,
        quick: bool,
    ) -> list[Plan]:
        """Plan a contour in the wanted postures (None: all) that it has no plan in."""
        each = self.tried[contour]
        made = len(each)
        unused = unused_postures(self.plans[contour], wanted)
        name = self._cuts.plan_of(each[0]).name
        for k, posture in enumerate(unused):
            progress(f"{name}: other postures", k, len(unused))
            one = None
            with suppress(NoFeasiblePath):
                one = self._cuts.in_posture(contour, posture, quick=quick)
            each += [] if one is None else [one]
        return self.plans[contour][made:]

    def turn_alike(self, contours: Sequence[int], progress: Progress) -> None:
        """Offer candidates of contours turned about the beam, alike in each posture.

        They are turned towards the first one in their posture, and that one towards home, or the
        first one of all if there is no home. Turned candidates replace those that were added.
        """
        near, first = dict[int, Array](), self._home
        for k, i in enumerate(contours):
            progress(TURNING, k, len(contours))
            for c, one in enumerate(self.tried[i][:]):
                posture = int(self._cuts.plan_of(one).posture[0])
                first = self._mean(one) if first is None else first
                aim = near.get(posture, first)
                other = self._turned(one, aim, aim)
                if other is not None and c >= self._given[i]:
                    self.tried[i][c] = other
                elif other is not None:
                    self.tried[i].append(other)
                near.setdefault(posture, self._mean(one if other is None else other))

    def posture_alone(self, posture: int, before: PartPlan) -> PartPlan | None:
        """Return a quick order of the candidates in one posture, from that of `before` on.

        None is returned where a contour has none, or there is no such order.
        """
        held = [
            [c for c, plan in enumerate(each) if (plan.posture == posture).all()]
            for each in self.plans
        ]
        if not all(held):
            return None
        alone = [[plans[c] for c in own] for plans, own in zip(self.plans, held, strict=True)]
        begin = [i for i, _ in before.chosen]
        try:
            found = order_plans(alone, begin=begin, draft=True, **self._keywords)
        except NoFeasiblePath:
            return None
        return replace(found, chosen=tuple((i, held[i][c]) for i, c in found.chosen))

    def turn_between(self, found: PartPlan, contours: Collection[int], progress: Progress) -> bool:
        """Offer the chosen candidates turned towards their neighbours; return whether any is new.

        They are turned to where the moves before and after them come from and go to.
        """
        starts, ends = (
            [back_off(made, end, found.retract) for made in found.plans] for end in ("start", "end")
        )
        before, after = [self._home, *ends[:-1]], [*starts[1:], self._home]
        new = False
        around = zip(found.chosen, before, after, strict=True)
        for k, ((i, c), one, two) in enumerate(around):
            progress(TURNING, k, len(before))
            behind, ahead = (two if one is None else one), (one if two is None else two)
            if i in contours and behind is not None and ahead is not None:
                other = self._turned(self.tried[i][c], behind, ahead)
                self.tried[i] += [] if other is None else [other]
                new |= other is not None
        return new

    def settle(self, found: PartPlan, longer: float) -> PartPlan | None:
        """Bring the chosen candidates of an order into their final form; return their order.

        Where that form differs they are ordered again, among themselves, with the bound of `found`.
        None is returned where one may not be used, or their order takes longer by more than a
        share `longer`: others may be better now.

        Raises
        ------
        NoFeasiblePath
            None of the candidates of a contour may be used.
        """
        same = usable = True
        final = {id(one) for one in self._final}
        new = [(i, c) for i, c in found.chosen if id(self.tried[i][c]) not in final]
        ones = [self.tried[i][c] for i, c in new]
        for (i, c), one, settled in zip(new, ones, self._cuts.settled(ones), strict=True):
            last = [] if settled is None else [settled]
            self.tried[i][c : c + 1] = last
            self._final += last
            usable &= settled is not None
            same &= settled is not None and np.array_equal(
                self._cuts.plan_of(settled).q, self._cuts.plan_of(one).q
            )
            if not self.tried[i]:
                name = self._cuts.plan_of(one).name
                said = f"contour {name!r}: none of its plans may be used"
                raise NoFeasiblePath(said, proved=False, node=-1)
        if same or not usable:
            return found if same else None
        return self._ordered_alone(found, longer)

    def _ordered_alone(self, found: PartPlan, longer: float) -> PartPlan | None:
        """Return the order of the chosen candidates of `found` among themselves, see `settle`."""
        chosen = dict(found.chosen)
        alone = [[made[chosen[i]]] for i, made in enumerate(self.plans)]
        try:
            begin = [i for i, _ in found.chosen]
            last = order_plans(alone, begin=begin, draft=are_many(len(alone)), **self._keywords)
        except NoFeasiblePath:
            return None
        if last.order.duration > (1 + longer) * found.order.duration:
            return None
        bound = min(found.order.at_least, last.order.duration)
        return replace(
            last,
            chosen=tuple((i, chosen[i]) for i, _ in last.chosen),
            order=replace(last.order, at_least=bound),
        )

    @property
    def _home(self) -> Array | None:
        home = self._order.home
        return None if home is None else np.asarray(home, dtype=np.float64)

    def _mean(self, one: T) -> Array:
        return np.asarray(self._cuts.plan_of(one).q.mean(axis=0))

    def _turned(self, one: T, before: Array, after: Array) -> T | None:
        made = turned(self._cuts.plan_of(one), before, after, self._order.cell)
        return None if made is None else self._cuts.with_plan(one, made)


def order_candidates(
    tried: Sequence[list[T]],
    cuts: PlannedCuts[T],
    postures: Sequence[Sequence[int] | None],
    common: Sequence[Sequence[int]],
    progress: Progress = no_progress,
    **order: Unpack[OrderKeywords],
) -> PartPlan:
    """Order candidates by `order_plans`, planned in common postures, and in others where needed.

    Candidates in common postures are also offered turned about the beam, see `turned`: alike in
    each posture, and once an order is found, towards their neighbours in it.

    Parameters
    ----------
    tried : sequence of lists
        The planned candidates of each contour; candidates in other postures are appended.
    cuts : PlannedCuts
        How further candidates are planned, and how the chosen ones are brought into their final
        form. Where the order takes longer by more than `LONGER` then, one of all is sought again.
    postures : sequence of sequences of int, or None
        Postures that each contour may be cut in; None: all.
    common : sequence of sequences of int
        Postures that each contour is planned in before the order is sought, see `common_postures`.
    progress : callable
    order
        The other keywords of `order_plans`.

    Returns
    -------
    PartPlan

    Raises
    ------
    NoFeasiblePath, InputError
        As `order_plans`.
    """
    offered = _Candidates(tried, cuts, order)
    for i, wanted in enumerate(common):
        offered.add(i, wanted, progress, quick=True)
    may_turn = [i for i, wanted in enumerate(common) if wanted]
    offered.turn_alike(may_turn, progress)
    longest = longest_search(OrderOptions(**order).seconds)

    def ordered(*, draft: bool = False, begin: PartPlan | None = None) -> PartPlan:
        progress(f"order and moves, at most {longest:g} s without a solution", 0, 0)
        return order_plans(
            offered.plans,
            more=lambda i: offered.add(i, postures[i], progress, quick=False),
            begin=None if begin is None else [i for i, _ in begin.chosen],
            draft=draft,
            **order,
        )

    many = are_many(len(tried))
    found = ordered(draft=many)
    for _ in range(TURNED):
        if not offered.turn_between(found, may_turn, progress):
            break
        took, found = found.order.duration, ordered(draft=many, begin=found)
        if found.order.duration > (1 - SHORTER) * took:
            break
    if many:
        found = ordered(begin=found)
    else:
        new = False
        for posture in sorted({p for wanted in common for p in wanted}):
            alone = offered.posture_alone(posture, found)
            if alone is not None and alone.order.duration <= (1 + RIVAL) * found.order.duration:
                new |= offered.turn_between(alone, may_turn, progress)
        found = ordered(begin=found) if new else found
    allowed = np.inf if many else LONGER
    while (settled := offered.settle(found, allowed)) is None:
        found = ordered(begin=found)
    found = settled
    # On the turns that the order has chosen.
    made = zip(found.chosen, found.plans, strict=True)
    last = (replace(offered.plans[i][c], q=on.q, turn=on.turn) for (i, c), on in made)
    return replace(found, plans=tuple(last))


def order_plans(
    candidates: Sequence[Sequence[Plan]],
    *,
    more: Callable[[int], Sequence[Plan]] = lambda contour: (),
    begin: Sequence[int] | None = None,
    draft: bool = False,
    **keywords: Unpack[OrderKeywords],
) -> PartPlan:
    """Return one plan for each contour, chosen from its candidates, in the order of least time.

    Order, candidates and moves are chosen together; candidates are also offered on near turns of
    their joints, see `on_near_turns`. Each move is first assumed to be straight,
    which no way around beats. The moves of the best order are then planned in the cell, until all
    moves of the best order are planned. A move for which no way is found is not used. Where no
    order is left without it, `more` plans of the two contours are requested, once.

    Parameters
    ----------
    candidates : sequence of sequences of Plan
        Candidates of each contour, all of one robot.
    more : callable, optional
        Returns further plans of a contour, given its number, in other postures. They become
        candidates of the contour and are numbered after the others.
    begin, draft
        As in `best_order`: contours in an order to begin with, and whether that of a quick search
        is enough.
    **keywords
        As in `OrderOptions`; `before` must agree with `given_order`.

    Raises
    ------
    NoFeasiblePath
        No candidate of a contour can be approached and left; there is no order; or there is no way
        between two contours, also none by which an endless joint turns back: the message names
        them, what is in the way and what was tried.
    InputError
        A length, speed or time is out of range.
    """
    options = OrderOptions(**keywords)
    cell, before = options.cell, options.before
    every = [list(made) for made in candidates]
    further = MorePlans(every, more)
    places = reachable(every, cell, options.retract, further)
    if options.given_order:
        before = [*before, *((i, i + 1) for i in range(len(every) - 1))]
    warm = _too_warm([c[0].contour for c in every], options.heat_spacing)
    home = (
        None if options.home is None else floats(options.home, "home", (every[0][0].robot.joints,))
    )
    air: MoveTimes | None = None
    plans: list[Plan] = []
    offered: list[tuple[int, int]] = []
    near: dict[int, Array] = {}
    while True:
        for i, c in places:
            one = every[i][c]
            aim = near.setdefault(int(one.posture[0]), one.q.mean(axis=0))
            near_by = [p for p in on_near_turns(one, home, aim) if can_back_off(p, options.retract)]
            plans = [*plans, *near_by]
            offered += [(i, c)] * len(near_by)
        group = np.array([i for i, _ in offered])
        air = (
            MoveTimes(plans, group, cell, options.retract, options.seconds, options.air_speed)
            if air is None
            else air.extended(plans, group)
        )
        if not options.heat_time:
            air.forbid(warm[np.ix_(group, group)])
        if home is not None:
            air.come_from(home)
            air.go_to(home)
        own = np.array([p.time[-1] - p.time[0] for p in plans])
        pierce = options.pierce_time
        each = np.array(pierce)[group if isinstance(pierce, Sequence) else ...]
        own += each + 2 * options.retract / options.approach_speed
        found = _settle_order(
            air, group, own, before, np.where(warm, options.heat_time, 0.0), options.seconds,
            begin, draft=draft,
        )  # fmt: skip
        if not isinstance(found, NoFeasiblePath):
            order = found
            break
        contours = sorted({int(group[c]) for leg in air.failed for c in leg if c != HOME})
        places = (
            more_reachable(every, cell, options.retract, further, contours) if air.failed else []
        )
        if not places:
            raise further.mentioned_in(found)
    made, moves, back = air.unrolled(order.candidates, options.turns_within)
    order = replace(order, duration=order.duration + back)
    pierce = options.pierce_time
    if isinstance(pierce, Sequence):
        pierce = tuple(pierce[offered[k][0]] for k in order.candidates.tolist())
    return PartPlan(
        plans=made,
        moves=moves,
        order=order,
        chosen=tuple(offered[k] for k in order.candidates.tolist()),
        retract=options.retract,
        approach_speed=options.approach_speed,
        pierce_time=pierce,
    )


def longest_search(seconds: float) -> float:
    """Return the total time (s) that searches for ways around may take without a result.

    It covers the searches before and after other postures are planned.
    """
    return 2 * PATIENCE * seconds


def _settle_order(
    air: MoveTimes, group: Ints, own: Array, before: Sequence[tuple[int, int]], rest: Array,
    seconds: float, begin: Sequence[int] | None, *, draft: bool,
) -> Order | NoFeasiblePath:  # fmt: skip
    """Return the best order in which every move has a way, or why none is found.

    Of very many groups, moves are planned along drafts before the solver begins.
    """
    failed, drafts = len(air.failed), draft or are_many(len(rest))
    while len(air.failed) - failed < PATIENCE:
        try:
            order = best_order(
                group, own, air.between,
                first=air.first, last=air.last, before=before, rest=rest, begin=begin,
                draft=drafts, seconds=seconds,
            )  # fmt: skip
        except NoFeasiblePath as none:
            return air.why_no_order(none)
        if air.look_at(order.candidates):
            continue
        if draft or not drafts:
            return order
        drafts, begin = False, group[order.candidates].tolist()
    return air.why_no_order(None)


def _too_warm(contours: Sequence[Contour], spacing: float) -> Bools:
    """Return which contours (G, G) are nearer to each other than `spacing` (m)."""
    if spacing <= 0:
        return np.zeros((len(contours), len(contours)), bool)
    return distances_between(contours) < spacing


def distances_between(contours: Sequence[Contour]) -> Array:
    """Return the least distance between the nodes of each two contours, (G, G) m.

    The diagonal is infinite.
    """
    apart = np.full((len(contours), len(contours)), np.inf)
    trees = [cKDTree(contour.points) for contour in contours]
    for i, j in combinations(range(len(contours)), 2):
        apart[i, j] = apart[j, i] = np.min(trees[i].query(contours[j].points)[0])
    return apart
