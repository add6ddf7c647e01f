"""Samples of gamma that follow the joints of every posture: close together where these swing.

Near a singularity a joint may turn half a circle within a hundredth of a degree of gamma, and a
grid of gamma misses it. Here an interval of gamma is halved while the joints of a posture leave the
straight line between its ends by much of the step that (5) allows, or turn far.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, freeze
from kerfpath.kernels.metric import increments_between, wrap
from kerfpath.refiner.joint_curves import JointCurves
from kerfpath.robots import Robot
from kerfpath.search import Branches

INTERVALS = 90
"""Intervals of gamma before any is halved: 4 degrees."""
SAG, TURN = 0.1, 0.15
"""An interval is halved if a joint leaves the straight line by more than this share of the step
that (5) allows, or turns by more, rad."""
HALVINGS, TO_EDGES = 12, 7
"""Most halvings of an interval, to 0.001 degrees, and of one in which a branch ends, to 0.03."""
HUMP, NEAR_REACH = 0.04, 0.15
"""rad: an interval without a branch at its ends is halved if at one of them each joint is this near
its range: inside the interval it may be in the range, for a way that falls with the square of the
width, or where the arm is out of reach at the other end."""
WIDEST = 0.6
"""rad: neighbouring samples are joined if no joint moves further between them."""
EDGE = 1e-9
"""rad: slack of the ranges of joints, for rounding."""


class _Intervals(NamedTuple):
    """Intervals of gamma of one node and posture, with the joints at their ends where admitted."""

    node: Ints
    posture: Ints
    low: Array
    high: Array
    at_low: Bools
    at_high: Bools
    q_low: Array
    q_high: Array

    def of(self, which: Bools) -> _Intervals:
        return _Intervals._make(part[which] for part in self)


def sample_branches(
    robot: Robot, frames: Array, tool: Array, step: Array, postures: Sequence[int] | None = None
) -> Branches:
    """Return samples of the branches of all nodes.

    Parameters
    ----------
    robot : Robot
        An arm with a free rotation and without free joints.
    frames : (K, 4, 4) m
        Task frames in the robot base.
    tool : (4, 4) m
        Tip frame in the flange.
    step : (n,) rad
        Largest increment of each joint from node to node.
    postures : sequence of int, optional
        Postures that may be used; default: all.
    """
    arm = _Arm(robot, frames, tool, postures)
    gamma = freeze(2 * np.pi * np.arange(INTERVALS) / INTERVALS - np.pi)
    q, admitted = arm.on_grid(gamma)
    node, number, posture = (part.ravel() for part in np.indices(admitted.shape))
    after = (number + 1) % INTERVALS
    low = gamma[number]
    intervals = _Intervals(
        node, posture, low, low + 2 * np.pi / INTERVALS,
        admitted[node, number, posture], admitted[node, after, posture],
        q[node, number, posture], q[node, after, posture],
    )  # fmt: skip
    here = intervals.at_low
    parts = [(node[here], posture[here], low[here], intervals.q_low[here])]
    for halved in range(HALVINGS):
        ends = intervals.at_low | intervals.at_high
        intervals = intervals.of(ends | arm.may_pass(intervals, HUMP / 4**halved))
        middle = (intervals.low + intervals.high) / 2
        at, admitted = arm.solve(intervals.node, middle, intervals.posture)
        split = arm.coarse(intervals, at, admitted, step)
        if halved >= TO_EDGES:
            split &= intervals.at_low & intervals.at_high
        if not split.any():
            break
        intervals, middle, at, admitted = (
            intervals.of(split), middle[split], at[split], admitted[split],
        )  # fmt: skip
        parts.append(
            (intervals.node[admitted], intervals.posture[admitted], middle[admitted], at[admitted])
        )
        below = intervals._replace(high=middle, at_high=admitted, q_high=at)
        above = intervals._replace(low=middle, at_low=admitted, q_low=at)
        intervals = _Intervals._make(
            np.concatenate(ends) for ends in zip(below, above, strict=True)
        )
    node, posture, angle, q = (np.concatenate(part) for part in zip(*parts, strict=True))
    return _joined(node, posture, wrap(angle), q, arm.endless, len(frames))


class _Arm:
    """The joints of an arm at the nodes, within their ranges."""

    def __init__(
        self, robot: Robot, frames: Array, tool: Array, postures: Sequence[int] | None
    ) -> None:
        self._robot, self._tool = robot, tool
        self._frames = freeze(np.array(frames, order="C"))
        self._limits = robot.joint_limits()
        wide = self._limits.upper - self._limits.lower > 2 * np.pi + EDGE
        self.endless = np.asarray(robot.endless | wide)
        self._wanted = np.isin(
            np.arange(robot.postures), range(robot.postures) if postures is None else postures
        )

    def on_grid(self, gamma: Array) -> tuple[Array, Bools]:
        """Return joints (K, m, P, n) at every gamma (m,), and which are admitted, (K, m, P)."""
        q, reach = self._robot.arm.inverse_nodes(self._frames, gamma, self._tool)
        reach = reach & self._wanted
        return self._within(np.where(reach[..., None], q, np.nan), reach)

    def solve(self, node: Ints, gamma: Array, posture: Ints) -> tuple[Array, Bools]:
        """Return joints (B, n) of nodes at gamma in postures (B,), and which are admitted, (B,)."""
        curves = JointCurves(self._robot, self._frames[node], self._tool, posture)
        q = curves.at(gamma[:, None], np.zeros((len(gamma), self._robot.joints)))
        return self._within(q, np.asarray(np.isfinite(q).all(axis=1)))

    def _within(self, q: Array, reach: Bools) -> tuple[Array, Bools]:
        """Bring joints in (-pi, pi] onto a turn inside their range; return where there is one."""
        limits, bounded = self._limits, ~self._limits.endless
        low, high = limits.lower - EDGE, limits.upper + EDGE
        inside = (q >= low) & (q <= high)
        up = q + 2 * np.pi * np.ceil((low - q) / (2 * np.pi))
        q = np.where(bounded & ~inside, up, q)
        admitted = reach & ((q <= high) | ~bounded).all(axis=-1)
        for row, least, most in zip(limits.rows, limits.row_lower, limits.row_upper, strict=True):
            if not (self.endless & (row != 0)).any():
                value = q @ row
                admitted &= (value >= least - EDGE) & (value <= most + EDGE)
        return q, np.asarray(admitted)

    def may_pass(self, intervals: _Intervals, hump: float) -> Bools:
        """Return in which intervals (B,) there may be a branch that ends inside on both sides.

        The range of one joint may end the branch on one side, that of another joint on the other.
        """
        low, high = self._outside(intervals.q_low), self._outside(intervals.q_high)
        nearer = np.fmin(low, high).max(axis=1, initial=0.0)
        most = np.where(np.isfinite(low + high).all(axis=1), hump, NEAR_REACH)
        return np.asarray(nearer <= most)

    def _outside(self, q: Array) -> Array:
        """Return how far joints (B, n) and couplings are out of their ranges; NaN if no joints."""
        limits = self._limits
        beyond = np.minimum(q - limits.upper, limits.lower + 2 * np.pi - q)
        beyond = np.where(limits.endless & np.isfinite(q), 0.0, np.maximum(beyond, 0.0))
        value = q @ limits.rows.T
        apart = np.maximum(limits.row_lower - value, value - limits.row_upper)
        apart[:, (self.endless & (limits.rows != 0)).any(axis=1)] = 0.0
        return np.hstack([beyond, np.maximum(apart, 0.0)])

    def coarse(self, intervals: _Intervals, at: Array, admitted: Bools, step: Array) -> Bools:
        """Return which intervals (B,) are to be halved, from the joints in their middle (B, n)."""
        across = increments_between(intervals.q_low, intervals.q_high, self.endless)
        sag = increments_between(intervals.q_low, at, self.endless) - across / 2
        both = intervals.at_low & intervals.at_high
        with np.errstate(invalid="ignore"):  # joints out of reach
            far = (np.abs(across) > TURN).any(axis=1) | (np.abs(sag) > SAG * step).any(axis=1)
        return np.asarray(np.where(both, far | ~admitted, True))


def _joined(
    node: Ints, posture: Ints, gamma: Array, q: Array, endless: Bools, nodes: int
) -> Branches:
    """Return samples in order, each joined with the next one in gamma on its branch."""
    order = np.lexsort((gamma, posture, node))
    node, posture, gamma = node[order], posture[order], gamma[order]
    q = np.ascontiguousarray(q[order])
    each = np.arange(len(node))
    new = np.ones(len(node), np.bool_)
    new[1:] = (node[1:] != node[:-1]) | (posture[1:] != posture[:-1])
    first = np.flatnonzero(new)
    last = np.append(first[1:], len(node))[: len(first)] - 1
    after = each + 1
    after[last] = first
    near = np.mod(gamma[after] - gamma, 2 * np.pi) < (2 * np.pi + EDGE) / INTERVALS + EDGE
    near &= np.abs(increments_between(q, q[after], endless)).max(axis=1, initial=0.0) <= WIDEST
    near &= after != each
    joined = near.copy()
    joined[after[near]] = True
    one = np.concatenate([each[near], each[~joined]])
    other = np.concatenate([after[near], each[~joined]])
    by_node = np.argsort(node[one], kind="stable")
    one, other = one[by_node], other[by_node]
    ends = np.arange(nodes + 1)
    return Branches(
        start=freeze(np.searchsorted(node, ends)),
        gamma=gamma,
        posture=posture,
        q=freeze(q),
        endless=freeze(endless),
        one=one,
        other=other,
        begin=np.searchsorted(node[one], ends),
    )
