"""Output of `kerfpath check`, `kerfpath speed` and `kerfpath plan`."""

from __future__ import annotations

import signal
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import typer
from rich.markup import escape

from kerfpath.cad import Part
from kerfpath.cell import Body, Capsule, Cell, Mesh, caveats, unlikely_sizes
from kerfpath.cli.charts_output import origin_entry
from kerfpath.cli.drawing_output import drawing_entry, drawing_of, show_drawing
from kerfpath.cli.show import (
    busy,
    compile_kernels,
    errors,
    merge_notes,
    out,
    print_json,
    progress_bars,
    show_files,
    table,
)
from kerfpath.cli.surroundings import end_early, ended_early, exit_code
from kerfpath.execution import Compensation, PathError
from kerfpath.job import (
    AsRun,
    ContourSpeed,
    CutResult,
    Job,
    JobPreview,
    JobResult,
    Spent,
    collision_note,
    origins_of,
    power_of,
    prepare,
    read_job,
    require_foreseen,
    require_language,
    require_place,
    run_prepared,
    sequence_entry,
    spent_by_contour,
    spent_entry,
    spent_on_all,
    spent_table,
    with_map,
    write_result,
)
from kerfpath.names import identifiers
from kerfpath.planner import FastestSpeed, at_least, at_most
from kerfpath.plans import Plan
from kerfpath.robots import posture_name

# -----------------------------------------------------------------------------
# `kerfpath check`: the bodies and pairs of the cell of a job, and the start of each contour.


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


# -----------------------------------------------------------------------------
# `kerfpath speed`: find the fastest constant speed of each contour, and the limit that binds.


def show_speeds(answers: Sequence[ContourSpeed]) -> bool:
    """Print the fastest speed of each contour; return whether every contour has one."""
    entries: list[dict[str, object]] = []
    rows = []
    for answer in answers:
        task, nodes, found, run = answer.task, answer.nodes, answer.at_nodes, answer.as_run
        close = answer.true_to_path
        entry: dict[str, object] = {"name": task.name, "asked_m_min": task.speed * 60}
        row = [escape(task.name), f"{task.speed * 60:g}"]
        if isinstance(found, FastestSpeed):
            place = (nodes.points[found.node] * 1000).round(1).tolist()
            entry |= {
                "fastest_m_min": found.speed * 60,
                "on_grid_m_min": None if found.on_grid is None else found.on_grid * 60,
                "as_run_m_min": None if run is None else run * 60,
                "true_to_path_m_min": None if close is None else close * 60,
                "impossible_from_m_min": None if found.ceiling is None else found.ceiling * 60,
                "joint": found.joint + 1,
                "limit": found.limit,
                "node": found.node,
                "point_mm": place,
            }
            what = f"joint {found.joint + 1} {found.limit}"
            at = " ".join(f"{v:g}" for v in place)
            on_grid = found.speed if found.on_grid is None else found.on_grid
            off_grid = "-" if found.on_grid is None else at_most(found.speed * 60)
            never = "-" if found.ceiling is None else at_least(found.ceiling * 60)
            kept = "-" if run is None else at_most(run * 60)
            true = "-" if close is None else at_most(close * 60)
            speeds = [at_most(on_grid * 60), off_grid, kept, true, never]
            rows.append([*row, *speeds, str(found.node), what, at])
        else:
            entry |= {"fastest_m_min": None, "reason": str(found), "proved_for": found.scope}
            rows.append(
                [*row, "-", "-", "-", "-", "-", str(found.node + 1), "no admissible pose", ""]
            )
        entries.append(entry)
    print_json({"contours": entries})
    columns = [
        "contour",
        "asked m/min",
        "on the grid",
        "refined",
        "as run",
        "true to path",
        "impossible from",
        "node",
        "what binds",
    ]
    at = "at x y z mm"
    table([*columns, at], rows, numbers=columns[1:8], spare=[at])
    out.print(
        "speeds for speed_m_min, cuts are slower where the job has shares of it or crosses sharp "
        "edges; on the grid: the fastest constant speed there, exact; refined: the fastest speed "
        "found off the grid, not proved to be the fastest possible; both keep the limits at "
        "the nodes; as run: a speed at which the program keeps them between the nodes, too, "
        "if the job asks for it (between_nodes) and one was found; true to path: a speed at which "
        "that motion, run more slowly, is executed within path_tolerance_mm; impossible from: at "
        "this speed and above it is proved that there is no motion, at any rotation"
    )
    return all(entry["fastest_m_min"] is not None for entry in entries)


# -----------------------------------------------------------------------------
# `kerfpath plan`: the run of a job, the result of each contour, and the files written.


def plan_job(
    job_file: Path,
    folder: Path,
    *,
    draw_map: bool = False,
    strict: bool = False,
) -> None:
    """Plan a job, write its files into a folder and print the result.

    Raises
    ------
    typer.Exit
        Code 1: some contour has no plan that passes its audit.
    """
    job = read_job(job_file)
    require_language(job)
    require_place(job, folder)
    if draw_map:
        job = with_map(job)
    part = drawing_of(job)
    show_drawing(part)
    prepared = prepare(job, part)
    compile_kernels(job.robot.kinematics)
    require_foreseen(prepared)
    with progress_bars("", time_left=True) as progress, end_early():
        outcome = run_prepared(prepared, progress=progress)
    if ended_early() and not outcome.cuts:
        errors.print("kerfpath: stopped before anything was planned; nothing is written")
        raise typer.Exit(exit_code(signal.SIGINT))
    finish_run(outcome, part, folder, strict=strict)


def finish_run(
    outcome: JobResult,
    part: Part,
    folder: Path,
    *,
    strict: bool = False,
    more: Mapping[str, object] | None = None,
) -> None:
    """Write the files of a run into a folder and print the result; `more` goes into the JSON.

    Raises
    ------
    typer.Exit
        Code 1: some contour has no plan that passes its audit.
    """
    with busy("writing"):
        written = write_result(outcome, folder, strict=strict)
    spent = spent_by_contour(outcome)
    print_json(
        {
            "passed": outcome.passed,
            "not_planned": list(outcome.not_planned),
            "drawing": drawing_entry(part),
            "contours": [
                cut_entry(cut) | times_entry(outcome.job, cut, spent.get(cut.name))
                for cut in outcome.cuts
            ],
            "process": _process_entry(outcome.job),
            "spent": spent_entry(spent_on_all(outcome, [*spent.values()])),
            "sequence": None if outcome.part is None else sequence_entry(outcome.part),
            "files": [str(f) for f in written.files],
            "removed": [str(f) for f in written.removed],
            "notes": list(written.notes),
            "faults": list(written.faults),
            **(more or {}),
        }
    )
    _show_cuts(outcome.cuts)
    _show_spent(outcome, spent)
    names = [cut.name for cut in outcome.cuts]
    names += identifiers(names, ())  # as in programs
    warnings: list[str] = []
    for cut in outcome.cuts:
        if cut.broken is not None:
            out.print(f"[bold]{escape(cut.name)}[/]: {escape(cut.failure)}")
        if cut.plan is not None and cut.plan.feed is not None:
            out.print(f"[bold]{escape(cut.name)}[/]: {cut.plan.feed}")
        if (tilt := _largest_tilt(cut)) is not None:
            out.print(f"[bold]{escape(cut.name)}[/]: tool axis tilted by up to {tilt:.2f} deg")
        for check in (*cut.checks, *cut.as_run.checks):
            if not check.ok and check.level == "warning":
                warnings.append(f"{cut.name}: {check.issue()}")
            elif not check.ok:
                out.print(f"[bold]{escape(cut.name)}[/]: {escape(str(check.issue()))}")
    for warning in merge_notes(warnings, names):
        out.print(escape(warning))
    for note in merge_notes(written.notes, names):
        out.print(f"note: {escape(note)}")
    for fault in written.faults:
        out.print(f"[bold red]do not cut:[/] {escape(fault)}")
    show_files(written.files, written.removed, of="an earlier run")
    if written.stale is not None:
        errors.print(
            f"kerfpath: {escape(str(written.stale))} is from an earlier run and does not belong "
            "to this plan; it was kept, as it was edited or kerfpath may not have written it: "
            "move it away"
        )
    if ended_early():
        errors.print("kerfpath: stopped; what was planned by then is written")
        raise typer.Exit(exit_code(signal.SIGINT))
    if not outcome.passed:
        raise typer.Exit(1)


def _largest_tilt(cut: CutResult) -> float | None:
    """Return the largest tilt of the tool axis at the nodes, deg; None if no tilt is allowed."""
    if cut.plan is None or cut.plan.settings.tilt is None:
        return None
    return float(np.degrees(np.hypot(*cut.plan.tilt.T).max()))


def cut_entry(cut: CutResult) -> dict[str, object]:
    """Return what the JSON output says of a cut, in SI."""
    entry: dict[str, object] = {"name": cut.name, "passed": cut.passed, "kept": bool(cut.kept)}
    entry |= {
        "length_m": cut.candidate.path.length,
        "nodes": len(cut.candidate.nodes),
        "speed_m_s": cut.request.task.speed,
        "technique": cut.request.task.table.technique,
        "technique_by_size": cut.request.task.by_size,
    }
    entry["departure"] = None if cut.departure is None else asdict(cut.departure)
    if cut.plan is None:
        assert cut.broken is not None
        fastest = None if cut.fastest is None else cut.fastest.speed
        return entry | {
            "reason": cut.failure,
            "last_node_reached": cut.broken.node,
            "proved": cut.broken.proved,
            "proved_for": cut.broken.scope,
            "closed": None if cut.broken.closed is None else asdict(cut.broken.closed),
            "relaxation": None if cut.broken.relaxation is None else asdict(cut.broken.relaxation),
            "fastest_speed_m_s": fastest,
        }
    criteria = cut.plan.criteria
    return entry | {
        "time_s": float(cut.plan.time[-1]),
        "posture": _postures(cut.plan),
        "cost": cut.plan.cost,
        "grid_cost": cut.plan.proof.grid_cost,
        "optimal": cut.plan.proof.optimal,
        "bound": cut.plan.proof.bound,
        "gap": cut.plan.proof.gap,
        "proof": cut.plan.proof.statement,
        "explored": None if cut.plan.proof.explored is None else asdict(cut.plan.proof.explored),
        "feed": None if cut.plan.feed is None else asdict(cut.plan.feed),
        "largest_tilt_deg": _largest_tilt(cut),
        "peak_velocity_share": float(criteria.peak_velocity.max()),
        "peak_acceleration_share": float(criteria.peak_acceleration.max()),
        "reversals": int(criteria.reversals.sum()),
        "as_run": _as_run_entry(cut.as_run),
        "issues": [str(c.issue()) for c in (*cut.checks, *cut.as_run.checks) if not c.ok],
    }


def times_entry(job: Job, cut: CutResult, spent: Spent | None) -> dict[str, object]:
    """Return what the JSON output says of the times of a cut, and of what it takes, in SI."""
    if spent is None:
        return {}
    times: dict[str, object] = {"piercing_s": spent.piercing, "gas_s": spent.gas_time}
    return times | {"spent": spent_entry(spent), "power": power_entry(job, cut)}


def _show_spent(outcome: JobResult, spent: Mapping[str, Spent]) -> None:
    heads, rows = spent_table(outcome, spent)
    if rows:
        columns = [f"{name.lower()} {unit}".strip() for name, unit in heads]
        table(columns, [[escape(cell) for cell in row] for row in rows], numbers=columns[2:])


def power_entry(job: Job, cut: CutResult) -> dict[str, object] | None:
    """Return what the JSON output says of the power along a cut; None where it is not set."""
    along = power_of(job, cut)
    if along is None:
        return None
    return {
        "s_m": along.s.tolist(),
        "speed_share": along.speed.tolist(),
        "asked_share": along.asked.tolist(),
        "power_share": along.set.tolist(),
        "changes": along.switches,
        "largest_difference": along.difference,
        "mean_difference": along.mean_difference,
        "fine_s_m": along.fine_s.tolist(),
        "fine_speed_share": along.fine_speed.tolist(),
    }


def _process_entry(job: Job) -> dict[str, object] | None:
    origins = origins_of(job.text, job.source)
    if not origins:
        return None
    return {"origins": [*map(origin_entry, origins)], "sheet": list(job.program.remarks)}


def _as_run_entry(run: AsRun) -> dict[str, object]:
    entry: dict[str, object] = {c.code.removesuffix("-as-run"): c.value for c in run.checks}
    if run.timing is not None:
        entry |= {"seconds": run.timing.seconds, "programmed_s": run.timing.programmed}
        entry |= {"speed_held": run.timing.held, "ramps_m": run.timing.ramps}
    if run.path_error is not None:
        entry["path_error"] = _path_error_entry(run.path_error)
    if run.compensation is not None:
        entry["compensation"] = _compensation_entry(run.compensation)
    if run.hole is not None:
        entry["hole"] = {f"{name}_m": value for name, value in run.hole._asdict().items()}
    return entry


def _compensation_entry(made: Compensation) -> dict[str, object]:
    """Return what moved targets give; they are those of the program unless there is a failure."""
    return {
        "before_m": made.before,
        "rest_m": made.rest,
        "largest_displacement_m": made.largest,
        "rounds": made.rounds,
        "failure": made.failure or None,
    }


def _path_error_entry(off: PathError) -> dict[str, object]:
    """Return how far the executed motion is from the path, and by which response."""
    response = off.response
    return {
        "largest_m": off.largest,
        "of_95_percent_m": off.usual,
        "at_m": float(off.s[off.worst]),
        "cause": off.cause,
        "largest_in_range_m": list(off.ends) or None,
        "response": response.name,
        "model": response.model,
        "standing": response.standing,
        "reversals_of_joints_1_to_3": len(off.reversals),
    }


def _show_cuts(cuts: Sequence[CutResult]) -> None:
    rows, again = [], any(cut.kept for cut in cuts)
    techniques = any(cut.request.task.technique for cut in cuts)
    for cut in cuts:
        row = [
            escape(cut.name),
            *([("kept" if cut.kept else "new")] if again else ()),
            f"{cut.candidate.path.length * 1000:.1f}",
            str(len(cut.candidate.nodes)),
            f"{cut.request.task.speed * 60:g}",
            *([escape(cut.request.task.technique or "-")] if techniques else []),
        ]
        sampling = _sampling(cut)
        if cut.plan is None:
            rows.append([*row, *"----------", *sampling, "no feasible path"])
            continue
        criteria = cut.plan.criteria
        rows.append(
            [
                *row,
                _postures(cut.plan),
                f"{cut.plan.time[-1]:.2f}",
                "" if cut.as_run.timing is None else f"{cut.as_run.timing.seconds:.2f}",
                "" if (off := cut.as_run.path_error) is None else f"{off.largest * 1e3:.2g}",
                "" if cut.plan.proof.grid_cost is None else f"{cut.plan.proof.grid_cost:.2f}",
                f"{cut.plan.cost:.2f}",
                cut.plan.proof.bound_shown,
                cut.plan.proof.gap_shown,
                f"{criteria.peak_velocity.max():.0%}",
                f"{criteria.peak_acceleration.max():.0%}",
                *sampling,
                "passed" if cut.passed else "FAILED",
            ]
        )
    columns = [
        "contour",
        *(["motion"] if again else ()),
        "mm",
        "nodes",
        "m/min",
        *(["technique"] if techniques else ()),
        "posture",
        "s",
        "run s",
        "off mm",
    ]
    columns += ["grid", "cost"]
    columns += ["bound", "gap %", "vel", "acc", "chord mm", "step deg", "audit"]
    spare = ["step deg", "chord mm", "grid", "bound", "m/min", "run s", "off mm"]
    numbers = [each for each in columns[1:-1] if each not in ("motion", "technique")]
    table(columns, rows, numbers=numbers, whole=["motion", "audit"], spare=spare)
    if again:
        out.print("motion: kept as it was, joint by joint, or new: planned again")
    out.print(
        "run s: time from rest to rest, with rounded corners and every joint limit kept; "
        "off mm: largest distance of the executed tool tip from the path, "
        f"{_response_of(cuts)}; "
        "cost: value of the objective; grid: lowest cost on the grid of rotations, before the "
        "refinement; bound: no motion that keeps the limits at the nodes costs less, at any "
        "rotation, posture and turn; gap: largest share of the cost that may lie above the best "
        "motion; vel, acc: highest share of a joint's velocity and acceleration limit; chord: "
        "largest distance of the CAD curve from the chords between nodes; step: largest rotation "
        "of the tool axis from node to node"
    )
    _show_holes(cuts)
    _show_compensation(cuts)
    unbound = [cut.name for cut in cuts if _is_unbound(cut)]
    if unbound:
        out.print(
            f"no bound for {escape(', '.join(unbound))}: the report and --json have the reason"
        )
    found = [cut.departure for cut in cuts if cut.departure is not None]
    loops = [each.path for each in found if each.path is not None]
    if loops:
        out.print(
            "*: measured from the path as cut, which differs from the drawn loop; that was within "
            f"{max(loop.chord_error for loop in loops) * 1e3:.4f} mm of the CAD curve"
        )
    rounded = [c.value for cut in cuts for c in cut.checks if c.code == "drawing"]
    if rounded:
        out.print(f"rounded corners leave the drawing by up to {max(rounded) * 1e3:.4f} mm")
    if any(each.against == "points of the drawing" for each in found + loops):
        out.print("if the drawing has points, the lines through them are taken as the CAD curve")


def _show_holes(cuts: Sequence[CutResult]) -> None:
    """Print the sizes of circles as they are cut."""
    rows = [
        [
            escape(cut.name),
            f"{hole.drawn * 1e3:.2f}",
            f"{hole.executed * 1e3:.2f}",
            f"{round((hole.executed - hole.drawn) * 1e3, 2) + 0.0:+.2f}",
            f"{hole.out_of_round * 1e3:.2f}",
        ]
        for cut in cuts
        if (hole := cut.as_run.hole) is not None
    ]
    if rows:
        columns = ["hole", "drawn mm", "executed mm", "change mm", "out of round mm"]
        table(columns, rows, numbers=columns[1:])


def _show_compensation(cuts: Sequence[CutResult]) -> None:
    """Print how far targets are moved, and what that gives."""
    found = [(cut.name, each) for cut in cuts if (each := cut.as_run.compensation) is not None]
    rows = [
        [
            escape(name),
            f"{each.before * 1e3:.3f}",
            f"{each.rest * 1e3:.3f}",
            f"{each.largest * 1e3:.3f}",
        ]
        for name, each in found
        if not each.failure
    ]
    if rows:
        columns = ["compensated", "off mm as drawn", "off mm", "targets moved mm"]
        table(columns, rows, numbers=columns[1:])


def _response_of(cuts: Sequence[CutResult]) -> str:
    """Return by which model the joints follow what is commanded."""
    found = {o.response.words for c in cuts if (o := c.as_run.path_error) is not None}
    return f"by {' and '.join(sorted(found))}" if found else "where the motion is modelled"


def _postures(plan: Plan) -> str:
    """Return the names of the postures of a plan, in the order in which it takes them."""
    first = np.flatnonzero(np.diff(plan.posture, prepend=-1))
    return " > ".join(posture_name(int(p)) for p in plan.posture[first])


def _is_unbound(cut: CutResult) -> bool:
    """Return whether a bound was asked for but none could be proved."""
    plan = cut.plan
    return plan is not None and plan.settings.certify is not None and plan.proof.bound is None


def _sampling(cut: CutResult) -> list[str]:
    """Return the chord error and the axis step of a cut's nodes."""
    found = cut.departure
    if found is None:
        return ["-", "-"]
    mark = "*" if found.path is not None else ""
    return [f"{found.chord_error * 1e3:.4f}{mark}", f"{np.degrees(found.axis_step):.2f}"]
