"""List the differences between two programs that were read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from kerfpath._repr import counted, short_repr
from kerfpath.post._compare import (
    ANGLE,
    FRAME,
    LEAD,
    POINT,
    REACH,
    SHARE,
    handshake_in_words,
    switches_in_words,
)
from kerfpath.post._groups import ReadGroup, groups_of
from kerfpath.post._matching import MovePair, Stop, match_groups, pair_moves
from kerfpath.post._orientations import distances
from kerfpath.post._read import ReadMove, ReadProgram
from kerfpath.post._settings import Rules
from kerfpath.robots import ExternalAxis

__all__ = ["Difference", "differences", "not_compared"]

Both = Sequence[tuple[Stop, Stop]]
"""Moves that both programs have."""
SAID = {"speeds": "speed", "zones": "zone", "switches": "switches", "postures": "target"}
"""The key of `ReadMove.elsewhere` for the code of a difference."""
UNSAID = (("speed", "speeds"), ("duration", "times"), ("cruise", "times"), ("zone", "zones"))
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
        switches, waits, postures or handshakes.
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
    """Largest differences (m, rad, sine, m/s, s) of two texts that come from their digits.

    Tips may differ by `by_joints` (m) more if both give joints: those are compared, too.
    """

    point: float
    by_joints: float
    angle: float
    frame: float
    speed: float
    lead: float


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
    steps = [(r.point_step, r.angle_step, r.speed_step) for r in rules] or [(0.0, 0.0, 0.0)]
    point, angle, speed = np.sum(steps, axis=0).tolist()
    digits = _Digits(
        point=POINT + point,
        by_joints=REACH * JOINTS * angle,
        angle=ANGLE + angle,
        frame=FRAME + point + angle,
        speed=1e-9 + 0.51 * speed,
        lead=LEAD * len(steps),
    )
    found = list(_compare_frames(a, b, digits))
    one, two = groups_of(a), groups_of(b)
    same = match_groups(one, two)
    found += _name_contours(one, {i for i, _ in same}, "removed", f"left out in {names[1]}")
    found += _name_contours(two, {j for _, j in same}, "added", f"only in {names[1]}")
    found += _compare_order(two, [j for _, j in same], names)
    pairs = [pair for i, j in same for pair in pair_moves(one[i], two[j], digits.point)]
    both = [(pair.a, pair.b) for pair in pairs if pair.a is not None and pair.b is not None]
    found += _name_moves(pairs, names)
    found += _compare_targets(both, digits)
    found += _compare_joints(both, digits, len(b.externals))
    found += _compare_external(both, digits, b.externals)
    found += _compare_values(both, digits, names)
    if strict:
        found += _find_unsaid(both, names)
    found += _compare_handshakes([(one[i], two[j]) for i, j in same], names)
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


def _compare_frames(a: ReadProgram, b: ReadProgram, digits: _Digits) -> Iterator[Difference]:
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


def _compare_targets(both: Both, digits: _Digits) -> Iterator[Difference]:
    """Compare the tip poses of targets and of points on the way to them."""
    posed = [
        (a, b, getattr(a.move, which), getattr(b.move, which))
        for a, b in both
        for which in ("T_part_tip", "T_part_via")
        if getattr(a.move, which) is not None and getattr(b.move, which) is not None
    ]
    if not posed:
        return
    off, turned = distances(
        np.array([one[2] for one in posed]), np.array([one[3] for one in posed])
    )
    jointed = np.array([a.move.q is not None and b.move.q is not None for a, b, _, _ in posed])
    point = digits.point + jointed * digits.by_joints
    angle = digits.angle + jointed * digits.by_joints / REACH
    moved = np.flatnonzero((off > point) | (turned > angle))
    if moved.size:
        a, b, _, _ = posed[moved[np.lexsort((turned[moved], off[moved]))[-1]]]
        message = (
            f"{len(moved)} moved, by up to {off[moved].max() * 1e3:.4f} mm "
            f"and {np.degrees(turned[moved].max()):.4f} deg"
        )
        yield _difference("targets", len(moved), message, a, b)


def _compare_joints(both: Both, digits: _Digits, external: int) -> Iterator[Difference]:
    """Compare the joints of the arm, if both programs give them; the last are external axes."""
    said = [(a, b) for a, b in both if a.move.q is not None and b.move.q is not None]
    if not said:
        return
    q = np.abs(np.array([a.move.q for a, _ in said]) - [b.move.q for _, b in said])
    off = q[:, : q.shape[1] - external].max(axis=1)
    moved = np.flatnonzero(off > digits.angle)
    if moved.size:
        worst = int(moved[np.argmax(off[moved])])
        message = f"{len(moved)} moved, by up to {np.degrees(off[worst]):.4f} deg"
        yield _difference("joints", len(moved), message, *said[worst])


def _compare_external(
    both: Both, digits: _Digits, axes: Sequence[ExternalAxis]
) -> Iterator[Difference]:
    """Compare the values of external axes, if both programs give them."""
    values = ((a.move.external_of(axes), b.move.external_of(axes), a, b) for a, b in both)
    said = [(np.abs(x - y), a, b) for x, y, a, b in values if x is not None and y is not None]
    for i, axis in enumerate(axes):
        least = digits.point if axis.kind == "linear" else digits.angle
        moved = [(float(off[i]), a, b) for off, a, b in said if off[i] > least]
        if moved:
            off, a, b = max(moved, key=lambda each: each[0])
            by = f"{off * 1e3:.4f} mm" if axis.kind == "linear" else f"{np.degrees(off):.4f} deg"
            message = f"{axis.name} moved at {counted(len(moved), 'target')}, by up to {by}"
            yield _difference("external", len(moved), message, a, b)


def _difference(code: str, count: int, message: str, a: Stop, b: Stop) -> Difference:
    said_at = b.move.elsewhere.get("target", "")
    places = (a.move.place, b.move.place)
    return Difference(code=code, count=count, message=message, places=places, said_at=said_at)


def _compare_values(both: Both, digits: _Digits, names: Names) -> Iterator[Difference]:
    """Compare the other attributes of moves, one after the other."""
    rows: tuple[tuple[str, Callable[[Stop, Stop], float], Callable[[Stop], str]], ...] = (
        ("kinds", lambda a, b: a.move.kind != b.move.kind, lambda a: a.move.kind),
        ("speeds", lambda a, b: _speeds(a.move, b.move, digits), lambda a: _speed(a.move)),
        (
            "times",
            lambda a, b: max(
                _excess(a.move.duration, b.move.duration, digits.lead),
                _excess(a.move.cruise, b.move.cruise, digits.lead),
            ),
            lambda a: f"{a.move.cruise if a.move.duration is None else a.move.duration:g} s",
        ),
        (
            "zones",
            lambda a, b: _zones(a.move, b.move, digits),
            _zone,
        ),
        (
            "switches",
            lambda a, b: _switches(a.move, b.move, digits),
            lambda a: switches_in_words(a.move.switches),
        ),
        ("waits", lambda a, b: _excess(a.wait, b.wait, digits.lead), lambda a: f"{a.wait:g} s"),
        (
            "postures",
            lambda a, b: (
                bool(a.move.posture and b.move.posture) and a.move.posture != b.move.posture
            ),
            lambda a: " ".join(str(word) for word in a.move.posture),
        ),
    )
    for code, excess, words in rows:
        off = np.array([float(excess(a, b)) for a, b in both])
        moved = np.flatnonzero(off > 0)
        if moved.size:
            a, b = both[int(moved[np.argmax(off[moved])])]
            said = f"{words(a)} in {names[0]} and {words(b)} in {names[1]}"
            message = f"{counted(len(moved), 'move')}, {said}"
            places = tuple((code == "waits" and s.waits_at) or s.move.place for s in (a, b))
            said_at = b.move.elsewhere.get(SAID[code], "") if code in SAID else ""
            yield Difference(
                code=code, count=len(moved), message=message, places=places, said_at=said_at
            )


def _find_unsaid(both: Both, names: Names) -> Iterator[Difference]:
    """Find moves that have a speed, a time or a zone in only one of the programs."""
    for attribute, code in UNSAID:
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


def _excess(one: float | None, two: float | None, allowed: float) -> float:
    """Return by how much two numbers differ beyond `allowed`; 0 if one is missing."""
    return 0.0 if one is None or two is None else max(abs(one - two) - allowed, 0.0)


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
    ours, theirs = ([(s.signal, s.on) for s in move.switches] for move in (a, b))
    return ours != theirs or any(
        abs(one.lead_time - two.lead_time) > digits.lead
        for one, two in zip(a.switches, b.switches, strict=True)
    )
