"""Plan over continuous gamma: paths by the value function, refined; else from the grid."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np

from kerfpath import refiner
from kerfpath.effort import current_effort
from kerfpath.errors import NoFeasiblePath
from kerfpath.planner.attempt import Attempt, Strategy, first_plan, unheard
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.courses import can_explore
from kerfpath.planner.exploration import Exploration
from kerfpath.planner.feed_reduction import may_keep_speed, slowed_motion
from kerfpath.planner.impossible import can_be_slower, interval_of, refuse_impossible, speed_at
from kerfpath.planner.on_grid import from_quickest, plan_on_grid
from kerfpath.planner.quickest import MANY, clear_paths, wide
from kerfpath.planner.refinements import refine_from_random_starts
from kerfpath.planner.starts import Starts, Tally
from kerfpath.planner.statements import STOPPED
from kerfpath.planner.subsampled import subsampled
from kerfpath.planner.task import Task
from kerfpath.plans import Explored, Plan, Proof
from kerfpath.progress import StopEarly
from kerfpath.refiner import Refinement
from kerfpath.search import BeamWidth, ContinuousPath, ContinuousSearch, Course

FINE, COARSE = (0.1, 0.25), (1.1, 1.0)
"""`BeamWidth.alike` for paths that hardly accelerate, and for paths that must."""
QUICK = (BeamWidth(60, FINE, 2), BeamWidth(200, COARSE, 2))
"""Beams of the first paths; a wide search follows if the value function promises more."""
OTHERWISE = (0.5, 0.5)
"""`BeamWidth.alike` of a wide search that is to reach other local optima than the first."""
ENOUGH, POOR = 5e-3, 1e-2
"""Relative gap to the value function: below the first a motion is good; beyond the second (6) binds
so much that the promised costs say little, and all paths are refined."""
BETTER = 1e-4
"""Relative gain from which a motion replaces one that has a bound: that of a converged descent."""
COARSE_STEP = np.radians(1.5)
"""rad: step of gamma from which a search that finds nothing is repeated with half the step."""
NEARLY = 0.95
"""Share of the speed at which a motion must have been found for that. A path that keeps the limits
at more than this share of the speed, before it is refined, is not called too slow."""


def plan_continuous(task: Task, finder: CollisionFreeSearch, begin: Callable[[str], None]) -> Plan:
    """Return the plan of the first strategy of `OVER_CONTINUOUS_GAMMA` that has one.

    Raises
    ------
    NoFeasiblePath
        No motion was found, not even on the grid.
    """
    return first_plan(Attempt(task=task, finder=finder, begin=begin), OVER_CONTINUOUS_GAMMA)


def best_motion_found(attempt: Attempt) -> Plan | None:
    """Plan the best motion found from paths between the samples of gamma.

    It costs no more than any path on the grid, unless it was found along some of very many nodes,
    without the graph of all.
    """
    if grid_reason(attempt.task):
        return None
    attempt.begin("search")
    attempt.starts = starts = Starts(attempt.task, attempt.finder)
    if _clear_motion(attempt.task, starts, attempt.begin) is None:
        return None
    if attempt.task.is_built and not starts.stopped:
        try:
            starts.hold_against_grid()
        except StopEarly:
            starts.stopped = True
    assert starts.best is not None, "a motion was found"
    made = claimed(starts.best, attempt.finder, starts.told)
    if starts.stopped:
        made = replace(made, proof=made.proof.also(STOPPED))
    return made


def motion_with_reduced_feed(attempt: Attempt) -> Plan | None:
    """Plan at a reduced feed where the limits need it, if the feed may be reduced.

    Where hardly any time would be lost, a motion at the speed asked for throughout is tried first.
    """
    task = attempt.task
    if task.settings.feed != "dip" or grid_reason(task) or _costs_at_samples(task):
        return None
    attempt.task = task = task.whole()
    attempt.begin("feed reduction")
    slowed = slowed_motion(task, attempt.finder)
    if slowed is not None and may_keep_speed(task, slowed):
        with suppress(StopEarly):
            return best_motion_found(attempt) or slowed
    return slowed


def better_motion(attempt: Attempt) -> Plan | None:
    """Explore all valleys, if this has not been done; return the plan if it is better.

    It is for plans with a bound that lies far below their cost.
    """
    task, starts = attempt.task, attempt.starts
    if starts is None or starts.best is None or starts.explored or not can_explore(task):
        return None
    before = starts.best.cost_after
    attempt.begin("search")
    Exploration(task.whole(), starts).run()
    if starts.best.cost_after > (1 - BETTER) * before:
        return None
    return claimed(starts.best, attempt.finder, starts.told)


def refined_course(attempt: Attempt, course: Course) -> Plan | None:
    """Return the plan that a course from elsewhere is refined to; None if that fails.

    It is for plans at a constant speed over continuous gamma.
    """
    task = attempt.task.whole()
    asked = task.settings
    if asked.method != "continuous" or asked.feed != "constant" or grid_reason(task):
        return None
    starts = Starts(task, attempt.finder)
    starts.refine_course(course, np.inf)
    if starts.best is None:
        return None
    before = attempt.starts
    return claimed(starts.best, attempt.finder, None if before is None else before.told)


def motion_from_grid(attempt: Attempt) -> Plan | None:
    """Plan on the grid, and refine what it has, from random starts too."""
    reason = grid_reason(attempt.task)
    why = "begun from the grid: the search between its samples found no motion"
    try:
        made = _from_grid(
            attempt.task,
            attempt.finder,
            attempt.begin,
            f"planned on the grid: {reason}" if reason else why,
        )
    except NoFeasiblePath as none:
        attempt.failure = none
        return None
    return made if reason else _improved(made, attempt.finder)


def motion_from_finer_grid(attempt: Attempt) -> Plan | None:
    """Plan with twice as many samples of gamma, if a motion nearly as fast was found."""
    if grid_reason(attempt.task) or can_explore(attempt.task):
        return None  # the samples of valleys do not depend on the step of the grid
    assert attempt.failure is not None, "the grid has no plan"
    made = _from_more_samples(attempt.task, attempt.finder, attempt.begin, attempt.failure)
    return None if made is None else _improved(made, attempt.finder)


FROM_GRID: tuple[Strategy, ...] = (motion_from_grid, motion_from_finer_grid)
"""The strategies of the grid, which are tried last."""
OVER_CONTINUOUS_GAMMA: tuple[Strategy, ...] = (
    motion_with_reduced_feed,
    best_motion_found,
    *FROM_GRID,
)
"""The strategies over continuous gamma, in the order in which they are tried."""


def _improved(made: Plan, finder: CollisionFreeSearch) -> Plan:
    """Return the plan refined from random starts, unless its feed is reduced."""
    return refine_from_random_starts(made, finder) if made.feed is None else made


def claimed(
    found: Refinement, finder: CollisionFreeSearch, explored: Explored | None = None
) -> Plan:
    """Return the plan of a motion with the claim about it, and what its search followed."""
    claim = f"the best motion found over continuous rotation: cost {found.plan.cost:.6g}"
    proof = Proof(optimal=False, statement=finder.claimed(claim), explored=explored)
    return replace(found.plan, proof=proof)


def _from_grid(
    task: Task, finder: CollisionFreeSearch, begin: Callable[[str], None], why: str
) -> Plan:
    """Return the best plan of the grid, refined if possible; its proof begins with `why`.

    Raises
    ------
    NoFeasiblePath
        There is none.
    """
    refine = task.robot.family.free_rotation and not _costs_at_samples(task)
    made = plan_on_grid(task, finder, begin, refine=refine)
    return replace(made, proof=replace(made.proof, statement=f"{why}; {made.proof.statement}"))


def _costs_at_samples(task: Task) -> bool:
    """Return whether nodes of a motion with a reduced feed have costs, known only on the grid."""
    comfort = task.settings.comfort
    return task.settings.feed == "dip" and comfort is not None and comfort.costs


def _from_more_samples(
    task: Task, finder: CollisionFreeSearch, begin: Callable[[str], None], none: NoFeasiblePath
) -> Plan | None:
    """Return a plan found with twice as many samples of gamma; None if there is none.

    This is tried if the samples are not close already and a motion nearly as fast was found.
    """
    needed, fine = none.relaxation, _finer(task)
    if fine is None or needed is None or needed.speed < NEARLY or none.closed is not None:
        return None
    there = finder.of(fine)
    found = clear_motion(fine, there, begin)
    why = "begun from a finer grid: the search between its samples found no motion"
    try:
        made = _from_grid(fine, there, begin, why) if found is None else claimed(found, there)
    except NoFeasiblePath:
        return None
    return replace(made, settings=task.settings)


def _finer(task: Task) -> Task | None:
    """Return the task with twice as many samples of gamma; None if they are close already.

    Its graph is built when it is needed.
    """
    step = task.settings.gamma_step
    return task.sampled(step / 2) if step >= COARSE_STEP else None


def clear_motion(
    task: Task,
    finder: CollisionFreeSearch,
    begin: Callable[[str], None] = unheard,
    *,
    thorough: bool = True,
    explored: bool = True,
    tally: Tally | None = None,
) -> Refinement | None:
    """Return the best clear motion found; None if there is none.

    The value function shows whether a wider search may find a better motion; without `thorough`,
    the refined first paths are enough. Without `explored`, wider beams follow instead of all
    valleys. With very many nodes, a motion is first planned along some
    of them, and the graph of all nodes is built only if that is not enough. What is followed and
    dropped is added to `tally`.

    Raises
    ------
    NoFeasiblePath
        A node has no pose, or the speed is proved to be much too high.
    """
    starts = Starts(task, finder, tally=tally)
    return _clear_motion(task, starts, begin, thorough=thorough, explored=explored)


def _clear_motion(
    task: Task,
    starts: Starts,
    begin: Callable[[str], None],
    *,
    thorough: bool = True,
    explored: bool = True,
) -> Refinement | None:
    """Return the best clear motion found, which `starts` keep; None if there is none."""
    finder = starts.finder
    made, least = _from_fewer_nodes(task, finder, starts.tally, explored=explored)
    starts.start_from(made, least)
    if starts.best is not None and not starts.above(least, ENOUGH):
        return starts.best
    task = task.whole()
    searched = clear_paths(task, finder, QUICK if starts.best is None else ())
    if searched is None:
        _begin("search on the grid", begin, task, finder, [])
        return starts.best
    search, paths = searched
    if starts.best is not None and starts.above(search.value, ENOUGH):
        paths = [path for beam in QUICK for path in search.paths(beam)]
    constant = task.settings.feed == "constant"
    if starts.best is None and constant:
        refuse_impossible(task, finder, paths)
    if starts.best is None:
        _begin("refinement", begin, task, finder, paths)
    else:
        begin("refinement")
    # Over many nodes refinements that cannot end inside the limits take minutes.
    many = explored and can_explore(task) and len(task.contour) >= MANY
    judged = many and starts.best is None and constant and can_be_slower(task)
    try:
        if judged and task.dt < NEARLY * _interval_of(task, paths):
            _require_quick_enough(task, finder, paths, begin)
        starts.refine(paths)
        if thorough and explored and finder.is_free and can_explore(task):
            _explore(task, starts, search)
        elif thorough:
            _search_wider(task, starts, search, paths)
    except StopEarly:
        if starts.best is None:
            raise
        starts.stopped = True
    return starts.best


def _begin(
    what: str,
    begin: Callable[[str], None],
    task: Task,
    finder: CollisionFreeSearch,
    paths: list[ContinuousPath],
) -> None:
    """Begin a phase; say at which speed the best path keeps the limits, if that is too slow.

    It is one of `paths`, or else a path without (6). It is not known where the feed may be reduced,
    and not looked for if nobody listens.
    """
    if begin is unheard or task.settings.feed != "constant" or task.contour.time is not None:
        begin(what)
        return
    if not paths:
        without = task.problem.limits.without_acceleration()
        free = task.with_problem(replace(task.problem, limits=without))
        searched = clear_paths(free, finder, QUICK[:1])
        paths = [] if searched is None else searched[1]
    dt = _interval_of(task, paths)
    if task.dt < NEARLY * dt < np.inf:
        what = f"{what}, first estimate of a possible speed {speed_at(task, dt)}"
    begin(what)


def _interval_of(task: Task, paths: list[ContinuousPath]) -> float:
    """Return the interval, s, in which the best of some paths keeps the limits, as it is."""
    claim = Proof(optimal=False, statement="")
    plans = [refiner.reduce_excess(task.plan_between(path, claim), most=0) for path in paths]
    return min((interval_of(task, plan) for plan in plans), default=np.inf)


def _require_quick_enough(
    task: Task,
    finder: CollisionFreeSearch,
    paths: list[ContinuousPath],
    begin: Callable[[str], None],
) -> None:
    """Require that one of the quickest motions is quick enough, where `paths` are not.

    Begun from that motion, the search leaves out paths that lead to better ones.

    Raises
    ------
    NoFeasiblePath
        There is none among them.
    """
    claim = Proof(optimal=False, statement="")
    sharp = np.abs(task.plan_between(paths[0], claim).acceleration_share) if paths else np.zeros(1)
    none = NoFeasiblePath(
        f"contour {task.contour.name!r}: no motion over continuous rotation was found",
        proved=False,
        node=int(sharp.max(axis=-1, initial=0.0).argmax()),
    )
    from_quickest(task, finder, none, begin)


def _explore(task: Task, starts: Starts, search: ContinuousSearch) -> None:
    """Refine courses through the cheapest valleys; explore all if there may be a better motion.

    The samples of these valleys follow the joints, whatever the step of gamma, so that what is
    found hardly depends on it: values between coarse samples are often above the best cost. Where
    there is no motion to improve on, the grid is a better start, or the speed is too high.
    """
    exploration = Exploration(task, starts)
    exploration.begin()
    if starts.above(search.value, current_effort().worth_exploring / 2) or exploration.promises:
        starts.refine([*search.paths(wide(task))])
        if starts.best is not None:
            exploration.run()


def _search_wider(
    task: Task, starts: Starts, search: ContinuousSearch, paths: list[ContinuousPath]
) -> None:
    """Refine more paths if the value function promises a better motion than the best one."""
    if starts.above(search.value, ENOUGH):
        paths += search.paths(wide(task))
        starts.refine(paths)
        starts.refine_from_grid(task)
    if starts.best is not None and starts.above(search.value, POOR):
        fine = _finer(task) if starts.finder.is_free else None
        if fine is not None:
            starts.refine_from_grid(fine)
        width, _, ways = wide(task)
        paths += search.paths(BeamWidth(width, OTHERWISE, ways))
        starts.refine(paths, unpromising=True)
        made = refine_from_random_starts(starts.best.plan, starts.finder)
        starts.best = replace(starts.best, plan=made, cost_after=made.cost)


def _from_fewer_nodes(
    task: Task, finder: CollisionFreeSearch, tally: Tally, *, explored: bool
) -> tuple[Plan | None, float]:
    """Return the motion along some of very many nodes, extended to all, and a cost to compare with.

    None if there is none, or a node has no pose. No motion along all nodes costs less than the best
    one along some: its steps together are no shorter, and the subsample imposes no more (5), (6).
    The cost is 0 if this does not apply.
    """
    thin = subsampled(task)
    try:
        found = (
            None
            if thin is None
            else clear_motion(thin.task, finder.of(thin.task), explored=explored, tally=tally)
        )
    except NoFeasiblePath as none:
        if thin is not None and none.closed is not None:
            raise thin.along_all_nodes(none, none.closed) from None
        found = None
    if thin is None or found is None:
        return None, 0.0
    comfort = task.settings.comfort
    told = task.settings.objective == "sum" and (comfort is None or not comfort.costs)
    return thin.at_all_nodes(found.plan), found.cost_after if told else 0.0


def grid_reason(task: Task) -> str:
    """Return why a task must be planned on the grid; "" if it need not be."""
    comfort = task.settings.comfort
    if not task.robot.family.free_rotation:
        return "the robot leaves no rotation free"
    if comfort is not None and comfort.prices_clearance:
        return "the cost of clearance is known only there"
    return ""
