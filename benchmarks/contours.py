"""Random contours: greedy, exact and refined plans, and the comparators of the paper."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from statistics import median
from time import perf_counter
from typing import TypeVar

import numpy as np

from benchmarks._figures import Report
from benchmarks._following import Follower
from benchmarks._random_contours import ROBOTS, Cut, cut
from benchmarks._tally import Outcome, sheet
from kerfpath import NoFeasiblePath, plan
from kerfpath.arrays import Array
from kerfpath.planner import layered_graph
from kerfpath.plans import Plan

__all__ = ["run"]

COUNTS = (134, 133, 133)
"""Cuts of each robot."""
SUBSET = 8
"""Number of cuts of each robot, from the first, that the comparators also get."""
PROCESSES = 2
FREE = 1e6
"""Multiple of the accelerations that is never active."""

METHODS = ("paper", "first-order", "exact", "refined")

HOW = """\
Random smooth 3-D contours, seeded: closed or open by equal chance, 100 to 300 mm across, swollen
and undulating, in front of the robot at 0.45 to 0.7 of its reach, tilted by up to 30 deg, the tool
axis leaning by up to about 20 deg more along the way; 60 to 80 nodes; a head whose beam leaves the
flange axis by 45 deg; joints 4 and 6 endless; accelerations of the KUKA as its maker states them,
of the others by the library's ratio. The speed is 0.75 to 1.35 times the fastest on a graph of 3
deg steps of gamma, the search uses 1 deg: nodes that far apart and steps that fine let gamma step
under the acceleration limits on most cuts; a grid of 5 deg froze it on nearly all. Manhattan
metric, sum (14). All methods search the same layered graph. paper: section 3.2, greedy.
first-order: the optimum under (5) alone, feasible only where its path keeps (6) by itself. exact:
proved. refined: plan(refine=True), gamma off the grid from the exact path and from the best one
without (6); its time includes the exact search. "Beyond the grid": feasible where the graph is
proved to have no path. Not counted in any time: the graph. Two processes, one core each."""

HOW_COMPARED = """\
The first cuts of each robot again, with the two comparators of the paper's introduction. Neither
is bound to the grid: they search gamma as a continuous course, so their cost can lie below the
grid's optimum, and the fair yardstick is the refined plan. Both get closed-form kinematics from
kerfpath, compiled, and for each course the best motion that follows it from any posture of the
first node. genetic (Shibata et al. 1997): pymoo's GA, genes are the level of gamma and 12
control points of a uniform cubic B-spline about it, first (5) and (6), then cost; 200
generations of 100; SBX and polynomial mutation. 6, 12 and 20 control points were tried;
few did better on slack cuts and many on tight ones, 12 are between.
sampling (Yao and Gupta 2007): OMPL's RRT* over node and gamma in each posture, edges forwards
only and within (5); then smoothed by Gaussian filters of 11 widths, the cheapest that keeps (6)
too taken, or none. 80 000 edges are tried per cut instead of a time limit, so that runs repeat
(1 to 2 s). RRTConnect found paths in less than 0.1 s, but several times as long; of the ranges 6,
15 and 40 and goal biases 0.05 and 0.2, the best are kept."""


_Key = tuple[str, int]
"""Robot and number of a cut."""
_R = TypeVar("_R")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Searched:
    """The library's results for one cut, and the properties of its graph."""

    outcomes: list[Outcome]
    graph_seconds: float
    layer: float
    steps: bool | None


def run(*, quick: bool) -> list[Report]:
    """Measure all methods on many cuts, and the comparators on some."""
    counts, subset = ((2, 2, 2), 1) if quick else (COUNTS, SUBSET)
    keys = [(name, i) for name, count in zip(ROBOTS, counts, strict=True) for i in range(count)]
    some = [key for key in keys if key[1] < subset]
    searched = _in_processes({"": _search}, keys, 1 if quick else PROCESSES)[""]
    assert not isinstance(searched, str)
    outcomes = [o for result in searched for o in result.outcomes]
    compared, findings = [o for o in outcomes if o.index < subset], []
    for name, made in _in_processes({"genetic": _genetic, "sampling": _sampled}, some, 1).items():
        if isinstance(made, str):
            findings.append(f"{name}: not run ({made})")
        else:
            compared += made
            findings.append(_against_refined(compared, name))
    return [
        Report(
            title=f"Random contours: {len(keys)} cuts, {len(ROBOTS)} robots",
            how=HOW,
            sheets=[sheet(outcomes, METHODS)],
            findings=_facts(searched),
        ),
        Report(
            title=f"Random contours: comparators on {len(some)} of the cuts",
            how=HOW_COMPARED,
            sheets=[sheet(compared, (*METHODS, "genetic", "sampling"))],
            findings=findings,
        ),
    ]


def _in_processes(
    tasks: dict[str, Callable[[_Key], _R]], keys: Sequence[_Key], processes: int
) -> dict[str, list[_R] | str]:
    """Return the results of each task for all keys in order, or why it did not run.

    Each task has `processes` workers, which are warmed up first; all tasks run at the same time.
    """
    pools = {
        name: ProcessPoolExecutor(
            processes,
            mp_context=get_context("spawn"),
            initializer=_warm_up,
            initargs=(task, keys[0]),
        )
        for name, task in tasks.items()
    }
    made: dict[str, list[_R] | str] = {}
    waiting: dict[str, list[Future[_R]]] = {}
    for name, task in tasks.items():
        waiting[name] = [pools[name].submit(task, key) for key in keys]
    for name, futures in waiting.items():
        try:
            made[name] = [future.result() for future in futures]
        except ImportError as error:
            made[name] = str(error)
        pools[name].shutdown()
    return made


def _warm_up(task: Callable[[_Key], object], key: _Key) -> None:
    """Compile what a task needs; a missing requirement is reported when it runs."""
    with suppress(ImportError):
        task(key)


def _search(key: _Key) -> _Searched:
    """Plan a cut by every method of the library."""
    task = cut(*key)
    start = perf_counter()
    layered_graph(task.contour, task.robot, **task.options)
    graph_seconds = perf_counter() - start
    follower, outcomes = Follower(task), list[Outcome]()
    exact: Plan | None = None
    for method in METHODS:
        start = perf_counter()
        made = _planned(task, method)
        seconds = perf_counter() - start
        if method == "exact":
            exact = made
        outcomes.append(_outcome(key, follower, method, seconds, made.q if made else None))
    return _Searched(
        outcomes=outcomes,
        graph_seconds=graph_seconds,
        layer=float(np.diff(task.graph.start).mean()),
        steps=None if exact is None else bool(np.ptp(exact.gamma) > 0),
    )


def _planned(task: Cut, method: str) -> Plan | None:
    """Return the plan of one method on the cut's graph, None if it finds none."""
    robot = task.robot
    if method == "first-order":
        robot = robot.with_limits(acceleration=FREE * robot.speed_limits()[1])
    try:
        return plan(
            task.contour,
            robot,
            speed=task.speed,
            graph=task.graph,
            method="paper" if method == "paper" else "exact",
            refine=method == "refined",
            **task.options,
        )
    except NoFeasiblePath:
        return None


def _genetic(key: _Key) -> Outcome:
    """Plan a cut by the genetic algorithm."""
    from benchmarks._genetic import genetic

    return _course(key, "genetic", lambda follower: genetic(follower, seed=key[1]))


def _sampled(key: _Key) -> Outcome:
    """Plan a cut by sampling."""
    from benchmarks._sampling import sampled, start_generators

    start_generators(1)
    return _course(key, "sampling", lambda follower: sampled(follower, seed=key[1]))


def _course(key: _Key, method: str, search: Callable[[Follower], Array | None]) -> Outcome:
    """Return the outcome of a search for the course of gamma for a cut."""
    follower = Follower(cut(*key))
    start = perf_counter()
    gamma = search(follower)
    seconds = perf_counter() - start
    q = None if gamma is None else follower.follow(gamma[None]).q[0]
    return _outcome(key, follower, method, seconds, q)


def _outcome(
    key: _Key, follower: Follower, method: str, seconds: float, q: Array | None
) -> Outcome:
    """Rate a motion, in the same way for all methods."""
    cost, feasible = (np.inf, False) if q is None else follower.weigh(q)
    return Outcome(
        robot=key[0],
        index=key[1],
        method=method,
        seconds=seconds,
        cost=cost if feasible else None,
    )


def _facts(searched: Sequence[_Searched]) -> list[str]:
    """Describe the graphs."""
    stepping = [s.steps for s in searched if s.steps is not None]
    return [
        f"{median(s.layer for s in searched):.0f} vertices a layer (median); graph "
        f"{median(s.graph_seconds for s in searched):.3f} s (median)",
        f"gamma steps in {sum(stepping)} of {len(stepping)} exact plans, and stays on one value "
        "in the others",
        "cost and limits (5), (6) of every motion were weighed anew by `_following.py`, the same "
        "for all methods",
    ]


def _against_refined(outcomes: Sequence[Outcome], method: str) -> str:
    """Compare a method with the refined plans of the same cuts."""
    refined = {(o.robot, o.index): o.cost for o in outcomes if o.method == "refined"}
    pairs = [(o.cost, refined[o.robot, o.index]) for o in outcomes if o.method == method]
    excess = [100 * (c / r - 1) for c, r in pairs if c is not None and r is not None]
    if not excess:
        return f"{method}: no cut on which it and the refined plan are feasible"
    return (
        f"{method} against refined, {len(excess)} cuts feasible in both: excess mean "
        f"{np.mean(excess):.2f} %, median {median(excess):.2f} %, least {min(excess):.2f} %, worst "
        f"{max(excess):.2f} %; cheaper by more than 0.1 % on {sum(e < -0.1 for e in excess)}"
    )
