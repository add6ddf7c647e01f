"""Compare programs: two that were read, or one with what was read back of its text."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from kerfpath.arrays import Array, Ints, counted, lengths_along, short_repr
from kerfpath.errors import InputError
from kerfpath.post.arcs import air_times, cruises, distances
from kerfpath.post.languages import Language, LanguageSettings, Rules
from kerfpath.post.places import ReadGroup, groups_of
from kerfpath.post.power import SAME_POWER
from kerfpath.post.program import (
    Await,
    CircularMove,
    Comment,
    Handshake,
    JointMove,
    LinearMove,
    Move,
    Program,
    ProgramIssue,
    Request,
    SetPower,
    Switch,
    Wait,
    switches_of,
)
from kerfpath.post.read_program import (
    ReadHandshake,
    ReadMove,
    ReadPower,
    ReadProgram,
    ReadStep,
    ReadWait,
)
from kerfpath.robots import ExternalAxis, Robot

# -----------------------------------------------------------------------------
# Tolerances.

POINT = 1e-6
"""Largest distance (m) of a target that is read back from the one written, beyond its digits."""
ANGLE = np.radians(1e-3)
"""The same for the orientation of the tool and for joints, rad."""
FRAME = 1e-7
"""The same for frames, m and sine."""
LEAD = 6e-4
"""The same for lead times and waits (s): controllers count milliseconds."""
DURATION = 1e-6
"""The same for durations (s), where a text gives times."""
DERIVED = np.radians(1.0)
"""Largest error (rad) of joints that follow from a pose and its configuration: the digits of the
pose, near a singularity. Another posture is farther off."""
REACH = 4.0
"""Distance (m) that no tip has from an axis: the lever arm of rounding errors of joints."""
SHARE = 6e-3
"""Largest difference of shares of the full speed: controllers count per cent."""

# -----------------------------------------------------------------------------
# Match the contours and moves of two programs.

NEAR = 5e-3
"""Contours whose paths are farther apart (m) are matched by their names only."""
SAMPLES = 50
"""Number of evenly spaced points at which paths are compared."""
NEVER = 1e6
"""Distance (m) of what must not be matched."""


class Stop(NamedTuple):
    """A move, the wait (s) at its end, and file and line of the wait."""

    move: ReadMove
    wait: float = 0.0
    waits_at: str = ""


class MovePair(NamedTuple):
    """A move of program A and one of B; None if only the other program has the move."""

    a: Stop | None
    b: Stop | None

    @property
    def places(self) -> tuple[str, ...]:
        """File and line of both."""
        return tuple(stop.move.place for stop in self if stop is not None)


def match_groups(a: Sequence[ReadGroup], b: Sequence[ReadGroup]) -> list[tuple[int, int]]:
    """Return the pairs of contours of A and B along the same path, or with the same name."""
    one, two = [_trace(group) for group in a], [_trace(group) for group in b]
    cost = np.full((len(a), len(b)), NEVER)
    for i, path in enumerate(one):
        for j, other in enumerate(two):
            if (path is None) == (other is None):
                # Of equal contours, the one in the same order.
                cost[i, j] = _distance(path, other) + 1e-9 * abs(i - j)
    rows, columns = linear_sum_assignment(np.minimum(cost, NEAR))
    found = {int(i): int(j) for i, j in zip(rows, columns, strict=True) if cost[i, j] < NEAR}
    for i, group in enumerate(a):
        left = [j for j in range(len(b)) if j not in found.values() and cost[i, j] < NEVER]
        same = [j for j in left if b[j].name.lower() == group.name.lower()]
        if i not in found and same:
            found[i] = same[0]
    return sorted(found.items())


def _distance(one: Array | None, two: Array | None) -> float:
    """Return the median distance (m) of two paths."""
    if one is None or two is None:
        return 0.0
    return float(np.median(np.linalg.norm(one - two, axis=1)))


def _trace(group: ReadGroup) -> Array | None:
    """Return points (SAMPLES, 3) along the path of a contour; None after the last."""
    points = _points(group.path)
    if not len(points):
        return None
    way = lengths_along(points)
    at = np.linspace(0, way[-1], SAMPLES)
    return np.stack([np.interp(at, way, x) for x in points.T], axis=1)


def _points(moves: Sequence[ReadMove]) -> Array:
    """Return the ends (K, 3) m of moves in the part."""
    ends = [move.T_part_tip for move in moves if move.T_part_tip is not None]
    if len(ends) < len(moves):
        raise InputError("a program gives joints alone along its path; apply with_tips first")
    return np.array(ends).reshape(-1, 4, 4)[:, :3, 3]


def pair_moves(a: ReadGroup, b: ReadGroup, near: float) -> list[MovePair]:
    """Return the moves of a contour in A with those in B that end at the same place.

    Other moves between them are paired in order, as many as both programs have.

    Parameters
    ----------
    a, b : ReadGroup
    near : float m
        Distance up to which two places are the same.
    """
    joint = min(len(a.joint), len(b.joint))
    ways = [_add_waits(g.joint, [(len(g.joint), w) for k, w in g.waits if k == 0]) for g in (a, b)]
    pairs = [MovePair(stop, None) for stop in ways[0][: len(ways[0]) - joint]]
    pairs += [MovePair(None, stop) for stop in ways[1][: len(ways[1]) - joint]]
    pairs += [
        MovePair(*both) for both in zip(*(way[len(way) - joint :] for way in ways), strict=True)
    ]
    one, two = _add_waits(a.path, a.waits), _add_waits(b.path, b.waits)
    keys = _number_places(a.path, b.path, near)
    if len(one) == len(two) and 2 * (keys[0] == keys[1]).sum() >= len(one):
        return pairs + [MovePair(*both) for both in zip(one, two, strict=True)]
    matcher = SequenceMatcher(None, keys[0].tolist(), keys[1].tolist(), autojunk=False)
    for _, i0, i1, j0, j1 in matcher.get_opcodes():
        both = min(i1 - i0, j1 - j0)
        pairs += [MovePair(one[i0 + k], two[j0 + k]) for k in range(both)]
        pairs += [MovePair(stop, None) for stop in one[i0 + both : i1]]
        pairs += [MovePair(None, stop) for stop in two[j0 + both : j1]]
    return pairs


def _add_waits(moves: Sequence[ReadMove], waits: Sequence[tuple[int, ReadWait]]) -> list[Stop]:
    """Return moves with the waits after them."""
    stops = [Stop(move) for move in moves]
    for behind, wait in waits:
        if behind > 0:
            move, time, at = stops[behind - 1]
            stops[behind - 1] = Stop(move, time + wait.time, at or wait.place)
    return stops


def _number_places(a: Sequence[ReadMove], b: Sequence[ReadMove], near: float) -> tuple[Ints, Ints]:
    """Return a number for each place that moves of a path end at."""
    one, two = _points(a), _points(b)
    if not len(one):
        return np.zeros(0, np.int64), -1 - np.arange(len(two))
    tree = cKDTree(one)
    first = np.arange(len(one))
    for i, j in sorted(tree.query_pairs(near)):
        first[j] = min(first[j], first[i])
    off, nearest = tree.query(two)
    return first, np.where(off <= near, first[nearest], -1 - np.arange(len(two)))


# -----------------------------------------------------------------------------
# List the differences between two programs that were read.

Both = Sequence[tuple[Stop, Stop]]
"""Moves that both programs have."""
Posed = tuple[Stop, Stop, Array, Array]
"""Such a pair of moves, with the poses (4, 4) that both have there."""
ELSEWHERE = {
    "targets": "target",
    "joints": "target",
    "external": "target",
    "postures": "target",
    "speeds": "speed",
    "zones": "zone",
    "switches": "switches",
}
"""The key of `ReadMove.elsewhere` for the code of a difference."""
OPTIONAL = (("speed", "speeds"), ("duration", "times"), ("cruise", "times"), ("zone", "zones"))
"""Attributes that a move may lack, and the code of a difference in them."""
JOINTS = 9
"""Largest number of joints of a robot."""
Names = tuple[str, str]
"""Names of programs A and B in messages."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """One kind of difference between programs A and B.

    Parameters
    ----------
    code : str
        frames, added, removed, order, targets, joints, external, kinds, speeds, times, zones,
        switches, waits, postures, handshakes or power.
    count : int
        Number of contours or moves that differ.
    message : str
        Text with the largest difference.
    places : tuple of str
        File and line of the largest difference in A and in B, as far as it has one there.
    said_at : str
        File and line in B of what differs, if that is not the line of the move.
    near : str
        File and line in B before which something is missing there.
    """

    code: str
    count: int
    message: str
    places: tuple[str, ...] = ()
    said_at: str = ""
    near: str = ""

    __repr__ = short_repr

    @property
    def place(self) -> str:
        """File and line in B; empty if there is none."""
        return self.near or (self.places[-1] if self.places else "")

    def __str__(self) -> str:
        at = f", at {' / '.join(self.places)}" if self.places else ""
        return f"{self.code}: {self.message}{at}"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Digits:
    """Largest differences (m, rad, sine, m/s, s, s) of two texts that come from their digits.

    Tips may differ by `by_joints` (m) more if both give joints: those are compared, too.
    """

    point: float
    by_joints: float
    angle: float
    frame: float
    speed: float
    lead: float
    duration: float

    @classmethod
    def of(cls, rules: Sequence[Rules], joints: int) -> _Digits:
        """Return those of texts with the digits of `rules`; without any, of equal languages."""
        steps = [(r.point_step, r.angle_step, r.speed_step) for r in rules] or [(0.0, 0.0, 0.0)]
        # Two texts are rounded, both with the digits of a single language: a number halfway between
        # two digits may become either of them.
        point, angle, speed = (np.sum(steps, axis=0) * 2 / len(steps)).tolist()
        return cls(
            point=POINT + np.sqrt(3.0) * point,
            by_joints=REACH * joints * angle,
            angle=ANGLE + angle,
            frame=FRAME + point + angle,
            speed=1e-9 + 0.51 * speed,
            lead=LEAD * len(steps),
            duration=LEAD * len(steps),
        )


_Unequal = tuple[Difference, list[ProgramIssue]]
"""Moves that differ in one property: the difference, and an issue of each of them."""


def differences(
    a: ReadProgram,
    b: ReadProgram,
    *,
    rules: Sequence[Rules] = (),
    names: Names = ("A", "B"),
    strict: bool = False,
) -> list[Difference]:
    """Return the differences between two programs for the same robot, at most one of each kind.

    Contours are matched by their paths, and targets along them by their positions, so that one
    that is added or left out does not affect the others. Names of routines and comments are not
    compared, nor what only one of the two programs contains; see `not_compared`.

    Parameters
    ----------
    a, b : ReadProgram
        Programs in the same language, or in two languages without their words for postures. A
        program that gives joints alone needs `with_tips` before.
    rules : sequence of Rules
        Rules of the languages, for their digits; empty if both texts are in the same language.
    names : (str, str)
        Names of the two programs in messages.
    strict : bool
        Whether a speed, time or zone that only one of them gives is a difference.

    Raises
    ------
    InputError
        A path is given in joints alone.
    """
    digits = _Digits.of(rules, JOINTS)
    found = list(_compare_frames(a, b, digits))
    one, two = groups_of(a), groups_of(b)
    same = match_groups(one, two)
    found += _name_contours(one, {i for i, _ in same}, "removed", f"left out in {names[1]}")
    found += _name_contours(two, {j for _, j in same}, "added", f"only in {names[1]}")
    found += _compare_order(two, [j for _, j in same], names)
    pairs = [pair for i, j in same for pair in pair_moves(one[i], two[j], digits.point)]
    both = [(pair.a, pair.b) for pair in pairs if pair.a is not None and pair.b is not None]
    found += _name_moves(pairs, names)
    found += [each for each, _ in _compare_targets(both, digits)]
    found += [each for each, _ in _compare_values(both, digits, b.externals, names)]
    if strict:
        found += _find_given_once(both, names)
    found += _compare_handshakes([(one[i], two[j]) for i, j in same], names)
    found += _compare_powers([(one[i], two[j]) for i, j in same], names)
    return found


def not_compared(a: ReadProgram, b: ReadProgram) -> list[str]:
    """Return what only one of two programs contains, so that it cannot be compared."""
    said = []
    for attribute, words in (
        ("speed", "speeds"), ("duration", "times"), ("zone", "zones"), ("posture", "postures"),
    ):  # fmt: skip
        has = [any(getattr(m, attribute) for m in p.moves if m.kind != "joint") for p in (a, b)]
        said += [words] if has[0] != has[1] else []
    for attribute, words in (("T_flange_tip", "the tool"), ("T_base_part", "the part frame")):
        has = [getattr(p, attribute) is not None for p in (a, b)]
        said += [words] if not all(has) else []
    return said


def _compare_frames(
    a: Program | ReadProgram, b: ReadProgram, digits: _Digits
) -> Iterator[Difference]:
    for attribute, words in (("T_flange_tip", "tool"), ("T_base_part", "part frame")):
        one, two = getattr(a, attribute), getattr(b, attribute)
        if one is None or two is None or np.abs(one - two).max() <= digits.frame:
            continue
        off, turned = distances(one[None], two[None])
        message = f"the {words} is {off[0] * 1e3:.4f} mm and {np.degrees(turned[0]):.4f} deg off"
        yield Difference(code="frames", count=1, message=message)


def _name_contours(
    groups: Sequence[ReadGroup], known: set[int], code: str, words: str
) -> Iterator[Difference]:
    alone = [group for k, group in enumerate(groups) if k not in known]
    if alone:
        names = ", ".join(group.name for group in alone)
        message = f"{counted(len(alone), 'contour')} {words}: {names}"
        first = [*alone[0].joint, *alone[0].path][:1] if code == "added" else []
        places = tuple(move.place for move in first)
        yield Difference(code=code, count=len(alone), message=message, places=places)


def _compare_order(
    groups: Sequence[ReadGroup], numbers: list[int], both: Names
) -> Iterator[Difference]:
    """Compare the order of contours, given the numbers in B of those of A."""
    if numbers != sorted(numbers):
        names = ", ".join(groups[j].name for j in sorted(numbers) if groups[j].path)
        message = f"the contours are cut in another order; {both[1]} has {names}"
        yield Difference(code="order", count=1, message=message)


def _name_moves(pairs: Sequence[MovePair], names: Names) -> Iterator[Difference]:
    """Find moves that only one of the programs has, and where they are missing in B."""
    for side, code, words in (
        (1, "removed", f"left out in {names[1]}"), (0, "added", f"only in {names[1]}"),
    ):  # fmt: skip
        alone = [k for k, pair in enumerate(pairs) if pair[side] is None]
        if not alone:
            continue
        around = [*pairs[alone[0] :], *reversed(pairs[: alone[0]])]
        near = [pair.b.move.place for pair in around if pair.b is not None]
        yield Difference(
            code=code,
            count=len(alone),
            message=f"{counted(len(alone), 'move')} {words}, the first",
            places=pairs[alone[0]].places,
            near=near[0] if side == 1 and near else "",
        )


def _posed(both: Both) -> list[Posed]:
    """Return the targets, and the points on the way to them, whose pose both programs give."""
    return [
        (a, b, getattr(a.move, which), getattr(b.move, which))
        for a, b in both
        for which in ("T_part_tip", "T_part_via")
        if getattr(a.move, which) is not None and getattr(b.move, which) is not None
    ]


def _compare_targets(both: Both, digits: _Digits) -> Iterator[_Unequal]:
    """Compare the tip poses of targets and of points on the way to them."""
    posed = _posed(both)
    jointed = np.array([a.move.q is not None and b.move.q is not None for a, b, _, _ in posed])
    by_joints = jointed * digits.by_joints
    yield from _compare_poses(posed, digits.point + by_joints, digits.angle + by_joints / REACH)


def _compare_poses(
    posed: Sequence[Posed], point: float | Array, angle: float | Array
) -> Iterator[_Unequal]:
    if not posed:
        return
    off, turned = distances(
        np.array([one[2] for one in posed]), np.array([one[3] for one in posed])
    )
    moved = np.flatnonzero((off > point) | (turned > angle)).tolist()
    if moved:
        off, turned = off[moved] * 1e3, np.degrees(turned[moved])
        message = f"{len(moved)} moved, by up to {off.max():.4f} mm and {turned.max():.4f} deg"
        words = [
            f"the tip is {by:.4f} mm and {angle:.4f} deg off"
            for by, angle in zip(off, turned, strict=True)
        ]
        worst = int(np.lexsort((turned, off))[-1])
        yield _unequal("targets", [posed[k][:2] for k in moved], worst, message, words)


def _compare_values(
    both: Both, digits: _Digits, axes: Sequence[ExternalAxis], names: Names
) -> Iterator[_Unequal]:
    """Compare joints and external axes, and the other properties of moves one after the other."""
    yield from _compare_joints(both, digits, len(axes))
    yield from _compare_external(both, digits, axes)
    rows: tuple[tuple[str, str, Callable[[Stop, Stop], float], Callable[[Stop], str]], ...] = (
        ("kinds", "is", lambda a, b: a.move.kind != b.move.kind, lambda a: a.move.kind),
        (
            "speeds",
            "the speed is",
            lambda a, b: _speeds(a.move, b.move, digits),
            lambda a: _speed(a.move),
        ),
        (
            "times",
            "takes",
            lambda a, b: _times(a.move, b.move, digits),
            lambda a: f"{a.move.cruise if a.move.duration is None else a.move.duration:g} s",
        ),
        ("zones", "the zone is", lambda a, b: _zones(a.move, b.move, digits), _zone),
        (
            "switches",
            "switches",
            lambda a, b: _switches(a.move, b.move, digits),
            lambda a: switches_in_words(a.move.switches),
        ),
        (
            "waits",
            "waits",
            lambda a, b: _excess(a.wait, b.wait, digits.lead),
            lambda a: f"{a.wait:g} s",
        ),
        (
            "postures",
            "the posture is",
            lambda a, b: (
                bool(a.move.posture and b.move.posture) and a.move.posture != b.move.posture
            ),
            lambda a: " ".join(str(word) for word in a.move.posture),
        ),
    )
    for code, verb, excess, shown in rows:
        off = np.array([float(excess(a, b)) for a, b in both])
        if moved := np.flatnonzero(off > 0).tolist():
            values = [(shown(a), shown(b)) for a, b in (both[k] for k in moved)]
            worst = int(np.argmax(off[moved]))
            one, two = values[worst]
            message = f"{counted(len(moved), 'move')}, {one} in {names[0]} and {two} in {names[1]}"
            words = [f"{verb} {found}, expected {expected}" for expected, found in values]
            yield _unequal(code, [both[k] for k in moved], worst, message, words)


def _compare_joints(both: Both, digits: _Digits, external: int) -> Iterator[_Unequal]:
    """Compare the joints of the arm, if both programs give them; the last are external axes."""
    given = [(a, b) for a, b in both if a.move.q is not None and b.move.q is not None]
    if not given:
        return
    q = np.abs(np.array([a.move.q for a, _ in given]) - [b.move.q for _, b in given])
    q = np.degrees(q[:, : q.shape[1] - external])
    off = q.max(axis=1)
    if moved := np.flatnonzero(off > np.degrees(digits.angle)).tolist():
        words = [f"joint {q[k].argmax() + 1} is {off[k]:.4f} deg off" for k in moved]
        message = f"{len(moved)} moved, by up to {off.max():.4f} deg"
        worst = int(np.argmax(off[moved]))
        yield _unequal("joints", [given[k] for k in moved], worst, message, words)


def _compare_external(
    both: Both, digits: _Digits, axes: Sequence[ExternalAxis]
) -> Iterator[_Unequal]:
    """Compare the values of external axes, if both programs give them."""
    values = ((a.move.external_of(axes), b.move.external_of(axes), a, b) for a, b in both)
    given = [(np.abs(x - y), a, b) for x, y, a, b in values if x is not None and y is not None]
    for i, axis in enumerate(axes):
        linear = axis.kind == "linear"
        least = digits.point if linear else digits.angle
        moved = [(a, b) for off, a, b in given if off[i] > least]
        offs = [float(off[i]) for off, _, _ in given if off[i] > least]
        if moved:
            by = [f"{x * 1e3:.4f} mm" if linear else f"{np.degrees(x):.4f} deg" for x in offs]
            worst = int(np.argmax(offs))
            message = f"{axis.name} moved at {counted(len(moved), 'target')}, by up to {by[worst]}"
            words = [f"{axis.name} is {each} off" for each in by]
            yield _unequal("external", moved, worst, message, words)


def _unequal(code: str, moves: Both, worst: int, message: str, words: Sequence[str]) -> _Unequal:
    """Return the difference at the worst of moves, and an issue of each in `words`."""
    pair = moves[worst]
    places = tuple((code == "waits" and stop.waits_at) or stop.move.place for stop in pair)
    said_at = pair[1].move.elsewhere.get(ELSEWHERE.get(code, ""), "")
    return (
        Difference(code=code, count=len(moves), message=message, places=places, said_at=said_at),
        [_issue(b.move, each) for (_, b), each in zip(moves, words, strict=True)],
    )


def _find_given_once(both: Both, names: Names) -> Iterator[Difference]:
    """Find moves that have a speed, a time or a zone in only one of the programs."""
    for attribute, code in OPTIONAL:
        said = [[getattr(stop.move, attribute) is not None for stop in pair] for pair in both]
        if alone := [k for k, (one, two) in enumerate(said) if one != two]:
            a, b = both[alone[0]]
            where = names[0] if said[alone[0]][0] else names[1]
            message = f"{counted(len(alone), 'move')}, given in {where} alone"
            places = (a.move.place, b.move.place)
            yield Difference(code=code, count=len(alone), message=message, places=places)


def _compare_handshakes(
    groups: Sequence[tuple[ReadGroup, ReadGroup]], names: Names
) -> Iterator[Difference]:
    """Compare which partners are asked and awaited, and when."""
    said = [[[(k, h.what) for k, h in g.handshakes] for g in both] for both in groups]
    differ = [both for both, (one, two) in zip(groups, said, strict=True) if one != two]
    if differ:
        one, two = (
            ", ".join(handshake_in_words(h.what) for _, h in group.handshakes) or "none"
            for group in differ[0]
        )
        message = f"{counted(len(differ), 'contour')}, {one} in {names[0]}, {two} in {names[1]}"
        there = [h.place for _, h in differ[0][1].handshakes]
        near = [move.place for move in (*differ[0][1].path, *differ[0][1].joint)]
        yield Difference(
            code="handshakes", count=len(differ), message=message, near=[*there, *near, ""][0]
        )


def _compare_powers(
    groups: Sequence[tuple[ReadGroup, ReadGroup]], names: Names
) -> Iterator[Difference]:
    """Compare the power that is set while the robot stands."""
    for a, b in groups:
        one, two = a.powers, b.powers
        same = len(one) == len(two) and all(
            k == j and _same_power(x, y) for (k, x), (j, y) in zip(one, two, strict=True)
        )
        if not same:
            shares = ([_power(power) for _, power in each] for each in (one, two))
            words = (", ".join(each) or "none" for each in shares)
            said = " and ".join(f"{w} in {name}" for w, name in zip(words, names, strict=True))
            there = [power.place for _, power in b.powers]
            near = [move.place for move in (*b.path, *b.joint)]
            message = f"set while the robot stands: {said}"
            yield Difference(code="power", count=1, message=message, near=[*there, *near, ""][0])
            return


def _excess(one: float | None, two: float | None, allowed: float) -> float:
    """Return by how much two numbers differ beyond `allowed`; 0 if one is missing."""
    return 0.0 if one is None or two is None else max(abs(one - two) - allowed, 0.0)


def _times(a: ReadMove, b: ReadMove, digits: _Digits) -> float:
    allowed = digits.lead if a.kind == "joint" else digits.duration
    return max(_excess(a.duration, b.duration, allowed), _excess(a.cruise, b.cruise, digits.lead))


def _zones(a: ReadMove, b: ReadMove, digits: _Digits) -> float:
    """Return by how much two zones differ; a stop differs from any rounded corner."""
    if (a.zone is None) != (b.zone is None) and 0.0 in (a.zone, b.zone):
        return np.inf
    return _excess(a.zone, b.zone, digits.point)


def _zone(stop: Stop) -> str:
    if stop.move.zone is None:
        return "a rounded corner"
    return f"{stop.move.zone * 1e3:g} mm" if stop.move.zone else "a stop"


def _speeds(a: ReadMove, b: ReadMove, digits: _Digits) -> float:
    kinds = {a.kind, b.kind}
    if "joint" in kinds:
        return _excess(a.speed, b.speed, SHARE) if len(kinds) == 1 else 0.0
    return _excess(a.speed, b.speed, digits.speed)


def _speed(move: ReadMove) -> str:
    assert move.speed is not None
    return f"{move.speed:.1%}" if move.kind == "joint" else f"{move.speed * 1e3:g} mm/s"


def _switches(a: ReadMove, b: ReadMove, digits: _Digits) -> bool:
    """Return whether two moves switch different signals, or at different times."""
    ours, theirs = ([(s.signal, s.on, s.needs) for s in move.switches] for move in (a, b))
    return ours != theirs or any(
        abs(one.lead_time - two.lead_time) > digits.lead
        or abs((one.share or 0.0) - (two.share or 0.0)) > SAME_POWER
        for one, two in zip(a.switches, b.switches, strict=True)
    )


# -----------------------------------------------------------------------------
# Compare a program that was read back with the one that was written.


def deviations(
    program: Program, read: ReadProgram, language: Language, settings: LanguageSettings
) -> list[ProgramIssue]:
    """Return every kind of difference between a program and what was read back of its text.

    Steps are compared in order, and only what the language can express.

    Parameters
    ----------
    program : Program
    read : ReadProgram
        The program that the reader of the language returned for the text.
    language : Language
    settings : LanguageSettings
        Settings with which it was written.
    """
    if language.sayable is not None:
        program = language.sayable(program, settings)
    ours = [step for step in program.steps if not isinstance(step, Comment)]
    theirs = list(read.steps)
    if len(ours) != len(theirs):
        message = f"{len(theirs)} moves and waits were read back, expected {len(ours)}"
        return [ProgramIssue("error", "read-back", message, "program")]
    issues: list[ProgramIssue] = []
    pairs: list[tuple[Move, ReadMove]] = []
    for step, back in zip(ours, theirs, strict=True):
        if isinstance(step, Wait) and isinstance(back, ReadWait):
            if abs(step.time - back.time) > LEAD:
                issues.append(_issue(back, f"waits {back.time:g} s, expected {step.time:g} s"))
        elif isinstance(step, SetPower) and isinstance(back, ReadPower):
            if not _same_power(step, back):
                message = f"the power is {_power(back)}, expected {_power(step)}"
                issues.append(_issue(back, message))
        elif isinstance(step, Request | Await) and isinstance(back, ReadHandshake):
            if step != back.what:
                message = f"{handshake_in_words(back.what)}, expected {handshake_in_words(step)}"
                issues.append(_issue(back, message))
        elif not isinstance(back, ReadMove) or _kind(step) != back.kind:
            issues.append(_issue(back, f"is a {_kind_read(back)}, expected a {_kind(step)}"))
        else:
            assert isinstance(step, JointMove | LinearMove)
            pairs.append((step, back))
    digits = _Digits.of([language.rules(settings)], program.robot.joints)
    digits = replace(digits, frame=FRAME, duration=DURATION)
    for frame in _compare_frames(program, read, digits):
        message = f"not as planned: {frame.message}"
        issues.append(ProgramIssue("error", "read-back", message, "program"))
    planned = _planned_moves(program, read, pairs, language, settings)
    both = [(Stop(move), Stop(back)) for move, (_, back) in zip(planned, pairs, strict=True)]
    for _, unequal in (
        *_compare_given_poses(program, both, digits),
        *_compare_values(both, digits, program.robot.externals, ("the program", "the text")),
    ):
        issues += unequal
    return [*issues, *_check_targets(program.robot, pairs)]


def _issue(back: ReadStep, message: str) -> ProgramIssue:
    return ProgramIssue("error", "read-back", f"not as planned: {message}", back.place)


def _kind(step: object) -> str:
    kinds = (
        ("joint", JointMove),
        ("circular", CircularMove),
        ("linear", LinearMove),
        ("wait", Wait),
        ("power", SetPower),
    )
    return next((word for word, kind in kinds if isinstance(step, kind)), "handshake")


def _kind_read(back: ReadStep) -> str:
    if isinstance(back, ReadMove):
        return back.kind
    kinds = (("wait", ReadWait), ("power", ReadPower))
    return next((word for word, kind in kinds if isinstance(back, kind)), "handshake")


def handshake_in_words(what: Handshake) -> str:
    """Return a handshake in words."""
    if isinstance(what, Await):
        return f"awaits {what.partner} for {what.timeout:g} s"
    return f"{what.partner} request {'on' if what.on else 'off'}"


def switches_in_words(switches: Iterable[Switch]) -> str:
    """Return switches in words."""
    words = [
        f"{s.signal} {_state(s)} {s.lead_time:g} s ahead"
        + (f", only with {' and '.join(s.needs)}" if s.needs else "")
        for s in switches
    ]
    return " and ".join(words) or "nothing"


def _same_power(a: SetPower | ReadPower, b: SetPower | ReadPower) -> bool:
    """Return whether two settings of the power are the same, but for digits."""
    near = abs(a.per_speed - b.per_speed) <= SAME_POWER * max(a.per_speed, b.per_speed)
    near = near and abs(a.lead_time - b.lead_time) <= LEAD
    return near and abs(a.share - b.share) <= SAME_POWER


def _power(power: SetPower | ReadPower) -> str:
    """Return a setting of the power in words."""
    return f"{power.per_speed:.1%} for each m/s" if power.per_speed else f"{power.share:.1%}"


def _state(switch: Switch) -> str:
    """Return what a signal is switched to, in words."""
    return ("on" if switch.on else "off") if switch.share is None else f"{switch.share:.1%}"


def _joints_follow(back: ReadMove) -> bool:
    """Return whether the joints of a move follow from a pose and its configuration."""
    return back.T_part_tip is not None and back.posture != ()


def _planned_moves(
    program: Program,
    read: ReadProgram,
    pairs: Sequence[tuple[Move, ReadMove]],
    language: Language,
    settings: LanguageSettings,
) -> Iterator[ReadMove]:
    """Yield each planned move with the values of all that its text states."""
    arm = program.robot.family.joints
    tips = program.tips([move for move, _ in pairs])
    air, cruise = dict(zip(read.moves, air_times(program), strict=False)), cruises(program)
    postures: Iterator[tuple[int | str, ...]] = iter(())
    worded = [move.q for move, back in pairs if back.posture]
    if worded and language.posture is not None:
        postures = iter(language.posture(program.robot, np.array(worded), settings))
    for (move, back), tip in zip(pairs, tips, strict=True):
        duration = air.get(back) if isinstance(move, JointMove) else move.duration
        timed_joint = isinstance(move, JointMove) and back.duration is not None
        yield replace(
            back,
            speed=None if timed_joint else move.speed,
            duration=None if back.duration is None else duration,
            cruise=cruise.get(move),
            zone=move.zone,
            q=None if back.q is None or _joints_follow(back) else move.q,
            T_part_tip=tip,
            T_part_via=move.T_part_via if isinstance(move, CircularMove) else None,
            external=move.q[arm:],
            posture=next(postures, ()) if back.posture else (),
            switches=switches_of(move),
        )


def _compare_given_poses(program: Program, both: Both, digits: _Digits) -> Iterator[_Unequal]:
    """Compare the poses in a text, and those to which its joints lead, with the planned ones."""
    yield from _compare_poses(_posed(both), digits.point, digits.angle)
    jointed = [(a, b, a.move.q, b.move.q) for a, b in both if a.move.q is not None]
    if jointed:
        ours, theirs = (
            program.robot.forward(np.array([one[side] for one in jointed])) @ program.T_flange_tip
            for side in (2, 3)
        )
        rows = [(a, b, T, T_b) for (a, b, *_), T, T_b in zip(jointed, ours, theirs, strict=True)]
        by_joints = digits.by_joints
        yield from _compare_poses(rows, digits.point + by_joints, digits.angle + by_joints / REACH)


def _check_targets(robot: Robot, pairs: Sequence[tuple[Move, ReadMove]]) -> Iterator[ProgramIssue]:
    """Find targets without a position, and configurations that lead to other joints."""
    for move, back in pairs:
        if back.q is None and back.T_part_tip is None:
            yield _issue(back, "the target is missing")
        if robot.externals and back.external_of(robot.externals) is None:
            yield _issue(back, f"the value of {robot.externals[0].name} is missing")
        if back.q is not None and _joints_follow(back):
            off = float(np.abs(move.q - back.q)[: robot.family.joints].max())
            if off > DERIVED:
                message = f"the configuration leads to joints {np.degrees(off):.1f} deg off"
                yield _issue(back, message)
