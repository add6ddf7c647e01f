"""`kerfpath contours`: list the loops of a drawing by the names that jobs use."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape

from kerfpath.cad import Loop, Part
from kerfpath.cli._drawing import drawing_entry, show_drawing, summary
from kerfpath.cli._show import busy, out, print_json, table
from kerfpath.post import write_program
from kerfpath.report import DrawnLoop, render_drawing

__all__ = ["list_contours"]


def list_contours(part: Part, html: Path | None, *, everything: bool, as_json: bool) -> None:
    """Print the size of a part, and the name, surface, length, edges and place of every loop."""
    main = [loop for loop in part.loops if not loop.skin and loop.side != "edge"]
    if html is not None:
        with busy(f"drawing {html.name}"):
            write_program(html, _page(part, main))
    if as_json:
        print_json(_contours_entry(part, html))
        return
    show_drawing(part)
    shown = part.loops if everything else main
    optional = [
        (head, key)
        for head, key in (("side", "side"), ("layer", "layer"), ("colour", "colour"))
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
                *(escape(getattr(loop, key)) for _, key in optional),
                "" if loop.closed else "open",
            ]
        )
    columns = ["loop", "surface", "length mm", "diameter mm", "edges", "gap mm", "middle mm"]
    heads = [*columns, *(head for head, _ in optional), "ends"]
    spare = ["gap mm", "edges", "middle mm"]
    table(heads, rows, numbers=columns[2:6], whole=["ends"], spare=spare)
    if len(shown) < len(part.loops):
        out.print(
            f"{len(part.loops) - len(shown)} more loops, of single faces in skins and around the "
            "thickness of the sheet, are listed with --all"
        )
    if html is not None:
        out.print(f"wrote {escape(str(html))}")


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
                "skin": loop.skin,
                "layer": loop.layer,
                "colour": loop.colour,
            }
            for loop in part.loops
        ],
    }
