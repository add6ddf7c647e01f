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
SECONDS = 20.0
"""Time for each of 19 readers: those of plans and programs read fewer files in it, but as long."""
FIRST = 10_000_000
"""The first seed; a part begins where another ends."""
HOW = """\
`tests/fuzz.py` spoils small sound files of each reader for the same time, as people, programs,
disks and wires do: bytes, tokens and structure. A process reads one after the other, with 2 GB of
address space beside what it has before, and is killed after a minute. Each is read, or refused in
one line that names it; anything else is a fault: a traceback, a warning, a crash, a hang, several
lines. Times are of the processor; the memory is the resident peak of the process with the most."""
DONE = re.compile(
    r"^(\w+): (\d+) mutants, (\d+) faults of \d+ kinds, slowest ([\d.]+) s, most ([\d.]+) MB, "
    r"(\d+) s"
)


def run(*, quick: bool = False) -> Report:
    """Return the tally of faults by reader."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "tests/fuzz.py", "--first", str(FIRST), "--out", folder]
        made = subprocess.run(
            [*command, "--mutants", str(10**9), "--seconds", str(1.0 if quick else SECONDS)],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            text=True,
            check=False,  # its exit code counts faults
        )
    return report_of(made.stdout)


def report_of(printed: str) -> Report:
    """Return the tally of one or several runs of `tests/fuzz.py`, from what they printed."""
    runs: dict[str, list[list[float]]] = {}
    for line in printed.splitlines():
        if found := DONE.match(line):
            runs.setdefault(found[1], []).append(list(map(float, found.groups()[1:])))
    tallies = {name: list(zip(*of, strict=True)) for name, of in runs.items()}
    rows = [
        (name, f"{sum(files):.0f}", f"{sum(faults):.0f}", f"{max(slowest):.1f}", f"{max(most):.0f}",
         f"{sum(seconds):.0f}")
        for name, (files, faults, slowest, most, seconds) in tallies.items()
    ]  # fmt: skip
    total, faults = (sum(int(row[k]) for row in rows) for k in (1, 2))
    columns = ("reader", "files", "faults", "slowest, s", "most memory, MB", "all, s")
    return Report(
        title="Spoilt files",
        how=HOW,
        sheets=[Sheet(columns=columns, rows=rows)],
        findings=[f"{total} files of {len(rows)} readers: {faults} faults"],
    )
