"""pareto(): many runs of the planner over one graph, and the plans that none of them beats."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from typing import Unpack

from numpy.typing import ArrayLike

from kerfpath._arrays import as_pose
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.front._adaptive import reach_of
from kerfpath.front._attempt import Attempts
from kerfpath.front._collection import AHEAD, Collection, Reached, Search, whole_number
from kerfpath.front._criteria import judge_of
from kerfpath.front._runs import Run
from kerfpath.front._set import Front, ParetoSet
from kerfpath.graph import LayeredGraph
from kerfpath.options import GraphKeywords, PlanOptions, chosen
from kerfpath.planner import layered_graph
from kerfpath.plans import Plan
from kerfpath.robots import Robot
from kerfpath.search import Closure

__all__ = ["pareto"]


class ParetoKeywords(GraphKeywords, total=False):
    """The options that `pareto` takes as keywords."""

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
    search: Search = "adaptive",
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
    are the epsilon constraint for the range (9). Every plan is the proved optimum of what its run
    asked for.

    Parameters
    ----------
    contour, robot, tool, placement, speed, cell
        As in `kerfpath.plan`; in a cell runs go one after another.
    options
        As in `kerfpath.plan`, or as keywords gamma_step, frames, tilt, postures, closure, rotation,
        comfort, eta_v and eta_a: the largest share of the velocity and acceleration limits that any
        run may use. Runs say objective, metric and weights; the speed is constant.
    criteria : sequence of str
        Less is better of: "displacement" (7) and "range" (9), over the joints' velocity limits and
        added up (s); "velocity", the largest increment (8) of any joint, and "acceleration", as
        shares of the limits; "displacement_J", "increment_J" and "range_J" of joint J, from 1
        (rad; m for a rail); "time" from home along the contour and back (s). More is better of
        "speed", the fastest constant one of the plan's path (m/s), of "clearance" in the cell (m),
        and of the measures of `kerfpath.comfort`, at their least.
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
    asked = chosen(options, keywords, ParetoKeywords, feed="constant", refine=False)
    judge = judge_of(
        criteria,
        robot,
        eta_v=asked.eta_v,
        eta_a=asked.eta_a,
        cell=cell,
        comfort=asked.comfort,
        home=home,
    )
    workers = whole_number((os.cpu_count() or 1) if workers is None else workers, "workers")
    T_flange_tip, T_base_part = as_pose(tool, "tool"), as_pose(placement, "placement")
    if graph is None:
        graph = layered_graph(
            contour, robot, tool=T_flange_tip, placement=T_base_part, options=asked
        )
    attempts = Attempts(
        contour=contour,
        robot=robot,
        tool=T_flange_tip,
        placement=T_base_part,
        speed=speed,
        options=asked,
        graph=graph,
        cell=cell,
        audit=audit,
    )
    collection = Collection(attempts, judge=judge, runs=runs, search=search, seed=seed, ahead=ahead)
    plans: dict[int, Plan] = {}
    begun = 0

    with ThreadPoolExecutor(1 if cell else workers) as pool:

        def submit(run: Run) -> Callable[[], Reached | str]:
            nonlocal begun
            number, begun = begun, begun + 1
            future = pool.submit(attempts.of if number else attempts.first, run)

            def settled() -> Reached | str:
                found = future.result()
                if progress is not None:
                    progress(1)
                if isinstance(found, str):
                    return found
                plans[number] = found
                return judge.losses(found), reach_of(found)

            return settled

        collection.gather(submit)
    front = collection.result()
    return ParetoSet(
        **{each.name: getattr(front, each.name) for each in fields(Front)},
        plans=tuple(plans[number] for number in front.numbers),
    )
