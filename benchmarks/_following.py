"""The joint motion of a course of gamma, to compare planners that search gamma.

From each posture of the first node a motion takes, at every next node, the nearest of the poses
that the joint limits admit; the best of these motions counts. Joint angles are in (-pi, pi], which
suffices if the joints with more than one turn are endless.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi, sin
from typing import NamedTuple, ParamSpec, TypeVar

import numba
import numpy as np

from benchmarks._random_contours import Cut
from kerfpath.arrays import Array, Bools, Ints
from kerfpath.kernels.frames import location
from kerfpath.kernels.kinematics import EVERY, POSTURES, OpwArm, inverse
from kerfpath.kernels.turns import JointLimits

__all__ = ["Followed", "Follower", "Task", "edge_cost"]

_P = ParamSpec("_P")
_R = TypeVar("_R")

SLACK = 1e-9
"""Slack on the bounds (5) and (6), rad, as in kerfpath."""


class Task(NamedTuple):
    """The data of a cut that the compiled functions need."""

    arm: OpwArm
    limits: JointLimits
    H: Array
    T_tip_flange: Array
    bound_v: Array
    bound_a: Array
    weight: Array


def _jit(function: Callable[_P, _R]) -> Callable[_P, _R]:
    compiled: Callable[_P, _R] = numba.njit(nogil=True)(function)
    return compiled


@_jit
def poses(task: Task, H: Array, gamma: float, out_q: Array, out_ok: Bools) -> None:
    """All postures (8, 6) of one tip pose, and which of them the joint limits admit."""
    L, T = np.zeros((4, 4)), np.zeros((4, 4))
    location(H, cos(gamma), sin(gamma), L)
    for r in range(3):
        for c in range(4):
            for i in range(3):
                T[r, c] += L[r, i] * task.T_tip_flange[i, c]
        T[r, 3] += L[r, 3]
    inverse(task.arm, T, EVERY, out_q, out_ok)
    limits = task.limits
    for mu in range(POSTURES):
        for i in range(6):
            free = limits.endless[i]
            inside = limits.lower[i] <= out_q[mu, i] <= limits.upper[i]
            out_ok[mu] &= free or inside
        for r in range(len(limits.rows)):
            coupled = 0.0
            for i in range(6):
                coupled += limits.rows[r, i] * out_q[mu, i]
            out_ok[mu] &= limits.row_lower[r] <= coupled <= limits.row_upper[r]


@_jit
def increment(task: Task, i: int, a: float, b: float) -> float:
    """Return the step of a joint from a to b (Eq. 13 on endless joints)."""
    step = b - a
    if task.limits.endless[i]:
        step -= 2 * pi * np.round(step / (2 * pi))
    return step


@_jit
def nearest(task: Task, q: Array, to: Array, ok: Bools) -> int:
    """Return the admitted posture nearest to q in the weighted Manhattan metric, -1 if none."""
    best, found = np.inf, -1
    for mu in range(POSTURES):
        if ok[mu]:
            rho = 0.0
            for i in range(6):
                rho += task.weight[i] * abs(increment(task, i, q[i], to[mu, i]))
            if rho < best:
                best, found = rho, mu
    return found


@_jit
def _weigh(task: Task, q: Array) -> tuple[float, float]:
    """Return the cost (14) of a motion q (K, 6) and by how much it breaks (5) and (6)."""
    cost = excess = 0.0
    for i in range(6):
        before = 0.0
        for k in range(1, len(q)):
            step = increment(task, i, q[k - 1, i], q[k, i])
            cost += task.weight[i] * abs(step)
            over = abs(step) - task.bound_v[i]
            excess += over / task.bound_v[i] if over > SLACK else 0.0
            if k > 1:
                over = abs(step - before) - task.bound_a[i]
                excess += over / task.bound_a[i] if over > SLACK else 0.0
            before = step
    return cost, excess


@_jit
def _follow(
    task: Task, gamma: Array, out_cost: Array, out_excess: Array, out_q: Array, out_posture: Ints
) -> None:
    nodes = gamma.shape[1]
    q, ok = np.empty((nodes, POSTURES, 6)), np.empty((nodes, POSTURES), np.bool_)
    motion, taken = np.empty((nodes, 6)), np.empty(nodes, np.int64)
    for p in range(len(gamma)):
        for k in range(nodes):
            poses(task, task.H[k], gamma[p, k], q[k], ok[k])
        out_cost[p] = out_excess[p] = np.inf
        for first in range(POSTURES):
            if not ok[0, first]:
                continue
            lost, taken[0] = 0.0, first
            motion[0] = q[0, first]
            for k in range(1, nodes):
                mu = nearest(task, motion[k - 1], q[k], ok[k])
                lost += 1e3 if mu < 0 else 0.0
                taken[k] = mu
                motion[k] = q[k, mu] if mu >= 0 else motion[k - 1]
            cost, excess = _weigh(task, motion)
            excess += lost
            if excess < out_excess[p] or (excess == out_excess[p] and cost < out_cost[p]):
                out_cost[p], out_excess[p] = cost, excess
                out_q[p], out_posture[p] = motion, taken


@_jit
def edge_cost(task: Task, mu: int, k0: int, gamma0: float, k1: int, gamma1: float) -> float:
    """Return the cost of gamma changing evenly from node k0 to k1 in one posture.

    It is infinite if k1 is not after k0, or if the motion leaves the joint limits or breaks (5).
    """
    if k1 <= k0:
        return np.inf
    q, ok = np.empty((2, POSTURES, 6)), np.empty((2, POSTURES), np.bool_)
    poses(task, task.H[k0], gamma0, q[0], ok[0])
    cost = 0.0 if ok[0, mu] else np.inf
    for k in range(k0 + 1, k1 + 1):
        now, before = (k - k0) % 2, (k - k0 + 1) % 2
        part = (k - k0) / (k1 - k0)
        poses(task, task.H[k], gamma0 + part * (gamma1 - gamma0), q[now], ok[now])
        if cost == np.inf or not ok[now, mu]:
            return np.inf
        for i in range(6):
            step = abs(increment(task, i, q[before, mu, i], q[now, mu, i]))
            if step > task.bound_v[i] + SLACK:
                return np.inf
            cost += task.weight[i] * step
    return cost


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Followed:
    """The motions of P courses of gamma.

    Parameters
    ----------
    cost : (P,)
        Objective (14), weights 1 / (velocity dt); inf if no pose of the first node is admitted.
    excess : (P,)
        Sum of the shares by which (5) and (6) are exceeded, and 1000 for each node without a pose;
        0 if the motion is feasible.
    q : (P, K, 6) rad
    posture : (P, K) int
    """

    cost: Array
    excess: Array
    q: Array
    posture: Ints


class Follower:
    """Turn courses of gamma into joint motions along one cut, and rate them."""

    def __init__(self, cut: Cut) -> None:
        velocity, acceleration = cut.robot.speed_limits()
        self.task = Task(
            arm=cut.robot.arm.model(),
            limits=cut.robot.joint_limits(),
            H=np.ascontiguousarray(cut.frames),
            T_tip_flange=np.asarray(np.linalg.inv(cut.tool), dtype=np.float64),
            bound_v=velocity * cut.dt,
            bound_a=acceleration * cut.dt**2,
            weight=1 / (velocity * cut.dt),
        )

    def follow(self, gamma: Array) -> Followed:
        """Return the motions of the courses gamma (P, K) rad."""
        P, K = gamma.shape
        cost, excess, q = np.empty(P), np.empty(P), np.zeros((P, K, 6))
        posture = np.full((P, K), -1)
        _follow(self.task, np.ascontiguousarray(gamma), cost, excess, q, posture)
        return Followed(cost=cost, excess=excess, q=q, posture=posture)

    def weigh(self, q: Array) -> tuple[float, bool]:
        """Return the cost (14) of a motion (K, 6) rad, and whether it keeps (5) and (6)."""
        cost, excess = _weigh(self.task, np.ascontiguousarray(q))
        return float(cost), excess == 0.0

    def admits_throughout(self, posture: int) -> bool:
        """Return whether every node has a pose in a posture, at one of 36 gammas at least."""
        gamma = np.linspace(-np.pi, np.pi, 36, endpoint=False)
        q, ok = np.empty((POSTURES, 6)), np.empty(POSTURES, np.bool_)

        def admits(H: Array, at: float) -> bool:
            poses(self.task, H, at, q, ok)
            return bool(ok[posture])

        return all(any(admits(H, at) for at in gamma) for H in self.task.H)
