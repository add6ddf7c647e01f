"""Wording of results that hold on a grid only, and rounding that keeps printed figures true.

A search knows the rotations of its grid. A proof that a path is best, fastest or absent holds for
these rotations; those between them may allow more.
"""

from __future__ import annotations

from dataclasses import replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal

import numpy as np

from kerfpath import refiner
from kerfpath.errors import NoFeasiblePath
from kerfpath.losses import Loss
from kerfpath.options import PlanOptions
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.quickest import QuickMotion
from kerfpath.planner.task import Task
from kerfpath.plans import Plan, Proof, path_cost
from kerfpath.refiner import Refinement
from kerfpath.retime import feed, retime
from kerfpath.search import BeamWidth, ContinuousSearch, SearchProblem, find_shortest, find_slowed

# -----------------------------------------------------------------------------
# Plans off the grid: the best refinement of the paths worth starting from.


def refine_plan(task: Task, finder: CollisionFreeSearch, made: Plan) -> Plan:
    """Return the plan moved off its grid, clear and at least as good; unchanged if that fails.

    A refinement ends in the nearest optimum. The grid quantises the acceleration, so its best
    path under (6) may be far from the best motion, and its best path without (6) close to it: both
    are refined. With a jerk limit, which the grid ignores, the result may cost more.

    Raises
    ------
    NoFeasiblePath
        The jerk is limited, and no motion was found within the limit.
    """
    first = plan_first_order(task, finder)
    starts = [made]
    if first is not None and not np.array_equal(first.q, made.q):
        starts.append(first)
    found = [refiner.refine(start) for start in starts]
    jerk = task.robot.jerk_limit()
    done = [f for f in found if f.done and (jerk is not None or f.cost_after <= made.cost)]
    clear = [f for f in done if finder.is_clear(f.plan)]
    if not clear:
        why = f"not refined: off the grid it would {'not be clear' if done else 'cost more'}"
        why = why if found[0].done else found[0].statement
        if jerk is not None:
            raise NoFeasiblePath(
                f"contour {task.contour.name!r}: no motion was found within the jerk limits, "
                f"which the search of the grid ignores; {why}",
                proved=False,
                node=len(made.q) - 1,
            )
        statement = f"{made.proof.statement}; {why}"
        return replace(made, proof=replace(made.proof, statement=statement))
    best = min(clear, key=lambda f: f.cost_after)
    how = "" if best is found[0] else " by way of the best path without acceleration limits"
    statement = (
        f"{made.proof.statement}; refined off the grid{how}: cost {made.cost:.6g} to "
        f"{best.cost_after:.6g}"
    )
    optimal = made.proof.optimal and best.cost_after <= made.cost
    proof = Proof(optimal=optimal, statement=statement, grid_cost=made.cost)
    return replace(best.plan, proof=proof)


def plan_off_grid(task: Task, finder: CollisionFreeSearch) -> Refinement | None:
    """Look for a motion close to the best path without (6), for graphs without a path.

    If a path breaks (6) only because gamma changes in steps, a motion close to it may keep (6). The
    motion found is clear in the cell; None if (5) alone leaves no path.
    """
    first = plan_first_order(task, finder)
    return None if first is None else _keep_if_clear(refiner.refine(first), finder)


def plan_slowly(task: Task, quick: QuickMotion, finder: CollisionFreeSearch) -> Plan | None:
    """Return the plan at the speed asked for, refined from a motion that is at least as quick.

    Slowed down, that motion uses less of every limit, so it keeps them, too. None if a limit on the
    rotation is not kept.
    """
    asked = task.settings
    begun = replace(quick.plan, settings=asked, time=task.times)
    claim = "found among the quickest motions"
    cost = path_cost(
        begun.increments, asked.weights, asked.metric, asked.objective, begun.node_cost
    )
    begun = replace(begun, cost=cost, proof=Proof(optimal=False, statement=claim))
    found = refiner.refine(begun)
    if found.done and finder.is_clear(found.plan):
        return found.plan
    return begun if asked.rotation is None else None


def _keep_if_clear(found: Refinement, finder: CollisionFreeSearch) -> Refinement:
    """Return the refinement, marked as not done if its plan is not clear."""
    if not found.done or finder.is_clear(found.plan):
        return found
    return replace(found, done=False, statement="the motion within the limits would not be clear")


def plan_first_order(task: Task, finder: CollisionFreeSearch) -> Plan | None:
    """Return the best path without (6); None if (5) alone leaves no path."""
    limits = task.problem.limits.without_acceleration()
    try:
        path = finder.find(find_shortest, replace(task.problem, limits=limits, method="exact"))
    except NoFeasiblePath:
        return None
    claim = "the best path on this graph without acceleration limits"
    return task.plan(path.index, path.cost, Proof(optimal=False, statement=claim))


# -----------------------------------------------------------------------------
# feed="dip": paths to slow down, their least times, and where the speed is reduced.

BEAM = BeamWidth(60, (1.1, 1.0))
"""BeamWidth of the search for a path over continuous gamma."""
SLOWER = (1.0, 1.15, 1.4, 2.0)
"""Node intervals at which (6) must hold everywhere, as multiples of the one asked for."""
MOST_LOOKS = 20
"""Most searches for a path whose samples are clear in the cell."""


def plan_slowed(task: Task, finder: CollisionFreeSearch, *, refine: bool) -> Plan:
    """Return a plan at the speed asked for where its path allows it, and slower elsewhere.

    Two paths of the grid get the least times under all limits: the one that loses the least time
    step by step, with lost time priced above all distances, and the best one without acceleration
    limits, if there is one. With `refine`, gamma also moves off the grid from each of them so that
    the limits are exceeded little, and each is refined. With the method "continuous", so are paths
    over continuous gamma: the best one without acceleration limits, and the one that keeps all
    limits at the least constant interval that has one. The plan is the quickest clear one, and of
    equally quick ones the cheapest.
    """
    slowed, first = _least_lost(task, finder), plan_first_order(task, finder)
    starts = [slowed]
    if first is not None and not np.array_equal(first.q, slowed.q):
        starts.append(first)
    on_grid = min((_with_least_times(task, start) for start in starts), key=_time_and_cost)
    if not (refine and task.robot.family.free_rotation):
        return on_grid
    if task.settings.method == "continuous":
        starts += _between_the_samples(task, finder)
    why = "take longer"
    for made in sorted((_off_grid(task, start) for start in starts), key=_time_and_cost):
        if _time_and_cost(made) > _time_and_cost(on_grid):
            break
        broken = _broken(task, finder, made)
        if not broken:
            return made
        why = broken
    claim = f"{on_grid.proof.statement}; not refined: off the grid it would {why}"
    return replace(on_grid, proof=replace(on_grid.proof, statement=claim))


def _off_grid(task: Task, start: Plan) -> Plan:
    """Return the quicker of an eased path and its refinement, with the least times."""
    eased = _ease(task, start)
    return min(eased, _with_least_times(task, refiner.refine(eased).plan), key=_time_and_cost)


def _between_the_samples(task: Task, finder: CollisionFreeSearch) -> list[Plan]:
    """Return the paths over continuous gamma that are worth slowing down; there may be none.

    Each has a constant interval: the one asked for, without (6), and the least of `SLOWER` with it.
    """
    free = replace(task.problem, limits=task.problem.limits.without_acceleration())
    found = [_between(task, finder, free)]
    for times in SLOWER:
        slow = _between(task, finder, replace(task.problem, dt=times * task.dt))
        if slow is not None:
            found.append(slow)
            break
    return [path for path in found if path is not None]


def _between(task: Task, finder: CollisionFreeSearch, problem: SearchProblem) -> Plan | None:
    """Return the best path over continuous gamma of a problem; None if none is found."""
    claim = "no motion was found at constant speed; slowed down from a path over continuous gamma"
    for _ in range(MOST_LOOKS):
        search = ContinuousSearch(finder.open_problem(problem), task.samples)
        paths = list(search.paths(BEAM))
        if not finder.learn([ends for path in paths for ends in (path.one, path.other)]):
            proof = Proof(optimal=False, statement=finder.claimed(claim))
            return task.plan_between(paths[0], proof) if paths else None
    return None


def _ease(task: Task, start: Plan) -> Plan:
    """Return the plan moved off the grid so that it exceeds the limits little, with least times."""
    claim = f"{start.proof.statement}; gamma moved off the grid to lose little time"
    eased = replace(refiner.ease(start), proof=Proof(optimal=False, statement=claim))
    return _with_least_times(task, eased)


def _time_and_cost(made: Plan) -> tuple[float, float]:
    """Return the time of a plan, s, rounded to 1 ns, and its cost."""
    return round(float(made.time[-1]), 9), made.cost


def _broken(task: Task, finder: CollisionFreeSearch, made: Plan) -> str:
    """Return what a plan off the grid would break, as text; "" if nothing."""
    comfort = task.settings.comfort
    if comfort is not None and comfort.broken(task.robot, made.q, task.setup.tool):
        return "break a margin of comfort"
    return "" if finder.is_clear(made) else "not be clear"


def _least_lost(task: Task, finder: CollisionFreeSearch) -> Plan:
    found = finder.find(find_slowed, task.problem)
    claim = finder.claimed(
        "at constant speed the graph has no path; of all its paths this one loses the least time "
        "step by step"
    )
    return task.plan(found.index, task.cost(found.index), Proof(optimal=False, statement=claim))


def _with_least_times(task: Task, made: Plan) -> Plan:
    """Return the plan with the least times and its feed reduction."""
    limits = task.problem.limits
    tau = retime(made.increments, task.dt, limits)
    dips = feed(tau, task.dt, made.increments, limits, np.diff(made.contour.s))
    return replace(made, time=np.concatenate([[0.0], np.cumsum(tau)]), feed=dips)


# -----------------------------------------------------------------------------
# Wording of results that hold on a grid only, and rounding that keeps printed figures true.

ON_THIS_GRID = "on this grid of the rotation"
"""Prefix of statements that hold on a grid."""
FINER = "a finer gamma_step_deg or the refinement may do more"
"""Note that goes with such a statement."""


def at_most(value: float, digits: int = 4) -> str:
    """Return a positive value with some digits, rounded down."""
    return _rounded(value, digits, ROUND_FLOOR)


def at_least(value: float, digits: int = 4) -> str:
    """Return a positive value with some digits, rounded up."""
    return _rounded(value, digits, ROUND_CEILING)


def limits_named(problem: SearchProblem) -> str:
    """Return the limits that a search of the grid keeps, as text."""
    held = ["velocity", "acceleration"] + ["torque"] * (problem.limits.torque is not None)
    return f"the {', '.join(held[:-1])} and {held[-1]} limits"


def add_window_note(broken: NoFeasiblePath, asked: PlanOptions) -> NoFeasiblePath:
    """Return an answer without a path that mentions windows of gamma if they may be the cause."""
    count = len(asked.gamma_windows)
    if not count or broken.closed is not None or broken.lost_by(Loss.PINNED):
        return broken
    hold = "1 window of gamma holds" if count == 1 else f"{count} windows of gamma hold"
    return broken.with_message(f"{broken}; {hold}, without which there may be a motion")


def _rounded(value: float, digits: int, how: str) -> str:
    exact = Decimal(repr(float(value)))  # the shortest decimal form, so that 0.1 is exactly 0.1
    last = Decimal(1).scaleb(exact.adjusted() - digits + 1)
    return f"{exact.quantize(last, rounding=how).normalize():f}"
