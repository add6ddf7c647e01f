"""The demo: seconds from the command to the audited program, cold and warm, and where they go.

Run as a module (``python -m benchmarks.demo FOLDER TIMES.json``) this is one demo run with a clock
around the library's calls; the benchmark starts it in processes of its own.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Any

from benchmarks._figures import Figure, Report

__all__ = ["run"]

ROOT = Path(__file__).parent.parent

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
"""What is timed: the name by which the caller's module knows each function."""

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
        environment = dict(os.environ)
        environment.pop("NUMBA_CACHE_DIR", None)
        if cold:
            environment["NUMBA_CACHE_DIR"] = str(Path(folder) / "compiled")
        start = perf_counter()
        subprocess.run(
            [*command, str(Path(folder) / "out")],
            check=True,
            cwd=ROOT,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        return perf_counter() - start


def _parts(*, cold: bool) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as folder:
        times = Path(folder) / "times.json"
        module = [sys.executable, "-m", "benchmarks.demo", str(times)]
        total = _whole(module, cold=cold)
        parts: dict[str, float] = json.loads(times.read_text())
    return {**parts, "other": total - sum(parts.values())}


class _Clock:
    """Seconds spent in each named call; a call inside another counts for the outer one."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(CLOCKS, 0.0)
        self._running = False

    def around(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*args: Any, **options: Any) -> Any:
            if self._running:
                return function(*args, **options)
            self._running, start = True, perf_counter()
            try:
                return function(*args, **options)
            finally:
                self.seconds[name] += perf_counter() - start
                self._running = False

        return timed


def _one_run(times: Path, folder: Path) -> None:
    start = perf_counter()
    command = import_module("kerfpath.cli")
    modules = {name: import_module(module) for name, (module, _) in CLOCKS.items()}
    imported = perf_counter() - start
    clock = _Clock()
    for name, (_, function) in CLOCKS.items():
        setattr(modules[name], function, clock.around(name, getattr(modules[name], function)))
    sys.argv = ["kerfpath", "demo", "--out", str(folder)]
    try:
        command.main()
    except SystemExit as done:
        if done.code:
            raise
    times.write_text(json.dumps({"import": imported, **clock.seconds}))


if __name__ == "__main__":
    _one_run(Path(sys.argv[1]), Path(sys.argv[2]))
