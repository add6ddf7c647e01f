"""pareto(): many runs of the planner over one graph, and the plans that none of them beats."""

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
    """Return plans of which none is as good as another in all criteria and better in one.

    The designer's collection of section 3.2: the layered graph is built once, and the planner run
    over it with other objectives, metrics, weights and eta, and with windows on the joints, which
    are the epsilon constraint for the range (9). Every second run is over continuous gamma, where
    it is looked for how the plans of the grid can be bettered in one criterion and as good in those
    that can be held, and then between the neighbours on the front. A plan of the grid is the proved
    optimum of what its run asked for, one over continuous gamma the best motion found. External
    axes follow the courses of the plans that `kerfpath.plan` finds on the grid, and leave them over
    continuous gamma; with any other method they have a grid of their own.

    Parameters
    ----------
    contour, robot, tool, placement, speed, cell
        As in `kerfpath.plan`; in a cell runs go one after another.
    options
        As in `kerfpath.plan`, or as keywords gamma_step, frames, tilt, postures, closure, rotation,
        comfort, method, eta_v and eta_a: the largest share of the velocity and acceleration limits
        that any run may use. Runs say objective, metric and weights; the speed is constant. Any
        method but "continuous" keeps all runs on the grid.
    criteria : sequence of str
        Names in `kerfpath.front.CRITERIA`, or in `JOINT_CRITERIA` with a joint from 1, as
        "range_6"; docs/pareto.md says what each measures. "clearance" needs a cell.
    runs : int
        How often the planner is run.
    search : {"adaptive", "grid"}
        Where the front is sparse, or over a plain grid of weights and eta.
    seed : int
        Of all that is random; the same seed and `ahead` give the same set, whatever `workers`.
    home : (n,) rad, optional
        Where the arm comes from and goes back to; only "time" needs it.
    graph : LayeredGraph, optional
        The layered graph of this very task, kept from `kerfpath.planner.layered_graph`.
    audit : callable, optional
        Returns what is wrong with a plan; only plans with nothing wrong are kept. Default:
        `kerfpath.audit`, with the cell.
    workers : int, optional
        Runs at a time, in threads; default: the processor's cores.
    ahead : int
        Runs that may be under way: fewer learn more from each other, more keep more workers busy.
    progress : callable, optional
        Called with the number of runs done since the last call.

    Raises
    ------
    NoFeasiblePath
        No run has a plan that passes its audit; `counts` says why not, by number of runs.
    InputError
        Unknown criteria or search, fewer than one run, and what `kerfpath.plan` refuses.
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
