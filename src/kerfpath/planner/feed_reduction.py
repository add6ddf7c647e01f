"""feed = "dip": paths to slow down, their least times, and where the feed is reduced.

A path is slowed down in three steps. Gamma moves so that the motion exceeds the limits little at
the speed asked for; `retime` gives every interval the least time that the limits need; and at these
times gamma moves to the least cost.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from kerfpath import refiner
from kerfpath.effort import current_effort
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.courses import Courses, can_explore
from kerfpath.planner.impossible import motion_test
from kerfpath.planner.quickest import MANY, alike, clear_paths, without_aim
from kerfpath.planner.refinements import plan_first_order
from kerfpath.planner.screening import QUICK
from kerfpath.planner.starts import Bounds, refined_clear
from kerfpath.planner.statements import STOPPED
from kerfpath.planner.straight_moves import follows, least_times
from kerfpath.planner.task import Task
from kerfpath.plans import Plan, Proof, has_room
from kerfpath.progress import StopEarly, counted, unstopped
from kerfpath.refiner import Refinement
from kerfpath.retime import feed, retime
from kerfpath.robots import lowest_joint
from kerfpath.search import (
    BeamWidth,
    ContinuousPath,
    SearchProblem,
    edges_allowed,
    find_slow_path,
    find_slowed,
)

BEAM = BeamWidth(60, (1.1, 1.0))
"""BeamWidth of the search for a path over continuous gamma."""
SLOWER = (1.0, 1.2, 1.5, 2.0, 3.0, 4.5, 7.0, 10.0, 20.0, 50.0)
"""Node intervals at which a path is to keep all limits, as multiples of the one asked for."""
PROGRAMS = 10
"""Most convex programs that reduce the excess; sixty gained 0.1 % of the time on 728 nodes."""
STEPS, THROUGH_VALLEYS, SHORTENING = 110, 150, 45
"""Convex programs and searches that slowing the first two paths usually takes, slowing motions
through all valleys, and shortening each of the quickest; to estimate the time left."""
LOST = 1e-3
"""Share of the time that a plan may lose before motions through all valleys are slowed, too."""
SAME_TIME = 1e-4
"""Share of the time by which plans that differ count as equally quick: that of `retime`."""
SLOWED, SHORTENED = 8, 2
"""Screened motions that are slowed down, and the quickest motions that are shortened."""
TAKEN, LEAST_TAKEN, GAIN = 0.1, 0.01, 5e-4
"""Share of the lost time that is taken at once, first and at last, and least relative gain."""
ROUNDS, HURRIED = 16, 3
"""Most times that time is taken, fewer over more than `MANY` nodes, and convex programs of each."""
NEARLY = 1.02
"""Time of a plan with a reduced feed, relative to that at the speed asked for, up to which a motion
at that speed throughout is looked for."""


# -----------------------------------------------------------------------------
# Over continuous gamma.


def slowed_motion(task: Task, finder: CollisionFreeSearch) -> Plan | None:
    """Return the quickest motion found, at the speed asked for where the limits allow it.

    The paths to slow down are those of beam searches: at the speed asked for without (6), and with
    all limits at the highest constant speed of `SLOWER` that has one. Where they lose time, courses
    through all valleys are screened for the least time, and the best are slowed down. Of equally
    quick motions it is the cheapest. None if no path was found or none stays clear of the cell.
    """
    clear: list[Plan] = []
    tried: list[Plan] = []
    try:
        with counted(STEPS) as remain:
            for path in _paths(task, finder):
                made = task.plan_between(path, _claim(finder))
                if not any(alike(made, other) for other in tried):
                    tried.append(made)
                    slowed = _slowed_between(task, finder, path, made)
                    clear += [] if slowed is None else [slowed]
            if not any(_hardly_slower(task, made) for made in clear):
                if can_explore(task):
                    remain(THROUGH_VALLEYS + SHORTENED * SHORTENING)
                    clear += _through_valleys(task, finder)
                quickest = sorted(clear, key=_quickest_followed)[:SHORTENED]
                for left, made in zip(range(len(quickest), 0, -1), quickest, strict=True):
                    remain(left * SHORTENING)
                    clear += _shortened(task, finder, made)
    except StopEarly:
        if not clear:
            with unstopped():
                plans = (refiner.reduce_excess(made, most=0) for made in tried)
                within = (plan for plan in plans if np.isfinite(plan.q).all())
                slow = (_with_least_times(task, plan) for plan in within)
                clear = [plan for plan in slow if not _broken(task, finder, plan)]
        if not clear:
            raise
        clear = [replace(plan, proof=plan.proof.also(STOPPED)) for plan in clear]
    return _cheapest_of_quickest(clear) if clear else None


def may_keep_speed(task: Task, made: Plan) -> bool:
    """Return whether a motion at the speed asked for throughout is worth a search.

    It is where a plan with a reduced feed takes hardly longer, unless it is proved that no motion
    passes the place where its feed is lowest.
    """
    assert made.feed is not None
    if made.time[-1] > NEARLY * task.times[-1]:
        return False
    test = motion_test(task) if made.feed.node >= 0 else None
    return test is None or test.closed(task.problem.limits, task.dt, made.feed.node) is None


def _claim(finder: CollisionFreeSearch) -> Proof:
    said = "the quickest motion found, slowed down from paths over continuous rotation"
    return Proof(optimal=False, statement=finder.claimed(said))


def _paths(task: Task, finder: CollisionFreeSearch) -> Iterator[ContinuousPath]:
    """Yield paths over continuous gamma that are worth slowing down; there may be none."""
    without = task.problem.limits.without_acceleration()
    yield from _first_path(task, finder, replace(task.problem, limits=without))
    for times in SLOWER:
        found = _first_path(task, finder, replace(task.problem, dt=times * task.dt))
        if found:
            yield from found
            return


def _first_path(
    task: Task, finder: CollisionFreeSearch, problem: SearchProblem
) -> list[ContinuousPath]:
    """Return the best path over continuous gamma of a problem, if one is found."""
    searched = clear_paths(task.with_problem(problem), finder, (BEAM,))
    return [] if searched is None else searched[1][:1]


def _slowed_between(
    task: Task, finder: CollisionFreeSearch, path: ContinuousPath, made: Plan
) -> Plan | None:
    """Return the plan of a path slowed down; None if it is not clear, even close to the path."""

    def refine(within: Bounds | None) -> Refinement:
        return refiner.refine(_with_reduced_excess(task, made, within), within=within)

    if not np.isfinite(refiner.promise(made)):
        return None
    found = refined_clear(finder, path, made, refine)
    at_nodes = refiner.reduce_excess(made, most=0) if found is None else found.plan
    slowed = _with_least_times(task, at_nodes)
    if found is None and _broken(task, finder, slowed):
        return None
    return replace(slowed, proof=_claim(finder))


def _hardly_slower(task: Task, made: Plan) -> bool:
    """Return whether a plan that the arm can follow loses hardly any time."""
    return follows(made) and bool(made.time[-1] <= (1 + LOST) * task.times[-1])


def _through_valleys(task: Task, finder: CollisionFreeSearch) -> list[Plan]:
    """Return motions through all valleys, slowed down, clear, the quickest ones."""
    courses = Courses(without_aim(task), aim="time")
    slowed = list[Plan]()
    for _, course in islice(courses.screened(courses.all(), QUICK), SLOWED):
        made = _with_reduced_excess(task, task.plan_at(*course, _claim(finder)))
        if not any(alike(made, other) for other in slowed):
            slowed.append(made)
    return [made for made in slowed if _is_admitted(task, finder, made)]


def _is_admitted(task: Task, finder: CollisionFreeSearch, made: Plan) -> bool:
    """Return whether a motion keeps ranges, margins, floor and room at its ends, and is clear."""
    asked, ends = task.settings, [0, -1]
    if not np.isfinite(refiner.promise(made)) or _broken(task, finder, made):
        return False
    if asked.floor is not None and (lowest_joint(task.robot, made.q) < asked.floor).any():
        return False
    if asked.retract is None:
        return True
    room = has_room(asked, task.robot, made.q[ends], made.posture[ends], task.setup.tool)
    return bool(room.all())


def _shortened(task: Task, finder: CollisionFreeSearch, made: Plan) -> list[Plan]:
    """Return the plan with less time lost, and that moved to less cost; none if it cannot be.

    A share of the time that every interval loses is taken from it, and gamma moves to exceed the
    limits little at these times. Where this gains no time, less is taken.
    """
    begun, taken = made, TAKEN
    for _ in range(max(1, ROUNDS * MANY // max(MANY, len(task.contour)))):
        hurried = np.cumsum(task.dt + (1 - taken) * (np.diff(made.time) - task.dt))
        start = replace(made, time=np.concatenate([[0.0], hurried]))
        moved = _with_reduced_excess(task, start, most=HURRIED)
        if moved.time[-1] < (1 - GAIN) * made.time[-1] and _is_admitted(task, finder, moved):
            made = moved
            continue
        taken /= 2
        if taken < LEAST_TAKEN:
            break
    cheaper = _with_least_times(task, refiner.refine(made).plan)
    shortened = [] if made is begun else [made]
    found = [*shortened, cheaper] if _is_admitted(task, finder, cheaper) else shortened
    return [replace(each, proof=_claim(finder)) for each in found]


# -----------------------------------------------------------------------------
# On the grid of gamma.


def plan_slowed(task: Task, finder: CollisionFreeSearch, *, refine: bool) -> Plan:
    """Return a plan at the speed asked for where the paths of the grid allow it, slower elsewhere.

    Two paths get the least times under all limits: the one that loses the least time step by step,
    with lost time priced above all distances, and the best one without acceleration limits. Where
    the velocities leave very many edges, the first is left out; if there is no other, the shortest
    path at the highest constant speed under the velocities is slowed down. With `refine`, gamma
    also moves off the grid. The plan is the quickest clear one, and of equally quick ones the
    cheapest.

    Raises
    ------
    NoFeasiblePath
        A node has no pose, or no path joins the nodes at any speed.
    """
    starts = list(_on_grid(task, finder))
    on_grid = min((_with_least_times(task, start) for start in starts), key=_quickest_followed)
    if not (refine and task.robot.family.free_rotation):
        return on_grid
    why, followed = "take longer", _quickest_followed(on_grid)
    for made in sorted((_off_grid(task, start) for start in starts), key=_quickest_followed):
        if _quickest_followed(made) > followed:
            break
        broken = _broken(task, finder, made)
        if not broken:
            return made
        why = broken
    proof = on_grid.proof.also(f"not refined: off the grid it would {why}")
    return replace(on_grid, proof=proof)


def _on_grid(task: Task, finder: CollisionFreeSearch) -> Iterator[Plan]:
    """Yield the paths of the grid to slow down; there is at least one."""
    few = edges_allowed(task.problem, task.dt) <= current_effort().exact_edges
    slowed, first = _least_lost(task, finder) if few else None, plan_first_order(task, finder)
    if slowed is not None:
        yield slowed
    if first is not None and (slowed is None or not np.array_equal(first.q, slowed.q)):
        yield first
    if slowed is None and first is None:
        path = finder.find(find_slow_path, task.problem)
        claim = finder.claimed("the shortest path at the highest constant speed under velocities")
        proof = Proof(optimal=False, statement=claim)
        yield task.plan(path.index, task.cost(path.index), proof)


def _least_lost(task: Task, finder: CollisionFreeSearch) -> Plan:
    found = finder.find(find_slowed, task.problem)
    claim = finder.claimed(
        "at constant speed the graph has no path; of all its paths this one loses the least time "
        "step by step"
    )
    return task.plan(found.index, task.cost(found.index), Proof(optimal=False, statement=claim))


def _off_grid(task: Task, start: Plan) -> Plan:
    """Return the faster of a path with reduced excess and its refinement, with the least times."""
    claim = f"{start.proof.statement}; gamma moved off the grid to lose little time"
    proof = Proof(optimal=False, statement=claim)
    moved = replace(_with_reduced_excess(task, start), proof=proof)
    return min(moved, _with_least_times(task, refiner.refine(moved).plan), key=_quickest_followed)


# -----------------------------------------------------------------------------


def _time_and_cost(made: Plan) -> tuple[float, float]:
    """Return the time of a plan, s, rounded to 1 ns, and its cost."""
    return round(float(made.time[-1]), 9), made.cost


def _quickest_followed(made: Plan) -> tuple[bool, float, float]:
    """Return a key that sorts plans whose moves the arm can follow first, then the quickest."""
    return (not follows(made), *_time_and_cost(made))


def _cheapest_of_quickest(plans: list[Plan]) -> Plan:
    """Return the cheapest of the plans that take the least time, as far as `retime` finds it.

    Plans whose moves the arm can follow come first.
    """
    followed = [made for made in plans if follows(made)] or plans
    enough = (1 + SAME_TIME) * min(float(made.time[-1]) for made in followed)
    return min((made for made in followed if made.time[-1] <= enough), key=lambda made: made.cost)


def _broken(task: Task, finder: CollisionFreeSearch, made: Plan) -> str:
    """Return what a plan off the grid would break, as text; "" if nothing."""
    comfort = task.settings.comfort
    if comfort is not None and comfort.broken(task.robot, made.q, task.setup.tool):
        return "break a margin of comfort"
    return "" if finder.is_clear(made) else "not be clear"


def _with_reduced_excess(
    task: Task, start: Plan, within: Bounds | None = None, most: int = PROGRAMS
) -> Plan:
    """Return the plan with gamma moved to exceed the limits little, with the least times."""
    return _with_least_times(task, refiner.reduce_excess(start, within=within, most=most))


def _with_least_times(task: Task, made: Plan) -> Plan:
    """Return the plan with the least times and its feed reduction.

    They also keep the velocities on the straight moves between the nodes that the arm can follow.
    """
    limits, asked = task.problem.limits, least_times(made)
    least = np.where(asked < np.inf, np.maximum(asked, task.dt), task.dt)
    tau = retime(made.increments, least, limits, q=made.q)
    dips = feed(tau, task.dt, made.increments, limits, np.diff(made.contour.s), q=made.q)
    return replace(made, time=np.concatenate([[0.0], np.cumsum(tau)]), feed=dips)
