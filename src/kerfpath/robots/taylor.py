"""Numbers that depend on several parameters: a quadratic polynomial, and a bound on the rest.

A Taylor model of second order encloses a function f of parameters s_j, |s_j| <= h_j:

    f(s) in v + sum_j g_j s_j + sum_{j <= k} Q_jk s_j s_k +- e      for all of them.

Sums and products keep what terms have in common, so that a chain of them loses only terms of third
order (Makino and Berz, "Taylor models and other validated functional inclusion methods", 2003). A
function of a model is its second-order expansion, with Taylor's remainder at the worst argument.

Rounding is in e: a sum or product of floats errs by at most half a unit in the last place, and
every operation adds several units of the sizes of its terms. Sines, cosines and arctangents are
taken to be accurate to four units, as in `kerfpath.kernels.intervals`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, short_repr

__all__ = ["Region", "Taylor", "angle_of", "either"]

UNIT = 2.0**-52
SAFE = 32 * UNIT
"""Rounding of one operation as a share of the sizes of its terms: a dozen operations, doubled."""
UP, DOWN = 1.0 + 2.0**-45, 1.0 - 2.0**-45
"""Factors that cover the roundings of a sum of up to thirty sizes."""
TINY = 1e-300
SMALL = 1e-12
"""Length (m) or sine at which the direction of a vector counts as unknown."""
CURVED = 1.5
"""Factor by which a polynomial may be wider than a bound without parameters; else that is used."""
HALF_TURN = np.pi * UP


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """The ranges of the parameters of C cells, and the pairs j <= k of a quadratic polynomial.

    Parameters
    ----------
    half : (M, C)
        |s_j| <= h_j.
    first, second : (N,)
        j and k of each pair.
    both : (N, C)
        h_j h_k.
    """

    half: Array
    first: Ints
    second: Ints
    both: Array

    __repr__ = short_repr

    @staticmethod
    def of(half: Array) -> Region:
        """Return the region with half-widths (M, C)."""
        first, second = np.triu_indices(len(half))
        return Region(half, first, second, half[first] * half[second] * UP)

    def parameters(self, middle: Array) -> list[Taylor]:
        """Return the parameters themselves: middle (M, C) + s."""
        found = []
        for j, at in enumerate(middle):
            one = self.constant(at, TINY)
            one.line[1 + j] = 1.0
            found.append(one)
        return found

    def constant(self, value: Array | float, error: Array | float = TINY) -> Taylor:
        """Return numbers (C,) that are known up to an error and do not depend on parameters."""
        C = self.half.shape[1]
        line = np.zeros((1 + len(self.half), C))
        line[0] = value
        return Taylor(line, np.zeros(self.both.shape), np.zeros(C) + error, self)


@dataclass(frozen=True, slots=True, eq=False)
class Taylor:
    """Taylor models of C cells with M parameters.

    Parameters
    ----------
    line : (1 + M, C)
        v and g.
    quad : (N, C)
        Q of each pair.
    rest : (C,)
        e, not negative.
    region : Region
    """

    line: Array
    quad: Array
    rest: Array
    region: Region

    __repr__ = short_repr

    @property
    def value(self) -> Array:
        """The value v in the middle of the region, (C,)."""
        return np.asarray(self.line[0])

    @property
    def sway(self) -> Array:
        """Bound (C,) on the linear part."""
        return np.asarray((np.abs(self.line[1:]) * self.region.half).sum(axis=0) * UP)

    @property
    def curve(self) -> Array:
        """Bound (C,) on the quadratic part."""
        return np.asarray((np.abs(self.quad) * self.region.both).sum(axis=0) * UP)

    @property
    def away(self) -> Array:
        """Bound (C,) on the distance of the function from v."""
        return np.asarray((self.sway + self.curve + self.rest) * UP)

    def bounds(self) -> tuple[Array, Array]:
        """Return the least and the largest value, (C,) each."""
        away = self.away + SAFE * np.abs(self.value)
        return self.value - away, self.value + away

    def __neg__(self) -> Taylor:
        return Taylor(-self.line, -self.quad, self.rest, self.region)

    def __add__(self, other: Taylor) -> Taylor:
        line, quad = self.line + other.line, self.quad + other.quad
        size = np.abs(self.value) + np.abs(other.value)
        size = size + self.sway + other.sway + self.curve + other.curve
        rest = (self.rest + other.rest + SAFE * size) * UP + TINY
        return Taylor(line, quad, rest, self.region)

    def __sub__(self, other: Taylor) -> Taylor:
        return self + -other

    def __mul__(self, other: Taylor) -> Taylor:
        a, b, region = self.value, other.value, self.region
        line = a * other.line + b * self.line
        line[0] = a * b
        quad = a * other.quad + b * self.quad + _pairs(self, other)
        A, B, S, T, U, V = *map(np.abs, (a, b)), self.sway, other.sway, self.curve, other.curve
        rest = S * V + U * T + U * V
        rest = rest + self.rest * (B + T + V + other.rest) + other.rest * (A + S + U)
        size = (A + S + U) * (B + T + V)
        return Taylor(line, quad, (rest + SAFE * size) * UP + TINY, region)

    def plus(self, number: float | Array, error: float | Array = 0.0) -> Taylor:
        """Return the sum with a number that is known up to an error."""
        line = self.line.copy()
        line[0] += number
        rounding = SAFE * (np.abs(self.value) + np.abs(number))
        return Taylor(line, self.quad, (self.rest + error + rounding) * UP + TINY, self.region)

    def scaled(self, number: float | Array, error: float | Array = 0.0) -> Taylor:
        """Return the product with a number that is known up to an error."""
        size, known = np.abs(number), np.abs(self.value) + self.sway + self.curve
        rest = size * self.rest + error * (known + self.rest) + SAFE * size * known
        return Taylor(self.line * number, self.quad * number, rest * UP + TINY, self.region)

    def sqrt(self) -> Taylor:
        """Return the square root, where there is one."""
        low, high = self.bounds()
        fine = (low > SMALL * SMALL) & np.isfinite(high)
        v, least = np.where(fine, self.value, 1.0), np.where(fine, low, 1.0)
        root, bottom = np.sqrt(v), np.sqrt(least)
        third = 0.375 / (least * least * bottom)
        curve = self._expanded(root, 0.5 / root, -0.25 / (v * root), third)
        ends = np.sqrt(np.maximum(low, 0.0)), np.sqrt(np.maximum(high, 0.0))
        box = self._between(*ends)
        return either(fine & (curve.away <= CURVED * box.away), curve, box)

    def cos_sin(self) -> tuple[Taylor, Taylor]:
        """Return cosine and sine of an angle."""
        c, s, away = np.cos(self.value), np.sin(self.value), self.away
        most = np.minimum(np.abs(s) + away, 1.0), np.minimum(np.abs(c) + away, 1.0)
        found = []
        for value, slope, third in ((c, -s, most[0]), (s, c, most[1])):
            curve = self._expanded(value, slope, -value, third)
            found.append(either(curve.away < 1.0, curve, self.region.constant(0.0, 1.0)))
        return found[0], found[1]

    def arccos(self) -> Taylor:
        """Return the angle in [0, pi] with this cosine, which is clipped to [-1, 1]."""
        low, high = (np.clip(end, -1.0, 1.0) for end in self.bounds())
        most = np.maximum(np.abs(low), np.abs(high))
        fine = (most < 1.0 - SMALL) & np.isfinite(self.away)
        v, top = np.where(fine, self.value, 0.0), np.where(fine, most, 0.0)
        square, least = (1.0 - v) * (1.0 + v), (1.0 - top) * (1.0 + top)
        sine = np.sqrt(square)
        third = (1.0 + 2.0 * top * top) / (least * least * np.sqrt(least))
        curve = self._expanded(np.arctan2(sine, v), -1.0 / sine, -v / (square * sine), third)
        ends = [np.arctan2(np.sqrt((1.0 - c) * (1.0 + c)), c) for c in (high, low)]
        box = self._between(ends[0] - SAFE, ends[1] + SAFE)
        return either(fine & (curve.away <= CURVED * box.away), curve, box)

    def _expanded(self, value: Array, first: Array, second: Array, third: Array) -> Taylor:
        """Return a function with value and derivatives at v, the third bounded everywhere."""
        line = first * self.line
        line[0] = value
        quad = first * self.quad + 0.5 * second * _pairs(self, self)
        S, U, e, away = self.sway, self.curve, self.rest, self.away
        steep, bent = np.abs(first), 0.5 * np.abs(second)
        rest = steep * e + bent * (2 * S + U + e) * (U + e) + third * away**3 / 6.0
        size = np.abs(value) + steep * (np.abs(self.value) + S + U) + bent * S * S + 1.0
        rest = (rest + SAFE * size) * UP + TINY
        return Taylor(line, quad, np.where(np.isnan(rest), np.inf, rest), self.region)

    def _between(self, low: Array, high: Array) -> Taylor:
        """Return numbers of which only the ends are known."""
        error = 0.5 * (high - low) + SAFE * (np.abs(low) + np.abs(high))
        return self.region.constant(0.5 * (low + high), error * UP + TINY)


def _pairs(a: Taylor, b: Taylor) -> Array:
    """Return the coefficients (N, C) of the product of the linear parts."""
    j, k = a.region.first, a.region.second
    g, f = a.line[1:], b.line[1:]
    both = g[j] * f[k]
    off = j != k
    both[off] += g[k[off]] * f[j[off]]
    return both


def either(which: Bools, one: Taylor, other: Taylor) -> Taylor:
    """Return one model where `which` (C,) holds, and the other elsewhere."""
    return Taylor(
        np.where(which, one.line, other.line),
        np.where(which, one.quad, other.quad),
        np.where(which, one.rest, other.rest),
        one.region,
    )


def angle_of(y: Taylor, x: Taylor) -> Taylor:
    """Return the angle atan2(y, x), continuous where it is known.

    Where the vector may vanish the angle is free: any angle is within half a turn of zero.
    """
    size = np.hypot(x.value, y.value)
    off = np.hypot(x.away, y.away) * UP
    gaps = np.abs(x.value) - x.away, np.abs(y.value) - y.away
    # All vectors are in a box and in a disk; from the middle of either none passes the origin.
    nearest = np.hypot(np.maximum(gaps[0], 0.0), np.maximum(gaps[1], 0.0))
    nearest = np.maximum(nearest, size - off) * DOWN
    fine = (nearest > SMALL) & np.isfinite(off)
    rho, low = np.where(fine, size, 1.0), np.where(fine, nearest, 1.0)
    c, s = np.where(fine, x.value / rho, 1.0), np.where(fine, y.value / rho, 0.0)
    a = (x.scaled(c) + y.scaled(s)).scaled(1.0 / rho, UNIT / rho).plus(-1.0)
    b = (y.scaled(c) - x.scaled(s)).scaled(1.0 / rho, UNIT / rho)
    # The angle is the imaginary part of log(1 + a + i b) = b - a b + .., whose third derivative
    # along a line is at most 2 by the cube of the distance from -1.
    moved = np.minimum(np.hypot(a.away, b.away), off / rho) * UP
    turned = np.arctan2(y.value, x.value)
    found = (b - a * b).plus(turned, (moved * rho / low) ** 3 / 3.0 * UP + 16.0 * SAFE)
    found.line[0] = turned
    rest = found.rest + np.abs(b.value) + np.abs(a.value)
    curve = Taylor(found.line, found.quad, np.where(np.isnan(rest), np.inf, rest), x.region)
    around = np.where(off < rho, np.arcsin(np.minimum(off / rho, 1.0)), np.pi) * UP + 16.0 * SAFE
    box = x.region.constant(turned, around)
    found = either(curve.away <= CURVED * box.away, curve, box)
    free = x.region.constant(0.0, HALF_TURN)
    return either(fine & (found.away < HALF_TURN), found, free)
