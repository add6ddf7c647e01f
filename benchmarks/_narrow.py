"""Short contours with little room for gamma, so that the best path of a dense grid can be found."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks._certified import Task
from benchmarks._random_contours import contour, head
from kerfpath import NoFeasiblePath, PlanOptions, fastest_speed, refine, robot
from kerfpath.certifier import certify
from kerfpath.plans import Plan
from kerfpath.search import Metric

__all__ = ["Narrow", "try_narrow"]

ROBOTS = (
    "abb_irb2400_155",
    "kuka_kr16_r1610_2",
    "staubli_tx2_90xl",
    "fanuc_m20ia",
    "ur_ur10e",
    "ur_ur5e",
)
RATIO = "cybertech_8_to_20kg"
"""Replaces accelerations that a maker does not publish."""
METRICS: tuple[Metric, ...] = ("manhattan", "euclid", "chebychev")
STEPS = (0.05, 0.1, 0.2)
"""Steps of gamma of the dense grid, deg, finest first."""
MOST_VERTICES = 6000
"""Most vertices of a dense grid: its search takes a second or two."""
SHARES = (0.3, 0.9)
"""Range of the speed, as a share of the fastest; close to that a grid seldom has a path."""
GAP, SECONDS = 5e-4, 1.0
"""Gap asked of a certificate, and the time after which it begins no further stage."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Narrow:
    """A bound and the motions that competitors found.

    Parameters
    ----------
    index : int
    robot, metric : str
    nodes : int
    step : float deg
        Of the dense grid; 0.0 if none was searched.
    cost : float
        Of the continuous plan; if that finds none, of the best competitor.
    bound : float
    costs : tuple of float
        Of all motions found.
    certificate_seconds, competitor_seconds : float s
    """

    index: int
    robot: str
    metric: str
    nodes: int
    step: float
    cost: float
    bound: float
    costs: tuple[float, ...]
    certificate_seconds: float
    competitor_seconds: float

    @property
    def violations(self) -> int:
        """Number of motions that cost less than the bound."""
        return sum(cost < self.bound for cost in self.costs)

    @property
    def shortfall(self) -> float:
        """Relative distance of the bound below the least cost."""
        return 1 - self.bound / min(self.costs)

    @property
    def excess(self) -> float:
        """Relative distance of the plan above the least cost."""
        return self.cost / min(self.costs) - 1

    def __str__(self) -> str:
        least = min(self.costs)
        return (
            f"piece {self.index} ({self.robot}, {self.metric}: bound {self.bound:.9g}, plan "
            f"{self.cost:.9g}, least {least:.9g})"
        )


def try_narrow(index: int) -> Narrow | None:
    """Bound a short contour and search for a motion below; None if it has no motion at all."""
    rng = np.random.default_rng([17, index])
    task = narrow_task(rng)
    if task is None:
        return None
    start = perf_counter()
    found, step = _dense(task)
    coarse = task.on_grid().made().plan
    found += [coarse] if coarse else []
    competed = perf_counter() - start
    made = task.made().plan
    if made is None and not found:
        return None
    best = made or min(found, key=lambda plan: plan.cost)
    start = perf_counter()
    proved = certify(best, gap=GAP, seconds=SECONDS, checkable=False).plan.proof
    assert proved.bound is not None
    return Narrow(
        index=index,
        robot=task.robot.id,
        metric=task.options.metric,
        nodes=len(task.contour),
        step=step,
        cost=best.cost,
        bound=proved.bound,
        costs=tuple(plan.cost for plan in (best, *found)),
        certificate_seconds=perf_counter() - start,
        competitor_seconds=competed,
    )


def narrow_task(rng: np.random.Generator) -> Task | None:
    """Return a random piece of a contour for a robot that may move little beside a first plan."""
    name = ROBOTS[rng.integers(len(ROBOTS))]
    machine = robot(name)
    if machine.acceleration is None:
        machine = robot(name, acceleration_ratio=RATIO)
    assert machine.lower is not None
    assert machine.upper is not None
    # One turn of each joint: the search for a first plan among all turns takes too long.
    lower, upper = np.maximum(machine.lower, -np.pi), np.minimum(machine.upper, np.pi)
    machine = machine.with_limits(lower=lower, upper=upper)
    assert machine.reach is not None
    options = PlanOptions(
        metric=METRICS[rng.integers(len(METRICS))],
        eta_v=rng.uniform(0.7, 1.0),
        eta_a=rng.uniform(0.5, 1.0),
    )
    whole = contour(rng, machine.reach)
    first, nodes = int(rng.integers(0, 40)), int(rng.integers(10, 21))
    piece = whole.part(first, first + nodes - 1, options.frames)
    share, room = rng.uniform(*SHARES), np.radians(rng.uniform(2, 8))
    weighted, factors = rng.random() < 0.5, rng.uniform(0.3, 3, 6)
    space: dict[str, Any] = {"tool": head(), "placement": np.eye(4)}
    with suppress(NoFeasiblePath):
        fastest = fastest_speed(
            piece, machine, eta_v=options.eta_v, eta_a=options.eta_a, refine=True, **space
        )
        if weighted:
            options = replace(options, weights=factors)
        task = Task(
            contour=piece, robot=machine, speed=share * fastest.speed, options=options, **space
        )
        plan = task.made().plan
        if plan is None:
            return None
        low, high = plan.q.min(axis=0) - room, plan.q.max(axis=0) + room
        held = machine.with_limits(lower=np.maximum(lower, low), upper=np.minimum(upper, high))
        return replace(task, robot=held)
    return None


def _dense(task: Task) -> tuple[list[Plan], float]:
    """Return the best path of a dense grid, its refined plan, and the step of the grid, deg."""
    for step in STEPS:
        dense = task.on_grid(gamma_step=np.radians(step), refine=False)
        graph = dense.graph()
        if len(graph.q) > MOST_VERTICES:
            continue
        made = dense.planned(graph)
        if made is None:
            break
        found = refine(made)
        return [made, *([found.plan] if found.done else [])], step
    return [], 0.0
