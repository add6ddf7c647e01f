"""Output of the commands for programs: post, audit, compare, run, touch-up and script."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.markup import escape

from kerfpath.arrays import SHOWN_UNITS, counted
from kerfpath.auditor import format_value
from kerfpath.cad import read_measured
from kerfpath.cli.drawing_output import drawing_of
from kerfpath.cli.plan_output import finish_run
from kerfpath.cli.show import (
    busy,
    compile_kernels,
    errors,
    merge_notes,
    out,
    print_json,
    progress_bars,
    require_output,
    show_files,
    table,
    write_text,
)
from kerfpath.errors import InputError, KerfpathError, about
from kerfpath.execution import (
    CommandedRun,
    Correction,
    correct,
    correction_text,
    fit_response,
    read_log,
    response_text,
    smoothing,
)
from kerfpath.job import (
    AuditReport,
    ControllerRun,
    audit_file,
    compare_programs,
    prepare,
    program_from_file,
    program_language,
    programmed_plans,
    python_script,
    read_job,
    read_plan_file,
    require_folder,
    run_program,
    runs_of,
    touch_up,
)
from kerfpath.placement import MeasuredFrame, placement_from_points
from kerfpath.post import (
    FolderChanges,
    Language,
    identifier,
    languages,
    replace_program,
    write_files,
    write_program,
)
from kerfpath.post import language as find_language
from kerfpath.report import FittedCut, render_controller_run, render_fit
from kerfpath.robots import joint_identifiers

# -----------------------------------------------------------------------------
# `kerfpath post`: write or print the program of a plan.


def write_post(
    plan_file: Path, language: str | None, output: Path | None, *, strict: bool,
    job: Path | None = None, dry_share: float | None = None, measured: Path | None = None,
    residual_mm: float = 0.5,
) -> None:  # fmt: skip
    """Write the files of a plan's program to `output`; print them without one.

    If `output` has the suffix of the language, it names the program, and further files go beside
    it. Otherwise a program of one file is written as `output`, and one of several files into the
    folder `output`.
    """
    if output is not None and not output.is_dir() and (output.suffix or output.exists()):
        require_output(output, "-o")
    elif output is not None:
        require_folder(output)
    if language is None:
        source = read_plan_file(plan_file).job if job is None else read_job(job).source
        language = program_language(source, job or plan_file)
    frame = None
    frame_lines: list[str] = []
    # If the program is printed, nothing else goes to stdout.
    console = out if out.quiet or output is not None else errors
    if measured is not None:
        points = read_measured(measured)
        frame = placement_from_points(*points, most_residual=residual_mm / 1000)
        frame_lines = _frame_lines(frame, plan_file)
        for line in frame_lines:  # before the program, which may be refused
            console.print(line)
    name = _name(output, find_language(language))
    if name is not None and dry_share is not None:
        name = name.removeprefix("dry_")  # dry runs add this prefix themselves
    try:
        files, notes = program_from_file(
            plan_file, language, name=name, strict=strict, job_file=job, dry_share=dry_share,
            frame=frame,
        )  # fmt: skip
    except KerfpathError:
        for line in frame_lines if out.quiet else ():
            errors.print(line)
        raise
    written: list[Path] = []
    replaced: FolderChanges | None = None
    if output is not None and name is not None:
        main, *_ = files
        # FANUC names are in capitals; the file gets the name that was asked for.
        names = {main: output.name} if main.lower() == output.name.lower() else {}
        files = {names.get(k, k): t for k, t in files.items()}
        replaced = replace_program(output.parent, files, list(files), only=output.name)
        written = list(replaced.written)
    elif output is not None and (len(files) > 1 or output.is_dir()):
        replaced = replace_program(output, files, list(files), only=next(iter(files)))
        written = list(replaced.written)
    elif output is not None:
        write_program(output, next(iter(files.values())))
        written = [output]
    print_json(
        {
            "language": language,
            "files": [str(path) for path in written],
            "removed": [] if replaced is None else [str(p) for p in replaced.removed],
            "texts": None if written else files,
            "measured": None if frame is None else _frame_entry(frame),
            "notes": notes,
        }
    )
    if not written and not out.quiet:
        for name, text in files.items():
            if len(files) > 1:
                print(f"----- {name} -----")
            print(text, end="")
    for note in merge_notes(notes) if written or frame is not None else ():
        console.print(f"note: {escape(note)}")
    show_files(written, () if replaced is None else replaced.removed, of="the earlier program")


def _name(output: Path | None, chosen: Language) -> str | None:
    """Return the name of a program for a file with the suffix of its language, else None.

    Raises
    ------
    InputError
        The file has the suffix of another language, its folder does not exist, or its name is not
        possible for a program.
    """
    if output is None or output.is_dir():
        return None
    suffix = output.suffix.lower()
    if suffix != chosen.suffix.lower():
        others = [each.name for each in languages().values() if each.suffix.lower() == suffix]
        if others:
            raise InputError(
                f"{output}: expected a file that ends in {chosen.suffix}, as the program is in "
                f"{chosen.name}; rename it, or choose --language {others[0]}"
            )
        return None
    if not output.parent.is_dir():
        raise InputError(f"cannot write the program to {output}: {output.parent} is not a folder")
    if identifier(output.stem) != output.stem:
        raise InputError(
            f"{output}: expected a name of letters, digits and _, as the program gets the same "
            f"name, got {output.stem!r}"
        )
    return output.stem


def _frame_lines(frame: MeasuredFrame, plan_file: Path) -> list[str]:
    """Return the lines to print: residuals, distance from the planned placement, and frame."""
    residuals = ", ".join(f"{r * 1e3:.3f}" for r in frame.residuals)
    planned = read_plan_file(plan_file).plans[0].T_base_part
    shift, turn = frame.moved_from(planned)
    return [
        f"residuals of {len(frame.residuals)} points: {residuals} mm",
        f"the part is {shift * 1e3:.3f} mm and {np.degrees(turn):.4f} deg from its planned "
        "placement",
        f"keys for a job: xyz_mm = {escape(str(frame.xyz_mm))}, rpy_deg = "
        f"{escape(str(frame.rpy_deg))}",
    ]


def _frame_entry(frame: MeasuredFrame) -> dict[str, object]:
    return {
        "T_base_part": frame.T_base_part.tolist(),
        "residuals_m": frame.residuals.tolist(),
        "xyz_mm": frame.xyz_mm,
        "rpy_deg": frame.rpy_deg,
    }


# -----------------------------------------------------------------------------
# `kerfpath audit`: check every contour of a plan or a program again.


def show_audit(file: Path, job: Path | None) -> bool:
    """Print the table of checks of each contour of a file; return whether all of them pass."""
    found = _run_audit(file, job)
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
                text = f"{name}: {c.issue()}"
                if name in found.places:
                    text = found.sentence(name, c)
                out.print(escape(text), soft_wrap=True)
    for name in found.missing:
        out.print(f"{escape(name)}: {'not cut' if found.places else 'no plan'}")
    out.print(f"note: {escape(found.note)}")
    out.print("audit passed" if found.passed else "audit FAILED")
    return found.passed


def _run_audit(file: Path, job: Path | None) -> AuditReport:
    if file.suffix.lower() == ".json":
        with about(file):
            return audit_file(file, job)
    if file.suffix.lower() == ".toml":
        raise InputError(
            f"{file}: expected a plan.json or a program, got a job; plan it first: kerfpath plan "
            f"{file}"
        )
    if job is None:
        raise InputError(f"{file}: a program is compared with its job; give it with --job JOB.toml")
    with about(file), busy("auditing the program"):
        return audit_file(file, job)


# -----------------------------------------------------------------------------
# `kerfpath compare`: describe in words what differs between two programs.


def show_differences(a: Path, b: Path, job: Path) -> bool:
    """Print what differs between two programs; return whether they are the same."""
    with busy("comparing the programs"):
        found = compare_programs(a, b, job)
    same = not found.differences
    print_json(
        {
            "same": same,
            "differences": [asdict(each) for each in found.differences],
            "not_compared": list(found.not_compared),
        }
    )
    for each in found.differences:
        out.print(escape(str(each)), soft_wrap=True)
    if found.not_compared:
        out.print(f"note: not compared: {', '.join(found.not_compared)}")
    alike = "the same" if not found.not_compared else "the same in what was compared"
    out.print(alike if same else "not the same")
    return same


# -----------------------------------------------------------------------------
# `kerfpath run`: run a program on a controller, and show what it did.

RUN_COLUMNS = ("contour", "planned s", "foreseen s", "run s", "off path mm")


def show_run(program: Path, on: str, job: Path | None, folder: Path) -> bool:
    """Run a program, write its page, JSON and record, and return whether no check is an error."""
    require_folder(folder, ("run.html", "run.json", "record.csv"))
    with about(program), busy(f"running the program on {on}"):
        done = run_program(program, job, on=on)
    rows = [
        [
            c.name,
            f"{c.planned:.3f}",
            f"{c.foreseen:.3f}",
            f"{c.time:.3f}",
            f"{c.off_path * 1e3:.4f}",
        ]
        for c in done.contours
    ]
    entry = _run_entry(done, program, on)
    files = {
        "run.html": _run_page(done, program, rows),
        "run.json": json.dumps(entry, indent=1, allow_nan=False) + "\n",
        "record.csv": _record_text(done),
    }
    written = write_files(folder, files)
    print_json(entry | {"files": [str(path) for path in written]})
    table(
        RUN_COLUMNS, [[escape(row[0]), *row[1:]] for row in rows], numbers=RUN_COLUMNS[1:],
        whole=RUN_COLUMNS[:1],
    )  # fmt: skip
    table(
        ["check", "largest", "allowed", "verdict"],
        [
            [c.title, format_value(c.value, c.unit), format_value(c.limit, c.unit),
             "ok" if c.ok else c.level.upper()]
            for c in done.checks
        ],
        numbers=["largest", "allowed"],
        whole=["verdict"],
    )  # fmt: skip
    out.print(
        f"run on {on} with simulated joints: {done.time:.3f} s; foreseen {done.foreseen:.3f} s, "
        f"planned {done.planned:.3f} s"
    )
    show_files(written)
    return all(check.ok or check.level == "warning" for check in done.checks)


def _run_entry(done: ControllerRun, program: Path, on: str) -> dict[str, object]:
    """Return a run for JSON."""
    return {
        "program": str(program),
        "controller": on,
        "joints": "simulated",
        "planned_s": done.planned,
        "foreseen_s": done.foreseen,
        "run_s": done.time,
        "contours": [
            {
                "name": each.name,
                "planned_s": each.planned,
                "foreseen_s": each.foreseen,
                "run_s": each.time,
                "off_path_mm": each.off_path * 1e3,
            }
            for each in done.contours
        ],
        "laser": [
            {
                "place": each.place,
                "on": each.on,
                "late_ms": each.late * 1e3,
                "off_mm": each.off * 1e3,
            }
            for each in done.switches
        ],
        "velocity_share": dict(
            zip(done.robot.joint_names, done.velocity.max(axis=0).tolist(), strict=True)
        ),
        "acceleration_share": dict(
            zip(done.robot.joint_names, done.acceleration.max(axis=0).tolist(), strict=True)
        ),
        "checks": [
            {"code": c.code, "value": c.value, "limit": c.limit, "unit": c.unit, "ok": c.ok}
            for c in done.checks
        ],
    }


def _run_page(done: ControllerRun, program: Path, rows: list[list[str]]) -> str:
    units = ("", "s", "s", "s", "mm")
    heads = [
        (name.removesuffix(f" {unit}") if unit else name, unit)
        for name, unit in zip(RUN_COLUMNS, units, strict=True)
    ]
    checks = [
        (c.title, format_value(c.value, c.unit), format_value(c.limit, c.unit), c.ok,
         c.level == "error")
        for c in done.checks
    ]  # fmt: skip
    return render_controller_run(
        program.stem,
        done.robot,
        time=done.record.time,
        off_path=done.off_path,
        shares=(done.velocity, done.acceleration),
        laser=done.record.laser,
        heads=heads,
        rows=rows,
        checks=checks,
        facts=[
            ("Robot", f"{done.robot.model}, simulated joints"),
            ("Run", f"{done.time:.3f} s"),
            ("Foreseen", f"{done.foreseen:.3f} s"),
            ("Planned", f"{done.planned:.3f} s"),
        ],
    )


def _record_text(done: ControllerRun) -> str:
    """Return the record as CSV: time, joints, line of the program, outputs."""
    record, robot = done.record, done.robot
    shown = [SHOWN_UNITS[unit] for unit in robot.units]
    scale = [factor for factor, _ in shown]
    names = zip(joint_identifiers(robot), shown, strict=True)
    axes = [f"{name}_{unit}" for name, (_, unit) in names]
    lines = [",".join(["t_s", *axes, "line", "laser", "gas"])]
    columns = np.c_[record.time, record.q * scale, record.line, record.laser, record.gas]
    text = ",".join(["%.3f", *["%.6f"] * robot.joints, "%d", "%d", "%d"])
    lines += [text % tuple(row) for row in columns.tolist()]
    return "\n".join([*lines, ""])


# -----------------------------------------------------------------------------
# `kerfpath fit`: fit the response of the robot to logs.


def fit_to_logs(logs: Sequence[Path], job_file: Path, plan: Path, output: Path) -> None:
    """Fit the response of the robot to logs of a plan's program; write its file and a page."""
    page = output.with_suffix(".html")
    if page == output:
        raise InputError(f"{output}: expected the name of a TOML file; a page is written beside it")
    require_output(output, "-o")
    require_output(page, "-o")
    job = read_job(job_file)
    made = programmed_plans(job, read_plan_file(plan))
    runs = [CommandedRun.of(run) for run in runs_of(job, made, f"{plan}")]
    read = [read_log(log, job.robot, job.tool) for log in logs]
    with busy("fitting the response"):
        fit = fit_response(runs, read)
    best = fit.tried[fit.chosen]
    notes = [
        f"{best.form}, fitted to {', '.join(sorted({e.log.name for e in fit.stretches}))[:150]}",
        f"held-out distance of the logs from the executed path: {_three(best.held_out)} mm",
    ]
    text = response_text(fit.response, notes)
    print_json(
        {
            "tried": [
                {
                    "form": each.form,
                    "sigma_ms": (each.response.sigma * 1e3).tolist(),
                    "friction_urad": each.response.friction * 1e6,
                    "own_m": each.own,
                    "held_out_m": each.held_out,
                }
                for each in fit.tried
            ],
            "chosen": best.form,
            "joints_not_told": [joint + 1 for joint in fit.untold],
            "unused_logs": list(fit.unused),
            "files": [str(output), str(page)],
        }
    )
    rows = [
        [
            f"{each.form}{' *' * (each is best)}",
            ", ".join(f"{sigma * 1e3:.3g}" for sigma in each.response.sigma),
            _three(each.own),
            _three(each.held_out),
        ]
        for each in fit.tried
    ]
    table(["form", "sigma ms", "fitted to all, mm", "held out, mm"], rows)
    cuts = {runs[each.run].name for each in fit.stretches}
    caption = (
        "mean / 95 % / largest distance of the logs from the executed path; held out: leaving out "
        f"{fit.left_out}; *: taken. Compared: {counted(len(fit.stretches), 'logged run')} of "
        f"{counted(len(cuts), 'cut')}"
    )
    out.print(caption)
    doubts = list[str]()
    if fit.untold:
        joints = ", ".join(str(joint + 1) for joint in fit.untold)
        doubts.append(
            f"the runs cannot tell sigma of joint {joints}, which moves too little or too slowly; "
            "it has that of all joints"
        )
    doubts += [f"{name} follows no cut of the program and was not used" for name in fit.unused]
    for doubt in doubts:
        out.print(f"note: {escape(doubt)}")
    write_text(output, text, "-o")
    compared = zip(fit.stretches, fit.without, fit.left, strict=True)
    shown = render_fit(
        output.stem,
        [FittedCut(f"{runs[e.run].name}, {e.log.name}", e.s, *off) for e, *off in compared],
        heads=[("Form", ""), ("Sigma", "ms"), ("Fitted to all", "mm"), ("Held out", "mm")],
        rows=rows,
        caption=f"{caption[0].upper()}{caption[1:]}.",
        facts=[("Robot", job.robot.model), ("Response", fit.response.words)],
        notes=doubts,
    )
    write_text(page, shown, "-o")


def _three(off: tuple[float, float, float]) -> str:
    return " / ".join(f"{each * 1e3:.3f}" for each in off)


# -----------------------------------------------------------------------------
# `kerfpath correct`: move targets by what a measured run misses.


def correct_by_logs(
    logs: Sequence[Path], job_file: Path, plan: Path, gain: float, output: Path
) -> None:
    """Correct the targets of a plan's program by logs of its run, and write the file of that."""
    require_output(output, "-o")
    if not 0 < gain <= 1:
        raise InputError(f"--gain: expected a share above 0 and at most 1, got {gain:g}")
    job, file = read_job(job_file), read_plan_file(plan)
    made = programmed_plans(job, file)
    runs = runs_of(job, made, f"{plan}")
    names = [run.section for run in runs]
    cuts = [(p, now.contour.points - p.contour.points)
            for p, now in zip(file.plans, made, strict=True) if p.name in names]  # fmt: skip
    before = job.compensation if isinstance(job.compensation, Correction) else Correction()
    read = [read_log(log, job.robot, job.tool) for log in logs]
    with busy("comparing the logs with the drawing"):
        done = correct(
            cuts, [CommandedRun.of(run) for run in runs], read, before, gain=gain,
            width=smoothing(job.response),
        )  # fmt: skip
    print_json(
        {
            "contours": [
                {
                    "name": each.name,
                    "rounds": [one._asdict() for one in each.rounds],
                    "settled": each.settled,
                    "largest_displacement_m": each.largest,
                }
                for each in done.contours.values()
            ],
            "files": [str(output)],
        }
    )
    rows = []
    for each in done.contours.values():
        last = each.rounds[-1]
        numbers = (last.largest, last.mean, last.noise, each.largest)
        shown = [f"{value * 1e3:.3f}" for value in numbers]
        rows.append([escape(each.name), str(len(each.rounds)), *shown, each.words])
    columns = ["contour", "round", "off mm", "mean mm", "noise mm", "moved mm", "next"]
    table(columns, rows, numbers=columns[1:-1])
    out.print(
        "off: largest distance of the drawn nodes from the measured path, averaged as the "
        "correction is; noise: how far logs of it, or their points, scatter; moved: largest "
        "displacement of a target in the next program"
    )
    for name in names:
        if name not in done.contours:
            out.print(f"note: no log follows {escape(name)}, which stays as it was")
    write_text(output, correction_text(done), "-o")
    out.print(escape(f'write compensate = "{output}" in [program] for the next program'))


# -----------------------------------------------------------------------------
# `kerfpath touch-up`: plan a job again around targets that a person has moved.


def touch_up_program(program: Path, job: Path, plan: Path, folder: Path, ease_mm: float) -> None:
    """Plan a job again around the moved targets of a program, and print the result."""
    require_folder(folder)
    compile_kernels()
    with progress_bars() as progress:
        done = touch_up(program, plan, job, ease=ease_mm / 1000, progress=progress)
    more = {"targets": [asdict(each) for each in done.targets], "not_kept": list(done.notes)}
    more["renewed"] = list(done.renewed)
    for each in done.targets:
        out.print(
            f"{escape(each.place)}: {escape(each.contour)}, node {each.node}, moved by "
            f"{each.off * 1e3:.3f} mm, axis turned by {np.degrees(each.turned):.3f} deg"
        )
    for note in [*merge_notes(done.notes), *done.renewed]:
        out.print(f"note: {escape(note)}")
    finish_run(done.outcome, done.part, folder, more=more)


# -----------------------------------------------------------------------------
# `kerfpath script`: write a job as a Python script.


def write_script(path: Path, output: Path | None) -> None:
    """Write the script of a job to a file, or print it without one.

    Raises
    ------
    InputError
        The job cannot be prepared or written as a script, or the file cannot be written.
    """
    if output is not None:
        require_output(output, "-o")
    job = read_job(path)
    folder = None if output is None else output.absolute().parent
    text = python_script(prepare(job, drawing_of(job)), folder)
    if output is None:
        print(text, end="")
    else:
        write_text(output, text, "-o")
