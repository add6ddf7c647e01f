"""Screening: many motions are brought near the limits and to low cost at once, and the best kept.

Newton's method minimises an energy, the cost with penalties in place of the limits, over gamma of
every node. It begins with a smoothed cost and weak penalties, which merge neighbouring optima, and
ends close to the problem itself. After each stage alike and poor motions are dropped. What is left
is for the refinement, which alone decides whether a motion keeps the limits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.kernels.change_table import change_factors
from kerfpath.kernels.metric import CHEBYCHEV, MANHATTAN, wrap
from kerfpath.kernels.screening import Energy, energies, newton_steps
from kerfpath.kernels.turns import JointLimits
from kerfpath.progress import may_stop
from kerfpath.refiner.joint_curves import JointCurves
from kerfpath.robots import Robot
from kerfpath.search import Course


class Stage(NamedTuple):
    """One stage of a screening."""

    smooth: float
    """Rounding of the distances, in thirds of the typical one of a step."""
    price: float
    """Price of exceeding a limit by once the limit, in typical distances of a step."""
    iterations: int
    kept: int | None
    """Most motions that are kept after it; None: all."""


SMOOTH = (
    Stage(1.0, 0.3, 10, None), Stage(1.0, 1.0, 10, 150), Stage(1.0, 3.0, 10, 100),
    Stage(0.7, 10.0, 10, 70), Stage(0.5, 30.0, 10, 50), Stage(0.3, 100.0, 10, 40),
    Stage(0.2, 300.0, 10, 30), Stage(0.1, 1e3, 12, 20), Stage(0.03, 3e3, 15, 14),
    Stage(0.03, 3e4, 15, 12), Stage(0.03, 3e5, 15, 12),
)  # fmt: skip
"""Stages that merge basins, for courses that hardly keep (6)."""
SHARP = (
    Stage(0.3, 1.0, 10, 150), Stage(0.3, 10.0, 12, 80), Stage(0.2, 100.0, 12, 50),
    Stage(0.1, 1e3, 12, 25), Stage(0.03, 3e3, 15, 12), Stage(0.03, 3e4, 15, 12),
    Stage(0.03, 3e5, 15, 12),
)  # fmt: skip
"""Stages that stay closer to the courses that they begin with."""
QUICK = (
    Stage(1.0, 10.0, 10, 150), Stage(0.5, 100.0, 12, 80), Stage(0.3, 1e3, 15, 40),
    Stage(0.1, 1e4, 15, 20), Stage(0.1, 1e5, 15, 12),
)  # fmt: skip
"""Stages for motions that exceed the limits as little as possible, whatever they cost."""
POWERS = ((0.4, 4.0), (0.15, 8.0), (0.0, 14.0))
"""Norms in place of the Chebychev one, each from a rounding on."""
DERIVATIVE_STEP = 1e-4
"""rad: second differences are exact to 1e-8 of the fourth derivative, rounding to 1e-7."""
LONGEST = 0.2
"""rad: most by which gamma of a node changes in a step of Newton's method."""
LENGTHS = (1.0, 0.35, 0.1, 0.02)
"""Shares of a step that are tried, in this order."""
CONVERGED = 1e-5
"""Relative gain below which a motion is left as it is."""
ALIKE, SAME_SCORE = 0.03, 0.02
"""rad, and relative difference of scores: motions that differ by less are one."""
OVER, OUTSIDE, NEGLIGIBLE = 0.2, 10.0, 0.01
"""Scores are costs times 1 + OVER per limit exceeded by once the limit, and OUTSIDE per rad out of
a range, if it is more than NEGLIGIBLE rad."""
SAME_STEPS = 1e-6
"""rad, and relative difference of the ways of all joints: motions that differ by less have the same
steps."""
UNBOUND = 0.5
"""rad: where the joints of a wrist stay so far inside their ranges, these do not shape a motion."""
Aim = Literal["cost", "interval", "time"]
"""What motions are compared by: their cost, the least interval that all their steps can have, or
the time that they take where every step has its own interval, at least the one asked for."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motions:
    """Motions side by side, with joints by the kinematics, not wrapped.

    Parameters
    ----------
    gamma : (S, K) rad
    q : (S, K, n) rad
    posture : (S, K) int
    """

    gamma: Array
    q: Array
    posture: Ints

    __repr__ = short_repr

    def of(self, which: Ints | Bools) -> Motions:
        """Return some of the motions."""
        return Motions(gamma=self.gamma[which], q=self.q[which], posture=self.posture[which])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Screening:
    """The problem of the motions that are screened.

    Parameters
    ----------
    robot : Robot
        Without free joints.
    frames : (K, 4, 4) m
        Task frames in the robot base.
    tool : (4, 4) m
        Tip frame in the flange.
    limits : JointLimits
    energy : Energy
        Weights, metric, objective and limits; the rest is set by the stages.
    aim : {"cost", "interval", "time"}
        What the score of a motion is, intervals and times in intervals asked for.
    """

    robot: Robot
    frames: Array
    tool: Array
    limits: JointLimits
    energy: Energy
    aim: Aim = "cost"

    __repr__ = short_repr

    def screened(self, courses: list[Course], stages: tuple[Stage, ...]) -> list[Course]:
        """Return the best motions that courses lead to, by their score; there may be none."""
        if not courses:
            return []
        motions = self._without_flipped(self._motions(courses))
        for stage in stages:
            if not len(motions.gamma):
                break
            motions = self._descended(motions, stage)
            motions = motions.of(self._best(motions, stage.kept))
        motions = motions.of(np.argsort(self.scores(motions.q), kind="stable"))
        return [
            Course(*each) for each in zip(motions.gamma, motions.q, motions.posture, strict=True)
        ]

    def _motions(self, courses: list[Course]) -> Motions:
        """Return the motions of courses that are in reach, on turns inside the ranges."""
        gamma, near, posture = (np.array([c[part] for c in courses]) for part in range(3))
        near = near.reshape(*gamma.shape, -1)
        motions = Motions(gamma=gamma, q=self._joints(gamma, near, posture), posture=posture)
        reached = np.asarray(np.isfinite(motions.q).all(axis=(1, 2)))
        motions = motions.of(reached)
        q = motions.q
        step = wrap(np.diff(q, axis=1))
        q[:, 1:] = q[:, :1] + np.cumsum(step, axis=1)
        return replace(
            motions, q=np.stack([within(self.limits, each) for each in q]) if len(q) else q
        )

    def _without_flipped(self, motions: Motions) -> Motions:
        """Leave out one of two motions that differ in the pose of the wrist alone (`Arm.flip`).

        Their steps are alike, so that they cost the same and lead to the same, unless a range of
        the other binds.
        """
        way = np.abs(np.diff(motions.q, axis=1)).sum(axis=(1, 2))
        order, unbound = np.argsort(way, kind="stable"), self.is_unbound(motions.q)
        kept = np.ones(len(way), np.bool_)
        for place, i in enumerate(order):
            for j in order[place + 1 :]:
                if way[j] > (1 + SAME_STEPS) * way[i]:
                    break
                flipped = np.array_equal(motions.posture[i], motions.posture[j] ^ 1)
                apart = np.abs(wrap(motions.gamma[i] - motions.gamma[j])).max()
                if flipped and apart < SAME_STEPS and unbound[[i, j]].any():
                    kept[j if unbound[i] and (i < j or not unbound[j]) else i] = False
        return motions.of(kept)

    def is_unbound(self, q: Array) -> Bools:
        """Return of which motions q (S, K, n) rad the wrist may be flipped, (S,).

        It has another pose (`Arm.flip`), and no joint of it is near the end of its range.
        """
        flip = self.robot.arm.flip
        if flip is None:
            return np.zeros(len(q), np.bool_)
        wrist = slice(flip[0] - 1, None)
        inside = np.minimum(q - self.limits.lower, self.limits.upper - q)[..., wrist]
        return np.asarray(((inside > UNBOUND) | self.limits.endless[wrist]).all(axis=(1, 2)))

    def _joints(self, gamma: Array, near: Array, posture: Ints) -> Array:
        """Return the joints (S, K, n) at gamma (S, K) on the turns near `near`, or NaN."""
        frames = np.tile(self.frames, (len(gamma), 1, 1))
        curves = JointCurves(self.robot, frames, self.tool, posture.ravel())
        q = curves.at(gamma.reshape(-1, 1), near.reshape(-1, near.shape[2]))
        return q.reshape(near.shape)

    def _descended(self, motions: Motions, stage: Stage) -> Motions:
        """Return motions after the iterations of a stage."""
        gamma, q, posture = motions.gamma.copy(), motions.q.copy(), motions.posture
        lengths = self._distances(q)
        typical = float(np.median(lengths))
        energy = self.energy._replace(
            smooth=max(stage.smooth * typical / 3, 1e-12),
            power=next(power for least, power in POWERS if stage.smooth >= least),
            price=stage.price * typical,
        )
        scale = np.maximum(lengths.max(axis=1), 1e-9)
        damping, live = np.full(len(q), CONVERGED), np.ones(len(q), np.bool_)
        value = np.empty(len(q))
        energies(q, energy, scale, value)
        step = np.empty(gamma.shape)
        h = DERIVATIVE_STEP
        for _ in range(stage.iterations):
            may_stop()
            at = np.flatnonzero(live)
            ahead = self._joints(gamma[at] + h, q[at], posture[at])
            behind = self._joints(gamma[at] - h, q[at], posture[at])
            first, second = (ahead - behind) / (2 * h), (ahead - 2 * q[at] + behind) / h**2
            edge = ~np.isfinite(first + second)
            first[edge] = second[edge] = 0.0
            damp, change = damping[at], np.empty((len(at), gamma.shape[1]))
            newton_steps(
                q[at], first, second, energy, scale[at], LONGEST, damp, change,
            )  # fmt: skip
            step[at], damping[at] = change, damp
            left, gain = live.copy(), np.zeros(len(q))
            for share in LENGTHS:
                m = np.flatnonzero(left)
                there = gamma[m] + share * step[m]
                joints = self._joints(there, q[m], posture[m])
                new = np.empty(len(m))
                energies(joints, energy, scale[m], new)
                better = new < value[m]
                taken = m[better]
                gamma[taken], q[taken] = there[better], joints[better]
                gain[taken] = value[taken] - new[better]
                value[taken] = new[better]
                damping[taken] *= 4.0 if share < 0.5 else 0.25
                left[taken] = False
                if not left.any():
                    break
            damping[left] *= 10.0
            damping = np.clip(damping, 1e-8, 1e4)
            live &= (gain > CONVERGED * np.abs(value)) | (left & (damping < 1e3))
            if not live.any():
                break
        return Motions(gamma=gamma, q=q, posture=posture)

    def _best(self, motions: Motions, most: int | None) -> Ints:
        """Return at most so many motions of the best scores that differ."""
        score = self.scores(motions.q)
        order = np.argsort(score, kind="stable")
        if most is None:
            return order
        kept: list[int] = []
        for j in order.tolist():
            apart = np.abs(wrap(motions.gamma[kept] - motions.gamma[j])).max(axis=1, initial=0.0)
            same = (apart < ALIKE) & (score[kept] > (1 - SAME_SCORE) * score[j])
            if not same.any():
                kept.append(j)
            if len(kept) == most:
                break
        return np.array(kept, dtype=np.int64)

    def _distances(self, q: Array) -> Array:
        """Return the distances (S, K-1) of the steps of motions."""
        d = np.abs(np.diff(q, axis=1)) * self.energy.weight
        if self.energy.metric == MANHATTAN:
            return np.asarray(d.sum(axis=2))
        if self.energy.metric == CHEBYCHEV:
            return np.asarray(d.max(axis=2))
        return np.asarray(np.sqrt((d * d).sum(axis=2)))

    def scores(self, q: Array) -> Array:
        """Return the score (S,) of motions by the aim, more for those that break limits.

        An interval, and the time of a step, is the least under (5) and (6). A time counts (6) where
        two steps meet as if both were equally long, so it is an estimate.
        """
        dq = np.diff(q, axis=1)
        fast = np.abs(dq / self.energy.velocity).max(axis=2)
        most = self.energy.acceleration * change_factors(self.energy.table, q[:, 1:-1])
        sharp = np.abs(np.diff(dq, axis=1) / most).max(axis=2)
        out = np.maximum(self.energy.lower - q, q - self.energy.upper).max(axis=(1, 2))
        out = np.where(out > NEGLIGIBLE, out, 0.0)
        if self.aim == "cost":
            lengths = self._distances(q)
            cost = lengths.max(axis=1) if self.energy.minimax else lengths.sum(axis=1)
            over = np.maximum(fast - 1, 0).sum(axis=1) + np.maximum(sharp - 1, 0).sum(axis=1)
            return np.asarray(cost * (1 + OVER * over + OUTSIDE * out))
        slow = np.sqrt(sharp)
        if self.aim == "interval":
            time = np.maximum(fast.max(axis=1), slow.max(axis=1, initial=0.0))
        else:
            tau = np.maximum(fast, 1.0)
            tau[:, 1:] = np.maximum(tau[:, 1:], slow)
            tau[:, :-1] = np.maximum(tau[:, :-1], slow)
            time = tau.sum(axis=1)
        return np.asarray(time * (1 + OUTSIDE * out))


def within(limits: JointLimits, q: Array) -> Array:
    """Return joints (K, n) rad, not wrapped, each shifted by whole turns to fit its range best."""
    turns = 2 * np.pi * np.arange(-3, 4)[:, None]
    least, most = q.min(axis=0) + turns, q.max(axis=0) + turns
    beyond = np.maximum(limits.lower - least, 0.0) + np.maximum(most - limits.upper, 0.0)
    beyond = np.where(limits.endless, 0.0, beyond) + 1e-9 * np.abs(least + most)
    return np.asarray(q + turns[np.argmin(beyond, axis=0), 0])
