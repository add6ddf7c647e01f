"""Continuous gamma beside the grid on many random contours: costs, gaps and times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from statistics import median

import numpy as np

from benchmarks._certified import GAP, Task, Weighed, in_processes, weigh
from benchmarks._figures import Report, Sheet
from benchmarks._random_contours import ROBOTS, cut
from kerfpath import PlanOptions

__all__ = ["report", "run", "weigh_cut"]

COUNTS = (134, 133, 133)
"""Cuts of each robot."""
PROCESSES = 2
SAME = 1e-3
"""Relative difference up to which two costs count as the same."""
WIDE = 0.02
"""Gap above which a plan is listed."""
LONG = 30.0
"""Seconds above which a certificate is listed."""
NAMED = 40
"""Most cuts listed of each kind."""
COSTS = (
    "robot",
    "cuts",
    "feasible",
    "grid",
    "only here",
    "only grid",
    "dearer > 0.1 %",
    "worst %",
    "cheaper > 0.1 %",
    "best %",
)
PROVED = (
    "robot",
    "gap median %",
    "gap 95 %",
    "gap worst %",
    "gap <= 0.5 %",
    "gap <= 2 %",
    "plan s",
    "grid's s",
    "plan, graph s",
    "grid's, graph s",
    "certificate s",
)

HOW = f"""\
The random contours of the comparison of methods (three robots, 60 to 80 nodes, joints 4 and 6
endless, speeds of 0.75 to 1.35 times the fastest on a coarse grid, so that some have no motion).
Feasible: cuts with a plan of method "continuous", gamma sampled every 2 deg as it comes; grid:
with one of method "exact" and `refine` on 1 deg. Dearer, cheaper: cuts where both have a plan, and
the continuous one costs over 0.1 % more or less; worst and best the relative differences at the
ends. Gap: what `certify` leaves, asked for {100 * GAP:g} %, within the work it does of itself.
Seconds: medians; without the graph and with it (the two searches have graphs of different steps).
Processes of one thread each, two at a time."""


def run(*, quick: bool) -> list[Report]:
    """Measure them."""
    counts = (2, 2, 2) if quick else COUNTS
    keys = [(name, i) for name, count in zip(ROBOTS, counts, strict=True) for i in range(count)]
    return [report(in_processes(weigh_cut, keys, 1 if quick else PROCESSES))]


def report(made: Sequence[Weighed]) -> Report:
    """Return the results of the cuts as tables, and list the remarkable ones."""
    robots = {name: [w for w in made if w.name == name] for name in ROBOTS}
    rows = [_row(name, weighed) for name, weighed in (robots | {"all": made}).items()]
    return Report(
        title=f"Continuous gamma: {len(made)} random contours",
        how=HOW,
        sheets=[
            Sheet(columns=COSTS, rows=[row[: len(COSTS)] for row in rows]),
            Sheet(columns=PROVED, rows=[(row[0], *row[len(COSTS) :]) for row in rows]),
        ],
        findings=_findings(made),
    )


def weigh_cut(key: tuple[str, int]) -> Weighed:
    """Plan one cut by both methods, and certify it."""
    drawn = cut(*key)
    task = Task(
        contour=drawn.contour,
        robot=drawn.robot,
        tool=drawn.tool,
        placement=np.eye(4),
        speed=drawn.speed,
        options=PlanOptions(),
    )
    return weigh(*key, task)


def _row(name: str, made: Sequence[Weighed]) -> tuple[str, ...]:
    here = [w for w in made if w.cost is not None]
    there = [w for w in made if w.grid_cost is not None]
    excess = [100 * w.excess for w in made if w.excess is not None]
    gaps = [100 * w.gap for w in here if w.gap is not None]
    return (
        name,
        str(len(made)),
        str(len(here)),
        str(len(there)),
        str(sum(w.grid_cost is None for w in here)),
        str(sum(w.cost is None for w in there)),
        str(sum(e > 100 * SAME for e in excess)),
        _of(max, excess),
        str(sum(e < -100 * SAME for e in excess)),
        _of(min, excess),
        _of(median, gaps),
        _of(lambda of: float(np.quantile(of, 0.95)), gaps),
        _of(max, gaps),
        f"{sum(gap <= 100 * GAP for gap in gaps)} of {len(gaps)}",
        f"{sum(gap <= 100 * WIDE for gap in gaps)} of {len(gaps)}",
        *(
            _of(median, times, "{:.3g}")
            for times in (
                [w.seconds for w in made],
                [w.grid_seconds for w in made],
                [w.seconds + w.graph_seconds for w in made],
                [w.grid_seconds + w.grid_graph_seconds for w in made],
                [w.certificate_seconds for w in here],
            )
        ),
    )


def _of(
    what: Callable[[Sequence[float]], float], values: Sequence[float], form: str = "{:.2f}"
) -> str:
    return form.format(what(values)) if values else "-"


def _findings(made: Sequence[Weighed]) -> list[str]:
    """List the remarkable cuts."""
    over = [w for w in made if w.bound is not None and _cheapest(w) < w.bound]
    kinds = {
        "a bound above a cost": over,
        "dearer than the grid's refined plan by over 0.1 %": [
            w for w in made if w.excess is not None and w.excess > SAME
        ],
        "a plan of the grid alone": [w for w in made if w.cost is None and w.grid_cost is not None],
        f"a gap over {100 * WIDE:g} %": [w for w in made if w.gap is not None and w.gap > WIDE],
        f"a certificate of over {LONG:g} s": [w for w in made if w.certificate_seconds > LONG],
    }
    return [
        f"{kind}: {len(which)}" + "".join(f"; {w}" for w in which[:NAMED])
        for kind, which in kinds.items()
    ]


def _cheapest(w: Weighed) -> float:
    """Return the least cost that was found."""
    return min(cost for cost in (w.cost, w.grid_cost, np.inf) if cost is not None)
