"""What a run of the planner is asked for: the first runs, and the plain grid of weights."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import get_args

import numpy as np

from kerfpath._arrays import Array, Bools, freeze
from kerfpath.front._criteria import Criterion
from kerfpath.graph import LayeredGraph
from kerfpath.search import Metric, ObjectiveKind

__all__ = ["WINDOW", "Run", "anchors", "grid", "whole", "within"]

WINDOW = "window of joint"
"""What vertices outside a window are counted under, before the joint's number."""
FAINT = 1e-6
"""Weight of the other joints where one joint counts: they decide between equals, or as good as."""
LEVELS = (0.25, 4.0)
"""Multiples of the weight of one joint at a time, in the grid."""
SHARES = (1.0, 0.9, 0.8)
"""Multiples of eta in the grid."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """What one run of the planner is asked for.

    Parameters
    ----------
    objective, metric, eta_v, eta_a
        As in `kerfpath.plan`.
    weights : (n,) 1/rad
        Weights of the joint-space distance.
    window : (n, 2) rad
        Between what each joint has to stay (modulo 2 pi where it is endless), infinite where it is
        free.
    """

    objective: ObjectiveKind
    metric: Metric
    weights: Array
    eta_v: float
    eta_a: float
    window: Array


def whole(weights: Array, eta_v: float, eta_a: float) -> Run:
    """Return the run with all that the limits allow and no window, for the least displacement."""
    return Run(
        objective="sum",
        metric="manhattan",
        weights=weights,
        eta_v=eta_v,
        eta_a=eta_a,
        window=freeze(np.tile([-np.inf, np.inf], (len(weights), 1))),
    )


def anchors(first: Run, criteria: Sequence[Criterion], least_eta_a: float | None) -> list[Run]:
    """Return a run for the best of each criterion but the displacement of all joints.

    For the displacement and the increment of a joint, peak velocity and peak acceleration it is the
    best on the graph; for a range it is only where to begin, and for a comfort measure there is
    none.
    """
    found = []
    for criterion in criteria:
        weights = first.weights
        if criterion.joint is not None:
            weights = FAINT * weights
            weights[criterion.joint] = first.weights[criterion.joint]
        if criterion.kind in ("velocity", "increment"):
            found.append(
                replace(first, objective="max", metric="chebychev", weights=freeze(weights))
            )
        elif criterion.joint is not None:
            found.append(replace(first, weights=freeze(weights)))
        elif criterion.kind == "range":
            found.append(replace(first, metric="euclid"))
        elif criterion.kind == "acceleration" and least_eta_a is not None:
            found.append(replace(first, eta_a=least_eta_a))
    return found


def grid(first: Run, rng: np.random.Generator) -> Iterator[Run]:
    """Yield the runs of a plain grid over objective, metric, weights and eta, in random order.

    Then the same again with other levels, between those before.
    """
    n = len(first.weights)
    kinds = list(product(get_args(ObjectiveKind), get_args(Metric), SHARES, SHARES, range(2 * n)))
    depth = 1
    while True:
        for number in rng.permutation(len(kinds)):
            objective, metric, share_v, share_a, which = kinds[number]
            weights = first.weights.copy()
            weights[which // 2] *= LEVELS[which % 2] ** (1 / depth)
            yield replace(
                first,
                objective=objective,
                metric=metric,
                weights=freeze(weights),
                eta_v=first.eta_v * share_v ** (1 / depth),
                eta_a=first.eta_a * share_a ** (1 / depth),
            )
        depth += 1


def within(graph: LayeredGraph, window: Array, endless: Bools) -> LayeredGraph:
    """Return the graph without the vertices outside a window (n, 2), counted by joint."""
    outside = {}
    for joint, (low, high) in enumerate(window):
        if not np.isfinite(high - low) or (endless[joint] and high - low >= 2 * np.pi):
            continue
        above = graph.q[:, joint] - low
        if endless[joint]:
            above %= 2 * np.pi
        outside[f"{WINDOW} {joint + 1}"] = (above < 0) | (above > high - low)
    return graph.without(outside) if outside else graph
