"""The demo: seconds from the command to the audited program, cold and warm, and where they go.

Run as a module (``python -m benchmarks.demo FOLDER TIMES.json``) this is one demo run with a clock
around the library's calls; the benchmark starts it in processes of its own.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

from benchmarks._figures import Figure, Report
from benchmarks._process import clocked, seconds

__all__ = ["run"]

HOW = """\
`kerfpath demo --out FOLDER` as a user starts it, in a process of its own, interpreter start
included: B-pillar from STEP to plan, audit, RAPID program and report. Cold: with an empty folder
for numba's compiled code (NUMBA_CACHE_DIR), as after installing; the files of Python and its
packages are warm. Warm: kernels compiled before. The parts are from further runs of the same
command with a clock around the library's calls; "other" is the rest of the process: interpreter
start, frames and sampling, plan and program files, kernels that `warm_up` leaves out, end."""

CLOCKS = {
    "compile (cold only)": ("kerfpath.job", "warm_up"),
    "read STEP": ("kerfpath.job._run", "read_drawing"),
    "graph": ("kerfpath.job._run", "layered_graph"),
    "search": ("kerfpath.planner._plan", "shortest_path"),
    "refinement": ("kerfpath.planner._plan", "refined"),
    "audit": ("kerfpath.job._run", "checks"),
    "report": ("kerfpath.job._files", "report_text"),
}
PARTS = ("import", *CLOCKS, "other")


def run(*, quick: bool) -> Report:
    """Run the demo cold and warm, by itself and in parts."""
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
        cache = {"NUMBA_CACHE_DIR": str(Path(folder) / "compiled")} if cold else {}
        return seconds([*command, str(Path(folder) / "out")], **cache)


def _parts(*, cold: bool) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as folder:
        times = Path(folder) / "times.json"
        module = [sys.executable, "-m", "benchmarks.demo", str(times)]
        total = _whole(module, cold=cold)
        parts: dict[str, float] = json.loads(times.read_text())
    return {**parts, "other": total - sum(parts.values())}


if __name__ == "__main__":
    clocked(CLOCKS, ["demo", "--out", sys.argv[2]], Path(sys.argv[1]))
