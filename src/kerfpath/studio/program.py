"""The program of a job: its clock, its text, and the files that can be exported."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any, Literal, NamedTuple, TypedDict

import numpy as np
from numpy.typing import ArrayLike
from pydantic import ValidationError

from kerfpath.arrays import Array
from kerfpath.errors import InputError
from kerfpath.job import (
    CutResult,
    FileTexts,
    JobResult,
    ProgramTable,
    program_places,
    script_refusal,
)
from kerfpath.plans import Plan
from kerfpath.post import (
    JointMove,
    Line,
    LinearMove,
    Program,
    ProgramIssue,
    TimedLine,
    Wait,
    build_program,
    languages,
    timetable,
)
from kerfpath.robots import Robot
from kerfpath.studio.messages import (
    Cycle,
    EditEntry,
    Export,
    FileEntry,
    FindingEntry,
    ProgramMessage,
    ProgramTextMessage,
    Segment,
    flat,
)

# -----------------------------------------------------------------------------
# Files for download.


class File(NamedTuple):
    """A file for download: its name, media type and content."""

    name: str
    kind: str
    content: bytes


# -----------------------------------------------------------------------------
# Exports: the job, the program in a language, plan, trajectory and report.

WAIT = "the bounds of the plans are still being computed"


def exports_of(result: JobResult, *, settled: bool) -> list[Export]:
    """Return the exports of a result, with the reason why one is not available.

    Parameters
    ----------
    result : JobResult
    settled : bool
        False while bounds of its plans are still to be computed.
    """
    program = ""
    if not result.may_be_written:
        program = _why_none(result)
    elif result.job.program.language == "none":
        program = 'the job has language = "none" in [program]; set a language there'
    files = "" if settled else WAIT
    script = script_refusal(result.job, [cut.request for cut in result.cuts])
    partial = ""
    if result.missing or result.job.switched_off:
        partial = f", of {', '.join(dict.fromkeys(cut.contour for cut in result.cuts if cut.plan))}"
    made = [
        Export(name=name, about=about, href=href, ready=not why, why=why)
        for name, about, href, why in (
            ("job", "the job file with its comments", "/export/job", ""),
            ("program", f"in the language of the job{partial}", "/export/program", program),
            ("plan.json", "", "/export/plan.json", files),
            ("trajectory.csv", "one row for each node", "/export/trajectory.csv", files),
            (
                "script",
                "in Python: the same plans from the public functions",
                "/export/script",
                script,
            ),
            ("report", "on a separate page", "/report", files),
        )
    ]
    if not result.may_be_written:
        made[1] = made[1].model_copy(update=_without_the_rest(result))
    return made


def _why_none(result: JobResult) -> str:
    """Return why a result has no program."""
    reasons = []
    if result.missing:
        reasons.append(f"no path for {', '.join(result.missing)}")
    if failed := _failed(result):
        reasons.append(f"the audit failed for {', '.join(failed)}")
    return "; ".join(reasons) or "a transfer move is missing or fails its audit"


def _failed(result: JobResult) -> list[str]:
    """Return the contours whose plans fail their audit."""
    failed = (cut.contour for cut in result.cuts if cut.plan is not None and not cut.passed)
    return list(dict.fromkeys(failed))


def _without_the_rest(result: JobResult) -> dict[str, object]:
    """Return the changes that make a program of the contours that may be cut, if there are any."""
    missing, failed = dict.fromkeys(result.missing), _failed(result)
    if not {cut.contour for cut in result.cuts} - {*missing, *failed}:
        return {}
    edits = []
    if missing and not result.job.accepts_incomplete:
        edits.append(EditEntry(path=["program", "incomplete"], value="accept"))
    if failed:
        off = [*result.job.switched_off, *failed]
        edits.append(EditEntry(path=["part", "switched_off"], value=off))
    return {"remedy": f"Without {', '.join([*missing, *failed])}", "edits": edits} if edits else {}


def in_language(result: JobResult, language: str | None) -> JobResult:
    """Return the result with another language for its program; None keeps the job's own.

    Raises
    ------
    InputError
        The language is unknown, or the settings of [program] do not fit it.
    """
    if language is None:
        return result
    if language not in languages():
        raise InputError(
            f"language {language!r:.40} is not known; expected {', '.join(sorted(languages()))}"
        )
    table: Mapping[str, Any] = {**result.job.source.get("program", {}), "language": language}
    try:
        asked = ProgramTable.model_validate(table)
    except ValidationError as error:
        said = error.errors(include_url=False)[0]["msg"]
        raise InputError(f"program in {language}: {said}; correct [program]") from None
    # Keep the name of the job: the file that was read may be a copy with another name.
    job = result.job
    own = job.program.contours
    options = asked.resolve(job.program.name, job.tolerances.path, contours=own)
    return replace(result, job=replace(result.job, program=options))


def program_text(result: JobResult, texts: FileTexts, revision: int) -> ProgramTextMessage:
    """Return the program files of a result, with the time of each line."""
    faults = list(texts.faults)
    if not texts.program and not faults:
        faults = [f"no program: {_why_none(result)}"]
    places = program_places(result, {name: texts.files[name] for name in texts.program})
    said = {str(issue) for issue, _ in places.findings}
    return ProgramTextMessage(
        language=result.job.program.language,
        revision=revision,
        files=[_file(name, texts.files[name], places.lines) for name in texts.program],
        findings=[_finding(*found) for found in places.findings],
        notes=[note for note in texts.notes if note not in said],
        faults=faults,
    )


def _file(name: str, text: str, lines: Sequence[TimedLine]) -> FileEntry:
    mine = [each for each in lines if each.line.file == name]
    return FileEntry(
        name=name,
        text=text,
        lines=[each.line.number for each in mine],
        begin=flat([each.begin for each in mine], 6),
        end=flat([each.end for each in mine], 6),
    )


def _finding(issue: ProgramIssue, line: Line | None) -> FindingEntry:
    return FindingEntry(
        level=issue.level,
        message=issue.message,
        place=issue.place,
        file=None if line is None else line.file,
        line=None if line is None else line.number,
    )


def zipped(name: str, texts: FileTexts) -> File:
    """Return the program as one file, or as an archive if it has several files.

    Raises
    ------
    InputError
        There is no program.
    """
    if not texts.program:
        raise InputError("; ".join(texts.faults) or 'no program: the job has language = "none"')
    if len(texts.program) == 1:
        (only,) = texts.program
        return File(only.rsplit("/", 1)[-1], "text/plain", texts.files[only].encode())
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for each in texts.program:
            # ZipInfo has a fixed time, so that the same program gives the same archive.
            archive.writestr(zipfile.ZipInfo(each), texts.files[each])
    return File(f"{name}.zip", "application/zip", packed.getvalue())


# -----------------------------------------------------------------------------
# The clock of a program: its segments with their times, from the first target to the last.

Kind = Literal["move", "approach", "pierce", "retract"]
Timed = JointMove | LinearMove | Wait
"""Steps that have a time in the timetable."""
RAMP = 9
"""Number of points that show the acceleration of a joint move."""
STRAIGHT = 9
"""Number of points that show a straight move along the tool axis; joint speeds hardly vary."""
UNPLANNED = (
    "The job has no [sequence]: the transfer moves are straight joint motions, which have not been "
    "checked for collisions."
)
NO_CELL = "The job has no [cell]: the transfer moves have not been checked for collisions."


class _Whose(TypedDict):
    """The contour that a stretch of a program belongs to."""

    contour: str


def program_message(result: JobResult, revision: int) -> ProgramMessage:
    """Return the segments of a result's program in its order, or the reason why there is none.

    Times are those that programs contain, in languages with times: cuts take the planned time,
    joint moves the least time that the limits and air_speed allow.

    Parameters
    ----------
    result : JobResult
    revision : int
        Revision of the job.
    """
    why = ""
    if result.missing and not result.may_be_written:
        why = f"There is no program: {_why_none(result)}."
    elif result.stuck is not None:
        why = f"There is no program: {result.stuck}."
    if not why:
        try:
            return _clock(result, revision)
        except InputError as refused:
            why = f"There is no program: {refused}."
    return ProgramMessage(revision=revision, total=0.0, segments=[], checked=False, notes=[why])


def cycle_of(message: ProgramMessage) -> Cycle | None:
    """Return the shares of a program's time; None without a program."""
    if not message.segments:
        return None
    spent = {"cut": 0.0, "pierce": 0.0}
    for segment in message.segments:
        if segment.kind in spent:
            spent[segment.kind] += segment.end - segment.begin
    cutting, piercing = spent["cut"], spent["pierce"]
    air = message.total - cutting - piercing
    return Cycle(cutting=cutting, air=air, piercing=piercing, total=message.total)


def _clock(result: JobResult, revision: int) -> ProgramMessage:
    # Arcs and merged moves pass the same points at the same times: show the nodes of the plans.
    options = replace(result.job.program, arc_tolerance=None, thin_tolerance=0.0)
    program = build_program(result.programmed, options, moves=result.moves)
    segments = list(_segments(program, [cut for cut in result.cuts if cut.plan is not None]))
    notes = []
    if result.part is None:
        notes.append(UNPLANNED)
    elif not program.air_checked:
        notes.append(NO_CELL)
    return ProgramMessage(
        revision=revision,
        total=segments[-1].end,
        segments=segments,
        checked=program.air_checked,
        notes=notes,
    )


def _segments(program: Program, cuts: Sequence[CutResult]) -> Iterator[Segment]:
    """Yield the segments of a program, which has one section for each cut."""
    robot, clock = program.robot, iter(timetable(program))
    here, begin = program.moves[0].q, 0.0
    for section, cut in zip(program.sections, cuts, strict=True):
        made = cut.plan
        assert made is not None
        whose: _Whose = {"contour": cut.contour}
        straight = [step for step in section.steps if isinstance(step, LinearMove)]
        into, out = straight[0], straight[-1]
        # All moves of the path form one segment; its plan has all of the nodes.
        for step, end in islice(clock, sum(isinstance(s, Timed) for s in section.steps)):
            if isinstance(step, Wait):
                rest = _stretch("pierce", begin, end, [0.0, end - begin], [here, here])
                yield rest.model_copy(update=whose)
            elif isinstance(step, JointMove):
                if end > begin:
                    yield _stretch(
                        "move", begin, end, *_from_stop_to_stop(robot, here, step.q, end - begin)
                    )
                here = step.q
            elif step is into or step is out:
                kind: Literal["approach", "retract"] = "approach" if step is into else "retract"
                q = _straight(made, here, step.q, 0 if step is into else -1)
                time = np.linspace(0.0, end - begin, len(q))
                yield _stretch(kind, begin, end, time, q).model_copy(update=whose)
                here = step.q
            else:
                here = step.q
                if step is not straight[-2]:
                    continue  # the segment ends at the end of the path
                yield Segment(kind="cut", begin=begin, end=end, plan=made.name, **whose)
            begin = end


def _stretch(kind: Kind, begin: float, end: float, time: ArrayLike, q: ArrayLike) -> Segment:
    return Segment(kind=kind, begin=begin, end=end, time=flat(time), q=flat(q))


def _from_stop_to_stop(robot: Robot, one: Array, two: Array, took: float) -> tuple[Array, Array]:
    """Return times (m,) s and joints (m, n) of a joint move: accelerate, hold speed, decelerate.

    The slowest joint accelerates at its limit, and the others follow in proportion.
    """
    way = np.abs(two - one)
    gain = float((way / robot.speed_limits()[1]).max())
    # Duration at the held speed alone; half of `took` if the move only accelerates and brakes.
    even = (took + np.sqrt(max(took**2 - 4 * gain, 0.0))) / 2
    gaining = min(gain / even, took / 2)
    ramp = np.linspace(0.0, gaining, RAMP)
    half = np.array([*ramp, took / 2])
    covered = np.array([*(ramp**2 / (2 * gaining * even)), 0.5])
    time = np.concatenate([half, took - half[-2::-1]])
    share = np.concatenate([covered, 1 - covered[-2::-1]])
    return time, one + share[:, None] * (two - one)


def _straight(made: Plan, one: Array, two: Array, end: int) -> Array:
    """Return joints (m, n) of a straight tip motion between two joint vectors, at a plan's end."""
    guess = one + np.linspace(0.0, 1.0, STRAIGHT)[:, None] * (two - one)
    arm, n = made.robot.arm, made.robot.arm.joints  # external axes are at rest
    T = arm.forward(np.array([one, two])[:, :n])
    poses = np.repeat(T[:1], STRAIGHT, axis=0)
    poses[:, :3, 3] = np.linspace(T[0, :3, 3], T[1, :3, 3], STRAIGHT)
    posture = np.full(STRAIGHT, made.posture[end])
    return np.column_stack([arm.follow(poses, guess[:, :n], posture), guess[:, n:]])
