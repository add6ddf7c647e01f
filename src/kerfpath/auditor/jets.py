"""Functions of t in [-h, h], enclosed with their first and second derivatives.

A jet has value and derivative at t = 0, and value and both derivatives over all of [-h, h]. The
operations are second-order automatic differentiation over intervals; after each one, Taylor's
formula from t = 0 narrows the results over [-h, h]. A derivative that does not exist or is not
bounded, such as that of a square root that may reach zero, is NaN: not known. A known second
derivative over [-h, h] therefore also proves that the function is defined and smooth there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Bools, short_repr

# -----------------------------------------------------------------------------
# Intervals of real numbers with outward rounding, as arrays.
#
# An operation on intervals returns an interval that contains the result of the same operation on
# any real numbers in them (Moore, Kearfott and Cloud, "Introduction to Interval Analysis", 2009).
# A bound of NaN means not known, and stays NaN in every operation except `meet`.
#
# The basic operations round to nearest (IEEE 754), so widening by one unit in the last place is
# enough. numpy's arctangents are assumed to be accurate to four units of their own last place,
# its sines and cosines to four units of the last place of 1.

UNIT = 2.0**-52
"""Share of a number that is one to two of its units in the last place."""
TINY = 1e-300
"""Larger than any loss by underflow."""
LIBRARY = 5 * UNIT
"""Error of a sine or cosine, and relative error of an arctangent: four units, and one more."""


@dataclass(frozen=True, slots=True, eq=False)
class Interval:
    """Intervals [lo, hi], elementwise; shapes broadcast.

    Parameters
    ----------
    lo, hi : array
        Ends, lo <= hi, or NaN where nothing is known.
    """

    lo: Array
    hi: Array

    __repr__ = short_repr
    __array_ufunc__ = None  # an array on the left leaves the operation to the interval

    def __neg__(self) -> Interval:
        return Interval(-self.hi, -self.lo)

    def __add__(self, other: Interval) -> Interval:
        return _outward(self.lo + other.lo, self.hi + other.hi)

    def __sub__(self, other: Interval) -> Interval:
        return _outward(self.lo - other.hi, self.hi - other.lo)

    def __mul__(self, other: Interval) -> Interval:
        a, b = self.lo * other.lo, self.lo * other.hi
        c, d = self.hi * other.lo, self.hi * other.hi
        return _outward(
            np.minimum(np.minimum(a, b), np.minimum(c, d)),
            np.maximum(np.maximum(a, b), np.maximum(c, d)),
        )

    def __truediv__(self, other: Interval) -> Interval:
        zero = (other.lo <= 0) & (other.hi >= 0)
        inverse = _outward(
            1 / np.where(zero, np.nan, other.hi), 1 / np.where(zero, np.nan, other.lo)
        )
        return self * inverse

    def __getitem__(self, index: Any) -> Interval:
        return Interval(self.lo[index], self.hi[index])

    def broadcast_to(self, shape: tuple[int, ...]) -> Interval:
        return Interval(np.broadcast_to(self.lo, shape), np.broadcast_to(self.hi, shape))

    def scaled(self, number: ArrayLike) -> Interval:
        """Return the product with exact numbers."""
        factor = np.asarray(number, dtype=float)
        a, b = self.lo * factor, self.hi * factor
        return _outward(np.minimum(a, b), np.maximum(a, b))

    def square(self) -> Interval:
        """Return the square, which is not negative."""
        a, b = self.lo * self.lo, self.hi * self.hi
        low = np.where((self.lo <= 0) & (self.hi >= 0), 0.0, np.minimum(a, b))
        out = _outward(low, np.maximum(a, b))
        return Interval(np.maximum(out.lo, 0.0), out.hi)

    def sqrt(self) -> Interval:
        """Return the square root of the part that is not negative; zero if all is negative."""
        out = _outward(np.sqrt(np.maximum(self.lo, 0.0)), np.sqrt(np.maximum(self.hi, 0.0)))
        return Interval(np.maximum(out.lo, 0.0), out.hi)

    def atan(self) -> Interval:
        """Return the arctangent, rad."""
        return _outward(np.arctan(self.lo), np.arctan(self.hi), LIBRARY)

    def cos_sin(self) -> tuple[Interval, Interval]:
        """Return cosine and sine of angles (rad); [-1, 1] where nothing is known.

        They use the sum of angles from the middle of each interval, and are tight for intervals of
        less than half a turn.
        """
        middle = self.middle()
        off = self.radius(middle)
        cos, sin = np.cos(middle), np.sin(middle)
        c, s = Interval(cos - LIBRARY, cos + LIBRARY), Interval(sin - LIBRARY, sin + LIBRARY)
        least = np.where(off < np.pi, np.cos(np.minimum(off, np.pi)), -1.0)
        most = np.where(off < np.pi / 2, np.sin(np.minimum(off, np.pi)), 1.0)
        near = Interval(least - LIBRARY, np.ones_like(least))
        side = Interval(-most - LIBRARY, most + LIBRARY)
        one = Interval(np.array(-1.0), np.array(1.0))
        return (c * near - s * side).meet(one), (s * near + c * side).meet(one)

    def meet(self, other: Interval) -> Interval:
        """Return the intersection; an end that is unknown in one is taken from the other."""
        return Interval(np.fmax(self.lo, other.lo), np.fmin(self.hi, other.hi))

    def middle(self) -> Array:
        """Return a number near the middle of each."""
        return np.asarray(0.5 * (self.lo + self.hi))

    def radius(self, middle: Array) -> Array:
        """Return bounds on the distance of each interval's ends from given numbers."""
        off = np.maximum(self.hi - middle, middle - self.lo)
        return np.asarray(off + (UNIT * np.abs(off) + TINY))

    def swept(self, half: Array) -> Interval:
        """Return the products with the interval [-half, half]."""
        most = half * self.magnitude()
        most = most + (UNIT * most + TINY)
        return Interval(-most, most)

    def magnitude(self) -> Array:
        """Return the largest absolute value of each."""
        return np.maximum(np.abs(self.lo), np.abs(self.hi))

    def known(self) -> Bools:
        """Return where both ends are finite."""
        return np.asarray(np.isfinite(self.lo) & np.isfinite(self.hi))


def exact(value: ArrayLike) -> Interval:
    """Return numbers as intervals of zero width."""
    array = np.asarray(value, dtype=float)
    return Interval(array, array)


def stack(intervals: list[Interval]) -> Interval:
    """Return intervals of one shape as one, along a new first axis."""
    return Interval(np.stack([i.lo for i in intervals]), np.stack([i.hi for i in intervals]))


def _outward(lo: Array, hi: Array, share: float = UNIT) -> Interval:
    """Return [lo, hi] widened by a share of its ends: by default at least one unit of each."""
    return Interval(lo - (share * np.abs(lo) + TINY), hi + (share * np.abs(hi) + TINY))


HALF_TURN = _outward(np.array(np.pi), np.array(np.pi))
"""An interval that contains pi."""


# -----------------------------------------------------------------------------
# Functions of t in [-h, h], enclosed with their first and second derivatives.


@dataclass(frozen=True, slots=True, eq=False)
class Jet:
    """A function of t, elementwise.

    Parameters
    ----------
    at, slope : Interval
        Value and first derivative at t = 0.
    value, rate, bend : Interval
        Value, first and second derivative anywhere in [-half, half]. The value contains every
        value of the function where it is defined; the derivatives are known only if it is defined
        everywhere.
    half : array
        The half-width h, not negative.
    """

    at: Interval
    slope: Interval
    value: Interval
    rate: Interval
    bend: Interval
    half: Array

    __repr__ = short_repr

    def __getitem__(self, index: Any) -> Jet:
        """Return some of the functions; t does not depend on the axes that are indexed."""
        return Jet(
            self.at[index],
            self.slope[index],
            self.value[index],
            self.rate[index],
            self.bend[index],
            self.half,
        )

    def broadcast_to(self, shape: tuple[int, ...]) -> Jet:
        """Return the functions in a shape; its last axis is that of t."""
        return Jet(
            self.at.broadcast_to(shape),
            self.slope.broadcast_to(shape),
            self.value.broadcast_to(shape),
            self.rate.broadcast_to(shape),
            self.bend.broadcast_to(shape),
            self.half,
        )

    def __neg__(self) -> Jet:
        return Jet(-self.at, -self.slope, -self.value, -self.rate, -self.bend, self.half)

    def __add__(self, other: Jet) -> Jet:
        return _narrowed(
            self.at + other.at,
            self.slope + other.slope,
            self.value + other.value,
            self.rate + other.rate,
            self.bend + other.bend,
            self.half,
        )

    def __sub__(self, other: Jet) -> Jet:
        return self + -other

    def __mul__(self, other: Jet) -> Jet:
        a, b = self, other
        return _narrowed(
            a.at * b.at,
            a.at * b.slope + a.slope * b.at,
            a.value * b.value,
            a.value * b.rate + a.rate * b.value,
            a.value * b.bend + (a.rate * b.rate).scaled(2.0) + a.bend * b.value,
            a.half,
        )

    def times(self, factor: Interval) -> Jet:
        """Return the product with a number that does not depend on t."""
        return _narrowed(
            self.at * factor,
            self.slope * factor,
            self.value * factor,
            self.rate * factor,
            self.bend * factor,
            self.half,
        )

    def scaled(self, factor: ArrayLike) -> Jet:
        """Return the product with exact numbers."""
        return Jet(
            self.at.scaled(factor),
            self.slope.scaled(factor),
            self.value.scaled(factor),
            self.rate.scaled(factor),
            self.bend.scaled(factor),
            self.half,
        )

    def plus(self, number: Interval) -> Jet:
        """Return the sum with a number that does not depend on t."""
        return Jet(
            self.at + number, self.slope, self.value + number, self.rate, self.bend, self.half
        )

    def square(self) -> Jet:
        """Return the square."""
        return _narrowed(
            self.at.square(),
            (self.at * self.slope).scaled(2.0),
            self.value.square(),
            (self.value * self.rate).scaled(2.0),
            (self.value * self.bend + self.rate.square()).scaled(2.0),
            self.half,
        )

    def sqrt(self) -> Jet:
        """Return the square root, on the part of [-h, h] where there is one."""
        at, value = self.at.sqrt(), self.value.sqrt()
        rate = self.rate / value.scaled(2.0)
        return _narrowed(
            at,
            self.slope / at.scaled(2.0),
            value,
            rate,
            (self.bend.scaled(0.5) - rate.square()) / value,
            self.half,
        )

    def cos_sin(self) -> tuple[Jet, Jet]:
        """Return cosine and sine of an angle; they are in [-1, 1] even if the angle is unknown."""
        c0, s0 = self.at.cos_sin()
        c, s = self.value.cos_sin()
        square = self.rate.square()
        cosine = _narrowed(
            c0, -(s0 * self.slope), c, -(s * self.rate), -(c * square + s * self.bend), self.half
        )
        sine = _narrowed(
            s0, c0 * self.slope, s, c * self.rate, c * self.bend - s * square, self.half
        )
        return cosine, sine


def constant(number: Interval, like: Jet) -> Jet:
    """Return a number that does not depend on t as a jet."""
    zero = exact(0.0)
    return Jet(number, zero, number, zero, zero, like.half)


def joined(jets: Sequence[Jet], axis: int = 0) -> Jet:
    """Return jets as one, along an axis that they have; along the last, each has its own t."""

    def along(parts: list[Interval]) -> Interval:
        return Interval(
            np.concatenate([part.lo for part in parts], axis),
            np.concatenate([part.hi for part in parts], axis),
        )

    return Jet(
        along([jet.at for jet in jets]),
        along([jet.slope for jet in jets]),
        along([jet.value for jet in jets]),
        along([jet.rate for jet in jets]),
        along([jet.bend for jet in jets]),
        np.concatenate([jet.half for jet in jets]) if axis == -1 else jets[0].half,
    )


def angle_from(middle: Array, half: Array) -> Jet:
    """Return the angles middle + t, rad."""
    zero, one = exact(np.zeros_like(middle)), exact(np.ones_like(middle))
    t = Interval(-half, half)
    return Jet(exact(middle), one, exact(middle) + t, one, zero, half)


def argument(x: Jet, y: Jet) -> Jet:
    """Return the angle from (1, 0) to (x, y), rad.

    It is continuous where the derivatives are known. Elsewhere its value contains the angle of
    every (x, y) up to full turns.
    """
    c, s = x.value.middle(), y.value.middle()
    size = np.hypot(c, s)
    fine = np.isfinite(size) & (size > 0)
    size = np.where(fine, size, 1.0)
    c, s = np.where(fine, c / size, 1.0), np.where(fine, s / size, 0.0)
    # Relative to a nearby direction the angle is small; the turn changes no derivative.
    turned = np.arctan2(s, c)
    base = Interval(turned - ROUNDED, turned + ROUNDED)
    x, y = x.scaled(c) + y.scaled(s), y.scaled(c) - x.scaled(s)
    size2 = x.value.square() + y.value.square()
    rate = (x.value * y.rate - y.value * x.rate) / size2
    twice = (x.value * x.rate + y.value * y.rate).scaled(2.0)
    bend = (x.value * y.bend - y.value * x.bend - rate * twice) / size2
    slope = (x.at * y.slope - y.at * x.slope) / (x.at.square() + y.at.square())
    out = _narrowed(
        base + _small_angle(x.at, y.at), slope, base + _small_angle(x.value, y.value), rate, bend,
        x.half,
    )  # fmt: skip
    turn = Interval(base.lo - HALF_TURN.hi, base.hi + HALF_TURN.hi)
    known = out.value.known()
    value = Interval(np.where(known, out.value.lo, turn.lo), np.where(known, out.value.hi, turn.hi))
    return Jet(out.at, out.slope, value, out.rate, out.bend, out.half)


ROUNDED = 4e-15
"""rad: error of an arctangent of two numbers (four units of pi) and of a sum with it."""


def _small_angle(x: Interval, y: Interval) -> Interval:
    """Return the angle of (x, y) where x is positive; elsewhere it is not known."""
    ahead = Interval(np.where(x.lo > 0, x.lo, np.nan), np.where(x.lo > 0, x.hi, np.nan))
    return (y / ahead).atan()


def _narrowed(
    at: Interval, slope: Interval, value: Interval, rate: Interval, bend: Interval, half: Array
) -> Jet:
    """Return the jet with value and rate narrowed by Taylor's formula from t = 0."""
    rate = rate.meet(slope + bend.swept(half))
    return Jet(at, slope, value.meet(at + rate.swept(half)), rate, bend, half)
