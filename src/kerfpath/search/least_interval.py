"""Least node interval: the fastest constant speed as a second-order minimax problem."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, freeze, short_repr
from kerfpath.errors import InputError
from kerfpath.kernels.change_table import ChangeTable
from kerfpath.kernels.metric import CHEBYCHEV, increments, increments_between
from kerfpath.kernels.search import Aim
from kerfpath.limits import AccelerationLimit
from kerfpath.search.exact import (
    quickest_path,
)
from kerfpath.search.problem import (
    Layers,
    SearchProblem,
    change_table,
    refuse_ends,
    refuse_torque,
    require_joined,
    sort_layers,
)

_LAYERS_SAMPLED = 8
"""Layers whose nearest pairs give the first guess of the interval, which affects only the time."""
_VERTICES_SAMPLED = 64
"""Vertices sampled of a layer."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LeastInterval:
    """Least time from node to node in which a path exists, and the limit that binds there.

    Parameters
    ----------
    dt : float s
    index : (K,) int
        A path that keeps it: vertex of each layer, 0-based inside its layer.
    joint : int
        The joint that binds, 0-based.
    node : int
        The node at which the binding increment ends, or at which the acceleration acts.
    limit : {"velocity", "acceleration"}
        The limit of the joint that binds.
    """

    dt: float
    index: Ints
    joint: int
    node: int
    limit: Literal["velocity", "acceleration"]

    __repr__ = short_repr


def find_least_interval(problem: SearchProblem) -> LeastInterval:
    """Return the exact least node interval in which a path through the layers keeps (5) and (6).

    Over all paths it minimises the largest of |dq_i| / (eta_v q'max_i) over edges and of
    sqrt(|ddq_i| / (eta_a q''max_i)) over pairs of edges.

    Parameters
    ----------
    problem : SearchProblem
        K >= 2; vertices cost 0, or infinity if closed. Its dt, weights, metric, objective and costs
        of reversals do not matter.

    Raises
    ------
    NoFeasiblePath
        A layer is empty, or closed vertices and shut edges leave no path; the message says where.
    InputError
        A single layer, other vertex costs, a closure, or a limit on rotation, torque or jerk.
    """
    refuse_ends(problem, "least node interval")
    refuse_torque(problem, "least node interval")
    if len(problem.start) < 3:
        raise InputError("start: a node interval needs at least two layers, got 1")
    if not np.isin(problem.vertex_cost, (0.0, np.inf)).all():
        raise InputError(
            "vertex_cost: for the least node interval a vertex is open (0) or closed (infinity), "
            "got another cost"
        )
    layers = problem.layers
    require_joined(layers)
    v, limit = problem.limits.velocity.usable, problem.limits.acceleration
    aim = aim_at_least_time(1 / v, limit.usable, change_table(problem.limits))
    ceiling = first_guess(layers, v)
    while True:
        # Edges that take longer than the ceiling are left out, which is exact if a path keeps it.
        found = quickest(layers, aim, ceiling * v, ceiling)
        if found is not None:
            return binding(layers, found[0], v, limit)
        ceiling *= 2


def aim_at_least_time(weight: Array, acceleration: Array, table: ChangeTable) -> Aim:
    """Return the aim to minimise the time, s, that the slowest step or change of a path needs.

    A step needs its Chebychev distance under `weight` (n,) s/rad, a change of increments the time
    in which `acceleration` (n,) rad/s^2, times the factor of the table, allows it. The node
    interval of the aim is one second.
    """
    return Aim(
        weight=freeze(weight),
        metric=CHEBYCHEV,
        minimax=True,
        velocity=np.full(len(weight), np.inf),
        acceleration=acceleration,
        table=table,
        timed=True,
    )


def quickest(layers: Layers, aim: Aim, bound: Array, ceiling: float) -> tuple[Ints, float] | None:
    """Return the path of least time whose steps keep `bound` (n,) rad, and its time.

    None if it needs more than `ceiling` s, or if no path keeps the bound.
    """
    graph = sort_layers(layers, bound)
    best = quickest_path(graph, aim._replace(velocity=freeze(bound), cap=ceiling), ceiling)
    return None if best is None else (graph.rank[best.path], best.cost)


def times_asked(path: Array, endless: Bools, velocity: Array, acceleration: Array) -> list[Array]:
    """Return the node intervals in which (5) and (6) would hold on a path (K, n) rad.

    They are those of its steps, (K-1, n), and of the changes of its steps, (K-2, n). They are in s
    with limits (n,), the second also (K-2, n), in rad/s and rad/s^2, and in node intervals with
    limits in rad.
    """
    dq = increments(path, endless)
    return [np.abs(dq) / velocity, np.sqrt(np.abs(np.diff(dq, axis=0)) / acceleration)]


def first_guess(layers: Layers, v: Array) -> float:
    """Return a first node interval: twice the one that the nearest vertices of some layers need."""
    least = 0.0
    for steps in sampled_steps(layers, _LAYERS_SAMPLED):
        least = max(least, min(float((step / v).max(axis=1).min()) for step in steps))
    return 2 * least or 1e-6


def sampled_steps(layers: Layers, count: int) -> Iterator[Iterator[Array]]:
    """Yield, for `count` layers, the steps (m, n) rad from all vertices to some of the next."""
    q, start = layers.q, layers.start
    for k in np.unique(np.linspace(0, len(start) - 3, count).astype(int)):
        here, there = (q[start[i] : start[i + 1]] for i in (k, k + 1))
        some = there[:: max(1, len(there) // _VERTICES_SAMPLED)]
        yield (np.abs(increments_between(vertex, here, layers.endless)) for vertex in some)


def binding(layers: Layers, index: Ints, v: Array, limit: AccelerationLimit) -> LeastInterval:
    """Return the least interval of a path, and the limit that requires it."""
    path = layers.q[layers.start[:-1] + index]
    fast, sharp = times_asked(path, layers.endless, v, limit.usable_at(path[1:-1]))
    what: Literal["velocity", "acceleration"]
    what = "acceleration" if sharp.max(initial=0.0) > fast.max() else "velocity"
    time = sharp if what == "acceleration" else fast
    k, joint = np.unravel_index(np.argmax(time), time.shape)
    return LeastInterval(
        dt=float(time.max()), index=freeze(index), joint=int(joint), node=int(k) + 1, limit=what
    )
