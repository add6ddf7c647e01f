"""What is said of a plan: what is proved, where its speed is reduced, and its criteria."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from kerfpath._arrays import Array
from kerfpath._repr import short_repr
from kerfpath.certificate import Certificate
from kerfpath.kernels import metric
from kerfpath.search import METRIC_CODES, Metric, ObjectiveKind

__all__ = ["Criteria", "Feed", "Proof", "path_cost"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof:
    """What is proved about a plan.

    Parameters
    ----------
    optimal : bool
        No path on its graph is better.
    statement : str
        The claim in words.
    grid_cost : float or None
        Where the plan is refined: the cost of the path on the graph that it was refined from, if
        that keeps all limits.
    bound : float or None
        No motion that keeps (5) and (6) at the nodes costs less, at any gamma, posture and turn;
        None where nothing of the kind is proved.
    gap : float or None
        How far the plan may be from the best motion: (cost - bound) / cost.
    certificate : Certificate or None
        What proves the bound, see `kerfpath.certificate`.
    """

    optimal: bool
    statement: str
    grid_cost: float | None = None
    bound: float | None = None
    gap: float | None = None
    certificate: Certificate | None = None

    __repr__ = short_repr

    @property
    def bound_claim(self) -> str:
        """The bound in words, as the statement has it; "" where there is none."""
        if self.bound is None:
            return ""
        return (
            f"no motion within the limits costs less than {self.bound_shown}, {self.gap_shown} % "
            "below this plan, at any gamma, posture and turn"
        )

    def without_bound(self) -> Proof:
        """Return what it says beside its bound: of another motion the bound and its gap do not."""
        rest = [part for part in self.statement.split("; ") if part != self.bound_claim]
        return replace(self, statement="; ".join(rest), bound=None, gap=None, certificate=None)

    @property
    def bound_shown(self) -> str:
        """The bound to two places, never more than it is; "-" where there is none."""
        return "-" if self.bound is None else f"{math.floor(self.bound * 100) / 100:.2f}"

    @property
    def gap_shown(self) -> str:
        """The gap in per cent to two places, never less than it is; "-" where there is none."""
        return "-" if self.gap is None else f"{max(math.ceil(self.gap * 1e4), 0) / 100:.2f}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Feed:
    """Where a retimed path keeps the commanded speed, where it is slowest, and what binds there.

    Parameters
    ----------
    full : float
        Share of the path length at the commanded speed.
    slowest : float
        Speed of the slowest interval as a share of the commanded speed; 1 where none is slowed.
    node : int
        The node that the slowest interval starts from; -1 where none is slowed.
    joint : int
        The joint nearest to its limit in that interval or at its ends, 0-based; -1 for none.
    limit : {"velocity", "acceleration"} or None
        Which limit that is.
    """

    full: float
    slowest: float
    node: int
    joint: int
    limit: Literal["velocity", "acceleration"] | None

    def __str__(self) -> str:
        """Say it in one line."""
        if self.limit is None:
            return "full speed throughout"
        return (
            f"full speed on {self.full:.1%} of the length; slowest, {self.slowest:.1%} of it, from "
            f"node {self.node} on, where the {self.limit} of joint {self.joint + 1} binds"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Criteria:
    """Smoothness of a plan, joint by joint, each (n,), and what it comes near to.

    In rad and rad/s; for a rail in m and m/s.

    Parameters
    ----------
    displacement : rad
        Total displacement (7).
    largest_increment : rad
        Largest increment between nodes (8).
    range : rad
        Coordinate range (9).
    peak_velocity, peak_acceleration : share of the limit
        Largest finite difference over the joint's limit, before eta.
    nearest : mapping of str to (float, int)
        The least of each measure of `kerfpath.comfort`, in its unit, and the node it stands at.
    """

    displacement: Array
    largest_increment: Array
    range: Array
    peak_velocity: Array
    peak_acceleration: Array
    nearest: Mapping[str, tuple[float, int]]

    __repr__ = short_repr


def path_cost(
    dq: Array,
    weights: Array,
    metric_name: Metric,
    objective: ObjectiveKind,
    node_cost: Array | None = None,
) -> float:
    """Return the objective (14) or (15) of joint increments (K-1, n) rad, with the nodes' costs."""
    total = metric.total_distance if objective == "sum" else metric.maximum_distance
    cost = float(total(np.ascontiguousarray(dq), weights, METRIC_CODES[metric_name]))
    if node_cost is None:
        return cost
    return cost + float(node_cost.sum()) if objective == "sum" else max(cost, *node_cost.tolist())
