"""Random contours at 1.5 times their fastest speed: for which gammas it is refuted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from time import perf_counter
from typing import Any

from benchmarks._certified import in_processes
from benchmarks._figures import Report, Sheet
from benchmarks._random_contours import ROBOTS, cut
from benchmarks.continuum_random import COUNTS, PROCESSES
from kerfpath import NoFeasiblePath, PlanOptions, fastest_speed, plan

__all__ = ["Refused", "report", "run", "try_too_fast"]

FACTOR = 1.5
"""Requested speed, as a multiple of the fastest found."""
NAMED = 40
"""Most cuts listed of each kind."""
VERDICTS = {
    "every gamma": "proved for every gamma",
    "grid": "proved on the grid only",
    "undecided": "undecided",
    "planned": "planned after all",
}
"""Possible results of a task, and the column of each."""
COLUMNS = ("robot", "tasks", *VERDICTS.values(), "seconds", "fastest speed s")

HOW = f"""\
The random contours of the comparison of methods at {FACTOR:g} times the fastest speed that
`fastest_speed` finds (1 deg, off the grid), planned by method "continuous". What `NoFeasiblePath`
says: that no motion keeps the limits at any gamma; that none does on the grid of gamma (2 deg),
while off it that is undecided; or undecided altogether. A plan after all is a motion that
`fastest_speed` missed, and must lie below the speed from which on it proves that there is none:
its `ceiling`, which is asked for wherever the answer is not "every gamma". Seconds: medians, from
the contour to this answer, and of finding the fastest speed; processes of one thread each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Refused:
    """The result for one cut that was requested too fast.

    Parameters
    ----------
    name : str
    index : int
    verdict : str
        One of `VERDICTS`.
    where : str
        Why there is no motion at any gamma, if that is proved.
    speed : float m/s
        The fastest found; the request is `FACTOR` times as fast.
    ceiling : float m/s or None
        Speed that no motion reaches; None if not proved or not requested.
    seconds, fastest_seconds : float s
        Time of planning, and of finding the fastest speed.
    """

    name: str
    index: int
    verdict: str
    where: str
    speed: float
    ceiling: float | None
    seconds: float
    fastest_seconds: float

    @property
    def below_ceiling(self) -> bool:
        """Whether the ceiling allows a motion at the speed asked for."""
        return self.ceiling is None or FACTOR * self.speed < self.ceiling

    def __str__(self) -> str:
        above = "none" if self.ceiling is None else f"{self.ceiling / self.speed:.3f}"
        said = f"{self.name} {self.index} ({VERDICTS[self.verdict]}"
        return said + (")" if self.where else f"; ceiling over the fastest found: {above})")


def run(*, quick: bool) -> list[Report]:
    """Measure them."""
    counts = (2, 2, 2) if quick else COUNTS
    keys = [(name, i) for name, count in zip(ROBOTS, counts, strict=True) for i in range(count)]
    made = in_processes(try_too_fast, keys, 1 if quick else PROCESSES)
    return [report(made)]


def try_too_fast(key: tuple[str, int]) -> Refused:
    """Plan one cut faster than it can be made, and read why it is refused."""
    drawn = cut(*key)
    task = (drawn.contour, drawn.robot)
    asked: dict[str, Any] = {"graph": drawn.graph, "refine": True, **drawn.options}
    start = perf_counter()
    fastest = fastest_speed(*task, **asked)
    found = perf_counter()
    verdict, where = "planned", ""
    try:
        plan(
            *task,
            tool=drawn.tool,
            placement=drawn.options["placement"],
            speed=FACTOR * fastest.speed,
            options=PlanOptions(certify=None),
        )
    except NoFeasiblePath as refusal:
        verdict, where = refusal.scope, str(refusal.closed or "")
    answered = perf_counter()
    proved = verdict == "every gamma"
    return Refused(
        name=key[0],
        index=key[1],
        verdict=verdict,
        where=where,
        speed=fastest.speed,
        ceiling=None if proved else fastest_speed(*task, ceiling=True, **asked).ceiling,
        seconds=answered - found,
        fastest_seconds=found - start,
    )


def report(made: Sequence[Refused]) -> Report:
    """Return the results of the cuts as a table, and list the remarkable ones."""
    robots = {name: [r for r in made if r.name == name] for name in ROBOTS}
    refused = [r for r in made if r.verdict != "planned"]
    proved = [r for r in refused if r.verdict == "every gamma"]
    findings = [
        f"proved for every gamma: {_share(len(proved), len(refused))} of those without a plan",
        _named("not proved for every gamma", [r for r in refused if r.verdict != "every gamma"]),
        _named("planned after all", [r for r in made if r.verdict == "planned"]),
        _named(
            "planned at a speed that is proved impossible",
            [r for r in made if r.verdict == "planned" and not r.below_ceiling],
        ),
        _named(
            "not proved by the plan where the ceiling proves it",
            [r for r in refused if r.verdict != "every gamma" and not r.below_ceiling],
        ),
    ]
    return Report(
        title=f"Continuous gamma: contours at {FACTOR:g} times their fastest speed",
        how=HOW,
        sheets=[
            Sheet(
                columns=COLUMNS,
                rows=[_row(name, of) for name, of in (robots | {"all": list(made)}).items()],
            )
        ],
        findings=findings,
    )


def _row(name: str, made: Sequence[Refused]) -> tuple[str, ...]:
    return (
        name,
        str(len(made)),
        *(str(sum(r.verdict == verdict for r in made)) for verdict in VERDICTS),
        f"{median(r.seconds for r in made):.3g}" if made else "-",
        f"{median(r.fastest_seconds for r in made):.3g}" if made else "-",
    )


def _share(some: int, of: int) -> str:
    return f"{some} of {of}" + (f" ({100 * some / of:.1f} %)" if of else "")


def _named(kind: str, which: Sequence[Refused]) -> str:
    return f"{kind}: {len(which)}" + "".join(f"; {r}" for r in which[:NAMED])
