"""What commands print: tables for people on stdout, or one JSON object; progress on stderr."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from datetime import timedelta
from threading import Event, Thread
from time import monotonic
from typing import Any

from rich.cells import cell_len
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars
from rich.table import Table
from rich.text import Text

from kerfpath.cli._stop import in_order

__all__ = [
    "busy",
    "compile_kernels",
    "errors",
    "out",
    "print_json",
    "progress_bars",
    "quiet",
    "resumable",
    "sweep_bar",
    "table",
    "told_once",
]

_PIPED = 200
"""Columns for output that goes to a file or another program: nothing is cut off there."""

_LEAST_OF_WORDS = 16
"""Columns that a cell of words has at least, or its own length."""
_ROOM_FOR_WORDS = 40
"""Columns for words that are enough: headings are not folded for more."""
_BETWEEN = 2
"""Columns between those of a table."""
LINE_SECONDS = 10.0
"""From line to line of progress where there is no terminal."""

quiet = Event()
"""Set where no progress is to be shown."""

out = Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else _PIPED)
errors = Console(stderr=True, highlight=False, soft_wrap=True)


def print_json(data: dict[str, Any]) -> None:
    """Print one JSON object on stdout."""
    print(json.dumps(data, allow_nan=False))


def table(
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    title: str = "",
    numbers: Collection[str] = (),
    whole: Collection[str] = (),
    spare: Sequence[str] = (),
) -> None:
    """Print a table that can be read at the width there is.

    Columns named in `numbers` stand to the right; these and those in `whole` are never folded. In a
    narrow terminal headings longer than what stands below are folded, then the columns in `spare`
    left out, the first one first, until the others fit, and last of all words are folded.
    """
    fixed = {*numbers, *whole}
    cells = [
        max((cell_len(Text.from_markup(row[i]).plain) for row in rows), default=0)
        for i in range(len(columns))
    ]
    kept, heads, left_out = list(range(len(columns))), list(columns), list[str]()

    def needed(least_of_words: int) -> int:
        """Return the width of what is kept, words folded to so much if they are longer."""
        widths = []
        for i in kept:
            width = cells[i] if columns[i] in fixed else min(cells[i], least_of_words)
            widths.append(max(width, *map(len, heads[i].split("\n"))))
        return sum(widths) + _BETWEEN * (len(kept) - 1)

    if needed(_ROOM_FOR_WORDS) > out.width:
        heads = [
            head.replace(" ", "\n") if len(head) > width else head
            for head, width in zip(columns, cells, strict=True)
        ]
    for name in spare:
        if needed(_LEAST_OF_WORDS) <= out.width:
            break
        kept.remove(columns.index(name))
        left_out.append(name)
    shown = Table(title=title or None, title_justify="left", box=None, pad_edge=False)
    for i in kept:
        right = columns[i] in numbers
        shown.add_column(
            heads[i],
            justify="right" if right else "left",
            no_wrap=columns[i] in fixed,
            overflow="fold",
        )
    for row in rows:
        shown.add_row(*(row[i] for i in kept))
    out.print(shown, soft_wrap=False)
    if left_out:
        out.print(f"no room for: {', '.join(left_out)}; a wider terminal or --json has them")


def told_once(notes: Sequence[str], names: Collection[str] = ()) -> list[str]:
    """Return notes with those that differ by figures and by `names` alone told once, and counted.

    Told is the first of them.
    """
    groups: dict[str, list[str]] = {}
    longest = sorted(names, key=len, reverse=True)
    pattern = "|".join([*map(re.escape, longest), r"\d+(?:\.\d+)?"])
    for note in notes:
        groups.setdefault(re.sub(pattern, "#", note), []).append(note)
    return [
        first + (f" (and {len(more)} more like it; the report has all)" if more else "")
        for first, *more in groups.values()
    ]


class _Lines:
    """Progress where there is no terminal: a line every few seconds on what is being done."""

    def __init__(self, unit: str) -> None:
        self._unit, self._now, self._begun = unit, "", monotonic()
        self._over = Event()
        self._thread = Thread(target=self._tell, daemon=True)

    def __enter__(self) -> Callable[[str, int, int], None]:
        self._thread.start()
        return self._take

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _take(self, what: str, done: int, total: int) -> None:
        of = f", {done} of {total} {self._unit}".rstrip() if total else ""
        self._now = f"{what}{of}"

    def _tell(self) -> None:
        while not self._over.wait(LINE_SECONDS):
            if self._now:
                errors.print(f"kerfpath: {self._now} ({monotonic() - self._begun:.0f} s)")


@contextmanager
def progress_bars(unit: str = "nodes") -> Iterator[Callable[[str, int, int], None]]:
    """Give a function that shows what is done and how far it is.

    A total of 0 is a piece of work without a measure; it is over when the next begins. Where there
    is no terminal, lines are written now and then, unless the command is to be `quiet`.
    """
    if quiet.is_set():
        yield lambda what, done, total: None
        return
    if not errors.is_terminal:
        with _Lines(unit) as take:
            yield take
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[measure]}"),
        TimeElapsedColumn(),
    )
    with Bars(*columns, console=errors, transient=True) as bars:
        tasks: dict[str, Any] = {}
        phase: list[Any] = []

        def advance(what: str, done: int, total: int) -> None:
            while phase:
                bars.remove_task(phase.pop())
            if not total:
                phase.append(bars.add_task(what, total=None, measure=""))
                return
            if what not in tasks:
                tasks[what] = bars.add_task(what, total=total, measure="")
            bars.update(tasks[what], completed=done, total=total, measure=f"{done}/{total} {unit}")

        yield advance


@contextmanager
def sweep_bar(unit: str) -> Iterator[Callable[[int, int, float | None], None]]:
    """Give a function that shows how far a sweep is, and the time left; see `resumable`."""
    if quiet.is_set() or not errors.is_terminal:
        lines = nullcontext() if quiet.is_set() else _Lines(unit)
        with resumable(), lines as take:
            yield lambda done, total, left: take and take(f"{unit} done", done, total)
        return
    left_over = TextColumn("{task.fields[left]}")
    columns = (BarColumn(), MofNCompleteColumn(), TextColumn(unit), left_over)
    with Bars(*columns, console=errors, transient=True) as bars:
        bar = bars.add_task("", total=None, left="")

        def advance(done: int, total: int, left: float | None) -> None:
            told = "" if left is None else f"{timedelta(seconds=round(left))} left"
            bars.update(bar, completed=done, total=total, left=told)

        with resumable():
            yield advance


def resumable() -> AbstractContextManager[None]:
    """Say at Ctrl-C how to go on, and leave with code 130."""
    return in_order("kerfpath: stopped; the same command goes on from the results so far")


@contextmanager
def busy(what: str) -> Iterator[None]:
    """Show that something is being done that has no measure; silent where nobody looks."""
    if errors.is_terminal and not quiet.is_set():
        with errors.status(what):
            yield
    else:
        yield


def compile_kernels() -> None:
    """Compile the kernels if this copy never has, and show it then."""
    from kerfpath.job import is_compiled, warm_up

    if is_compiled():
        return
    if not (quiet.is_set() or errors.is_terminal):
        errors.print("kerfpath: compiling the kernels, first run only")
    with busy("compiling the kernels, first run only"):
        warm_up()
