"""The commands that plan many times: each keeps its results and continues from them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from kerfpath.cli.app import JobArgument, Json, Out, Strict, app
from kerfpath.errors import InputError

Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", help="Dask scheduler whose workers do the work: tcp://10.0.0.1:8786."
    ),
]
Processes = Annotated[
    int | None, typer.Option(help="Local processes that do the work; default: one per core.")
]
Seed = Annotated[int, typer.Option(help="Seed of all random choices.")]


@app.command()
def pareto(
    job: JobArgument,
    to: Out = None,
    contour: Annotated[
        str | None, typer.Option(help="Name of the contour in the job; default: the longest.")
    ] = None,
    criteria: Annotated[
        str, typer.Option(help="Criteria to compare plans by, with commas between.")
    ] = "displacement,velocity,range",
    runs: Annotated[int, typer.Option(help="Number of runs: how often to plan.")] = 100,
    search: Annotated[
        Literal["adaptive", "grid"],
        typer.Option(help="Choose runs where the front is sparse, or from a grid of weights."),
    ] = "adaptive",
    seed: Seed = 0,
    ahead: Annotated[
        int, typer.Option(help="Runs under way at a time; on a cluster as many as workers.")
    ] = 8,
    pick: Annotated[
        str | None,
        typer.Option(
            metavar="N|NAME",
            help="Write plan N of the front found before, the balanced one, or the best in NAME.",
        ),
    ] = None,
    refine: Annotated[
        bool,
        typer.Option(
            "--refine", help="Refine a picked plan of the grid: move its rotation off the grid."
        ),
    ] = False,
    strict: Strict = False,
    scheduler: Scheduler = None,
    processes: Processes = None,
    as_json: Json = False,
) -> None:
    """Find plans of a contour with different trade-offs, none better than another in all criteria.

    The criteria are displacement, range, velocity, acceleration, speed, time (from home_deg in
    [sequence]), rotation (about the beam), clearance (in the cell), wrist, elbow, shoulder, limits,
    manipulability, and displacement_J, increment_J, range_J of joint J. Every second run is over
    continuous rotation; the others find the proved optimum on its grid, as all runs do with
    method = "exact". Every plan is audited. pareto.json and pareto.html go to the folder JOB-pareto
    unless --out names another. After a stop, even kill -9, the same command continues.

    Example: kerfpath pareto door.toml --criteria displacement,velocity,range_6 --runs 200

    With --pick nothing is searched: the whole job is planned with the picked plan of that contour,
    and plan, report and program go to the folder plan-N in that folder.

    Example: kerfpath pareto door.toml --pick balanced
    """
    from kerfpath.cli.study_output import pick_plan, show_front

    folder = to or Path(f"{job.stem}-pareto")
    if pick is not None:
        pick_plan(job, folder, pick, refine=refine, strict=strict)
        return
    if refine or strict:
        raise InputError("--refine and --strict: only with --pick, which writes a plan")
    names = [name.strip() for name in criteria.split(",")]
    show_front(
        job, folder, contour=contour, criteria=names, runs=runs, search=search, seed=seed,
        ahead=ahead, scheduler=scheduler, processes=processes,
    )  # fmt: skip


@app.command()
def batch(
    jobs: Annotated[list[Path], typer.Argument(metavar="JOB.toml", help="The job files.")],
    to: Out = None,
    scheduler: Scheduler = None,
    processes: Processes = None,
    as_json: Json = False,
) -> None:
    """Plan, audit and write many jobs, each as `kerfpath plan` does, on all cores or a cluster.

    The files of door.toml go to the folder door in the one that --out names (kerfpath-batch). If a
    job is refused or has no plan, its row has the reason, and the other jobs continue.

    Results are kept in batch.sqlite there: the same command after Ctrl-C or a power cut plans only
    jobs that are new or have changed, and writes files that are missing. On a cluster every worker
    needs the job files at the same path, as on a shared disk.

    Exit codes: 0 every job has passed, 1 some job has not, 2 the command itself was wrong.

    Example: kerfpath batch parts/*.toml --out cut

    Example: kerfpath batch /shared/parts/*.toml --out cut --scheduler tcp://10.0.0.1:8786
    """
    from kerfpath.cli.study_output import plan_jobs

    if not plan_jobs(jobs, to or Path("kerfpath-batch"), scheduler, processes):
        raise typer.Exit(1)


@app.command()
def layout(
    job: JobArgument,
    to: Out = None,
    goal: Annotated[
        Literal["speed", "margin", "motion"] | None,
        typer.Option(help="Goal of the placement; default: speed."),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=LOW:HIGH", help="Variable and its range; repeat it for more variables."
        ),
    ] = None,
    evaluations: Annotated[
        int | None, typer.Option(help="Number of placements to try; default: 240.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of all random choices; default: 0.")
    ] = None,
    tolerance_mm: Annotated[
        float | None, typer.Option(help="Tolerance of lengths, over which the worst value counts.")
    ] = None,
    tolerance_deg: Annotated[
        float | None, typer.Option(help="Tolerance of angles, over which the worst value counts.")
    ] = None,
    map_points: Annotated[
        int | None, typer.Option(help="Points of the map per side, 0 for no map; default: 15.")
    ] = None,
    robots: Annotated[
        bool,
        typer.Option("--robots", help="Move nothing; list the robots that can do the job."),
    ] = False,
    acceleration_ratio: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|nearest",
            help="With --robots: accelerations to assume where the maker publishes none.",
        ),
    ] = None,
    scheduler: Scheduler = None,
    processes: Processes = None,
    as_json: Json = False,
) -> None:
    """Find where to put the part, or the robot, or how to turn the head, for a chosen goal.

    The goal speed is the fastest constant speed of the slowest contour; margin is the least ratio
    of a fastest speed to the speed in the job; motion is the least total displacement of the joints
    at the speeds in the job. Placements that cannot cut every contour come after all that can.

    An estimate over continuous rotation orders the placements. Those that come near the best are
    planned. Others are proved to be no faster, if that can be proved, or judged by their estimate
    alone; the command prints how many. With method = "exact" in the job everything is on its grid.

    The variables are offsets in the robot base: x_mm, y_mm, z_mm, yaw_deg, tilt_x_deg, tilt_y_deg
    of the part with its fixtures; base_x_mm, base_y_mm, base_z_mm, base_yaw_deg of the robot's
    base; mount_deg, the rotation of the head on the flange. Their ranges come from --vary, or else
    from the table [layout] of the job; by default x_mm and y_mm vary by 200 mm, yaw_deg by 30 deg.

    layout.json, layout.html and placed.toml, the job with its new numbers, go to the folder
    JOB-layout unless --out names another. After a stop, even kill -9, the same
    command continues. Exit code 1: no placement is feasible; the command prints why.

    Example: kerfpath layout door.toml

    Example: kerfpath layout door.toml --vary x_mm=-300:100 --vary yaw_deg=-45:45 --goal margin

    Example: kerfpath layout door.toml --tolerance-mm 2 --tolerance-deg 0.5

    Then: kerfpath plan door-layout/placed.toml

    With --robots nothing is moved; instead each robot of the library replaces that of the job.
    robots.json and robots.html list reach, fastest speed of each contour and margin over the speeds
    of the job, the best robot first. Exit code 1: no robot is as fast as the job asks.

    Example: kerfpath layout door.toml --robots --acceleration-ratio nearest
    """
    from kerfpath.cli.study_output import LayoutOptions, show_layout, show_robots_for

    options = LayoutOptions(
        goal=goal, evaluations=evaluations, seed=seed, tolerance_mm=tolerance_mm,
        tolerance_deg=tolerance_deg, map_points=map_points,
    )  # fmt: skip
    folder = to or Path(f"{job.stem}-layout")
    if robots:
        if given := [*(["--vary"] if vary is not None else []), *options.given()]:
            raise InputError(f"--robots moves nothing; remove {', '.join(given)}")
        found = show_robots_for(
            job, folder, scheduler=scheduler, processes=processes, ratio=acceleration_ratio,
        )  # fmt: skip
    elif acceleration_ratio is not None:
        raise InputError("--acceleration-ratio: only with --robots; else set it in the job")
    else:
        found = show_layout(
            job, folder, vary=vary or [], options=options, scheduler=scheduler,
            processes=processes,
        )  # fmt: skip
    if not found:
        raise typer.Exit(1)


@app.command()
def studio(
    job: Annotated[
        Path | None,
        typer.Argument(
            metavar="[JOB.toml|DRAWING]",
            help="The job, or a drawing; default: a copy of the demo's.",
        ),
    ] = None,
    port: Annotated[
        int, typer.Option(help="Port to listen at; 0: any free port.", min=0, max=65535)
    ] = 8087,
    host: Annotated[
        str,
        typer.Option(
            help="Address to listen at. The page opens only with the token in the printed "
            "address. If other machines can reach it, what is sent can be read on the way."
        ),
    ] = "127.0.0.1",
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the browser.")
    ] = True,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json",
            help="Print job, address and version as one JSON object, and stop once standard input "
            "ends: for programs that start the studio, such as FreeCAD.",
        ),
    ] = False,
) -> None:
    """See a job in the browser, change it, watch it cut, and export it.

    The plan follows every change. Changes are kept in JOB.studio.toml beside the job until they are
    saved to it; the same command finds them again. For a drawing a job is written beside it, under
    its name, unless there is one. Without either, the shipped job is copied to the folder
    kerfpath-studio.

    Example: kerfpath studio door.toml
    """
    from kerfpath.cli.studio import open_studio

    open_studio(job, host=host, port=port, browser=browser, for_program=as_json)
