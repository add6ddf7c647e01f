"""Exploration of all valleys for the cheapest motion.

Courses through all valleys are screened together; the best are refined, then changed at random,
and screened again.
"""

from __future__ import annotations

from itertools import islice

import numpy as np

from kerfpath.effort import current_effort
from kerfpath.planner.courses import Courses
from kerfpath.planner.screening import SHARP, SMOOTH, Stage
from kerfpath.planner.starts import Starts
from kerfpath.planner.task import Task
from kerfpath.plans import Plan
from kerfpath.refiner import Refinement
from kerfpath.search import Course

FIRST = 3
"""Courses through the cheapest valleys that are refined before all are explored."""
BY_FEW = 4.0
"""How many times `Effort.worth_exploring` the gap to the value function along every few nodes may
be: their steps pass over what a course turns back between them."""
REFINED, REFINED_AGAIN = 5, 3
"""Motions that are refined after the first screening, and after each later one, and in any case one
in each posture: a score is a guess where (6) binds, and all motions of the posture that it puts
first may end outside the limits."""
HOPELESS = 1.25
"""Scores from this many times the best cost on are not refined: a refinement gains less."""
ROUNDS = 2
"""Times that the best motions are shaken, the second only if the first gained."""
AGAIN, SAME_END = 3, 1e-4
"""Refinements that end at the best cost again, to this relative difference, from which on no more
are made: motions that are not alike lead to it. The cost of the largest step alone says nothing of
that, as many motions share the step."""
SHAKEN = 2
"""Best motions that are shaken."""
SAME_COST = 1e-3
"""Relative difference of cost up to which two motions count as one when they are shaken."""
SAME_MOTION = 0.02
"""rad: a screened motion whose gamma is nearer to that of a known one is not refined."""


class Exploration:
    """Exploration of the valleys of a task for the cheapest motion.

    Parameters
    ----------
    task : Task
        A task that `can_explore`.
    starts : Starts
        Refines the motions and keeps the best; it has one already.
    """

    def __init__(self, task: Task, starts: Starts) -> None:
        self._starts, self._courses = starts, Courses(task)
        self._known: list[Course] = []
        self._begun: list[Course] = []
        self._again, self._costs_add_up = 0, task.settings.objective == "sum"

    def begin(self) -> None:
        """Refine the courses through the cheapest valleys that may lead to better motions."""
        tally = self._starts.tally
        for course in islice(self._courses.cheapest(), FIRST):
            self._begun.append(course)
            tally.follow(course)
            if self._is_known(course):
                tally.alike += 1
            elif self._starts.is_hopeless(course):
                tally.dearer += 1
            else:
                self._starts.refine_course(course, np.inf)

    @property
    def promises(self) -> bool:
        """Whether there may be a better motion than the best one.

        Along every few nodes the value function sees courses that it misses along all of them.
        """
        above, courses, gap = self._starts.above, self._courses, current_effort().worth_exploring
        return above(courses.value, gap) or above(courses.value_along_few, BY_FEW * gap)

    def run(self) -> None:
        """Screen and refine courses through all valleys; shake the best motions."""
        self._starts.explored = True
        courses, tally = self._courses, self._starts.tally
        every = courses.all()
        for course in courses.followed:
            if not any(course.like(other) for other in self._begun):
                tally.follow(course)
        tally.unfollowed = courses.unfollowed
        self._refine(self._screened(every, SMOOTH, SHARP), REFINED)
        for _ in range(ROUNDS):
            before = self._best_cost
            if self._again < AGAIN:
                self._refine(self._screened(courses.shaken(self._best()), SHARP), REFINED_AGAIN)
            if self._best_cost >= (1 - SAME_END) * before:
                break

    def _screened(
        self, courses: list[Course], *ways: tuple[Stage, ...]
    ) -> list[tuple[float, Course]]:
        """Return what courses are screened to each way, with scores, best first."""
        found, tally = self._courses.screened(courses, *ways), self._starts.tally
        begun = len(courses) * len(ways)
        tally.screened += begun
        tally.dropped += begun - len(found)
        return found

    def _refine(self, screened: list[tuple[float, Course]], most: int) -> None:
        """Refine the best motions that are not known: so many, and the best of every posture."""
        tried, tally, postures = 0, self._starts.tally, set[frozenset[int]]()
        for number, (score, course) in enumerate(screened):
            best, rest = self._best_cost, len(screened) - number
            if score > HOPELESS * best:
                tally.dearer += rest
                break
            if self._again == AGAIN:
                tally.left += rest
                break
            posture = frozenset(course.posture.tolist())
            if tried >= most and posture in postures:
                tally.left += 1
            elif self._is_known(course):
                tally.alike += 1
            else:
                tried += 1
                postures.add(posture)
                self._known.append(course)
                found = self._starts.refine_course(self._courses.closed(course), score)
                if self._costs_add_up and found <= (1 + SAME_END) * best < np.inf:
                    self._again = self._again + 1 if found >= (1 - SAME_END) * best else 0

    @property
    def _best_cost(self) -> float:
        """Cost of the best motion; infinite if there is none."""
        best = self._starts.best
        return np.inf if best is None else best.cost_after

    def _is_known(self, course: Course) -> bool:
        """Return whether a motion is nearly one that has been refined, or one found so.

        The other pose of its wrist changes nothing, unless it must be clear in a cell.
        """
        plans = (each.plan for each in self._starts.all_found)
        found = (Course(plan.gamma, plan.q, plan.posture) for plan in plans)
        same = self._courses.same if self._starts.finder.is_free else Course.like
        return any(same(course, other, SAME_MOTION) for other in (*self._known, *found))

    def _best(self) -> list[Plan]:
        """Return the best motions that differ in cost."""
        best: list[Refinement] = []
        for found in sorted(self._starts.all_found, key=lambda each: each.cost_after):
            if all(abs(found.cost_after / o.cost_after - 1) > SAME_COST for o in best):
                best.append(found)
        return [found.plan for found in best[:SHAKEN]]
