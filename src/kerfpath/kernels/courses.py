"""Steps between coarse samples of external axes and gamma, roughly within the limits (5)."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.kernels.jit import jit, jit_inline
from kerfpath.kernels.metric import increment

__all__ = ["CoarseLayer", "Nearby", "best_steps"]

MOST, OVER = 3.0, 20.0
"""`MOST` is how many of its spans a joint may move; `OVER` is the price of the excess over one. A
joint may exceed its span because samples are coarse, and the motion between them may need less."""


class CoarseLayer(NamedTuple):
    """The arm's joints at one node, for all external axes, gammas and postures."""

    q: Array
    """(X, m, P, n) rad."""
    ok: Bools
    """(X, m, P): whether they are within reach and limits."""


class Nearby(NamedTuple):
    """Where a step may start, and what it costs."""

    place: Ints
    """(X, W): nearby samples of the external axes for each of them; -1: none."""
    cost: Array
    """(W,): cost of moving the external axes from there."""
    turns: int
    """Number of samples of gamma that a step may turn by, either way."""
    span: Array
    """(n,) rad: the farthest that each joint can move in the time of a step."""
    wraps: Bools
    """(n,): joints that go the short way round."""
    weight: Array
    """(n,): cost of a full span of each joint."""
    square: float
    """Cost of the square of the share of a span that a joint moves."""


@jit_inline
def _arm_cost(a: Array, b: Array, near: Nearby, most: float) -> float:
    """Return the cost of the arm's step from joints a to b (n,); infinite far beyond (5)."""
    cost = 0.0
    for j in range(len(a)):
        share = abs(increment(b[j] - a[j], near.wraps[j])) / near.span[j]
        cost += near.weight[j] * share + near.square * share * share
        if share > 1.0:
            cost += OVER * near.square * (share - 1.0)
        if share > MOST or cost >= most:
            return inf
    return cost


@jit
def best_steps(
    before: CoarseLayer, value: Array, here: CoarseLayer, near: Nearby,
    out_value: Array, out_from: Ints,
) -> None:  # fmt: skip
    """Fill the cost to reach each sample (X, m, P), and its predecessor's flat index; -1: none."""
    X, m, P = here.ok.shape
    for x in range(X):
        for g in range(m):
            for p in range(P):
                best, chosen = inf, -1
                if here.ok[x, g, p]:
                    for w in range(near.place.shape[1]):
                        y = near.place[x, w]
                        if y < 0:
                            continue
                        for turn in range(-near.turns, near.turns + 1):
                            h = (g + turn) % m
                            start = value[y, h, p] + near.cost[w]
                            if not before.ok[y, h, p] or start >= best:
                                continue
                            step = _arm_cost(before.q[y, h, p], here.q[x, g, p], near, best - start)
                            if start + step < best:
                                best, chosen = start + step, (y * m + h) * P + p
                out_value[x, g, p], out_from[x, g, p] = best, chosen
