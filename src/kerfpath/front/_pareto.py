"""pareto(): run the planner many times over one graph, and keep the plans that none dominates."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from typing import Unpack

from numpy.typing import ArrayLike

from kerfpath._arrays import as_pose, floats
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.front._criteria import criteria_named
from kerfpath.front._front import Front, ParetoSet
from kerfpath.front._planned import graph_of_runs
from kerfpath.front._problem import Evaluation, ParetoProblem
from kerfpath.front._search import AHEAD, FrontSearch, SearchKind, whole_number
from kerfpath.front._subproblem import Subproblem
from kerfpath.graph import LayeredGraph
from kerfpath.options import GraphKeywords, PlanMethod, PlanOptions, with_keywords
from kerfpath.plans import Plan
from kerfpath.robots import Robot
from kerfpath.search import Closure

__all__ = ["pareto"]


class ParetoKeywords(GraphKeywords, total=False):
    """The options that `pareto` takes as keywords."""

    method: PlanMethod
    eta_v: float
    eta_a: float
    closure: Closure
    rotation: ArrayLike | None


def pareto(
    contour: Contour,
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    speed: float | None = None,
    criteria: Sequence[str] = ("displacement", "velocity", "range"),
    runs: int = 100,
    search: SearchKind = "adaptive",
    seed: int = 0,
    home: ArrayLike | None = None,
    options: PlanOptions | None = None,
    cell: Cell | None = None,
    graph: LayeredGraph | None = None,
    audit: Callable[[Plan], Sequence[object]] | None = None,
    workers: int | None = None,
    ahead: int = AHEAD,
    progress: Callable[[int], None] | None = None,
    **keywords: Unpack[ParetoKeywords],
) -> ParetoSet:
    """Return the Pareto front: plans that no other plan found dominates.

    This is the designer's collection of plans of section 3.2. The layered graph is built once, and
    the planner runs over it with different objectives, metrics, weights and eta, and with windows
    on the joints, which are the epsilon constraint for the range (9). Every second run is over
    continuous gamma: it first tries to improve a plan of the grid in one criterion while the
    criteria that can be bounded stay as good, and then searches between neighbours on the front. A
    plan on the grid is the proved optimum of its run; a plan over continuous gamma is the best
    motion found. External axes follow the courses of the plans that `kerfpath.plan` finds on the
    grid, and may leave them over continuous gamma; with any other method they have a grid too.

    Parameters
    ----------
    contour, robot, tool, placement, speed, cell
        As in `kerfpath.plan`; in a cell the runs go one after another.
    options
        As in `kerfpath.plan`, or as keywords gamma_step, frames, tilt, postures, closure, rotation,
        comfort, method, eta_v and eta_a. eta_v and eta_a are the largest shares of the velocity and
        acceleration limits that a run may use. Objective, metric and weights belong to the runs;
        the speed is constant. Any method except "continuous" keeps all runs on the grid.
    criteria : sequence of str
        Names in `kerfpath.front.CRITERIA`, or in `JOINT_CRITERIA` with a joint from 1, such as
        "range_6"; docs/pareto.md says what each measures. "clearance" needs a cell.
    runs : int
        Number of runs of the planner.
    search : {"adaptive", "grid"}
        Search where the front is sparse, or over a plain grid of weights and eta.
    seed : int
        Seed of the random numbers; the same seed and `ahead` give the same front, whatever
        `workers` is.
    home : (n,) rad, optional
        Where the arm comes from and goes back to; only "time" needs it.
    graph : LayeredGraph, optional
        The layered graph of the same task, from `kerfpath.planner.layered_graph`.
    audit : callable, optional
        Returns the faults of a plan; only plans without faults are kept. Default:
        `kerfpath.audit`, with the cell.
    workers : int, optional
        Number of threads; default: the number of cores.
    ahead : int
        Number of runs that may be in progress: fewer runs learn more from each other, more keep
        more workers busy.
    progress : callable, optional
        Called with the number of runs done since the last call.

    Raises
    ------
    NoFeasiblePath
        No run has a plan that passes its audit; `counts` has the number of runs for each reason.
    InputError
        The criteria or the search are unknown, there is less than one run, or `kerfpath.plan`
        refuses an argument.
    """
    asked = with_keywords(
        options,
        keywords,
        ParetoKeywords,
        feed="constant",
        refine=False,
        certify=None,
    )
    found = criteria_named(criteria, robot, options=asked, cell=cell, home=home)
    workers = whole_number((os.cpu_count() or 1) if workers is None else workers, "workers")
    T_flange_tip, T_base_part = as_pose(tool, "tool"), as_pose(placement, "placement")
    if graph is None:
        graph = graph_of_runs(
            contour, robot, tool=T_flange_tip, placement=T_base_part, speed=speed, options=asked,
            cell=cell,
        )  # fmt: skip
    problem = ParetoProblem(
        contour=contour,
        robot=robot,
        tool=T_flange_tip,
        placement=T_base_part,
        speed=speed,
        options=asked,
        graph=graph,
        criteria=found,
        cell=cell,
        home=None if home is None else floats(home, "home", (robot.joints,)),
        audit=audit,
    )
    front_search = FrontSearch(problem, runs=runs, search=search, seed=seed, ahead=ahead)
    plans: dict[int, Plan] = {}

    with ThreadPoolExecutor(1 if cell else workers) as pool:

        def submit(number: int, run: Subproblem) -> Callable[[], Evaluation | str]:
            future = pool.submit(problem.solve, run, first=number == 0)

            def wait() -> Evaluation | str:
                made = future.result()
                if progress is not None:
                    progress(1)
                if isinstance(made, str):
                    return made
                plans[number] = made
                return problem.evaluate(made)

            return wait

        front = front_search.run(submit)
    return ParetoSet(
        **{each.name: getattr(front, each.name) for each in fields(Front)},
        plans=tuple(plans[number] for number in front.numbers),
    )
