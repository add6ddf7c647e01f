"""Plan on the grid of gamma by the exact search; if it has no path, slower or off the grid."""

from __future__ import annotations

from collections.abc import Callable

from kerfpath.errors import NoFeasiblePath
from kerfpath.planner._clear import ClearSearch
from kerfpath.planner._closed import at_any_gamma, with_relaxation
from kerfpath.planner._dip import plan_slowed
from kerfpath.planner._quickest import quick_motions, slow_motions
from kerfpath.planner._refined import plan_off_grid, plan_slowly, refine_plan
from kerfpath.planner._task import PlanningTask
from kerfpath.planner._words import ON_THIS_GRID, limits_named
from kerfpath.plans import Plan, Proof
from kerfpath.robots import posture_name
from kerfpath.search import SearchProblem, find_shortest, velocity_allows

__all__ = ["plan_on_grid"]

HOPELESS = 4.0
"""If no path on the grid keeps the velocities in this multiple of the node interval, no motion is
as quick as asked for, and the exact fastest path is not worth minutes."""
TOO_SLOW, NEARLY = 2.0, 1.15
"""Multiples of the node interval above which a proof that there is no motion is tried before the
next search: for the fastest path on the grid, and for quicker motions."""


def plan_on_grid(
    task: PlanningTask, finder: ClearSearch, begin: Callable[[str], None], *, refine: bool
) -> Plan:
    """Return the plan of the best path on the graph of a task, refined if `refine`.

    Raises
    ------
    NoFeasiblePath
        A node has no pose, or there is no path, nor one that is slower or off the grid if that is
        allowed.
    """
    task = task.whole()
    begin("search")
    try:
        path = finder.find(find_shortest, task.problem)
    except NoFeasiblePath as at_speed:
        return _otherwise(task, finder, at_speed, begin, refine=refine)
    proof = _proof(task.problem, path.optimal, finder)
    made = task.plan(path.index, path.cost, proof)
    if not refine:
        return made
    begin("refinement")
    return refine_plan(task, finder, made)


def _otherwise(
    task: PlanningTask,
    finder: ClearSearch,
    broken: NoFeasiblePath,
    begin: Callable[[str], None],
    *,
    refine: bool,
) -> Plan:
    """Return a slower plan, or one off the grid, if the graph has none at the speed asked for.

    Raises
    ------
    NoFeasiblePath
        There is none, or neither is allowed.
    """
    asked, found = task.settings, None
    if asked.feed == "dip":
        try:
            return plan_slowed(task, finder, refine=refine)
        except NoFeasiblePath as at_any_speed:
            broken = at_any_speed
    elif refine and asked.closure == "free":
        begin("refinement")
        found = plan_off_grid(task, finder)
        if found is not None and found.done:
            return found.plan
    tried = "" if found is None else f"; off the grid {found.statement}"
    where = f"{ON_THIS_GRID} " if task.robot.family.free_rotation else ""
    broken = broken.with_message(
        f"contour {task.contour.name!r}: {where}{broken}{_bracket(broken, task)}{tried}"
    )
    if not refine or asked.feed == "dip":
        raise broken from None
    return _from_quickest(task, finder, broken, begin)


def _from_quickest(
    task: PlanningTask, finder: ClearSearch, broken: NoFeasiblePath, begin: Callable[[str], None]
) -> Plan:
    """Return the refinement of a motion that is at least as quick as asked for.

    Unless some motions are nearly as quick, a proof that there is none at all is tried first.

    Raises
    ------
    NoFeasiblePath
        No motion was found; the message says what is proved, and with which lower speed or higher
        limits a motion was found.
    """
    asked = task.settings
    # The search for quickest motions supports no closure, torque, jerk or cost of clearance. On a
    # grid of external axes its first motion may take minutes: the long steps between samples leave
    # the arm nearly every edge, and the exact search for the fastest path keeps each as a state.
    priced = asked.comfort is not None and asked.comfort.prices_clearance
    held = task.problem.limits
    unknown = held.torque is not None or held.jerk is not None
    on_a_grid = task.robot.free.size and task.external is None
    if asked.closure == "periodic" or priced or unknown or on_a_grid:
        raise _judged(broken, task, begin) from None
    judged, best = None, None
    begin("search for the quickest motion")
    hopeless = not velocity_allows(task.problem, HOPELESS * task.dt)
    motions = slow_motions if hopeless else quick_motions
    try:
        for tried, best in enumerate(motions(task, finder)):
            made = plan_slowly(task, best, finder) if best.is_enough(task.dt) else None
            if made is not None:
                return made
            far = best.dt > (TOO_SLOW, NEARLY)[tried > 0] * task.dt
            if judged is None and far:
                judged = _judged(broken, task, begin)
                if judged.closed is not None:
                    break
    except NoFeasiblePath:  # not at any speed
        best = None
    if judged is None:
        judged = _judged(broken, task, begin)
    if best is None or asked.rotation is not None:
        raise judged
    raise with_relaxation(judged, task, best)


def _judged(
    broken: NoFeasiblePath, task: PlanningTask, begin: Callable[[str], None]
) -> NoFeasiblePath:
    """Return the answer without a path, with whether it is proved at every gamma."""
    begin("search for a proof that no motion exists")
    return at_any_gamma(broken, task)


def _bracket(broken: NoFeasiblePath, task: PlanningTask) -> str:
    """Return text on the node from which paths reach the end, and the posture change needed."""
    if broken.back is None:
        return ""
    said = f"; from the back, paths reach the end from node {broken.back} on"
    said = said if broken.back > broken.node + 1 else ""
    if broken.reached is None or broken.leaving is None:
        return said
    before, after = (
        {int(mu) for mu in task.graph.posture[task.graph.start[node] + vertices]}
        for node, vertices in ((broken.node, broken.reached), (broken.back, broken.leaving))
    )
    if before & after:
        return said
    names = (", ".join(posture_name(mu) for mu in sorted(group)) for group in (before, after))
    return f"{said}; the posture would have to change from {' to '.join(names)}"


def _proof(problem: SearchProblem, optimal: bool, finder: ClearSearch) -> Proof:
    if optimal:
        claim = finder.claimed(f"the best path on this graph under {limits_named(problem)}")
    elif problem.method == "known":
        claim = "no claim: the known technique tests neither velocity nor acceleration"
    else:
        claim = "no claim: the acceleration test of the paper's procedure is greedy"
    return Proof(optimal=optimal, statement=claim)
