"""Limits that the shipped jobs need between nodes: with narrow zones, as shipped, guaranteed."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks._figures import Report, Sheet
from kerfpath.job import CutResult, read_job, run_job

__all__ = ["report_shipped"]

PARTS = Path(__file__).parents[1] / "examples" / "parts"
JOBS = (
    Path(str(files("kerfpath") / "demo" / "b_pillar.toml")),
    PARTS / "bracket.toml",
    PARTS / "tube.toml",
)
KINDS = {
    "0.3 mm, nodes alone": ('between_nodes = "reported"', "zone_mm = 0.3"),
    "auto, nodes alone": ('between_nodes = "reported"', ""),
    "auto, guaranteed": ('between_nodes = "guaranteed"', ""),
}
"""Lines for [plan] and [program]."""
COLUMNS = ("job", "zones", "contours", "velocity", "acceleration", "over", "tip mm", "held", "cost")
HOW = """\
The shipped jobs, nothing certified, with zones of 0.3 mm as before, with automatic ones, and with a
guarantee. Velocity, acceleration: the largest share of a full limit that a program needs as it is
run, bounds at every instant. Over: contours that need more than a limit. Tip: off the path as run,
at most. Held: contours whose speed is held all along between the ramps. Cost: of all contours."""


def report_shipped(*, quick: bool) -> Report:
    """Measure them."""
    rows = [row for job in (JOBS[1:2] if quick else JOBS) for row in _rows(job)]
    sheets = [Sheet(columns=COLUMNS, rows=rows)]
    return Report(title="Between the nodes: shipped jobs", how=HOW, sheets=sheets, findings=[])


def _rows(job: Path) -> Iterator[tuple[str, ...]]:
    for kind, (of_plan, of_program) in KINDS.items():
        with TemporaryDirectory() as folder:
            here = Path(shutil.copytree(job.parent, Path(folder) / "job")) / job.name
            text = re.sub(r"^(certify|zone_mm) = .*\n", "", here.read_text(), flags=re.MULTILINE)
            text = text.replace("[plan]\n", f"[plan]\ncertify = false\n{of_plan}\n")
            here.write_text(text.replace("[program]\n", f"[program]\n{of_program}\n"))
            yield (job.stem, kind, *_row(run_job(read_job(here)).cuts))


def _row(cuts: Sequence[CutResult]) -> tuple[str, ...]:
    tables = [{row.code: row for row in cut.as_run.checks} for cut in cuts]
    velocity, acceleration, tip = (
        [table[f"{what}-as-run"].value for table in tables]
        for what in ("velocity", "acceleration", "tip")
    )
    over = sum(max(pair) > 1 for pair in zip(velocity, acceleration, strict=True))
    timings = [cut.as_run.timing for cut in cuts]
    held = sum(timing is not None and timing.held == 1 for timing in timings)
    cost = sum(cut.plan.cost for cut in cuts if cut.plan is not None)
    return (
        str(len(cuts)),
        f"{max(velocity):.3f}",
        f"{max(acceleration):.3f}",
        str(over),
        f"{max(tip) * 1e3:.3f}",
        str(held),
        f"{cost:.3f}",
    )
