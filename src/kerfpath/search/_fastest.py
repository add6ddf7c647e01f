"""The least node interval: the fastest constant speed as a second-order minimax problem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, bools, floats, freeze, positive, scalar
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.kernels import search as kernel
from kerfpath.kernels.metric import CHEBYCHEV, increments
from kerfpath.search._exact import quickest_path
from kerfpath.search._layers import empty_layer, narrowest_key, offsets, sorted_layers

__all__ = ["GATE_LIMIT", "LeastInterval", "least_interval", "quickest"]

GATE_LIMIT = 1.5
"""What a gate lets pass: between 1, from open to an end, and 2, from end to end."""
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


def least_interval(
    q: ArrayLike,
    start: ArrayLike,
    *,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    endless: ArrayLike | None = None,
    eta_v: float = 1.0,
    eta_a: float = 1.0,
    gates: ArrayLike | None = None,
) -> LeastInterval:
    """Return the least node interval in which a path through the layers keeps (5) and (6), exactly.

    Minimises over all paths the largest of |dq_i| / (eta_v q'max_i) over edges and of
    sqrt(|ddq_i| / (eta_a q''max_i)) over pairs of edges.

    Parameters
    ----------
    q, start, velocity, acceleration, endless, eta_v, eta_a
        As in `shortest_path`; K >= 2.
    gates : (N, m), optional
        Numbers of the vertices that no step may change by more than 1.5, at any speed.

    Raises
    ------
    NoFeasiblePath
        An empty layer; says which. Or the gates let no path through.
    InputError
        Arrays that do not fit each other, NaN, limits that are not positive.
    """
    q = floats(q, "q", (None, None), copy=False)
    start, n = offsets(start, len(q)), q.shape[1]
    v = scalar(eta_v, "eta_v", above=0.0) * positive(velocity, "velocity", (n,))
    a = scalar(eta_a, "eta_a", above=0.0) * positive(acceleration, "acceleration", (n,))
    endless = bools(np.zeros(n, bool) if endless is None else endless, "endless", (n,))
    if len(start) < 3:
        raise InputError("start: a node interval needs at least two layers, got 1")
    empty = np.flatnonzero(np.diff(start) == 0)
    if empty.size:
        raise empty_layer(int(empty[0]))
    gate = floats(np.empty((len(q), 0)) if gates is None else gates, "gates", (len(q), None))
    m, ceiling = gate.shape[1], _guess(q, start, v, endless)
    widest = np.where(endless, 2 * np.pi, np.ptp(q, axis=0))
    slowest = float(max((widest / v).max(), np.sqrt(2 * widest / a).max()))
    while True:
        # Edges that take longer than the ceiling are not looked at: right if a path keeps it.
        found = quickest(
            np.hstack([q, gate]) if m else q,
            start,
            np.append(endless, np.zeros(m, bool)),
            np.append(1 / v, np.zeros(m)),
            np.append(ceiling * v, np.full(m, GATE_LIMIT)),
            np.append(a, np.full(m, np.inf)),
            ceiling,
        )
        if found is not None:
            index, _ = found
            return _binding(q[start[:-1] + index], index, v, a, endless)
        if m and ceiling > slowest:
            raise NoFeasiblePath("no path passes the gates at any speed", proved=True, node=-1)
        ceiling *= 2


def quickest(
    q: Array,
    start: Ints,
    endless: Bools,
    weight: Array,
    bound: Array,
    acceleration: Array,
    ceiling: float,
) -> tuple[Ints, float] | None:
    """Return the path whose steps and changes ask for the least time at most, and that time.

    A step asks for its Chebychev distance under `weight` (n,) s/rad and may not exceed `bound` (n,)
    rad; a change asks for the time in which `acceleration` (n,) rad/s^2 allows it. None where more
    than `ceiling` s is asked for, or no path keeps the bound.
    """
    key, width, circular = narrowest_key(q, start, bound, endless)
    layers, _ = sorted_layers(q, start, key, width, circular, endless)
    aim = kernel.Objective(
        weight=freeze(weight),
        metric=CHEBYCHEV,
        minimax=True,
        vertex_cost=freeze(np.zeros(len(q))),
        velocity=freeze(bound),
        acceleration=freeze(acceleration),
        cap=ceiling,
        timed=True,
    )
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
