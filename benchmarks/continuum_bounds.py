"""Compare plans near the fastest speed with many starts, and bounds with strong competitors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from time import perf_counter

import numpy as np

from benchmarks._certified import Task, in_processes, weigh
from benchmarks._figures import Report, Sheet
from benchmarks._narrow import Narrow, try_narrow
from benchmarks._random_contours import ROBOTS, cut
from benchmarks._starts import GRIDS, SHAKES, from_grids, shaken
from kerfpath import PlanOptions, fastest_speed

__all__ = ["Fast", "bounds", "near_fastest", "run", "try_fast"]

SHARE = 0.97
"""Requested share of the fastest speed."""
TASKS = 10
"""Tasks of each robot near the fastest speed."""
INSTANCES = 2000
"""Short contours with a competitor of the bound."""
PROCESSES = 2
SECONDS = 60.0
"""Time after which a certificate near the fastest speed begins no further stage."""
NEAR = 0.01
"""Target for the relative cost over the best known."""
NAMED = 40
"""Most pieces listed of each kind."""
FAST = (
    "robot",
    "cut",
    "cost",
    "grid, refined",
    "best of starts",
    "excess %",
    "gap %",
    "nodes at (6) %",
    "plan s",
    "certificate s",
    "starts s",
)
BOUND = (
    "robot",
    "instances",
    "costs compared",
    "violations",
    "nodes",
    "grid step deg",
    "shortfall median %",
    "95 %",
    "worst %",
    "shortfall <= 0.1 %",
    "plan > 0.1 % dearer",
    "certificate s",
    "competitors s",
)

HOW_FAST = f"""\
The first random contours of each robot at {SHARE:g} of the fastest speed that `fastest_speed` finds
(1 deg, off the grid), where (6) binds at many nodes. Best of {len(GRIDS) + len(SHAKES)} starts:
the refined plans of grids of 2, 1 and 0.5 deg, two of them with samples moved by a third of a step,
and then smooth random changes of gamma of the best so far, refined, each at most so large in rad:
{", ".join(f"{size:g}" for size in SHAKES)}. Excess: the plan of method "continuous" over the least
cost known (its own included). Gap: what `certify` leaves, asked for 0.5 %;
it begins no further stage after {SECONDS:g} s."""

HOW_BOUND = """\
Pieces of 10 to 20 nodes of random contours, six robots, three metrics, random weights, eta and
speeds; the joints may leave the range that a first plan uses by 2 to 8 deg only, so that gamma has
little room and a dense grid can be searched: method "exact" on steps of 0.05 to 0.2 deg, the finest
with at most so many vertices as are searched in a second or two; its refinement; and the refined
plan of a grid of 1 deg. The bound is asked for a gap of 0.05 % and begins no
further stage after a second: what is wrong in
it would show as a bound above one of these costs. Shortfall: how far the bound lies below the least
cost that is known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fast:
    """The result for one task near the fastest speed."""

    name: str
    index: int
    cost: float | None
    grid_cost: float | None
    best: float | None
    gap: float | None
    bound: float | None
    at_limit: float
    seconds: float
    certificate_seconds: float
    starts_seconds: float

    @property
    def excess(self) -> float | None:
        """Relative cost over the least that is known."""
        known = [c for c in (self.cost, self.best) if c is not None]
        return None if self.cost is None else self.cost / min(known) - 1

    def __str__(self) -> str:
        said = "no plan" if self.excess is None else f"{100 * self.excess:+.2f} %"
        return f"{self.name} {self.index} ({said})"


def run(*, quick: bool) -> list[Report]:
    """Measure both."""
    tasks, instances = (1, 12) if quick else (TASKS, INSTANCES)
    keys = [(name, i) for name in ROBOTS for i in range(tasks)]
    return [
        near_fastest(in_processes(try_fast, keys, min(PROCESSES, tasks))),
        bounds(in_processes(try_narrow, range(instances), PROCESSES)),
    ]


def near_fastest(made: Sequence[Fast]) -> Report:
    """Return the results of tasks near the fastest speed as a table."""
    rows = [_fast_row(w) for w in made]
    planned = [w for w in made if w.excess is not None]
    excess = [100 * w.excess for w in planned if w.excess is not None]
    gaps = [100 * w.gap for w in planned if w.gap is not None]
    missed = [w for w in made if w.cost is None and w.best is not None]
    near = sum(e <= 100 * NEAR for e in excess)
    above = sum(_is_above(w.bound, w.cost, w.grid_cost, w.best) for w in made)
    findings = [
        f"{len(planned)} of {len(made)} planned; {near} within {100 * NEAR:g} % of the best known",
        f"no plan where a start finds one: {len(missed)}" + "".join(f"; {w}" for w in missed),
        f"bounds above a cost: {above}",
    ]
    if excess and gaps:
        findings.append(
            f"excess median {median(excess):.2f} %, worst {max(excess):.2f} %; gap median "
            f"{median(gaps):.2f} %, worst {max(gaps):.2f} %"
        )
    return Report(
        title=f"Continuous gamma: {len(made)} contours near the fastest speed",
        how=HOW_FAST,
        sheets=[Sheet(columns=FAST, rows=rows)],
        findings=findings,
    )


def try_fast(key: tuple[str, int]) -> Fast:
    """Plan one cut near the fastest speed, and from many starts."""
    drawn = cut(*key)
    fastest = fastest_speed(
        drawn.contour, drawn.robot, graph=drawn.graph, refine=True, **drawn.options
    )
    task = Task(
        contour=drawn.contour,
        robot=drawn.robot,
        tool=drawn.tool,
        placement=np.eye(4),
        speed=SHARE * fastest.speed,
        options=PlanOptions(),
    )
    weighed = weigh(*key, task, seconds=SECONDS)
    start = perf_counter()
    found = list(from_grids(task))
    here = task.made().plan
    begun = min([*found, *([here] if here else [])], key=lambda p: p.cost, default=None)
    if begun is not None:
        found += shaken(begun, np.random.default_rng([9, key[1]]))
    return Fast(
        name=key[0],
        index=key[1],
        cost=weighed.cost,
        grid_cost=weighed.grid_cost,
        best=min((made.cost for made in found), default=None),
        gap=weighed.gap,
        bound=weighed.bound,
        at_limit=weighed.at_limit,
        seconds=weighed.seconds + weighed.graph_seconds,
        certificate_seconds=weighed.certificate_seconds,
        starts_seconds=perf_counter() - start,
    )


def _fast_row(w: Fast) -> tuple[str, ...]:
    costs = (w.cost, w.grid_cost, w.best)
    return (
        w.name,
        str(w.index),
        *("-" if cost is None else f"{cost:.4f}" for cost in costs),
        "-" if w.excess is None else f"{100 * w.excess:.2f}",
        "-" if w.gap is None else f"{100 * w.gap:.2f}",
        f"{100 * w.at_limit:.0f}",
        f"{w.seconds:.3g}",
        f"{w.certificate_seconds:.3g}",
        f"{w.starts_seconds:.3g}",
    )


def _is_above(bound: float | None, *costs: float | None) -> bool:
    return bound is not None and any(cost is not None and bound > cost for cost in costs)


def bounds(tried: Sequence[Narrow | None]) -> Report:
    """Return the results of narrow pieces, None for those without a motion, as a table."""
    made = [one for one in tried if one is not None]
    families = {name: [m for m in made if m.robot == name] for name in {m.robot: 0 for m in made}}
    rows = [_bound_row(name, of) for name, of in (families | {"all": made}).items()]
    above = [m for m in made if m.violations]
    dearer = [m for m in made if m.excess > 1e-3]
    return Report(
        title="Continuous gamma: bounds beside competitors",
        how=HOW_BOUND,
        sheets=[Sheet(columns=BOUND, rows=rows)],
        findings=[
            f"{len(tried) - len(made)} of {len(tried)} pieces have no motion to begin with",
            f"bounds above a cost: {len(above)}" + "".join(f"; {m}" for m in above[:NAMED]),
            f"plans over 0.1 % dearer than the least cost known: {len(dearer)}"
            + "".join(f"; {m}" for m in dearer[:NAMED]),
        ],
    )


def _bound_row(name: str, made: Sequence[Narrow]) -> tuple[str, ...]:
    short = [100 * m.shortfall for m in made]
    return (
        name,
        str(len(made)),
        str(sum(len(m.costs) for m in made)),
        str(sum(m.violations for m in made)),
        f"{median(m.nodes for m in made):.0f}" if made else "-",
        f"{median(m.step for m in made):.2f}" if made else "-",
        *(
            (f"{median(short):.3f}", f"{np.quantile(short, 0.95):.3f}", f"{max(short):.3f}")
            if short
            else ("-",) * 3
        ),
        f"{sum(m.shortfall <= 1e-3 for m in made)} of {len(made)}",
        str(sum(m.excess > 1e-3 for m in made)),
        f"{median(m.certificate_seconds for m in made):.3g}" if made else "-",
        f"{median(m.competitor_seconds for m in made):.3g}" if made else "-",
    )
