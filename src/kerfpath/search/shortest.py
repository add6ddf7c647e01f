"""The best path through a layered graph given as arrays (section 3.2 of the paper)."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Bools, Ints, freeze, short_repr
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.kernels import search as kernel
from kerfpath.kernels.exact import count_closing
from kerfpath.kernels.metric import increments_between
from kerfpath.kernels.search import Aim, SortedLayers
from kerfpath.kernels.states import States
from kerfpath.limits import Limits, TorqueLimit
from kerfpath.search.branch import best_closed_path
from kerfpath.search.exact import BestPath, best_path, dead_end, may_cost_less
from kerfpath.search.problem import (
    Closure,
    Layers,
    Method,
    Metric,
    ObjectiveKind,
    SearchProblem,
    best_within_rotation,
    broken_edge,
    closed_before,
    empty_layer,
    example_problem,
    reverse,
    sort_layers,
    too_far,
    why_closed,
)

SAME_END = 1e-6
"""rad: joint difference up to which the ends of a closed contour count as the same vertex."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LayeredPath:
    """One vertex per layer, and the cost of the path.

    Parameters
    ----------
    index : (K,) int
        Vertex of each layer, 0-based inside its layer.
    cost : float
        Objective (14) or (15), vertex costs included.
    optimal : bool
        True only if the path is proved to be the best on this graph under (5), (6) and torque
        limits.
    """

    index: Ints
    cost: float
    optimal: bool

    __repr__ = short_repr


def shortest_path(
    q: ArrayLike,
    start: ArrayLike,
    *,
    dt: float,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    endless: ArrayLike | None = None,
    posture: ArrayLike | None = None,
    vertex_cost: ArrayLike | None = None,
    shut: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    metric: Metric = "manhattan",
    objective: ObjectiveKind = "sum",
    method: Method = "exact",
    closure: Closure = "free",
    rotation: ArrayLike | None = None,
    eta_v: float = 1.0,
    eta_a: float = 1.0,
    torque: TorqueLimit | None = None,
) -> LayeredPath:
    """Return the best path through a layered graph, with one vertex of each layer, in order.

    Parameters
    ----------
    q : (N, n) rad
        Joint vectors of all vertices, layer after layer.
    start : (K+1,) int
        Layer k is ``q[start[k]:start[k+1]]``.
    dt : float s
        Time from layer to layer.
    velocity, acceleration : (n,) rad/s, rad/s^2
        Limits of each joint, used in (5) and (6) with `eta_v` and `eta_a`.
    endless : (n,) bool, optional
        Joints that turn without end, compared modulo 2 pi (13); default none. Half a turn goes in
        the direction of the values in `q`.
    posture : (N,) int, optional
        Posture of each vertex; the "known" method stays in one.
    vertex_cost : (N,), optional
        Cost added for each visited vertex (with objective "max": maximised); infinite: the vertex
        is closed.
    shut : (E, 2) int, optional
        Edges that may not be used, as rows of q: from a vertex to one of the next layer.
    weights : (n,) 1/rad, optional
        Weights of the distance; default 1 / (velocity dt).
    metric : {"manhattan", "chebychev", "euclid"}
        Distance rho_a in the weighted joint space.
    objective : {"sum", "max"}
        (14) or (15).
    method : {"exact", "paper", "known"}
        "paper": the procedure of section 3.2, whose acceleration test sees only the best
        predecessor. "known": the technique of 2004, without (5) and (6), in one posture.
        "exact": the proved optimum under (5) and (6); of several with the same maximum, the one
        with the least sum.
    closure : {"free", "periodic"}
        "periodic": the last layer repeats the first, the path returns to the vertex it left
        (endless joints modulo 2 pi), and (6) holds across the seam; exact method only.
    rotation : (n,) rad, optional
        Largest angle that an endless joint may turn away from where the path begins, in either
        direction; infinity: no limit (default); exact method only.
    eta_v, eta_a : float
        Share of the velocity and acceleration limits that may be used.
    torque : TorqueLimit, optional
        Kept at the nodes where (6) holds, by central differences; exact method only.

    Raises
    ------
    NoFeasiblePath
        No admissible path was found; the message says where, and which limits forbid it.
    InputError
        Arrays whose shapes do not fit, NaN, limits or dt that are not positive, unknown names,
        a periodic closure whose end layers differ, or a finite rotation of a joint that is not
        endless.

    Notes
    -----
    Nothing is stored per edge that is not shut. Besides `q`, the search takes about 100 bytes per
    vertex with six joints, at most 80 MB for the states (p, j) remembered under a loose bound, and
    finally 8 bytes for each state within the cost of the answer. The time grows with the number of
    layers. The search runs on the calling thread, without the interpreter lock: several may run at
    once, and each answer is the same to the bit.
    """
    problem = SearchProblem(
        q=q,
        start=start,
        dt=dt,
        limits=Limits.of(velocity, acceleration, eta_v=eta_v, eta_a=eta_a, torque=torque),
        endless=endless,
        vertex_cost=vertex_cost,
        shut=shut,
        weights=weights,
        metric=metric,
        objective=objective,
        closure=closure,
        rotation=rotation,
        method=method,
        posture=posture,
    )
    return find_shortest(problem)


def find_shortest(problem: SearchProblem) -> LayeredPath:
    """Return the best path through the layers of a problem; see `shortest_path`."""
    given, aim = problem.layers, problem.aim
    if problem.method == "known":
        free = freeze(np.full(len(aim.weight), np.inf))
        aim = aim._replace(velocity=free, acceleration=free)
        key = np.zeros(len(given.q)) if problem.posture is None else problem.posture.astype(float)
        layers = sort_layers(given, free, key, 0.5)
        del key  # as large as the graph
    else:
        layers = sort_layers(given, aim.velocity)
    if _filled(layers) == 0:
        raise empty_layer(given, 0)
    if problem.method != "exact":
        return _follow_procedure(given, layers, aim, may_prove=problem.method == "paper")
    closed = problem.closure == "periodic"
    if closed:
        _require_same_ends(given)
    try:
        found = _find_exactly(given, layers, aim, closed=closed)
    except NoFeasiblePath as broken:
        if (sooner := closed_before(given, aim, problem.rotation, broken)) is not None:
            raise sooner from None
        if np.isinf(problem.rotation).all():
            broken.back, broken.leaving = _from_the_back(given, aim)
        else:
            broken.reached = None  # within the rotation limits there may be fewer vertices
        raise
    over = too_far(given.q[given.start[:-1] + found.index], given.endless, problem.rotation)
    return _turn_less(given, aim, problem.rotation, over, closed=closed) if over.any() else found


class NoCheaperPath(Exception):  # an answer, not an error
    """No path costs less than asked. In a cell nobody asks why, as of `NoFeasiblePath`."""


def find_cheaper(problem: SearchProblem, cost: float) -> LayeredPath:
    """Return the best path through the layers of a problem, method "exact", below a cost.

    Where none is, this takes less time than `find_shortest`: what costs more is not followed, and
    closure and rotation limits matter only if there is one without them.

    Raises
    ------
    NoCheaperPath
        No path costs less, which is proved.
    """
    layers = sort_layers(problem.layers, problem.aim.velocity)
    whole = _filled(layers) == len(layers.start) - 1
    if whole and may_cost_less(layers, problem.aim, cost):
        with suppress(NoFeasiblePath):
            found = find_shortest(problem)
            if found.cost < cost:
                return found
    raise NoCheaperPath


def compile_exact() -> None:
    """Compile the kernels of `find_cheaper`."""
    find_cheaper(example_problem(), np.inf)


def _filled(layers: SortedLayers) -> int:
    """Return the first layer that has no vertex, or the number of layers if all have some."""
    sizes = np.diff(layers.start)
    return int(np.argmin(sizes)) if (sizes == 0).any() else len(sizes)


def _find_exactly(given: Layers, layers: SortedLayers, aim: Aim, *, closed: bool) -> LayeredPath:
    """Return the proved optimum; raise NoFeasiblePath, proved, where the path breaks."""
    filled = _filled(layers)
    whole = filled == len(layers.start) - 1
    if closed and whole:
        found = best_closed_path(layers, aim)
    else:
        found = best_path(layers._replace(start=layers.start[: filled + 1]), aim)
    if isinstance(found, BestPath):
        if not whole:
            raise empty_layer(given, filled)
        index = layers.rank[found.path]
        return LayeredPath(index=freeze(index), cost=found.cost, optimal=True)
    breaks = found.counts.any() or found.shut
    if closed and found.layers >= filled - 1 and not breaks:
        raise NoFeasiblePath(
            "paths reach the last node, but none returns to the vertex that it left"
            " with an admissible acceleration across the seam",
            proved=True,
            node=len(layers.start) - 2,
        )
    broken = broken_edge(found.layers, found.counts, found.shut, proved=True)
    broken.reached = freeze(layers.rank[found.reached])
    raise broken


def _turn_less(
    given: Layers, aim: Aim, rotation: Array, over: Bools, *, closed: bool
) -> LayeredPath:
    """Return the proved optimum within rotation limits, which the joints `over` (n,) exceed."""
    unrolled, found = best_within_rotation(given, aim, rotation, over, closed=closed)
    if found is None:
        raise why_closed(given, aim, rotation, unrolled, closed=closed)
    index, cost = found
    return LayeredPath(index=freeze(index), cost=cost, optimal=True)


def _from_the_back(given: Layers, aim: Aim) -> tuple[int, Ints | None]:
    """Return the first node from which admissible paths reach the end, and their vertices there.

    (5) and (6) hold for a path and its reverse alike, so this is as far as any path goes backwards
    from the last layer.
    """
    layers = sort_layers(reverse(given), aim.velocity)
    K, filled = len(layers.start) - 1, _filled(layers)
    if filled == 0:
        return K, None
    found = dead_end(layers._replace(start=layers.start[: filled + 1]), aim)
    return K - found.layers, freeze(layers.rank[found.reached])


def _follow_procedure(
    given: Layers, layers: SortedLayers, aim: Aim, *, may_prove: bool
) -> LayeredPath:
    """Run steps (1) to (5) of the procedure and trace the path; NoFeasiblePath if it breaks."""
    start, filled = layers.start, _filled(layers)
    dist, before = np.full(len(layers.low), np.inf), np.full(len(layers.low), -1)
    to_search = layers._replace(start=start[: filled + 1])
    reached, turned_away = kernel.path_planning(to_search, aim, dist, before)
    if reached < filled:
        ends = _ends(layers, dist, before, reached - 1)
        counts, shut = count_closing(layers, aim, ends, reached)
        raise broken_edge(reached, counts, int(shut), proved=not turned_away)
    if filled < len(start) - 1:
        raise empty_layer(given, filled)
    a, b = start[-2], start[-1]
    best = np.flatnonzero(dist[a:b] == dist[a:b].min()) + a
    j = int(best[np.argmin(layers.rank[best])])
    cost = float(dist[j])
    path = np.empty(len(start) - 1, dtype=np.int64)
    for k in range(len(path) - 1, -1, -1):
        path[k] = layers.rank[j]
        j = int(before[j])
    return LayeredPath(index=freeze(path), cost=cost, optimal=may_prove and not turned_away)


def _ends(layers: SortedLayers, dist: Array, before: Ints, k: int) -> States:
    """Return the last edges of the paths into layer k that the procedure has found."""
    a, b = layers.start[k : k + 2]
    vertex = a + np.flatnonzero(dist[a:b] < np.inf)
    parent = before[vertex]
    dq = increments_between(layers.given[:, parent].T, layers.given[:, vertex].T, layers.endless)
    first = np.searchsorted(vertex, np.arange(a, b + 1))
    way = np.zeros_like(vertex)
    return States(vertex, dist[vertex], np.ascontiguousarray(dq), parent, way, first)


def _require_same_ends(given: Layers) -> None:
    first, last = given.q[: given.start[1]], given.q[given.start[-2] :]
    if len(first) != len(last):
        raise InputError(
            "closure: periodic needs a last layer that repeats the first, but they have "
            f"{len(first)} and {len(last)} vertices"
        )
    gap = np.abs(increments_between(first, last, given.endless))
    if gap.max(initial=0.0) > SAME_END:
        i = int(np.argmax(gap.max(axis=1)))
        raise InputError(
            "closure: periodic needs a last layer that repeats the first, but their vertices "
            f"{i} differ by {gap[i].max():.3g} rad"
        )
