"""Compute clearances of very many joint vectors with as few distance queries as proofs allow.

Pairs of bodies are treated one at a time. Seen from its first body, the second takes a cloud of
poses, one for each joint vector. A block of that cloud is measured at its middle, with distance d.
No point of the second body moves by more than delta from there to another pose of the block, so the
distance at that pose is between d - delta and d + delta. Where this is not enough, the block is
halved twice along its widest direction, and each part is treated in the same way. Poses that look
the same from the first body, such as those of a head in different postures of the arm, or of a
round nozzle that turns about the beam, coincide in the cloud. A joint vector at which one pair
collides is not measured any more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.cell.cell import Cell
from kerfpath.cell.pairs import relative
from kerfpath.cell.scene import ACCURACY
from kerfpath.cell.shapes import RING, Hull, Shape

AT_ONCE = 40_000
"""Joint vectors treated together: more cost memory, fewer cost overhead."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Clearances:
    """Bounds on the clearance of joint vectors.

    Parameters
    ----------
    lower, upper : (B,) m
        Bounds on the smallest distance of any pair beyond what it must keep, without pairs that
        have their own near-miss distance. If any pair is too close, `upper` is 0 or less and
        `lower` is minus infinity.
    pair : (B,) int
        The pair of `upper`, a row of `Cell.pairs`; -1 where `upper` is infinite.
    """

    lower: Array
    upper: Array
    pair: Ints

    __repr__ = short_repr


def clearances(
    cell: Cell,
    q: Array,
    *,
    band: float,
    resolution: float,
    progress: Callable[[int], None] | None = None,
) -> Clearances:
    """Return bounds on the clearance of each of q (B, n) rad.

    Neighbouring joint vectors should follow each other in q, which is treated piece by piece.

    Parameters
    ----------
    cell : Cell
    q : (B, n) rad
    band : float m
        Clearance above which no upper bound is sought.
    resolution : float m
        Largest difference of the two bounds for clear joint vectors below `band`.
    progress : callable, optional
        Called with the number of joint vectors done since the last call.
    """
    lower, upper = np.full(len(q), np.inf), np.full(len(q), np.inf)
    pair = np.full(len(q), -1)
    for first in range(0, len(q), AT_ONCE):
        piece = slice(first, first + AT_ONCE)
        _judge(cell, q[piece], band, resolution, (lower[piece], upper[piece], pair[piece]))
        if progress is not None:
            progress(len(q[piece]))
    return Clearances(lower=lower, upper=upper, pair=pair)


def _judge(
    cell: Cell, q: Array, band: float, resolution: float, out: tuple[Array, Array, Ints]
) -> None:
    """Write lower, upper and pair (B,) of joint vectors to `out`, one pair of bodies at a time."""
    lower, upper, pair = out
    frames = cell.frames(q)
    cheap = cell.scene.cheap(frames) - cell.required
    for p in cell.scene.order.tolist():
        own = bool(cell.own[p])
        aim = np.zeros(len(q)) if own else np.minimum(band, upper)
        over, above = cheap[:, p], np.full(len(q), np.inf)
        rows = np.flatnonzero((upper > 0) & ~(over > aim))
        if rows.size:
            cloud = _Cloud(cell, p, frames[rows])
            over[rows], above[rows] = cloud.bounds(aim[rows], resolution)
        if own:
            above[above > 0] = np.inf
        else:
            np.minimum(lower, over, out=lower)
        pair[above < upper] = p
        np.minimum(upper, above, out=upper)
    lower[upper <= 0] = -np.inf


class _Cloud:
    """Poses of the second body of a pair, seen from its first."""

    def __init__(self, cell: Cell, p: int, frames: Array) -> None:
        one, two = (cell.bodies[i] for i in cell.pairs[p])
        self._scene, self._p, self._frames = cell.scene, p, frames
        self._required = float(cell.required[p])
        T = relative(frames, one.frame, two.frame)
        self._body = body = _outline(two.shape)
        self._rows = np.ascontiguousarray(T[:, :3].transpose(1, 2, 0))
        middle, turned = T[:, :3] @ body.tips.mean(axis=0), T[:, :3, :3] @ body.spread
        self._place = np.hstack([middle, turned.reshape(len(T), -1)])

    def bounds(self, aim: Array, resolution: float) -> tuple[Array, Array]:
        """Return bounds (B,) m on the distances beyond the required one.

        They determine its sign; if it is between zero and `aim`, they are at most `resolution`
        apart.
        """
        over, above = np.full(len(aim), -np.inf), np.full(len(aim), np.inf)
        left, block = np.arange(len(aim)), np.zeros(len(aim), np.int64)
        while left.size:
            start = np.flatnonzero(np.diff(block, prepend=-1))
            count = np.diff(start, append=len(left))
            middle = left[self._middles(left, block, start)]
            delta = self._shift(np.repeat(middle, count), left) + ACCURACY
            # A distance this large clears the whole block up to its aim, so a bound is enough.
            enough = np.maximum.reduceat(delta, start) + np.maximum.reduceat(aim[left], start)
            low, high = self._scene.pair_bounds(
                self._p, self._frames[middle], self._required + enough + ACCURACY
            )
            low, high = low - self._required, high - self._required
            over[left] = np.maximum(over[left], np.repeat(low, count) - delta)
            above[left] = np.minimum(above[left], np.repeat(high, count) + delta)
            over[middle], above[middle] = low, np.where(np.isinf(high), high, low)
            o, a = over[left], above[left]
            settled = (a <= 0) | ((o > 0) & ((o >= aim[left]) | (a - o <= resolution)))
            settled[np.isin(left, middle)] = True
            left, block = self._halved(*self._halved(left[~settled], block[~settled]))
        return over, above

    def _middles(self, left: Ints, block: Ints, start: Ints) -> Ints:
        """Return which of `left` is closest to the middle of each block."""
        x = self._place[left]
        count = np.diff(start, append=len(left))
        mean = np.add.reduceat(x, start) / count[:, None]
        off = ((x - np.repeat(mean, count, axis=0)) ** 2).sum(axis=1)
        return np.asarray(np.lexsort((off, block))[start])

    def _halved(self, left: Ints, block: Ints) -> tuple[Ints, Ints]:
        """Return `left` and `block` with every block halved across its widest direction, if any."""
        if not left.size:
            return left, block
        x, i = self._place[left], np.arange(len(left))
        start = np.flatnonzero(np.diff(block, prepend=-1))
        count = np.diff(start, append=len(left))
        each = np.repeat(np.arange(len(start)), count)
        low, high = np.minimum.reduceat(x, start), np.maximum.reduceat(x, start)
        widest = np.argmax(high - low, axis=1)
        wide = (high - low).max(axis=1) > ACCURACY
        cut = ((low + high) / 2)[each, widest[each]]
        beyond = np.where(wide[each], x[i, widest[each]] > cut, i >= (start + count / 2)[each])
        block = 2 * each + beyond
        order = np.argsort(block, kind="stable")
        return left[order], block[order]

    def _shift(self, one: Ints, two: Ints) -> Array:
        """Return bounds (b,) m on the motion of any point of the body from poses `one` to `two`."""
        D = self._rows[:, :, two] - self._rows[:, :, one]
        body = self._body
        far = _length([body.tips @ row for row in D]).max(axis=0)
        tilt = _length([body.axis @ row[:3] for row in D]) if body.radius else 0.0
        return np.asarray(far + body.radius * tilt + body.uneven)


class _Outline(NamedTuple):
    """The outline that bounds motions: points around a body, or the cylinder of a round one.

    Parameters
    ----------
    tips : (c, 4) m
        Homogeneous points; the body is in their hull, or in that of the two discs about them.
    axis : (3,)
        Axis of a round body; rotation about it changes the body only by `uneven`.
    radius, uneven : float m
        Radius of the discs, and how much closer to the axis the body is between corners.
    spread : (3, s) m
        Vectors that turn with the body, as long as it is wide.
    """

    tips: Array
    axis: Array
    radius: float
    uneven: float
    spread: Array


def _length(xyz: Sequence[Array]) -> Array:
    x, y, z = xyz
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def _outline(shape: Shape) -> _Outline:
    corners = shape.corners
    if not isinstance(shape, Hull) or shape.axis is None:
        spread = np.diag(corners.std(axis=0))
        return _Outline(_homogeneous(corners), np.zeros(3), 0.0, 0.0, spread)
    foot, top = shape.axis
    axis = (top - foot) / np.linalg.norm(top - foot)
    along = (corners - foot) @ axis
    radius = float(np.linalg.norm(corners - foot - along[:, None] * axis, axis=1).max())
    tips = foot + np.array([[along.min()], [along.max()]]) * axis
    uneven = radius * (1 - np.cos(np.pi / RING))
    spread = axis[:, None] * np.hypot(np.ptp(along) / 2, radius)
    return _Outline(_homogeneous(tips), axis, radius, uneven + ACCURACY, spread)


def _homogeneous(points: Array) -> Array:
    return np.hstack([points, np.ones((len(points), 1))])
