"""`kerfpath check`: print bodies and pairs of the cell of a job, and the start of each contour."""

from __future__ import annotations

import numpy as np
from rich.markup import escape

from kerfpath.cell import Body, Capsule, Cell, Mesh, caveats, unlikely_sizes
from kerfpath.cli.drawing_output import drawing_entry
from kerfpath.cli.show import out, print_json, table
from kerfpath.job import (
    JobPreview,
    collision_note,
)


def show_check(checked: JobPreview) -> None:
    """Print a job's robot, the bodies and pairs of its cell, and the start of every contour."""
    job, cell = checked.job, checked.cell
    print_json(
        {
            "drawing": drawing_entry(checked.part),
            "robot": job.robot.id,
            "joints": job.robot.joints,
            "language": job.program.language,
            "cell": None if cell is None else _cell_entry(cell),
            "contours": [
                {
                    "name": s.name,
                    "nodes": s.nodes,
                    "poses": s.poses,
                    "clear": None if cell is None else s.clear,
                    "clearance_m": None if np.isnan(s.clearance) else s.clearance,
                    "pair": s.pair,
                }
                for s in checked.starts
            ],
            "notes": [*checked.warnings, _note(checked)],
        }
    )
    out.print(f"robot {escape(job.robot.id)}, {job.robot.joints} joints; {job.part_file.name}")
    if cell is not None:
        _show_cell(cell)
    rows = []
    for s in checked.starts:
        row = [escape(s.name), str(s.nodes), str(s.poses)]
        if cell is not None:
            clearance = "" if np.isnan(s.clearance) else f"{s.clearance * 1e3:.1f}"
            row += [str(s.clear), clearance, "" if s.pair is None else escape(" - ".join(s.pair))]
        rows.append(row)
    columns = ["contour", "nodes", "poses at its start"]
    columns += [] if cell is None else ["clear", "clearance mm", "nearest"]
    table(columns, rows, numbers=columns[1:5], spare=["nodes"])
    for warning in checked.warnings:
        out.print(f"warning: {escape(warning)}")
    out.print(f"note: {escape(_note(checked))}")


def _note(checked: JobPreview) -> str:
    """Return the note on the collision checks of `kerfpath plan`; here only starts are checked."""
    moves_too = checked.job.sequence is not None and checked.cell is not None
    return collision_note(checked.cell, moves_too=moves_too)


def _show_cell(cell: Cell) -> None:
    rows = [
        [
            escape(body.name),
            body.kind,
            escape(cell.chain.moves_with(body.frame)),
            " x ".join(f"{edge * 1e3:.0f}" for edge in body.size),
            _shape(body) + ("" if body.holds else ", not the real shape"),
            str((cell.pairs == i).sum()),
        ]
        for i, body in enumerate(cell.bodies)
    ]
    table(["body", "kind", "moves with", "box mm", "shape", "pairs"], rows, numbers=["pairs"])
    for warning in unlikely_sizes(cell):
        out.print(f"warning: {escape(warning)}")
    kept = f"{cell.near_miss * 1e3:g} mm"
    out.print(f"{len(cell.pairs)} pairs are judged; all keep {kept}, except for:")
    rules = zip(cell.pair_names, cell.asked, cell.required, cell.depth, cell.own, strict=True)
    for (a, b), asked, required, depth, own in rules:
        if own or required < asked or depth > 0:
            rule = f"{required * 1e3:.3g} mm"
            if depth > 0:
                rule = f"beyond the {depth * 1e3:g} mm that they overlap by design"
            elif required < asked:
                rule += f" instead of {asked * 1e3:g} mm, as the design leaves hardly more"
            out.print(f"  {escape(a)} - {escape(b)}: {rule}")
    out.print("not judged:")
    by_reason: dict[str, list[str]] = {}
    for (a, b), why in cell.unjudged.items():
        by_reason.setdefault(why, []).append(f"{a} - {b}")
    for why, pairs in by_reason.items():
        out.print(f"  {escape(why)}: {escape(', '.join(pairs))}")


def _shape(body: Body) -> str:
    shape = body.shape
    if isinstance(shape, Capsule):
        return f"capsule, radius {shape.radius * 1e3:.0f} mm"
    if isinstance(shape, Mesh):
        return f"mesh, {len(shape.triangles)} triangles, within {shape.deviation * 1e3:g} mm"
    hull = ", the hull of its mesh" if body.approximate else ""
    surface = ", judged by its surface" if shape.crowded else ""
    return f"convex, {len(shape.points)} corners{hull}{surface}"


def _cell_entry(cell: Cell) -> dict[str, object]:
    return {
        "near_miss_m": cell.near_miss,
        "bodies": [
            {
                "name": b.name,
                "kind": b.kind,
                "joint": max(b.frame - cell.chain.base, 0),
                "moves_with": cell.chain.moves_with(b.frame),
                "approximate": b.approximate,
                "holds_the_real_one": b.holds,
                "size_m": b.size.tolist(),
            }
            for b in cell.bodies
        ],
        "warnings": list(unlikely_sizes(cell)),
        "judged": [
            {
                "between": list(pair),
                "at_least_m": float(required),
                "asked_m": float(asked),
                "overlap_by_design_m": float(depth),
            }
            for pair, asked, required, depth in zip(
                cell.pair_names, cell.asked, cell.required, cell.depth, strict=True
            )
        ],
        "not_judged": [{"between": list(pair), "why": why} for pair, why in cell.unjudged.items()],
        "not_proved": list(caveats(cell)),
    }
