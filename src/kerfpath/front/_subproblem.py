"""Subproblems: the settings of one run of the planner, and a plain grid of such settings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import NotRequired, TypedDict, get_args

import numpy as np

from kerfpath._arrays import Array, Bools, freeze
from kerfpath._repr import short_repr
from kerfpath.cell import Cell
from kerfpath.graph import LayeredGraph
from kerfpath.losses import Loss, Reason
from kerfpath.options import PlanOptions
from kerfpath.search import Metric, ObjectiveKind

__all__ = ["Subproblem", "SubproblemData", "counts_as_clearance", "grid", "is_in_window"]

LEVELS = (0.25, 4.0)
"""Factors on the weight of one joint at a time, in the grid."""
SHARES = (1.0, 0.9, 0.8)
"""Factors on eta in the grid."""


class SubproblemData(TypedDict):
    """A subproblem as JSON data; the window of a joint is null where it has none.

    A missing `continuous` means a run on the grid of gamma.
    """

    objective: ObjectiveKind
    metric: Metric
    weights: list[float]
    eta_v: float
    eta_a: float
    window: list[list[float] | None]
    clearance: float
    continuous: NotRequired[bool]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Subproblem:
    """The objective and the epsilon constraints of one run of the planner.

    Parameters
    ----------
    objective, metric, eta_v, eta_a
        As in `kerfpath.plan`.
    weights : (n,) 1/rad
        Weights of the joint-space distance.
    window : (n, 2) rad
        Range that each joint must stay in (modulo 2 pi where it is endless); infinite where the
        joint has no window.
    clearance : float m
        Clearance of robot and head from all other bodies, beyond the near-miss distance.
    continuous : bool
        Whether gamma is continuous instead of on its grid.
    """

    objective: ObjectiveKind
    metric: Metric
    weights: Array
    eta_v: float
    eta_a: float
    window: Array
    clearance: float = 0.0
    continuous: bool = False

    __repr__ = short_repr

    @classmethod
    def unbounded(cls, weights: Array, eta_v: float, eta_a: float) -> Subproblem:
        """Return the subproblem of least displacement with the full limits and no window."""
        return cls(
            objective="sum",
            metric="manhattan",
            weights=weights,
            eta_v=eta_v,
            eta_a=eta_a,
            window=freeze(np.tile([-np.inf, np.inf], (len(weights), 1))),
        )

    def applied_to(self, options: PlanOptions) -> PlanOptions:
        """Return the options with the settings of this subproblem."""
        return replace(
            options,
            method="continuous" if self.continuous else "exact",
            objective=self.objective,
            metric=self.metric,
            weights=self.weights,
            eta_v=self.eta_v,
            eta_a=self.eta_a,
        )

    def graph(self, graph: LayeredGraph, endless: Bools) -> LayeredGraph:
        """Return the layered graph without the vertices outside the windows, counted by joint."""
        outside = {}
        for joint in self.windowed(endless):
            low, high = self.window[joint]
            inside = is_in_window(graph.q[:, joint], low, high - low, endless=bool(endless[joint]))
            outside[Reason(Loss.WINDOW, joint + 1)] = ~inside
        return graph.without(outside) if outside else graph

    def windowed(self, endless: Bools) -> list[int]:
        """Return the joints with an effective window: finite, and below a turn where endless."""
        width = np.diff(self.window)[:, 0]
        said = np.isfinite(width) & ~(endless & (width >= 2 * np.pi))
        return [int(joint) for joint in np.flatnonzero(said)]

    def cell(self, cell: Cell | None) -> Cell | None:
        """Return the cell in which the clearance is kept beyond its near-miss distance."""
        if cell is None or not self.clearance:
            return cell
        names = [cell.pair_names[p] for p in np.flatnonzero(counts_as_clearance(cell))]
        asked = dict.fromkeys(names, cell.near_miss + self.clearance)
        return replace(cell, near_miss_of={**cell.near_miss_of, **asked})

    def quicker(self, factor: float) -> Subproblem:
        """Return the subproblem whose plans also keep the limits at `factor` times the speed."""
        return replace(self, eta_v=self.eta_v / factor, eta_a=self.eta_a / factor**2)

    def to_data(self) -> SubproblemData:
        """Return the subproblem as JSON data, from which `from_data` restores it exactly."""
        data: SubproblemData = {
            "objective": self.objective,
            "metric": self.metric,
            "weights": self.weights.tolist(),
            "eta_v": self.eta_v,
            "eta_a": self.eta_a,
            "window": [p if np.isfinite(p).all() else None for p in self.window.tolist()],
            "clearance": self.clearance,
        }
        return {**data, "continuous": True} if self.continuous else data

    @classmethod
    def from_data(cls, data: SubproblemData) -> Subproblem:
        """Return the subproblem that `to_data` wrote."""
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
            continuous=data.get("continuous", False),
        )


def grid(first: Subproblem, rng: np.random.Generator) -> Iterator[Subproblem]:
    """Yield a plain grid over objective, metric, weights and eta, in random order.

    Then yield it again with levels closer to those of the first run, and so on.
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


def is_in_window(q: Array, low: float, width: float, *, endless: bool) -> Bools:
    """Return which values (N,) of a joint are in a window, modulo 2 pi where it is endless."""
    above = (q - low) % (2 * np.pi) if endless else q - low
    return np.asarray((above >= 0) & (above <= width))


def counts_as_clearance(cell: Cell) -> Bools:
    """Return which judged pairs (P,) count: robot or head against other bodies of the cell.

    Pairs with their own near-miss distance, such as nozzle and part, are close by design, and links
    may be close to each other whatever the arm does.
    """
    moving = np.array([cell.bodies[b].kind in ("robot", "head") for b in cell.pairs.ravel()])
    one, two = moving.reshape(-1, 2).T
    return np.asarray((one != two) & ~cell.own, dtype=np.bool_)
