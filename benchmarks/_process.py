"""A run of the command in a process of its own, with a clock around the library's calls."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Any

__all__ = ["Clock", "Clocks", "clocked", "seconds"]

ROOT = Path(__file__).parent.parent

Clocks = Mapping[str, tuple[str, str]]
"""What is timed: the name by which the caller's module knows each function."""


def seconds(command: Sequence[str], **environment: str) -> float:
    """Return the seconds that a command takes; caches are where `environment` says, or usual."""
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


def clocked(clocks: Clocks, arguments: Sequence[str], times: Path) -> None:
    """Run `kerfpath` here; write the seconds in each of the clocks, and of the import, as JSON."""
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
