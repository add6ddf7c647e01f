"""Lines, arcs and splines; the normal of a flat drawing is +z."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline

from kerfpath._arrays import Array
from kerfpath._repr import short_repr
from kerfpath.cad._sample import AROUND

__all__ = ["NOTHING", "UP", "Arc", "Curve", "Line", "Mark", "Spline", "backwards", "turned"]

Mark = tuple[float, ...]
NOTHING = 1e-6
"""mm: shorter curves have no length; curves that differ by less are the same."""
UP = (0.0, 0.0, 1.0)
"""The normal of a flat drawing."""
GAUSS = np.polynomial.legendre.leggauss(12)
"""Nodes and weights on (-1, 1); 12 per smooth stretch give the length of drawn curves to 1e-9."""
LOOK = 64
"""Number of points per stretch of a spline from which its bounding box is taken."""


class _Flat(ABC):
    """Base class of curves (see `Edge`); each has start, end, normal `up`, `at` and `speed`."""

    start: float
    end: float
    up: tuple[float, ...]

    @cached_property
    def ends(self) -> Array:
        return self.at(np.array([self.start, self.end]))

    @cached_property
    def mark(self) -> Mark:
        """Numbers that are the same for two curves that coincide, in either direction."""
        points = self.at(np.linspace(self.start, self.end, 5))
        rounded = (np.round(points / (10 * NOTHING)) + 0.0).tolist()
        ends, inner = sorted(rounded[::4]), sorted(rounded[1:4])
        return tuple(v for point in (*ends, *inner) for v in point)

    @cached_property
    def around(self) -> Array:
        return self.at(np.linspace(self.start, self.end, AROUND, endpoint=False))

    @cached_property
    def length(self) -> float:
        breaks = self.breaks()
        half, middle = np.diff(breaks)[:, None] / 2, (breaks[1:] + breaks[:-1])[:, None] / 2
        speed = self.speed((middle + half * GAUSS[0]).ravel()).reshape(len(half), -1)
        return float(np.abs(half[:, 0]) @ (speed @ GAUSS[1]))

    def bounds(self) -> Array:
        points = self.at(self.extremes())
        return np.stack([points.min(axis=0), points.max(axis=0)])

    def breaks(self) -> Array:
        return np.array([self.start, self.end])

    def extremes(self) -> Array:
        """Return parameters (K,) at which coordinates are least and greatest."""
        return self.breaks()

    def evaluate(self, t: Array) -> tuple[Array, Array]:
        """Return points (K, 3) mm and normals (K, 3), all the same."""
        return self.at(t), np.tile(self.up, (len(t), 1))

    @abstractmethod
    def at(self, t: Array) -> Array:
        """Return points (K, 3) mm."""

    @abstractmethod
    def speed(self, t: Array) -> Array:
        """Return the length (K,) mm of the derivative."""


@dataclass(frozen=True)
class Line(_Flat):
    """The segment from `p` to `q`, (3,) mm."""

    p: Array
    q: Array
    start: float = 0.0
    end: float = 1.0
    up: tuple[float, ...] = UP

    __repr__ = short_repr

    def at(self, t: Array) -> Array:
        return np.asarray(self.p + t[:, None] * (self.q - self.p))

    def speed(self, t: Array) -> Array:
        return np.full(len(t), np.linalg.norm(self.q - self.p))


@dataclass(frozen=True)
class Arc(_Flat):
    """Part of a circle or an ellipse: centre + cos(t) major + sin(t) minor, all (3,) mm."""

    centre: Array
    major: Array
    minor: Array
    start: float
    end: float
    up: tuple[float, ...] = UP

    __repr__ = short_repr

    def at(self, t: Array) -> Array:
        return np.asarray(
            self.centre + np.cos(t)[:, None] * self.major + np.sin(t)[:, None] * self.minor
        )

    def speed(self, t: Array) -> Array:
        d = np.cos(t)[:, None] * self.minor - np.sin(t)[:, None] * self.major
        return np.asarray(np.linalg.norm(d, axis=1))

    def breaks(self) -> Array:
        """Return quarters, because the flat sides of an ellipse are nearly straight."""
        quarters = int(np.ceil(abs(self.end - self.start) / (np.pi / 2) - 1e-9))
        return np.linspace(self.start, self.end, max(1, quarters) + 1)

    def extremes(self) -> Array:
        """Return the ends, and the extremes of x, y and z between them."""
        low, high = sorted((self.start, self.end))
        turns = np.arctan2(self.minor, self.major)
        k = np.arange(np.floor(low / np.pi) - 1, np.ceil(high / np.pi) + 1)
        t = (turns[:, None] + k * np.pi).ravel()
        return np.concatenate([[low, high], t[(t > low) & (t < high)]])


@dataclass(frozen=True)
class Spline(_Flat):
    """A rational B-spline: `homogeneous` gives (x w, y w, z w, w)."""

    homogeneous: BSpline
    start: float
    end: float
    up: tuple[float, ...] = UP

    def at(self, t: Array) -> Array:
        p = self.homogeneous(t)
        return np.asarray(p[:, :3] / p[:, 3:])

    def speed(self, t: Array) -> Array:
        p, d = self.homogeneous(t), self.homogeneous(t, 1)
        return np.asarray(
            np.linalg.norm((d[:, :3] - d[:, 3:] * p[:, :3] / p[:, 3:]) / p[:, 3:], axis=1)
        )

    def breaks(self) -> Array:
        """Return the knots between the ends."""
        low, high = sorted((self.start, self.end))
        knots = np.unique(self.homogeneous.t)
        t = np.concatenate([[low], knots[(knots > low) & (knots < high)], [high]])
        return t if self.start < self.end else t[::-1]

    def extremes(self) -> Array:
        """Return many parameters, some within a thousandth of a stretch of the true extremes."""
        breaks = self.breaks()
        part = np.linspace(0.0, 1.0, LOOK, endpoint=False)
        inside = (breaks[:-1, None] + np.diff(breaks)[:, None] * part).ravel()
        return np.append(inside, breaks[-1])


Curve = Line | Arc | Spline


def backwards(curve: Curve) -> Curve:
    """Return the curve in the opposite direction."""
    return replace(curve, start=curve.end, end=curve.start)


def turned(curve: Curve, R: Array, up: tuple[float, ...]) -> Curve:
    """Return the curve turned by a rotation (3, 3), with the normal `up`."""
    if isinstance(curve, Line):
        return replace(curve, p=R @ curve.p, q=R @ curve.q, up=up)
    if isinstance(curve, Arc):
        centre, major, minor = R @ curve.centre, R @ curve.major, R @ curve.minor
        return replace(curve, centre=centre, major=major, minor=minor, up=up)
    spline = curve.homogeneous
    net = np.column_stack([spline.c[:, :3] @ R.T, spline.c[:, 3]])
    return replace(curve, homogeneous=BSpline(spline.t, net, spline.k), up=up)
