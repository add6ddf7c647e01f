"""The best path through a layered graph given as bare arrays (section 3.2 of the paper)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, bools, floats, freeze, integers, positive, scalar
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.kernels import metric as metrics
from kerfpath.kernels import search as kernel
from kerfpath.search._exact import Best, best_closed_path, best_path, dead_end
from kerfpath.search._layers import backwards, empty_layer, narrowest_key, offsets, sorted_layers

__all__ = ["Closure", "LayeredPath", "Method", "Metric", "ObjectiveKind", "shortest_path"]

Metric = Literal["manhattan", "chebychev", "euclid"]
ObjectiveKind = Literal["sum", "max"]
Method = Literal["exact", "paper", "known"]
Closure = Literal["free", "periodic"]

_METRIC_CODES: dict[str, int] = {
    "euclid": metrics.EUCLID,
    "manhattan": metrics.MANHATTAN,
    "chebychev": metrics.CHEBYCHEV,
}
SAME_END = 1e-6
"""Joint difference (rad) up to which the ends of a closed contour count as the same vertex."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LayeredPath:
    """One vertex per layer, and what the path costs.

    Parameters
    ----------
    index : (K,) int
        Vertex of each layer, 0-based inside its layer.
    cost : float
        Objective (14) or (15), vertex costs included.
    optimal : bool
        True only when the path is proved to be the best on this graph under (5) and (6).
    """

    index: Ints
    cost: float
    optimal: bool


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
    weights: ArrayLike | None = None,
    metric: Metric = "manhattan",
    objective: ObjectiveKind = "sum",
    method: Method = "exact",
    closure: Closure = "free",
    eta_v: float = 1.0,
    eta_a: float = 1.0,
) -> LayeredPath:
    """Return the best path that takes one vertex of each layer, in order.

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
        Joints that turn without end, compared modulo 2 pi (13); default none.
    posture : (N,) int, optional
        Posture of each vertex; the "known" method stays on one.
    vertex_cost : (N,), optional
        Added for each visited vertex (with objective "max": maximised).
    weights : (n,) 1/rad, optional
        Weights of the distance; default 1 / (velocity dt).
    metric : {"manhattan", "chebychev", "euclid"}
        Distance rho_a in the weighted joint space.
    objective : {"sum", "max"}
        (14) or (15).
    method : {"exact", "paper", "known"}
        "paper": the procedure of section 3.2, whose acceleration test sees only the best
        predecessor. "known": the technique of 2004, without (5) and (6), on one posture.
        "exact": the optimum under (5) and (6), proved; of several with the same maximum, the one
        with the least sum.
    closure : {"free", "periodic"}
        "periodic": the last layer repeats the first, the path returns to the vertex it left
        (endless joints modulo 2 pi), and (6) holds across the seam; exact method only.
    eta_v, eta_a : float
        Share of the velocity and acceleration limits that may be used.

    Raises
    ------
    NoFeasiblePath
        No admissible path was found; says where and what forbids it.
    InputError
        Arrays that do not fit each other, NaN, limits or dt that are not positive, unknown names,
        a periodic closure whose end layers differ.
    """
    q = floats(q, "q", (None, None), copy=False)
    start = offsets(start, len(q))
    n = q.shape[1]
    if n == 0:
        raise InputError("q: expected at least one joint, got shape " + str(q.shape))
    dt = scalar(dt, "dt", unit="s", above=0.0)
    velocity = positive(velocity, "velocity", (n,))
    acceleration = positive(acceleration, "acceleration", (n,))
    endless = bools(np.zeros(n, bool) if endless is None else endless, "endless", (n,))
    _one_of("metric", metric, tuple(_METRIC_CODES))
    _one_of("objective", objective, get_args(ObjectiveKind))
    _one_of("method", method, get_args(Method))
    _one_of("closure", closure, get_args(Closure))
    bound_v = scalar(eta_v, "eta_v", above=0.0) * velocity * dt
    bound_a = scalar(eta_a, "eta_a", above=0.0) * acceleration * dt**2
    weight = 1.0 / (velocity * dt) if weights is None else floats(weights, "weights", (n,))
    if (weight < 0).any():
        raise InputError(f"weights: must not be negative, got {weight.tolist()}")
    cost = (
        np.zeros(len(q)) if vertex_cost is None else floats(vertex_cost, "vertex_cost", (len(q),))
    )
    if posture is not None:
        posture = integers(posture, "posture", (len(q),))
    if closure == "periodic" and method != "exact":
        raise InputError(f'closure: "periodic" needs method="exact", got method={method!r}')

    if method == "known":
        bound_v = bound_a = np.full(n, np.inf)
        key = np.zeros(len(q)) if posture is None else posture.astype(float)
        window, circular = 0.5, False
    else:
        key, window, circular = narrowest_key(q, start, bound_v, endless)
    layers, order = sorted_layers(q, start, key, window, circular, endless)
    aim = kernel.Objective(
        weight=freeze(np.ascontiguousarray(weight)),
        metric=_METRIC_CODES[metric],
        minimax=objective == "max",
        vertex_cost=freeze(cost[order]),
        velocity=freeze(bound_v),
        acceleration=freeze(bound_a),
        cap=np.inf,
        timed=False,
    )
    filled = int(np.argmin(np.diff(start))) if (np.diff(start) == 0).any() else len(start) - 1
    if filled == 0:
        raise empty_layer(0)
    if method == "exact":
        try:
            return _exactly(layers, aim, filled, closure)
        except NoFeasiblePath as broken:
            broken.back = _first_from_the_back(q, start, aim, endless)
            raise
    return _search(layers, aim, filled, may_prove=method == "paper")


def _exactly(
    layers: kernel.Layers, aim: kernel.Objective, filled: int, closure: Closure
) -> LayeredPath:
    """Return the proved optimum, or prove that there is no path (and say where it breaks)."""
    whole = filled == len(layers.start) - 1
    to_search = layers._replace(start=layers.start[: filled + 1])
    if closure == "periodic" and whole:
        _require_same_ends(layers)
        found = best_closed_path(layers, aim)
    else:
        found = best_path(to_search, aim)
    if isinstance(found, Best):
        if not whole:
            raise empty_layer(filled)
        index = layers.rank[found.path]
        return LayeredPath(index=freeze(index), cost=found.cost, optimal=True)
    if closure == "periodic" and found.layers >= filled - 1 and not found.counts.any():
        raise NoFeasiblePath(
            "paths reach the last node, but none returns to the vertex that it left"
            " with its acceleration across the seam admissible",
            proved=True,
            node=len(layers.start) - 2,
        )
    raise _broken_edge(found.layers, found.counts, proved=True)


def _first_from_the_back(q: Array, start: Ints, aim: kernel.Objective, endless: Bools) -> int:
    """Return the first node from which an admissible path reaches the end.

    (5) and (6) hold for a path and its reverse alike, so that it is as far as any path goes from
    the last layer backwards.
    """
    q, start = backwards(q, start)
    sizes = np.diff(start)
    filled = int(np.argmin(sizes)) if (sizes == 0).any() else len(sizes)
    if filled == 0:
        return len(sizes)
    key, window, circular = narrowest_key(q, start, aim.velocity, endless)
    layers, _ = sorted_layers(q, start, key, window, circular, endless)
    free = aim._replace(vertex_cost=freeze(np.zeros(len(q))))
    return len(sizes) - dead_end(layers._replace(start=start[: filled + 1]), free).layers


def _search(
    layers: kernel.Layers, aim: kernel.Objective, filled: int, *, may_prove: bool
) -> LayeredPath:
    """Run steps (1) to (5) of the procedure and read the path back (or say where it breaks)."""
    start = layers.start
    sizes = np.diff(start)
    dist, before = np.full(len(layers.low), np.inf), np.full(len(layers.low), -1)
    to_search = layers._replace(start=start[: filled + 1])
    reached, turned_away = kernel.path_planning(to_search, aim, dist, before)
    if reached < filled:
        counts = kernel.closing_counts(layers, aim, dist, before, reached)
        raise _broken_edge(reached, counts, proved=not turned_away)
    if filled < len(sizes):
        raise empty_layer(filled)
    a, b = start[-2], start[-1]
    best = np.flatnonzero(dist[a:b] == dist[a:b].min()) + a
    j = int(best[np.argmin(layers.rank[best])])
    cost = float(dist[j])
    path = np.empty(len(sizes), dtype=np.int64)
    for k in range(len(sizes) - 1, -1, -1):
        path[k] = layers.rank[j]
        j = int(before[j])
    return LayeredPath(index=freeze(path), cost=cost, optimal=may_prove and not turned_away)


def _broken_edge(k: int, forbidden: Ints, *, proved: bool) -> NoFeasiblePath:
    """Say that no admissible edge leads into layer k, and which limits forbid how many."""
    counts = {
        f"{test}, joint {i + 1}": int(number)
        for test, row in zip(("velocity", "acceleration"), forbidden, strict=True)
        for i, number in enumerate(row)
        if number
    }
    told = ", ".join(f"{name}: {number}" for name, number in counts.items())
    total = int(sum(counts.values()))
    return NoFeasiblePath(
        f"no admissible edge from node {k - 1} to node {k}; of {total} edges, forbidden by {told}",
        proved=proved,
        node=k - 1,
        counts=counts,
    )


def _require_same_ends(layers: kernel.Layers) -> None:
    first, last = slice(0, layers.start[1]), slice(layers.start[-2], layers.start[-1])
    sizes = int(layers.start[1]), int(layers.start[-1] - layers.start[-2])
    if sizes[0] != sizes[1]:
        raise InputError(
            "closure: periodic needs a last layer that repeats the first, but they have "
            f"{sizes[0]} and {sizes[1]} vertices"
        )
    a = layers.q[:, first][:, np.argsort(layers.rank[first])]
    b = layers.q[:, last][:, np.argsort(layers.rank[last])]
    gap = np.abs(a - b)
    gap = np.where(layers.endless[:, None], np.minimum(gap, 2 * np.pi - gap), gap)
    if gap.max(initial=0.0) > SAME_END:
        i = int(np.argmax(gap.max(axis=0)))
        raise InputError(
            "closure: periodic needs a last layer that repeats the first, but their vertices "
            f"{i} differ by {gap[:, i].max():.3g} rad"
        )


def _one_of(name: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise InputError(f"{name}: expected one of {', '.join(known)}, got {value!r}")
