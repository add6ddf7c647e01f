"""Newton steps of many motions at once, with penalties in place of the limits.

The energy of a motion q_k(gamma_k) is its cost (14) or (15), smoothed, plus penalties:

    E = sum rho_eps(dq_k)
        + price / 2 sum (|dq_k| / v - 1)_+^2 + price / 2 sum (|d2q_k| / a - 1)_+^2 + ranges,

where v and a are the limits (5), (6) on increments and on their changes. Its Hessian by gamma,
q'^T E_qq q' plus the positive part of E_q q'', has five diagonals, so that a step costs O(K).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array
from kerfpath.kernels.change_table import NO_TABLE, ChangeTable, fill_change
from kerfpath.kernels.jit import jit, jit_part
from kerfpath.kernels.metric import EUCLID, MANHATTAN

__all__ = ["Energy", "energies", "newton_steps"]

KEPT = 0.999, 0.995
"""Shares of (5) and of (6) from which their penalties begin: what is left is for the refinement."""
OF_RANGES, INSIDE = 1e5, 1e-3
"""Price of leaving a range by 1 rad, squared and halved; it begins this far before the end, rad."""
OF_LARGEST = 10.0
"""Power of the distances that are summed instead of their largest one, (15)."""
DAMPED, MORE_DAMPED, MOST_TRIES = 1e-4, 4.0, 40
"""Least damping, as a share of the diagonal, where the Hessian is not positive definite; its growth
with each try, and most tries."""


class Energy(NamedTuple):
    """What the energy of a motion is made of."""

    weight: Array
    """(n,) 1/rad"""
    metric: int
    minimax: bool
    smooth: float
    """Distance by which |x| is rounded: sqrt(x^2 + smooth^2)."""
    power: float
    """Norm that replaces the largest of the joints, with the Chebychev metric."""
    velocity: Array
    """(n,) rad: largest increment."""
    acceleration: Array
    """(n,) rad: largest change of an increment, at any configuration."""
    lower: Array
    """(n,) rad; infinite for none."""
    upper: Array
    """(n,) rad"""
    price: float
    table: ChangeTable = NO_TABLE
    """By how much larger changes of an increment may be at a configuration."""


@jit_part
def _distance(x: Array, energy: Energy, out_slope: Array, out_curve: Array) -> tuple[float, float]:
    """Smoothed distance rho of an increment x (n,); returns it and c.

    Its Hessian is diag(out_curve) - c out_slope out_slope^T.
    """
    n, weight, smooth = len(x), energy.weight, energy.smooth
    if energy.metric == MANHATTAN:
        length = 0.0
        for i in range(n):
            y = weight[i] * x[i]
            each = np.sqrt(y * y + smooth * smooth)
            length += each
            out_slope[i] = weight[i] * y / each
            out_curve[i] = weight[i] ** 2 * smooth**2 / each**3
        return length, 0.0
    if energy.metric == EUCLID:
        square = smooth * smooth
        for i in range(n):
            square += (weight[i] * x[i]) ** 2
        length = np.sqrt(square)
        for i in range(n):
            out_slope[i] = weight[i] ** 2 * x[i] / length
            out_curve[i] = weight[i] ** 2 / length
        return length, 1.0 / length
    largest = 0.0
    for i in range(n):
        largest = max(largest, (weight[i] * x[i]) ** 2 + smooth * smooth)
    total = 0.0
    for i in range(n):
        total += (((weight[i] * x[i]) ** 2 + smooth * smooth) / largest) ** (energy.power / 2)
    length = np.sqrt(largest) * total ** (1 / energy.power)
    for i in range(n):
        share = ((weight[i] * x[i]) ** 2 + smooth * smooth) / length**2
        factor = share ** (energy.power / 2 - 1) * weight[i] ** 2 / length
        out_slope[i] = factor * x[i]
        out_curve[i] = (energy.power - 1) * factor
    return length, (energy.power - 1) / length


@jit_part
def _beyond(x: float, kept: float) -> tuple[float, float]:
    """By how much a share of a limit exceeds what is kept, and the sign of the share."""
    return max(abs(x) - kept, 0.0), 1.0 if x > 0.0 else -1.0


@jit_part
def _outside(x: float, lower: float, upper: float) -> tuple[float, float]:
    """By how much a joint is beyond the inside of its range, rad, and on which side."""
    if x > upper - INSIDE:
        return x - upper + INSIDE, 1.0
    return max(lower + INSIDE - x, 0.0), -1.0


@jit_part
def _fill_change(energy: Energy, q: Array, out: Array) -> None:
    """Fill the largest change (n,) rad of an increment at joints q (n,)."""
    if len(energy.table.joint_2) > 0:
        fill_change(energy.table, q[1], q[2], energy.acceleration, out)
    else:
        out[:] = energy.acceleration


@jit_part
def _value(
    q: Array, energy: Energy, scale: float, slope: Array, curve: Array, x: Array, most: Array
) -> float:
    """Energy of a motion q (K, n); the other arrays (n,) are scratch."""
    K, n = q.shape
    value = 0.0
    for k in range(K):
        for i in range(n):
            beyond, _ = _outside(q[k, i], energy.lower[i], energy.upper[i])
            value += 0.5 * OF_RANGES * beyond * beyond
        if k == K - 1:
            break
        _fill_change(energy, q[k], most)
        for i in range(n):
            x[i] = q[k + 1, i] - q[k, i]
            beyond, _ = _beyond(x[i] / energy.velocity[i], KEPT[0])
            value += 0.5 * energy.price * beyond * beyond
            if k > 0:
                change = x[i] - q[k, i] + q[k - 1, i]
                beyond, _ = _beyond(change / most[i], KEPT[1])
                value += 0.5 * energy.price * beyond * beyond
        length, _ = _distance(x, energy, slope, curve)
        value += scale * (length / scale) ** OF_LARGEST / OF_LARGEST if energy.minimax else length
    return value


@jit
def energies(q: Array, energy: Energy, scale: Array, out: Array) -> None:
    """Fill the energies (S,) of motions q (S, K, n) rad; infinite for one that is out of reach.

    With (15) a motion has the typical largest distance scale (S,).
    """
    n = q.shape[2]
    slope, curve, x, most = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for s in range(len(q)):
        out[s] = np.inf
        if np.isfinite(q[s]).all():
            out[s] = _value(q[s], energy, scale[s], slope, curve, x, most)


@jit_part
def _fill_model(
    q: Array, first: Array, second: Array, energy: Energy, scale: float,
    by_joint: Array, gradient: Array, bands: Array,
) -> None:  # fmt: skip
    """Fill gradient (K,) and bands (K, 3) of a motion: bands[k, j] couples nodes k and k - j.

    first, second (K, n): derivatives of the joints by gamma. by_joint (K, n) is scratch.
    """
    K, n = q.shape
    slope, curve, x, most = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    by_joint[:] = 0.0
    bands[:] = 0.0
    for k in range(K - 1):
        for i in range(n):
            x[i] = q[k + 1, i] - q[k, i]
        length, coupled = _distance(x, energy, slope, curve)
        factor = 1.0
        if energy.minimax:
            factor = (length / scale) ** (OF_LARGEST - 1)
            rise = (OF_LARGEST - 1) / scale * (length / scale) ** (OF_LARGEST - 2)
            for i in range(n):
                curve[i] *= factor
            coupled = coupled * factor - rise
        along = along_next = own = own_next = across = 0.0
        for i in range(n):
            here, there = first[k, i], first[k + 1, i]
            along += slope[i] * here
            along_next += slope[i] * there
            force, stiff = factor * slope[i], curve[i]
            beyond, sign = _beyond(x[i] / energy.velocity[i], KEPT[0])
            if beyond > 0.0:
                force += energy.price * beyond * sign / energy.velocity[i]
                stiff += energy.price / energy.velocity[i] ** 2
            by_joint[k + 1, i] += force
            by_joint[k, i] -= force
            own += stiff * here * here
            own_next += stiff * there * there
            across += stiff * here * there
        bands[k, 0] += own - coupled * along * along
        bands[k + 1, 0] += own_next - coupled * along_next * along_next
        bands[k + 1, 1] -= across - coupled * along * along_next
    for k in range(1, K - 1):
        _fill_change(energy, q[k], most)
        for i in range(n):
            change = q[k + 1, i] - 2 * q[k, i] + q[k - 1, i]
            beyond, sign = _beyond(change / most[i], KEPT[1])
            if beyond > 0.0:
                force = energy.price * beyond * sign / most[i]
                stiff = energy.price / most[i] ** 2
                by_joint[k + 1, i] += force
                by_joint[k, i] -= 2 * force
                by_joint[k - 1, i] += force
                before, here, after = first[k - 1, i], -2 * first[k, i], first[k + 1, i]
                bands[k - 1, 0] += stiff * before * before
                bands[k, 0] += stiff * here * here
                bands[k + 1, 0] += stiff * after * after
                bands[k, 1] += stiff * before * here
                bands[k + 1, 1] += stiff * here * after
                bands[k + 1, 2] += stiff * before * after
    for k in range(K):
        bent = gradient[k] = 0.0
        for i in range(n):
            beyond, sign = _outside(q[k, i], energy.lower[i], energy.upper[i])
            if beyond > 0.0:
                by_joint[k, i] += OF_RANGES * beyond * sign
                bands[k, 0] += OF_RANGES * first[k, i] ** 2
            gradient[k] += by_joint[k, i] * first[k, i]
            bent += by_joint[k, i] * second[k, i]
        bands[k, 0] += max(bent, 0.0)


@jit_part
def _solve(bands: Array, damping: float, gradient: Array, factors: Array, out: Array) -> bool:
    """Solve (H + damping |diagonal|) out = -gradient; False if H is not positive definite.

    H has five diagonals; factors (K, 3) is scratch for its factors L D L^T.
    """
    K = len(gradient)
    for k in range(K):
        diagonal = bands[k, 0] + damping * (abs(bands[k, 0]) + 1e-6)
        two = bands[k, 2] / factors[k - 2, 0] if k > 1 else 0.0
        one = bands[k, 1] if k > 0 else 0.0
        if k > 1:
            one -= two * factors[k - 2, 0] * factors[k - 1, 1]
            diagonal -= two * two * factors[k - 2, 0]
        if k > 0:
            one /= factors[k - 1, 0]
            diagonal -= one * one * factors[k - 1, 0]
        if not diagonal > 1e-12 * abs(bands[k, 0]) + 1e-300:
            return False
        factors[k, 0], factors[k, 1], factors[k, 2] = diagonal, one, two
    for k in range(K):
        out[k] = -gradient[k]
        if k > 0:
            out[k] -= factors[k, 1] * out[k - 1]
        if k > 1:
            out[k] -= factors[k, 2] * out[k - 2]
    for k in range(K):
        out[k] /= factors[k, 0]
    for k in range(K - 1, -1, -1):
        if k + 1 < K:
            out[k] -= factors[k + 1, 1] * out[k + 1]
        if k + 2 < K:
            out[k] -= factors[k + 2, 2] * out[k + 2]
    return True


@jit
def newton_steps(
    q: Array, first: Array, second: Array, energy: Energy, scale: Array, most: float,
    damping: Array, out: Array,
) -> None:  # fmt: skip
    """Fill steps of gamma (S, K) rad of motions q (S, K, n), no longer than `most` at any node.

    first, second (S, K, n): derivatives of the joints by gamma. damping (S,) grows where a Hessian
    is not positive definite.
    """
    S, K, n = q.shape
    by_joint, bands, factors = np.empty((K, n)), np.empty((K, 3)), np.empty((K, 3))
    gradient = np.empty(K)
    for s in range(S):
        out[s] = 0.0
        _fill_model(q[s], first[s], second[s], energy, scale[s], by_joint, gradient, bands)
        for _ in range(MOST_TRIES):
            if _solve(bands, damping[s], gradient, factors, out[s]):
                break
            damping[s] = max(MORE_DAMPED * damping[s], DAMPED)
        longest = np.abs(out[s]).max()
        if not longest <= most:
            out[s] *= most / longest if longest < np.inf else 0.0
