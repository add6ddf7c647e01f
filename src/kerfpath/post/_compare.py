"""Compare a program that was read back with the one that was written."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from kerfpath._arrays import Array
from kerfpath.post._issue import ProgramIssue
from kerfpath.post._languages import Language
from kerfpath.post._orientations import distances
from kerfpath.post._program import (
    Await,
    CircularMove,
    Comment,
    Handshake,
    JointMove,
    LinearMove,
    Move,
    Program,
    Request,
    Wait,
)
from kerfpath.post._read import ReadHandshake, ReadMove, ReadProgram, ReadStep, ReadWait
from kerfpath.post._settings import LanguageSettings, Rules
from kerfpath.post._times import air_times, cruises
from kerfpath.robots import Robot

__all__ = ["deviations", "handshake_in_words", "switches_in_words"]

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
    issues = list(_compare_frames(program, read))
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


def _compare_frames(program: Program, read: ReadProgram) -> Iterator[ProgramIssue]:
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
    yield from _compare_external(program.robot, pairs, point, angle)
    for move, back in pairs:
        if back.q is not None and _joints_follow(back):
            off_by = float(np.abs(move.q - back.q)[: program.robot.family.joints].max())
            if off_by > DERIVED:
                message = f"the configuration leads to joints {np.degrees(off_by):.1f} deg off"
                yield _issue(back, message)
        if back.q is None and back.T_part_tip is None:
            yield _issue(back, "the target is missing")


def _compare_external(
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
