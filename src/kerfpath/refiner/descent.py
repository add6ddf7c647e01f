"""Sequential convex programming: solve a linear model, test the step by the true kinematics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, short_repr
from kerfpath.kernels.turns import JointLimits
from kerfpath.plans import STILL, path_cost
from kerfpath.progress import may_stop
from kerfpath.refiner.convex_program import MARGIN, PRICE, LinearModel, Target, solve
from kerfpath.refiner.goals import Goal
from kerfpath.refiner.joint_curves import JointCurves
from kerfpath.refiner.rates import RateLimits
from kerfpath.search import Metric, ObjectiveKind

MOST_PROGRAMS = 60
"""Most programs of one descent, which converges with far fewer."""
CORRECTIONS = 3
"""Most corrections of a step, through the joints it reached, before it is shortened."""
CONVERGED = 1e-4
"""Relative gain promised by the model below which a descent has converged."""
LEAST_EXCESS = 0.1
"""Excess that this gain is relative to where there is less: it may be 0."""
INSIDE, SURE = 0.9, 1e-6
"""Share of the radius, and error of the model relative to the value: a step that stays below both
ends the descent, as the model is convex and a larger radius would lead to the same place."""
SMALLEST_RADIUS = 1e-7
"""rad: no controller resolves a smaller change."""
NEARBY = 5e-3
"""rad: largest change of gamma tried to bring a nearly admissible motion within the limits; a tenth
of it is tried next."""
WIDER = 4.0
"""Factor by which a radius grows if it promises little because it is small."""
AWAY = 1e3
"""1/rad: price of being out of a range, above any share of a limit."""
ENOUGH = 0.1
"""Share of the promised gain that a step must bring to be taken."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotionState:
    """A motion by the true kinematics.

    Parameters
    ----------
    free : (K, F) rad or m
        Gamma, and the values of the external axes.
    q : (K, n) rad
        Joints, not wrapped.
    cost : float
        Objective of the motion.
    excess : float
        Largest share of a rate or torque limit, or of the cap, minus one.
    lost : float
        Sum over intervals and nodes of the excess over rate and torque limits, in shares of them.
    outside : float rad
        Largest distance of a joint or a coupling outside its range, or of a step against the
        direction that is held; negative inside.
    """

    free: Array
    q: Array
    cost: float
    excess: float
    lost: float
    outside: float

    __repr__ = short_repr

    @property
    def admitted(self) -> bool:
        """Whether every limit is kept."""
        return self.excess <= 0 and self.outside <= 0

    def value(self, target: Target) -> float:
        """Return the value that is minimised: the excess, the cost, or the cost with `lost`."""
        away = AWAY * max(self.outside, 0)
        if target == "excess":
            return self.excess + away
        return self.cost + PRICE * self.lost + away if target == "lost" else self.cost


class _Step(NamedTuple):
    """Result of a step: admissible motion or None, promised gain, largest change, programs."""

    to: MotionState | None
    promised: float
    longest: float
    programs: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Descent:
    """Minimisation over the free variables of a motion: objective and constraints.

    Parameters
    ----------
    curves : JointCurves
    rates : RateLimits
    limits : JointLimits
    rotation : (n,) rad
        Largest rotation of a joint away from where it begins.
    weight : (n,) 1/rad
    metric : str
    objective : {"sum", "max"}
    radius : float rad or m
        Largest change in the first iteration; a descent must have tried it to count as converged.
    first : float rad, optional
        Largest change in the first iteration, if smaller.
    low, high : (K, F) rad or m
        Bounds on the free variables; infinite for none.
    node_cost : (K,), optional
        Cost of each node, taken as fixed; the cost after gamma has moved is computed at the end.
    held : (K-1, n), optional
        Direction, 1 or -1, that each joint keeps in each interval; 0: either. Default: either.
    cap : float
        Largest distance that is allowed in a step.
    goals : tuple of Goal
        Criteria in place of the objective; none: the objective.
    most : int
        Programs after which a descent ends.
    """

    curves: JointCurves
    rates: RateLimits
    limits: JointLimits
    rotation: Array
    weight: Array
    metric: Metric
    objective: ObjectiveKind
    radius: float
    low: Array
    high: Array
    first: float | None = None
    node_cost: Array | None = None
    held: Array | None = None
    cap: float = np.inf
    goals: tuple[Goal, ...] = ()
    most: int = MOST_PROGRAMS

    __repr__ = short_repr

    def stand(self, free: Array, near: Array) -> MotionState:
        """Return the motion at `free` on the turns near `near`; infinite values if out of reach."""
        q = self.curves.at(free, near)
        if not np.isfinite(q).all():
            return MotionState(
                free=free, q=q, cost=np.inf, excess=np.inf, lost=np.inf, outside=np.inf
            )
        excess = self.rates.excess(q)
        if self.cap < np.inf:
            longest = path_cost(np.diff(q, axis=0), self.weight, self.metric, "max")
            excess = max(excess, longest / self.cap - 1)
        gamma = free[:, 0]
        for goal in self.goals:
            excess = max(excess, goal.value(gamma, q, self.rates) / goal.most - 1)
        return MotionState(
            free=free,
            q=q,
            cost=self.cost(gamma, q),
            excess=excess,
            lost=self.rates.lost(q),
            outside=self._outside(q),
        )

    def cost(self, gamma: Array, q: Array) -> float:
        """Return the objective of a motion: (14) or (15), or the sum of the priced goals.

        Gamma (K,) rad and joints (K, n) rad are not wrapped.
        """
        if self.goals:
            return sum(goal.price * goal.value(gamma, q, self.rates) for goal in self.goals)
        dq = np.diff(q, axis=0)
        return path_cost(dq, self.weight, self.metric, self.objective, self.node_cost)

    def admitted(self, at: MotionState) -> tuple[MotionState, int]:
        """Return the first motion found that keeps every limit, and the number of programs.

        It looks for one of little cost: from the motion as it is, then from the motion moved to
        exceed the limits little; else at any cost. If none is found, it returns the motion that
        breaks the limits least.
        """
        programs = 0
        if at.admitted:
            return at, 0
        for near in self._nearer(at):
            largest = min(NEARBY, self.radius)
            for radius in (largest, largest / 10):
                step = self._step(near, radius, self.objective)
                programs += step.programs
                if step.to is not None:
                    return step.to, programs
        found, more = self._run(at, "excess", enough=0.0)
        return found, programs + more

    def _nearer(self, at: MotionState) -> Iterator[MotionState]:
        """Yield motions to bring inside the limits: this one, then one with less excess."""
        yield at
        moved = self.with_reduced_excess(at)
        if moved.outside <= 0:
            yield moved

    def gentlest(self, at: MotionState) -> MotionState:
        """Return the motion with the least largest share of a limit."""
        return self._run(at, "excess")[0]

    def with_reduced_excess(self, at: MotionState) -> MotionState:
        """Return a motion of little cost that exceeds the limits in few places and by little."""
        return self._run(at, "lost")[0]

    def best(self, at: MotionState) -> tuple[MotionState, int]:
        """Return the best motion found from an admissible one, and the number of programs.

        With the objective "max", of motions with the same maximum it takes the least sum.
        """
        found, programs = self._run(at, self.objective)
        if self.objective == "max" and not self.goals:
            tie = replace(self, objective="sum", cap=found.cost)
            smooth, more = tie._run(tie.stand(found.free, found.q), "sum")
            found, programs = self.stand(smooth.free, smooth.q), programs + more
        return found, programs

    def _run(
        self, at: MotionState, target: Target, enough: float = -np.inf
    ) -> tuple[MotionState, int]:
        """Descend in steps within a radius, which grows and shrinks with the model's accuracy."""
        radius, programs, failed = self.first or self.radius, 0, np.inf
        while radius > SMALLEST_RADIUS and programs < self.most:
            step = self._step(at, radius, target)
            programs += step.programs
            gained = 0.0 if step.to is None else at.value(target) - step.to.value(target)
            size = abs(at.value(target))
            size = max(size, LEAST_EXCESS) if target == "excess" else size
            if step.to is not None and step.promised <= CONVERGED * size:
                at = step.to if gained > 0 else at
                if WIDER * radius > min(self.radius, failed):
                    break
                radius *= WIDER
                continue
            if step.to is not None and gained > ENOUGH * step.promised:
                off = abs(gained - step.promised)
                certain = step.longest < INSIDE * radius and off <= SURE * abs(at.value(target))
                at = step.to
                if certain or at.value(target) <= enough:
                    break
                radius *= 2 if step.programs == 1 else 1
            else:
                failed = min(radius, step.longest)
                radius = failed / 3
        return at, programs

    def _step(self, at: MotionState, radius: float, target: Target) -> _Step:
        """Solve the model and correct it at the joints reached, until the motion is admissible."""
        model, promised, longest = self._model(at, radius), 0.0, radius
        for programs in range(1, 2 + CORRECTIONS):
            may_stop()
            delta = solve(model, self.rates, target)
            if delta is None:
                break
            if programs == 1:
                promised = at.value(target) - self._modelled(model, delta, target)
            longest = float(np.abs(delta).max())
            there = self.stand(self._within(at.free + delta), at.q)
            soft = target in ("excess", "lost")
            if there.admitted or (soft and there.outside <= max(at.outside, 0)):
                return _Step(there, promised, longest, programs)
            if there.outside == np.inf:
                break
            model = self._model(there, radius).through(delta)
        return _Step(None, promised, longest, programs)

    def _within(self, free: Array) -> Array:
        """Return `free` with axes clipped to their bounds, which solvers keep only nearly."""
        free[:, 1:] = np.clip(free[:, 1:], self.low[:, 1:], self.high[:, 1:])
        return free

    def _modelled(self, model: LinearModel, delta: Array, target: Target) -> float:
        q = model.q + model.moved(delta)
        gamma = model.gamma + delta[:, 0]
        if target == "excess":
            over = [goal.value(gamma, q, self.rates) / goal.most - 1 for goal in self.goals]
            return max(self.rates.excess(q), *over) if over else self.rates.excess(q)
        return self.cost(gamma, q) + (PRICE * self.rates.lost(q) if target == "lost" else 0.0)

    def _model(self, at: MotionState, radius: float) -> LinearModel:
        slope = self.curves.slope(at.free, at.q)
        # A node at the edge of reach does not move, nor does a variable without room.
        reached = np.asarray(np.isfinite(slope).all(axis=(1, 2)))
        slope = np.where(reached[:, None, None], slope, 0.0)
        movable = reached[:, None] & (self.low < self.high)
        endless = self.limits.endless
        # A range may be a single point.
        room = np.minimum(MARGIN, (self.limits.upper - self.limits.lower) / 2)
        return LinearModel(
            q=at.q,
            slope=slope,
            radius=np.where(movable, radius, 0.0),
            least=np.where(movable, np.clip((self.low - at.free) / radius, -1.0, 0.0), -1.0),
            most=np.where(movable, np.clip((self.high - at.free) / radius, 0.0, 1.0), 1.0),
            lower=np.where(endless, -np.inf, self.limits.lower + room),
            upper=np.where(endless, np.inf, self.limits.upper - room),
            rotation=self.rotation - MARGIN,
            rows=self.limits.rows,
            row_lower=self.limits.row_lower + MARGIN,
            row_upper=self.limits.row_upper - MARGIN,
            weight=self.weight,
            metric=self.metric,
            held=self.held,
            cap=self.cap,
            gamma=np.unwrap(at.free[:, 0]),
            goals=self.goals,
            acceleration=self.rates.linear_acceleration(at.q, slope),
            torque=self.rates.linear_torque(at.q, slope[..., 0]),
        )

    def _outside(self, q: Array) -> float:
        limits = self.limits
        beyond = np.where(limits.endless, -np.inf, np.maximum(limits.lower - q, q - limits.upper))
        value = q @ limits.rows.T
        over = np.maximum(limits.row_lower - value, value - limits.row_upper)
        turned = np.abs(q - q[0]) - self.rotation
        back = -np.inf
        if self.held is not None:
            back = (-self.held * np.diff(q, axis=0) - STILL * self.rates.tau[:, None]).max()
        return float(max(beyond.max(), over.max(initial=-np.inf), turned.max(), back))
