"""`kerfpath touch-up`: plan a job again around targets that a person has moved."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.markup import escape

from kerfpath.cli._plan import finish_run
from kerfpath.cli._show import compile_kernels, merge_notes, out, progress_bars
from kerfpath.job import require_folder, touch_up

__all__ = ["touch_up_program"]


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
