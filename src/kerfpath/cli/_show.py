"""What commands print: tables for people on stdout, or one JSON object; progress on stderr."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from datetime import timedelta
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars
from rich.table import Table

from kerfpath.cli._stop import in_order

__all__ = [
    "busy",
    "compile_kernels",
    "errors",
    "out",
    "print_json",
    "progress_bars",
    "resumable",
    "sweep_bar",
    "table",
]

_PIPED = 200
"""Columns for output that goes to a file or another program: nothing is cut off there."""

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
) -> None:
    """Print a table; columns named in `numbers` stand to the right and are never folded."""
    shown = Table(title=title or None, title_justify="left", box=None, pad_edge=False)
    for column in columns:
        number = column in numbers
        shown.add_column(column, justify="right" if number else "left", no_wrap=number)
    for row in rows:
        shown.add_row(*row)
    out.print(shown)


@contextmanager
def progress_bars(unit: str = "nodes") -> Iterator[Callable[[str, int, int], None]]:
    """Give a function that shows how far each piece of work is; silent where nobody looks."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn(unit),
        TimeRemainingColumn(),
    )
    watched = errors.is_terminal
    with Bars(*columns, console=errors, transient=True, disable=not watched) as bars:
        tasks: dict[str, Any] = {}

        def advance(what: str, done: int, total: int) -> None:
            if what not in tasks:
                tasks[what] = bars.add_task(what, total=total)
            bars.update(tasks[what], completed=done, total=total)

        yield advance


@contextmanager
def sweep_bar(unit: str) -> Iterator[Callable[[int, int, float | None], None]]:
    """Give a function that shows how far a sweep is, and the time left; see `resumable`."""
    left_over = TextColumn("{task.fields[left]}")
    columns = (BarColumn(), MofNCompleteColumn(), TextColumn(unit), left_over)
    watched = errors.is_terminal
    with Bars(*columns, console=errors, transient=True, disable=not watched) as bars:
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
    if errors.is_terminal:
        with errors.status(what):
            yield
    else:
        yield


def compile_kernels() -> None:
    """Compile the kernels if this copy never has, and show it."""
    from kerfpath.job import warm_up

    with busy("compiling the kernels, first run only"):
        warm_up()
