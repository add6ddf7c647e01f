"""List the differences between two programs that were read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from kerfpath.arrays import Array, Ints, counted, short_repr
from kerfpath.errors import InputError
from kerfpath.post.arcs import air_times, cruises, distances
from kerfpath.post.languages import Language, LanguageSettings, Rules
from kerfpath.post.places import ReadGroup, groups_of
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
    Wait,
)
from kerfpath.post.read_program import ReadHandshake, ReadMove, ReadProgram, ReadStep, ReadWait
from kerfpath.robots import ExternalAxis, Robot

# -----------------------------------------------------------------------------
# Compare a program that was read back with the one that was written.

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


def deviations(
    program: Program, read: ReadProgram, language: Language, settings: LanguageSettings
) -> list[ProgramIssue]:
    """Return every difference between a program and what was read back; empty if there is none.

    Only what the language can express is compared.

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
    issues = list(_check_frames(program, read))
    ours = [step for step in program.steps if not isinstance(step, Comment)]
    theirs = list(read.steps)
    if len(ours) != len(theirs):
        message = f"{len(theirs)} moves and waits were read back, expected {len(ours)}"
        return [*issues, ProgramIssue("error", "read-back", message, "program")]
    pairs: list[tuple[Move, ReadMove]] = []
    for step, back in zip(ours, theirs, strict=True):
        if isinstance(step, Wait) and isinstance(back, ReadWait):
            if abs(step.time - back.time) > LEAD:
                issues.append(_issue(back, f"waits {back.time:g} s, expected {step.time:g} s"))
        elif isinstance(step, Request | Await) and isinstance(back, ReadHandshake):
            if step != back.what:
                message = f"{handshake_in_words(back.what)}, expected {handshake_in_words(step)}"
                issues.append(_issue(back, message))
        elif not isinstance(back, ReadMove) or _kind(step) != back.kind:
            issues.append(_issue(back, f"is a {_kind_read(back)}, expected a {_kind(step)}"))
        else:
            assert isinstance(step, JointMove | LinearMove)
            pairs.append((step, back))
    rules = language.rules(settings)
    issues += _compare_places(program, pairs, rules)
    issues += _compare_motion(pairs, rules, _Air(program, read))
    issues += _compare_postures(program, pairs, language, settings)
    return issues


def _issue(back: ReadStep, message: str) -> ProgramIssue:
    return ProgramIssue("error", "read-back", f"not as planned: {message}", back.place)


def _kind(step: object) -> str:
    kinds = (
        ("joint", JointMove),
        ("circular", CircularMove),
        ("linear", LinearMove),
        ("wait", Wait),
    )
    return next((word for word, kind in kinds if isinstance(step, kind)), "handshake")


def _kind_read(back: ReadStep) -> str:
    if isinstance(back, ReadMove):
        return back.kind
    return "wait" if isinstance(back, ReadWait) else "handshake"


def handshake_in_words(what: Handshake) -> str:
    """Return a handshake in words."""
    if isinstance(what, Await):
        return f"awaits {what.partner} for {what.timeout:g} s"
    return f"{what.partner} request {'on' if what.on else 'off'}"


def _check_frames(program: Program, read: ReadProgram) -> Iterator[ProgramIssue]:
    for what in ("T_flange_tip", "T_base_part"):
        back = getattr(read, what)
        if back is not None and np.abs(back - getattr(program, what)).max() > FRAME:
            name = "tool" if what == "T_flange_tip" else "part frame"
            message = f"the {name} differs from the planned one"
            yield ProgramIssue("error", "read-back", message, "program")


def _compare_places(
    program: Program, pairs: list[tuple[Move, ReadMove]], rules: Rules
) -> Iterator[ProgramIssue]:
    """Compare the tips of all targets, by joints where the text gives them."""
    point, angle = POINT + rules.point_step, ANGLE + rules.angle_step
    tips = program.tips([m for m, _ in pairs])
    posed = [
        (b, T, b.T_part_tip)
        for (_, b), T in zip(pairs, tips, strict=True)
        if b.T_part_tip is not None
    ]
    posed += [
        (b, m.T_part_via, b.T_part_via)
        for m, b in pairs
        if isinstance(m, CircularMove) and b.T_part_via is not None
    ]
    if posed:
        yield from _compare_poses(
            [b for b, _, _ in posed],
            np.array([ours for _, ours, _ in posed]),
            np.array([theirs for _, _, theirs in posed]),
            point,
            angle,
        )
    jointed = [(m, b) for m, b in pairs if b.q is not None and not _joints_follow(b)]
    if jointed:
        q, q_back = np.array([m.q for m, _ in jointed]), np.array([b.q for _, b in jointed])
        forward = program.robot.forward
        backs = [b for _, b in jointed]
        tool = program.T_flange_tip
        left = q.shape[1] * rules.angle_step
        tips, tips_back = forward(q) @ tool, forward(q_back) @ tool
        yield from _compare_poses(backs, tips, tips_back, point + REACH * left, angle + left)
        arm = program.robot.family.joints
        apart = np.abs(q - q_back)[:, :arm]
        off = apart.max(axis=1)
        for k in np.flatnonzero(off > angle).tolist():
            joint = int(apart[k].argmax()) + 1
            yield _issue(backs[k], f"joint {joint} is {np.degrees(off[k]):.4f} deg off")
    yield from _check_external(program.robot, pairs, point, angle)
    for move, back in pairs:
        if back.q is not None and _joints_follow(back):
            off_by = float(np.abs(move.q - back.q)[: program.robot.family.joints].max())
            if off_by > DERIVED:
                message = f"the configuration leads to joints {np.degrees(off_by):.1f} deg off"
                yield _issue(back, message)
        if back.q is None and back.T_part_tip is None:
            yield _issue(back, "the target is missing")


def _check_external(
    robot: Robot, pairs: list[tuple[Move, ReadMove]], point: float, angle: float
) -> Iterator[ProgramIssue]:
    """Compare the values of external axes at all targets, where a text must give them."""
    arm = robot.family.joints
    for move, back in pairs if robot.externals else ():
        values = back.external_of(robot.externals)
        if values is None:
            yield _issue(back, f"the value of {robot.externals[0].name} is missing")
            continue
        for axis, ours, theirs in zip(robot.externals, move.q[arm:], values, strict=True):
            off = abs(float(ours - theirs))
            if off > (point if axis.kind == "linear" else angle):
                by = (
                    f"{off * 1e3:.4f} mm" if axis.kind == "linear" else f"{np.degrees(off):.4f} deg"
                )
                yield _issue(back, f"{axis.name} is {by} off")


def _joints_follow(back: ReadMove) -> bool:
    """Return whether the joints of a move follow from a pose and its configuration."""
    return back.T_part_tip is not None and back.posture != ()


def _compare_poses(
    backs: list[ReadMove], ours: Array, theirs: Array, point: float, angle: float
) -> Iterator[ProgramIssue]:
    off, turned = distances(ours, theirs)
    for k in np.flatnonzero((off > point) | (turned > angle)).tolist():
        message = f"the tip is {off[k] * 1e3:.4f} mm and {np.degrees(turned[k]):.4f} deg off"
        yield _issue(backs[k], message)


def _compare_motion(
    pairs: list[tuple[Move, ReadMove]], rules: Rules, air: _Air
) -> Iterator[ProgramIssue]:
    for move, back in pairs:
        joint, timed = isinstance(move, JointMove), False
        if isinstance(move, JointMove):
            timed = back.duration is not None
            if message := air.apart(move, back):
                yield _issue(back, message)
        off = SHARE if joint else 0.51 * rules.speed_step + 1e-9
        if back.speed is not None and not timed and abs(move.speed - back.speed) > off:
            unit, scale = ("of the full speed", 1.0) if joint else ("mm/s", 1e3)
            message = f"the speed is {back.speed * scale:g} {unit}, expected {move.speed * scale:g}"
            yield _issue(back, message)
        if (
            isinstance(move, LinearMove)
            and (took := back.duration) is not None
            and abs(move.duration - took) > DURATION
        ):
            yield _issue(back, f"takes {took:g} s, expected {move.duration:g} s")
        if back.zone is None and move.zone == 0:
            yield _issue(back, "the move does not stop, expected a stop")
        if back.zone is not None and abs(move.zone - back.zone) > POINT:
            message = f"the zone is {back.zone * 1e3:g} mm, expected {move.zone * 1e3:g} mm"
            yield _issue(back, message)
        ours: Any = getattr(move, "switches", ())
        same = [(s.signal, s.on) for s in ours] == [(s.signal, s.on) for s in back.switches]
        if not same or any(
            abs(s.lead_time - b.lead_time) > LEAD for s, b in zip(ours, back.switches, strict=True)
        ):
            message = (
                f"switches {switches_in_words(back.switches)}, expected {switches_in_words(ours)}"
            )
            yield _issue(back, message)


class _Air:
    """Times (s) of the joint moves of a program, in all and at constant speed."""

    def __init__(self, program: Program, read: ReadProgram) -> None:
        self._took = dict(zip(read.moves, air_times(program), strict=False))
        self._cruise = cruises(program)

    def apart(self, move: JointMove, back: ReadMove) -> str:
        """Return how the time of a move that was read back differs; empty if it does not."""
        for took, planned in (
            (back.duration, self._took.get(back)),
            (back.cruise, self._cruise.get(move)),
        ):
            if took is not None and planned is not None and abs(took - planned) > LEAD:
                return f"takes {took:g} s, expected {planned:g} s"
        return ""


def switches_in_words(switches: Any) -> str:
    """Return switches in words."""
    words = [f"{s.signal} {'on' if s.on else 'off'} {s.lead_time:g} s ahead" for s in switches]
    return " and ".join(words) or "nothing"


def _compare_postures(
    program: Program,
    pairs: list[tuple[Move, ReadMove]],
    language: Language,
    settings: LanguageSettings,
) -> Iterator[ProgramIssue]:
    worded = [(move, back) for move, back in pairs if back.posture]
    if not worded or language.posture is None:
        return
    expected = language.posture(program.robot, np.array([m.q for m, _ in worded]), settings)
    for (_, back), ours in zip(worded, expected, strict=True):
        if back.posture != ours:
            yield _issue(back, f"the posture is {_words(back.posture)}, expected {_words(ours)}")


def _words(posture: tuple[int | str, ...]) -> str:
    return " ".join(str(code) for code in posture)


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
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
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
