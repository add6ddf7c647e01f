"""pareto(): many runs of the planner over one graph, and the plans that none of them beats."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.cell import Cell
from kerfpath.comfort import Comfort
from kerfpath.contour import Contour, FrameKind
from kerfpath.front._adaptive import reach_of
from kerfpath.front._attempt import Attempts
from kerfpath.front._collection import AHEAD, Collection, Reached, Search, whole_number
from kerfpath.front._criteria import judge_of
from kerfpath.front._runs import Run
from kerfpath.front._set import Front, ParetoSet
from kerfpath.graph import LayeredGraph
from kerfpath.planner import layered_graph
from kerfpath.plans import Plan
from kerfpath.robots import Robot
from kerfpath.search import Closure
from kerfpath.tilt import Tilt

__all__ = ["pareto"]


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
    gamma_step: float = np.pi / 180,
    frames: FrameKind = "rotation-minimising",
    tilt: Tilt | None = None,
    postures: Sequence[int] | None = None,
    eta_v: float = 1.0,
    eta_a: float = 1.0,
    closure: Closure = "free",
    rotation: ArrayLike | None = None,
    home: ArrayLike | None = None,
    cell: Cell | None = None,
    comfort: Comfort | None = None,
    graph: LayeredGraph | None = None,
    audit: Callable[[Plan], Sequence[object]] | None = None,
    workers: int | None = None,
    ahead: int = AHEAD,
    progress: Callable[[int], None] | None = None,
) -> ParetoSet:
    """Return plans of which none is as good as another in all criteria and better in one.

    The designer's collection of section 3.2: the layered graph is built once, and the planner run
    over it with other objectives, metrics, weights and eta, and with windows on the joints, which
    are the epsilon constraint for the range (9). Every plan is the proved optimum of what its run
    asked for.

    Parameters
    ----------
    contour, robot, tool, placement, speed, gamma_step, frames, tilt, postures, closure, rotation
        As in `kerfpath.plan`.
    criteria : sequence of str
        Less is better of: "displacement" (7) and "range" (9), over the joints' velocity limits and
        added up (s); "velocity", the largest increment (8) of any joint, and "acceleration", as
        shares of the limits; "displacement_J", "increment_J" and "range_J" of joint J, from 1
        (rad, of a rail m); "time" from home along the contour and back (s). More is better of
        "speed", the fastest constant one of the plan's path (m/s), of "clearance" in the cell (m),
        and of the measures of `kerfpath.comfort`, at their least.
    runs : int
        How often the planner is run.
    search : {"adaptive", "grid"}
        Where the front is sparse, or over a plain grid of weights and eta.
    seed : int
        Of all that is random; the same seed and `ahead` give the same set, whatever `workers`.
    eta_v, eta_a : float
        Largest share of the velocity and acceleration limits that any run may use.
    home : (n,) rad, optional
        Where the arm comes from and goes back to; only "time" needs it.
    cell, comfort : optional
        As in `kerfpath.plan`; in a cell runs go one after another.
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
    judge = judge_of(
        criteria, robot, eta_v=eta_v, eta_a=eta_a, cell=cell, comfort=comfort, home=home
    )
    workers = whole_number((os.cpu_count() or 1) if workers is None else workers, "workers")
    if graph is None:
        graph = layered_graph(
            contour,
            robot,
            tool=tool,
            placement=placement,
            gamma_step=gamma_step,
            frames=frames,
            tilt=tilt,
            postures=postures,
            comfort=comfort,
        )
    options: dict[str, Any] = {
        "tool": tool,
        "placement": placement,
        "speed": speed,
        "gamma_step": gamma_step,
        "frames": frames,
        "tilt": tilt,
        "closure": closure,
        "rotation": rotation,
        "comfort": comfort,
    }
    attempts = Attempts(
        contour=contour, robot=robot, graph=graph, cell=cell, options=options, audit=audit
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
