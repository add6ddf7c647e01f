"""The contour: points, tool axes and kinds of stretches (the augmented line of section 2.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Ints, floats, freeze, integers, positive, require_one_of, scalar
from kerfpath.contour import sampling
from kerfpath.contour.sampling import unit
from kerfpath.errors import InputError
from kerfpath.kernels.frames import closing_twist, rotation_minimising_x, tangent_x
from kerfpath.tolerances import SAME_PLACE

FrameKind = Literal["tangent", "rotation-minimising"]
FRAME_KINDS: tuple[FrameKind, ...] = ("tangent", "rotation-minimising")

REPEATED_POINT = 1e-9
"""Consecutive nodes closer than this (m) are one point: they define no direction of travel."""


KINDS = ("cut", "pierce", "lead-in", "micro joint", "overlap", "lead-out", "loop", "corner")
"""Kinds of stretches of a contour; `Contour.kind` holds indices into this tuple."""
CORNER_KIND = KINDS.index("corner")


@dataclass(frozen=True, slots=True, eq=False)
class Contour:
    """Points and tool axes along a cut: the augmented line of section 2.1.

    Between two nodes the path is straight and the axis turns evenly.

    Parameters
    ----------
    points : (K, 3) m
        Tool-tip positions; K >= 2, consecutive points distinct.
    axes : (K, 3)
        Tool axes, from the nozzle into the part; any non-zero length, stored as unit vectors.
    closed : bool
        True when the path returns to its start. The first node is then repeated at the end
        (p_0 = p_n); it is added when the last point differs from the first.
    s : (K,) m, optional
        Arc length of each node along the path that was sampled; default: along the polyline.
    time : (K,) s, optional
        Time of each node, if a speed has been assigned to the contour.
    kind : (K,) int, optional
        Kind of the stretch that begins at each node, an index into `KINDS`; the last node has the
        kind of the stretch before it. "pierce" is a point: the first node, where the beam pierces.
        Default: "cut" everywhere.
    speed_share : (K,), optional
        Requested share of the contour's speed at each node, above 0 and at most 1; default 1.
    x : (K, 3), optional
        Direction at each node from which gamma is measured. Default: from the path (see `frames`);
        a part of a contour keeps the directions of the contour that it comes from.
    name : str
        Name in messages, reports and programs.

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
    kind: Ints = None  # type: ignore[assignment]  # filled in by __post_init__
    speed_share: Array = None  # type: ignore[assignment]  # filled in by __post_init__
    x: Array | None = None
    name: str = "contour"

    def __repr__(self) -> str:
        return (
            f"Contour({self.name!r}, {len(self.points)} points, {self.length * 1e3:.1f} mm, "
            f"{'closed' if self.closed else 'open'})"
        )

    def __post_init__(self) -> None:
        points = floats(self.points, "points", (None, 3), hint="give x, y, z in m of every node")
        each = "give the tool axis of every node; if all are the same, np.tile(axis, (K, 1))"
        axes = unit(floats(self.axes, "axes", (len(points), 3), hint=each))
        kind, share = self._labels(len(points))
        returns = self.closed and len(points) > 0
        if returns and np.linalg.norm(points[0] - points[-1]) > REPEATED_POINT:
            if self.s is not None or self.time is not None:
                raise InputError(
                    "points: a closed contour with s or time must repeat its first node at the end"
                )
            points, axes = np.vstack([points, points[:1]]), np.vstack([axes, axes[:1]])
            kind, share = np.append(kind, kind[-1]), np.append(share, share[0])
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
        _set(self, "kind", freeze(kind))
        _set(self, "speed_share", freeze(share))
        _set(self, "closed", bool(self.closed))
        _set(self, "s", _increasing(s, "s", len(points)))
        if self.time is not None:
            _set(self, "time", _increasing(self.time, "time", len(points)))
        if self.x is not None:
            _set(self, "x", floats(self.x, "x", (len(points), 3)))

    def _labels(self, count: int) -> tuple[Ints, Array]:
        """Return kinds and speed shares (K,), defaults filled in."""
        kind = np.zeros(count, np.int64)
        if self.kind is not None:
            kind = integers(self.kind, "kind", (count,))
            if not ((kind >= 0) & (kind < len(KINDS))).all():
                raise InputError(f"kind: expected indices into KINDS, 0 to {len(KINDS) - 1}")
            if (kind[1:] == KINDS.index("pierce")).any():
                raise InputError("kind: only the first node of a contour can be its pierce")
        share = np.ones(count)
        if self.speed_share is not None:
            share = positive(self.speed_share, "speed_share", (count,))
            if (share > 1).any():
                raise InputError(f"speed_share: expected at most 1, got {share.max():g}")
        return kind, share

    def __len__(self) -> int:
        return len(self.points)

    @property
    def length(self) -> float:
        """Length of the path, m."""
        return float(self.s[-1] - self.s[0])

    def at(self, s: ArrayLike) -> tuple[Array, Array]:
        """Return points (..., 3) m and unit axes (..., 3) at arc lengths `s` (...,) m."""
        return self._polyline.at(np.asarray(s, dtype=float))

    @property
    def _polyline(self) -> sampling.Polyline:
        return sampling.Polyline(self.s, self.points, self.axes)

    @property
    def returns(self) -> bool:
        """Whether the path ends within 1 um of its start, closed or not."""
        return bool(np.linalg.norm(self.points[0] - self.points[-1]) < SAME_PLACE)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kind of the stretch that begins at each node, as a word of `KINDS`."""
        return tuple(KINDS[code] for code in self.kind)

    @property
    def corners(self) -> Ints:
        """Nodes at which the path turns by more than 20 deg; ends count only if it is closed."""
        return sampling.corners(self.points, self.closed)

    @property
    def bend_ends(self) -> Ints:
        """Nodes at which the tool axis begins or ceases to turn, as at the ends of bends."""
        return sampling.bend_ends(self._polyline, self.closed)

    @property
    def feature_ends(self) -> Ints:
        """Nodes that sampling by `spacing` or `dt` keeps: ends, corners and changes of kind.

        Of a rounded corner only the middle is kept, the point nearest to the drawn corner; or its
        other node that is kept, where the contour begins or changes its kind in it.
        """
        kind = self._stretch_kind()
        ends = np.flatnonzero(np.diff(kind)) + 1
        runs = np.concatenate([[0], ends, [len(kind)]])
        rounded = np.flatnonzero(kind[runs[:-1]] == CORNER_KIND)
        first, last = runs[rounded], runs[rounded + 1]
        plain = np.diff(np.where(kind == CORNER_KIND, KINDS.index("cut"), kind))
        kept = np.concatenate([[0], np.flatnonzero(plain) + 1, [len(self) - 1]])
        whole = ~(np.isin(first, kept) | np.isin(last, kept))
        return np.unique(np.concatenate([self.corners, kept, ((first + last) // 2)[whole]]))

    def resample(
        self,
        *,
        spacing: float | None = None,
        count: int | None = None,
        tolerance: float | None = None,
        axis_tolerance: float | None = None,
        dt: float | None = None,
        speed: ArrayLike | None = None,
        keep: ArrayLike = (),
        bend_ends: bool = False,
    ) -> Contour:
        """Sample the contour again, uniformly in arc length or in time (Eq. 1).

        Give exactly one of `spacing`, `count`, `tolerance` (with or without `axis_tolerance`), or
        `dt` together with `speed`. The ends are always nodes. With `spacing` or `dt`, feature ends
        (see `feature_ends`) are nodes too, and steps may be up to a fifth shorter than the largest.

        Parameters
        ----------
        spacing : float m
            Largest distance between nodes along the path; each stretch is divided evenly.
        count : int
            Number of nodes, both ends included.
        tolerance : float m
            Largest deviation of the chords from this contour; the fewest evenly spaced nodes are
            taken that keep it.
        axis_tolerance : float rad
            The same for the axis, turned evenly along each chord; with `tolerance` or alone.
        dt : float s
            Largest time between nodes. Each stretch is divided evenly; a stretch with shorter
            steps than the others is traversed more slowly.
        speed : float or (K,) m/s
            Speed along the path, constant or at each node; multiplied by `speed_share`.
        keep : (m,) int
            Further nodes of this contour to keep, with `spacing` or `dt`.
        bend_ends : bool
            Whether nodes at ends of bends are kept, too, unless a node that is kept is within an
            eighth of the step; with `spacing` or `dt`.

        Raises
        ------
        InputError
            None or several ways of sampling, a value that is not positive, or a stretch too short
            for the step.
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
        keep = integers(keep, "keep", (None,))
        if (len(keep) or bend_ends) and spacing is None and dt is None:
            what = "keep" if len(keep) else "bend_ends"
            raise InputError(f"{what}: nodes are kept only with spacing= or dt=")
        ends = np.union1d(self.feature_ends, keep)
        if ends[0] < 0 or ends[-1] >= len(self):
            raise InputError(f"keep: expected nodes from 0 to {len(self) - 1}, got {keep.tolist()}")
        if count is not None:
            if not (isinstance(count, int | np.integer) and count >= 2):
                raise InputError(f"count: expected a whole number of nodes >= 2, got {count!r}")
            return self.at_nodes(np.linspace(self.s[0], self.s[-1], int(count)))
        if spacing is not None:
            step = scalar(spacing, "spacing", unit="m", above=0.0)
            ends = sampling.apart(self.s, ends, self.bend_ends if bend_ends else ends[:0], step)
            return self.at_nodes(sampling.divide_evenly(self.s, ends, step, "mm", self.name))
        if dt is not None or speed is not None:
            return self._in_time(dt, speed, ends, self.bend_ends if bend_ends else ends[:0])
        position = np.inf if tolerance is None else scalar(tolerance, "tolerance", above=0.0)
        angle = (
            np.inf if axis_tolerance is None else scalar(axis_tolerance, "axis_tolerance", above=0)
        )
        return self.at_nodes(sampling.sample_fewest(self._polyline, position, angle))

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
        require_one_of(kind, "frames", FRAME_KINDS)
        n, x = self.axes, np.empty_like(self.points)
        if self.x is not None:
            x = self.x - (self.x * n).sum(axis=1, keepdims=True) * n
            x, bad = unit(x, "x"), -1
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
        """Directions of travel (K, 3): unit vectors normal to the axes; raises as `frames` does."""
        return replace(self, x=None).frames("tangent")[:, :3, 0]

    def part(self, first: int, last: int, frames: FrameKind) -> Contour:
        """Return nodes `first` to `last` as an open contour that measures gamma from equal frames.

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
            kind=self.kind[nodes],
            speed_share=self.speed_share[nodes],
            x=self.frames(frames)[nodes, :3, 0],
            name=self.name,
        )

    def between(self, s0: float, s1: float) -> Contour:
        """Return the open contour between two arc lengths (m); it keeps the nodes between them."""
        inside = self.s[(self.s > s0 + REPEATED_POINT) & (self.s < s1 - REPEATED_POINT)]
        s = np.concatenate([[s0], inside, [s1]])
        return replace(self, closed=False, x=None).at_nodes(s)

    def _stretch_kind(self) -> Ints:
        """Return the kind of each stretch, (K-1,); the first is never "pierce"."""
        kind = self.kind[:-1].copy()
        if self.kind[0] == KINDS.index("pierce"):
            kind[0] = self.kind[1]
        return kind

    def at_nodes(self, s: Array, time: Array | None = None) -> Contour:
        """Return the contour sampled at increasing arc lengths `s` (M,) m, with `time` (M,) s."""
        points, axes = self.at(s)
        # A node that rounding puts just before the end of a stretch still begins the next one.
        k = np.searchsorted(self.s, s + REPEATED_POINT, side="right") - 1
        kind = self._stretch_kind()[np.clip(k, 0, len(self) - 2)]
        if self.kind[0] == KINDS.index("pierce") and s[0] == self.s[0]:
            kind[0] = self.kind[0]
        return Contour(
            points,
            axes,
            closed=self.closed,
            s=s,
            time=time,
            kind=kind,
            speed_share=np.interp(s, self.s, self.speed_share),
            name=self.name,
        )

    def _in_time(
        self, dt: float | None, speed: ArrayLike | None, ends: Ints, bends: Ints
    ) -> Contour:
        if dt is None or speed is None:
            raise InputError("resample: sampling in time needs both dt= (s) and speed= (m/s)")
        step = scalar(dt, "dt", unit="s", above=0.0)
        v = positive(np.broadcast_to(np.asarray(speed), len(self)), "speed", (len(self),))
        v = v * self.speed_share
        s, time = sampling.sample_in_time(self.s, v, step, ends, bends, self.name)
        return self.at_nodes(s, freeze(time))


def _increasing(value: ArrayLike, name: str, count: int) -> Array:
    array = floats(value, name, (count,))
    if (bad := np.flatnonzero(np.diff(array) <= 0)).size:
        raise InputError(
            f"{name}: expected increasing values, but that of node {bad[0] + 1} is not larger "
            f"than that of node {bad[0]}"
        )
    return array


# -----------------------------------------------------------------------------
# Join contours end to end.


def join(
    contours: Sequence[Contour],
    *,
    gap_tolerance: float = 1e-5,
    spacing: float | None = None,
    closed: bool = False,
    name: str | None = None,
) -> Contour:
    """Return one contour that runs through `contours` in order.

    Parameters
    ----------
    contours : sequence of open Contour
        Each begins where the one before it ends.
    gap_tolerance : float m
        Largest gap between an end and the next start that is bridged; the two become one node.
    spacing : float m, optional
        Resample the joined contour evenly; the nodes of the segments are not kept.
    closed : bool
        Whether the last segment returns to the first.
    name : str, optional
        Default: the names of the contours, joined by "+".

    Raises
    ------
    InputError
        No contour, a closed contour among several, or a gap above the tolerance.
    """
    if not contours:
        raise InputError("join: expected at least one contour, got none")
    for c in contours:
        if c.closed and len(contours) > 1:
            raise InputError(f"join: expected open contours, but {c.name!r} is closed")
    for before, after in pairwise(contours):
        gap = float(np.linalg.norm(before.points[-1] - after.points[0]))
        if gap > gap_tolerance:
            raise InputError(
                f"join: {before.name!r} ends {gap * 1e3:.4f} mm from the start of {after.name!r} "
                f"(allowed {gap_tolerance * 1e3:g} mm); check order and direction"
            )
    first = contours[0]
    whole = np.vstack([first.points, *(c.points[1:] for c in contours[1:])])
    if closed and np.linalg.norm(whole[0] - whole[-1]) <= gap_tolerance:
        whole[-1] = whole[0]
    # A node between two segments begins the later one.
    kind = np.concatenate([*(c.kind[:-1] for c in contours), contours[-1].kind[-1:]])
    share = np.concatenate([*(c.speed_share[:-1] for c in contours), contours[-1].speed_share[-1:]])
    joined = Contour(
        whole,
        np.vstack([first.axes, *(c.axes[1:] for c in contours[1:])]),
        closed=closed or first.closed,
        kind=kind,
        speed_share=share,
    )
    joined = replace(joined, name=name or "+".join(c.name for c in contours))
    return joined if spacing is None else joined.resample(spacing=spacing)
