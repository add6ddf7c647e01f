"""The commands for one job or file: their arguments, help and exit codes.

Exit codes are 0 for done, 1 for no feasible plan or a failed audit, 2 for bad input.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, Literal

import typer
from rich.markup import escape

from kerfpath import __version__
from kerfpath.cli.reading import ReadingOptions, reads_drawing
from kerfpath.cli.show import (
    busy,
    compile_kernels,
    errors,
    out,
    progress_bars,
    quiet,
    require_output,
)
from kerfpath.cli.surroundings import flush
from kerfpath.errors import AuditFailed, InputError, KerfpathError, NoFeasiblePath
from kerfpath.text import NOT_TEXT, named

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="Plan laser-cutting robots: from a CAD drawing to an audited robot program.\n\n"
    "Begin with **kerfpath demo**: it plans the shipped part and writes everything. "
    "Then write a first job for your part with **kerfpath new** part.step, change what it guesses "
    "(see **kerfpath contours** and **kerfpath robots**), and run **kerfpath plan**.\n\n"
    "Exit codes: 0 done, 1 no feasible plan or failed audit, 2 bad input; stopped by Ctrl-C 130, "
    "SIGTERM 143, SIGHUP 129.",
)


def _choose_json(asked: bool) -> None:
    out.quiet = asked


Json = Annotated[
    bool,
    typer.Option("--json", callback=_choose_json, help="Print one JSON object instead of tables."),
]
"""Silences `out`; `print_json` prints then."""
Out = Annotated[
    Path | None, typer.Option("--out", help="Folder for the files; the command makes it if needed.")
]
JobArgument = Annotated[Path, typer.Argument(metavar="JOB.toml", help="The job file.")]
Strict = Annotated[
    bool, typer.Option("--strict", help="Refuse a program that would only give a warning.")
]


def run() -> None:
    """Run the command line and exit with its exit code."""
    try:
        _require_text(*sys.argv[1:])
        try:
            app()
        finally:
            flush()
    except (NoFeasiblePath, AuditFailed) as error:
        errors.print(f"kerfpath: {escape(str(error))}")
        sys.exit(1)
    except KerfpathError as error:
        for line in (str(error), *getattr(error, "others", ())):
            errors.print(f"[bold red]kerfpath: error:[/] {escape(line)}")
        sys.exit(2)


def _require_text(*arguments: str) -> None:
    """Raise InputError for an argument, or a current folder, that is no text in UTF-8.

    Jobs, reports and programs name files in Unicode, and every command shows its arguments.
    """
    with suppress(OSError):  # the folder is gone
        arguments += (str(Path.cwd()),)
    for argument in arguments:
        if (found := NOT_TEXT.search(argument)) is not None:
            is_byte = "\udc80" <= found[0] <= "\udcff"
            got = "bytes that are not UTF-8" if is_byte else named(found[0])
            raise InputError(
                f"{argument}: expected text in UTF-8, got {got}; rename the file or folder"
            )


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
    out.quiet = False
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
    from kerfpath.cli.plan_output import plan_job

    with as_file(files("kerfpath").joinpath("demo")) as folder:
        plan_job(folder / "b_pillar.toml", to or Path("kerfpath-demo"))


@app.command()
@reads_drawing
def new(
    *,
    drawing: Annotated[
        Path,
        typer.Argument(metavar="PART", help="STEP, IGES, DXF, a mesh, points (CSV), or a path."),
    ],
    robot: Annotated[
        str | None,
        typer.Option(metavar="ID", help="Robot of the library; default: a placeholder to change."),
    ] = None,
    how: ReadingOptions,
    to: Annotated[
        Path | None,
        typer.Option("--out", metavar="JOB.toml", help="Job to write; default: PART.toml."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a first job for a drawing, with comments; what is guessed in it is marked.

    The job cuts the loops of the outer side, the 250 longest, or the open lines if there are no
    loops, at a guessed speed, with the beam from above and the part in front of the robot. A file
    that exists already is never overwritten.

    Example: kerfpath new door.step --robot kuka_kr30_ha
    """
    from kerfpath.cli.drawing_output import drawing_by, write_new

    write_new(drawing_by(drawing, how), to, robot=robot)


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

    The files go to the folder JOB-plan unless --out names another. The program is written only if
    every contour has a plan that passes its audit; with language = "none" there is no program.
    If the job has a cell, the motions along the contours are free of collisions.

    Ctrl-C ends the searches: what is planned by then is audited and written. A second one stops at
    once.

    Example: kerfpath plan door.toml --out door
    """
    from kerfpath.cli.plan_output import plan_job

    plan_job(job, to or Path(f"{job.stem}-plan"), draw_map=draw_map, strict=strict)


@app.command()
def check(job: JobArgument, as_json: Json = False) -> None:
    """Read a job without planning it; print its cell and the poses at the start of each contour.

    The command lists every fault that can be found before planning, with its key; the exit code is
    then 2.

    The column clear counts the poses at the first node that keep every near-miss distance. The
    column clearance is the least distance of the best of these poses, over the pairs that keep
    near_miss_mm.

    Example: kerfpath check door.toml
    """
    from kerfpath.cli.drawing_output import drawing_of, show_drawing
    from kerfpath.cli.plan_output import show_check
    from kerfpath.job import check_job, prepare, read_job, require_foreseen

    read = read_job(job)
    part = drawing_of(read)
    show_drawing(part)
    compile_kernels(read.robot.kinematics)
    with busy("checking the cell"):
        checked = check_job(read, part)
    show_check(checked)
    require_foreseen(prepare(read, part, checked.cell))


@app.command()
def speed(
    job: JobArgument,
    as_json: Json = False,
) -> None:
    """Find the fastest constant cutting speed of each contour, and the limit that binds.

    The column on the grid is exact on the graph that the job describes (its spacing, rotation step,
    limits and eta), and free of collisions in its cell, if it has one. The column refined has the
    speed after the rotation was moved off the grid, if the job refines; the limit shown belongs to
    that speed. Both keep the limits at the nodes. The column as run has a speed at which the
    program keeps them between the nodes, too, if the job asks for it, and the column true to path
    one at which the executed path is within path_tolerance_mm, as the joints lag. The speeds in the
    job have no effect.

    Example: kerfpath speed door.toml
    """
    from kerfpath.cli.plan_output import show_speeds
    from kerfpath.job import fastest_speeds, read_job

    read = read_job(job)
    compile_kernels(read.robot.kinematics)
    with progress_bars("contours") as progress:
        answers = fastest_speeds(read, progress=progress)
    if not show_speeds(answers):
        raise typer.Exit(1)


@app.command()
@reads_drawing
def contours(
    *,
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="STEP, IGES, DXF, a mesh, points (CSV), or a path."),
    ],
    how: ReadingOptions,
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
    """List the loops of a drawing by the names that jobs use.

    Check the bounding box first: it shows a wrong unit in the file's header. A job picks a loop
    with pick = "NAME" in a table [[contour]].

    Example: kerfpath contours door.step --html door.html
    """
    from kerfpath.cli.drawing_output import drawing_by, drawn, list_contours

    if html is not None:
        require_output(html, "--html")
    list_contours(drawn(drawing_by(file, how)), html, everything=everything)


@app.command()
def robots(
    name: Annotated[
        str | None, typer.Argument(help="Id of one robot, rail or positioner; default: all.")
    ] = None,
    urdf: Annotated[
        Path | None,
        typer.Option(help="Write the joints and limits of the robot as a description (URDF)."),
    ] = None,
    as_json: Json = False,
) -> None:
    """List the robots, rails and positioners of the library, or show one with limits and sources.

    A job uses a robot with model = "ID" in its table [robot], and an axis of a rail or positioner
    with model = "ID" in a table [[robot.external]].

    Example: kerfpath robots abb_irb4600_60_205
    """
    from kerfpath.cli.robots_output import list_robots, show_external, show_robot, write_urdf
    from kerfpath.robots import external_ids

    if urdf is not None:
        write_urdf(name, urdf)
    elif name is None:
        list_robots()
    elif name in external_ids():
        show_external(name)
    else:
        show_robot(name)


@app.command()
def charts(
    action: Annotated[
        Literal["list", "show", "check", "convert"],
        typer.Argument(help="What to do with cut charts."),
    ],
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[CHART]...", help="Charts by path or name; files to convert."),
    ] = None,
    job: Annotated[
        Path | None,
        typer.Option(metavar="JOB.toml", help="With show: where each value of the job comes from."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="With convert: the chart to write; default: print it."),
    ] = None,
    columns: Annotated[
        list[str] | None,
        typer.Option(
            "--map",
            metavar="COLUMN=KEY",
            help="With convert: a column of a table and the key that it has, once for each.",
        ),
    ] = None,
    sheet: Annotated[
        str | None, typer.Option(help="With convert: the sheet of a spreadsheet with several.")
    ] = None,
    unit: Annotated[
        Literal["mm", "inch"] | None,
        typer.Option(help="With convert: unit of a QtPlasmaC file, which does not say it."),
    ] = None,
    material: Annotated[
        str | None, typer.Option(help="With convert: the material of rows that do not say it.")
    ] = None,
    thickness_mm: Annotated[
        float | None, typer.Option(help="With convert: the thickness of rows that do not say it.")
    ] = None,
    gas: Annotated[
        str | None, typer.Option(help="With convert: the gas of rows that do not say it.")
    ] = None,
    as_json: Json = False,
) -> None:
    """List, show, check or convert cut charts: speed, kerf, pierce and power by material.

    A job uses a chart with the table [process]. Files of QtPlasmaC (_material.cfg), tables (.csv,
    .xlsx, .xls, .ods) and LightBurn (.clb) are converted; what they lack is listed.

    Example: kerfpath charts show --job door.toml
    """
    from kerfpath.cli.charts_output import check_charts, convert, list_charts, show_charts, trace

    if action == "list":
        list_charts()
    elif action == "check":
        check_charts(names or ())
    elif action == "show" and job is not None:
        trace(job)
    elif action == "show":
        show_charts(names or ())
    else:
        if len(names or ()) != 1:
            raise InputError(f"charts convert: expected one file, got {len(names or ())}")
        convert(
            Path((names or [""])[0]),
            output,
            columns=columns or (),
            sheet=sheet,
            unit=unit,
            said={"material": material, "thickness_mm": thickness_mm, "gas": gas},
        )
