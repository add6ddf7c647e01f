"""The demo: seconds from the command to the audited program, cold and warm, total and by part."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from benchmarks._figures import Figure, Report
from benchmarks._process import parts, seconds

__all__ = ["run"]

HOW = """\
`kerfpath demo --out FOLDER` as a user starts it, in a process of its own, interpreter start
included: B-pillar from STEP to plan, audit, RAPID program and report. Cold: with an empty folder
for numba's compiled code (NUMBA_CACHE_DIR), as after installing; the files of Python and its
packages are warm. Warm: kernels compiled before. The parts are from further runs of the same
command with a clock around the library's calls; "other" is the rest of the process: interpreter
start, frames and sampling, files written, kernels that `warm_up` leaves out, end."""

CLOCKS = {
    "compile (cold only)": ("kerfpath.job", "warm_up"),
    "read STEP": ("kerfpath.cli.plan_output", "drawing_of"),
    "graph": ("kerfpath.job.format.reading", "layered_graph"),
    "search and refinement": ("kerfpath.planner.continuous", "clear_motion"),
    "audit": ("kerfpath.job.format.tables.job", "checks"),
    "certificate": ("kerfpath.job.run.job", "certified"),
    "program, with its audit": ("kerfpath.job.output.writing", "program_texts"),
    "report": ("kerfpath.job.output.writing", "report_text"),
}
PARTS = ("import", *CLOCKS, "other")


def run(*, quick: bool) -> Report:
    """Run the demo cold and warm, in total and by part."""
    warm_runs, cold_runs = (2, 1) if quick else (5, 3)
    command = str(Path(sys.executable).parent / "kerfpath")
    _whole([command, "demo", "--out"], cold=False)
    warm = [_whole([command, "demo", "--out"], cold=False) for _ in range(warm_runs)]
    cold = [_whole([command, "demo", "--out"], cold=True) for _ in range(cold_runs)]
    warm_parts = [_parts(cold=False) for _ in range(warm_runs)]
    cold_parts = [_parts(cold=True) for _ in range(cold_runs)]
    figures = [
        Figure(what="command to program, warm", values=warm),
        *(
            Figure(what=f"  of which {part}", values=[p[part] for p in warm_parts])
            for part in PARTS
            if part != "compile (cold only)"
        ),
        Figure(what="command to program, cold", values=cold),
        *(
            Figure(what=f"  of which {part.removesuffix(' (cold only)')}", values=values)
            for part in PARTS
            for values in ([p[part] for p in cold_parts],)
        ),
    ]
    return Report(title="Demo: command to program", how=HOW, figures=figures)


def _whole(command: list[str], *, cold: bool) -> float:
    with tempfile.TemporaryDirectory() as folder:
        return seconds([*command, f"{folder}/out"], **_cache(folder, cold=cold))


def _parts(*, cold: bool) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as folder:
        return parts(CLOCKS, ["demo", "--out", f"{folder}/out"], **_cache(folder, cold=cold))


def _cache(folder: str, *, cold: bool) -> dict[str, str]:
    return {"NUMBA_CACHE_DIR": f"{folder}/compiled"} if cold else {}
