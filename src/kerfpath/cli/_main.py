"""Arguments, summaries and exit codes: 0 done, 1 no feasible plan or failed audit, 2 bad input."""

from __future__ import annotations

import os
import sys
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from kerfpath import __version__
from kerfpath.cli._show import busy, compile_kernels, errors, out, progress_bars, quiet
from kerfpath.errors import AuditFailed, KerfpathError, NoFeasiblePath

__all__ = ["app", "run"]

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="Plan laser-cutting robots: from a CAD drawing to an audited robot program.\n\n"
    "Begin with **kerfpath demo**: it plans the shipped part and writes everything. "
    "Then copy its job file, put in your part (see **kerfpath contours**) and your robot "
    "(see **kerfpath robots**), and run **kerfpath plan**.\n\n"
    "Exit codes: 0 done, 1 no feasible plan or failed audit, 2 bad input.",
)

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of tables.")]
Out = Annotated[
    Path | None, typer.Option("--out", help="Folder for the files; made if it is not there.")
]
JobArgument = Annotated[Path, typer.Argument(metavar="JOB.toml", help="The job file.")]
Strict = Annotated[
    bool, typer.Option("--strict", help="Refuse programs that would only be warned of.")
]
PlanFileArgument = Annotated[Path, typer.Argument(metavar="PLAN.json", help="A plan, as written.")]


def run() -> None:
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
    silent: Annotated[
        bool, typer.Option("--quiet", help="Show no progress: results, notes and errors alone.")
    ] = False,
) -> None:
    if silent:
        quiet.set()
    else:
        quiet.clear()


@app.command()
def demo(to: Out = None, as_json: Json = False) -> None:
    """Plan the shipped B-pillar from its STEP file to an audited ABB program.

    Example: kerfpath demo --out my-demo
    """
    from kerfpath.cli._plan import plan_job

    with as_file(files("kerfpath").joinpath("demo")) as folder:
        plan_job(folder / "b_pillar.toml", to or Path("kerfpath-demo"), as_json=as_json)


@app.command()
def plan(
    job: JobArgument,
    to: Out = None,
    draw_map: Annotated[
        bool, typer.Option("--map", help="Draw every pose by its clearance; needs a cell.")
    ] = False,
    strict: Strict = False,
    as_json: Json = False,
) -> None:
    """Plan and audit every contour of a job; write plan, trajectory, report and program.

    The files go to the folder JOB-plan beside you unless --out names another. No program is
    written unless every contour has a plan that passes its audit, nor with language = "none".
    With a cell in the job the motions keep clear of collisions along the contours.

    Example: kerfpath plan door.toml --out door
    """
    from kerfpath.cli._plan import plan_job

    plan_job(job, to or Path(f"{job.stem}-plan"), as_json=as_json, draw_map=draw_map, strict=strict)


@app.command()
def check(job: JobArgument, as_json: Json = False) -> None:
    """Read a job without planning it: the bodies and pairs of its cell, and how contours begin.

    Clear: of the robot's poses at the first node, those that keep every near-miss distance.
    Clearance: of the best of them, its least distance among the pairs that keep near_miss_mm.

    Example: kerfpath check door.toml
    """
    from kerfpath.cli._check import show_check
    from kerfpath.cli._drawing import drawing_of, show_drawing
    from kerfpath.job import check_job, read_job

    read = read_job(job)
    part = drawing_of(read)
    if not as_json:
        show_drawing(part)
    compile_kernels()
    with busy("looking at the cell"):
        checked = check_job(read, part)
    show_check(checked, as_json=as_json)


@app.command()
def speed(
    job: JobArgument,
    as_json: Json = False,
) -> None:
    """Find the fastest constant cutting speed of each contour, and what binds where.

    On the grid: exact on the graph that the job describes (its spacing, gamma step, limits and
    eta), and clear in its cell, if it has one. Fastest: with gamma moved off the grid from there,
    if the job refines; what binds is said of that. The speeds that the job asks for play no part.

    Example: kerfpath speed door.toml
    """
    from kerfpath.cli._speed import show_speeds
    from kerfpath.job import fastest_speeds, read_job

    read = read_job(job)
    compile_kernels()
    with progress_bars("contours") as progress:
        answers = fastest_speeds(read, progress=progress)
    if not show_speeds(answers, as_json=as_json):
        raise typer.Exit(1)


@app.command()
def post(
    plan_file: PlanFileArgument,
    language: Annotated[
        str | None,
        typer.Option(
            help="Robot language: rapid, krl, fanuc, val3, inform, urscript, ros, csv, or your "
            "own; default: the one that the job asks for."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="File to write, or folder of a program of several files; default: print it.",
        ),
    ] = None,
    job: Annotated[
        Path | None,
        typer.Option(
            metavar="JOB.toml", help="Take [program] from this job, and audit in its cell."
        ),
    ] = None,
    strict: Strict = False,
    dry_share: Annotated[
        float | None,
        typer.Option(
            "--dry-run",
            metavar="SHARE",
            help="Switch nothing, wait nowhere, and move at this share of the speed.",
        ),
    ] = None,
    measured: Annotated[
        Path | None,
        typer.Option(
            metavar="POINTS.csv", help="Lead the plan to the part as measured, and audit it there."
        ),
    ] = None,
    residual_mm: Annotated[
        float, typer.Option(help="Most that a measured point may be off the fitted placement.")
    ] = 0.5,
    as_json: Json = False,
) -> None:
    """Write the robot program of a plan, after auditing it again.

    Options such as names, retract and zone are taken from the [program] table of the job that
    the plan was made from, or of --job: there, [program.LANGUAGE] has the settings of a language.

    Example: kerfpath post door/plan.json --language rapid -o door.mod

    A table of measured points has columns nominal_x_mm, nominal_y_mm, nominal_z_mm (in the part)
    and measured_x_mm, measured_y_mm, measured_z_mm (in the robot base), and three rows at least.
    Collisions are not checked again at the measured placement: its cell is not known.

    Example: kerfpath post door/plan.json --dry-run 0.2 -o dry_door.mod

    Example: kerfpath post door/plan.json --measured points.csv -o door.mod
    """
    from kerfpath.cli._post import write_post

    write_post(
        plan_file, language, output, strict=strict, as_json=as_json, job=job,
        dry_share=dry_share, measured=measured, residual_mm=residual_mm,
    )  # fmt: skip


@app.command()
def audit(
    file: Annotated[
        Path, typer.Argument(metavar="PLAN.json|PROGRAM", help="A plan, or a program of ours.")
    ],
    job: Annotated[
        Path | None,
        typer.Option(metavar="JOB.toml", help="Compare with the drawing that this job names."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Check a plan or a program again, by kinematics that share nothing with the planner.

    Of a plan, without --job the way between nodes is compared with the straight lines between
    them; with it, with the curve as drawn, and the motion with the cell of the job, if it has one.

    A program, also one that a person has edited since, needs its job: its text is read, its targets
    are led through the robot's kinematics, and the motion is audited as a plan's is; frames,
    speeds, postures, turns, switches and waits are compared with what the job asks for.

    Example: kerfpath audit door/plan.json --job door.toml

    Example: kerfpath audit door/door.mod --job door.toml
    """
    from kerfpath.cli._audit import show_audit

    if not show_audit(file, job, as_json=as_json):
        raise typer.Exit(1)


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="A program of ours.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="Another, or the same edited.")],
    job: Annotated[Path, typer.Option(metavar="JOB.toml", help="The job that they were made for.")],
    as_json: Json = False,
) -> None:
    """Say in words what differs between two programs, in the same language or in two.

    Contours are told apart by their paths, targets by their places; of each kind of difference the
    count and the largest is told, with file and line. Exit code 0: the same, 1: not.

    Example: kerfpath compare door/door.mod edited.mod --job door.toml
    """
    from kerfpath.cli._compare import show_differences

    if not show_differences(a, b, job, as_json=as_json):
        raise typer.Exit(1)


@app.command()
def touch_up(
    program: Annotated[
        Path, typer.Argument(metavar="PROGRAM", help="A program in which targets were moved.")
    ],
    job: Annotated[Path, typer.Option(metavar="JOB.toml", help="The job it was made for.")],
    plan: Annotated[Path, typer.Option(metavar="PLAN.json", help="The plan it was written from.")],
    to: Out = None,
    ease_mm: Annotated[
        float, typer.Option(help="Distance along the path over which a shift fades out.")
    ] = 10.0,
    as_json: Json = False,
) -> None:
    """Plan a job again around the targets that a person has moved in its program.

    Moved targets keep tip and tool axis as taught, and the path eases back to the planned one; the
    rotation about the beam is planned again, in the posture of the plan. The files, as of a plan,
    go to the folder PROGRAM-touched beside you unless --out names another; the audit is that of the
    touched-up path.

    Example: kerfpath touch-up edited.mod --job door.toml --plan door/plan.json --out door-2
    """
    from kerfpath.cli._touch_up import touch_up_program

    folder = to or Path(f"{program.stem}-touched")
    touch_up_program(program, job, plan, folder, ease_mm, as_json=as_json)


@app.command()
def contours(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="STEP, IGES, DXF, or a table of points (CSV).")
    ],
    unit: Annotated[
        str | None,
        typer.Option(help="Length unit, if the file says none or a wrong one: mm, cm, m, in."),
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(help="Page to write: the part with its loops by name."),
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Single faces of skins and cut edges of sheets too.")
    ] = False,
    as_json: Json = False,
) -> None:
    """List the loops of a drawing, by the names that jobs pick them by.

    Check the bounding box first: a wrong unit in the file's header shows there.

    Example: kerfpath contours door.step --html door.html
    """
    from kerfpath.cli._contours import list_contours

    list_contours(file, unit, html, everything=everything, as_json=as_json)


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
