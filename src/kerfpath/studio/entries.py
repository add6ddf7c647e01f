"""Entries of messages: plans, contours without one, files, the text of a program, the job."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from kerfpath.arrays import Array
from kerfpath.auditor import Check
from kerfpath.comfort import MEASURES
from kerfpath.errors import InputError
from kerfpath.job import (
    CutResult,
    FileTexts,
    Job,
    JobFile,
    JobResult,
    ProgramTable,
    program_options,
    program_places,
    script_refusal,
)
from kerfpath.plans import Plan
from kerfpath.post import Line, ProgramIssue, TimedLine, languages
from kerfpath.studio.document import Document
from kerfpath.studio.messages import (
    CheckEntry,
    ContourName,
    CriteriaEntry,
    EditEntry,
    Export,
    Fault,
    FileEntry,
    FindingEntry,
    JobMessage,
    LossEntry,
    NearestEntry,
    NoPathMessage,
    PlanMessage,
    ProgramTextMessage,
    Relaxation,
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
    if not result.passed:
        program = "a contour has no plan that passes its audit, or a transfer move is missing"
    elif result.job.program.language == "none":
        program = 'the job has language = "none" in [program]; set a language there'
    files = "" if settled else WAIT
    script = script_refusal(result.job, [cut.request for cut in result.cuts])
    return [
        Export(name="job", href="/export/job", ready=True),
        Export(name="program", href="/export/program", ready=not program, why=program),
        Export(name="plan.json", href="/export/plan.json", ready=settled, why=files),
        Export(name="trajectory.csv", href="/export/trajectory.csv", ready=settled, why=files),
        Export(name="script", href="/export/script", ready=not script, why=script),
        Export(name="report", href="/report", ready=settled, why=files),
    ]


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
    options = program_options(asked, job.program.name, job.tolerances)
    options = replace(options, language=language)
    return replace(result, job=replace(result.job, program=options))


def program_text(result: JobResult, texts: FileTexts, revision: int) -> ProgramTextMessage:
    """Return the program files of a result, with the time of each line."""
    faults = list(texts.faults)
    if not texts.program and not faults:
        faults = ["no program: a contour has no plan that passes its audit"]
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
        why = "; ".join(texts.faults) or "a contour has no plan that passes its audit"
        raise InputError(f"no program: {why}")
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
# The messages about a plan, and about the reason why there is none.


def plan_message(
    cut: CutResult,
    made: Plan,
    *,
    revision: int,
    graph: str,
    pieces: int,
    settled: bool,
    audited: bool,
    seconds: float,
) -> PlanMessage:
    """Return the message about the motion of a cut.

    Parameters
    ----------
    cut : CutResult
    made : Plan
        Plan of the cut.
    revision : int
        Revision of the job that it was planned for.
    graph : str
        Id of its map.
    pieces : int
        Number of plans of its contour.
    settled : bool
        False while its bound is still to be computed.
    audited : bool
        Whether the audit of the cut is complete.
    seconds : float
        Time that the search took, s.
    """
    velocity, acceleration = made.velocity_share, made.acceleration_share
    s, proof = made.contour.s, made.proof
    first = float(cut.request.candidates[0].nodes.s[0])
    return PlanMessage(
        revision=revision,
        contour=cut.contour,
        name=made.name,
        pieces=pieces,
        graph=graph,
        s=flat(s - first),
        time=flat(made.time),
        q=flat(made.unwrapped),
        gamma=flat(made.gamma),
        posture=made.posture.tolist(),
        points=flat(made.points),
        kind=list(made.contour.kinds),
        speed=flat(np.diff(s) / np.diff(made.time)),
        cost=made.cost,
        bound=proof.bound,
        gap=proof.gap,
        settled=settled,
        optimal=proof.optimal,
        statement=proof.statement,
        method=made.settings.method,
        weights=flat(np.asarray(made.settings.weights)),
        previous_cost=None,
        criteria=_criteria(made),
        velocity_share=flat(velocity, 6),
        acceleration_share=flat(acceleration, 6),
        joint_load=flat(_load(velocity, acceleration), 6),
        checks=check_entries((*cut.checks, *cut.as_run.checks)) if audited else None,
        passed=cut.passed if audited else None,
        feed=None if made.feed is None else str(made.feed),
        seconds=seconds,
    )


def _load(velocity: Array, acceleration: Array) -> Array:
    """Return the largest share of any joint's limits at each node, (K,).

    Parameters
    ----------
    velocity : (K-1, n)
        Shares between nodes; a node takes the larger one of its two intervals.
    acceleration : (K-2, n)
        Shares at the inner nodes.
    """
    between = np.abs(velocity).max(axis=1)
    load = np.maximum(np.append(between, 0.0), np.append(0.0, between))
    load[1:-1] = np.maximum(load[1:-1], np.abs(acceleration).max(axis=1, initial=0.0))
    return np.asarray(load)


def _criteria(made: Plan) -> CriteriaEntry:
    found = made.criteria
    return CriteriaEntry(
        displacement=flat(found.displacement),
        largest_increment=flat(found.largest_increment),
        range=flat(found.range),
        peak_velocity=flat(found.peak_velocity),
        peak_acceleration=flat(found.peak_acceleration),
        nearest=[
            NearestEntry(name=name, value=value, unit=MEASURES[name].unit, node=node)
            for name, (value, node) in found.nearest.items()
        ],
    )


def check_entries(checks: Sequence[Check]) -> list[CheckEntry]:
    """Return the entries of an audit's checks."""
    return [
        CheckEntry(
            code=check.code,
            title=check.title,
            value=check.value if np.isfinite(check.value) else None,
            limit=check.limit if np.isfinite(check.limit) else None,
            unit=check.unit,
            level=check.level,
            ok=check.ok,
            node=check.node,
        )
        for check in checks
    ]


def no_path_message(
    cut: CutResult,
    placement: Array,
    *,
    revision: int,
    graph: str,
    relaxations: list[Relaxation] | None,
) -> NoPathMessage:
    """Return the message about the reason why a cut has no plan.

    Parameters
    ----------
    cut : CutResult
        A cut without a plan.
    placement : (4, 4) m
        T_base_part.
    revision : int
        Revision of the job.
    graph : str
        Id of its map.
    relaxations : list of Relaxation or None
        Changes that would make a path; None while they are being searched for.
    """
    broken, nodes = cut.broken, cut.candidate.nodes
    assert broken is not None
    at = min(max(broken.node, 0), len(nodes) - 1)
    return NoPathMessage(
        revision=revision,
        contour=cut.contour,
        node=broken.node,
        back=broken.back,
        s=float(nodes.s[at] - nodes.s[0]),
        point=flat(placement[:3, :3] @ nodes.points[at] + placement[:3, 3]),
        statement=str(broken),
        scope=broken.scope,
        reasons=[LossEntry(name=str(why), count=count) for why, count in broken.counts.items()],
        graph=graph,
        relaxations=relaxations,
        remedy=cut.remedy,
    )


# -----------------------------------------------------------------------------
# Changes that may make a path where there is none, as edits of the job.


def alternatives(cut: CutResult, index: int) -> list[Relaxation]:
    """Return possible changes for a cut without a plan, first those that gave one.

    Parameters
    ----------
    cut : CutResult
        A cut without a plan, with its advice.
    index : int
        Index of its [[contour]] table in the job.
    """
    found, advice = list[Relaxation](), cut.advice
    if advice is not None:
        if advice.without_windows:
            pins = EditEntry(path=["contour", index, "gamma_windows"], value=None)
            found.append(Relaxation(label="remove the pinned windows of gamma", edits=[pins]))
        if advice.other_method:
            found.append(_plan('search the grid exactly: method = "exact"', "method", "exact"))
        for speed in (advice.refined, advice.speed):
            if speed is not None:
                found.append(
                    Relaxation(
                        label=f"cut slower: {speed} m/min instead of "
                        f"{cut.request.task.speed * 60:g} m/min",
                        edits=[
                            EditEntry(path=["contour", index, "speed_m_min"], value=float(speed))
                        ],
                    )
                )
        for key, value in advice.shares.items():
            which = "velocity" if key == "eta_velocity" else "acceleration"
            words = f"use more of the {which} limits: {key} = {value}"
            found.append(_plan(words, key, float(value)))
    return found + _untried(cut)


def _untried(cut: CutResult) -> list[Relaxation]:
    """Return changes that have not been tried and that the other options allow."""
    found, options = list[Relaxation](), cut.request.options
    plain = options.closure == "free" and options.rotation is None and options.objective == "sum"
    grid = options.method in ("continuous", "exact")
    if plain and grid and options.feed == "constant" and options.interruptions == "none":
        found.append(_plan('not tried: slow down where needed: feed = "dip"', "feed", "dip"))
        words = 'not tried: cut in the fewest pieces: interruptions = "fewest"'
        found.append(_plan(words, "interruptions", "fewest"))
    if options.postures is not None:
        found.append(_plan("not tried: allow every posture", "posture", None))
    return found


def _plan(label: str, key: str, value: object) -> Relaxation:
    return Relaxation(label=label, edits=[EditEntry(path=["plan", key], value=value)])


# -----------------------------------------------------------------------------
# The message about the job: its text, values with defaults, and errors.

_PLACE = re.compile(r"^.*?\.toml:(?:(\d+):)? ?(?:([a-z_][\w.]*): )?(.*)$", re.DOTALL)
"""File, line, key and text of an error message about a job."""
_TABLE = re.compile(r"^[ \t]*\[\[[ \t]*contour[ \t]*\]\]")


def job_message(
    document: Document,
    job: Job | None,
    contours: list[ContourName],
    faults: list[Fault],
    *,
    interval: float,
) -> JobMessage:
    """Return the message about the current job.

    Parameters
    ----------
    document : Document
    job : Job or None
        The job that the text describes; None if the text is not valid.
    contours : list of ContourName
        The contours that are cut.
    faults : list of Fault
    interval : float s
        Interval of the nodes of the first contour; the default weights depend on it.
    """
    weights = None
    if job is not None:
        weights = 1 / (job.robot.speed_limits()[0] * interval)
    return JobMessage(
        revision=document.revision,
        name=document.path.name,
        text=document.text,
        values=None if job is None else job_file(job).model_dump(mode="json"),
        given=[] if job is None else list(_given(job.source)),
        contours=contours,
        undo=document.can_undo,
        redo=document.can_redo,
        saved=document.saved,
        faults=faults,
        weights=[] if weights is None else flat(weights),
    )


def faults_of(error: InputError, text: str) -> list[Fault]:
    """Return the errors of a job, each with the key that its message names, if any."""
    lines = text.split("\n")
    return [_fault(said, lines) for said in (str(error), *error.others)]


def _fault(said: str, lines: list[str]) -> Fault:
    found = _PLACE.match(said)
    if found is None:
        return Fault(key=[], message=said)
    line, key, words = found.groups()
    way: list[str | int] = [] if key is None else list(key.split("."))
    if line is not None and way[:1] == ["contour"]:
        number = sum(map(bool, map(_TABLE.match, lines[: int(line)]))) - 1
        way[1:1] = [max(number, 0)]
    return Fault(key=way, message=words)


def job_file(job: Job) -> JobFile:
    """Return the tables of a job, with all defaults."""
    return JobFile.model_validate(dict(job.source), context={"folder": job.path.parent})


def _given(value: object, way: str = "") -> Iterator[str]:
    """Yield the dotted keys of a job, each table before its entries."""
    if way:
        yield way
    entries = list[tuple[object, object]]()
    if isinstance(value, Mapping):
        entries = list(value.items())
    elif isinstance(value, list) and all(isinstance(one, Mapping) for one in value):
        entries = list(enumerate(value))
    for name, inner in entries:
        yield from _given(inner, f"{way}.{name}" if way else str(name))
