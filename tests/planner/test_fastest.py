"""The fastest motion: what is reached a plan finds, and a refusal says what would open the way."""

import re
from contextlib import suppress
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from kerfpath import InputError, NoFeasiblePath, audit, fastest_speed, plan, refiner
from kerfpath.contour import Contour
from kerfpath.effort import changed_effort
from kerfpath.options import PlanOptions
from kerfpath.planner import quickest as quickest_module
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.quickest import quick_motions
from kerfpath.planner.task import planning_task
from kerfpath.plans import path_cost
from kerfpath.setup import Setup

STEP = np.radians(6)
pytestmark = pytest.mark.usefixtures("quickest_at_work")


def drawn(seed, nodes=21):
    """Return a random short open contour in front of the robot, on a curved surface."""
    rng = np.random.default_rng([23, seed])
    t = np.linspace(0, 2 * np.pi * rng.uniform(0.5, 0.8), 400)
    r = 0.06 + 0.02 * rng.uniform(-1, 1) * np.cos(2 * t + rng.uniform(0, 6))
    points = np.stack([r * np.cos(t), r * np.sin(t), 0.02 * np.cos(3 * t)], axis=1)
    points[:, 1] += rng.uniform(-0.2, 0.2)
    lean = 0.3 * np.stack([np.cos(t + rng.uniform(0, 6)), np.sin(t + rng.uniform(0, 6))], axis=1)
    return Contour(points, np.column_stack([lean, -np.ones(400)]), closed=False).resample(
        count=nodes
    )


def errors(made):
    """Return what the audit refuses at the nodes: between nodes as far apart nothing is held."""
    issues = [issue for issue in audit(made) if issue.level == "error"]
    return [issue for issue in issues if not issue.code.endswith("-between")]


@pytest.fixture
def space(tool, placement):
    return {"tool": tool, "placement": placement, "gamma_step": STEP}


def task(nodes, arm, tool, placement, speed=0.5, **options):
    asked = PlanOptions(gamma_step=STEP, **options)
    return planning_task(nodes, Setup.of(arm, tool, placement), asked, speed=speed)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "seed"), [("continuous", 0), ("exact", 1), ("continuous", 2), ("exact", 2)]
)
def test_at_the_fastest_speed_and_below_there_is_a_plan(seed, method, arm, space):
    nodes = drawn(seed)
    fastest = fastest_speed(nodes, arm, refine=True, **space)
    for share in (1.0, 0.97):
        made = plan(
            nodes,
            arm,
            speed=share * fastest.speed,
            method=method,
            refine=method == "exact",
            **space,
        )
        assert errors(made) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_exploring_all_valleys_gives_no_lower_speed_and_a_plan_at_it(seed, arm, space):
    nodes = drawn(seed)
    before = fastest_speed(nodes, arm, refine=True, **space)
    with changed_effort(explored=True):
        fastest = fastest_speed(nodes, arm, refine=True, **space)
        made = plan(nodes, arm, speed=fastest.speed, **space)
    assert fastest.speed >= before.speed  # it goes on from the same motion
    assert errors(made) == []


@pytest.mark.parametrize("seed", range(3))
def test_motions_grow_quicker_and_keep_every_limit_at_their_own_speed(seed, arm, tool, placement):
    posed = task(drawn(seed), arm, tool, placement)
    found = list(quick_motions(posed, CollisionFreeSearch(posed)))
    assert len(found) >= 2
    steps = [motion.dt for motion in found]
    assert steps == sorted(steps, reverse=True)
    assert found[0].dt == found[0].on_grid
    for motion in found[1:]:
        assert errors(motion.plan) == []
        # What binds is used up, but for what is left free against rounding.
        criteria = motion.plan.criteria
        peak = getattr(criteria, f"peak_{motion.at.limit}")
        assert peak[motion.at.joint] == pytest.approx(1.0, rel=1e-4)


def test_what_a_plan_aims_at_plays_no_part(arm, tool, placement):
    nodes, steps = drawn(0), []
    for aim in (
        {},
        {"metric": "euclid", "weights": [3, 1, 1, 0.1, 0.1, 2]},
        {"objective": "max", "speed": 0.1},
    ):
        posed = task(nodes, arm, tool, placement, **aim)
        finder = CollisionFreeSearch(posed)
        steps.append([motion.dt for motion in islice(quick_motions(posed, finder), 3)])
    assert steps[0] == steps[1] == steps[2]


def test_the_fastest_speed_is_that_of_the_quickest_motion(arm, tool, placement, space):
    nodes = drawn(1)
    posed = task(nodes, arm, tool, placement)
    *_, best = quick_motions(posed, CollisionFreeSearch(posed))
    told = fastest_speed(nodes, arm, refine=True, **space)
    # dt is a mean of differences of times.
    assert told.speed == pytest.approx(np.diff(nodes.s).max() / best.dt, rel=1e-12)
    assert (told.joint, told.node, told.limit) == tuple(best.at)
    assert told.on_grid == fastest_speed(nodes, arm, **space).speed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "share"), [(0, 1.02), (1, 1.02), (2, 1.02), (0, 3.0), (1, 20.0), (2, 20.0)]
)
def test_a_refusal_says_with_what_a_motion_was_found(seed, share, arm, space):
    nodes = drawn(seed)
    fastest = fastest_speed(nodes, arm, refine=True, **space)
    speed = share * fastest.speed
    with pytest.raises(NoFeasiblePath) as caught:
        plan(nodes, arm, speed=speed, **space)
    none, needed = caught.value, caught.value.relaxation
    assert 0 < needed.speed < 1
    assert max(needed.velocity, needed.acceleration) > 1
    assert f"found at {needed.speed:g} of the speed" in str(none)
    assert (f"{needed.acceleration:g} times the accelerations" in str(none)) == (
        needed.acceleration > 1
    )
    if none.closed is None:
        # All that fastest_speed tries was tried, and the figures are rounded to 4 digits.
        assert needed.speed * share == pytest.approx(1, rel=2e-3)
    assert errors(plan(nodes, arm, speed=needed.speed * speed, **space)) == []


@pytest.mark.slow
@pytest.mark.usefixtures("explored")
@pytest.mark.parametrize(("seed", "share"), [(0, 1.02), (1, 1.15), (0, 1.6)])
def test_with_all_valleys_the_lower_speed_that_a_refusal_states_is_planned(seed, share, arm, space):
    nodes = drawn(seed)
    fastest = fastest_speed(nodes, arm, refine=True, **space)
    speed = share * fastest.speed
    with pytest.raises(NoFeasiblePath) as caught:
        plan(nodes, arm, speed=speed, **space)
    none = caught.value
    needed = none.relaxation.speed * share
    assert needed == pytest.approx(1, rel=2e-3) if share < 1.1 else needed <= 1 + 1e-9
    assert errors(plan(nodes, arm, speed=none.relaxation.speed * speed, **space)) == []
    if none.closed is not None:  # an independent search, from other samples, is no quicker
        other = fastest_speed(nodes, arm, refine=True, **space | {"gamma_step": np.radians(5)})
        assert other.speed < speed


@pytest.mark.slow
@pytest.mark.usefixtures("explored")
def test_an_interval_that_is_wanted_ends_the_search_and_changes_nothing_before(
    arm, tool, placement, monkeypatch
):
    """So that a plan at the speed of a motion found finds that motion, too."""
    posed = task(drawn(0), arm, tool, placement)

    def found(**wanted):
        return [each.dt for each in quick_motions(posed, CollisionFreeSearch(posed), **wanted)]

    for many in (1, 1000):
        monkeypatch.setattr(quickest_module, "MANY", many)
        every, before = found(), 0
        for share in (0.7, 0.85, 0.93, 0.97, 1.01):
            some = found(wanted=share * every[-1])
            assert some == every[: len(some)]
            assert len(some) >= max(before, 2)
            before = len(some)
        assert some == every


@pytest.mark.parametrize("seed", range(3))
def test_of_a_hopeless_speed_a_motion_is_found_without_the_exact_search(
    seed, arm, space, monkeypatch, change_effort
):
    nodes = drawn(seed)
    fastest = fastest_speed(nodes, arm, refine=True, **space)

    def no_search(problem):
        raise AssertionError("the exact search may take minutes here")

    monkeypatch.setattr(quickest_module, "find_least_interval", no_search)
    change_effort(exact_edges=0)
    with pytest.raises(NoFeasiblePath) as caught:
        plan(nodes, arm, speed=20 * fastest.speed, **space)
    needed = caught.value.relaxation.speed * 20
    # It keeps the limits, so that it is no quicker than the quickest; how near it comes is luck.
    assert 0.3 < needed < 1.001
    assert errors(plan(nodes, arm, speed=needed * fastest.speed, **space)) == []


def test_far_above_the_fastest_speed_no_refinement_is_tried(arm, space):
    """A proof about a few nodes takes less time than refinements that cannot end in the limits."""
    nodes, speed, phases = drawn(0, nodes=41), 0.4, []
    arm = arm.with_limits(acceleration=arm.speed_limits()[1] / 50)  # velocities do not matter
    with pytest.raises(NoFeasiblePath) as caught:
        plan(nodes, arm, speed=speed, phase=phases.append, **space)
    none = caught.value
    assert phases == ["search"]
    assert none.proved
    assert none.scope == "every gamma"
    assert none.node == none.closed.node
    assert 0 < none.relaxation.speed < 0.5
    made = plan(nodes, arm, speed=none.relaxation.speed * speed, **space)
    assert errors(made) == []


@pytest.mark.parametrize("kind", ["rail", "positioner"])
def test_with_an_external_axis_motions_grow_quicker_too(kind, arm, tool, placement):
    limits = {"lower": -1.0, "upper": 1.0, "velocity": 2.0, "acceleration": 4.0, "step": 0.25}
    if kind == "rail":
        robot = arm.on_rail([0, 2, 0], **limits)
    else:
        robot = arm.with_positioner([0, 0, 1], [1.2, 0, 0], **limits)
    posed = task(drawn(0, nodes=11), robot, tool, placement)
    found = list(quick_motions(posed, CollisionFreeSearch(posed)))
    # What the fastest path on the grid is quickened to, its axis with it, may be the last.
    assert found[-1].dt <= found[1].dt < found[0].dt
    for motion in found[1:]:
        assert np.abs(motion.plan.velocity_share).max() <= 1
        assert np.abs(motion.plan.acceleration_share).max() <= 1
        assert errors(motion.plan) == []


def test_what_stays_out_of_a_range_is_not_quickened(arm, space):
    """A joint that no gamma brings back into its range; without a limit there, it is quickened."""
    made = plan(drawn(0), arm, speed=0.2, **space)
    assert refiner.quicken(made) is not None
    upper = arm.upper.copy()
    upper[1] = made.q[:, 1].min() - 1.0
    assert refiner.quicken(replace(made, robot=arm.with_limits(upper=upper))) is None


def test_what_is_out_of_reach_is_not_quickened(arm, space):
    made = plan(drawn(0), arm, speed=0.2, **space)
    away = made.T_base_part.copy()
    away[0, 3] += 10.0
    assert refiner.quicken(replace(made, T_base_part=away)) is None


def test_a_node_out_of_reach_has_no_pose_at_any_gamma(arm, space):
    points = np.array([[0.0, 0.0, 0.0], [4.5, 0.0, 0.0], [9.0, 0.0, 0.0]])
    line = Contour(points, np.tile([0.0, 0.0, -1.0], (3, 1)), closed=False)
    with pytest.raises(NoFeasiblePath, match="rotation: node 1 has no pose within") as caught:
        plan(line, arm, speed=0.1, **space)
    none = caught.value
    assert none.scope == "every gamma"
    assert (none.closed.node, none.closed.joint, none.closed.limit) == (0, None, "pose")
    assert none.node == 0


def test_a_node_whose_poses_lie_between_the_samples_has_some_off_the_grid(arm, space):
    nodes = drawn(0)
    made = plan(nodes, arm, speed=0.05, **space | {"gamma_step": np.radians(2)})
    # Only what is about that motion, and no sample of a quarter turn is.
    room = np.radians(0.1)
    narrow = arm.with_limits(
        lower=made.q.min(axis=0) - room, upper=made.q.max(axis=0) + room, endless=[0] * 6
    )
    with pytest.raises(NoFeasiblePath, match="no admissible pose at node") as caught:
        plan(nodes, narrow, speed=0.05, **space | {"gamma_step": np.radians(90)})
    assert caught.value.scope == "grid"
    assert caught.value.closed is None
    assert "whether it has one off the grid is undecided" in str(caught.value)


def test_what_is_asked_for_stays_in_the_plan_that_a_quick_motion_leads_to(arm, space):
    nodes = drawn(2)
    fastest = fastest_speed(nodes, arm, refine=True, **space)
    options = PlanOptions(metric="euclid", gamma_step=STEP)
    at = {"tool": space["tool"], "placement": space["placement"], "speed": fastest.speed}
    made = plan(nodes, arm, options=options, **at)
    assert made.settings.metric == "euclid"
    assert made.dt == pytest.approx(np.diff(nodes.s).max() / fastest.speed)
    asked = made.settings
    # Rounding: the cost is summed over the unwrapped motion.
    assert made.cost == pytest.approx(
        path_cost(made.increments, asked.weights, "euclid", "sum"), rel=1e-9
    )


@pytest.mark.slow
def test_a_speed_that_is_enough_ends_the_search(arm, space, quickest_at_work):
    nodes = drawn(1)
    fastest = fastest_speed(nodes, arm, refine=True, **space)
    assert fastest.on_grid is not None
    middle = (fastest.on_grid + fastest.speed) / 2
    for enough in (fastest.on_grid, middle, 2 * fastest.speed):
        found = fastest_speed(nodes, arm, refine=True, enough=enough, **space)
        assert min(enough, fastest.speed) <= found.speed <= fastest.speed
    with pytest.raises(InputError, match=r"enough: expected .*, got 0"):
        fastest_speed(nodes, arm, refine=True, enough=0.0, **space)


def test_the_phases_say_early_at_which_speed_there_is_a_motion(arm, space):
    nodes, phases = drawn(0, nodes=41), []
    fastest = fastest_speed(nodes, arm, refine=True, explore=False, **space)
    with suppress(NoFeasiblePath):
        plan(nodes, arm, speed=1.15 * fastest.speed, phase=phases.append, **space)
    said = [float(found[1]) / 60 for p in phases if (found := re.search(r"([\d.]+) m/min", p))]
    assert said
    # A path that a refinement begins from: slower than asked for, but not by far.
    assert 0.5 * fastest.speed < said[0] < 1.15 * fastest.speed
    assert errors(plan(nodes, arm, speed=said[0], **space)) == []
