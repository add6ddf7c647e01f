"""The order of cutting: a travelling-salesman problem over groups of candidates.

Each group (a contour) has candidates (a start, a direction, a posture), of which one is taken. What
is minimised is the time of the candidates taken and of the moves between them; the solver (CP-SAT
of OR-tools) proves its order best, or says how far from it.
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
"""s: the solver counts in whole ticks."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Order:
    """An order of cutting.

    Parameters
    ----------
    candidates : (G,) int
        The candidate taken of each group, in the order of cutting.
    duration : float s
        Of those candidates and the moves between them.
    at_least : float s
        No order takes less; the same as `duration` where it is proved best.
    """

    candidates: Ints
    duration: float
    at_least: float

    __repr__ = short_repr

    @property
    def optimal(self) -> bool:
        """Whether no order is shorter by more than the solver's tick for each move."""
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
    """Return the order of least time in which one candidate of every group is done.

    Parameters
    ----------
    group : (C,) int
        Group of each candidate, 0 to G - 1, each with one candidate at least.
    own : (C,) s
        Time that each candidate takes itself.
    between : (C, C) s
        Time from the end of one to the start of another; infinite where that may not follow.
    first, last : (C,) s, optional
        Time to reach each as the first, and to come home from each as the last; default 0,
        infinite where that may not be.
    before : sequence of (g, h)
        Group g is done before group h.
    seconds : float
        How long the solver may take.

    Raises
    ------
    NoFeasiblePath
        No order keeps all of that (proved), or none was found in time.
    InputError
        Shapes that do not fit, a group without candidates, `before` of a group that is not there.
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
    # What waits for all others is last because only it may go home; the rest need their places.
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
    solver.parameters.num_workers = 1  # the same answer each time
    solver.parameters.random_seed = 1
    # Cuts of the circuit prove a plain tour about ten times sooner; with places they only cost.
    solver.parameters.linearization_level = 1 if waiting else 2
    status = solver.solve(model)
    if status not in (cp_model.OPTIMAL, cp_model.FEASIBLE):
        proved = status == cp_model.INFEASIBLE
        why = "contradict each other" if proved else f"were not met within {seconds:g} s"
        raise NoFeasiblePath(
            f"no order of cutting: what may follow what, and what comes first, {why}",
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
    """Return the time (C + 1, C + 1) of going on to each and cutting it; 0 is home, inf forbids."""
    time = np.full((len(group) + 1, len(group) + 1), np.inf)
    same = group[:, None] == group
    time[1:, 1:] = np.where(same | earlier[group[None], group[:, None]], np.inf, move + own)
    time[0, 1:] = np.where(earlier[:, group].any(axis=0), np.inf, enter + own)
    time[1:, 0] = np.where(earlier[group].any(axis=1), np.inf, leave)
    return time
