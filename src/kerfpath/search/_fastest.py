"""The least node interval: the fastest constant speed as a second-order minimax problem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, bools, floats, freeze, positive, scalar
from kerfpath._told import told
from kerfpath.errors import InputError
from kerfpath.kernels import search as kernel
from kerfpath.kernels.metric import CHEBYCHEV, increments
from kerfpath.search._exact import quickest_path
from kerfpath.search._layers import require_joined, sorted_layers
from kerfpath.search._problem import Problem, closed_vertices, offsets, shut_edges

__all__ = ["LeastInterval", "least_interval", "quickest"]

_LAYERS_SAMPLED = 8
"""Layers whose nearest pairs give the first guess of the interval; any guess ends right."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LeastInterval:
    """The least time from node to node in which a path exists, and what binds there.

    Parameters
    ----------
    dt : float s
    index : (K,) int
        A path that keeps it: vertex of each layer, 0-based inside its layer.
    joint : int
        The joint that binds, 0-based.
    node : int
        Where: the node at which the binding increment ends, or at which the acceleration acts.
    limit : {"velocity", "acceleration"}
        Which of its limits binds.
    """

    dt: float
    index: Ints
    joint: int
    node: int
    limit: Literal["velocity", "acceleration"]

    __repr__ = told


def least_interval(
    q: ArrayLike,
    start: ArrayLike,
    *,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    endless: ArrayLike | None = None,
    vertex_cost: ArrayLike | None = None,
    shut: ArrayLike | None = None,
    eta_v: float = 1.0,
    eta_a: float = 1.0,
) -> LeastInterval:
    """Return the least node interval in which a path through the layers keeps (5) and (6), exactly.

    Minimises over all paths the largest of |dq_i| / (eta_v q'max_i) over edges and of
    sqrt(|ddq_i| / (eta_a q''max_i)) over pairs of edges.

    Parameters
    ----------
    q, start, velocity, acceleration, endless, shut, eta_v, eta_a
        As in `shortest_path`; K >= 2.
    vertex_cost : (N,), optional
        0, or infinity where a vertex is closed.

    Raises
    ------
    NoFeasiblePath
        An empty layer, or closed vertices and shut edges that leave no path; says where.
    InputError
        Arrays that do not fit each other, NaN, limits that are not positive, other vertex costs.
    """
    q = floats(q, "q", (None, None), copy=False)
    start, n = offsets(start, len(q)), q.shape[1]
    v = scalar(eta_v, "eta_v", above=0.0) * positive(velocity, "velocity", (n,))
    a = scalar(eta_a, "eta_a", above=0.0) * positive(acceleration, "acceleration", (n,))
    endless = bools(np.zeros(n, bool) if endless is None else endless, "endless", (n,))
    if len(start) < 3:
        raise InputError("start: a node interval needs at least two layers, got 1")
    problem = timed(
        q, start, endless, weight=1 / v, acceleration=a, vertex_cost=vertex_cost, shut=shut
    )
    if not np.isin(problem.aim.vertex_cost, (0.0, np.inf)).all():
        raise InputError("vertex_cost: here a vertex is open (0) or closed (infinity)")
    require_joined(problem)
    ceiling = _guess(q, start, v, endless)
    while True:
        # Edges that take longer than the ceiling are not looked at: right if a path keeps it.
        found = quickest(problem, ceiling * v, ceiling)
        if found is not None:
            index, _ = found
            return _binding(q[start[:-1] + index], index, v, a, endless)
        ceiling *= 2


def timed(
    q: Array,
    start: Ints,
    endless: Bools,
    *,
    weight: Array,
    acceleration: Array,
    vertex_cost: ArrayLike | None = None,
    shut: ArrayLike | None = None,
) -> Problem:
    """Return the problem of the path whose steps and changes ask for the least time at most.

    A step asks for its Chebychev distance under `weight` (n,) s/rad, a change for the time in which
    `acceleration` (n,) rad/s^2 allows it.
    """
    aim = kernel.Objective(
        weight=freeze(weight),
        metric=CHEBYCHEV,
        minimax=True,
        vertex_cost=closed_vertices(vertex_cost, len(q)),
        velocity=np.full(len(endless), np.inf),
        acceleration=freeze(acceleration),
        cap=np.inf,
        timed=True,
    )
    return Problem(q=q, start=start, endless=endless, aim=aim, shut=shut_edges(shut, start))


def quickest(problem: Problem, bound: Array, ceiling: float) -> tuple[Ints, float] | None:
    """Return the best path of a timed problem whose steps keep `bound` (n,) rad, and its time.

    None where more than `ceiling` s is asked for, or no path keeps the bound.
    """
    aim = problem.aim._replace(velocity=freeze(bound), cap=ceiling)
    layers, aim, _ = sorted_layers(problem._replace(aim=aim))
    best = quickest_path(layers, aim, ceiling)
    return None if best is None else (layers.rank[best.path], best.cost)


def _guess(q: Array, start: Ints, v: Array, endless: Bools) -> float:
    """Return a node interval to begin with: twice what the nearest vertices of some layers need."""
    least = 0.0
    for k in np.unique(np.linspace(0, len(start) - 3, _LAYERS_SAMPLED).astype(int)):
        here, there = (q[start[i] : start[i + 1]] for i in (k, k + 1))
        nearest = np.full(len(here), np.inf)
        for j in range(0, len(there), max(1, len(there) // 64)):
            step = np.abs(here - there[j])
            short = np.abs(step - 2 * np.pi * np.round(step / (2 * np.pi)))
            nearest = np.minimum(nearest, (np.where(endless, short, step) / v).max(axis=1))
        least = max(least, float(nearest.min()))
    return 2 * least or 1e-6


def _binding(path: Array, index: Ints, v: Array, a: Array, endless: Bools) -> LeastInterval:
    """Measure a path: its least interval, and what asks for it."""
    dq = increments(np.ascontiguousarray(path), endless)
    fast = np.abs(dq) / v
    sharp = np.sqrt(np.abs(np.diff(dq, axis=0)) / a)
    limit: Literal["velocity", "acceleration"]
    if sharp.size and sharp.max() > fast.max():
        k, joint = np.unravel_index(np.argmax(sharp), sharp.shape)
        dt, node, limit = float(sharp.max()), int(k) + 1, "acceleration"
    else:
        k, joint = np.unravel_index(np.argmax(fast), fast.shape)
        dt, node, limit = float(fast.max()), int(k) + 1, "velocity"
    return LeastInterval(
        dt=dt,
        index=freeze(index),
        joint=int(joint),
        node=node,
        limit=limit,
    )
