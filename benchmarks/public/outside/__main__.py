"""Run a planner of another project on an instance, and print the answer as JSON."""

from __future__ import annotations

import argparse
import json
from importlib import import_module
from time import perf_counter

import numpy as np

from benchmarks.public.check import instance

NAMES = ("pink", "ipopt", "descartes")


def main() -> None:
    """Read the arguments, plan, print."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.public.outside", description=__doc__
    )
    parser.add_argument("planner", choices=NAMES)
    parser.add_argument("instance")
    given = parser.parse_args()
    planner = import_module(f"benchmarks.public.outside.{given.planner}")
    begin = perf_counter()
    q, says = planner.plan(instance(given.instance), np.random.default_rng(1))
    answer = {
        "instance": given.instance,
        "planner": given.planner,
        "settings": planner.SETTINGS,
        "seconds": round(perf_counter() - begin, 3),
        "q": None if q is None else q.tolist(),
        "says": says,
    }
    print(json.dumps(answer))


if __name__ == "__main__":
    main()
