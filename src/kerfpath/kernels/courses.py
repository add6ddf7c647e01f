"""Steps between coarse samples of external axes and gamma, about in the velocity limits (5)."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from kerfpath._arrays import Array, Bools, Ints
from kerfpath.kernels._jit import jit, jit_inline
from kerfpath.kernels.metric import increment

__all__ = ["CoarseLayer", "Nearby", "best_steps"]

MOST, OVER = 3.0, 20.0
"""Shares of its span that a joint moves at most, and the price of one beyond the whole: samples are
coarse, and the motion between them may need less."""


class CoarseLayer(NamedTuple):
    """The arm's joints at every place of the external axes, gamma and posture of one node."""

    q: Array
    """(X, m, P, n) rad."""
    ok: Bools
    """(X, m, P): within reach and limits."""


class Nearby(NamedTuple):
    """Where a step may come from, and what it costs."""

    place: Ints
    """(X, W): places of the external axes near each; -1: none."""
    cost: Array
    """(W,): what moving the external axes from there costs."""
    turns: int
    """Samples of gamma that a step may turn by, either way."""
    span: Array
    """(n,) rad: what each joint can move in the time of a step."""
    wraps: Bools
    """(n,): joints that go the short way round."""
    weight: Array
    """(n,): cost of a whole span of each joint;"""
    square: float
    """and of the square of the share of a span that is moved."""


@jit_inline
def _arm_cost(a: Array, b: Array, near: Nearby, most: float) -> float:
    """Return what the arm's step from joints a to b (n,) costs; infinite far beyond (5)."""
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
    """Fill what reaching each sample (X, m, P) costs, and the sample before it, flat; -1: none."""
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
