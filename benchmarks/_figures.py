"""Measure and print figures: alternating runs, medians, peak memory, tables, machine facts."""

from __future__ import annotations

import ctypes
import json
import os
import platform
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any, Literal

from rich.console import Console
from rich.markup import escape
from rich.table import Table

__all__ = [
    "Figure",
    "Report",
    "Sheet",
    "available_gigabytes",
    "in_turn",
    "kept_rows",
    "machine",
    "markdown",
    "peak_megabytes",
    "show",
]

PACKAGES = (
    "kerfpath",
    "numpy",
    "numba",
    "scipy",
    "eaik",
    "py-opw-kinematics",
    "ssik",
    "ur-analytic-ik",
    "tesseract-robotics",
    "pymoo",
    "moocore",
    "ompl",
    "clarabel",
    "toppra",
    "distributed",
)
COLUMNS = ("figure", "median", "min", "max", "runs", "unit", "note")


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One row of a table: all runs of one measurement.

    Parameters
    ----------
    what : str
    values : sequence of float
        One number per run; empty if it was not run, and then `note` gives the reason.
    unit : str
    note : str
    """

    what: str
    values: Sequence[float] = ()
    unit: str = "s"
    note: str = ""

    def cells(self) -> tuple[str, ...]:
        """Return the row in words, by `COLUMNS`."""
        if not self.values:
            return (self.what, "-", "-", "-", "0", "", f"not run: {self.note}")
        middle = (median(self.values), min(self.values), max(self.values))
        numbers = [f"{v:.0f}" if v >= 1000 else f"{v:.3g}" for v in middle]
        return (self.what, *numbers, str(len(self.values)), self.unit, self.note)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """A table with its own columns, as text; the first `words` columns hold no numbers."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    words: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """The figures of one benchmark.

    Parameters
    ----------
    title : str
    how : str
        What is measured, and how.
    figures : list of Figure
    sheets : list of Sheet
        Tables that do not fit the columns of figures.
    findings : list of str
        Checks other than times: agreement, errors, ratios.
    """

    title: str
    how: str
    figures: list[Figure] = field(default_factory=list)
    sheets: list[Sheet] = field(default_factory=list)
    findings: list[str] = field(default_factory=list)


def in_turn(
    calls: Mapping[str, Callable[[], object]], runs: int, *, unmeasured: int = 1
) -> dict[str, list[float]]:
    """Return the seconds of each run of each call; every round runs all calls one after another.

    Alternating the calls spreads a busy period of a shared machine over all of them; the first
    rounds, which compile and fill caches, are not measured.
    """
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(unmeasured + runs):
        for name, call in calls.items():
            start = perf_counter()
            call()
            if turn >= unmeasured:
                seconds[name].append(perf_counter() - start)
    return seconds


def kept_rows(
    make: Callable[[int], dict[str, Any]], seeds: Iterable[int], file: Path | None
) -> list[dict[str, Any]]:
    """Return the rows of a benchmark that is run in parts: of a file, then what `make` makes.

    The file has one JSON object a line. Seeds that it has are not made again; the others are added
    to it, each once it is made.
    """
    made = list[dict[str, Any]]()
    if file is not None and file.exists():
        made = [json.loads(line) for line in file.read_text().splitlines()]
    known = {row["seed"] for row in made}
    for seed in seeds:
        if seed not in known:
            made.append(make(seed))
            if file is not None:
                with file.open("a") as rows:
                    print(json.dumps(made[-1]), file=rows)
    return made


def peak_megabytes(call: Callable[[], object]) -> float:
    """Return by how much resident memory peaks above its level before a call, MB.

    Linux only: free pages are returned and the kernel's high-water mark is reset first.
    """
    ctypes.CDLL(None).malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5")
    before = _resident("VmRSS")
    call()
    return (_resident("VmHWM") - before) / 1024


def _resident(name: str) -> int:
    found = re.search(rf"{name}:\s*(\d+) kB", Path("/proc/self/status").read_text())
    assert found is not None
    return int(found[1])


def available_gigabytes() -> float:
    """Return how much memory is free for a new process, GB."""
    found = re.search(r"MemAvailable:\s*(\d+) kB", Path("/proc/meminfo").read_text())
    assert found is not None
    return int(found[1]) * 1024e-9


def machine() -> dict[str, str]:
    """Return the facts about this machine that figures depend on."""
    cpu = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())
    memory = re.search(r"MemTotal:\s*(\d+) kB", Path("/proc/meminfo").read_text())
    facts = {
        "CPU": cpu[1] if cpu else platform.processor(),
        "cores": str(os.cpu_count()),
        "memory": f"{int(memory[1]) / 2**20:.0f} GiB" if memory else "?",
        "system": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "load when started": " ".join(f"{v:.1f}" for v in os.getloadavg()) + " (1, 5, 15 min)",
    }
    for package in PACKAGES:
        try:
            facts[package] = version(package)
        except PackageNotFoundError:
            facts[package] = "not installed"
    return facts


def show(report: Report, console: Console) -> None:
    """Print one report as tables."""
    for i, sheet in enumerate(_sheets(report)):
        table = Table(title=None if i else report.title, title_justify="left")
        for j, column in enumerate(sheet.columns):
            justify: Literal["left", "right"] = "right" if _is_number(sheet, j) else "left"
            table.add_column(column, justify=justify, no_wrap=column != "note")
        for row in sheet.rows:
            table.add_row(*(escape(cell) for cell in row))
        console.print(table)
    for finding in report.findings:
        console.print(f"  - {escape(finding)}")


def _sheets(report: Report) -> list[Sheet]:
    """Return the tables of a report, that of its figures first."""
    rows = [figure.cells() for figure in report.figures]
    return [Sheet(columns=COLUMNS, rows=rows)] * bool(rows) + report.sheets


def _is_number(sheet: Sheet, column: int) -> bool:
    """Return whether a column is aligned to the right."""
    return column >= sheet.words and sheet.columns[column] not in ("unit", "note")


def markdown(
    reports: Sequence[Report], facts: Mapping[str, str], date: str, before: str = ""
) -> str:
    """Return the text of RESULTS.md; sections that this run did not measure are kept."""
    lines = ["# Benchmark results", ""]
    lines += ["Written by `python -m benchmarks --write`; do not edit. The machine and versions of"]
    lines += ["the last run, which made the sections that bear its date:", ""]
    lines += [f"- {name}: {value}" for name, value in facts.items()]
    sections = {text.partition("\n")[0]: text for text in before.split("\n## ")[1:]}
    when = ", ".join(text for text in (date, facts.get("note", "")) if text)
    for report in reports:
        sections[report.title] = "\n".join(_section(report, when))
    return "\n".join(lines) + "".join(f"\n\n## {text.strip()}" for text in sections.values()) + "\n"


def _section(report: Report, when: str) -> Iterator[str]:
    yield from (report.title, "")
    if when:
        yield from (f"*Measured {when}.*", "")
    yield report.how
    for sheet in _sheets(report):
        columns = range(len(sheet.columns))
        rules = ["---:" if _is_number(sheet, j) else "---" for j in columns]
        yield ""
        yield from ("| " + " | ".join(row) + " |" for row in (sheet.columns, rules, *sheet.rows))
    yield from ("", *(f"- {finding}" for finding in report.findings))
