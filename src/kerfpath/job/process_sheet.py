"""Check the process sheet at the head of a program, which says what the operator sets."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from kerfpath.auditor import Check
from kerfpath.job.audit_report import count
from kerfpath.job.format import TITLE

MISSING = (
    "The program has no process sheet: kerfpath charts show --job JOB.toml shows what to set by "
    "hand."
)
"""The note on a program without one."""
BESIDE = {".pjx": "start.pgx"}
"""File with the sheet, by the suffix of the main file, where that has none."""
_REMARK = re.compile(r"[\s\d:;'!#/|]*([-+] .*?)[\s;]*")


def check_sheet(file: Path, expected: Sequence[str]) -> tuple[list[Check], str]:
    """Return the check that a program has the sheet of its job, and a note if it has none.

    The node of the check is the line of the file at which the sheet begins.

    Comments may be removed, but a sheet that differs would have the operator set other values.

    Parameters
    ----------
    file : Path
        The main file of the program.
    expected : sequence of str
        The lines of the sheet of the job; empty without [process].
    """
    found, begins = _sheet(with_sheet(file))
    if not found:
        return [], MISSING if expected else ""
    wanted = [_bare(line) for line in expected]
    wrong = [line for line in found if line not in wanted]
    lacking = [line for line in wanted if line not in found]
    faults = len(wrong) + len(lacking) or int(found != wanted)
    example = (wrong or lacking or [""])[0]
    said = "lines of the process sheet that differ from the job" + (f": {example}" * bool(faults))
    return [count("sheet", said, faults, begins)], ""


def with_sheet(file: Path) -> Path:
    """Return the file of a program that has its sheet."""
    return file.with_name(BESIDE.get(file.suffix.lower(), file.name))


def _sheet(file: Path) -> tuple[list[str], int]:
    """Return the lines of the sheet in a file, as far as every language writes them alike.

    Also the number of the first of them, from 1.
    """
    try:
        lines = file.read_bytes().decode("latin-1").splitlines()
    except OSError:
        return [], 0
    found: list[str] = []
    begins = 0
    for number, line in enumerate(lines, 1):
        remark = _REMARK.fullmatch(line)
        bare = "" if remark is None else _bare(remark[1])
        if found and not bare:
            break
        if found or bare == _bare(f"- {TITLE}"):
            found.append(bare)
            begins = begins or number
    return found, begins


def _bare(line: str) -> str:
    """Return a line without the characters that languages change in remarks."""
    return re.sub(r"[;,\]>\s]+", " ", line).strip()
