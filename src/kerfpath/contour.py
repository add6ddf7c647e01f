"""The contour: the paper's augmented line of points and tool axes, its sampling and its frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Ints, floats, freeze, positive, scalar
from kerfpath.errors import InputError
from kerfpath.kernels.frames import closing_twist, rotation_minimising_x, tangent_x

__all__ = ["FRAME_KINDS", "Contour", "FrameKind", "join"]

FrameKind = Literal["tangent", "rotation-minimising"]
FRAME_KINDS: tuple[FrameKind, ...] = ("tangent", "rotation-minimising")

REPEATED_POINT = 1e-9
"""Consecutive nodes closer than this (m) are one point: they leave no direction of travel."""
MOST_NODES = 200_000
"""Nodes that a tolerance may ask for; a sharp corner asks for its length over the tolerance."""
ZERO_AXIS = 1e-9
"""A tool axis shorter than this (any unit) has no direction."""


@dataclass(frozen=True, slots=True, eq=False)
class Contour:
    """Points and tool axes along a cut: the augmented line of section 2.1.

    Between nodes the contour is the polyline through its points, the axis turning evenly.

    Parameters
    ----------
    points : (K, 3) m
        Tool-tip positions; K >= 2, consecutive points distinct.
    axes : (K, 3)
        Tool axes, pointing from the nozzle into the part; any length but zero, kept at length one.
    closed : bool
        True when the path returns to its start. The first node is then repeated at the end
        (p_0 = p_n); it is added when the last point differs from the first.
    s : (K,) m, optional
        Arc length of each node along the path that was sampled; default: along the polyline.
    time : (K,) s, optional
        Time of each node, where a speed has been laid on the contour.
    x : (K, 3), optional
        Direction at each node that gamma counts from, where that is not to follow from the path
        alone (see `frames`), as for a part of a contour.
    name : str
        What messages, reports and programs call it.

    Raises
    ------
    InputError
        Wrong shapes, NaN, fewer than two nodes, repeated points or a zero axis (with the index).
    """

    points: Array
    axes: Array
    closed: bool = False
    s: Array = None  # type: ignore[assignment]  # filled in by __post_init__
    time: Array | None = None
    x: Array | None = None
    name: str = "contour"

    def __post_init__(self) -> None:
        points = floats(self.points, "points", (None, 3))
        axes = _unit(floats(self.axes, "axes", (len(points), 3)))
        if self.closed and len(points) and _distance(points[0], points[-1]) > REPEATED_POINT:
            if self.s is not None or self.time is not None:
                raise InputError(
                    "points: a closed contour with s or time must repeat its first node at the end"
                )
            points, axes = np.vstack([points, points[:1]]), np.vstack([axes, axes[:1]])
        if len(points) < 2:
            raise InputError(f"points: a contour needs at least 2 nodes, got {len(points)}")
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        if (short := np.flatnonzero(steps <= REPEATED_POINT)).size:
            k = int(short[0])
            raise InputError(
                f"points: nodes {k} and {k + 1} are the same point {points[k].tolist()} m; "
                "remove one of them"
            )
        if self.closed:
            points, axes = points.copy(), axes.copy()
            points[-1], axes[-1] = points[0], axes[0]
        s = np.concatenate([[0.0], np.cumsum(steps)]) if self.s is None else self.s
        _set = object.__setattr__
        _set(self, "points", freeze(points))
        _set(self, "axes", freeze(axes))
        _set(self, "closed", bool(self.closed))
        _set(self, "s", _increasing(s, "s", len(points)))
        if self.time is not None:
            _set(self, "time", _increasing(self.time, "time", len(points)))
        if self.x is not None:
            _set(self, "x", floats(self.x, "x", (len(points), 3)))

    def __len__(self) -> int:
        return len(self.points)

    @property
    def length(self) -> float:
        """Length of the path, m."""
        return float(self.s[-1] - self.s[0])

    def at(self, s: ArrayLike) -> tuple[Array, Array]:
        """Return points (..., 3) m and unit axes (..., 3) at arc lengths `s` (...,) m."""
        where = np.clip(np.asarray(s, dtype=float), self.s[0], self.s[-1])
        k = np.clip(np.searchsorted(self.s, where, side="right") - 1, 0, len(self) - 2)
        part = ((where - self.s[k]) / (self.s[k + 1] - self.s[k]))[..., None]
        points = self.points[k] + part * (self.points[k + 1] - self.points[k])
        return points, _turned(self.axes[k], self.axes[k + 1], part)

    def resample(
        self,
        *,
        spacing: float | None = None,
        count: int | None = None,
        tolerance: float | None = None,
        axis_tolerance: float | None = None,
        dt: float | None = None,
        speed: ArrayLike | None = None,
    ) -> Contour:
        """Sample the contour anew, uniformly in arc length or in time (Eq. 1).

        Give exactly one of `spacing`, `count`, `tolerance` (with or without `axis_tolerance`), or
        `dt` together with `speed`. The ends are always nodes.

        Parameters
        ----------
        spacing : float m
            Largest distance between nodes along the path; the path is divided evenly.
        count : int
            Number of nodes, both ends included.
        tolerance : float m
            The fewest evenly spaced nodes whose chords leave this contour by no more than this.
        axis_tolerance : float rad
            With it (or alone): the axis, turned evenly along each chord, also stays this close.
        dt : float s
            Largest time between nodes; the duration is divided evenly.
        speed : float or (K,) m/s
            Speed along the path, constant or at each node of this contour.

        Raises
        ------
        InputError
            No or several ways of sampling given, or a value that is not positive.
        """
        given = {
            "spacing": spacing,
            "count": count,
            "tolerance": tolerance if tolerance is not None else axis_tolerance,
            "dt": dt if dt is not None else speed,
        }
        ways = [name for name, value in given.items() if value is not None]
        if len(ways) != 1:
            raise InputError(
                "resample: give one of spacing=, count=, tolerance=, or dt= with speed=; "
                f"got {', '.join(ways) or 'none'}"
            )
        if count is not None:
            if not (isinstance(count, int | np.integer) and count >= 2):
                raise InputError(f"count: expected a whole number of nodes >= 2, got {count!r}")
            return self._at_nodes(np.linspace(self.s[0], self.s[-1], int(count)))
        if spacing is not None:
            cells = _cells(self.length, scalar(spacing, "spacing", unit="m", above=0.0))
            return self._at_nodes(np.linspace(self.s[0], self.s[-1], cells + 1))
        if dt is not None or speed is not None:
            return self._in_time(dt, speed)
        position = np.inf if tolerance is None else scalar(tolerance, "tolerance", above=0.0)
        angle = (
            np.inf if axis_tolerance is None else scalar(axis_tolerance, "axis_tolerance", above=0)
        )
        return self._at_nodes(self._fewest(position, angle))

    def frames(self, kind: FrameKind = "tangent") -> Array:
        """Return the task frames H_k, (K, 4, 4): x along the path, z along the tool axis.

        "tangent" follows section 2.1; "rotation-minimising" starts there and carries x along
        without rotation about the tool axis, so that neighbouring gamma grids stay aligned; on a
        closed contour the closing twist is spread evenly over the length.

        Raises
        ------
        InputError
            An unknown kind, or a node where path and tool axis are parallel (with its index).
        """
        if kind not in FRAME_KINDS:
            raise InputError(f"frames: expected one of {', '.join(FRAME_KINDS)}, got {kind!r}")
        n, x = self.axes, np.empty_like(self.points)
        if self.x is not None:
            x = self.x - (self.x * n).sum(axis=1, keepdims=True) * n
            x, bad = _unit(x, "x"), -1
        elif kind == "tangent":
            bad = tangent_x(self.points, n, self.closed, x)
        else:
            bad = tangent_x(self.points[:2], n[:2], False, x[:2])
            bad = bad if bad >= 0 else rotation_minimising_x(n, x)
        if bad >= 0:
            raise InputError(
                f"contour {self.name!r}, node {bad}: the tool axis {n[bad].round(4).tolist()} is "
                "parallel to the direction of travel, or reverses; no frame exists there"
            )
        if kind != "tangent" and self.closed and self.x is None:
            angle = (closing_twist(n, x) * (self.s - self.s[0]) / self.length)[:, None]
            x = np.cos(angle) * x + np.sin(angle) * np.cross(n, x)
        H = np.zeros((len(self), 4, 4))
        H[:, :3, 0], H[:, :3, 1], H[:, :3, 2], H[:, :3, 3] = x, np.cross(n, x), n, self.points
        H[:, 3, 3] = 1.0
        return freeze(H)

    @property
    def along(self) -> Array:
        """Directions of travel, (K, 3): unit, normal to the tool axes; errors as in `frames`."""
        return replace(self, x=None).frames("tangent")[:, :3, 0]

    def part(self, first: int, last: int, frames: FrameKind) -> Contour:
        """Return the nodes first to last as an open contour, gamma counting from the same frames.

        Raises
        ------
        InputError
            Fewer than two nodes, or nodes that do not exist.
        """
        if not 0 <= first < last < len(self):
            raise InputError(f"part: expected 0 <= first < last < {len(self)}, got {first}, {last}")
        nodes = slice(first, last + 1)
        return Contour(
            self.points[nodes],
            self.axes[nodes],
            s=self.s[nodes],
            time=None if self.time is None else self.time[nodes],
            x=self.frames(frames)[nodes, :3, 0],
            name=self.name,
        )

    def between(self, s0: float, s1: float) -> Contour:
        """Return the open contour between two arc lengths (m), its own nodes kept on the way."""
        inside = self.s[(self.s > s0 + REPEATED_POINT) & (self.s < s1 - REPEATED_POINT)]
        s = np.concatenate([[s0], inside, [s1]])
        return replace(self, closed=False, x=None)._at_nodes(s)

    def _at_nodes(self, s: Array, time: Array | None = None) -> Contour:
        points, axes = self.at(s)
        return Contour(points, axes, closed=self.closed, s=s, time=time, name=self.name)

    def _in_time(self, dt: float | None, speed: ArrayLike | None) -> Contour:
        if dt is None or speed is None:
            raise InputError("resample: sampling in time needs both dt= (s) and speed= (m/s)")
        step = scalar(dt, "dt", unit="s", above=0.0)
        v = positive(np.broadcast_to(np.asarray(speed), len(self)), "speed", (len(self),))
        # With the speed linear in s over a segment, its mean slowness is ln(v1/v0)/(v1-v0).
        log_ratio = np.log(v[1:] / v[:-1])
        change = np.diff(v)
        even = np.abs(log_ratio) < 1e-6
        slowness = np.where(even, 2.0 / (v[1:] + v[:-1]), log_ratio / np.where(even, 1.0, change))
        t = np.concatenate([[0.0], np.cumsum(np.diff(self.s) * slowness)])
        time = np.linspace(0.0, t[-1], _cells(float(t[-1]), step) + 1)
        k = np.clip(np.searchsorted(t, time, side="right") - 1, 0, len(self) - 2)
        # Within a segment s(t) solves ds/dt = v: exponential where the speed changes.
        rate = np.append(change, 0.0)[k] / np.diff(self.s)[k]
        tau = time - t[k]
        grown = np.where(
            np.abs(rate * tau) < 1e-12, tau, np.expm1(rate * tau) / np.where(rate, rate, 1)
        )
        s = self.s[k] + v[k] * grown
        s[0], s[-1] = self.s[0], self.s[-1]
        return self._at_nodes(s, freeze(time))

    def _fewest(self, tolerance: float, axis_tolerance: float) -> Array:
        """Return the arc lengths of the fewest evenly spaced nodes that keep both tolerances."""
        # Cells this short keep both: in one, path and axis move less than is allowed.
        n0, n1 = self.axes[:-1], self.axes[1:]
        turn = np.arctan2(np.linalg.norm(np.cross(n0, n1), axis=1), (n0 * n1).sum(1))
        rate = float((turn / np.diff(self.s)).max())
        enough = self.length * max(1 / tolerance, rate / axis_tolerance) + 1
        witness = len(self) // 2
        for cells in range(1, int(min(enough, MOST_NODES)) + 1):
            s = np.linspace(self.s[0], self.s[-1], cells + 1)
            # A node that spoilt the coarser sampling most likely spoils this one: try it first.
            if self._keeps(s, np.array([witness]), tolerance, axis_tolerance) < 0:
                bad = self._keeps(s, np.arange(len(self)), tolerance, axis_tolerance)
                if bad < 0:
                    return s
                witness = bad
        raise InputError(
            f"tolerance: {tolerance:g} m would need more than {MOST_NODES} nodes; relax it, or "
            "round the sharp corners of the contour"
        )

    def _keeps(self, s: Array, nodes: Ints, tolerance: float, axis_tolerance: float) -> int:
        """Return -1 if chords over `s` stay close at these nodes, or the worst of them."""
        cell = np.clip(np.searchsorted(s, self.s[nodes], side="right") - 1, 0, len(s) - 2)
        p0, n0 = self.at(s[cell])
        p1, n1 = self.at(s[cell + 1])
        part = ((self.s[nodes] - s[cell]) / (s[cell + 1] - s[cell]))[:, None]
        chord, there = p1 - p0, self.points[nodes]
        along = ((there - p0) * chord).sum(1) / np.maximum(
            (chord * chord).sum(1), REPEATED_POINT**2
        )
        off = np.linalg.norm(p0 + np.clip(along, 0, 1)[:, None] * chord - there, axis=1)
        axis = _turned(n0, n1, part)
        sine = np.linalg.norm(np.cross(axis, self.axes[nodes]), axis=1)
        angle = np.arctan2(sine, (axis * self.axes[nodes]).sum(1))
        excess = np.maximum(off / tolerance, angle / axis_tolerance)
        worst = int(np.argmax(excess))
        return -1 if excess[worst] <= 1.0 else int(nodes[worst])


def join(
    contours: Sequence[Contour],
    *,
    gap_tolerance: float = 1e-5,
    spacing: float | None = None,
    closed: bool = False,
    name: str | None = None,
) -> Contour:
    """Return one contour that runs through `contours` in order, sampled alike if asked.

    Parameters
    ----------
    contours : sequence of open Contour
        Each begins where the one before it ends.
    gap_tolerance : float m
        Largest distance bridged between an end and the next start; such ends become one node.
    spacing : float m, optional
        Sample the whole evenly at this spacing (the segments' own nodes are not kept).
    closed : bool
        The last segment returns to the first.

    Raises
    ------
    InputError
        Nothing to join, a closed contour among several, or a gap over the tolerance (says where).
    """
    if not contours:
        raise InputError("join: expected at least one contour, got none")
    for c in contours:
        if c.closed and len(contours) > 1:
            raise InputError(f"join: contour {c.name!r} is closed, nothing can be joined to it")
    points, axes = [contours[0].points], [contours[0].axes]
    for before, after in pairwise(contours):
        gap = _distance(before.points[-1], after.points[0])
        if gap > gap_tolerance:
            raise InputError(
                f"join: {before.name!r} ends {gap * 1e3:.4f} mm from the start of {after.name!r} "
                f"(allowed {gap_tolerance * 1e3:g} mm); check order and direction"
            )
        points.append(after.points[1:])
        axes.append(after.axes[1:])
    whole = np.vstack(points)
    if closed and _distance(whole[0], whole[-1]) <= gap_tolerance:
        whole[-1] = whole[0]
    joined = Contour(whole, np.vstack(axes), closed=closed or contours[0].closed)
    joined = replace(joined, name=name or "+".join(c.name for c in contours))
    return joined if spacing is None else joined.resample(spacing=spacing)


def _unit(axes: Array, name: str = "axes") -> Array:
    size = np.abs(axes).max(axis=1, initial=0.0)
    if (zero := np.flatnonzero(size <= ZERO_AXIS)).size:
        what = "the tool axis" if name == "axes" else "the direction normal to the tool axis"
        raise InputError(f"{name}: {what} of node {zero[0]} is zero; it needs a direction")
    scaled = axes / size[:, None]  # no square overflows
    return np.asarray(scaled / np.linalg.norm(scaled, axis=1)[:, None])


def _turned(n0: Array, n1: Array, part: Array) -> Array:
    """Turn unit vectors n0 (..., 3) by `part` (..., 1) of the angle towards n1, evenly."""
    cosine = np.clip((n0 * n1).sum(-1, keepdims=True), -1.0, 1.0)
    angle = np.arctan2(np.linalg.norm(np.cross(n0, n1), axis=-1, keepdims=True), cosine)
    small = angle < 1e-7
    sine = np.where(small, 1.0, np.sin(angle))
    w0 = np.where(small, 1 - part, np.sin((1 - part) * angle) / sine)
    w1 = np.where(small, part, np.sin(part * angle) / sine)
    turned = w0 * n0 + w1 * n1
    return np.asarray(turned / np.linalg.norm(turned, axis=-1, keepdims=True))


def _increasing(value: ArrayLike, name: str, count: int) -> Array:
    array = floats(value, name, (count,))
    if (bad := np.flatnonzero(np.diff(array) <= 0)).size:
        raise InputError(f"{name}: must increase from node to node, but not after node {bad[0]}")
    return array


def _distance(a: Array, b: Array) -> float:
    return float(np.linalg.norm(a - b))


def _cells(length: float, step: float) -> int:
    """Return into how many equal parts `length` falls so that none is longer than `step`."""
    return max(1, int(np.ceil(length / step * (1 - 1e-12))))
