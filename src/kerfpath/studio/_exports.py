"""What can be taken along: the job, the program in a language, plan, trajectory and report."""

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


WAIT = "what is proved of the plans is still to come"


def exports_of(result: JobResult, *, settled: bool) -> list[Export]:
    """Return what can be taken along of a result, and why the rest cannot.

    Parameters
    ----------
    result : JobResult
    settled : bool
        Whether nothing more is to be proved of its plans.
    """
    program = ""
    if not result.passed:
        program = "a contour has no plan that passes its audit, or no way leads to the next one"
    elif result.job.program.language == "none":
        program = 'the job asks for none: language = "none" in [program]; ask for one by name'
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
    """Return a result whose job asks for a program in another language; None: in its own.

    Raises
    ------
    InputError
        An unknown language, settings that do not fit it.
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
    # The name is the job's, whatever the copy of it is called that was read.
    job = result.job
    options = program_options(asked, job.program.name, job.tolerances)
    options = replace(options, language=language)
    return replace(result, job=replace(result.job, program=options))


def program_text(result: JobResult, texts: FileTexts, revision: int) -> ProgramTextMessage:
    """Return the program of a result as its files say it, and what each line does when."""
    faults = list(texts.faults)
    if not texts.program and not faults:
        faults = ["there is no program: a contour has no plan that passes its audit"]
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
    """Return the program as one file: as it is, or several in an archive.

    Raises
    ------
    InputError
        There is none.
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
            # The same program is the same archive: it has no time of its own.
            archive.writestr(zipfile.ZipInfo(each), texts.files[each])
    return File(f"{name}.zip", "application/zip", packed.getvalue())
