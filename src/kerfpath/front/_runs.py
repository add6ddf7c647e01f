"""What a run of the planner is asked for: the first runs, and the plain grid of weights."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TypedDict, get_args

import numpy as np

from kerfpath._arrays import Array, Bools, freeze
from kerfpath._told import told
from kerfpath.cell import Cell
from kerfpath.front._clearance import roomier
from kerfpath.front._criteria import Criterion
from kerfpath.graph import LayeredGraph
from kerfpath.losses import Loss, Reason
from kerfpath.options import PlanOptions
from kerfpath.search import Metric, ObjectiveKind, Relaxations

__all__ = ["Run", "RunData", "anchors", "grid", "in_window", "quicker", "whole", "within"]

FAINT = 1e-6
"""Weight of the other joints where one joint counts: they decide between equals, or as good as."""
LEVELS = (0.25, 4.0)
"""Multiples of the weight of one joint at a time, in the grid."""
ROUNDING = 1e-9
"""Share by which limits are wider than what was found to need them."""
SHARES = (1.0, 0.9, 0.8)
"""Multiples of eta in the grid."""


class RunData(TypedDict):
    """A run as JSON holds it; null where a joint has no window."""

    objective: ObjectiveKind
    metric: Metric
    weights: list[float]
    eta_v: float
    eta_a: float
    window: list[list[float] | None]
    clearance: float


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
    clearance : float m
        What robot and head are to keep from what stands around beyond the near-miss distance.
    """

    objective: ObjectiveKind
    metric: Metric
    weights: Array
    eta_v: float
    eta_a: float
    window: Array
    clearance: float = 0.0

    __repr__ = told

    def applied_to(self, options: PlanOptions) -> PlanOptions:
        """Return the options with what this run asks for in their place."""
        return replace(
            options,
            objective=self.objective,
            metric=self.metric,
            weights=self.weights,
            eta_v=self.eta_v,
            eta_a=self.eta_a,
        )

    def graph(self, graph: LayeredGraph, endless: Bools) -> LayeredGraph:
        """Return the layered graph of a task without what is outside the window."""
        return within(graph, self.window, endless)

    def cell(self, cell: Cell | None) -> Cell | None:
        """Return the cell in which the clearance is kept."""
        if cell is None or not self.clearance:
            return cell
        return roomier(cell, self.clearance)

    def data(self) -> RunData:
        """Return it as plain JSON data; `of_data` gives the very same run back."""
        return {
            "objective": self.objective,
            "metric": self.metric,
            "weights": self.weights.tolist(),
            "eta_v": self.eta_v,
            "eta_a": self.eta_a,
            "window": [p if np.isfinite(p).all() else None for p in self.window.tolist()],
            "clearance": self.clearance,
        }

    @classmethod
    def of_data(cls, data: RunData) -> Run:
        """Return the run that `data` was made of."""
        free = [-np.inf, np.inf]
        window = [free if pair is None else pair for pair in data["window"]]
        weights = freeze(np.array(data["weights"], dtype=np.float64))
        return cls(
            objective=data["objective"],
            metric=data["metric"],
            weights=weights,
            eta_v=data["eta_v"],
            eta_a=data["eta_a"],
            window=freeze(np.array(window)),
            clearance=data["clearance"],
        )


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


def anchors(
    first: Run, criteria: Sequence[Criterion], least: Relaxations | None, dt: float
) -> list[Run]:
    """Return a run for the best of each criterion but the displacement of all joints.

    For the displacement and the increment of a joint, peak velocity, peak acceleration and speed it
    is the best on the graph; for a range it is only where to begin, and for the others there is
    none. `least` is what acceleration and speed need, at the node interval `dt` s.
    """
    found = []
    for criterion in criteria:
        kind, weights = criterion.kind, first.weights
        if criterion.joint is not None:
            weights = FAINT * weights
            weights[criterion.joint] = first.weights[criterion.joint]
        if kind in ("velocity", "increment"):
            found.append(
                replace(first, objective="max", metric="chebychev", weights=freeze(weights))
            )
        elif criterion.joint is not None:
            found.append(replace(first, weights=freeze(weights)))
        elif kind == "range":
            found.append(replace(first, metric="euclid"))
        elif kind == "acceleration" and least is not None and least.eta_a is not None:
            found.append(replace(first, eta_a=least.eta_a * (1 + ROUNDING)))
        elif kind == "speed" and least is not None:
            found.append(quicker(first, dt / least.slower.dt * (1 - ROUNDING)))
    return found


def quicker(run: Run, factor: float) -> Run:
    """Return the run whose plans keep the limits at `factor` times the speed, too."""
    return replace(run, eta_v=run.eta_v / factor, eta_a=run.eta_a / factor**2)


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
        inside = in_window(graph.q[:, joint], low, high - low, endless=bool(endless[joint]))
        outside[Reason(Loss.WINDOW, joint + 1)] = ~inside
    return graph.without(outside) if outside else graph


def in_window(q: Array, low: float, width: float, *, endless: bool) -> Bools:
    """Return which values (N,) of a joint are in a window, modulo 2 pi where it is endless."""
    above = (q - low) % (2 * np.pi) if endless else q - low
    return np.asarray((above >= 0) & (above <= width))
