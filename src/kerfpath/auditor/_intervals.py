"""Intervals of real numbers with outward rounding, as arrays.

An operation on intervals returns an interval that contains the result of the same operation on any
real numbers in them (Moore, Kearfott and Cloud, "Introduction to Interval Analysis", 2009). A bound
of NaN means not known, and stays NaN in every operation except `meet`.

The basic operations round to nearest (IEEE 754), so widening by one unit in the last place is
enough. numpy's arctangents are assumed to be accurate to four units of their own last place, its
sines and cosines to four units of the last place of 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools
from kerfpath._repr import short_repr

__all__ = ["HALF_TURN", "Interval", "exact", "stack"]

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
