"""Run the command in a separate process, with clocks around the library's calls.

As a module (``python -m benchmarks._process CLOCKS TIMES.json ARGUMENT ...``) it runs
``kerfpath ARGUMENT ...`` in this process, with the clocks given as JSON.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Any

__all__ = ["Clock", "Clocks", "parts", "seconds"]

ROOT = Path(__file__).parent.parent

Clocks = Mapping[str, tuple[str, str]]
"""What is timed: the name of each function in the module of its caller."""


def seconds(command: Sequence[str], **environment: str) -> float:
    """Return the seconds that a command takes; `environment` may move the caches."""
    usual = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    start = perf_counter()
    subprocess.run(
        command,
        check=True,
        cwd=ROOT,
        env=usual | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    return perf_counter() - start


def parts(clocks: Clocks, arguments: Sequence[str], **environment: str) -> dict[str, float]:
    """Return the seconds of a run of `kerfpath` in "import", in each of the clocks, and "other"."""
    with tempfile.TemporaryDirectory() as folder:
        times = Path(folder) / "times.json"
        module = [sys.executable, "-m", "benchmarks._process", json.dumps(clocks), str(times)]
        total = seconds([*module, *arguments], **environment)
        found: dict[str, float] = json.loads(times.read_text())
    return {**found, "other": total - sum(found.values())}


class Clock:
    """Seconds spent in each named call; a call inside another counts for the outer one."""

    def __init__(self, clocks: Clocks) -> None:
        self.seconds = dict.fromkeys(clocks, 0.0)
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


def _clocked(clocks: Clocks, times: Path, arguments: Sequence[str]) -> None:
    start = perf_counter()
    command = import_module("kerfpath.cli")
    modules = {name: import_module(module) for name, (module, _) in clocks.items()}
    imported = perf_counter() - start
    clock = Clock(clocks)
    for name, (_, function) in clocks.items():
        setattr(modules[name], function, clock.around(name, getattr(modules[name], function)))
    sys.argv = ["kerfpath", *arguments]
    try:
        command.main()
    except SystemExit as done:
        if done.code:
            raise
    times.write_text(json.dumps({"import": imported, **clock.seconds}))


if __name__ == "__main__":
    _clocked(json.loads(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
