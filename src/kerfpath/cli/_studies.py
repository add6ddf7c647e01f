"""Commands that plan many times: each keeps what it has done, and goes on from there."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from kerfpath.cli._main import JobArgument, Json, Out, Strict, app
from kerfpath.errors import InputError

__all__ = ["batch", "layout", "pareto"]

Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", help="Dask scheduler whose workers do it: tcp://10.0.0.1:8786."
    ),
]
Processes = Annotated[
    int | None, typer.Option(help="Processes of this machine that do it; default: one per core.")
]
Seed = Annotated[int, typer.Option(help="Of all that is random.")]


@app.command()
def pareto(
    job: JobArgument,
    to: Out = None,
    contour: Annotated[
        str | None, typer.Option(help="Name of the contour in the job; default: the longest.")
    ] = None,
    criteria: Annotated[
        str, typer.Option(help="What to compare plans by, names with commas between.")
    ] = "displacement,velocity,range",
    runs: Annotated[int, typer.Option(help="How often to plan.")] = 100,
    search: Annotated[
        Literal["adaptive", "grid"],
        typer.Option(help="Where the front is sparse, or over a grid of weights."),
    ] = "adaptive",
    seed: Seed = 0,
    ahead: Annotated[
        int, typer.Option(help="Runs under way at a time; a cluster wants as many as workers.")
    ] = 8,
    pick: Annotated[
        str | None,
        typer.Option(
            metavar="N|NAME",
            help="Write plan N of the front that is there, the balanced one, or the best in NAME.",
        ),
    ] = None,
    refine: Annotated[
        bool, typer.Option("--refine", help="Move the picked plan off the grid of gamma.")
    ] = False,
    strict: Strict = False,
    scheduler: Scheduler = None,
    processes: Processes = None,
    as_json: Json = False,
) -> None:
    """Find plans of a contour that weigh its criteria differently, none better than another in all.

    Criteria: displacement, range, velocity, acceleration, speed, time (from home_deg in
    [sequence]), clearance (in the cell), wrist, elbow, shoulder, limits, manipulability,
    and displacement_J, increment_J, range_J of joint J. Every plan is the proved optimum of its
    run on the grid, and audited. pareto.json and pareto.html go to the folder JOB-pareto beside
    you unless --out names another. Stopped, even by kill -9, the same command goes on.

    Example: kerfpath pareto door.toml --criteria displacement,velocity,range_6 --runs 200

    With --pick nothing is searched: the whole job is planned, that contour as picked, and plan,
    report and program go to the folder plan-N in there.

    Example: kerfpath pareto door.toml --pick balanced
    """
    from kerfpath.cli._pareto import pick_plan, show_front

    folder = to or Path(f"{job.stem}-pareto")
    if pick is not None:
        pick_plan(job, folder, pick, refine=refine, strict=strict, as_json=as_json)
        return
    if refine or strict:
        raise InputError("--refine and --strict: only with --pick, which writes a plan")
    names = [name.strip() for name in criteria.split(",")]
    show_front(
        job, folder, contour=contour, criteria=names, runs=runs, search=search, seed=seed,
        ahead=ahead, scheduler=scheduler, processes=processes, as_json=as_json,
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

    The files of door.toml go to the folder door in the one that --out names (kerfpath-batch). A job
    that is refused or has no plan gets its row with the reason, and the others go on.

    What is done is kept in batch.sqlite there: the same command again, after Ctrl-C or a power cut,
    plans only what is new or has changed, and writes what is missing. On a cluster every worker
    needs the job files at the same path, as on a shared disk.

    Exit codes: 0 every job has passed, 1 some has not, 2 the command itself was wrong.

    Example: kerfpath batch parts/*.toml --out cut

    Example: kerfpath batch /shared/parts/*.toml --out cut --scheduler tcp://10.0.0.1:8786
    """
    from kerfpath.cli._batch import plan_jobs

    if not plan_jobs(jobs, to or Path("kerfpath-batch"), scheduler, processes, as_json=as_json):
        raise typer.Exit(1)


@app.command()
def layout(
    job: JobArgument,
    to: Out = None,
    goal: Annotated[
        Literal["speed", "margin", "motion"] | None,
        typer.Option(help="What the best placement is best in; default: speed."),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=LOW:HIGH", help="What may vary and how far; may come often."),
    ] = None,
    evaluations: Annotated[
        int | None, typer.Option(help="How many placements to look at; default: 240.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Of all that is random; default: 0.")] = None,
    tolerance_mm: Annotated[
        float | None, typer.Option(help="What lengths may be off: the worst counts.")
    ] = None,
    tolerance_deg: Annotated[
        float | None, typer.Option(help="What angles may be off: the worst counts.")
    ] = None,
    map_points: Annotated[
        int | None, typer.Option(help="Points of the map each way, 0 for none; default: 15.")
    ] = None,
    robots: Annotated[
        bool,
        typer.Option("--robots", help="Move nothing: tell which robots can do the job, how fast."),
    ] = False,
    acceleration_ratio: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|nearest",
            help="With --robots: assume accelerations that the maker does not publish.",
        ),
    ] = None,
    scheduler: Scheduler = None,
    processes: Processes = None,
    as_json: Json = False,
) -> None:
    """Find where to put the part, or the robot, or how to turn the head, for a chosen goal.

    Goals: speed, the fastest constant speed of the slowest contour; margin, the least share of a
    fastest speed and the speed asked for; motion, the least total displacement of the joints at
    the speeds asked for. Placements that cannot cut every contour come after all that can.

    What may vary, as offsets in the robot base: x_mm, y_mm, z_mm, yaw_deg, tilt_x_deg, tilt_y_deg
    of the part with its fixtures; base_x_mm, base_y_mm, base_z_mm, base_yaw_deg of the robot's
    base; mount_deg, the turn of the head about the flange. Ranges are those of --vary, or else of
    the layout table of the job, or else x_mm and y_mm by 200 mm, yaw_deg by 30 deg either way.

    layout.json, layout.html and placed.toml, the job with its new numbers, go to the folder
    JOB-layout beside you unless --out names another. Stopped, even by kill -9, the same command
    goes on. Exit code 1: no placement is feasible, and why.

    Example: kerfpath layout door.toml

    Example: kerfpath layout door.toml --vary x_mm=-300:100 --vary yaw_deg=-45:45 --goal margin

    Example: kerfpath layout door.toml --tolerance-mm 2 --tolerance-deg 0.5

    Then: kerfpath plan door-layout/placed.toml

    With --robots nothing is moved: every robot of the library is put in the place of the job's own,
    and told are its reach, the fastest speed of each contour and the margin over what is asked,
    the best first, in robots.json and robots.html. Exit code 1: none does it as fast as asked.

    Example: kerfpath layout door.toml --robots --acceleration-ratio nearest
    """
    from kerfpath.cli._layout import LayoutOptions, show_layout
    from kerfpath.cli._robots_for import show_robots_for

    options = LayoutOptions(
        goal=goal, evaluations=evaluations, seed=seed, tolerance_mm=tolerance_mm,
        tolerance_deg=tolerance_deg, map_points=map_points,
    )  # fmt: skip
    folder = to or Path(f"{job.stem}-layout")
    if robots:
        if given := [*(["--vary"] if vary is not None else []), *options.given()]:
            raise InputError(f"--robots: nothing is moved with it; leave out {', '.join(given)}")
        found = show_robots_for(
            job, folder, scheduler=scheduler, processes=processes, ratio=acceleration_ratio,
            as_json=as_json,
        )  # fmt: skip
    elif acceleration_ratio is not None:
        raise InputError("--acceleration-ratio: only with --robots; else the job says it")
    else:
        found = show_layout(
            job, folder, vary=vary or [], options=options, scheduler=scheduler,
            processes=processes, as_json=as_json,
        )  # fmt: skip
    if not found:
        raise typer.Exit(1)
