"""Output about a drawing: its summary, the loops of `kerfpath contours`, and its first job."""

from __future__ import annotations

import csv
from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.markup import escape

from kerfpath.arrays import counted
from kerfpath.cad import Loop, Part, read
from kerfpath.cli.reading import ReadingOptions
from kerfpath.cli.show import busy, out, print_json, progress_bars, show_files, table
from kerfpath.errors import InputError
from kerfpath.files import write_whole
from kerfpath.job import Drawing, Job, job_text, machine_of
from kerfpath.post import write_program
from kerfpath.report import DrawnLoop, render_drawing

# -----------------------------------------------------------------------------
# The one-line summary of a drawing, which every command that reads a drawing prints.


def drawing_by(file: Path, how: ReadingOptions) -> Drawing:
    """Return a drawing by the options of a command.

    Columns are x,y,z,... or x=NAME,y=NAME,...; the machine is as in a job.
    """
    beam = how.beam
    return Drawing(
        file=file,
        unit=how.unit,
        gap=how.gap_mm / 1000,
        edge_turn=how.edge_turn_mm / 1000,
        outer_towards=None if how.outer_towards is None else np.array(how.outer_towards),
        axis=None if how.axis is None else np.array(how.axis),
        columns=None if how.columns is None else _columns(how.columns),
        sort=how.sort,
        beam=beam[0] if beam and len(beam) == 1 else beam or None,
        section=None if how.section is None else np.array(how.section),
        section_at=tuple(height / 1000 for height in how.section_mm or ()),
        machine=None if how.machine is None else machine_of(how.machine, "--machine"),
        drawing_frame=how.drawing_frame,
    )


def drawn(drawing: Drawing) -> Part:
    """Return the part in a drawing.

    Raises
    ------
    InputError
        As `kerfpath.cad.read`.
    """
    with progress_bars("faces") as progress:
        return drawing.read(progress)


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


# -----------------------------------------------------------------------------
# `kerfpath contours`: list the loops of a drawing by the names that jobs use.


def list_contours(part: Part, html: Path | None, *, everything: bool) -> None:
    """Print the size of a part, and the name, surface, length, edges and place of every loop."""
    main = [loop for loop in part.loops if loop.is_main]
    if html is not None:
        with busy(f"drawing {html.name}"):
            write_program(html, _page(part, main))
    if out.quiet:
        print_json(_contours_entry(part, html))
        return
    show_drawing(part)
    shown = part.loops if everything else main
    optional = [
        key
        for key in ("side", "countersink", "layer", "colour")
        if any(getattr(loop, key) for loop in shown)
    ]
    rows = []
    for loop in shown:
        middle = (loop.bounding_box.mean(axis=0) * 1000).round(1) + 0.0
        rows.append(
            [
                escape(loop.name),
                loop.surface,
                f"{loop.length * 1000:.2f}",
                "" if loop.diameter is None else f"{loop.diameter * 1000:.2f}",
                str(loop.edges),
                f"{loop.largest_gap * 1000:.4f}",
                " ".join(f"{v:.1f}" for v in middle),
                *(escape(getattr(loop, key)) for key in optional),
                "" if loop.closed else "open",
            ]
        )
    columns = ["loop", "surface", "length mm", "diameter mm", "edges", "gap mm", "middle mm"]
    heads = [*columns, *optional, "ends"]
    spare = ["gap mm", "edges", "middle mm"]
    table(heads, rows, numbers=columns[2:6], whole=["ends"], spare=spare)
    if len(shown) < len(part.loops):
        out.print(
            f"{len(part.loops) - len(shown)} more loops, of single faces in skins and around the "
            "thickness of the sheet, are listed with --all"
        )
    if html is not None:
        show_files([html])


def _page(part: Part, main: list[Loop]) -> str:
    loops = [
        DrawnLoop(
            name=loop.name,
            kind=loop.kind,
            points=loop.line(2e-5),
            facts=f"{loop.length * 1000:.2f} mm, {loop.edges} edges"
            + ("" if loop.diameter is None else f", diameter {loop.diameter * 1000:.2f} mm")
            + ("" if loop.closed else ", open"),
            fault=not loop.closed and loop.kind != "open",
            aside=loop not in main,
        )
        for loop in part.loops
    ]
    corners = " to ".join(
        " ".join(f"{v:.1f}" for v in (corner * 1000).round(1) + 0.0) for corner in part.bounding_box
    )
    facts = [("File", str(part.path)), ("Holds", summary(part)), ("Box", f"{corners} mm")]
    return render_drawing(part.path.name, loops, mesh=part.mesh(), facts=facts, notes=part.notes)


def _contours_entry(part: Part, html: Path | None) -> dict[str, object]:
    return drawing_entry(part) | {
        "html": None if html is None else str(html),
        "loops": [
            {
                "name": loop.name,
                "face": loop.face,
                "kind": loop.kind,
                "surface": loop.surface,
                "length_m": loop.length,
                "diameter_m": loop.diameter,
                "edges": loop.edges,
                "closed": loop.closed,
                "largest_gap_m": loop.largest_gap,
                "shortest_edge_m": loop.shortest_edge,
                "bounding_box_m": loop.bounding_box.tolist(),
                "side": loop.side,
                "countersink": loop.countersink,
                "skin": loop.skin,
                "layer": loop.layer,
                "colour": loop.colour,
                "feeds_m_s": loop.feeds,
                "edge_turns": [
                    {"at_m": turn.at.tolist(), "angle_deg": float(np.degrees(turn.angle))}
                    for turn in loop.edge_turns
                ],
            }
            for loop in part.loops
        ],
    }


# -----------------------------------------------------------------------------
# `kerfpath new`: write a first job for a drawing; `kerfpath studio` does so for one without.


def write_new(drawing: Drawing, job: Path | None, *, robot: str | None = None) -> None:
    """Write a first job for a drawing, and print what it has and what to do next.

    Raises
    ------
    InputError
        There is a job already, or as `first_job`.
    """
    job = job or drawing.file.with_suffix(".toml")
    if job.exists():
        raise InputError(
            f"{job}: there is a file already, which is never overwritten; give another name with "
            "--out, or delete it"
        )
    part = drawn(drawing)
    text = job_text(part, job, robot=robot, drawing=drawing)
    _write(job, text)
    print_json({"job": str(job), "drawing": str(drawing.file), "text": text})
    show_drawing(part)
    out.print(f"wrote {escape(str(job))}; now change what is marked as a guess there, then:")
    out.print(f"  kerfpath check {escape(str(job))}", highlight=False)
    out.print(f"  kerfpath plan {escape(str(job))}")


def first_job(drawing: Path) -> Path:
    """Return the job beside a drawing with the same name; write one if there is none.

    Raises
    ------
    InputError
        The drawing cannot be read; the job cannot be written.
    """
    job = drawing.with_suffix(".toml")
    if not job.exists():
        _write(job, job_text(read(drawing), job))
    return job


def _write(job: Path, text: str) -> None:
    try:
        write_whole({job: text.encode()})
    except OSError as error:
        raise InputError(
            f"{job}: cannot write a job for the drawing ({error.strerror}); copy the drawing to "
            "a writable folder"
        ) from None
