"""Exports: the job, the program in a language, plan, trajectory and report."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from pydantic import ValidationError

from kerfpath.errors import InputError
from kerfpath.job import (
    FileTexts,
    JobResult,
    ProgramTable,
    program_options,
    program_places,
    script_refusal,
)
from kerfpath.post import Line, ProgramIssue, TimedLine, languages
from kerfpath.studio._files import File
from kerfpath.studio._messages import Export, FileEntry, FindingEntry, ProgramTextMessage
from kerfpath.studio._numbers import flat

__all__ = ["WAIT", "exports_of", "in_language", "program_text", "zipped"]


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
