"""Sweeps: the overhead of the engine per task, and what is stored after repeated kills."""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter

import numpy as np

import kerfpath
from benchmarks._figures import Figure, Report
from kerfpath import sweep
from kerfpath.sweep.workers import ONE_THREAD

__all__ = ["run"]

HOW = """\
A task that takes 2 microseconds returns 1 kB; two processes of this machine, or two Dask workers of
one thread on loopback. Per task: from the first result to the last, over the tasks between, kept in
the store each. Start: the call until its first result. Killed: SIGKILL to the sweep each time it
has come to a random number of tasks, the same call again after each; the last is left to end.
Small plans: a slit of 31 nodes, gamma every 15 degrees, another height each, planned and audited
by two such processes or workers; of 2000 the second half is measured, when all is loaded. Own time:
of a task in its worker, a mean. Overhead: two workers times the wall clock of that half, less the
own times of its tasks, over their number: what workers wait and the engine takes. Kept: what the
store holds for each. Sleepers: 200 threads of four Dask workers whose tasks sleep and return 0.5
kB: the scheduler, the caller and its store are what limits. Over the last three quarters."""

WORKERS = 2
NODES = 31
SLEEPERS = {"workers": 4, "threads": 50}
NAPS = {0.05: 6000, 0.4: 4000}
"""Seconds that each task sleeps, and the number of tasks."""


def payload(x: int) -> dict[str, str]:
    """Return 1 kB that depends on `x`, so that a torn or foreign record is noticed."""
    return {"text": hashlib.sha256(str(x).encode()).hexdigest() * 16}


@cache
def _arm() -> kerfpath.Robot:
    return kerfpath.robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")


def slit(height_m: float) -> dict[str, object]:
    """Plan and audit a small slit in a wall at a height; return the record a study would keep."""
    points = np.linspace((0.0, -0.03, height_m), (0.0, 0.03, height_m), NODES)
    tool, placement = np.eye(4), np.eye(4)
    tool[:3, :3] = [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]]
    tool[:3, 3] = [0.1, 0, 0.3]
    placement[:3, 3] = [1.6, 0, 0.8]
    made = kerfpath.plan(
        kerfpath.Contour(points, np.tile((1.0, 0.0, -0.2), (NODES, 1))),
        _arm(),
        tool=tool,
        placement=placement,
        speed=0.05,
        gamma_step=np.pi / 12,
        postures=[0, 1],
    )
    criteria = made.criteria
    return {
        "cost": made.cost,
        "time_s": float(made.time[-1]),
        "issues": len(kerfpath.audit(made)),
        "peak_velocity": criteria.peak_velocity.tolist(),
        "peak_acceleration": criteria.peak_acceleration.tolist(),
        "displacement": criteria.displacement.tolist(),
    }


def nap(x: int, seconds: float) -> dict[str, object]:
    """Sleep as long as a plan might take; return 0.5 kB."""
    time.sleep(seconds)
    return {"x": x, "text": "x" * 500}


def sweep_aloud(store: str, count: int) -> None:
    """Sweep over `count` tasks and print how many are done, for the process that will kill it."""
    sweep.run(
        payload,
        [{"x": x} for x in range(count)],
        store=store,
        processes=2,
        progress=lambda _what, done, _total: print(done, flush=True),
    )


def run(*, quick: bool = False) -> Report:
    """Measure overhead per task, and kill a sweep many times."""
    tasks, kills, runs, plans = (1000, 4, 1, 200) if quick else (10_000, 20, 3, 1000)
    from kerfpath.job import warm_up  # otherwise the workers' imports would count as overhead

    warm_up()
    figures, findings = [], list[str]()
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        local = [_timed(at / f"local-{i}", 1000, None) for i in range(runs)]
        figures += _shown("two processes", local)
        figures += _planned("two processes", at / "plans-local", plans, None)
        if find_spec("distributed"):
            with _cluster(at) as address:
                _timed(at / "unmeasured", 10, address)
                dask = [_timed(at / f"dask-{i}", 1000, address) for i in range(runs)]
                many = _planned("Dask, two workers", at / "plans-dask", plans, address)
            figures += _shown("Dask, two workers", dask) + many
            if not quick:
                with _cluster(at, **SLEEPERS) as address:
                    figures += [_slept(at / f"naps-{s}", s, n, address) for s, n in NAPS.items()]
        else:
            figures.append(Figure(what="Dask, two workers", note="distributed is not installed"))
        findings.append(_killed(at / "killed", tasks, kills))
    return Report(title="Sweeps", how=HOW, figures=figures, findings=findings)


def _shown(what: str, timed: list[tuple[float, float]]) -> list[Figure]:
    starts, each = zip(*timed, strict=True)
    return [
        Figure(what=f"{what}: start", values=starts),
        Figure(what=f"{what}: per task", values=[1e3 * s for s in each], unit="ms"),
    ]


def _timed(store: Path, count: int, scheduler: str | None) -> tuple[float, float]:
    """Return the seconds until the first results, and those per task after them."""
    clock: list[tuple[int, float]] = []
    sweep.run(
        payload,
        [{"x": x} for x in range(count)],
        store=store,
        scheduler=scheduler,
        processes=None if scheduler else 2,
        progress=lambda _what, done, _total: clock.append((done, perf_counter())),
    )
    (_, begun), (first, came), (last, ended) = clock[0], clock[1], clock[-1]
    return came - begun, (ended - came) / (last - first)


def _planned(what: str, store: Path, count: int, scheduler: str | None) -> list[Figure]:
    """Return the time of small plans, the overhead of the engine, and the size of its records."""
    clock: list[tuple[int, float]] = []
    results = sweep.run(
        slit,
        [{"height_m": height} for height in np.linspace(-0.1, 0.1, 2 * count).tolist()],
        store=store,
        scheduler=scheduler,
        processes=None if scheduler else WORKERS,
        progress=lambda _what, done, _total: clock.append((done, perf_counter())),
    )
    assert all(result.failure is None for result in results)
    (early, begun), (_, ended) = next(c for c in clock if c[0] >= count), clock[-1]
    left = len(results) - early
    with closing(sqlite3.connect(store)) as base:
        rows = base.execute("SELECT seconds FROM result ORDER BY rowid LIMIT -1 OFFSET ?", (early,))
        own = sum(seconds for (seconds,) in rows)
    wall = ended - begun
    size, kept = len(json.dumps(results[0].value)), store.stat().st_size / len(results)
    note = f"result {size} bytes, kept {kept:.0f} bytes"
    return [
        Figure(what=f"{what}: small plan, own time", values=[1e3 * own / left], unit="ms"),
        Figure(
            what=f"{what}: small plan, overhead",
            values=[1e3 * (WORKERS * wall - own) / left],
            unit="ms",
            note=note,
        ),
        Figure(what=f"{what}: small plans", values=[left / wall], unit="1/s"),
    ]


def _slept(store: Path, seconds: float, count: int, scheduler: str) -> Figure:
    """Return the rate at which sleeping tasks are done, and the rate without any overhead."""
    clock: list[tuple[int, float]] = []
    sweep.run(
        nap,
        [{"x": x, "seconds": seconds} for x in range(count)],
        store=store,
        scheduler=scheduler,
        progress=lambda _what, done, _total: clock.append((done, perf_counter())),
    )
    (first, begun), (last, ended) = next(c for c in clock if c[0] >= count / 4), clock[-1]
    ideal = SLEEPERS["workers"] * SLEEPERS["threads"] / seconds
    return Figure(
        what=f"Dask, 200 sleepers of {seconds:g} s",
        values=[(last - first) / (ended - begun)],
        unit="1/s",
        note=f"at most {ideal:.0f}",
    )


@contextmanager
def _cluster(folder: Path, *, workers: int = WORKERS, threads: int = 1) -> Iterator[str]:
    """Start a Dask scheduler and workers on loopback; yield the scheduler's address."""
    import distributed

    def dask(*arguments: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments, "--host", "127.0.0.1", "--no-dashboard"],
            stderr=subprocess.DEVNULL,
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": os.pathsep.join(sys.path)},
        )

    file = folder / f"scheduler-{workers}-{threads}.json"
    started = [dask("scheduler", "--port", "0", "--scheduler-file", str(file))]
    try:
        while not file.exists() or not file.read_text().endswith("}"):
            time.sleep(0.02)
        address = str(json.loads(file.read_text())["address"])
        options = ("--nthreads", str(threads), "--no-nanny", "--local-directory", str(folder))
        started += [dask("worker", address, *options) for _ in range(workers)]
        with distributed.Client(address) as client:
            client.wait_for_workers(workers)
        yield address
    finally:
        for process in started:
            process.kill()
            process.wait()


def _killed(store: Path, tasks: int, kills: int) -> str:
    """Kill a sweep at random moments, resume it, and report what its store holds at the end."""
    code = "import sys; from benchmarks.sweeps import sweep_aloud as s; s(sys.argv[1], {})"
    moments = sorted(np.random.default_rng(0).integers(0, tasks - 200, kills).tolist())
    begun = perf_counter()
    for moment in [*moments, tasks]:
        with subprocess.Popen(
            [sys.executable, "-c", code.format(tasks), str(store)],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        ) as running:
            assert running.stdout is not None
            for line in running.stdout:
                if moment <= int(line) < tasks:
                    running.kill()
                    break
    seconds = perf_counter() - begun
    with closing(sqlite3.connect(store)) as base:
        rows = base.execute("SELECT parameters, value FROM result").fetchall()
        (checked,) = base.execute("PRAGMA integrity_check").fetchone()
    numbers = [json.loads(parameters)["x"] for parameters, _ in rows]
    torn = sum(json.loads(v) != payload(x) for x, (_, v) in zip(numbers, rows, strict=True))
    once = len(set(numbers) & set(range(tasks)))
    return (
        f"{tasks} tasks, killed {kills} times: {once} of them in the store, "
        f"{len(rows) - once} more than once, {torn} torn, SQLite's integrity check {checked}; "
        f"{seconds:.0f} s with all {kills + 1} starts"
    )
