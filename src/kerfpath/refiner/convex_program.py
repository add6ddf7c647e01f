"""The convex program of one step: limits and ranges linear in the free variables, costs convex.

The free variables of a node are gamma and its external axes, F numbers f_k. With
q_k(f_k + delta_k) = q_k + J_k delta_k, the limits (5), (6) and on jerks and the ranges of the
joints are linear in delta; the torques of arms without such axes are linearised. The distances of
(14) and (15) are convex: a linear program for the Manhattan and Chebychev metrics, a second-order
cone program for the Euclidean one. The unknowns are x = delta / radius, which lie in [-1, 1].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.plans import STILL
from kerfpath.refiner.goals import Goal
from kerfpath.refiner.rates import LinearAcceleration, LinearTorque, RateLimits
from kerfpath.refiner.rows import ConstraintRows, Rows
from kerfpath.search import Metric

Target = Literal["sum", "max", "excess", "lost"]
"""Objectives: (14); (15); the largest share of a limit, whatever the distances; or (14) plus, at
`PRICE` each, the excess of every interval and every node over the limits."""

PRICE = 100.0
"""Price of exceeding a limit by once the limit; distances are rarely above 1 per interval."""

LEAST_SHARP = 1e-6
"""Least share of an acceleration limit at which its square root is linearised."""
MARGIN = 1e-8
"""Share of a limit, or rad, that is left free for rounding."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearModel:
    """Joints as linear functions of the change of the free variables, and their constraints.

    Parameters
    ----------
    q, slope : (K, n) rad, (K, n, F)
        Joints without a change, not wrapped, and their derivatives by the free variables.
    radius : (K, F) rad or m
        Largest change of each free variable.
    least, most : (K, F)
        Bounds on the change as a share of the radius, from -1 to 1.
    lower, upper : (n,) rad
        Ranges of the joints; infinite for none.
    rotation : (n,) rad
        Largest rotation of a joint away from where it begins; infinite for no limit.
    rows, row_lower, row_upper : (m, n), (m,) rad, (m,) rad
        Couplings.
    weight : (n,) 1/rad
    metric : str
    held : (K-1, n) or None
        Direction, 1 or -1, that each joint keeps in each interval unless it is still; 0: either.
        None: all may go either way.
    cap : float
        Largest distance that is allowed; infinite: any.
    gamma : (K,) rad
        Without a change.
    goals : tuple of Goal
        Criteria in place of the distances; none: the distances count.
    acceleration : LinearAcceleration
        Largest accelerations where intervals meet.
    torque : LinearTorque or None
        Shares of the torque limits; None if there are no such limits.
    """

    q: Array
    slope: Array
    radius: Array
    least: Array
    most: Array
    lower: Array
    upper: Array
    rotation: Array
    rows: Array
    row_lower: Array
    row_upper: Array
    weight: Array
    metric: Metric
    held: Array | None
    cap: float
    gamma: Array
    goals: tuple[Goal, ...]
    acceleration: LinearAcceleration
    torque: LinearTorque | None = None

    __repr__ = short_repr

    def moved(self, delta: Array) -> Array:
        """Return the changes (K, n) of the joints for changes `delta` (K, F)."""
        return np.asarray((self.slope @ delta[..., None])[..., 0])

    def through(self, delta: Array) -> LinearModel:
        """Return the model, made after changes delta (K, F), with its values before them."""
        torque = self.torque
        return replace(
            self,
            q=self.q - self.moved(delta),
            gamma=self.gamma - delta[:, 0],
            acceleration=self.acceleration.through(delta),
            torque=None if torque is None else torque._replace(share=torque.at(-delta[:, 0])),
        )


def solve(model: LinearModel, rates: RateLimits, target: Target) -> Array | None:
    """Return the best change (K, F) by the linear model; None if the program has no solution."""
    free = model.radius.shape
    rows = ConstraintRows(size := model.radius.size)
    dq, D = np.diff(model.q, axis=0), _increments(model)
    beyond, shares = _limits(rows, dq, D, model, rates, target)
    _ranges(rows, model)
    if model.held is not None:
        kept, way = np.flatnonzero(model.held), model.held.ravel()
        most = np.repeat(STILL * rates.tau / 2, dq.shape[1])[kept]
        rows.at_most((-way * dq.ravel())[kept], D.scaled(-way).of(kept), most)
    unknown = np.arange(size)[:, None]
    for sign, bound in ((1.0, model.most), (-1.0, -model.least)):
        rows.hold(Rows(np.full((size, 1), sign), unknown), bound.ravel())
    if model.goals:
        cost = _goals(rows, dq, D, model, target, shares, beyond)
    elif target == "excess":
        cost = np.zeros(rows.variables)
    else:
        cost = _cost(rows, dq, D, model, minimax=target == "max")
    cost = np.pad(cost, (0, rows.variables - len(cost)))
    cost[beyond] += 1.0 if target == "excess" else PRICE
    equal = None
    if rates.periodic:
        first = unknown[: free[1]]
        last = first + size - free[1]
        equal = Rows(model.radius[0][:, None], first).beside(-model.radius[-1][:, None], last)
    # Scaled again, programs of lost time took 32 to 62 iterations on 656 nodes, else 18 to 23.
    x = rows.solve(cost, equal, scaled=target == "lost")
    if x is None:
        return None
    return np.clip(x[:size].reshape(free), model.least, model.most) * model.radius


def _increments(model: LinearModel) -> Rows:
    """Return the slopes ((K-1) n) of the increments by the unknowns, edge after edge."""
    n, slopes = model.q.shape[1], _slopes(model)
    ahead = slopes.of(slice(n, None))
    return (-slopes.of(slice(-n))).beside(*ahead)


def _slopes(model: LinearModel) -> Rows:
    """Return the slopes (K n) of the joints by the unknowns, node after node."""
    K, n, F = model.slope.shape
    values = (model.slope * model.radius[:, None]).reshape(K * n, F)
    return Rows(values, np.repeat(_unknowns(np.arange(K), F), n, axis=0))


def _unknowns(node: Ints, F: int) -> Ints:
    """Return the unknowns (m, F) of nodes (m,)."""
    return np.asarray(node[:, None] * F + np.arange(F))


def _limits(
    rows: ConstraintRows, dq: Array, D: Rows, model: LinearModel, rates: RateLimits, target: Target
) -> tuple[Ints, list[tuple[Array, Rows]]]:
    """Add the limits (5), (6), on torques and jerks; return the unknowns of the excess over them.

    The excess is one unknown for all (target "excess"), or one for each interval and each node that
    may exceed a limit ("lost"), not negative; else there is none. Also return the shares of the
    limits of velocity, up and down, and those of acceleration, with their slopes.
    """
    edges, n = dq.shape
    meetings, (v, a) = rates.meetings, rates.of(dq)
    span = (rates.tau[meetings[0]] + rates.tau[meetings[1]]) / 2
    owner = np.arange(edges + len(span))
    V = D.scaled(np.repeat(1 / rates.tau, n))
    joints = np.arange(n)
    before, after = ((joints + n * at[:, None]).ravel() for at in meetings)
    A = (-V.of(before)).plus(V.of(after)).scaled(np.repeat(1 / span, n))
    most = model.acceleration.limit
    held = [
        (v / rates.velocity, V.scaled(1 / rates.velocity.ravel()), owner[:edges]),
        (a / most, A.scaled(1 / most.ravel()), owner[edges:]),
    ]
    # What the limit itself gains, in shares of it, is taken off on both sides.
    gained = _accelerations(model, model.acceleration)
    if model.torque is not None:
        held.append((model.torque.share, _torques(model, model.torque), owner[edges:]))
    if rates.limits.jerk is not None and len(jerk := rates.jerk_share(dq)):
        over = meetings[1][: len(jerk)]
        here = (joints + n * np.arange(len(jerk))[:, None]).ravel()
        there = (here + n) % len(A.value)
        per = np.outer(1 / rates.tau[over], 1 / rates.limits.jerk.usable).ravel()
        change = (-A.of(here)).plus(A.of(there))
        held.append((jerk, change.scaled(per), owner[:edges][over]))
    used = [
        (sign * value.ravel(), per_share if sign > 0 else -per_share, np.repeat(of, n))
        for value, per_share, of in held
        for sign in (1.0, -1.0)
    ]
    if gained is not None:
        used[2:4] = [(share, slope.plus(-gained), of) for share, slope, of in used[2:4]]
    shares = [(share, slope) for share, slope, _ in used[:4]]
    if target in ("sum", "max"):
        for share, slope, _ in used:
            rows.at_most(share, slope, 1 - MARGIN)
        return rows.new(0), shares
    # Shares that stay below 1, or below what another one needs at least, do not count.
    least = 1.0
    if target == "excess":
        least = max(float((share - slope.span).max(initial=-np.inf)) for share, slope, _ in used)
    some = [share + slope.span >= least for share, slope, _ in used]
    place = np.concatenate([of[kept] for (_, _, of), kept in zip(used, some, strict=True)])
    if target == "excess":
        beyond = rows.new(1)
        unknown = np.zeros(len(owner), np.int64) + beyond
    else:
        places = np.unique(place)
        beyond = rows.new(len(places))
        unknown = np.zeros(len(owner), np.int64)
        unknown[places] = beyond
        rows.hold(Rows(-np.ones((len(beyond), 1)), beyond[:, None]), np.zeros(len(beyond)))
    for (share, slope, of), kept in zip(used, some, strict=True):
        rows.hold(slope.of(kept).beside(-1.0, unknown[of[kept]][:, None]), 1 - share[kept])
    return beyond, shares


def _accelerations(model: LinearModel, limit: LinearAcceleration) -> Rows | None:
    """Return the slopes (M n) of the acceleration limits as shares of them; None: constant."""
    if not limit.slope.any():
        return None
    M, n, F = limit.slope.shape
    values = limit.slope * model.radius[limit.node, None] / limit.limit[..., None]
    return Rows(values.reshape(M * n, F), np.repeat(_unknowns(limit.node, F), n, axis=0))


def _torques(model: LinearModel, torque: LinearTorque) -> Rows:
    """Return the slopes (M n) of the shares of torque limits by gamma, node after node."""
    values = torque.slope * model.radius[torque.column]
    n = torque.share.shape[1]
    return Rows(values.reshape(len(values), -1).T, np.repeat(torque.column.T, n, axis=0))


def _ranges(rows: ConstraintRows, model: LinearModel) -> None:
    """Add the ranges of joints, rotation limits and couplings."""
    K, n, F = model.slope.shape
    one = _slopes(model)
    rows.at_most(model.q.ravel(), one, np.tile(model.upper, K))
    rows.at_most(-model.q.ravel(), -one, np.tile(-model.lower, K))
    if np.isfinite(model.rotation).any():
        away = one.plus(-one.of(np.tile(np.arange(n), K)))
        for used, turned in ((away, model.q - model.q[0]), (-away, model.q[0] - model.q)):
            rows.at_most(turned.ravel(), used, np.tile(model.rotation, K))
    for row, lower, upper in zip(model.rows, model.row_lower, model.row_upper, strict=True):
        both = Rows(row @ one.value.reshape(K, n, F), _unknowns(np.arange(K), F))
        rows.at_most(model.q @ row, both, upper)
        rows.at_most(-(model.q @ row), -both, -lower)


def _goals(
    rows: ConstraintRows,
    dq: Array,
    D: Rows,
    model: LinearModel,
    target: Target,
    shares: list[tuple[Array, Rows]],
    beyond: Ints,
) -> Array:
    """Add the goals; return the coefficients of the sum of their prices times themselves.

    Their largest values are limits, too, but for the target "lost".
    """
    made = [_goal(rows, dq, D, model, goal, shares) for goal in model.goals]
    cost = np.zeros(rows.variables)
    for goal, (row, constant) in zip(model.goals, made, strict=True):
        if target == "excess":
            most = np.full((1, 1), -goal.most)
            rows.hold(row.beside(most, beyond[None]), np.array([goal.most - constant]))
        else:
            np.add.at(cost, row.column[0], goal.price * row.value[0])
            if target != "lost":
                rows.hold(row, np.array([goal.most * (1 - MARGIN) - constant]))
    return cost


def _goal(
    rows: ConstraintRows,
    dq: Array,
    D: Rows,
    model: LinearModel,
    goal: Goal,
    shares: list[tuple[Array, Rows]],
) -> tuple[Rows, float]:
    """Return an upper bound on a goal as one row and a constant."""
    K, n, _ = model.slope.shape
    if goal.kind == "way":
        lengths, constant = _lengths(
            rows, dq, D, replace(model, weight=goal.weight, metric="manhattan")
        )
        places, values = lengths.column.ravel(), lengths.value.ravel()
        sums = np.bincount(places, values, rows.variables).astype(np.float64, copy=False)
        column = np.flatnonzero(sums)
        return Rows(sums[None, column], column[None]), float(constant.sum())
    if goal.kind in ("span", "turn"):
        turn = goal.kind == "turn"
        one = Rows(model.radius[:, :1], _unknowns(np.arange(K), model.radius.shape[1])[:, :1])
        each = [(model.gamma, one, 1.0)] if turn else []
        slopes = _slopes(model)
        for i in np.flatnonzero(goal.weight) if not turn else ():
            each.append((model.q[:, i], slopes.of(slice(i, None, n)), goal.weight[i]))
        ends, price = rows.new(2 * len(each)), np.repeat([w for _, _, w in each], 2)
        price[1::2] *= -1.0
        middle = [float(value.mean()) for value, _, _ in each]
        pairs = ends.reshape(-1, 2)
        for (value, slope, _), at, (top, low) in zip(each, middle, pairs, strict=True):
            rows.hold(slope.beside(-1.0, np.full((K, 1), top)), at - value)
            rows.hold((-slope).beside(1.0, np.full((K, 1), low)), value - at)
        return Rows(price[None], ends[None]), 0.0
    if goal.kind == "step":
        weight = np.tile(goal.weight, len(dq))
        value, slope = (goal.weight * dq).ravel(), D.scaled(weight)
        some = weight != 0
        sides = [(value[some], slope.of(some)), (-value[some], -slope.of(some))]
    elif goal.kind == "interval":
        # The square root of the accelerations, from above.
        now = max(float(share.max(initial=LEAST_SHARP)) for share, _ in shares[2:])
        half = now**-0.5 / 2
        sides = [*shares[:2]]
        for share, slope in shares[2:]:
            by = np.full(len(share), half)
            sides.append((share * half + now * half, slope.scaled(by)))
    else:
        sides = shares[:2] if goal.kind == "velocity" else shares[2:]
    largest = rows.new(1)
    # What stays below the least that another one needs cannot be the largest.
    least = max(float((value - slope.span).max(initial=-np.inf)) for value, slope in sides)
    for value, slope in sides:
        some = value + slope.span >= least
        column = np.tile(largest, (int(some.sum()), 1))
        rows.hold(slope.of(some).beside(-1.0, column), -value[some])
    return Rows(np.ones((1, 1)), largest[None]), 0.0


def _cost(rows: ConstraintRows, dq: Array, D: Rows, model: LinearModel, minimax: bool) -> Array:
    """Return the coefficients of the objective: the sum of the distances, or the largest."""
    lengths, constant = _lengths(rows, dq, D, model)
    if model.cap < np.inf:
        rows.hold(lengths, model.cap - constant)
    if not minimax:
        at, value = lengths.column.ravel(), lengths.value.ravel()
        return np.bincount(at, value, rows.variables).astype(np.float64, copy=False)
    largest = rows.new(1)
    rows.hold(lengths.beside(-1.0, np.tile(largest, (len(constant), 1))), -constant)
    cost = np.zeros(rows.variables)
    cost[largest] = 1.0
    return cost


def _lengths(rows: ConstraintRows, dq: Array, D: Rows, model: LinearModel) -> tuple[Rows, Array]:
    """Return upper bounds on the distances rho, as lengths (K-1) @ x + constant (K-1,)."""
    edges, n = dq.shape
    value = (model.weight * dq).ravel()
    slope, edge = D.scaled(np.tile(model.weight, edges)), np.repeat(np.arange(edges), n)
    reach = slope.span
    if model.metric == "manhattan":
        # Where no step reverses a joint, its absolute value is linear.
        turns = np.abs(value) <= reach
        sign = np.sign(value)
        sign[turns] = 0.0
        total = slope.scaled(sign).value.reshape(edges, n, -1).sum(axis=1)
        part = np.zeros(edges * n, np.int64)
        part[turns] = rows.new(int(turns.sum()))
        _absolute(rows, value[turns], slope.of(turns), part[turns])
        parts = np.where(turns, 1.0, 0.0).reshape(edges, n), part.reshape(edges, n)
        constant = (sign * value).reshape(edges, n).sum(axis=1)
        return Rows(total, slope.column[::n]).beside(*parts), constant
    length = rows.new(edges)
    if model.metric == "chebychev":
        # A joint that stays below the least value of another one cannot be the largest.
        least = np.maximum(np.abs(value) - reach, 0).reshape(edges, n).max(axis=1)
        can = np.flatnonzero(np.abs(value) + reach >= least[edge])
        _absolute(rows, value[can], slope.of(can), length[edge[can]])
    else:
        first = np.zeros((edges, 1, slope.value.shape[1]))
        first[..., 0] = 1.0
        columns = np.zeros(first.shape, np.int64)
        columns[:, 0, 0] = length
        blocks = [
            np.concatenate([own, each.reshape(edges, n, -1)], axis=1).reshape(edges * (n + 1), -1)
            for own, each in zip((first, columns), slope, strict=True)
        ]
        constant = np.column_stack([np.zeros(edges), value.reshape(edges, n)]).ravel()
        rows.cone(Rows(*blocks), constant, n + 1)
    return Rows(np.ones((edges, 1)), length[:, None]), np.zeros(edges)


def _absolute(rows: ConstraintRows, value: Array, slope: Rows, above: Ints) -> None:
    """Add |value + slope x| <= the unknowns `above` (m,)."""
    rows.hold(slope.beside(-1.0, above[:, None]), -value)
    rows.hold((-slope).beside(-1.0, above[:, None]), value)
