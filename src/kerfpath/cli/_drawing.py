"""The one-line summary of a drawing, which every command that reads a drawing prints."""

from __future__ import annotations

import csv
from dataclasses import asdict
from pathlib import Path

from rich.markup import escape

from kerfpath._repr import counted
from kerfpath.cad import Part
from kerfpath.cad import read as read_drawing
from kerfpath.cli._show import busy, out, progress_bars
from kerfpath.job import Job

__all__ = ["drawing_entry", "drawing_in", "drawing_of", "show_drawing", "summary"]


def drawing_in(
    file: Path,
    *,
    unit: str | None,
    gap: float,
    outer_towards: tuple[float, float, float] | None,
    axis: tuple[float, float, float] | None,
    columns: str | None,
) -> Part:
    """Return the part in a file; `columns` is x,y,z,... or x=NAME,y=NAME,..., and `gap` is in m.

    Raises
    ------
    InputError
        As `kerfpath.cad.read`.
    """
    with progress_bars("faces") as progress:
        return read_drawing(
            file,
            unit=unit,
            gap=gap,
            outer_towards=outer_towards,
            axis=axis,
            columns=None if columns is None else _columns(columns),
            progress=progress,
        )


def _columns(text: str) -> dict[str, str] | list[str]:
    """Return the columns of a table; an item that contains a comma is in double quotes."""
    parts = [part.strip() for part in next(csv.reader([text], skipinitialspace=True), [])]
    if not any("=" in part for part in parts):
        return parts
    return {name.strip(): own.strip() for name, _, own in (part.partition("=") for part in parts)}


def drawing_of(job: Job) -> Part:
    """Return the part that a job cuts.

    Raises
    ------
    InputError
        The drawing cannot be read, or lacks a loop that the job picks.
    """
    with busy(f"reading {job.part_file.name}"):
        part = job.read_part()
    job.tasks(part)
    return part


def summary(part: Part) -> str:
    """Return the size of a part, its unit, and its loops with their lengths and faults."""
    size = (part.bounding_box[1] - part.bounding_box[0]) * 1000
    lengths = [loop.length * 1000 for loop in part.loops]
    return (
        f"{counted(part.faces, 'face')}, {counted(len(part.loops), 'loop')}"
        f"{f' of {min(lengths):.1f} to {max(lengths):.1f} mm' if lengths else ''}, "
        f"{' x '.join(f'{v:.1f}' for v in size)} mm (file in {part.unit}); "
        f"largest gap {part.largest_gap * 1000:.4f} mm, "
        f"shortest edge {part.shortest_edge * 1000:.4f} mm"
    )


def show_drawing(part: Part) -> None:
    """Print the summary of a part, and what reading it assumed, repaired or left out."""
    out.print(escape(f"{part.path}: {summary(part)}"))
    for note in part.notes:
        out.print(escape(f"note: {note}"))
    if part.frames:
        out.print(escape(f"coordinate systems: {', '.join(map(repr, part.frames))}"))


def drawing_entry(part: Part) -> dict[str, object]:
    """Return the summary of a part as JSON data."""
    return {
        "file": str(part.path),
        "unit": part.unit,
        "bounding_box_m": part.bounding_box.tolist(),
        "faces": part.faces,
        "frames": {name: T.tolist() for name, T in part.frames.items()},
        "largest_gap_m": part.largest_gap,
        "shortest_edge_m": part.shortest_edge,
        "notes": list(part.notes),
        "left_out": [asdict(each) for each in part.left_out],
    }
