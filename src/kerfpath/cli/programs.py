"""The commands that write, audit, compare, run and touch up programs, or write a job's script."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from kerfpath.cli.app import JobArgument, Json, Out, Strict, app

PlanFileArgument = Annotated[
    Path, typer.Argument(metavar="PLAN.json", help="The plan.json of a run.")
]


@app.command()
def post(
    plan_file: PlanFileArgument,
    language: Annotated[
        str | None,
        typer.Option(
            help="Robot language: rapid, krl, fanuc, val3, inform, urscript, linuxcnc, ros, csv, "
            "or your own; default: that of the job."
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
            help="Job with the table [program] to use, and with the cell for the audit.",
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
            metavar="POINTS.csv", help="Move the plan to the measured part, and audit it there."
        ),
    ] = None,
    residual_mm: Annotated[
        float, typer.Option(help="Largest distance of a measured point from the fitted placement.")
    ] = 0.5,
    as_json: Json = False,
) -> None:
    """Write the robot program of a plan, after auditing it again.

    Names, retract, zone and so on come from the table [program] of the job from which the plan was
    made, or of --job. The table [program.LANGUAGE] has the settings of a language.

    Example: kerfpath post door/plan.json --language rapid -o door.mod

    A table of measured points has columns nominal_x_mm, nominal_y_mm, nominal_z_mm (in the part)
    and measured_x_mm, measured_y_mm, measured_z_mm (in the robot base), and at least three rows.
    Collisions are not checked again at the measured placement: its cell is not known.

    Example: kerfpath post door/plan.json --dry-run 0.2 -o dry_door.mod

    Example: kerfpath post door/plan.json --measured points.csv -o door.mod
    """
    from kerfpath.cli.program_output import write_post

    write_post(
        plan_file, language, output, strict=strict, job=job,
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
    """Check a plan or a program again, with kinematics that share nothing with the planner.

    With --job a plan is compared with its job, drawing and cell. Without --job the path between the
    nodes is compared with the straight lines between them.

    A program needs its job. The audit reads the text of the program, edited or not, computes the
    joints at its targets and checks the motion like that of a plan; it compares frames, speeds,
    postures, turns, switches and waits with those of the job.

    Example: kerfpath audit door/plan.json --job door.toml

    Example: kerfpath audit door/door.mod --job door.toml
    """
    from kerfpath.cli.program_output import show_audit

    if not show_audit(file, job):
        raise typer.Exit(1)


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="A kerfpath program.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="Another one, or an edited copy.")],
    job: Annotated[Path, typer.Option(metavar="JOB.toml", help="The job of both programs.")],
    as_json: Json = False,
) -> None:
    """Describe in words how two programs differ, in the same language or in two.

    Contours are matched by their paths, targets by their places. Each kind of difference has a
    line with its count, the largest one, file and line. Exit code 0: no difference, 1: some.

    Example: kerfpath compare door/door.mod edited.mod --job door.toml
    """
    from kerfpath.cli.program_output import show_differences

    if not show_differences(a, b, job):
        raise typer.Exit(1)


@app.command()
def fit(
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOG.csv...", help="Logs of the program's runs.")
    ],
    job: Annotated[Path, typer.Option(metavar="JOB.toml", help="The job of the program.")],
    plan: Annotated[
        Path | None,
        typer.Option(metavar="PLAN.json", help="Its plan; default: JOB-plan/plan.json."),
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write.")] = Path(
        "response.toml"
    ),
    as_json: Json = False,
) -> None:
    """Fit how the joints lag to logs of the robot, for the executed path of later plans.

    A log is a table (CSV) with a column of times (t_s or t_ms) and one for each joint (q1_deg, or
    q1_rad, and so on), or x_mm, y_mm and z_mm of the tracked tool tip in the robot base. Run the
    program as it was written, at full override. The logs are compared as paths, so delays, missing
    samples and times that jitter do not matter.

    Forms of the response with more and more parameters are fitted. The simplest is taken that is
    about as good as the best on what was left out of its fit. The file that is written is named by
    file in [robot.response] of a job; a page of the same name shows the distances, cut by cut.

    Example: kerfpath fit run1.csv run2.csv --job door.toml -o my_robot.toml
    """
    from kerfpath.cli.program_output import fit_to_logs

    fit_to_logs(logs, job, plan or Path(f"{job.stem}-plan") / "plan.json", output)


@app.command()
def correct(
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="MEASURED.csv...", help="Logs of the program's last run."),
    ],
    job: Annotated[Path, typer.Option(metavar="JOB.toml", help="The job of the program.")],
    plan: Annotated[
        Path | None,
        typer.Option(metavar="PLAN.json", help="Its plan; default: JOB-plan/plan.json."),
    ] = None,
    gain: Annotated[
        float, typer.Option(help="Share of what is missing by which targets are moved, up to 1.")
    ] = 0.8,
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write.")] = Path(
        "correction.json"
    ),
    as_json: Json = False,
) -> None:
    """Correct the targets of a program by what its measured run misses, round by round.

    A log is a table as for kerfpath fit. Run the program as it was written, correct it, write it
    again with the file named by compensate in [program], and measure that run, until what is left
    is noise, or no longer falls: then the best run is kept. Several logs of the same run are
    averaged, and show its noise.

    Example: kerfpath correct run1.csv run2.csv --job door.toml -o correction.json
    """
    from kerfpath.cli.program_output import correct_by_logs

    plan = plan or Path(f"{job.stem}-plan") / "plan.json"
    correct_by_logs(logs, job, plan, gain, output)


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
    """Plan contours again around the targets that a person has moved in a program.

    Moved targets keep tip and tool axis as taught, and the path fades back to the planned one; the
    rotation about the beam is planned again, in the posture of the plan. All other contours keep
    their motion; the table says which. The files are those of kerfpath plan and go to the folder
    PROGRAM-touched unless --out names another; the audit is that of the touched-up path.

    Example: kerfpath touch-up edited.mod --job door.toml --plan door/plan.json --out door-2
    """
    from kerfpath.cli.program_output import touch_up_program

    folder = to or Path(f"{program.stem}-touched")
    touch_up_program(program, job, plan, folder, ease_mm)


@app.command("run")
def run_program(
    program: Annotated[
        Path, typer.Argument(metavar="PROGRAM", help="A program with the files beside it.")
    ],
    on: Annotated[str, typer.Option(help="The controller: linuxcnc.")] = "linuxcnc",
    job: Annotated[
        Path | None,
        typer.Option(
            metavar="JOB.toml", help="The job of the program; default: the plan.json beside it."
        ),
    ] = None,
    to: Out = None,
    as_json: Json = False,
) -> None:
    """Run a program on a controller that is installed here, and compare what it did with the plan.

    LinuxCNC runs without a screen, with the INI and HAL of the program and simulated joints, in the
    time that the program takes. Its commands are recorded every millisecond. The table shows the
    time of each contour and how far the tip was off the lines between the targets; the checks are
    about the laser, the limits of the joints and the time. The folder PROGRAM-run, or that of
    --out, gets run.html, run.json and record.csv.

    Example: kerfpath run door/door.ngc --on linuxcnc
    """
    from kerfpath.cli.program_output import show_run

    if not show_run(program, on, job, to or Path(f"{program.stem}-run")):
        raise typer.Exit(1)


@app.command()
def script(
    job: JobArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="File to write; default: print the script."),
    ] = None,
) -> None:
    """Write a job as a Python script that does the same with the public functions.

    The script reads the drawing, plans each contour with the options of the job, audits, and writes
    the program. Keep it beside the drawing. Jobs with features that a script cannot express, such
    as an order, are refused.

    Example: kerfpath script door.toml -o door.py
    """
    from kerfpath.cli.program_output import write_script

    write_script(job, output)


@app.command()
def freecad(
    to: Annotated[
        Path | None,
        typer.Option(
            metavar="MOD",
            help="Folder of add-ons; default: that of every FreeCAD of this user.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Install the workbench for FreeCAD, 0.20 or newer, which then plans with this kerfpath.

    Start FreeCAD again afterwards, and choose the workbench Kerfpath.

    Example: kerfpath freecad
    """
    from rich.markup import escape

    from kerfpath.cli.show import out, print_json
    from kerfpath.freecad import install

    folders = install(to)
    print_json({"installed": [str(folder) for folder in folders]})
    for folder in folders:
        out.print(f"installed {escape(str(folder))}", soft_wrap=True)
    out.print("Start FreeCAD again, and choose the workbench Kerfpath.")
