"""`kerfpath check`: print bodies and pairs of the cell of a job, and the start of each contour."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.markup import escape

from kerfpath.auditor import format_value
from kerfpath.cell import Body, Capsule, Cell, Mesh, caveats, unlikely_sizes
from kerfpath.cli.drawing_output import drawing_entry
from kerfpath.cli.show import busy, out, print_json, table
from kerfpath.errors import InputError, about
from kerfpath.job import (
    AuditReport,
    JobPreview,
    audit_file,
    audit_program,
    collision_note,
    compare_programs,
)

# -----------------------------------------------------------------------------
# `kerfpath audit`: check every contour of a plan or a program again.


def show_audit(file: Path, job: Path | None, *, as_json: bool) -> bool:
    """Print the table of checks of each contour of a file; return whether all of them pass."""
    found = _run_audit(file, job)
    if as_json:
        print_json(
            {
                "passed": found.passed,
                "notes": [found.note],
                "missing": list(found.missing),
                "contours": {
                    name: [asdict(c) | {"ok": c.ok, "place": found.place(name, c)} for c in checks]
                    for name, checks in found.tables.items()
                },
            }
        )
    else:
        for name, checks in found.tables.items():
            if found.places and all(c.ok for c in checks):
                out.print(f"{escape(name)}: {len(checks)} checks passed")
                continue
            rows = [
                [
                    escape(c.title),
                    format_value(c.value, c.unit),
                    format_value(c.limit, c.unit),
                    str(c.node),
                    "ok" if c.ok else c.level.upper(),
                ]
                for c in checks
            ]
            table(
                ["check", "worst", "allowed", "node", "verdict"],
                rows,
                title=escape(name),
                numbers=["worst", "allowed", "node"],
                whole=["verdict"],
            )
            for c in checks:
                if not c.ok:
                    said = f"{name}: {c.issue()}"
                    if name in found.places:
                        said = found.sentence(name, c)
                    out.print(escape(said), soft_wrap=True)
        for name in found.missing:
            out.print(f"{escape(name)}: {'not cut' if found.places else 'no plan'}")
        out.print(f"note: {escape(found.note)}")
        out.print("audit passed" if found.passed else "audit FAILED")
    return found.passed


def _run_audit(file: Path, job: Path | None) -> AuditReport:
    if file.suffix.lower() == ".json":
        with about(file):
            return audit_file(file, job)
    if job is None:
        raise InputError(f"{file}: a program is compared with its job; give it with --job JOB.toml")
    with about(file), busy("auditing the program"):
        return audit_program(file, job)


# -----------------------------------------------------------------------------
# `kerfpath compare`: describe in words what differs between two programs.


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


# -----------------------------------------------------------------------------
# `kerfpath check`: print bodies and pairs of the cell of a job, and the start of each contour.


def show_check(checked: JobPreview, *, as_json: bool) -> None:
    """Print a job's robot, the bodies and pairs of its cell, and the start of every contour."""
    job, cell = checked.job, checked.cell
    if as_json:
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
                "notes": [_note(checked)],
            }
        )
        return
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
            f"{len(_partners(cell, i))}",
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
    for why, pairs in _not_judged(cell).items():
        names = ", ".join(f"{a} - {b}" for a, b in pairs)
        out.print(f"  {escape(why)}: {escape(names)}")


def _partners(cell: Cell, body: int) -> list[int]:
    return [int(a + b - body) for a, b in cell.pairs.tolist() if body in (a, b)]


def _not_judged(cell: Cell) -> dict[str, list[tuple[str, str]]]:
    """Return the pairs that are not judged, by reason."""
    found: dict[str, list[tuple[str, str]]] = {}
    for pair, why in cell.unjudged.items():
        found.setdefault(why, []).append(pair)
    return found


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
