"""Starts of refinements over continuous gamma, and the best motion reached from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from kerfpath import refiner
from kerfpath.arrays import Array
from kerfpath.compiling import finish_compiling
from kerfpath.errors import NoFeasiblePath
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.quickest import alike
from kerfpath.planner.refinements import plan_off_grid
from kerfpath.planner.straight_moves import not_followed
from kerfpath.planner.task import Task
from kerfpath.plans import Explored, Plan, Proof, has_room
from kerfpath.refiner import Goal, Refinement
from kerfpath.search import (
    ContinuousPath,
    Course,
    NoCheaperPath,
    find_cheaper,
    find_shortest,
)

FIRST_STEP = 5e-3
"""rad: first change of gamma when a path between the samples is refined."""
GAIN, GAIN_OF_MAX = 5e-3, 3e-2
"""Relative gain that a refinement may reach beyond the cost of a course or a promised one: of all
steps together, and of the largest step alone."""
FAR = 0.05
"""Relative cost above its score from which the refinement of a course is repeated from nearer the
limits."""
NARROWED = 6
"""Most repetitions of a refinement closer to its path while the result is not clear."""
FREE = 1.0
"""rad or m: how far external axes may at first leave their course in a cell."""


_CLAIM = Proof(optimal=False, statement="found over continuous rotation")


@dataclass(slots=True)
class Tally:
    """Counts of what a search followed and dropped, as in `kerfpath.plans.Explored`."""

    valleys: dict[str, int] = field(default_factory=dict)
    screened: int = 0
    refined: int = 0
    dearer: int = 0
    alike: int = 0
    left: int = 0
    dropped: int = 0
    unfollowed: int = 0

    def follow(self, course: Course) -> None:
        """Count a valley."""
        one = int(course.posture[0])
        where = str(one) if (course.posture == one).all() else "several"
        self.valleys[where] = self.valleys.get(where, 0) + 1

    def told(self, *, explored: bool) -> Explored:
        """Return the counts; `explored`: whether the valleys were, beyond the cheapest."""
        return Explored(
            valleys=dict(sorted(self.valleys.items())),
            all_valleys=explored and not self.unfollowed,
            screened=self.screened,
            refined=self.refined,
            dearer=self.dearer,
            alike=self.alike,
            left=self.left,
            dropped=self.dropped,
            unfollowed=self.unfollowed,
        )


class Starts:
    """Starts of refinements, and the best motion that was reached from them.

    Parameters
    ----------
    task : Task
    finder : CollisionFreeSearch
    goals : tuple of Goal
        Criteria that courses are refined to instead of the objective; default: the objective.
    tally : Tally, optional
        Counts that it goes on with; default: new ones.
    """

    def __init__(
        self,
        task: Task,
        finder: CollisionFreeSearch,
        goals: tuple[Goal, ...] = (),
        tally: Tally | None = None,
    ) -> None:
        self.tally = tally or Tally()
        self._task, self.finder, self._goals = task, finder, goals
        self._tried: list[Plan] = []
        self.found: list[Refinement] = []
        self.best: Refinement | None = None
        self.explored = False
        self._far_outside = False
        self.stopped = False

    @property
    def all_found(self) -> list[Refinement]:
        """Motions found that keep the limits, the best one among them."""
        return self.found if self.best is None else [*self.found, self.best]

    @property
    def told(self) -> Explored:
        """What was followed and dropped so far."""
        return self.tally.told(explored=self.explored)

    def above(self, value: float, share: float) -> bool:
        """Return whether the best motion costs more than (1 + share) times a value."""
        return self.best is None or self.best.cost_after > (1 + share) * value

    def start_from(self, made: Plan | None, least: float) -> None:
        """Refine a motion that is close to the best one, whose cost is at least `least`."""
        if made is not None:
            self._tried.append(made)
            self.tally.refined += 1
            found = refiner.refine(made, first=FIRST_STEP, least=least)
            self.best = found if found.done and self.finder.is_clear(found.plan) else None

    def refine(self, paths: list[ContinuousPath], *, unpromising: bool = False) -> None:
        """Refine paths, the most promising first, and of similar paths only one.

        Paths that promise no better motion are refined only if `unpromising`: the cost of bringing
        a path inside the limits is a guess.
        """
        plans = [self._task.plan_between(path, _CLAIM) for path in paths]
        order = sorted((refiner.promise(plan), i) for i, plan in enumerate(plans))
        for number, (promised, i) in enumerate(order):
            best, made = self.best, plans[i]
            if self._is_hopeless(promised) and not unpromising:
                self.tally.dearer += len(order) - number
                break
            known = self._tried if best is None else [*self._tried, best.plan]
            if any(alike(made, other) for other in known):
                self.tally.alike += 1
            else:
                self._tried.append(made)
                self.tally.refined += 1
                found = _refine_path(self._task, self.finder, paths[i], made)
                self.best = _better(best, found)

    def is_hopeless(self, course: Course) -> bool:
        """Return whether a course, inside the limits or not, costs too much to be refined."""
        return self._is_hopeless(self._task.plan_at(*course, _CLAIM).cost)

    def _is_hopeless(self, cost: float) -> bool:
        gain = GAIN_OF_MAX if self._task.settings.objective == "max" else GAIN
        best = self.best
        return best is not None and cost * (1 - gain) >= best.cost_after

    def refine_course(self, course: Course, score: float) -> float:
        """Refine a course whose cost is about `score`; if need be, first bring it near the limits.

        A refinement that begins far outside the limits may end at a cost far above the score; once
        one has, courses are brought near them at once. Returns the cost that is reached, infinite
        where the motion breaks limits or is not clear.
        """
        self.tally.refined += 1
        made, ease = self._task.plan_at(*course, _CLAIM), self._far_outside
        found = self._refined(made, ease=ease)
        if not (found.done and (ease or found.cost_after <= (1 + FAR) * score)):
            self._far_outside |= found.done
            other = self._refined(made, ease=not ease)
            found = min((found, other), key=lambda each: (not each.done, each.cost_after))
        if not (found.done and self.finder.is_clear(found.plan) and self._has_room(found.plan)):
            return np.inf
        self.found.append(found)
        self.best = _better(self.best, found)
        return found.cost_after

    def _refined(self, made: Plan, *, ease: bool) -> Refinement:
        """Return the refinement of a motion, which is first brought near the limits if `ease`."""
        if ease:
            made = refiner.reduce_excess(made, goals=self._goals)
        return refiner.refine(made, first=FIRST_STEP, goals=self._goals)

    def _has_room(self, made: Plan) -> bool:
        """Return whether the tool can back off at each end where it can in the best motion."""
        if self.best is None or made.settings.retract is None:
            return True
        ends, asked = [0, -1], made.settings
        room, before = (
            has_room(asked, plan.robot, plan.q[ends], plan.posture[ends], plan.T_flange_tip)
            for plan in (made, self.best.plan)
        )
        return bool((room | ~before).all())

    def refine_from_grid(self, task: Task) -> None:
        """Refine the best path on the grid of a task, if there is already a motion to improve on.

        It leads to other local optima than paths between the samples do.
        """
        if self.best is None:
            return
        found: Refinement | None
        self.tally.refined += 1
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

    def hold_against_grid(self) -> None:
        """Take the best path on the grid of the task, refined if possible, where it costs less.

        That there is none is proved with little work: paths that cost more are not followed.
        """
        assert self.best is not None, "there is a motion to compare with"
        finish_compiling({"exact"})
        try:
            cheaper = partial(find_cheaper, cost=self.best.cost_after)
            path = self.finder.find(cheaper, self._task.problem)
        except NoCheaperPath:
            return
        made = self._task.plan(path.index, path.cost, _CLAIM)
        self.tally.refined += 1
        refined = refiner.refine(made)
        found = [refined] if refined.done else []
        if made.robot.jerk_limit() is None:  # else the path need not keep it
            found.append(replace(refined, done=True, plan=made, cost_after=made.cost))
        for each in found:
            if self.finder.is_clear(each.plan) and not_followed(each.plan) is None:
                self.best = _better(self.best, each)


def _refine_path(
    task: Task, finder: CollisionFreeSearch, path: ContinuousPath, made: Plan
) -> Refinement | None:
    """Return the refinement of a path; None if it does not keep the limits or is not clear."""
    return refined_clear(
        finder, path, made, lambda within: refiner.refine(made, first=FIRST_STEP, within=within)
    )


Bounds = tuple[Array, Array]
"""Least and largest free variables of a refinement, (K, 1 + E) rad or m."""


def refined_clear(
    finder: CollisionFreeSearch,
    path: ContinuousPath,
    made: Plan,
    refine: Callable[[Bounds | None], Refinement],
) -> Refinement | None:
    """Return what `refine` makes of the plan of a path; None if it is not done or not clear.

    In a cell, gamma stays between clear samples. Where the refined motion is not clear, gamma and
    external axes are kept closer to the path, and the refinement is repeated.
    """
    clear = finder.corridor(path.one, path.other)
    if clear is None:
        found = refine(None)
        return found if found.done else None
    graph = finder.graph
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
        found = refine((low, high))
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
