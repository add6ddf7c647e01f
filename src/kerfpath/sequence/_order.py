"""The order of cutting: a generalised travelling-salesman problem over groups of candidates.

Each group (a contour) has candidates (a start, a direction, a posture), of which one is chosen. The
objective is the time of the chosen candidates and of the moves between them. The solver (CP-SAT of
OR-tools) proves that its order is best, or gives a bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, floats, integers
from kerfpath._extras import require_extra
from kerfpath._repr import short_repr
from kerfpath.errors import InputError, NoFeasiblePath

__all__ = ["Order", "best_order"]

TICK = 1e-4
"""s: resolution of times in the solver."""


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
        Lower bound: no order takes less. Equal to `duration` where the order is proved best.
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
    seconds: float = 10.0,
) -> Order:
    """Return the order of least time that visits one candidate of every group.

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
    seconds : float s
        Time limit of the solver.

    Raises
    ------
    NoFeasiblePath
        No order satisfies all of this (proved), or none was found in time.
    InputError
        The shapes do not fit, a group has no candidates, or `before` has an unknown group.
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
    return _solve(g, cost, move, enter, leave, before, seconds)


def _solve(
    group: Ints, own: Array, move: Array, enter: Array, leave: Array,
    before: Sequence[tuple[int, int]], seconds: float,
) -> Order:  # fmt: skip
    require_extra("programs", "the order of cuts")
    from ortools.sat.python import cp_model  # loaded where it is needed: half a second

    C, G = len(group), int(group.max()) + 1
    earlier = np.zeros((G, G), bool)
    for g, h in before:
        earlier[g, h] = True
    time = _times(group, own, move, enter, leave, earlier)
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
    model.minimize(sum(round(time[ends] / TICK) * way for ends, way in taken.items()))
    solver = cp_model.CpSolver()
    solver.parameters.max_time_in_seconds = seconds
    solver.parameters.num_workers = 1  # reproducible
    solver.parameters.random_seed = 1
    # Circuit cuts prove a plain tour about ten times faster; with places they only cost time.
    solver.parameters.linearization_level = 1 if waiting else 2
    status = solver.solve(model)
    if status not in (cp_model.OPTIMAL, cp_model.FEASIBLE):
        proved = status == cp_model.INFEASIBLE
        why = (
            "its constraints (which contour may follow or must come before another) contradict "
            "each other"
            if proved
            else f"none that keeps the constraints was found within {seconds:g} s"
        )
        raise NoFeasiblePath(
            f"no order of cutting: {why}",
            proved=proved,
            node=-1,
        )
    following = {a: b for (a, b), way in taken.items() if solver.boolean_value(way)}
    chosen, here = [], following[0]
    while here:
        chosen.append(here - 1)
        here = following[here]
    order = np.array(chosen)
    duration = enter[order[0]] + own[order].sum() + move[order[:-1], order[1:]].sum()
    return Order(
        candidates=order,
        duration=float(duration + leave[order[-1]]),
        at_least=float(min(solver.best_objective_bound * TICK, duration + leave[order[-1]])),
    )


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
