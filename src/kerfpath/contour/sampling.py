"""The sampling of a path, and the unit vectors that it needs."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Ints
from kerfpath.errors import InputError

# -----------------------------------------------------------------------------
# Arrays of unit vectors: normalisation, angles and interpolation.

ZERO = 1e-9
"""A vector shorter than this (any unit) has no direction."""

ASIDE = float(np.sin(np.radians(20.0)))
"""Least distance of unit vectors from the direction about which they turn."""
ALL_ROUND = float(np.radians(345.0))
"""Angle from which on unit vectors turn all the way round."""


def unit(vectors: Array, name: str = "axes") -> Array:
    """Return vectors (K, 3) scaled to unit length.

    Raises
    ------
    InputError
        A vector without direction (with its index).
    """
    size = np.abs(vectors).max(axis=1, initial=0.0)
    if (zero := np.flatnonzero(size <= ZERO)).size:
        what = "the tool axis" if name == "axes" else "the direction normal to the tool axis"
        raise InputError(f"{name}: {what} of node {zero[0]} is zero; it needs a direction")
    scaled = vectors / size[:, None]  # no square overflows
    return np.asarray(scaled / np.linalg.norm(scaled, axis=1)[:, None])


def angle_between(n0: Array, n1: Array) -> Array:
    """Return the angle (...,) rad between unit vectors (..., 3), accurate for tiny ones too."""
    sine = np.linalg.norm(np.cross(n0, n1), axis=-1)
    return np.asarray(np.arctan2(sine, (n0 * n1).sum(-1)))


def turned_about(axes: Array) -> Array | None:
    """Return the direction (3,) about which unit vectors (K, 3) turn all the way round.

    None if they do not turn all the way about any direction, or come close to it somewhere: there
    the angle about it is undetermined.
    """
    direction = np.linalg.svd(axes - axes.mean(axis=0))[2]
    along, x, y = direction[2], axes @ direction[0], axes @ direction[1]
    if np.hypot(x, y).min() < ASIDE:
        return None
    turned = np.ptp(np.unwrap(np.arctan2(y, x)))
    return along if turned > ALL_ROUND else None


def slerp(n0: Array, n1: Array, part: Array) -> Array:
    """Turn unit vectors n0 (..., 3) towards n1 by a share `part` (..., 1) of their angle."""
    angle = angle_between(n0, n1)[..., None]
    small = angle < 1e-7
    sine = np.where(small, 1.0, np.sin(angle))
    w0 = np.where(small, 1 - part, np.sin((1 - part) * angle) / sine)
    w1 = np.where(small, part, np.sin(part * angle) / sine)
    mixed = w0 * n0 + w1 * n1
    return np.asarray(mixed / np.linalg.norm(mixed, axis=-1, keepdims=True))


# -----------------------------------------------------------------------------
# Sample a path evenly between features, evenly in time, or with the fewest nodes.

CORNER = np.radians(20)
"""rad: a node at which the path turns by more than this is a corner, which sampling keeps."""
EVEN = 0.8
"""Smallest step between features, as a share of the largest."""
MOST_OFTEN = 8.0
"""Factor by which steps may become shorter than requested to fit a short stretch."""
MOST_NODES = 200_000
"""Most nodes for a tolerance; with a sharp corner, about length / tolerance are needed."""
REPEATED_POINT = 1e-9
"""m; prevents a division by zero for a chord without length."""


NEAR = 2.5e-4
"""m: the tool axis at a node is compared with those this far before and behind it."""
BEND = np.radians(0.5)
"""rad: the axis at the end of a bend differs from the middle of these two by more than this; that
is so for bends up to a radius of 14 mm."""
APART = 0.125
"""Share of the step: an end of a bend that is closer to another node that is kept is left out."""


class Polyline(NamedTuple):
    """A path that is straight between its nodes, with an axis that turns evenly between them."""

    s: Array
    """(K,) m: arc lengths, increasing."""
    points: Array
    """(K, 3) m."""
    axes: Array
    """(K, 3): unit vectors."""

    def at(self, s: Array) -> tuple[Array, Array]:
        """Return points (..., 3) m and unit axes (..., 3) at arc lengths s (...,) m."""
        where = np.clip(s, self.s[0], self.s[-1])
        k = np.clip(np.searchsorted(self.s, where, side="right") - 1, 0, len(self.s) - 2)
        part = ((where - self.s[k]) / (self.s[k + 1] - self.s[k]))[..., None]
        points = self.points[k] + part * (self.points[k + 1] - self.points[k])
        return points, slerp(self.axes[k], self.axes[k + 1], part)


def corners(points: Array, closed: bool) -> Ints:
    """Return the nodes, in order, at which the path through points (K, 3) m turns sharply.

    The first node of a closed path can be one; the ends of an open path cannot.
    """
    along = unit(np.diff(points, axis=0), "points")
    turn = angle_between(along, np.roll(along, 1, axis=0))
    turn[0] = turn[0] if closed else 0.0
    return np.flatnonzero(turn > CORNER)


def bend_ends(line: Polyline, closed: bool) -> Ints:
    """Return the nodes, in order, at which the tool axis begins or ceases to turn.

    Of several within `NEAR`, the one at which it does so most counts.
    """
    start, end = line.s[0], line.s[-1]
    before, behind = line.s - NEAR, line.s + NEAR
    if closed:
        before = np.where(before < start, before + (end - start), before)
        behind = np.where(behind > end, behind - (end - start), behind)
    evenly = slerp(line.at(before)[1], line.at(behind)[1], np.full((len(line.s), 1), 0.5))
    off = angle_between(line.axes, evenly)
    off[[0, -1]] = 0.0  # nodes in any case
    found: list[int] = []
    for k in np.argsort(-off, kind="stable")[: np.count_nonzero(off > BEND)].tolist():
        if all(abs(line.s[k] - line.s[other]) > NEAR for other in found):
            found.append(k)
    return np.array(sorted(found), dtype=np.int64)


def apart(at: Array, ends: Ints, more: Ints, step: float) -> Ints:
    """Return the nodes `ends`, and those of `more` that are far enough from all others for a step.

    The arguments are as of `divide_evenly`.
    """
    kept = ends.tolist()
    for k in more.tolist():
        if np.abs(at[kept] - at[k]).min() > APART * step:
            kept.append(k)
    return np.unique(np.array(kept, dtype=np.int64))


def divide_evenly(at: Array, ends: Ints, step: float, unit_name: str, name: str) -> Array:
    """Return values that divide the stretches between at[ends] evenly, none longer than `step`.

    Parameters
    ----------
    at : (K,) m or s
        Arc length or time of the nodes.
    ends : (e,) int
        Nodes that are kept.
    step : float m or s
        Reduced where that makes the steps of all stretches equal within `EVEN`.
    unit_name, name : str
        For messages: mm or ms, and the contour's name.

    Raises
    ------
    InputError
        A stretch so short that far more nodes than asked for would be needed.
    """
    lengths = np.diff(at[ends])
    if len(lengths) == 1:
        return np.linspace(at[0], at[-1], int(_cells(lengths, step)[0]) + 1)
    steps = step * np.geomspace(1.0, 1.0 / MOST_OFTEN, 400)
    cells = _cells(lengths, steps[:, None])
    share = (lengths / cells / steps[:, None]).min(axis=1)
    if share.max() < EVEN:
        k = int(np.argmin(lengths))
        raise InputError(
            f"contour {name!r}: the stretch of {lengths[k] * 1e3:.4g} {unit_name} that begins at "
            f"{at[ends[k]] * 1e3:.6g} {unit_name} is too short for steps of {step * 1e3:.4g} "
            f"{unit_name}; use about {lengths[k] * 1e3:.4g} {unit_name}, or leave the feature out"
        )
    best = int(np.argmax(share >= EVEN))
    pieces = [
        np.linspace(at[a], at[b], int(n) + 1)[:-1]
        for (a, b), n in zip(pairwise(ends), cells[best], strict=True)
    ]
    return np.concatenate([*pieces, at[-1:]])


def sample_in_time(
    s: Array, speed: Array, dt: float, ends: Ints, bends: Ints, name: str
) -> tuple[Array, Array]:
    """Return arc lengths (M,) m and times (M,) s of nodes evenly spaced in time, at most `dt`.

    Parameters
    ----------
    s : (K,) m
        Arc lengths of the nodes.
    speed : (K,) m/s
        Speed at each node, linear in arc length between nodes.
    dt : float s
    ends : (e,) int
        Nodes that are kept.
    bends : (b,) int
        Nodes that are kept unless they are too close to others, see `apart`.
    name : str
        Name of the contour, for messages.
    """
    # With the speed linear in s over a segment, its mean slowness is ln(v1/v0)/(v1-v0).
    log_ratio, change = np.log(speed[1:] / speed[:-1]), np.diff(speed)
    even = np.abs(log_ratio) < 1e-6
    slowness = np.where(even, 2.0 / (speed[1:] + speed[:-1]), log_ratio / np.where(even, 1, change))
    t = np.concatenate([[0.0], np.cumsum(np.diff(s) * slowness)])
    at = divide_evenly(t, apart(t, ends, bends, dt), dt, "ms", name)
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    # Within a segment s(t) solves ds/dt = v: exponential where the speed changes.
    rate = np.append(change, 0.0)[k] / np.diff(s)[k]
    tau = at - t[k]
    still = np.abs(rate * tau) < 1e-12
    grown = np.where(still, tau, np.expm1(rate * tau) / np.where(still, 1.0, rate))
    made = s[k] + speed[k] * grown
    made[0], made[-1] = s[0], s[-1]
    # Every step takes as much time as the longest, so a stretch with shorter steps is slower.
    return made, np.diff(at).max(initial=0.0) * np.arange(len(at))


def sample_fewest(line: Polyline, tolerance: float, axis_tolerance: float) -> Array:
    """Return the arc lengths of the fewest evenly spaced nodes that keep both tolerances."""
    # Cells this short keep both tolerances: path and axis change by less within a cell.
    rate = float((angle_between(line.axes[:-1], line.axes[1:]) / np.diff(line.s)).max())
    enough = (line.s[-1] - line.s[0]) * max(1 / tolerance, rate / axis_tolerance) + 1
    witness = len(line.s) // 2
    for cells in range(1, int(min(enough, MOST_NODES)) + 1):
        s = np.linspace(line.s[0], line.s[-1], cells + 1)
        # A node that violated a tolerance before most likely does so again: try it first.
        if _spoilt(line, s, np.array([witness]), tolerance, axis_tolerance) < 0:
            bad = _spoilt(line, s, np.arange(len(line.s)), tolerance, axis_tolerance)
            if bad < 0:
                return s
            witness = bad
    raise InputError(
        f"tolerance: {tolerance:g} m would need more than {MOST_NODES} nodes; relax it, or "
        "round the sharp corners of the contour"
    )


def _spoilt(line: Polyline, s: Array, nodes: Ints, tolerance: float, axis_tolerance: float) -> int:
    """Return -1 if the chords between `s` keep both tolerances at `nodes`, else the worst node."""
    cell = np.clip(np.searchsorted(s, line.s[nodes], side="right") - 1, 0, len(s) - 2)
    p0, n0 = line.at(s[cell])
    p1, n1 = line.at(s[cell + 1])
    part = ((line.s[nodes] - s[cell]) / (s[cell + 1] - s[cell]))[:, None]
    chord, there = p1 - p0, line.points[nodes]
    along = ((there - p0) * chord).sum(1) / np.maximum((chord * chord).sum(1), REPEATED_POINT**2)
    off = np.linalg.norm(p0 + np.clip(along, 0, 1)[:, None] * chord - there, axis=1)
    angle = angle_between(slerp(n0, n1, part), line.axes[nodes])
    excess = np.maximum(off / tolerance, angle / axis_tolerance)
    worst = int(np.argmax(excess))
    return -1 if excess[worst] <= 1.0 else int(nodes[worst])


def _cells(length: Array, step: Array | float) -> Ints:
    """Return the number of equal parts of each length, none of them longer than `step`."""
    return np.maximum(1, np.ceil(length / step * (1 - 1e-12))).astype(np.int64)
