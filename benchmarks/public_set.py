"""The public benchmark set: draw it, run planners, keep the best known, write the results.

    python -m benchmarks.public_set draw [NAMES BEGIN WITH]
    python -m benchmarks.public_set run kerfpath|grid|paper
    python -m benchmarks.public_set run pink|ipopt|descartes --python OTHER/bin/python
    python -m benchmarks.public_set known
    python -m benchmarks.public_set results

Answers are in build/public-set/PLANNER; an interrupted run continues. The planners of other
projects need an interpreter with requirements/planners.txt.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._public_instances import draw
from benchmarks._public_planners import PLANNERS, answer
from benchmarks._public_tables import written
from benchmarks.public.check import INSTANCES, KNOWN, check, instance, names
from benchmarks.public.outside.__main__ import NAMES as OUTSIDE
from kerfpath.files import write_whole

ANSWERS = Path(__file__).parents[1] / "build" / "public-set"
LONGEST = 300.0
"""Time limit of a planner per instance, s."""


def main() -> None:
    """Read the arguments, and run the command."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.public_set",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    does = parser.add_subparsers(dest="does", required=True)
    does.add_parser("draw").add_argument("prefix", nargs="?", default="")
    run = does.add_parser("run")
    run.add_argument("planner", choices=[*PLANNERS, *OUTSIDE])
    run.add_argument("--python", default=sys.executable, help="interpreter for other planners")
    run.add_argument("--only", default="", help="instances whose names begin so")
    does.add_parser("known")
    does.add_parser("results")
    given = parser.parse_args()
    if given.does == "draw":
        INSTANCES.mkdir(exist_ok=True)
        for name in draw(given.prefix):
            print(name, flush=True)
    elif given.does == "run":
        _run(given.planner, given.python, given.only)
    elif given.does == "known":
        _keep_best()
    else:
        write_whole({README: written(README.read_text(), ANSWERS).encode()})


README = Path(__file__).parent / "public" / "README.md"


def _run(planner: str, python: str, only: str) -> None:
    """Run a planner on the instances that it has not answered yet."""
    folder = ANSWERS / planner
    folder.mkdir(parents=True, exist_ok=True)
    left = [n for n in names() if n.startswith(only) and not (folder / f"{n}.json").exists()]
    answers = _outside(planner, python, left) if planner in OUTSIDE else _inside(planner, left)
    for i, said in enumerate(answers, start=1):
        write_whole({folder / f"{said['instance']}.json": json.dumps(said).encode()})
        print(f"{i}/{len(left)} {said['instance']} {said['seconds']:.1f} s", flush=True)


def _inside(planner: str, left: list[str]) -> Iterator[dict[str, Any]]:
    """Yield the answers of a planner of this package, from a process that is killed if it hangs."""
    os.environ["NUMBA_NUM_THREADS"] = "1"
    pool: ProcessPoolExecutor | None = None
    for name in left:
        if pool is None:
            pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"))
            pool.submit(answer, planner, names()[0]).result()  # compiles, and is not timed
        try:
            yield pool.submit(answer, planner, name).result(timeout=LONGEST)
        except (TimeoutError, BrokenProcessPool) as error:
            for process in pool._processes.values():
                process.kill()
            pool = None
            yield _silent(planner, name, PLANNERS[planner][0], type(error).__name__)


def _outside(planner: str, python: str, left: list[str]) -> Iterator[dict[str, Any]]:
    """Yield the answers of a planner of another project, each from a separate process."""
    environ = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1]), "OMP_NUM_THREADS": "1"}
    for name in left:
        command = [python, "-W", "ignore", "-m", "benchmarks.public.outside", planner, name]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=LONGEST, env=environ, check=False
            )
        except subprocess.TimeoutExpired:
            yield _silent(planner, name, "", "TimeoutError")
            continue
        if done.returncode != 0:
            print(done.stderr, file=sys.stderr)
            yield _silent(planner, name, "", f"exit {done.returncode}")
            continue
        yield json.loads(done.stdout.splitlines()[-1])


def _silent(planner: str, name: str, settings: str, why: str) -> dict[str, Any]:
    """Return the record of a planner that gave no answer."""
    return {
        "instance": name,
        "planner": planner,
        "settings": settings,
        "seconds": LONGEST,
        "q": None,
        "says": f"no answer within {LONGEST:.0f} s ({why})",
    }


def _keep_best() -> None:
    """Write the best known motion and bound of every instance, or why there is no motion."""
    KNOWN.mkdir(exist_ok=True)
    for name in names():
        file = KNOWN / f"{name}.json"
        before = json.loads(file.read_text()) if file.exists() else {}
        best = _best(name, before)
        write_whole({file: _lines(best).encode()})


def _best(name: str, known: dict[str, Any]) -> dict[str, Any]:
    task, best = instance(name), {"instance": name, "cost": None, "bound": None} | known
    for file in sorted(ANSWERS.glob(f"*/{name}.json")):
        said = json.loads(file.read_text())
        by = _named(said["planner"])
        if said["q"] is not None and not (verdict := check(task, said["q"])).faults:
            # The bound of the same plan on another machine may differ by rounding.
            if best["cost"] is None or verdict.cost < best["cost"] - 1e-9:
                q = np.round(said["q"], 12)
                best |= {"cost": check(task, q).cost, "by": by, "q": q.tolist()}
            bound = said.get("bound")
            if bound is not None and (best["bound"] is None or bound > best["bound"] + 1e-9):
                best |= {"bound": bound, "bound_by": by}
        if said.get("scope") == "every gamma":
            best |= {"infeasible": said["where"] | {"says": said["says"], "by": by}}
    if best.get("infeasible") and best["cost"] is not None:
        raise SystemExit(f"{name}: proved infeasible, and there is a motion")
    if best["cost"] is not None and best["bound"] is not None and best["bound"] > best["cost"]:
        raise SystemExit(f"{name}: bound {best['bound']} above the cost {best['cost']}")
    return best


def _named(planner: str) -> str:
    """Return a planner's name, with the version if it is a planner of this package."""
    if planner not in PLANNERS:
        return planner
    return f"kerfpath {version('kerfpath')}" + (f", {planner}" if planner != "kerfpath" else "")


def _lines(data: dict[str, Any]) -> str:
    """Return JSON with one key per line and, in the motion, one node per line."""
    rows = []
    for key, value in data.items():
        text = json.dumps(value)
        if key == "q":
            text = "[\n" + ",\n".join(json.dumps(row) for row in value) + "\n]"
        rows.append(f"{json.dumps(key)}: {text}")
    return "{\n" + ",\n".join(rows) + "\n}\n"


if __name__ == "__main__":
    main()
