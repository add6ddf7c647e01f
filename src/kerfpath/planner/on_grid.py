"""Plan on the grid of gamma by the exact search; if it has no path, slower or off the grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

from kerfpath.errors import NoFeasiblePath
from kerfpath.planner.attempt import Attempt, Strategy, first_plan
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.feed_reduction import plan_slowed
from kerfpath.planner.impossible import MUCH, at_any_gamma, can_be_slower, speed_at, with_relaxation
from kerfpath.planner.quickest import QuickMotion, quick_motions, velocity_limited_motions
from kerfpath.planner.refinements import plan_from_faster, plan_off_grid, refine_plan
from kerfpath.planner.statements import ON_THIS_GRID, limits_named
from kerfpath.planner.task import Task
from kerfpath.plans import Plan, Proof
from kerfpath.robots import posture_name
from kerfpath.search import SearchProblem, find_shortest, velocity_allows

HOPELESS = 2.0
"""If no path on the grid keeps the velocities in this multiple of the node interval, no motion is
as quick as asked for, and the exact fastest path is not worth minutes."""
FIRST, NEARLY = 2, 1.15
"""Motions found before a proof that there is no quicker one is tried: the fastest path on the grid,
moved off it; and the multiple of the node interval above which it is tried then."""


def plan_on_grid(
    task: Task, finder: CollisionFreeSearch, begin: Callable[[str], None], *, refine: bool
) -> Plan:
    """Return the plan of the first strategy of `ON_GRID` that has one; it is refined if `refine`.

    Raises
    ------
    NoFeasiblePath
        A node has no pose, or no strategy has a plan.
    """
    return first_plan(Attempt(task=task, finder=finder, begin=begin, refine=refine), ON_GRID)


def best_path(attempt: Attempt) -> Plan | None:
    """Plan along the best path of the graph, and refine it if the attempt may leave the grid."""
    attempt.task = task = attempt.task.whole()
    attempt.begin("search")
    try:
        path = attempt.finder.find(find_shortest, task.problem)
    except NoFeasiblePath as none:
        attempt.failure = _said_of_grid(none, task)
        return None
    proof = _proof(task.problem, path.optimal, attempt.finder)
    made = task.plan(path.index, path.cost, proof)
    if not attempt.refine:
        return made
    attempt.begin("refinement")
    return refine_plan(task, attempt.finder, made)


def slowed_path(attempt: Attempt) -> Plan | None:
    """Plan with a reduced feed where the limits need it, if the feed may be reduced."""
    if attempt.task.settings.feed != "dip":
        return None
    try:
        return plan_slowed(attempt.task, attempt.finder, refine=attempt.refine)
    except NoFeasiblePath as none:
        attempt.failure = _said_of_grid(none, attempt.task)
        return None


def path_off_grid(attempt: Attempt) -> Plan | None:
    """Refine the best path without acceleration limits until it keeps them."""
    asked = attempt.task.settings
    if asked.feed == "dip" or asked.closure != "free" or not attempt.refine:
        return None
    attempt.begin("refinement")
    found = plan_off_grid(attempt.task, attempt.finder)
    if found is None or found.done:
        return None if found is None else found.plan
    assert attempt.failure is not None, "the search of the grid found no path"
    attempt.failure = attempt.failure.with_message(
        f"{attempt.failure}; off the grid {found.statement}"
    )
    return None


def quickest_motion(attempt: Attempt) -> Plan | None:
    """Refine a motion that is at least as quick as asked for; else prove that there is none."""
    if attempt.task.settings.feed == "dip" or not attempt.refine:
        return None
    assert attempt.failure is not None, "the search of the grid found no path"
    return from_quickest(attempt.task, attempt.finder, attempt.failure, attempt.begin)


ON_GRID: tuple[Strategy, ...] = (best_path, slowed_path, path_off_grid, quickest_motion)
"""The strategies on the grid of gamma, in the order in which they are tried."""


def _said_of_grid(none: NoFeasiblePath, task: Task) -> NoFeasiblePath:
    """Return the failure of a search of the grid with the contour named, and where paths end."""
    where = f"{ON_THIS_GRID} " if task.robot.family.free_rotation else ""
    return none.with_message(f"contour {task.contour.name!r}: {where}{none}{_bracket(none, task)}")


def from_quickest(
    task: Task, finder: CollisionFreeSearch, broken: NoFeasiblePath, begin: Callable[[str], None]
) -> Plan:
    """Return the refinement of a motion that is at least as quick as asked for.

    Unless some motions are nearly as quick, a proof that there is none at all is tried first.

    Raises
    ------
    NoFeasiblePath
        No motion was found; the message says what is proved, and with which lower speed or higher
        limits a motion was found.
    """
    # On a grid of external axes the first quickest motion may take minutes: the long steps between
    # samples leave the arm nearly every edge, and the exact search for the fastest path keeps each
    # as a state.
    on_a_grid = task.robot.free.size and task.external is None
    if on_a_grid or not can_be_slower(task):
        raise _judged(broken, task, begin) from None
    begin("search for the quickest motion")
    hopeless = not velocity_allows(task.problem, HOPELESS * task.dt)
    search = velocity_limited_motions if hopeless else quick_motions
    motions, judged = list[QuickMotion](), None
    with suppress(NoFeasiblePath):  # not at any speed
        for best in search(task, finder, wanted=task.dt):
            motions.append(best)
            begin(f"search for the quickest motion, {speed_at(task, best.dt)} so far")
            made = plan_from_faster(task, best, finder) if best.is_enough(task.dt) else None
            if made is not None:
                return made
            if len(motions) == FIRST and best.dt > NEARLY * task.dt:
                judged = _judged(broken, task, begin, motions)
                if judged.closed is not None and best.dt > MUCH * task.dt:
                    break
    if judged is None or judged.closed is None:
        judged = _judged(broken, task, begin, motions)
    raise with_relaxation(judged, task, motions[-1].plan) if motions else judged


def _judged(
    broken: NoFeasiblePath,
    task: Task,
    begin: Callable[[str], None],
    motions: Sequence[QuickMotion] = (),
) -> NoFeasiblePath:
    """Return the answer without a path, with whether it is proved at every gamma."""
    begin("search for a proof that no motion exists")
    return at_any_gamma(broken, task, motions)


def _bracket(broken: NoFeasiblePath, task: Task) -> str:
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


def _proof(problem: SearchProblem, optimal: bool, finder: CollisionFreeSearch) -> Proof:
    if optimal:
        claim = finder.claimed(f"the best path on this graph under {limits_named(problem)}")
    elif problem.method == "known":
        claim = "no claim: the known technique tests neither velocity nor acceleration"
    else:
        claim = "no claim: the acceleration test of the paper's procedure is greedy"
    return Proof(optimal=optimal, statement=claim)
