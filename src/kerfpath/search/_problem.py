"""The border of the searches: what users hand in, cast and checked."""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, bools, floats, freeze, integers, positive, scalar
from kerfpath.errors import InputError
from kerfpath.kernels import metric as metrics
from kerfpath.kernels.search import Objective

__all__ = [
    "METRIC_CODES",
    "Metric",
    "ObjectiveKind",
    "Problem",
    "checked",
    "closed_vertices",
    "offsets",
    "one_of",
    "rotation_limits",
    "shut_edges",
]

Metric = Literal["manhattan", "chebychev", "euclid"]
ObjectiveKind = Literal["sum", "max"]

METRIC_CODES: dict[str, int] = {
    "euclid": metrics.EUCLID,
    "manhattan": metrics.MANHATTAN,
    "chebychev": metrics.CHEBYCHEV,
}


class Problem(NamedTuple):
    """A layered graph, not sorted yet, and what is asked of a path through it."""

    q: Array
    """(N, n) rad."""
    start: Ints
    """(K+1,): layer k is q[start[k]:start[k+1]]."""
    endless: Bools
    """(n,): joints that turn without end."""
    aim: Objective
    """Its vertex costs are in the order of q, infinite where a vertex is closed."""
    shut: Ints
    """(E, 2): edges that may not be used, from and to, in the order of q."""


def offsets(start: ArrayLike, vertices: int) -> Ints:
    start = integers(start, "start", (None,))
    if len(start) < 2 or start[0] != 0 or start[-1] != vertices or (np.diff(start) < 0).any():
        raise InputError(
            "start: expected K+1 offsets that begin with 0, never decrease and end with the number "
            f"of vertices ({vertices}), got {start.tolist() if len(start) < 12 else '...'}"
        )
    return start


def checked(
    q: ArrayLike,
    start: ArrayLike,
    *,
    dt: float,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    endless: ArrayLike | None,
    vertex_cost: ArrayLike | None,
    shut: ArrayLike | None,
    weights: ArrayLike | None,
    metric: Metric,
    objective: ObjectiveKind,
    eta_v: float,
    eta_a: float,
) -> Problem:
    """Return the problem that the arguments of `shortest_path` pose.

    Raises
    ------
    InputError
        Arrays that do not fit each other, NaN, limits or dt that are not positive, unknown names.
    """
    q = floats(q, "q", (None, None), copy=False)
    start, n = offsets(start, len(q)), q.shape[1]
    if n == 0:
        raise InputError("q: expected at least one joint, got shape " + str(q.shape))
    dt = scalar(dt, "dt", unit="s", above=0.0)
    velocity = positive(velocity, "velocity", (n,))
    acceleration = positive(acceleration, "acceleration", (n,))
    endless = bools(np.zeros(n, bool) if endless is None else endless, "endless", (n,))
    one_of("metric", metric, tuple(METRIC_CODES))
    one_of("objective", objective, get_args(ObjectiveKind))
    weight = 1.0 / (velocity * dt) if weights is None else floats(weights, "weights", (n,))
    if (weight < 0).any():
        raise InputError(f"weights: must not be negative, got {weight.tolist()}")
    aim = Objective(
        weight=freeze(np.ascontiguousarray(weight)),
        metric=METRIC_CODES[metric],
        minimax=objective == "max",
        vertex_cost=closed_vertices(vertex_cost, len(q)),
        velocity=freeze(scalar(eta_v, "eta_v", above=0.0) * velocity * dt),
        acceleration=freeze(scalar(eta_a, "eta_a", above=0.0) * acceleration * dt**2),
        cap=np.inf,
        timed=False,
    )
    return Problem(q=q, start=start, endless=endless, aim=aim, shut=shut_edges(shut, start))


def closed_vertices(vertex_cost: ArrayLike | None, vertices: int) -> Array:
    """Return what vertices (N,) cost, infinity where they are closed."""
    if vertex_cost is None:
        return freeze(np.zeros(vertices))
    cost = floats(vertex_cost, "vertex_cost", (vertices,), infinite=True)
    if (cost == -np.inf).any():
        raise InputError("vertex_cost: a vertex may cost infinity, which closes it, but not -inf")
    return cost


def shut_edges(shut: ArrayLike | None, start: Ints) -> Ints:
    """Return the edges (E, 2) that may not be used, each from a layer to the next."""
    if shut is None:
        return np.empty((0, 2), np.int64)
    edges = integers(shut, "shut", (None, 2))
    layer = np.searchsorted(start, edges, side="right") - 1
    inside = ((edges >= 0) & (edges < start[-1])).all(axis=1)
    wrong = np.flatnonzero(~inside | (layer[:, 1] != layer[:, 0] + 1))
    if wrong.size:
        raise InputError(
            "shut: an edge leads from a vertex to one of the next layer, got "
            f"{edges[wrong[0]].tolist()}"
        )
    return edges


def rotation_limits(rotation: ArrayLike | None, endless: Bools) -> Array:
    """Return the largest angle (n,) rad that each joint may turn away, infinity where unlimited.

    Raises
    ------
    InputError
        Negative or NaN; a finite limit of a joint that is not endless.
    """
    n = len(endless)
    if rotation is None:
        return np.full(n, np.inf)
    limit = floats(rotation, "rotation", (n,), infinite=True)
    if (limit < 0).any():
        raise InputError(f"rotation: must not be negative, got {limit.tolist()}")
    plain = np.flatnonzero(np.isfinite(limit) & ~endless)
    if plain.size:
        raise InputError(
            f"rotation: joint {plain[0] + 1} is not endless, its range limits it: give infinity, "
            f"got {limit[plain[0]]:g}"
        )
    return limit


def one_of(name: str, value: str, known: tuple[str, ...]) -> None:
    """Refuse a name that is not known."""
    if value not in known:
        raise InputError(f"{name}: expected one of {', '.join(known)}, got {value!r}")
