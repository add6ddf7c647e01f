"""Results about a plan: its proof, its feed reduction, and its criteria."""

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
        Whether it is proved that no path on its graph is better.
    statement : str
        The claim in words.
    grid_cost : float or None
        Of a refined plan: the cost of the path on the graph that it was refined from, if that path
        keeps all limits.
    bound : float or None
        No motion that keeps (5) and (6) at the nodes costs less, at any gamma, posture and turn;
        None if no such bound is proved.
    gap : float or None
        Largest possible distance of the plan from the best motion: (cost - bound) / cost.
    certificate : Certificate or None
        Proof of the bound, see `kerfpath.certificate`.
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
        """The bound in words, as in `statement`; "" if there is none."""
        if self.bound is None:
            return ""
        return (
            f"no motion within the limits costs less than {self.bound_shown}, {self.gap_shown} % "
            "below this plan, at any gamma, posture and turn"
        )

    def without_bound(self) -> Proof:
        """Return the proof without bound, gap and certificate, which hold for this motion only."""
        rest = [part for part in self.statement.split("; ") if part != self.bound_claim]
        return replace(self, statement="; ".join(rest), bound=None, gap=None, certificate=None)

    @property
    def bound_shown(self) -> str:
        """The bound with two decimals, rounded down; "-" if there is none."""
        return "-" if self.bound is None else f"{math.floor(self.bound * 100) / 100:.2f}"

    @property
    def gap_shown(self) -> str:
        """The gap in per cent with two decimals, rounded up; "-" if there is none."""
        return "-" if self.gap is None else f"{max(math.ceil(self.gap * 1e4), 0) / 100:.2f}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Feed:
    """Feed reduction of a retimed path: its extent, its slowest interval, and the limit there.

    Parameters
    ----------
    full : float
        Share of the path length at the commanded speed.
    slowest : float
        Speed of the slowest interval as a share of the commanded speed; 1 if none is slowed.
    node : int
        Node from which the slowest interval starts; -1 if none is slowed.
    joint : int
        Joint that is nearest to its limit in that interval or at its ends, 0-based; -1 for none.
    limit : {"velocity", "acceleration"} or None
        That limit; None if no interval is slowed.
    """

    full: float
    slowest: float
    node: int
    joint: int
    limit: Literal["velocity", "acceleration"] | None

    def __str__(self) -> str:
        """Return it as one line of text."""
        if self.limit is None:
            return "full speed throughout"
        return (
            f"full speed on {self.full:.1%} of the length; lowest speed {self.slowest:.1%} of it "
            f"from node {self.node} on, where the {self.limit} of joint {self.joint + 1} binds"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Criteria:
    """Smoothness criteria of a plan, joint by joint, and its least measures of comfort.

    Parameters
    ----------
    displacement : (n,) rad, a rail: m
        Total displacement (7).
    largest_increment : (n,) rad, a rail: m
        Largest increment between nodes (8).
    range : (n,) rad, a rail: m
        Coordinate range (9).
    peak_velocity, peak_acceleration : (n,) share of the limit
        Largest finite difference over the joint's limit, before eta.
    nearest : mapping of str to (float, int)
        The least value of each measure of `kerfpath.comfort`, in its unit, and its node.
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
    """Return the objective (14) or (15), node costs included.

    Parameters
    ----------
    dq : (K-1, n) rad
        Joint increments.
    weights : (n,) 1/rad
    metric_name : {"manhattan", "chebychev", "euclid"}
    objective : {"sum", "max"}
    node_cost : (K,), optional
        Cost of each node.
    """
    total = metric.total_distance if objective == "sum" else metric.maximum_distance
    cost = float(total(np.ascontiguousarray(dq), weights, METRIC_CODES[metric_name]))
    if node_cost is None:
        return cost
    return cost + float(node_cost.sum()) if objective == "sum" else max(cost, *node_cost.tolist())
