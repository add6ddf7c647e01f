"""`kerfpath contours`: the loops of a CAD file, by the names that jobs pick them by."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape

from kerfpath.cad import read_step
from kerfpath.cli._show import out, print_json, table

__all__ = ["list_contours"]


def list_contours(file: Path, unit: str | None, *, as_json: bool) -> None:
    """Print the size of a part, and every loop's name, surface, length, edges and place."""
    part = read_step(file, unit=unit)
    size = part.bounding_box[1] - part.bounding_box[0]
    if as_json:
        print_json(
            {
                "file": str(file),
                "unit": part.unit,
                "bounding_box_m": part.bounding_box.tolist(),
                "faces": part.faces,
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
                    }
                    for loop in part.loops
                ],
            }
        )
        return
    out.print(
        f"{escape(str(file))}: {part.faces} faces, {len(part.loops)} loops, "
        f"{' x '.join(f'{v * 1000:.1f}' for v in size)} mm (file in {part.unit})"
    )
    rows = []
    for loop in part.loops:
        middle = loop.bounding_box.mean(axis=0) * 1000
        rows.append(
            [
                escape(loop.name),
                loop.surface,
                f"{loop.length * 1000:.2f}",
                "" if loop.diameter is None else f"{loop.diameter * 1000:.2f}",
                str(loop.edges),
                f"{loop.largest_gap * 1000:.4f}",
                " ".join(f"{v:.1f}" for v in middle),
                "" if loop.closed else "open",
            ]
        )
    columns = ["loop", "surface", "length mm", "diameter mm", "edges", "gap mm", "middle mm", ""]
    table(columns, rows, numbers=columns[2:6])
