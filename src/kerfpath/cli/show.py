"""Output of commands: tables for people or one JSON object on stdout, progress on stderr.

A command prints both: with --json `out` is silent, without it `print_json` is.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from threading import Event, Thread
from time import monotonic

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, JustifyMethod, RenderableType
from rich.markup import escape
from rich.progress import BarColumn, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bars
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from kerfpath.cli.surroundings import stop_in_order
from kerfpath.errors import InputError, printable
from kerfpath.files import require_writable, write_whole
from kerfpath.progress import Progress, no_progress

_PIPED = 200
"""Width in characters of output to a file or another program, where nothing is cut off."""

_LEAST_OF_WORDS = 16
"""Least width of a column of words in characters, unless its words are shorter."""
_ROOM_FOR_WORDS = 40
"""Width in characters that is enough for words; headings are not folded to gain more."""
_MANY = 1000
"""Rows from which on nothing is folded: rich takes about half a millisecond for each cell."""
_MARKUP = re.compile(r"[\[\\:]")
"""A character of markup, or of the name of a symbol."""
_BETWEEN = 2
"""Characters between two columns of a table."""
LINE_SECONDS = 10.0
"""Time between two lines of progress without a terminal, s."""
DAY = 86400.0
"""Seconds over which the speed of a bar is averaged: tasks may take minutes each."""

quiet = Event()
"""Set if no progress is to be shown."""


class _Lines(Console):
    """A console that prints escapes for characters in names that do not print.

    Otherwise a name from a file, or of one, could change the terminal or the direction of writing.
    """

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        for segment in super().render(renderable, options):
            if segment.control or segment.text.isprintable():
                yield segment
            else:
                yield Segment(printable(segment.text, keep="\n"), segment.style)


out = _Lines(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else _PIPED)
errors = _Lines(stderr=True, highlight=False, soft_wrap=True)


def print_json(data: Mapping[str, object]) -> None:
    """Print the result of a command as one JSON object on stdout, if --json asks for it."""
    if out.quiet:
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
    """Print a table that fits the terminal.

    Columns in `numbers` are aligned right; these and those in `whole` are never folded. In a narrow
    terminal headings longer than their column are folded first, then columns in `spare` are left
    out, in that order, until the others fit, and last of all words are folded; in tables of
    `_MANY` rows they are not.
    """
    rows = [[printable(cell) for cell in row] for row in rows]  # as wide as they are printed
    fixed = {*numbers, *whole}
    cells = [
        max((cell_len(_plain(row[i])) for row in rows), default=0) for i in range(len(columns))
    ]
    kept, heads, left_out = list(range(len(columns))), list(columns), list[str]()

    def width_with(least_of_words: int) -> int:
        """Return the width of the kept columns, words folded to `least_of_words` characters."""
        widths = []
        for i in kept:
            width = cells[i] if columns[i] in fixed else min(cells[i], least_of_words)
            widths.append(max(width, *map(len, heads[i].split("\n"))))
        return sum(widths) + _BETWEEN * (len(kept) - 1)

    if width_with(_ROOM_FOR_WORDS) > out.width:
        heads = [
            head.replace(" ", "\n") if len(head) > width else head
            for head, width in zip(columns, cells, strict=True)
        ]
    for name in spare:
        if width_with(_LEAST_OF_WORDS) <= out.width:
            break
        kept.remove(columns.index(name))
        left_out.append(name)
    heads, right = [heads[i] for i in kept], [columns[i] in numbers for i in kept]
    rows = [[row[i] for i in kept] for row in rows]
    if len(rows) >= _MANY:
        _print_lines(title, heads, rows, right)
    else:
        shown = Table(title=title or None, title_justify="left", box=None, pad_edge=False)
        for i, head, is_right in zip(kept, heads, right, strict=True):
            justify: JustifyMethod = "right" if is_right else "left"
            no_wrap = columns[i] in fixed
            shown.add_column(head, justify=justify, no_wrap=no_wrap, overflow="fold")
        for row in rows:
            shown.add_row(*row)
        out.print(shown, soft_wrap=False)
    if left_out:
        out.print(f"no room for: {', '.join(left_out)}; a wider terminal or --json shows them")


def _print_lines(
    title: str, heads: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[bool]
) -> None:
    """Print a table without folding; columns that are `right` are aligned so."""
    every = [[head.replace("\n", " ") for head in heads], *([_plain(c) for c in r] for r in rows)]
    widths = [max(map(cell_len, column)) for column in zip(*every, strict=True)]
    lines = [title] if title else []
    for row in every:
        blank = [" " * (width - cell_len(cell)) for cell, width in zip(row, widths, strict=True)]
        padded = (
            space + cell if at_right else cell + space
            for cell, space, at_right in zip(row, blank, right, strict=True)
        )  # fmt: skip
        lines.append((" " * _BETWEEN).join(padded).rstrip())
    out.print(Text("\n".join(lines)))


def _plain(cell: str) -> str:
    """Return the text of a cell without its markup."""
    return Text.from_markup(cell).plain if _MARKUP.search(cell) else cell


def merge_notes(notes: Sequence[str], names: Collection[str] = ()) -> list[str]:
    """Return the notes; those that differ only in figures and `names` are one, with a count."""
    groups: dict[str, list[str]] = {}
    longest = sorted(names, key=len, reverse=True)
    pattern = "|".join([*map(re.escape, longest), r"-?\d+(?:\.\d+)?"])
    for note in notes:
        groups.setdefault(re.sub(pattern, "#", note), []).append(note)
    return [
        first + (f" (and {len(more)} more like it; the report has all)" if more else "")
        for first, *more in groups.values()
    ]


def show_files(written: Iterable[Path], removed: Iterable[Path] = (), *, of: str = "") -> None:
    """Print the files that were removed, with what they belonged to, and the written ones."""
    for path in removed:
        out.print(f"removed {escape(str(path))}, of {of}")
    for path in written:
        out.print(f"wrote {escape(str(path))}")


def require_output(path: Path, option: str) -> None:
    """Require that the file that an option of the command names can be written.

    Raises
    ------
    InputError
        It cannot; the message names the option.
    """
    try:
        require_writable(path)
    except OSError as error:
        raise InputError(
            f"{path}: cannot write ({error.strerror}); choose another {option}"
        ) from None


def write_text(path: Path, text: str, option: str) -> None:
    """Write the file that an option of the command names, and print that.

    Raises
    ------
    InputError
        The file cannot be written; the message names the option.
    """
    try:
        write_whole({path: text.encode()})
    except OSError as error:
        raise InputError(
            f"{path}: cannot write ({error.strerror}); choose another {option}"
        ) from None
    show_files([path])


@contextmanager
def progress_lines(unit: str) -> Iterator[Progress]:
    """Give a `Progress` that prints a line every few seconds, for output without a terminal."""
    state, expected_end, begun, over = "", 0.0, monotonic(), Event()
    first: tuple[str, int, float] = "", 0, 0.0

    def take(what: str, done: int, total: int) -> None:
        nonlocal state, expected_end, first
        now = monotonic()
        if what != first[0]:
            first = what, done, now
        state = what + (f", {done} of {total} {unit}".rstrip() if total else "")
        rate = (now - first[2]) / (done - first[1]) if done > first[1] else 0.0
        expected_end = now + rate * (total - done)

    def repeat() -> None:
        while not over.wait(LINE_SECONDS):
            now = monotonic()
            left = f", about {expected_end - now:.0f} s left" if expected_end - now >= 1 else ""
            if state:
                errors.print(f"kerfpath: {state}{left} ({now - begun:.0f} s)")

    thread = Thread(target=repeat, daemon=True)
    thread.start()
    try:
        yield take
    finally:
        over.set()
        thread.join()


@contextmanager
def progress_bars(unit: str = "nodes", *, time_left: bool = False) -> Iterator[Progress]:
    """Give a `Progress` that draws a bar for each piece of work, counted in `unit`.

    Without a terminal it prints lines instead, and after `--quiet` nothing.
    """
    if quiet.is_set():
        yield no_progress
        return
    if not errors.is_terminal:
        with progress_lines(unit) as take:
            yield take
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[measure]}"),
        TimeElapsedColumn(),
        *((TimeRemainingColumn(), TextColumn("left")) if time_left else ()),
    )
    with Bars(*columns, console=errors, transient=True, speed_estimate_period=DAY) as bars:
        tasks: dict[str, TaskID] = {}
        unmeasured: list[TaskID] = []

        def advance(what: str, done: int, total: int) -> None:
            while unmeasured:
                bars.remove_task(unmeasured.pop())
            if not total:
                unmeasured.append(bars.add_task(what, total=None, measure=""))
                return
            if what not in tasks:
                tasks[what] = bars.add_task(what, total=total, measure="")
            measure = f"{done}/{total} {unit}".rstrip()
            bars.update(tasks[what], completed=done, total=total, measure=measure)

        yield advance


@contextmanager
def sweep_bar(unit: str) -> Iterator[Progress]:
    """Give a `Progress` that shows how far a sweep is, and the time left; see `resumable`."""
    with resumable(), progress_bars(unit, time_left=True) as show:
        yield lambda what, done, total: show(f"{unit} done", done, total)


def resumable() -> AbstractContextManager[None]:
    """Print at Ctrl-C how to continue, and exit with code 130."""
    return stop_in_order("kerfpath: stopped; the same command continues from the results so far")


@contextmanager
def busy(what: str) -> Iterator[None]:
    """Show work of unknown length on a terminal; print nothing elsewhere."""
    if errors.is_terminal and not quiet.is_set():
        with errors.status(what):
            yield
    else:
        yield


def compile_kernels(kinematics: str | None = None) -> None:
    """Compile the kernels before the first run, and print that.

    Parameters
    ----------
    kinematics : str, optional
        The kinematic family of the robot of a job that this process plans; kernels that only bounds
        need are then compiled while it plans. Default: all for the usual family, for processes to
        come.
    """
    from kerfpath.compiling import LATER
    from kerfpath.job import is_compiled, warm_up

    later = () if kinematics is None else LATER
    kinematics = kinematics or "opw"

    if is_compiled(kinematics):
        return
    if not (quiet.is_set() or errors.is_terminal):
        errors.print("kerfpath: compiling the kernels, first run only")
    with busy("compiling the kernels, first run only"):
        warm_up(kinematics, later=later)
