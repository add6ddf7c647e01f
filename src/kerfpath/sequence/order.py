"""The order of cutting: a generalised travelling-salesman problem over groups of candidates.

Each group (a contour) has candidates (a start, a direction, a posture), of which one is chosen. The
objective is the time of the chosen candidates and of the moves between them. The solver (CP-SAT of
OR-tools) proves that its order is best, or gives a bound.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle, pairwise, product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from kerfpath.arrays import Array, Bools, Ints, floats, integers, short_repr
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.extras import require_extra

# -----------------------------------------------------------------------------
# Find contours that lie inside others: a piece must not fall out before its holes are cut.

COMMON = 0.1
"""Length of the mean tool axis from which on the axes have a common direction."""


def inner_first(contours: Sequence[Contour]) -> list[tuple[int, int]]:
    """Return the pairs (i, j) of contours where i lies inside the closed contour j.

    The contours are seen along the mean tool axis of j. Both must be on the same side of the part:
    their mean axes differ by less than 90 deg. Open contours contain nothing, so pass the loops of
    the drawing without their leads. A loop around a tube, whose axes have no common direction,
    contains nothing either.
    """
    firsts = np.array([contour.points[0] for contour in contours]).reshape(-1, 3)
    means = np.array([contour.axes.mean(axis=0) for contour in contours]).reshape(-1, 3)
    pairs = []
    for j, outer in enumerate(contours):
        n = means[j]
        if not outer.closed or np.linalg.norm(n) < COMMON:
            continue
        x = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
        plane = np.array([x / np.linalg.norm(x), np.cross(n, x) / np.linalg.norm(np.cross(n, x))]).T
        ring = outer.points @ plane
        # The first point is enough for most contours, which are far outside.
        at = firsts @ plane
        near = (means @ n > 0) & ((ring.min(axis=0) <= at) & (at <= ring.max(axis=0))).all(axis=1)
        near[j] = False
        found = np.flatnonzero(near)[_inside(ring, at[near])]
        pairs += [(i, j) for i in found.tolist() if _inside(ring, contours[i].points @ plane).all()]
    return pairs


def _inside(ring: Array, points: Array) -> Bools:
    """Return which points (B, 2) are inside a ring (K, 2), by the parity of ray crossings."""
    a, b = ring[:-1], ring[1:]
    above = a[:, 1] > points[:, None, 1], b[:, 1] > points[:, None, 1]
    rise = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
    at = a[:, 0] + (points[:, None, 1] - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
    crossed = (above[0] != above[1]) & (points[:, None, 0] < at)
    return np.asarray(crossed.sum(axis=1) % 2 == 1)


# -----------------------------------------------------------------------------
# The order of cutting: a generalised travelling-salesman problem over groups of candidates.

TICK, REST_TICK = 1e-4, 1e-6
"""s: resolution of times in the solver, and of those between groups that need a rest: they are sums
over many moves."""


WORK = 0.3
"""Deterministic time of the solver per second of its limit: a unit of it took 2 to 3.5 s of a core
that others used, too, on the model of 42 contours."""
MOST_LEGS = 10_000
"""Most moves that the solver chooses from if there is an order already: of 17 000 moves between 42
contours, and 300 000 between 201, it shortened no order and raised no bound in 11 and 20 s."""
CIRCUIT_CUTS = 30
"""Number of groups from which on circuit cuts pay although groups need a place in the order."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Order:
    """An order of cutting.

    Parameters
    ----------
    candidates : (G,) int
        The chosen candidate of each group, in the order of cutting.
    duration : float s
        Time of those candidates and of the moves between them.
    at_least : float s
        Lower bound: no order takes less. Equal to `duration` where the order is proved best; 0
        where it was kept from an earlier plan.
    """

    candidates: Ints
    duration: float
    at_least: float

    __repr__ = short_repr

    @property
    def optimal(self) -> bool:
        """Whether the order is proved best within the solver's resolution for each move."""
        return self.duration - self.at_least <= 2 * TICK * (len(self.candidates) + 1)


def best_order(
    group: ArrayLike,
    own: ArrayLike,
    between: ArrayLike,
    *,
    first: ArrayLike | None = None,
    last: ArrayLike | None = None,
    before: Sequence[tuple[int, int]] = (),
    rest: ArrayLike | None = None,
    begin: Sequence[int] | None = None,
    draft: bool = False,
    seconds: float = 10.0,
) -> Order:
    """Return the order of least time that visits one candidate of every group.

    It never waits: where groups need a rest between them, others come in between. The solver begins
    with an order from a quick search, if that finds one, and ends after a limit on its work, so
    that the same arguments give the same order on every machine.

    Parameters
    ----------
    group : (C,) int
        Group of each candidate, 0 to G - 1; every group has at least one candidate.
    own : (C,) s
        Time of each candidate itself.
    between : (C, C) s
        Time from the end of candidate i to the start of candidate j; infinite where j may not
        follow i.
    first, last : (C,) s, optional
        Time to reach each candidate as the first, and to return home from it as the last; infinite
        where that is not allowed. Default: 0.
    before : sequence of (g, h)
        Group g comes before group h.
    rest : (G, G) s, optional
        Least time from the end of either of two groups to the beginning of the other one; 0: none.
    begin : sequence of int, optional
        The groups in an order that the quick search begins with, too.
    draft : bool
        Whether the order of the quick search is enough, if it finds one.
    seconds : float s
        Limit on the work of the solver, which takes about so long on a core of its own.

    Raises
    ------
    NoFeasiblePath
        No order satisfies all of this (proved), or none was found with that work.
    InputError
        The shapes do not fit, a group has no candidates, `before` has an unknown group, or `rest`
        is not symmetric.
    """
    g = integers(group, "group", (None,))
    C, G = len(g), int(g.max(initial=-1)) + 1
    if set(g.tolist()) != set(range(G)) or G == 0:
        raise InputError(f"group: expected every number from 0 to {max(G - 1, 0)}, got {set(g)}")
    move = np.asarray(between, dtype=np.float64)
    if move.shape != (C, C) or np.isnan(move).any() or (move < 0).any():
        raise InputError(f"between: expected times >= 0 of shape ({C}, {C}), got {move.shape}")
    if any(not 0 <= h < G for pair in before for h in pair):
        raise InputError(f"before: expected pairs of numbers from 0 to {G - 1}, got {list(before)}")
    cost = floats(own, "own", (C,))
    ends = []
    for name, given in (("first", first), ("last", last)):
        time = np.zeros(C) if given is None else np.asarray(given, dtype=np.float64)
        if time.shape != (C,) or not (time >= 0).all():
            raise InputError(f"{name}: expected {C} times >= 0, got {time.tolist()}")
        ends.append(time)
    enter, leave = ends
    pause = floats(np.zeros((G, G)) if rest is None else rest, "rest", (G, G))
    if (pause < 0).any() or (pause != pause.T).any() or pause.diagonal().any():
        raise InputError("rest: expected times >= 0, the same either way and 0 on the diagonal")
    earlier = np.zeros((G, G), bool)
    for one, other in before:
        earlier[one, other] = True
    time = _times(g, cost, move, enter, leave, earlier)
    start = _quick_order(g, cost, time, earlier, pause, begin)
    if start is not None and (draft or np.isfinite(time).sum() > MOST_LEGS):
        return _found(start, time, _least_around(g, time))
    return _solve(g, cost, time, earlier, before, pause, start, seconds)


def _found(order: Ints, time: Array, least: float) -> Order:
    """Return an order of candidates that takes at least some time."""
    duration = _duration(order, time)
    return Order(candidates=order, duration=duration, at_least=min(least, duration))


def _solve(
    group: Ints, own: Array, time: Array, earlier: Bools, before: Sequence[tuple[int, int]],
    rest: Array, start: Ints | None, seconds: float,
) -> Order:  # fmt: skip
    require_extra("programs", "the order of cuts")
    from ortools.sat.python import cp_model  # loaded where it is needed: half a second

    C, G = len(group), len(earlier)
    model = cp_model.CpModel()
    ways = np.argwhere(np.isfinite(time)).tolist()
    taken = {(a, b): model.new_bool_var(f"{a} to {b}") for a, b in ways}
    without = [model.new_bool_var(f"without {i}") for i in range(C)]
    model.add_circuit(
        [(a, b, taken[a, b]) for a, b in ways] + [(i + 1, i + 1, without[i]) for i in range(C)]
    )
    for h in range(G):
        members = np.flatnonzero(group == h).tolist()
        model.add(sum(without[i] for i in members) == len(members) - 1)
    # A group that comes after all others is last since only it may go home; others need a place.
    last = (earlier.sum(axis=0) == G - 1) & ~earlier.diagonal()
    waiting = [(g, h) for g, h in before if not last[h]]
    if waiting:
        place = [model.new_int_var(0, G - 1, f"place {h}") for h in range(G)]
        model.add_all_different(place)
        for (a, b), way in taken.items():
            here = -1 if a == 0 else place[group[a - 1]]
            there = G if b == 0 else place[group[b - 1]]
            model.add(there == here + 1).only_enforce_if(way)
        for g, h in waiting:
            model.add(place[g] < place[h])
    if rest.any():
        _let_rest(model, group, own, time, rest, taken, without)
    model.minimize(sum(round(time[ends] / TICK) * way for ends, way in taken.items()))
    if start is not None:
        steps = {0: 0} | {int(i) + 1: k for k, i in enumerate(start.tolist())}
        legs = set(pairwise([0, *(start + 1).tolist(), 0]))
        for leg, variable in taken.items():
            model.add_hint(variable, leg in legs)
        for i, variable in enumerate(without):
            model.add_hint(variable, i + 1 not in steps)
        for k, h in enumerate(group[start].tolist() if waiting else []):
            model.add_hint(place[h], k)
    solver = cp_model.CpSolver()
    solver.parameters.max_deterministic_time = WORK * seconds
    solver.parameters.num_workers = 1  # reproducible
    solver.parameters.random_seed = 1
    # Circuit cuts prove a plain tour about ten times faster. With places they only cost time where
    # few groups are proved soon anyway; of 42 groups they left a gap of 0.1 % in place of 1.4 %.
    solver.parameters.linearization_level = 1 if waiting and G < CIRCUIT_CUTS else 2
    status = solver.solve(model)
    if status in (cp_model.OPTIMAL, cp_model.FEASIBLE):
        following = {a: b for (a, b), way in taken.items() if solver.boolean_value(way)}
        chosen, here = [], following[0]
        while here:
            chosen.append(here - 1)
            here = following[here]
        order = np.array(chosen)
        if start is not None and _duration(start, time) < _duration(order, time):
            order = start
    elif start is not None:
        order = start
    else:
        proved = status == cp_model.INFEASIBLE
        why = (
            "its constraints (which contour may follow or must come before another"
            f"{', and the time between near ones' if rest.any() else ''}) contradict each other"
            if proved
            else f"none that keeps the constraints was found with the work of {seconds:g} s; give "
            "more with seconds in [sequence]"
        )
        raise NoFeasiblePath(f"no order of cutting: {why}", proved=proved, node=-1)
    least = _least_around(group, time)
    if status in (cp_model.OPTIMAL, cp_model.FEASIBLE):
        least = max(least, solver.best_objective_bound * TICK)
    return _found(order, time, least)


def _let_rest(
    model: Any, group: Ints, own: Array, time: Array, rest: Array,
    taken: Mapping[tuple[int, int], Any], without: Sequence[Any],
) -> None:  # fmt: skip
    """Add to a model of an order that groups have their rest, but for the rounding of times."""
    G, ticks = len(rest), np.rint(np.where(np.isfinite(time), time, 0.0) / REST_TICK).astype(int)
    longest = np.zeros(G, int)
    np.maximum.at(longest, group, ticks[:, 1:].max(axis=0))
    end = [model.new_int_var(0, int(longest.sum()), f"end of {h}") for h in range(G)]
    for (a, b), way in taken.items():
        if b:
            begun = end[group[a - 1]] if a else 0
            model.add(end[group[b - 1]] == begun + int(ticks[a, b])).only_enforce_if(way)
    begin = list(end)
    for i, (h, its_own) in enumerate(zip(group.tolist(), own.tolist(), strict=True)):
        begin[h] = begin[h] - round(its_own / REST_TICK) * (1 - without[i])
    for g, h in np.argwhere(np.triu(rest)).tolist():
        least = int(rest[g, h] / REST_TICK) - G
        first = model.new_bool_var(f"{g} before {h}")
        model.add(begin[h] >= end[g] + least).only_enforce_if(first)
        model.add(begin[g] >= end[h] + least).only_enforce_if(~first)


def keeps_rest(order: Ints, group: Ints, own: Array, time: Array, rest: Array) -> bool:
    """Return whether an order of candidates has every rest, but for the rounding of times."""
    if not rest.any():
        return True
    end = np.cumsum(time[np.append(0, order[:-1] + 1), order + 1])
    between = (end - own[order])[None] - end[:, None]
    enough = between >= rest[np.ix_(group[order], group[order])] - 2 * REST_TICK * (len(order) + 1)
    return bool(enough[np.triu_indices(len(order), 1)].all())


def _duration(order: Ints, time: Array) -> float:
    """Return the time (s) of an order of candidates, from home and back."""
    around = np.concatenate([[0], order + 1, [0]])
    return float(time[around[:-1], around[1:]].sum())


def _least_around(group: Ints, time: Array) -> float:
    """Return a time (s) that no order beats: each group, and home, is reached once and left once.

    Which follows which is assigned at least cost; other candidates may be left than were reached.
    """
    number = np.append(0, group + 1)
    best = np.full((number.max() + 1,) * 2, np.inf)
    np.minimum.at(best, (number[:, None], number), time)
    return float(best[linear_sum_assignment(best)].sum())


def _quick_order(
    group: Ints, own: Array, time: Array, earlier: Bools, rest: Array, begin: Sequence[int] | None
) -> Ints | None:
    """Return a good order of candidates, from the nearest next or from `begin`; None if none."""
    starts = [_nearest_first(group, own, time, earlier, rest)]
    if begin is not None:
        starts.append(_along(begin, group, time))
    found = [
        shortened(start, group, time, earlier, own, rest)
        for start in starts
        if start is not None and keeps_rest(start, group, own, time, rest)
    ]
    return min(found, key=lambda order: _duration(order, time), default=None)


def _along(begin: Sequence[int], group: Ints, time: Array) -> Ints | None:
    """Return the best candidates of groups in an order; None where none of them may follow."""
    layers = [np.flatnonzero(group == h) for h in begin]
    cost, came = time[0, layers[0] + 1], list[Ints]()
    for one, other in pairwise(layers):
        reach = cost[:, None] + time[np.ix_(one + 1, other + 1)]
        came.append(np.argmin(reach, axis=0))
        cost = reach.min(axis=0)
    cost = cost + time[layers[-1] + 1, 0]
    at = int(np.argmin(cost))
    if not np.isfinite(cost[at]):
        return None
    chosen = [layers[-1][at]]
    for layer, back in zip(layers[-2::-1], came[::-1], strict=True):
        at = int(back[at])
        chosen.append(layer[at])
    return np.array(chosen[::-1])


STARTS = 32
"""Number of candidates from which orders are begun that go to the nearest one each."""


def _nearest_first(
    group: Ints, own: Array, time: Array, earlier: Bools, rest: Array
) -> Ints | None:
    """Return the best of some orders that go to the nearest allowed candidate, None if all end."""
    best: Ints | None = None
    firsts = np.argsort(time[0, 1:], kind="stable")
    for first in firsts[np.isfinite(time[0, 1:][firsts])][:STARTS].tolist():
        order, left, missing = list[int](), np.ones(len(group), bool), earlier.sum(axis=0)
        here, following, now = 0, first, 0.0
        rested: Array = np.zeros(len(rest))
        while np.isfinite(time[here, following + 1]):
            order.append(following)
            now += time[here, following + 1]
            rested = np.maximum(rested, now + rest[group[following]])
            left &= group != group[following]
            missing = missing - earlier[group[following]]
            here = following + 1
            if not left.any():
                break
            may = left & (missing[group] == 0) & (now + time[here, 1:] - own >= rested[group])
            reach = np.where(may, time[here, 1:], np.inf)
            following = int(np.argmin(reach))
            if not np.isfinite(reach[following]):
                break
        found = np.array(order, dtype=np.int64)
        is_whole = not left.any() and np.isfinite(time[here, 0])
        if is_whole and (best is None or _duration(found, time) < _duration(best, time)):
            best = found
    return best


BLOCKS = (1, 2, 3, 4, 6, 8)
"""Numbers of successive groups that are moved together to another place in an order."""


def shortened(
    order: Ints, group: Ints, time: Array, earlier: Bools, own: Array, rest: Array
) -> Ints:
    """Return an order in which no group, nor a few in succession, is better elsewhere in it.

    A group that is moved alone may also change its candidate. It takes a second for 400 groups.
    """
    members = [np.flatnonzero(group == h) for h in range(group.max() + 1)]
    in_vain, blocks = 0, cycle(product(BLOCKS, range(len(order))))
    while in_vain < len(BLOCKS) * len(order):
        size, at = next(blocks)
        in_vain += 1
        if at + size > len(order):
            continue
        block, left = order[at : at + size], np.delete(order, np.s_[at : at + size])
        its, others = group[block], group[left]
        heads, tails = (members[its[0]],) * 2 if size == 1 else (block[:1], block[-1:])
        around = np.concatenate([[0], left + 1, [0]])
        leg = time[around[:-1], around[1:]]
        shut = ~np.isfinite(leg)  # only the block in between makes this an order
        longer = time[np.ix_(around[:-1], heads + 1)] + time[np.ix_(tails + 1, around[1:])].T
        longer -= np.where(shut, 0.0, leg)[:, None]
        if shut.any():
            longer[~shut] = np.inf
        after = np.flatnonzero(earlier[np.ix_(others, its)].any(axis=1))
        until = np.flatnonzero(earlier[np.ix_(its, others)].any(axis=0))
        longer[: after[-1] + 1 if after.size else 0] = np.inf
        longer[until[0] + 1 if until.size else len(longer) :] = np.inf
        place, which = np.unravel_index(np.argmin(longer), longer.shape)
        moved = members[its[0]][which : which + 1] if size == 1 else block
        other = np.insert(left, place, moved)
        is_better = _duration(other, time) < _duration(order, time) - TICK
        if is_better and keeps_rest(other, group, own, time, rest):
            order, in_vain = other, 0
    return order


def _times(
    group: Ints, own: Array, move: Array, enter: Array, leave: Array, earlier: Bools
) -> Array:
    """Return times (C + 1, C + 1) of the move to each candidate and its cut; 0 is home.

    Infinity means not allowed.
    """
    time = np.full((len(group) + 1, len(group) + 1), np.inf)
    same = group[:, None] == group
    time[1:, 1:] = np.where(same | earlier[group[None], group[:, None]], np.inf, move + own)
    time[0, 1:] = np.where(earlier[:, group].any(axis=0), np.inf, enter + own)
    time[1:, 0] = np.where(earlier[group].any(axis=1), np.inf, leave)
    return time
