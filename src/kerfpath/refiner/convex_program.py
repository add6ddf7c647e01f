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
from scipy import sparse

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.refiner.rates import LinearAcceleration, LinearTorque, RateLimits
from kerfpath.refiner.rows import ConstraintRows, Sparse, span_of, wide
from kerfpath.search import Metric

Target = Literal["sum", "max", "excess", "lost"]
"""Objectives: (14); (15); the largest share of a limit, whatever the distances; or (14) plus, at
`PRICE` each, the excess of every interval and every node over the limits."""

PRICE = 100.0
"""Price of exceeding a limit by once the limit; distances are rarely above 1 per interval."""

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
    cap : float
        Largest distance that is allowed; infinite: any.
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
    cap: float
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
            acceleration=self.acceleration.through(delta),
            torque=None if torque is None else torque._replace(share=torque.at(-delta[:, 0])),
        )


def solve(model: LinearModel, rates: RateLimits, target: Target) -> Array | None:
    """Return the best change (K, F) by the linear model; None if the program has no solution."""
    free = model.radius.shape
    rows = ConstraintRows(size := model.radius.size)
    dq, D = np.diff(model.q, axis=0), _increments(model)
    beyond = None
    if target in ("excess", "lost"):
        beyond = rows.new(1 if target == "excess" else len(rates.tau) + len(rates.meetings[0]))
    _limits(rows, dq, D, model, rates, beyond)
    _ranges(rows, model)
    for sign, bound in ((1.0, model.most), (-1.0, -model.least)):
        rows.hold(sign * sparse.eye_array(size, format="csr"), bound.ravel())
    if target == "excess":
        cost = np.zeros(size)
    else:
        cost = _cost(rows, dq, D, model, minimax=target == "max")
    if beyond is not None:
        price = (1.0 if target == "excess" else PRICE) * beyond.sum(axis=0)
        cost = np.pad(cost, (0, rows.variables - len(cost)))
        cost[: len(price)] += price
    equal = None
    if rates.periodic:
        each, last = np.arange(free[1]), size - free[1]
        values = np.concatenate([model.radius[0], -model.radius[-1]])
        columns = np.concatenate([each, last + each])
        equal = _matrix(values, np.tile(each, 2), columns, (free[1], size))
    x = rows.solve(cost, equal)
    if x is None:
        return None
    return np.clip(x[:size].reshape(free), model.least, model.most) * model.radius


def _matrix(values: Array, row: Ints, column: Ints, shape: tuple[int, int]) -> Sparse:
    return sparse.csr_array((values, (row, column)), shape=shape)


def _scaled(factors: Array, matrix: Sparse) -> Sparse:
    """Multiply the rows of a matrix by factors."""
    data = matrix.data * np.repeat(factors, np.diff(matrix.indptr))
    return sparse.csr_array((data, matrix.indices, matrix.indptr), matrix.shape)


def _less(rows: Sparse, one: Sparse) -> Sparse:
    """Subtract a single row from each of the rows; it has at least as many unknowns as they."""
    return wide(rows, one.shape[1]) - sparse.csr_array(np.ones((rows.shape[0], 1))) @ one


def _increments(model: LinearModel) -> Sparse:
    """Return the slopes ((K-1) n, K F) of the increments, edge after edge."""
    n, slopes = model.q.shape[1], _slopes(model)
    return slopes[n:] - slopes[:-n]


def _slopes(model: LinearModel) -> Sparse:
    """Return the slopes (K n, K F) of the joints by the unknowns, node after node."""
    K, n, F = model.slope.shape
    values = (model.slope * model.radius[:, None]).ravel()
    row = np.repeat(np.arange(K * n), F)
    column = (row // n) * F + np.tile(np.arange(F), K * n)
    return _matrix(values, row, column, (K * n, K * F))


def _limits(
    rows: ConstraintRows,
    dq: Array,
    D: Sparse,
    model: LinearModel,
    rates: RateLimits,
    beyond: Sparse | None,
) -> None:
    """Add the limits (5), (6), on torques and on jerks, with an excess `beyond` if it is unknown.

    The excess is one unknown for all, or one for each interval and then each node, not negative.
    """
    edges, n = dq.shape
    meetings, (v, a) = rates.meetings, rates.of(dq)
    span = (rates.tau[meetings[0]] + rates.tau[meetings[1]]) / 2
    owner = np.zeros(edges + len(span), np.int64)
    if beyond is not None and beyond.shape[0] > 1:
        owner = np.arange(len(owner))
        rows.hold(-beyond, np.zeros(len(owner)))
    V = _scaled(np.repeat(1 / rates.tau, n), D)
    joints = np.arange(n)
    before, after = ((joints + n * at[:, None]).ravel() for at in meetings)
    A = _scaled(np.repeat(1 / span, n), V[after] - V[before])
    most = model.acceleration.limit
    held = [
        (v / rates.velocity, _scaled(1 / rates.velocity.ravel(), V), owner[:edges]),
        (a / most, _scaled(1 / most.ravel(), A), owner[edges:]),
    ]
    # What the limit itself gains, in shares of it, is taken off on both sides.
    gained = _accelerations(model, model.acceleration)
    if model.torque is not None:
        held.append((model.torque.share, _torques(model, model.torque), owner[edges:]))
    if rates.limits.jerk is not None and len(jerk := rates.jerk_share(dq)):
        over = meetings[1][: len(jerk)]
        here = (joints + n * np.arange(len(jerk))[:, None]).ravel()
        there = (here + n) % A.shape[0]
        per = np.outer(1 / rates.tau[over], 1 / rates.limits.jerk.usable).ravel()
        held.append((jerk, _scaled(per, A[there] - A[here]), owner[:edges][over]))
    for i, (value, per_share, of) in enumerate(held):
        share = value.ravel()
        for sign in (1.0, -1.0):
            used = sign * per_share
            if i == 1 and gained is not None:
                used = used - gained
            if beyond is None:
                rows.at_most(sign * share, used, 1 - MARGIN)
            else:
                spread = beyond[np.repeat(of, n)]
                rows.hold(wide(used, rows.variables) - spread, 1 - sign * share)


def _accelerations(model: LinearModel, limit: LinearAcceleration) -> Sparse | None:
    """Return the slopes (M n, K F) of the acceleration limits as shares of them; None: constant."""
    if not limit.slope.any():
        return None
    M, n, F = limit.slope.shape
    values = limit.slope * model.radius[limit.node, None] / limit.limit[..., None]
    row = np.repeat(np.arange(M * n), F)
    column = np.repeat(limit.node, n * F) * F + np.tile(np.arange(F), M * n)
    return _matrix(values.ravel(), row, column, (M * n, model.radius.size))


def _torques(model: LinearModel, torque: LinearTorque) -> Sparse:
    """Return the slopes (M n, K) of the shares of torque limits by gamma, node after node."""
    values = torque.slope * model.radius[torque.column]
    m, n = torque.share.shape
    row = np.tile(np.arange(m * n), 3)
    column = np.repeat(torque.column.ravel(), n)
    return _matrix(values.ravel(), row, column, (m * n, len(model.q)))


def _ranges(rows: ConstraintRows, model: LinearModel) -> None:
    """Add the ranges of joints, rotation limits and couplings."""
    K, n = model.q.shape
    one = _slopes(model)
    rows.at_most(model.q.ravel(), one, np.tile(model.upper, K))
    rows.at_most(-model.q.ravel(), -one, np.tile(-model.lower, K))
    if np.isfinite(model.rotation).any():
        away = one - sparse.vstack([one[:n]] * K, format="csr")
        for sign in (1.0, -1.0):
            turned = sign * (model.q - model.q[0]).ravel()
            rows.at_most(turned, sign * away, np.tile(model.rotation, K))
    for row, lower, upper in zip(model.rows, model.row_lower, model.row_upper, strict=True):
        both = sparse.kron(sparse.eye_array(K), row[None], format="csr") @ one
        rows.at_most(model.q @ row, both, upper)
        rows.at_most(-(model.q @ row), -both, -lower)


def _cost(rows: ConstraintRows, dq: Array, D: Sparse, model: LinearModel, minimax: bool) -> Array:
    """Return the coefficients of the objective: the sum of the distances, or the largest."""
    lengths, constant = _lengths(rows, dq, D, model)
    if model.cap < np.inf:
        rows.hold(lengths, model.cap - constant)
    if not minimax:
        return np.asarray(lengths.sum(axis=0))
    largest = rows.new(1)
    rows.hold(_less(lengths, largest), -constant)
    return np.asarray(largest.sum(axis=0))


def _lengths(
    rows: ConstraintRows, dq: Array, D: Sparse, model: LinearModel
) -> tuple[Sparse, Array]:
    """Return upper bounds on the distances rho, as lengths (K-1, any) @ x + constant (K-1,)."""
    edges, n = dq.shape
    value = (model.weight * dq).ravel()
    slope, edge = _scaled(np.tile(model.weight, edges), D), np.repeat(np.arange(edges), n)
    reach = span_of(slope)
    if model.metric == "manhattan":
        # Where no step reverses a joint, its absolute value is linear.
        turns = np.flatnonzero(np.abs(value) <= reach)
        sign = np.sign(value)
        sign[turns] = 0.0
        total = _matrix(sign, edge, np.arange(edges * n), (edges, edges * n))
        part = rows.new(len(turns))
        _absolute(rows, value[turns], slope[turns], part)
        parts = _matrix(
            np.ones(len(turns)), edge[turns], np.arange(len(turns)), (edges, len(turns))
        )
        return wide(total @ slope, rows.variables) + parts @ part, total @ value
    length = rows.new(edges)
    if model.metric == "chebychev":
        # A joint that stays below the least value of another one cannot be the largest.
        least = np.maximum(np.abs(value) - reach, 0).reshape(edges, n).max(axis=1)
        can = np.flatnonzero(np.abs(value) + reach >= least[edge])
        _absolute(rows, value[can], slope[can], length[edge[can]])
    else:
        blocks = sparse.vstack([length, wide(slope, rows.variables)], format="csr")
        parts_of = edges + np.arange(edges * n).reshape(edges, n)
        order = np.column_stack([np.arange(edges), parts_of]).ravel()
        rows.cone(blocks[order], np.append(np.zeros(edges), value)[order], n + 1)
    return length, np.zeros(edges)


def _absolute(rows: ConstraintRows, value: Array, slope: Sparse, above: Sparse) -> None:
    """Add |value + slope x| <= above x."""
    rows.hold(wide(slope, rows.variables) - above, -value)
    rows.hold(-wide(slope, rows.variables) - above, value)
