"""Check that the cells of a certificate cover every motion, with the audit's own enclosures.

A place is an interval of gamma at a node, in one posture and on one turn of each joint. All places
that a motion may pass are visited from the coarsest intervals down: a place is a cell of the
certificate, or has no solution within the ranges, or is divided in two.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from kerfpath.arrays import Array, Bools, Ints, places_within, short_repr
from kerfpath.auditor.enclosure import POSTURES, Enclosure, Status, enclose, linear_minimum
from kerfpath.certificate import BASE, LIFTS, Stage
from kerfpath.errors import CertificateRefused
from kerfpath.robots import Robot

Linked = Callable[["Places"], Bools]
TURN = 2 * np.pi
DEEPEST_CELL = 20
"""The finest level of cells, down to which places are divided."""
HALF_TURN = np.pi + 1e-9
"""rad: bound on every angle up to full turns, with room for rounding."""
EDGE = 1e-9
"""rad: by how much a motion may leave the ranges."""
ON_TURN = 2e-14
"""rad: rounding error of joints on a turn, up to ten turns."""
SAME_MIDDLE = 1e-9
"""rad: tolerance within which two enclosures of an interval have the same middle."""
EVERYWHERE, IN_MIDDLE, SAME = range(3)
"""Where the joints of wanted places are known, see `_Wanted`."""
BEYOND = 6
"""Number of levels below the finest cell of a stage within which an interval must prove empty."""
MOST_PLACES = 500_000
"""Number of places at a time; a certificate that leaves more is refused."""
PLACES_AT_ONCE = 1e5
"""Approximate number of places that are visited together, which decides the number of nodes."""


@dataclass(frozen=True, slots=True, eq=False)
class Reachable:
    """The data of a plan's task that decide where motions may be.

    Parameters
    ----------
    robot : Robot
    frames : (K, 4, 4) m
        Task frames in the robot base.
    T_flange_tip : (4, 4) m
    postures : (P,) int
        The allowed postures.
    lower, upper : (n,) rad
        Ranges of the joints that are not endless.
    endless : (n,) bool
    rows : (R, n)
        Couplings of joints that are not endless.
    row_lower, row_upper : (R,) rad
    """

    robot: Robot
    frames: Array
    T_flange_tip: Array
    postures: Ints
    lower: Array
    upper: Array
    endless: Bools
    rows: Array
    row_lower: Array
    row_upper: Array

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Intervals of gamma, each in a posture and with every joint on a turn.

    The joints are in q + slope t + [low, high] t^2 / 2 +- radius for |t| <= half, and so within
    `reach` of q; for endless joints this holds up to full turns. `turn` counts from the centre of
    the enclosure.

    Parameters
    ----------
    cell : (C,) int
        Index of the cell of the stage; -1 for none.
    node, level, index, posture : (C,) int
    turn : (C, n) int
    smooth : (C,) bool
    q, slope, low, high, radius, reach : (C, n)
    half : (C,) rad
    """

    cell: Ints
    node: Ints
    level: Ints
    index: Ints
    posture: Ints
    turn: Ints
    smooth: Bools
    q: Array
    slope: Array
    low: Array
    high: Array
    radius: Array
    reach: Array
    half: Array

    __repr__ = short_repr

    def __len__(self) -> int:
        return len(self.node)

    @property
    def middle(self) -> Array:
        """Gamma in the middle of each place, (C,) rad."""
        width = TURN / (BASE * np.exp2(self.level.astype(np.float64)))
        return np.asarray(width * (self.index + 0.5) - np.pi)

    def take(self, which: Ints | Bools | slice) -> Places:
        """Return a selection of the places."""
        return Places(*(getattr(self, each.name)[which] for each in fields(self)))


@dataclass(frozen=True, slots=True, eq=False)
class _Wanted:
    """Intervals of one level that motions may pass with joints within `room` of `near` (W, n).

    `known` says where in the interval this holds: everywhere, in its middle, or that the place is
    the same.
    """

    node: Ints
    index: Ints
    posture: Ints
    near: Array
    room: Array
    known: Ints


def covered(where: Reachable, stage: Stage, before: Places | None, linked: Linked) -> Places:
    """Return the cells of a stage that motions may pass, as places, by node.

    Parameters
    ----------
    where : Reachable
    stage : Stage
        A stage whose arrays fit.
    before : Places or None
        The places that the stage must cover, which another stage leaves. At nodes without such
        places it must cover everything that steps join to them. None: everything.
    linked : callable
        Returns which places (C,) are joined by steps to others, from the first node to the last.

    Raises
    ------
    CertificateRefused
        The stage does not cover all of these places.
    """
    nodes = np.unique(stage.node).astype(np.int64)
    old = nodes if before is None else np.intersect1d(nodes, before.node)
    turns = np.where(where.endless, 1.0, np.maximum((where.upper - where.lower) / TURN, 1.0)).prod()
    at_once = max(1, int(PLACES_AT_ONCE / (BASE * len(where.postures) * turns)))
    parts: list[Places] = []
    for i in range(0, len(old), at_once):
        part = old[i : i + at_once]
        rows = np.flatnonzero((stage.node >= part[0]) & (stage.node <= part[-1]))
        rows = rows[np.isin(stage.node[rows], part)]
        some = None if before is None else before.take(np.isin(before.node, part))
        parts += _covered(where, stage, rows, part, some)
    new = np.setdiff1d(nodes, old)
    if len(new):
        beside = joined(parts)
        rows = np.flatnonzero(np.isin(stage.node, new))

        def joins(found: list[Places], left: Places) -> Bools:
            """Return which places steps join to places all the way along."""
            return linked(joined([beside, *found, left]))[-len(left) :]

        parts += _covered(where, stage, rows, new, None, joins)
    found = joined(parts)
    found = found.take(np.argsort(found.cell, kind="stable"))
    # Up to full turns every angle is within half a turn.
    anywhere = found.reach > HALF_TURN
    for curve in (found.slope, found.low, found.high):
        curve[anywhere] = 0.0
    for size in (found.radius, found.reach):
        size[anywhere] = HALF_TURN
    return found


def one_interval(where: Reachable, places: Places) -> tuple[Places, Array] | None:
    """Return one interval of gamma at each of the M nodes of places, which holds them all.

    Also return the differences (M-1, n) rad of its joints in the middle from node to node, for
    endless joints the short way round. None if the places of a node are in several postures or on
    several turns, or their joints are not a smooth function of gamma on the whole interval.
    """
    nodes, layer = np.unique(places.node, return_inverse=True)
    M, n = len(nodes), len(where.endless)
    posture, middle, half = np.empty(M, np.int64), np.empty(M), np.empty(M)
    if not places.smooth.all():
        return None
    for k in range(M):
        at = np.flatnonzero(layer == k)
        posture[k] = places.posture[at[0]]
        if (places.posture[at] != posture[k]).any():
            return None
        off = places.middle[at] - places.middle[at[0]]
        off = np.sort(off - TURN * np.round(off / TURN))
        # From the widest gap on, once around the circle.
        first = int(np.argmax(np.diff(off, append=off[0] + TURN))) + 1
        off[:first] += TURN
        low, high = off[first % len(off)], off[first - 1]
        if first == len(off):
            low, high = off[0], off[-1]
        middle[k] = places.middle[at[0]] + (low + high) / 2
        half[k] = (high - low) / 2 + places.half[at].max() + 16 * ON_TURN
    if not (half < np.pi).all():
        return None
    found = enclose(where.robot, where.frames, nodes, middle, half, where.T_flange_tip)
    own = np.arange(M), posture
    if (found.status[own] != Status.SMOOTH).any():
        return None
    q, slope, low, high = (getattr(found, name)[own] for name in ("center", "slope", "low", "high"))
    radius = found.radius[own] + ON_TURN
    bend, h = np.maximum(np.abs(low), np.abs(high)), half[:, None]
    reach = (np.abs(slope) * h + bend * (h * h / 2) + radius) * (1 + 1e-15)
    # The joints of each place are those of the interval there, on the turn of the place.
    t = places.middle - middle[layer]
    t = (t - TURN * np.round(t / TURN))[:, None]
    there = q[layer] + slope[layer] * t + (low + high)[layer] * (t * t / 4)
    turn = np.round((places.q - there) / TURN)
    own_turn = np.zeros((M, n))
    own_turn[layer] = turn
    ended = ~where.endless
    sure = np.abs(places.q - there - TURN * turn) + radius[layer] + places.radius
    sure = sure + (high - low)[layer] * (t * t / 4)
    if (turn != own_turn[layer])[:, ended].any() or not (sure < np.pi).all():
        return None
    turned = np.where(where.endless, 0.0, own_turn)
    whole = Places(
        np.full(M, -1), nodes.astype(np.int64), np.zeros(M, np.int64), np.zeros(M, np.int64),
        posture, turned.astype(np.int64), np.ones(M, np.bool_), q + TURN * turned, slope, low,
        high, radius, reach, half,
    )  # fmt: skip
    moved = np.diff(whole.q, axis=0)
    return whole, np.where(where.endless, moved - TURN * np.round(moved / TURN), moved)


def _covered(
    where: Reachable,
    stage: Stage,
    rows: Ints,
    nodes: Ints,
    before: Places | None,
    joins: Callable[[list[Places], Places], Bools] | None = None,
) -> list[Places]:
    """Return the cells (`rows` of the stage) that motions may pass at some nodes."""
    found: list[Places] = []
    deepest = int(before.level.max(initial=-1)) if before is not None else 0
    left: Places | None = None
    finest = max(int(stage.level.max(initial=0)), deepest)
    for level in range(min(finest + BEYOND, DEEPEST_CELL) + 1):
        wanted = [] if left is None else [_bisected(left)]
        if before is not None:
            wanted.append(_same_intervals(before.take(before.level == level)))
        elif level == 0:
            wanted.append(_full_circle(where, nodes))
        places = _places(where, level, _all(wanted))
        cells = rows[stage.level[rows] == level]
        known, listed = _matched(where, stage, cells, places)
        found.append(known)
        left = places.take(~listed)
        if joins is not None and len(left):
            left = left.take(joins(found, left))
        if not len(left) and level >= deepest:
            return found
        if level >= finest and joins is None and (sure := _passable(where, left)).any():
            left = left.take(sure)
            break
    assert left is not None
    raise CertificateRefused(
        f"its cells leave out motions in posture {left.posture[0]} at node {left.node[0]}, gamma "
        f"{np.degrees(_middle(left.level[0], left.index[:1])[0]):.4g} deg"
    )


def _middle(level: int, index: Ints) -> Array:
    return np.asarray(TURN / (BASE << level) * (index + 0.5) - np.pi)


def _full_circle(where: Reachable, nodes: Ints) -> _Wanted:
    """Return the full circle of gamma of some nodes in every allowed posture."""
    node, index, posture = (
        grid.ravel() for grid in np.meshgrid(nodes, np.arange(BASE), where.postures, indexing="ij")
    )
    shape = (len(node), len(where.endless))
    near = np.broadcast_to((where.lower + where.upper) / 2, shape)
    room = np.broadcast_to((where.upper - where.lower) / 2 + 2 * EDGE, shape)
    return _Wanted(node, index, posture, near, room, np.full(len(node), EVERYWHERE))


def _same_intervals(places: Places) -> _Wanted:
    """Return places of another stage, only on their own turns."""
    room, known = np.full(places.q.shape, SAME_MIDDLE), np.full(len(places), SAME)
    return _Wanted(places.node, places.index, places.posture, places.q, room, known)


def _bisected(places: Places) -> _Wanted:
    """Return both halves of places.

    Where the joints are one smooth function of gamma, its value in the middle gives the turn.
    """
    twice = np.repeat(np.arange(len(places)), 2)
    right = np.arange(len(twice)) % 2
    at = places.take(twice)
    t = ((right - 0.5) * at.half)[:, None]
    smooth = at.smooth[:, None]
    near = at.q + at.slope * t + (at.low + at.high) * (t * t / 4)
    room = at.radius + (at.high - at.low) * (t * t / 4) + SAME_MIDDLE
    near, room = np.where(smooth, near, at.q), np.where(smooth, room, at.reach)
    return _Wanted(
        at.node,
        2 * at.index + right,
        at.posture,
        near,
        room,
        np.where(at.smooth, IN_MIDDLE, EVERYWHERE),
    )


def _all(wanted: list[_Wanted]) -> _Wanted:
    names = [each.name for each in fields(_Wanted)]
    return _Wanted(*(np.concatenate([getattr(w, name) for w in wanted]) for name in names))


def _places(where: Reachable, level: int, wanted: _Wanted) -> Places:
    """Return every place of the wanted intervals that a motion may pass."""
    code = wanted.node * (BASE << level) + wanted.index
    keys, key = np.unique(code, return_inverse=True)
    node, index = np.divmod(keys, BASE << level)
    half = np.full(len(keys), np.pi / (BASE << level) + 4e-15)
    gamma = _middle(level, index)
    found = enclose(where.robot, where.frames, node, gamma, half, where.T_flange_tip)
    some = found.status[key, wanted.posture] != Status.NONE
    key, posture = key[some], wanted.posture[some]
    parts = [getattr(found, name)[key, posture] for name in Enclosure.__dataclass_fields__]
    status, center, slope, low, high, radius = parts
    smooth = status == Status.SMOOTH
    bend, width = np.maximum(np.abs(low), np.abs(high)), half[0] if len(half) else 0.0
    radius = radius + ON_TURN
    reach = (np.abs(slope) * width + bend * (width * width / 2) + radius) * (1 + 1e-15)
    known = wanted.known[some][:, None]
    size = np.where(smooth[:, None] & (known == IN_MIDDLE), radius, np.minimum(reach, HALF_TURN))
    size = np.where(known == SAME, 0.0, size)
    row, turns = _turns(wanted.near[some], wanted.room[some] + size, center, where.endless)
    whole = Places(
        np.full(len(row), -1), node[key[row]], np.full(len(row), level), index[key[row]],
        posture[row], turns, smooth[row], center[row] + TURN * turns, slope[row], low[row],
        high[row], radius[row], reach[row], half[key[row]],
    )  # fmt: skip
    whole = whole.take(_in_range(where, whole))
    if not len(whole):
        return whole
    # Halves of neighbouring turns may be the same place.
    code = ((whole.node * (BASE << level) + whole.index) * POSTURES) + whole.posture
    _, once = np.unique(_coded(code, whole.turn), return_index=True)
    return whole.take(once)


def _coded(code: Ints, turn: Ints) -> Ints:
    """Return one number for each row of code (C,) and turn (C, n), equal for equal rows."""
    digits = np.zeros(len(code), dtype=np.int64)
    for i in range(turn.shape[1]):
        digits = digits * 64 + turn[:, i] + 32
    _, first = np.unique(code, return_inverse=True)
    other, second = np.unique(digits, return_inverse=True)
    return np.asarray(first * len(other) + second)


def _turns(near: Array, room: Array, center: Array, endless: Bools) -> tuple[Ints, Ints]:
    """Return rows (T,) and turns (T, n) for which center + 2 pi turn is within `room` of `near`.

    The turn of an endless joint is 0.
    """
    low = np.where(endless, 0, np.ceil((near - room - center) / TURN - 1e-14))
    high = np.where(endless, 0, np.floor((near + room - center) / TURN + 1e-14))
    count = np.maximum(high - low + 1, 0)
    total = count.prod(axis=1)
    if not total.sum() <= MOST_PLACES:
        raise CertificateRefused(f"it leaves more than {MOST_PLACES} places to check")
    total = total.astype(np.int64)
    row = np.repeat(np.arange(len(total)), total)
    place = places_within(total)
    turns = low[row].astype(np.int64)
    for i in range(turns.shape[1]):
        size = count[row, i].astype(np.int64)
        turns[:, i] += place % size
        place //= size
    return row, turns


def _in_range(where: Reachable, at: Places) -> Bools:
    """Return which places a motion within ranges and couplings may pass, (C,)."""
    low, high = where.lower - EDGE, where.upper + EDGE
    inside = ((at.q - at.reach <= high) & (at.q + at.reach >= low)) | where.endless
    fits = np.asarray(inside.all(axis=1))
    for row, lower, upper in zip(where.rows, where.row_lower, where.row_upper, strict=True):
        middle = at.q @ row
        curve = (at.slope, at.low, at.high, at.radius, at.half)
        least = middle + linear_minimum(*curve, np.broadcast_to(row, at.q.shape))
        most = middle - linear_minimum(*curve, np.broadcast_to(-row, at.q.shape))
        fits &= (least <= upper + 2 * EDGE) & (most >= lower - 2 * EDGE)
    return fits


def _passable(where: Reachable, at: Places) -> Bools:
    """Return which places certainly have a pose within ranges in their middle.

    Couplings are not tried: with them, no place is certain.
    """
    if len(where.rows):
        return np.zeros(len(at), dtype=bool)
    inside = (at.q - at.radius >= where.lower) & (at.q + at.radius <= where.upper)
    return np.asarray(at.smooth & (inside | where.endless).all(axis=1))


def _matched(
    where: Reachable, stage: Stage, cells: Ints, places: Places
) -> tuple[Places, NDArray[np.bool_]]:
    """Return the places that are cells of the stage, and which of all places they are."""
    listed = np.zeros(len(places), dtype=bool)
    if not len(cells) or not len(places):
        return places.take(np.zeros(0, dtype=np.int64)), listed
    level = int(places.level[0])

    def interval(node: Ints, index: Ints, posture: Ints) -> Ints:
        return np.asarray((node * (BASE << level) + index) * POSTURES + posture)

    own = interval(places.node, places.index, places.posture)
    given = interval(*(np.asarray(part[cells], dtype=np.int64)
                       for part in (stage.node, stage.index, stage.posture)))  # fmt: skip
    # Any place of the interval gives the middle of the joints, up to full turns.
    order = np.argsort(own, kind="stable")
    at = order[np.minimum(np.searchsorted(own, given, sorter=order), len(own) - 1)]
    same = own[at] == given
    cells, given, at = cells[same], given[same], at[same]
    off = stage.lift[cells] * (np.pi / LIFTS) - places.q[at]
    off = np.where(where.endless, 0.0, np.round(off / TURN)).astype(np.int64)
    turn = np.vstack([places.turn, places.turn[at] + off])
    code = _coded(np.concatenate([own, given]), turn)
    have, want = code[: len(own)], code[len(own) :]
    order = np.argsort(have)
    at = np.minimum(np.searchsorted(have, want, sorter=order), len(have) - 1)
    fits = have[order[at]] == want
    row = order[at[fits]]
    listed[row] = True
    known = places.take(row)
    known.cell[:] = cells[fits]
    return known, listed


def joined(parts: list[Places]) -> Places:
    """Return several places as one object, in order."""
    return Places(
        *(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Places))
    )
