"""The certificate of a plan: a proof that no motion along its contour costs less than a bound.

At each node every motion passes through one of the cells of a stage: an interval of gamma in one
posture and on one turn of each joint. A stage defines a function on its cells, the potential

    V(q) = max over m of  level_m - dual_m . (q - q_0),        m = 0, 1,

where q_0 are the joints at the middle of the cell. With any potential, a motion q_0, q_1, .. costs
at least V(q_0) plus, for each of its steps, the least of rho(q_{k+1} - q_k) + V(q_{k+1}) - V(q_k)
over the two cells of the step (the sum telescopes). So the shortest path through the cells with
these reduced costs is a lower bound. A checker computes the enclosures of the joints, and from them
the reduced costs, by itself; a wrong potential makes the bound weaker, not untrue.

The layers of a stage are the nodes of its cells; it need not have all nodes. A step from
node k to node k' > k + 1 spans k' - k intervals: its velocity bound is that many times the one of
(5), and rho of the step is no more than the sum over its intervals. In such a step an endless joint
may turn further than the short way: if another representative of the difference is within reach,
either counts.

A stage may have multipliers nu of (6), which tilt the cost of a step (see `Stage`). Cells through
which every motion costs more than the plan drop out, and the next stage covers those that remain.

What the stages leave may be divided into branches, again and again: at a node into the cells in one
posture and all others, or into those on either side of a value of gamma. Each motion passes a cell
of that node, so that it is in one of the two. A branch is bounded by stages of its own, and by
vectors y of the increments and nu of (6). With q_k on one interval of gamma in one posture, a
motion costs at least the sum of the least of (y_{k-1} - y_k) . q_k over these intervals, of the
least of rho(u) + (nu_k - nu_{k+1} - y_k) . u over the increments that (5) allows, and of
-|nu_k| . A. If that is above 0 without rho, the branch has no motion. The bound is the least of all
branches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kerfpath.arrays import Array, not_negative, scalar, short_repr
from kerfpath.errors import InputError
from kerfpath.setting import Settings, documented, setting

__all__ = [
    "ALLOWANCE",
    "BASE",
    "LEAST_GAP",
    "LIFTS",
    "USUAL",
    "Branch",
    "Certificate",
    "Certify",
    "Stage",
    "allowance",
    "cell_bounds",
]

BASE = 72
"""Number of cells of the circle of gamma at level 0; each level halves them."""
LIFTS = 8
"""Parts of pi in which the position of a joint is stored, to distinguish its turns."""
ALLOWANCE = 2e-4
"""Share of the plan's cost by which the stated bound is below the computed one, because a checker's
enclosure of the same joints may be a little wider."""
LEAST_GAP = 2e-5
"""Smallest gap that the certifier tries to reach; below it, rounding and the tolerance of the
program that gives the multipliers decide."""


def allowance(gap: float, *, checkable: bool) -> float:
    """Return the share of the cost by which the stated bound is below the computed one.

    Where nobody checks the bound it is at most half of the gap asked for.
    """
    return ALLOWANCE if checkable else min(ALLOWANCE, gap / 2)


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Certify(Settings):
    """How plans are certified: the gap to reach, and the time for it.

    Raises
    ------
    InputError
        A gap below 0 or over 1, or a time that is not positive.
    """

    gap: float = setting(
        0.5,
        "gap at which the certifier stops: the share of the plan's cost between bound and cost; 0: "
        "the smallest that it can prove, 0.002 % of the cost",
        unit="%",
        least=0,
        most=100,
        example="0.5",
        key="certify_gap_percent",
        group="Bound",
        label="Required gap",
        concerns="proof",
    )
    seconds: float | None = setting(
        None,
        "time to spend on each plan; none: only the certifier's own limit on its work, so that "
        "the same task has the same bound on every machine",
        unit="s",
        above=0,
        example="10",
        key="certify_seconds",
        data="seconds",
        group="Bound",
        label="Time limit",
        concerns="proof",
    )
    keep: bool = setting(
        False,
        "whether plan.json contains the certificate, for others to check; it always has the bound",
        example="false",
        key="certificate",
        concerns="proof",
    )

    def __post_init__(self) -> None:
        gap = not_negative(self.gap, "certify gap")
        if gap > 1:
            raise InputError(f"certify gap: expected a share of the cost up to 1, got {gap:g}")
        object.__setattr__(self, "gap", gap)
        if self.seconds is not None:
            seconds = scalar(self.seconds, "certify seconds", unit="s", above=0.0)
            object.__setattr__(self, "seconds", seconds)
        if not isinstance(self.keep, bool):
            raise InputError(f"certify keep: expected True or False, got {self.keep!r}")


USUAL = Certify()
"""How plans are certified by default."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stage:
    """Cells and a potential on them.

    Parameters
    ----------
    node : (C,) int32
        Node of each cell; ascending. The nodes that occur are the layers.
    posture : (C,) int8
    level : (C,) int8
        How often a cell of the coarsest grid (`BASE`) was halved.
    index : (C,) int32
        Position on the circle: gamma from -pi + width index to -pi + width (index + 1), with width
        2 pi / (`BASE` 2^level).
    lift : (C, n) int8
        Approximate joints in units of pi / `LIFTS`, which identify the turn of each joint: its
        enclosure is moved by whole turns until the middle is nearest to this value.
    value : (C, 2) float64
        The levels of the potential, in units of cost.
    dual : (C, 2, n) float32
        Its slopes, 1/rad times cost.
    multipliers : (K, n) float64, optional
        nu at each node, zero at the first and the last. They add to the cost of a motion
        nu_k . (u_k - u_{k-1}) - |nu_k| . A, which is never above zero where (6) holds; u_k is the
        increment from node k to k + 1, A the bound of (6) on its change. Only if there are cells
        at all nodes.
    """

    node: NDArray[np.int32]
    posture: NDArray[np.int8]
    level: NDArray[np.int8]
    index: NDArray[np.int32]
    lift: NDArray[np.int8]
    value: Array
    dual: NDArray[np.float32]
    multipliers: Array | None = None

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Branch:
    """A part of the motions that the stages of a certificate leave.

    Parameters
    ----------
    stages : tuple of Stage
        They bound its motions, each those that the one before leaves.
    y : (K-1, n) float64, optional
        Prices of the increments.
    multipliers : (K, n) float64, optional
        nu at each node, zero at the first and the last; as y only where both are given.
    node : int
        Node at which the branch is divided in two, which follow it in the certificate, the first
        with all its branches; -1: it is not divided.
    posture : int
        The first has the cells of the node in this posture, the second all others; -1: they are
        told apart by gamma.
    gamma : float rad
        The first has the cells whose middle is at most half a turn below it, or at it.
    """

    stages: tuple[Stage, ...]
    y: Array | None = None
    multipliers: Array | None = None
    node: int = -1
    posture: int = -1
    gamma: float = 0.0

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Certificate:
    """Proof of a lower bound on the cost of every motion along a contour.

    Parameters
    ----------
    bound : float
        The bound as stated: `ALLOWANCE` times the plan's cost below the computed one.
    stages : tuple of Stage
        The first covers all motions, each further one those that the stage before leaves.
    branches : tuple of Branch
        Parts of the motions that the last stage leaves, the first one all of them; none: they are
        not divided.
    """

    bound: float
    stages: tuple[Stage, ...]
    branches: tuple[Branch, ...] = ()

    __repr__ = short_repr


def cell_bounds(level: NDArray[np.int8], index: NDArray[np.int32]) -> tuple[Array, Array]:
    """Return the middle and half the width of cells, (C,) rad each.

    The half width is a few roundings too large, so that neighbouring cells overlap.

    Parameters
    ----------
    level, index : (C,)
        As in `Stage`.
    """
    width = 2 * np.pi / (BASE * np.exp2(level.astype(float)))
    return -np.pi + width * (index + 0.5), width / 2 + 1e-15 * np.pi
