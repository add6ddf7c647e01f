"""The commands for one job or file: their arguments, help and exit codes.

Exit codes are 0 for done, 1 for no feasible plan or a failed audit, 2 for bad input.
"""

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
    Path | None, typer.Option("--out", help="Folder for the files; the command makes it if needed.")
]
JobArgument = Annotated[Path, typer.Argument(metavar="JOB.toml", help="The job file.")]
Strict = Annotated[
    bool, typer.Option("--strict", help="Refuse a program where it would only be warned of.")
]
PlanFileArgument = Annotated[
    Path, typer.Argument(metavar="PLAN.json", help="The plan.json of a run.")
]


def run() -> None:
    """Run the command line and leave with its exit code."""
    try:
        app()
    except (NoFeasiblePath, AuditFailed) as error:
        errors.print(f"kerfpath: {escape(str(error))}")
        sys.exit(1)
    except KerfpathError as error:
        for line in (str(error), *getattr(error, "others", ())):
            errors.print(f"[bold red]kerfpath: error:[/] {escape(line)}")
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
        bool, typer.Option("--quiet", help="Show results, notes and errors, but no progress.")
    ] = False,
) -> None:
    if silent:
        quiet.set()
    else:
        quiet.clear()


@app.command()
def demo(to: Out = None, as_json: Json = False) -> None:
    """Plan the shipped B-pillar from its STEP file to an audited ABB program.

    The folder gets report.html (look at it first), plan.json, trajectory.csv and b_pillar.mod.

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
        bool,
        typer.Option("--map", help="Draw every pose, coloured by its clearance; needs a cell."),
    ] = False,
    strict: Strict = False,
    as_json: Json = False,
) -> None:
    """Plan and audit every contour of a job; write plan, trajectory, report and program.

    The files go to the folder JOB-plan in the current one unless --out names another. A program is
    written only if every contour has a plan that passes its audit, and not with language = "none".
    With a cell in the job the motions are clear of collisions along the contours.

    Example: kerfpath plan door.toml --out door
    """
    from kerfpath.cli._plan import plan_job

    plan_job(job, to or Path(f"{job.stem}-plan"), as_json=as_json, draw_map=draw_map, strict=strict)


@app.command()
def check(job: JobArgument, as_json: Json = False) -> None:
    """Read a job without planning it: the bodies and pairs of its cell, and how contours begin.

    Every fault that is known before planning is listed, with its key; the exit code is then 2.

    The column clear counts the poses at the first node that keep every near-miss distance; the
    column clearance has the least distance of the best of them, over the pairs that keep
    near_miss_mm.

    Example: kerfpath check door.toml
    """
    from kerfpath.cli._check import show_check
    from kerfpath.cli._drawing import drawing_of, show_drawing
    from kerfpath.job import check_job, prepare, read_job, require_foreseen

    read = read_job(job)
    part = drawing_of(read)
    if not as_json:
        show_drawing(part)
    compile_kernels()
    with busy("looking at the cell"):
        checked = check_job(read, part)
    show_check(checked, as_json=as_json)
    require_foreseen(prepare(read, part, checked.cell))


@app.command()
def speed(
    job: JobArgument,
    as_json: Json = False,
) -> None:
    """Find the fastest constant cutting speed of each contour, and what binds where.

    The column on the grid is exact on the graph that the job describes (its spacing, gamma step,
    limits and eta), and clear in its cell, if it has one. The column refined has the speed with
    gamma moved off the grid from there, if the job refines; what binds belongs to that
    speed. The speeds in the job play no part.

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
            "own; default: that of the job."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="File to write, or folder for a program of several files; default: print it.",
        ),
    ] = None,
    job: Annotated[
        Path | None,
        typer.Option(
            metavar="JOB.toml",
            help="Job to take [program] from, and whose cell the audit looks at.",
        ),
    ] = None,
    strict: Strict = False,
    dry_share: Annotated[
        float | None,
        typer.Option(
            "--dry-run",
            metavar="SHARE",
            help="Write a dry run: no outputs, no waits, this share of the speed.",
        ),
    ] = None,
    measured: Annotated[
        Path | None,
        typer.Option(
            metavar="POINTS.csv", help="Move the plan to the part as measured, and audit it there."
        ),
    ] = None,
    residual_mm: Annotated[
        float, typer.Option(help="Largest distance of a measured point from the fitted placement.")
    ] = 0.5,
    as_json: Json = False,
) -> None:
    """Write the robot program of a plan, after auditing it again.

    Names, retract, zone and so on come from the table [program] of the job that the plan was made
    from, or of --job; its table [program.LANGUAGE] has the settings of a language.

    Example: kerfpath post door/plan.json --language rapid -o door.mod

    A table of measured points has columns nominal_x_mm, nominal_y_mm, nominal_z_mm (in the part)
    and measured_x_mm, measured_y_mm, measured_z_mm (in the robot base), and at least three rows.
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
        Path, typer.Argument(metavar="PLAN.json|PROGRAM", help="A plan, or a kerfpath program.")
    ],
    job: Annotated[
        Path | None,
        typer.Option(metavar="JOB.toml", help="Job to compare with; a program needs it."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Check a plan or a program again, by kinematics that share nothing with the planner.

    A plan is compared with its job, drawing and cell where --job names them. Without --job the
    path between the nodes is compared with the straight lines between them.

    A program needs its job. The audit reads its text, also where a person has edited it, takes
    the targets through the robot's kinematics and checks the motion as that of a plan; it compares
    frames, speeds, postures, turns, switches and waits with those of the job.

    Example: kerfpath audit door/plan.json --job door.toml

    Example: kerfpath audit door/door.mod --job door.toml
    """
    from kerfpath.cli._audit import show_audit

    if not show_audit(file, job, as_json=as_json):
        raise typer.Exit(1)


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="A kerfpath program.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="Another one, or the same edited.")],
    job: Annotated[Path, typer.Option(metavar="JOB.toml", help="The job of both programs.")],
    as_json: Json = False,
) -> None:
    """Say in words what differs between two programs, in the same language or in two.

    Contours are matched by their paths, targets by their places. Each kind of difference has a
    line with its count, the largest one, file and line. Exit code 0: the same, 1: not.

    Example: kerfpath compare door/door.mod edited.mod --job door.toml
    """
    from kerfpath.cli._compare import show_differences

    if not show_differences(a, b, job, as_json=as_json):
        raise typer.Exit(1)


@app.command()
def touch_up(
    program: Annotated[
        Path, typer.Argument(metavar="PROGRAM", help="A program with moved targets.")
    ],
    job: Annotated[Path, typer.Option(metavar="JOB.toml", help="The job of the program.")],
    plan: Annotated[Path, typer.Option(metavar="PLAN.json", help="The plan of the program.")],
    to: Out = None,
    ease_mm: Annotated[
        float, typer.Option(help="Distance along the path over which a shift fades to zero.")
    ] = 10.0,
    as_json: Json = False,
) -> None:
    """Plan a job again around the targets that a person has moved in its program.

    Moved targets keep tip and tool axis as taught, and the path fades back to the planned one; the
    rotation about the beam is planned again, in the posture of the plan. The files are those of
    kerfpath plan and go to the folder PROGRAM-touched in the current one unless --out names
    another; the audit is that of the touched-up path.

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
        typer.Option(help="Length unit, if the file has none or a wrong one: mm, cm, m, in."),
    ] = None,
    gap_mm: Annotated[
        float, typer.Option(help="Largest distance between two ends that a loop bridges, mm.")
    ] = 0.05,
    outer_towards: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            help="Where the outer sides of sheets face, in the part. Default: the side that "
            "lies less deep in the part; of a flat sheet the one that faces up."
        ),
    ] = None,
    axis: Annotated[
        tuple[float, float, float] | None,
        typer.Option(help="Tool axis of lines in space, and of points that have none."),
    ] = None,
    columns: Annotated[
        str | None,
        typer.Option(help='Columns of a table: x,y,z,-,nx,... in order, or x=NAME,"y=A, B",...'),
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(help="HTML page to write: the part with its loops by name."),
    ] = None,
    everything: Annotated[
        bool,
        typer.Option("--all", help="List loops of single faces of skins and of cut edges, too."),
    ] = False,
    as_json: Json = False,
) -> None:
    """List the loops of a drawing, by the names that jobs pick them by.

    Check the bounding box first: it shows a wrong unit in the file's header. A job takes a loop by
    pick = "NAME" in its table [[contour]].

    Example: kerfpath contours door.step --html door.html
    """
    from kerfpath.cli._contours import list_contours
    from kerfpath.cli._drawing import drawing_in

    part = drawing_in(
        file,
        unit=unit,
        gap=gap_mm / 1000,
        outer_towards=outer_towards,
        axis=axis,
        columns=columns,
    )
    list_contours(part, html, everything=everything, as_json=as_json)


@app.command()
def robots(
    name: Annotated[
        str | None, typer.Argument(help="Id of one robot; default: all robots.")
    ] = None,
    as_json: Json = False,
) -> None:
    """List the robots of the library, or show one with its limits and their sources.

    A job takes a robot by model = "ID" in its table [robot].

    Example: kerfpath robots abb_irb4600_60_205
    """
    from kerfpath.cli._robots import list_robots, show_robot

    if name is None:
        list_robots(as_json=as_json)
    else:
        show_robot(name, as_json=as_json)
