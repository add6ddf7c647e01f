"""Plan over continuous gamma: paths by the value function, refined; else from the grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import islice

import numpy as np

from kerfpath import refiner
from kerfpath.errors import NoFeasiblePath
from kerfpath.planner.attempt import Attempt, Strategy, first_plan
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.on_grid import plan_on_grid
from kerfpath.planner.quickest import alike, clear_paths, wide
from kerfpath.planner.refinements import plan_off_grid, refine_from_random_starts
from kerfpath.planner.subsampled import subsampled
from kerfpath.planner.task import Task
from kerfpath.plans import Plan, Proof
from kerfpath.refiner import Refinement
from kerfpath.search import BeamWidth, ContinuousPath, ContinuousSearch, find_shortest

FIRST_STEP = 5e-3
"""rad: first change of gamma when a path between the samples is refined."""
FINE, COARSE = (0.1, 0.25), (1.1, 1.0)
"""`BeamWidth.alike` for paths that hardly accelerate, and for paths that must."""
QUICK = (BeamWidth(60, FINE, 2), BeamWidth(200, COARSE, 2))
"""Beams of the first paths; a wide search follows if the value function promises more."""
OTHERWISE = (0.5, 0.5)
"""`BeamWidth.alike` of a wide search that is to reach other local optima than the first."""
ENOUGH, POOR = 5e-3, 1e-2
"""Relative gap to the value function: below the first a motion is good; beyond the second (6) binds
so much that the promised costs say little, and all paths are refined."""
COARSE_STEP = np.radians(1.5)
"""rad: step of gamma from which a search that finds nothing is repeated with half the step."""
NEARLY = 0.95
"""Share of the speed at which a motion must have been found for that."""
VALLEYS = 20
"""Most valleys through which courses are looked for."""
SAME_COST = 1e-6
"""Relative difference of courses and motions that count as equally costly."""
GAIN = 5e-3
"""Relative gain that a refinement may reach beyond the promised cost of a path."""
NARROWED = 6
"""Most repetitions of a refinement closer to its path while the result is not clear."""
FREE = 1.0
"""rad or m: how far external axes may at first leave their course in a cell."""


def plan_continuous(task: Task, finder: CollisionFreeSearch, begin: Callable[[str], None]) -> Plan:
    """Return the plan of the first strategy of `OVER_CONTINUOUS_GAMMA` that has one.

    Raises
    ------
    NoFeasiblePath
        No motion was found, not even on the grid.
    """
    return first_plan(Attempt(task=task, finder=finder, begin=begin), OVER_CONTINUOUS_GAMMA)


def best_motion_found(attempt: Attempt) -> Plan | None:
    """Plan the best motion found from paths between the samples of gamma."""
    if grid_reason(attempt.task):
        return None
    attempt.begin("search")
    found = clear_motion(attempt.task, attempt.finder, attempt.begin)
    return None if found is None else claimed(found, attempt.finder)


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
    if grid_reason(attempt.task):
        return None
    assert attempt.failure is not None, "the grid has no plan"
    made = _from_more_samples(attempt.task, attempt.finder, attempt.begin, attempt.failure)
    return None if made is None else _improved(made, attempt.finder)


OVER_CONTINUOUS_GAMMA: tuple[Strategy, ...] = (
    best_motion_found,
    motion_from_grid,
    motion_from_finer_grid,
)
"""The strategies over continuous gamma, in the order in which they are tried."""


def _improved(made: Plan, finder: CollisionFreeSearch) -> Plan:
    """Return the plan refined from random starts, unless its feed is reduced."""
    return refine_from_random_starts(made, finder) if made.feed is None else made


def claimed(found: Refinement, finder: CollisionFreeSearch) -> Plan:
    """Return the plan of a motion with the claim about it."""
    claim = f"the best motion found over continuous rotation: cost {found.cost_after:.6g}"
    return replace(found.plan, proof=Proof(optimal=False, statement=finder.claimed(claim)))


def _from_grid(
    task: Task, finder: CollisionFreeSearch, begin: Callable[[str], None], why: str
) -> Plan:
    """Return the best plan of the grid, refined if possible; its proof begins with `why`.

    Raises
    ------
    NoFeasiblePath
        There is none.
    """
    comfort = task.settings.comfort
    # The node costs of a slowed-down motion are known only on the grid.
    priced = task.settings.feed == "dip" and comfort is not None and comfort.costs
    refine = task.robot.family.free_rotation and not priced
    made = plan_on_grid(task, finder, begin, refine=refine)
    return replace(made, proof=replace(made.proof, statement=f"{why}; {made.proof.statement}"))


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
    begin: Callable[[str], None] = lambda what: None,
    *,
    thorough: bool = True,
) -> Refinement | None:
    """Return the best clear motion found; None if there is none.

    The value function shows whether a wider search may find a better motion; without `thorough`,
    the refined first paths are enough. With very many nodes, a motion is first planned along some
    of them, and the graph of all nodes is built only if that is not enough.

    Raises
    ------
    NoFeasiblePath
        A node has no pose.
    """
    starts = _Starts(task, finder)
    made, least = _from_fewer_nodes(task, finder)
    starts.start_from(made, least)
    if starts.best is not None and not starts.above(least, ENOUGH):
        return starts.best
    task = task.whole()
    searched = clear_paths(task, finder, QUICK if starts.best is None else ())
    if searched is None:
        return starts.best
    search, paths = searched
    if starts.best is not None and starts.above(search.value, ENOUGH):
        paths = [path for beam in QUICK for path in search.paths(beam)]
    begin("refinement")
    starts.refine(paths)
    if thorough:
        _search_wider(task, starts, search, paths)
        starts.refine_valleys(search)
    return starts.best


def _search_wider(
    task: Task, starts: _Starts, search: ContinuousSearch, paths: list[ContinuousPath]
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


def _from_fewer_nodes(task: Task, finder: CollisionFreeSearch) -> tuple[Plan | None, float]:
    """Return the motion along some of very many nodes, extended to all, and a cost to compare with.

    None if there is none, or a node has no pose. No motion along all nodes costs less than the best
    one along some: its steps together are no shorter, and the subsample imposes no more (5), (6).
    The cost is 0 if this does not apply.
    """
    thin = subsampled(task)
    try:
        found = None if thin is None else clear_motion(thin.task, finder.of(thin.task))
    except NoFeasiblePath:
        found = None
    if thin is None or found is None:
        return None, 0.0
    comfort = task.settings.comfort
    told = task.settings.objective == "sum" and (comfort is None or not comfort.costs)
    return thin.at_all_nodes(found.plan), found.cost_after if told else 0.0


_CLAIM = Proof(optimal=False, statement="found over continuous rotation")


class _Starts:
    """Starts of refinements, and the best motion that was reached from them."""

    def __init__(self, task: Task, finder: CollisionFreeSearch) -> None:
        self._task, self.finder = task, finder
        self._tried: list[Plan] = []
        self.best: Refinement | None = None

    def above(self, value: float, share: float) -> bool:
        """Return whether the best motion costs more than (1 + share) times a value."""
        return self.best is None or self.best.cost_after > (1 + share) * value

    def start_from(self, made: Plan | None, least: float) -> None:
        """Refine a motion that is close to the best one, whose cost is at least `least`."""
        if made is not None:
            self._tried.append(made)
            found = refiner.refine(made, first=FIRST_STEP, least=least)
            self.best = found if found.done and self.finder.is_clear(found.plan) else None

    def refine(self, paths: list[ContinuousPath], *, unpromising: bool = False) -> None:
        """Refine paths, the most promising first, and of similar paths only one.

        Paths that promise no better motion are refined only if `unpromising`: the cost of bringing
        a path inside the limits is a guess.
        """
        plans = [self._task.plan_between(path, _CLAIM) for path in paths]
        for promised, i in sorted((refiner.promise(plan), i) for i, plan in enumerate(plans)):
            best, made = self.best, plans[i]
            hopeless = best is not None and promised * (1 - GAIN) >= best.cost_after
            if hopeless and not unpromising:
                break
            known = self._tried if best is None else [*self._tried, best.plan]
            if not any(alike(made, other) for other in known):
                self._tried.append(made)
                found = _refine_path(self._task, self.finder, paths[i], made)
                self.best = _better(best, found)

    def refine_valleys(self, search: ContinuousSearch) -> None:
        """Refine courses through other valleys that may cost less than the best motion.

        Under (6) the cheapest course by (5) alone need not lead to the best motion. Of courses that
        cost the same, which differ in the posture of the wrist, one is enough. Where there is no
        motion to improve on, the grid is a better start.
        """
        if self.best is None:
            return
        courses = list(islice(search.valleys(), VALLEYS))
        self.finder.learn([ends for path in courses for ends in (path.one, path.other)])
        refined = np.zeros(0)
        for path in courses:
            cost = self._task.plan_between(path, _CLAIM).cost
            least = (1 + POOR) * self.best.cost_after
            if cost < least and not np.isclose(cost, refined, rtol=SAME_COST).any():
                before = self.best
                self.refine([path], unpromising=True)
                if self.best.cost_after > (1 - SAME_COST) * before.cost_after:
                    self.best = before
                refined = np.append(refined, cost)

    def refine_from_grid(self, task: Task) -> None:
        """Refine the best path on the grid of a task, if there is already a motion to improve on.

        It leads to other local optima than paths between the samples do.
        """
        if self.best is None:
            return
        found: Refinement | None
        try:
            path = self.finder.find(find_shortest, task.problem)
        except NoFeasiblePath:
            found = plan_off_grid(task, self.finder) if task.settings.closure == "free" else None
        else:
            claim = Proof(optimal=False, statement="begun from the grid")
            found = refiner.refine(task.plan(path.index, path.cost, claim))
        if found is not None and found.done and self.finder.is_clear(found.plan):
            own = replace(found.plan, settings=self._task.settings)
            self.best = _better(self.best, replace(found, plan=own))


def _refine_path(
    task: Task, finder: CollisionFreeSearch, path: ContinuousPath, made: Plan
) -> Refinement | None:
    """Return the refinement of a path; None if it does not keep the limits or is not clear.

    In a cell, gamma stays between clear samples. Where the refined motion is not clear, gamma and
    external axes are kept closer to the path, and the refinement is repeated.
    """
    clear = finder.corridor(path.one, path.other)
    if clear is None:
        found = refiner.refine(made, first=FIRST_STEP)
        return found if found.done else None
    graph = task.graph
    sample = graph.sample[path.one].astype(np.int64)
    below, above = graph.gamma_at(sample), graph.gamma_at(sample + (path.one != path.other))
    at = below + path.share * (above - below)
    low = made.gamma - (at - graph.gamma_at(sample - clear[0]))
    high = made.gamma + graph.gamma_at(sample + (path.one != path.other) + clear[1]) - at
    begun = np.column_stack([made.gamma, made.unwrapped[:, made.robot.free]])
    low, high = (
        np.column_stack([gamma, begun[:, 1:] + side * FREE])
        for gamma, side in ((low, -1.0), (high, 1.0))
    )
    for _ in range(NARROWED):
        found = refiner.refine(made, first=FIRST_STEP, within=(low, high))
        unclear = finder.unclear(found.plan)
        if not (found.done and unclear.any()):
            break
        moved = unclear[:, None]
        low = np.where(moved, (low + begun) / 2, low)
        high = np.where(moved, (high + begun) / 2, high)
    return found if found.done and not unclear.any() else None


def _better(one: Refinement | None, other: Refinement | None) -> Refinement | None:
    """Return the better of two motions, or the one that there is."""
    if one is None or other is None:
        return one or other
    return min(one, other, key=lambda found: found.cost_after)


def grid_reason(task: Task) -> str:
    """Return why a task must be planned on the grid; "" if it need not be."""
    comfort = task.settings.comfort
    if not task.robot.family.free_rotation:
        return "the robot leaves no rotation free"
    if comfort is not None and comfort.prices_clearance:
        return "the cost of clearance is known only there"
    return ""
