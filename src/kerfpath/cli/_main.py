"""Arguments, summaries and exit codes: 0 done, 1 no feasible plan or failed audit, 2 bad input."""

from __future__ import annotations

import os
import sys
from dataclasses import asdict
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from kerfpath import __version__
from kerfpath.cli._show import busy, errors, out, print_json, progress_bars, table
from kerfpath.errors import AuditFailed, KerfpathError, NoFeasiblePath

__all__ = ["app", "main"]

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="Plan laser-cutting robots: from a CAD drawing to an audited robot program.\n\n"
    "Begin with [bold]kerfpath demo[/bold]: it plans the shipped part and writes everything. "
    "Then copy its job file, put in your part (see [bold]kerfpath contours[/bold]) and your robot "
    "(see [bold]kerfpath robots[/bold]), and run [bold]kerfpath plan[/bold].\n\n"
    "Exit codes: 0 done, 1 no feasible plan or failed audit, 2 bad input.",
)

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of tables.")]
Out = Annotated[
    Path | None, typer.Option("--out", help="Folder for the files; made if it is not there.")
]
PlanFileArgument = Annotated[Path, typer.Argument(metavar="PLAN.json", help="A plan, as written.")]


def main() -> None:
    """Run the command line and leave with its exit code."""
    try:
        app()
    except (NoFeasiblePath, AuditFailed) as error:
        errors.print(f"kerfpath: {escape(str(error))}")
        sys.exit(1)
    except KerfpathError as error:
        errors.print(f"[bold red]kerfpath: error:[/] {escape(str(error))}")
        sys.exit(2)
    except BrokenPipeError:
        # The reader of a pipe has gone, as in `kerfpath robots | head`; leave stdout unflushed.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)


def _version(asked: bool) -> None:
    if asked:
        out.print(f"kerfpath {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


@app.command()
def demo(to: Out = None, as_json: Json = False) -> None:
    """Plan the shipped B-pillar from its STEP file to an audited ABB program.

    Example: kerfpath demo --out my-demo
    """
    with as_file(files("kerfpath").joinpath("demo")) as folder:
        _plan(folder / "b_pillar.toml", to or Path("kerfpath-demo"), as_json)


@app.command()
def plan(
    job: Annotated[Path, typer.Argument(metavar="JOB.toml", help="The job file.")],
    to: Out = None,
    as_json: Json = False,
) -> None:
    """Plan and audit every contour of a job; write plan, trajectory, report and program.

    The files go to the folder JOB-plan beside you unless --out names another. No program is
    written unless every contour has a plan that passes its audit.

    Example: kerfpath plan door.toml --out door
    """
    _plan(job, to or Path(f"{job.stem}-plan"), as_json)


def _plan(job_file: Path, folder: Path, as_json: bool) -> None:
    from kerfpath.job import read_job, require_folder, run_job, warm_up, write_outcome

    require_folder(folder)
    job = read_job(job_file)
    with busy("compiling the kernels, first run only"):
        warm_up()
    with progress_bars() as progress:
        outcome = run_job(job, progress=progress)
    with busy("writing"):
        written = write_outcome(outcome, folder)
    if as_json:
        print_json(
            {
                "passed": outcome.passed,
                "contours": [_cut_entry(cut) for cut in outcome.cuts],
                "files": [str(f) for f in written.files],
                "notes": list(written.notes),
            }
        )
    else:
        _show_cuts(outcome.cuts)
        for cut in outcome.cuts:
            if cut.broken is not None:
                out.print(f"[bold]{escape(cut.task.name)}[/]: {escape(cut.failure)}")
            if cut.plan is not None and cut.plan.feed is not None:
                out.print(f"[bold]{escape(cut.task.name)}[/]: {cut.plan.feed}")
            for check in cut.checks:
                if not check.ok:
                    out.print(f"[bold]{escape(cut.task.name)}[/]: {escape(str(check.issue()))}")
        for note in written.notes:
            out.print(f"note: {escape(note)}")
        for path in written.files:
            out.print(f"wrote {escape(str(path))}")
    if written.stale is not None:
        errors.print(
            f"kerfpath: {escape(str(written.stale))} is from an earlier run and does not belong "
            "to this plan; no program was written"
        )
    if not outcome.passed:
        raise typer.Exit(1)


def _cut_entry(cut: Any) -> dict[str, Any]:
    entry: dict[str, Any] = {"name": cut.task.name, "passed": cut.passed}
    entry |= {"length_m": cut.drawn.length, "nodes": len(cut.nodes), "speed_m_s": cut.task.speed}
    if cut.plan is None:
        fastest = None if cut.fastest is None else cut.fastest.speed
        return entry | {
            "reason": cut.failure,
            "last_node_reached": cut.broken.node,
            "proved": cut.broken.proved,
            "fastest_speed_m_s": fastest,
        }
    criteria = cut.plan.criteria
    return entry | {
        "time_s": float(cut.plan.time[-1]),
        "cost": cut.plan.cost,
        "grid_cost": cut.plan.proof.grid_cost,
        "optimal": cut.plan.proof.optimal,
        "feed": None if cut.plan.feed is None else asdict(cut.plan.feed),
        "peak_velocity_share": float(criteria.peak_velocity.max()),
        "peak_acceleration_share": float(criteria.peak_acceleration.max()),
        "issues": [str(c.issue()) for c in cut.checks if not c.ok],
    }


def _show_cuts(cuts: Any) -> None:
    rows = []
    for cut in cuts:
        row = [
            escape(cut.task.name),
            f"{cut.drawn.length * 1000:.1f}",
            str(len(cut.nodes)),
            f"{cut.task.speed * 60:g}",
        ]
        if cut.plan is None:
            rows.append([*row, *"-----", "no feasible path"])
            continue
        criteria = cut.plan.criteria
        rows.append(
            [
                *row,
                f"{cut.plan.time[-1]:.2f}",
                "" if cut.plan.proof.grid_cost is None else f"{cut.plan.proof.grid_cost:.2f}",
                f"{cut.plan.cost:.2f}",
                f"{criteria.peak_velocity.max():.0%}",
                f"{criteria.peak_acceleration.max():.0%}",
                "passed" if cut.passed else "FAILED",
            ]
        )
    columns = ["contour", "mm", "nodes", "m/min", "s", "grid", "cost", "vel", "acc", "audit"]
    table(columns, rows, numbers=columns[1:-1])
    out.print(
        "cost: what is minimised; grid: the best on the gamma grid, before the refinement; "
        "vel, acc: highest share of a joint's velocity and acceleration limit"
    )


@app.command()
def speed(
    job: Annotated[Path, typer.Argument(metavar="JOB.toml", help="The job file.")],
    as_json: Json = False,
) -> None:
    """Find the fastest constant cutting speed of each contour, and what binds where.

    On the grid: exact on the graph that the job describes (its spacing, gamma step, limits and
    eta). Fastest: with gamma moved off the grid from there, if the job refines; what binds is said
    of that. The speeds that the job asks for play no part.

    Example: kerfpath speed door.toml
    """
    from kerfpath.cli._speed import show_speeds
    from kerfpath.job import fastest_speeds, read_job, warm_up

    read = read_job(job)
    with busy("compiling the kernels, first run only"):
        warm_up()
    with progress_bars("contours") as progress:
        answers = fastest_speeds(read, progress=progress)
    if not show_speeds(answers, as_json=as_json):
        raise typer.Exit(1)


@app.command()
def post(
    plan_file: PlanFileArgument,
    language: Annotated[str, typer.Option(help="Robot language; known: rapid.")] = "rapid",
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="File to write; default: print it.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Write the robot program of a plan, after auditing it again.

    Options such as names, retract and zone are taken from the [program] table of the job that
    the plan was made from.

    Example: kerfpath post door/plan.json --language rapid -o door.mod
    """
    from kerfpath.job import program_from_file
    from kerfpath.post import write_program

    text, warnings = program_from_file(plan_file, language)
    if output is not None:
        write_program(output, text)
    if as_json:
        print_json(
            {
                "language": language,
                "file": None if output is None else str(output),
                "text": text if output is None else None,
                "notes": warnings,
            }
        )
    elif output is None:
        print(text, end="")
    else:
        for warning in warnings:
            out.print(f"note: {escape(warning)}")
        out.print(f"wrote {escape(str(output))}")


@app.command()
def audit(
    plan_file: PlanFileArgument,
    job: Annotated[
        Path | None,
        typer.Option(metavar="JOB.toml", help="Compare with the drawing that this job names."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Check a plan again, by kinematics that share nothing with the planner.

    Without --job the way between nodes is compared with the straight lines between them; with it,
    with the curve as drawn.

    Example: kerfpath audit door/plan.json --job door.toml
    """
    from kerfpath.auditor import in_words
    from kerfpath.job import audit_file

    tables, missing = audit_file(plan_file, job)
    passed = not missing and all(
        check.ok or check.level == "warning" for checks in tables.values() for check in checks
    )
    if as_json:
        print_json(
            {
                "passed": passed,
                "missing": list(missing),
                "contours": {
                    name: [asdict(c) | {"ok": c.ok} for c in checks]
                    for name, checks in tables.items()
                },
            }
        )
    else:
        for name, checks in tables.items():
            rows = [
                [
                    escape(c.title),
                    in_words(c.value, c.unit),
                    in_words(c.limit, c.unit),
                    str(c.node),
                    "ok" if c.ok else c.level.upper(),
                ]
                for c in checks
            ]
            table(
                ["check", "worst", "allowed", "node", ""],
                rows,
                title=escape(name),
                numbers=["worst", "allowed", "node"],
            )
        for name in missing:
            out.print(f"{escape(name)}: no plan")
        out.print("audit passed" if passed else "audit FAILED")
    if not passed:
        raise typer.Exit(1)


@app.command()
def contours(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A STEP file.")],
    unit: Annotated[
        str | None, typer.Option(help="Length unit, if the file's header is wrong: mm, cm, m, in.")
    ] = None,
    as_json: Json = False,
) -> None:
    """List the loops of a CAD file, by the names that jobs pick them by.

    Check the bounding box first: a wrong unit in the file's header shows there.

    Example: kerfpath contours door.step
    """
    from kerfpath.cad import read_step

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


@app.command()
def robots(
    name: Annotated[str | None, typer.Argument(help="Id of one robot; default: list all.")] = None,
    as_json: Json = False,
) -> None:
    """List the robots of the library, or show one with its limits and their sources.

    Example: kerfpath robots abb_irb4600_60_205
    """
    from kerfpath.cli._robots import list_robots, show_robot

    if name is None:
        list_robots(as_json=as_json)
    else:
        show_robot(name, as_json=as_json)
