"""Quickest motion: the fastest path moved off the grid, then beam searches at higher speeds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from kerfpath.arrays import short_repr
from kerfpath.effort import current_effort
from kerfpath.kernels.metric import wrap
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.courses import Courses, can_explore
from kerfpath.planner.screening import QUICK
from kerfpath.planner.straight_moves import not_followed
from kerfpath.planner.task import Task
from kerfpath.plans import Plan, Proof
from kerfpath.refiner import MOST_INTERVALS, Binding, quicken
from kerfpath.search import (
    BeamWidth,
    ContinuousPath,
    ContinuousSearch,
    Course,
    LeastInterval,
    edges_allowed,
    find_least_interval,
    find_slow_path,
)
from kerfpath.tolerances import LIMIT_MARGIN

GAIN = 2e-3
"""Relative gain of speed below which a search counts as without gain."""
WIDE, MOST_STATES = 1600, 5_000_000
"""Most states kept in a wide search, in each layer and in all layers."""
WIDE_ALIKE = (1.1, 0.5)
"""`BeamWidth.alike` of a wide search."""
SAME_VALLEY = 0.05
"""rad: paths whose gamma differs by less are refined to the same motion."""
FACTORS = (1.05, 1.0, 1.15)
"""Multiples of the speed reached at which valleys are explored, from the third on only where the
last gained."""
QUICKENED, FEW = 5, 2
"""Motions that are moved to their least interval after each screening; and where these are far from
an interval that is wanted."""
HOPELESS = 1.5
"""A screened motion that needs this many times the best interval is left."""
ROUNDS = 2
"""Times that the best motion is shaken."""
ALIKE_BOUND, SAME_END = 3, 1e-4
"""Number of motions with the best interval, to this relative difference, but another gamma, from
which on no more are looked for: they are bound where gamma changes nothing."""
FAR = 2.0
"""Multiple of a wanted interval from which on valleys are not explored: they hardly gain it."""
NEAR, CLOSE = 1.25, 1.05
"""Multiples of a wanted interval from which on only the first search of each kind is made, which
gains most; the second over many nodes."""
MANY = 200
"""Nodes from which on a search of each kind takes several seconds."""
FEW_EDGES = 0.1
"""Share of the most edges of an exact search up to which it is made for a speed far too high."""
MOST_SEARCHES = 40
"""Most searches for paths that are clear."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class QuickMotion:
    """A motion with the least interval between its nodes, and the limit that binds it.

    Parameters
    ----------
    plan : Plan
        The motion with the times of that interval; not refined for its cost.
    at : Binding
    on_grid : float s
        The least interval of a path on the grid.
    """

    plan: Plan
    at: Binding
    on_grid: float

    __repr__ = short_repr

    @property
    def dt(self) -> float:
        """Interval between its nodes, s."""
        return self.plan.dt

    def is_enough(self, dt: float) -> bool:
        """Return whether it keeps every limit, rounding included, with `dt` s between its nodes."""
        return self.dt * (1 - LIMIT_MARGIN / 2) <= dt


def quick_motions(
    task: Task, finder: CollisionFreeSearch, *, wanted: float = np.inf, explore: bool = True
) -> Iterator[QuickMotion]:
    """Yield successively faster motions along the contour of a task, clear and within its margins.

    The first is the fastest path on the grid. The second, if the robot leaves a rotation free, is
    that path with gamma moved off the grid, or the same again. Beam searches over continuous gamma
    at the speed reached and above give the others, whatever they cost, until the speed no longer
    grows, and, if `explore`, courses through all valleys, twice, and again as long as the last
    ones gained. All end where several motions that differ have the best interval. The speed,
    closure and costs of the task do not matter: tasks that differ only in them have the same
    motions, in the same order. Where the motions stay far from the `wanted` interval, s, the last
    of them are not looked for.

    Raises
    ------
    NoFeasiblePath
        No path on the grid is clear at any speed.
    """
    task = without_aim(task)
    best = _along(task, finder.find(find_least_interval, task.problem))
    path = best.plan
    yield best
    if not task.robot.family.free_rotation:
        return
    best = faster_motion(task, finder, path, best)
    yield best
    explore = explore and can_explore(task)
    tried, seen = [path], _Seen()
    factors, begun = current_effort().speed_factors, best.dt
    enough = (CLOSE if len(task.contour) >= MANY else NEAR) * wanted
    for factor in factors[:1]:
        for found in _by_beam(task, finder, best, factor, tried, seen):
            best = found
            yield best
    if explore and best.dt <= (NEAR if len(task.contour) >= MANY else FAR) * wanted:
        for found in _through_valleys(
            task, finder, best, factor=FACTORS[0], seen=seen, enough=enough
        ):
            best = found
            yield best
    if can_explore(task) and best.dt > enough:
        return
    without_gain = int(best.dt >= (1 - GAIN) * begun)
    while without_gain < len(factors) and not seen.settled(best):
        before = best.dt
        for found in _by_beam(task, finder, best, factors[without_gain], tried, seen):
            best = found
            yield best
        without_gain = 0 if best.dt < (1 - GAIN) * before else without_gain + 1
    valleys = [partial(_through_valleys, factor=factor) for factor in FACTORS[1:]]
    searches: list[Callable[..., Iterator[QuickMotion]]] = [*valleys, _shaken]
    for search in searches:
        if not explore or seen.settled(best):
            return
        before = best.dt
        for found in search(task, finder, best, seen=seen):
            best = found
            yield best
        explore = best.dt < (1 - GAIN) * before


class _Seen:
    """The courses that were moved to their least interval, and the motions that they led to."""

    def __init__(self) -> None:
        self.courses, self._ends = list[Course](), list[Plan]()

    def faster(
        self, task: Task, finder: CollisionFreeSearch, start: Plan, best: QuickMotion
    ) -> QuickMotion:
        """Return `faster_motion`, and remember where it ends."""
        found = _at_least_interval(start)
        if found is not None:
            self._ends.append(found[0])
        return _faster(task, finder, found, best)

    def settled(self, best: QuickMotion) -> bool:
        """Return whether enough motions that differ have the best interval."""
        apart: list[Plan] = []
        for end in self._ends:
            as_quick = end.dt <= (1 + SAME_END) * best.dt
            if as_quick and all(_apart(end, other) >= SAME_VALLEY for other in apart):
                apart.append(end)
        return len(apart) >= ALIKE_BOUND


def _by_beam(
    task: Task,
    finder: CollisionFreeSearch,
    best: QuickMotion,
    factor: float,
    tried: list[Plan],
    seen: _Seen,
) -> Iterator[QuickMotion]:
    """Yield ever faster motions by a beam search at some times the speed of the best one.

    Paths like those `tried`, to which its own are added, are left out.
    """
    ahead = _at(task, best.dt / factor)
    found = clear_paths(ahead, finder, (wide(task),))
    for between in () if found is None else found[1]:
        made = ahead.plan_between(between, _claim())
        if not any(alike(made, other) for other in tried):
            tried.append(made)
            faster = seen.faster(task, finder, made, best)
            if faster is not best:
                best = faster
                yield best


def _through_valleys(
    task: Task,
    finder: CollisionFreeSearch,
    best: QuickMotion,
    *,
    factor: float,
    seen: _Seen,
    enough: float = np.inf,
) -> Iterator[QuickMotion]:
    """Yield ever faster motions through all valleys at some times the speed of the best one.

    There are fewer while the best one takes longer than `enough`, s.
    """
    ahead = _at(task, best.dt / factor)
    courses = Courses(ahead, aim="interval")
    screened = courses.screened(courses.all(), QUICK)
    yield from _quickened(ahead, finder, screened, best, seen, enough)


def _shaken(
    task: Task, finder: CollisionFreeSearch, best: QuickMotion, seen: _Seen
) -> Iterator[QuickMotion]:
    """Yield ever faster motions from the best one, changed at random."""
    shaken, screened = None, list[tuple[float, Course]]()
    for _ in range(ROUNDS):
        if best is not shaken:  # else the changes are the same, and the next of them are tried
            shaken, ahead = best, _at(task, best.dt / FACTORS[0])
            courses = Courses(ahead, aim="interval")
            screened = courses.screened(courses.shaken([best.plan]), QUICK)
        for found in _quickened(ahead, finder, screened, best, seen):
            best = found
            yield best


def _quickened(
    ahead: Task,
    finder: CollisionFreeSearch,
    screened: list[tuple[float, Course]],
    best: QuickMotion,
    seen: _Seen,
    enough: float = np.inf,
) -> Iterator[QuickMotion]:
    """Yield ever faster motions from the best screened ones that are not known."""
    tried = 0
    for needed, course in screened:
        most = QUICKENED if best.dt <= enough else FEW
        if tried >= most or needed * ahead.dt > HOPELESS * best.dt or seen.settled(best):
            break
        if any(course.like(other, SAME_VALLEY) for other in seen.courses):
            continue
        tried += 1
        seen.courses.append(course)
        faster = seen.faster(ahead, finder, ahead.plan_at(*course, _claim()), best)
        if faster is not best:
            best = faster
            yield best


def velocity_limited_motions(
    task: Task, finder: CollisionFreeSearch, *, wanted: float = np.inf
) -> Iterator[QuickMotion]:
    """Yield motions of a task whose speed is much too high: the quickest if these take little time.

    If the velocities leave very many edges in the time that a path takes, they are the shortest
    path by the velocities alone, and that path with gamma moved off the grid, nearly to its least
    interval: they only say how far the speed is too high. Raises as `quick_motions`.
    """
    slow = without_aim(task)
    path = finder.find(find_slow_path, slow.problem)
    if edges_allowed(slow.problem, path.dt) <= FEW_EDGES * current_effort().exact_edges:
        yield from quick_motions(task, finder, wanted=wanted)
        return
    task, best = slow, _along(slow, path)
    yield best
    if task.robot.family.free_rotation:
        yield _faster(task, finder, _at_least_interval(best.plan, most=1), best)


def _along(task: Task, least: LeastInterval) -> QuickMotion:
    """Return the motion along a path on the grid."""
    path = _at(task, least.dt).plan(least.index, 0.0, _claim())
    at = Binding(least.joint, least.node, least.limit)
    return QuickMotion(plan=path, at=at, on_grid=least.dt)


def without_aim(task: Task) -> Task:
    """Return the task of the fastest speed: no costs, no closure, default distances."""
    velocity, _ = task.robot.speed_limits()
    settings = replace(
        task.settings.without_penalties,
        metric="manhattan",
        objective="sum",
        closure="free",
        rotation=None,
        weights=1 / velocity,
    )
    problem = replace(
        task.problem.free(), metric="manhattan", objective="sum", weights=settings.weights
    )
    return replace(task.with_problem(problem), settings=settings)


def _at(task: Task, dt: float) -> Task:
    return task.with_problem(replace(task.problem, dt=dt))


def _claim() -> Proof:
    return Proof(optimal=False, statement="the quickest motion found")


def faster_motion(
    task: Task, finder: CollisionFreeSearch, start: Plan, best: QuickMotion
) -> QuickMotion:
    """Return the better of the best motion so far and a start with its interval minimised."""
    return _faster(task, finder, _at_least_interval(start), best)


def _faster(
    task: Task,
    finder: CollisionFreeSearch,
    found: tuple[Plan, Binding] | None,
    best: QuickMotion,
) -> QuickMotion:
    """Return the better of the best motion so far and a found one, if there is one."""
    if found is None or found[0].dt >= best.dt or not _allowed(task, finder, found[0]):
        return best
    return replace(best, plan=found[0], at=found[1])


def quickest_along(task: Task, finder: CollisionFreeSearch, path: ContinuousPath) -> Plan | None:
    """Return a path between the samples, moved to its least interval; the speed does not matter.

    None if it leaves the reach of its posture, or is not clear.
    """
    task = without_aim(task)
    found = _at_least_interval(task.plan_between(path, _claim()))
    return None if found is None or not _allowed(task, finder, found[0]) else found[0]


def _at_least_interval(start: Plan, *, most: int = MOST_INTERVALS) -> tuple[Plan, Binding] | None:
    """Return a motion moved to its least interval, and what binds it there; `most` as `quicken`."""
    quickened = quicken(start, most=most)
    if quickened is None:
        return None
    made, at = quickened
    return replace(made, time=made.time * (1 + LIMIT_MARGIN)), at


def _allowed(task: Task, finder: CollisionFreeSearch, made: Plan) -> bool:
    """Return whether the arm follows a motion, which keeps the margins of comfort and is clear."""
    if not_followed(made) is not None:
        return False
    comfort = task.settings.comfort
    if comfort is not None and comfort.broken(task.robot, made.q, task.setup.tool):
        return False
    return finder.is_clear(made)


def wide(task: Task) -> BeamWidth:
    """Return the beam of a wide search, less wide over very many nodes."""
    return BeamWidth(min(WIDE, MOST_STATES // len(task.contour) + 1), WIDE_ALIKE, 1)


def clear_paths(
    task: Task, finder: CollisionFreeSearch, beams: tuple[BeamWidth, ...]
) -> tuple[ContinuousSearch, list[ContinuousPath]] | None:
    """Return a search over continuous gamma and its paths, clear at the samples that they use.

    Samples that paths would use are checked, and avoided if they collide, until all paths are
    clear; None if this takes too many searches.
    """
    for _ in range(MOST_SEARCHES):
        search = ContinuousSearch(finder.open_problem(task.problem), task.samples)
        paths = [path for beam in beams for path in search.paths(beam)]
        if not finder.learn([ends for path in paths for ends in (path.one, path.other)]):
            return search, paths
    return None


def alike(made: Plan, other: Plan) -> bool:
    """Return whether two motions are so similar that they are refined to the same one."""
    return _apart(made, other) < SAME_VALLEY and np.array_equal(made.posture, other.posture)


def _apart(made: Plan, other: Plan) -> float:
    """Return the largest difference of gamma of two motions, rad."""
    return float(np.abs(wrap(made.gamma - other.gamma)).max())
