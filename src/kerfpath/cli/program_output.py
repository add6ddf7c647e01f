"""`kerfpath post`: write or print the program of a plan."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.markup import escape

from kerfpath.cad import read_measured
from kerfpath.cli.plan_output import finish_run
from kerfpath.cli.show import (
    compile_kernels,
    errors,
    merge_notes,
    out,
    print_json,
    progress_bars,
    show_files,
)
from kerfpath.errors import InputError, KerfpathError
from kerfpath.job import (
    program_from_file,
    program_language,
    read_job,
    read_plan_file,
    require_folder,
    touch_up,
)
from kerfpath.placement import MeasuredFrame, placement_from_points
from kerfpath.post import (
    FolderChanges,
    Language,
    identifier,
    languages,
    replace_program,
    write_program,
)
from kerfpath.post import language as find_language

# -----------------------------------------------------------------------------
# `kerfpath touch-up`: plan a job again around targets that a person has moved.


def touch_up_program(
    program: Path, job: Path, plan: Path, folder: Path, ease_mm: float, *, as_json: bool
) -> None:
    """Plan a job again around the moved targets of a program, and print the result."""
    require_folder(folder)
    compile_kernels()
    with progress_bars() as progress:
        done = touch_up(program, plan, job, ease=ease_mm / 1000, progress=progress)
    more = {"targets": [asdict(each) for each in done.targets], "not_kept": list(done.notes)}
    if not as_json:
        for each in done.targets:
            out.print(
                f"{escape(each.place)}: {escape(each.contour)}, node {each.node}, moved by "
                f"{each.off * 1e3:.3f} mm, axis turned by {np.degrees(each.turned):.3f} deg"
            )
        for note in merge_notes(done.notes):
            out.print(f"note: {escape(note)}")
    finish_run(done.outcome, done.part, folder, as_json=as_json, more=more)


# -----------------------------------------------------------------------------
# `kerfpath post`: write or print the program of a plan.


def write_post(
    plan_file: Path, language: str | None, output: Path | None, *, strict: bool, as_json: bool,
    job: Path | None = None, dry_share: float | None = None, measured: Path | None = None,
    residual_mm: float = 0.5,
) -> None:  # fmt: skip
    """Write the files of a plan's program to `output`; print them without one.

    If `output` has the suffix of the language, it names the program, and further files go beside
    it. Otherwise a program of one file is written as `output`, and one of several files into the
    folder `output`.
    """
    if language is None:
        source = read_plan_file(plan_file).job if job is None else read_job(job).source
        language = program_language(source, job or plan_file)
    frame = None
    if measured is not None:
        points = read_measured(measured)
        frame = placement_from_points(*points, most_residual=residual_mm / 1000)
        if not as_json:  # printed first, so that it is shown even if there will be no program
            for line in _frame_lines(frame, plan_file):
                (errors if output is None else out).print(line)
    name = _name(output, find_language(language))
    if name is not None and dry_share is not None:
        name = name.removeprefix("dry_")  # dry runs add this prefix themselves
    try:
        files, notes = program_from_file(
            plan_file, language, name=name, strict=strict, job_file=job, dry_share=dry_share,
            frame=frame,
        )  # fmt: skip
    except KerfpathError:
        for line in _frame_lines(frame, plan_file) if as_json and frame is not None else ():
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
    if as_json:
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
        return
    # If the program is printed, nothing else goes to stdout.
    console = out if written else errors
    if not written:
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
