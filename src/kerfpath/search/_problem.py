"""Search problem: a layered graph, limits and objective, cast and checked once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import (
    Array,
    Bools,
    Ints,
    bools,
    floats,
    freeze,
    integers,
    require_one_of,
    scalar,
)
from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.kernels import metric as metrics
from kerfpath.kernels.search import Aim
from kerfpath.kernels.torque import NO_TORQUE, TorqueTest
from kerfpath.limits import Limits
from kerfpath.search._layers import Layers

__all__ = [
    "METRIC_CODES",
    "Closure",
    "Method",
    "Metric",
    "ObjectiveKind",
    "SearchProblem",
    "offsets",
    "refuse_ends",
    "refuse_torque",
    "rotation_limits",
]

Metric = Literal["manhattan", "chebychev", "euclid"]
ObjectiveKind = Literal["sum", "max"]
Method = Literal["exact", "paper", "known"]
Closure = Literal["free", "periodic"]

METRIC_CODES: dict[str, int] = {
    "euclid": metrics.EUCLID,
    "manhattan": metrics.MANHATTAN,
    "chebychev": metrics.CHEBYCHEV,
}


@dataclass(frozen=True, slots=True, eq=False, init=False)
class SearchProblem:
    """A layered graph given as arrays, and the limits and objective of a path through it.

    A path takes one vertex of each layer, in order.

    Parameters
    ----------
    q, start, dt, endless, vertex_cost, shut, weights, metric, objective, closure, rotation, posture
        As in `kerfpath.shortest_path`; q is not copied.
    limits : Limits
        Limits (5) and (6) and on the torque of each step; searches do not keep a jerk limit.
    method : {"exact", "paper", "known"}
        Method of `find_shortest`; all other searches are exact.

    Raises
    ------
    InputError
        Arrays whose shapes do not fit, NaN, a dt that is not positive, unknown names, a finite
        rotation of a joint that is not endless, or another method than "exact" with a closure, a
        rotation, or a limit on torque or jerk.
    """

    q: Array
    start: Ints
    dt: float
    limits: Limits
    endless: Bools
    vertex_cost: Array
    shut: Ints
    weights: Array
    metric: Metric
    objective: ObjectiveKind
    closure: Closure
    rotation: Array
    method: Method
    posture: Ints | None

    __repr__ = short_repr

    def __init__(
        self,
        *,
        q: ArrayLike,
        start: ArrayLike,
        dt: float,
        limits: Limits,
        endless: ArrayLike | None = None,
        vertex_cost: ArrayLike | None = None,
        shut: ArrayLike | None = None,
        weights: ArrayLike | None = None,
        metric: Metric = "manhattan",
        objective: ObjectiveKind = "sum",
        closure: Closure = "free",
        rotation: ArrayLike | None = None,
        method: Method = "exact",
        posture: ArrayLike | None = None,
    ) -> None:
        for name, value, known in (
            ("method", method, get_args(Method)),
            ("closure", closure, get_args(Closure)),
            ("metric", metric, tuple(METRIC_CODES)),
            ("objective", objective, get_args(ObjectiveKind)),
        ):
            require_one_of(value, name, known)
        q = floats(q, "q", (None, None), copy=False)
        N, n = q.shape
        if n == 0:
            raise InputError(f"q: expected at least one joint, got shape {q.shape}")
        dt = scalar(dt, "dt", unit="s", above=0.0)
        limits.require_joints(n)
        start = offsets(start, N)
        turning = bools(np.zeros(n, bool) if endless is None else endless, "endless", (n,))
        cast: dict[str, Any] = {
            "q": q,
            "start": start,
            "dt": dt,
            "limits": limits,
            "endless": turning,
            "vertex_cost": _vertex_costs(vertex_cost, N),
            "shut": _shut_edges(shut, start),
            "weights": _weights(weights, limits, dt),
            "metric": metric,
            "objective": objective,
            "closure": closure,
            "rotation": rotation_limits(rotation, turning),
            "method": method,
            "posture": None if posture is None else integers(posture, "posture", (N,)),
        }
        for name, value in cast.items():
            object.__setattr__(self, name, value)
        if method != "exact" and closure == "periodic":
            raise InputError(f'closure: "periodic" needs method="exact", got method={method!r}')
        if method != "exact" and np.isfinite(self.rotation).any():
            raise InputError(f'rotation: a limit needs method="exact", got method={method!r}')
        for name in ("torque", "jerk"):
            if method != "exact" and getattr(limits, name) is not None:
                raise InputError(f'{name}: a limit needs method="exact", got method={method!r}')

    @property
    def layers(self) -> Layers:
        """The layered graph."""
        return Layers(self.q, self.start, self.endless, self.vertex_cost, self.shut)

    def free(self) -> SearchProblem:
        """Return the problem without closure, rotation limits and costs of open vertices."""
        return replace(
            self,
            vertex_cost=np.where(self.vertex_cost < np.inf, 0.0, np.inf),
            closure="free",
            rotation=np.full(len(self.endless), np.inf),
        )

    @property
    def aim(self) -> Aim:
        """Objective and bounds on the increments, for the kernels."""
        torque = self.limits.torque
        return Aim(
            weight=self.weights,
            metric=METRIC_CODES[self.metric],
            minimax=self.objective == "max",
            velocity=self.limits.velocity.per_interval(self.dt),
            acceleration=self.limits.acceleration.per_interval(self.dt),
            torque=NO_TORQUE
            if torque is None
            else TorqueTest(arm=torque.dynamics.bodies, bound=torque.bound, dt=self.dt),
        )


def offsets(start: ArrayLike, vertices: int) -> Ints:
    """Return `start` as checked offsets of layers; InputError if it is not."""
    start = integers(start, "start", (None,))
    if len(start) < 2 or start[0] != 0 or start[-1] != vertices or (np.diff(start) < 0).any():
        raise InputError(
            "start: expected K+1 offsets that begin with 0, never decrease and end with the number "
            f"of vertices ({vertices}), got {start.tolist() if len(start) < 12 else '...'}"
        )
    return start


def _weights(weights: ArrayLike | None, limits: Limits, dt: float) -> Array:
    velocity = limits.velocity.bound
    if weights is None:
        return freeze(1.0 / (velocity * dt))
    weights = floats(weights, "weights", velocity.shape)
    if (weights < 0).any():
        raise InputError(f"weights: must not be negative, got {weights.tolist()}")
    return weights


def _vertex_costs(vertex_cost: ArrayLike | None, vertices: int) -> Array:
    if vertex_cost is None:
        return freeze(np.zeros(vertices))
    cost = floats(vertex_cost, "vertex_cost", (vertices,), infinite=True)
    if (cost == -np.inf).any():
        raise InputError("vertex_cost: a vertex may cost infinity, which closes it, but not -inf")
    return cost


def _shut_edges(shut: ArrayLike | None, start: Ints) -> Ints:
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
            f"rotation: joint {plain[0] + 1} is not endless and already limited by its range; "
            f"expected infinity, got {limit[plain[0]]:g}"
        )
    return limit


def refuse_torque(problem: SearchProblem, what: str) -> None:
    """Raise InputError for limits on torque or jerk, which a search does not support."""
    for name in ("torque", "jerk"):
        if getattr(problem.limits, name) is not None:
            raise InputError(f"{what}: limits on the {name} are not supported; remove them")


def refuse_ends(problem: SearchProblem, what: str) -> None:
    """Raise InputError for a closure or a rotation limit, which a search does not support."""
    if problem.closure != "free" or np.isfinite(problem.rotation).any():
        raise InputError(
            f'{what}: needs closure "free" and no rotation limit, got {problem.closure!r} and '
            f"{problem.rotation.tolist()}"
        )
