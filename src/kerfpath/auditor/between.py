"""Bound the joints between the samples of a straight move, by bisection.

On a straight move J(q) q' = V, the tool's twist per interval. If s is the least singular value of J
at a sample and J changes by at most L per radian of the joints, then within a step h of the
interval the joints stay within r of the sample, where L r^2 - s r + |V| h = 0. The least singular
value stays above s - L r, joint speeds stay below S = |V| / (s - L r), and their change per step
below Q h with Q = (L S^2 + |V'|) / (s - L r). Of seven joints, one runs evenly by x per interval:
then V is reduced by its share x J_x, J is the Jacobian of the others and also changes with this
joint, by L x, so V' grows by at most L x (S + x), and (S + x)^2 replaces S^2. A step is divided
until the excess that it can hide is negligible or cannot reach a limit. Lengths are in m, so 1 m
weighs as much as 1 rad.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.auditor.chain import JointChain
from kerfpath.auditor.motion import Motion, follow, joint_increments, straight
from kerfpath.options import Interpolation
from kerfpath.plans import Plan

HIDDEN_ANGLE = 1e-5
"""rad: by how much a joint may exceed its samples unnoticed."""
HIDDEN_SPEED = 1e-2
"""Share of its limit by which a joint may be faster than at the samples unnoticed."""
BY_FAR = 5.0
"""Multiple of a speed limit from which on a speed need not be known more exactly."""
DEEPEST = 14
"""Largest number of halvings of a part of an interval: to about 1e-5 of the interval."""
MOST = 60
"""Most samples per interval, averaged over a plan, in addition to the first ones and to 5000."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BetweenNodes:
    """Ranges and speeds of the joints between the nodes, found by bisection.

    Parameters
    ----------
    low, high : (K-1, n + c) rad
        Least and largest value of each joint, then of each coupling, in each interval.
    speed : (K-1, n) rad
        Largest speed of each joint in each interval, per interval.
    residual : (K-1,)
        Largest error of the straight move at the samples in between, m and rad.
    open : (K-1,) bool
        Whether the joints may exceed their samples: near a singularity, or where the number of
        samples ran out.
    """

    low: Array
    high: Array
    speed: Array
    residual: Array
    open: Bools


@dataclass(slots=True)
class _Steps:
    """Steps: interval, begin, length; joints, speeds and least singular values at both ends."""

    k: Ints
    f0: Array
    h: Array
    q0: Array
    q1: Array
    v0: Array
    v1: Array
    s0: Array
    s1: Array

    def rows(self, wanted: Bools) -> _Steps:
        return _Steps(*(getattr(self, name)[wanted] for name in self.__slots__))


def bound_between_nodes(
    plan: Plan, chain: JointChain, motion: Motion, interpolation: Interpolation
) -> BetweenNodes:
    """Return the ranges and speeds of the joints between the nodes of a plan.

    Parameters
    ----------
    plan : Plan
    chain : JointChain
        Chain of the robot, without the tool.
    motion : Motion
        Gives the first samples.
    interpolation : {"linear", "joint"}
        Interpolation of the motion; in even joint motions the ends are the extremes.
    """
    if interpolation == "joint":
        rows = np.vstack([np.eye(plan.q.shape[1]), *(c.row[None] for c in plan.robot.couplings)])
        values, none = motion.q @ rows.T, np.zeros(len(plan.q) - 1)
        low, high = values.min(axis=1), values.max(axis=1)
        speed = np.abs(motion.q[:, -1] - motion.q[:, 0])
        return BetweenNodes(low=low, high=high, speed=speed, residual=none, open=none > 0)
    chain = replace(chain, tip=chain.tip @ plan.T_flange_tip)
    task = _StraightMoves(plan, chain)
    parts = motion.q.shape[1] - 1
    K = len(plan.q) - 1
    k = np.repeat(np.arange(K), parts + 1)
    flat = motion.q.reshape(K * (parts + 1), -1)
    v, s = task.speeds(k, flat)
    shape = (K, parts + 1, -1)
    ends = [each.reshape(shape) for each in (flat, v, s[:, None])]
    (q0, q1), (v0, v1), (s0, s1) = (
        (e[:, :-1].reshape(K * parts, -1), e[:, 1:].reshape(K * parts, -1)) for e in ends
    )
    steps = _Steps(
        k=np.repeat(np.arange(K), parts),
        f0=np.tile(np.arange(parts) / parts, K),
        h=np.full(K * parts, 1 / parts),
        q0=q0, q1=q1, v0=v0, v1=v1, s0=s0[:, 0], s1=s1[:, 0],
    )  # fmt: skip
    values = motion.q @ task.rows.T
    low, high, residual = values.min(axis=1), values.max(axis=1), np.zeros(K)
    speed = task.fastest(steps).reshape(K, parts, -1).max(axis=1)
    left, count = np.zeros(K, bool), len(flat)
    for _ in range(DEEPEST):
        steps = steps.rows(~task.settled(steps))
        if not len(steps.k):
            break
        if count + len(steps.k) > len(flat) + MOST * K + 5000:
            break
        steps, missed = task.halved(steps)
        count += len(steps.k) // 2
        np.maximum.at(residual, steps.k[::2], missed)
        np.minimum.at(low, steps.k, steps.q0 @ task.rows.T)
        np.maximum.at(high, steps.k, steps.q0 @ task.rows.T)
        np.maximum.at(speed, steps.k, task.fastest(steps))
    else:
        steps = steps.rows(~task.settled(steps))
    left[steps.k] = True
    return BetweenNodes(low=low, high=high, speed=speed, residual=residual, open=left)


class _StraightMoves:
    """The straight moves of a plan, with the test whether a step of one is small enough."""

    def __init__(self, plan: Plan, chain: JointChain) -> None:
        self._chain, self._n = chain, len(chain.axes)
        self._poses = chain.forward(plan.q)
        R = self._poses[:, :3, :3]
        local = Rotation.from_matrix(R[:-1].transpose(0, 2, 1) @ R[1:]).as_rotvec()
        self._turn = np.einsum("kij,kj->ki", R[:-1], local)
        self._step = np.diff(self._poses[:, :3, 3], axis=0)
        dq = joint_increments(plan)
        self._x = dq[:, self._n :]
        self._own = np.arange(self._n)[np.arange(self._n) != chain.even]
        self._even = np.zeros(len(dq)) if chain.even is None else dq[:, chain.even]
        rate, reach = np.sqrt((self._step**2).sum(1) + (self._turn**2).sum(1)), _reaches(chain)
        rotary = np.array([axis.kind == "rotary" for axis in chain.externals], dtype=float)
        spun, slid = np.abs(self._x) @ rotary, np.abs(self._x) @ (1 - rotary)
        self._turned = spun * float(np.sqrt((reach**2 + 1.0).sum()))  # of the Jacobian
        far = _farthest(chain, self._poses[:, :3, 3], plan.q[:, self._n :])
        self._size = rate + slid + spun * far
        # Change of the twist per interval: the axis that it is measured about turns with it.
        still = self._n >= 6
        own = 0.0 if still else (self._turn**2).sum(1)
        self._change = own + spun * rate * (1.0 + reach[0]) + self._turned * self._size
        if len(chain.externals) > 1:  # one axis carries the other
            self._change = self._change + 2 * spun * (slid + spun * far)
        self._lipschitz = _lipschitz(reach) * (1.0 if still else 2.0)
        if chain.even is not None:
            run = np.abs(self._even)
            self._turned = self._turned + self._lipschitz * run
            self._size = self._size + run * float(np.hypot(reach[chain.even], 1.0))
        limits, (velocity, _) = plan.robot.joint_limits(), plan.robot.speed_limits()
        bound, couplings = ~plan.robot.endless, plan.robot.couplings
        bound[np.setdiff1d(np.arange(len(bound)), self._own)] = False  # they run evenly
        self.rows = np.vstack([np.eye(dq.shape[1]), *(c.row[None] for c in couplings)])
        self._low = np.append(np.where(bound, limits.lower, -np.inf), [c.lower for c in couplings])
        self._high = np.append(np.where(bound, limits.upper, np.inf), [c.upper for c in couplings])
        self._fast = (np.diff(plan.time)[:, None] * velocity)[:, self._own]

    def speeds(self, k: Ints, q: Array) -> tuple[Array, Array]:
        """Return joint speeds (S, n) per interval at samples, and least singular values (S,)."""
        T, J = self._chain.jacobian(q)
        V = np.concatenate([self._step[k], self._turn[k]], axis=1)
        V = V - (self._chain.twists(q, T[:, :3, 3]) @ self._x[k, :, None])[..., 0]
        if (even := self._chain.even) is not None:
            V = V - J[:, :, even] * self._even[k, None]
        J = J[:, :, self._own]
        if self._n < 6:
            z = T[:, :3, 2]
            J[:, 3:] -= z[:, :, None] * np.einsum("bi,bij->bj", z, J[:, 3:])[:, None]
            V[:, 3:] -= z * (z * V[:, 3:]).sum(axis=1, keepdims=True)
        U, s, Vt = np.linalg.svd(J, full_matrices=False)
        least = s[:, -1]
        inverse = np.where(s > 1e-12, 1 / np.maximum(s, 1e-12), 0.0)
        v = np.empty((len(q), self._n))
        v[:, self._own] = np.einsum("bji,bj,bkj,bk->bi", Vt, inverse, U, V)
        if even is not None:
            v[:, even] = self._even[k]
        return np.concatenate([v, self._x[k]], axis=1), least

    def settled(self, steps: _Steps) -> Bools:
        """Return which steps (S,) can hide nothing that matters."""
        L, own = self._lipschitz, self._own
        s, size = np.maximum(steps.s0, steps.s1), self._size[steps.k]
        s = s - self._turned[steps.k] * steps.h
        root = s**2 - 4 * L * size * steps.h
        known = (s > 0) & (root >= 0)
        r = np.where(known, (s - np.sqrt(np.maximum(root, 0.0))) / (2 * L), np.inf)
        floor = np.where(known, s - L * np.where(known, r, 0.0), 1.0)
        speed = size / floor
        both = speed + np.abs(self._even[steps.k])
        second = (L * both**2 + self._change[steps.k]) / floor
        hidden = second * steps.h**2 / 8
        faster = (second * steps.h / 2)[:, None]
        one, two = steps.q0 @ self.rows.T, steps.q1 @ self.rows.T
        by = hidden[:, None] * np.linalg.norm(self.rows, axis=1)
        inside = (
            (np.minimum(one, two) - by >= self._low) & (np.maximum(one, two) + by <= self._high)
        ).all(axis=1)
        fast = self._fast[steps.k]
        most = self.fastest(steps)[:, own]
        slow = ((most + faster <= fast) | (faster <= HIDDEN_SPEED * fast)).all(axis=1)
        joined = np.linalg.norm((steps.q1 - steps.q0)[:, own], axis=1) <= r + 1e-6
        safe = known & joined & slow & (inside | (hidden <= HIDDEN_ANGLE))
        # A limit that is exceeded by far is seen anyway.
        return np.asarray(safe | (most > BY_FAR * fast).any(axis=1))

    def fastest(self, steps: _Steps) -> Array:
        """Return the speeds (S, n) per interval seen in steps, jumps to other branches included."""
        ends = np.maximum(np.abs(steps.v0), np.abs(steps.v1))
        return np.asarray(np.maximum(ends, np.abs(steps.q1 - steps.q0) / steps.h[:, None]))

    def halved(self, steps: _Steps) -> tuple[_Steps, Array]:
        """Return the two halves of each step, one after the other, and the errors in between."""
        f = steps.f0 + steps.h / 2
        wanted = straight(self._poses[:-1], self._poses[1:], steps.k, f)
        q, missed = follow(self._chain, wanted, (steps.q0 + steps.q1) / 2)
        v, s = self.speeds(steps.k, q)

        def both(first: Array, second: Array) -> Array:
            return np.stack([first, second], axis=1).reshape(2 * len(first), *first.shape[1:])

        half = steps.h / 2
        halves = _Steps(
            k=np.repeat(steps.k, 2),
            f0=both(steps.f0, f), h=both(half, half),
            q0=both(steps.q0, q), q1=both(q, steps.q1),
            v0=both(steps.v0, v), v1=both(v, steps.v1),
            s0=both(steps.s0, s), s1=both(s, steps.s1),
        )  # fmt: skip
        return halves, missed


def _reaches(chain: JointChain) -> Array:
    """Return the largest distance (n,) m of the tip from each joint axis."""
    links = np.linalg.norm(chain.origins[:, :3, 3], axis=1)
    tip = float(np.linalg.norm(chain.tip[:3, 3]))
    return np.array([links[i + 1 :].sum() + tip for i in range(len(links))])


def _lipschitz(reach: Array) -> float:
    """Return a bound on the change of the Jacobian per radian of the joints, both in 2-norms.

    Turning joint j moves column i by at most the reach of the outer of the two joints, and turns
    its axis if j is the inner one.
    """
    n = len(reach)
    outer = np.maximum.outer(np.arange(n), np.arange(n))
    inner = np.tril(np.ones((n, n)), -1)
    return float(np.sqrt((reach[outer] ** 2 + inner).sum()))


def _farthest(chain: JointChain, tips: Array, x: Array) -> float:
    """Return a bound on the twist of the tip (m and rad) per radian of a rotary external axis.

    tips : (K, 3) m; x : (K, E), values of the axes at the nodes.
    """
    linear = [axis.kind == "linear" for axis in chain.externals]
    travel = float(np.abs(x[:, linear]).max(axis=0).sum()) if any(linear) else 0.0
    points = sum(float(np.linalg.norm(axis.point)) for axis in chain.externals)
    return float(np.linalg.norm(tips, axis=1).max()) + 1.0 + travel + 2 * points
