"""Spoilt files of every reader by the thousand: what is neither read nor refused in one line."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks._figures import Report, Sheet

__all__ = ["run"]

ROOT = Path(__file__).parent.parent
MUTANTS = 6000
"""Files of each of 18 readers, 108 000 in all."""
FIRST = 10_000_000
"""The first seed; a part begins where another ends."""
HOW = """\
`tests/fuzz.py` spoils {mutants} small sound files of each reader as people, programs, disks and
wires do: bytes, tokens and structure. A process reads one after the other, with 2 GB of address
space beside what it has before, and is killed after a minute. Each is read, or refused in one line
that names it; anything else is a fault: a traceback, a warning, a crash, a hang, several lines.
Times are of the processor; the memory is the resident peak of the process with the most."""
DONE = re.compile(
    r"^(\w+): (\d+) mutants, (\d+) faults of \d+ kinds, slowest ([\d.]+) s, most ([\d.]+) MB, "
    r"(\d+) s"
)


def run(*, quick: bool = False) -> Report:
    """Return the tally of faults by reader."""
    mutants = 60 if quick else MUTANTS
    rows, faults, total = list[tuple[str, ...]](), 0, 0
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "tests/fuzz.py", "--first", str(FIRST), "--out", folder]
        made = subprocess.run(
            [*command, "--mutants", str(mutants)],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            text=True,
            check=False,  # its exit code counts faults
        )
    for line in made.stdout.splitlines():
        if found := DONE.match(line):
            rows.append(found.groups())
            total, faults = total + int(found[2]), faults + int(found[3])
    columns = ("reader", "files", "faults", "slowest, s", "most memory, MB", "all, s")
    return Report(
        title="Spoilt files",
        how=HOW.format(mutants=mutants),
        sheets=[Sheet(columns=columns, rows=rows)],
        findings=[f"{total} files of {len(rows)} readers: {faults} faults"],
    )
