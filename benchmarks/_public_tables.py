"""The tables of the public set's page: results of each planner for each family of instances."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.public.check import KNOWN, Instance, check, instance, names

__all__ = ["written"]

BEGIN, END = "<!-- tables: begin -->", "<!-- tables: end -->"
ORDER = ("kerfpath", "grid", "paper", "ipopt", "pink", "descartes")


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """The result for an instance: its cost over the best known, or the faults of the motion."""

    family: str
    seconds: float
    over: float | None
    faults: Sequence[str]
    ran: bool
    feasible: bool


def written(page: str, answers: Path) -> str:
    """Return a page with its tables made again from the answers."""
    before, _, rest = page.partition(BEGIN)
    _, _, after = rest.partition(END)
    lines = [*_set(), "", *_planners(answers)]
    return "\n".join([before + BEGIN, *lines, END + after])


@cache
def _task(name: str) -> Instance:
    return instance(name)


@cache
def _known(name: str) -> dict[str, Any]:
    known: dict[str, Any] = json.loads((KNOWN / f"{name}.json").read_text())
    return known


def _families() -> list[str]:
    return list(dict.fromkeys(_task(name).family for name in names()))


def _set() -> Iterator[str]:
    yield from _head(
        "family", "instances", "nodes", "best known", "gap to the bound, median, most",
        "infeasible, proved", "open",
    )  # fmt: skip
    for family in [*_families(), "all"]:
        mine = [name for name in names() if family in (_task(name).family, "all")]
        known = [_known(name) for name in mine]
        gaps = [1 - k["bound"] / k["cost"] for k in known if k["cost"] and k["bound"] is not None]
        shown = f"{100 * median(gaps):.2f} %, {100 * max(gaps):.2f} %" if gaps else "no bound"
        nodes = [len(_task(name).points) for name in mine]
        solved = sum(k["cost"] is not None for k in known)
        closed = sum("infeasible" in k for k in known)
        shown = shown if solved else "-"
        yield (
            f"| {family} | {len(mine)} | {min(nodes)} to {max(nodes)} | {solved} | {shown} | "
            f"{closed} | {len(mine) - solved - closed} |"
        )


def _head(*columns: str) -> Iterator[str]:
    yield f"| {' | '.join(columns)} |"
    yield f"| --- |{' ---: |' * (len(columns) - 1)}"


def _planners(answers: Path) -> Iterator[str]:
    yield from _head(
        "planner", "family", "valid", "cost over the best known, median, most", "not valid", "none",
        "seconds, median, most",
    )  # fmt: skip
    for planner in ORDER:
        judged = [
            _judged(json.loads(file.read_text()))
            for file in sorted((answers / planner).glob("*.json"))
        ]
        for family in _families():
            mine = [j for j in judged if j.family == family and j.ran]
            if mine:
                yield _row(planner, family, mine)


def _row(planner: str, family: str, mine: Sequence[Judged]) -> str:
    feasible = sum(j.feasible for j in mine)
    over = [j.over for j in mine if j.over is not None]
    # A cost that differs from the best known only by rounding is +0.0 %, not -0.0.
    percent = [round(100 * share, 1) + 0.0 for share in over]
    shown = f"{median(percent):+.1f} %, {max(percent):+.1f} %" if over else "-"
    broken = sum(bool(j.faults) for j in mine)
    seconds = [j.seconds for j in mine]
    return (
        f"| {planner} | {family} | {len(over)} of {feasible} | {shown} | {broken} | "
        f"{len(mine) - len(over) - broken} | {median(seconds):.1f}, {max(seconds):.1f} |"
    )


def _judged(said: dict[str, Any]) -> Judged:
    task, known = _task(said["instance"]), _known(said["instance"])
    over, faults = None, []
    if said["q"] is not None:
        verdict = check(task, said["q"])
        faults = verdict.faults
        if not faults:
            over = verdict.cost / known["cost"] - 1
    return Judged(
        family=task.family,
        seconds=said["seconds"],
        over=over,
        faults=faults,
        ran=not said["says"].startswith("not run"),
        feasible=known["cost"] is not None,
    )
