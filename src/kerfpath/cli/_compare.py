"""`kerfpath compare`: describe in words what differs between two programs."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from rich.markup import escape

from kerfpath.cli._show import busy, out, print_json
from kerfpath.job import compare_programs

__all__ = ["show_differences"]


def show_differences(a: Path, b: Path, job: Path, *, as_json: bool) -> bool:
    """Print what differs between two programs; return whether they are the same."""
    with busy("comparing the programs"):
        found = compare_programs(a, b, job)
    same = not found.differences
    if as_json:
        print_json(
            {
                "same": same,
                "differences": [asdict(each) for each in found.differences],
                "not_compared": list(found.not_compared),
            }
        )
        return same
    for each in found.differences:
        out.print(escape(str(each)), soft_wrap=True)
    if found.not_compared:
        out.print(f"note: not compared: {', '.join(found.not_compared)}")
    alike = "the same" if not found.not_compared else "the same in what was compared"
    out.print(alike if same else "not the same")
    return same
