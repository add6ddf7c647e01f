"""Exploration of all valleys: the changes that it makes, and the motions that it finds."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kerfpath import Band, Comfort, GammaWindow, Tilt, audit, fastest_speed, plan
from kerfpath.contour import Contour
from kerfpath.effort import changed_effort
from kerfpath.options import PlanOptions
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.courses import Courses, can_explore, ramps, smoothed, varied, waves
from kerfpath.planner.exploration import AGAIN, REFINED, REFINED_AGAIN, Exploration
from kerfpath.planner.starts import Starts
from kerfpath.planner.task import planning_task
from kerfpath.plans import path_cost
from kerfpath.search import Course
from kerfpath.setup import Setup

pytestmark = pytest.mark.usefixtures("explored")

SAME = 1e-3
"""Relative: refinements stop where the model promises less than 1e-4 a step, from either side."""


@pytest.mark.parametrize("width", [1, 2, 5])
def test_smoothing_leaves_a_straight_course_and_its_ends(width):
    straight = np.linspace(-1, 3, 20)
    np.testing.assert_allclose(smoothed(straight, width), straight, atol=1e-12)
    bent = straight**2
    assert smoothed(bent, width)[[0, -1]] == pytest.approx(bent[[0, -1]], abs=1e-12)


def course(posture):
    K = len(posture)
    return Course(np.linspace(0, 1, K) ** 2, np.zeros((K, 6)), np.array(posture))


def test_a_course_in_one_posture_is_also_smoothed():
    own, smooth = varied(course([1] * 20))
    np.testing.assert_array_equal(own.gamma, course([1] * 20).gamma)
    np.testing.assert_array_equal(smooth.posture, own.posture)
    assert np.abs(np.diff(smooth.gamma, 2)).max() <= np.abs(np.diff(own.gamma, 2)).max() + 1e-12


@pytest.mark.parametrize(
    ("posture", "changes"),
    [
        ([0] * 8 + [1] * 8, {(5,), (6,), (7,), (8,), (9,)}),
        ([0] + [1] * 9, {(0,), (1,), (2,)}),  # not before the first node
        ([0] * 4 + [1] * 3 + [0] * 4, {(k, k + 3) for k in (1, 2, 3, 4, 5)}),
        ([0, 1, 0, 1, 0, 1], {(0, 1, 2, 3, 4)}),  # many changes stay where they are
    ],
)
def test_a_change_of_posture_also_comes_sooner_and_later(posture, changes):
    made = varied(course(posture))
    assert {tuple(np.flatnonzero(np.diff(each.posture))) for each in made} == changes
    assert all(each.posture[0] == posture[0] for each in made)
    assert all(each.posture[-1] == posture[-1] for each in made)


def test_changes_are_as_large_as_they_are_said_to_be():
    rng = np.random.default_rng(2)
    slow = waves(rng, 50, 7, 0.4)
    np.testing.assert_allclose(np.abs(slow).max(axis=1), 0.4)
    steps = ramps(rng, 50, 7, 0.4)
    assert steps.shape == (7, 50)
    assert (np.abs(steps) <= 0.4).all()
    assert (np.abs(np.diff(np.sign(np.diff(steps, axis=1)), axis=1)) == 0).all()  # monotone
    assert len(waves(rng, 50, 0, 0.4)) == 0


def test_tilts_free_joints_and_very_many_nodes_are_not_explored(
    circle, arm, tool, placement, change_effort
):
    def task(robot, **options):
        return planning_task(circle, Setup.of(robot, tool, placement), PlanOptions(**options),
                             speed=0.1)  # fmt: skip

    assert can_explore(task(arm))
    assert not can_explore(task(arm, tilt=Tilt(cone=0.1, steps=1)))
    rail = arm.on_rail([1, 0, 0], lower=-0.5, upper=0.5, velocity=1.0, acceleration=2.0)
    assert not can_explore(task(rail))
    change_effort(subsampled_from=len(circle) - 1)
    assert not can_explore(task(arm))


@pytest.mark.parametrize(
    "options",
    [
        {"objective": "max"},
        {"metric": "euclid"},
        {"metric": "chebychev"},
        {"closure": "periodic"},
        {"comfort": Comfort(wrist=Band(margin=0.2, width=0.5, cost=0.2))},
        {"postures": (1,)},
    ],
    ids=str,
)
def test_a_plan_that_is_explored_costs_no_more(circle, arm, tool, placement, options):
    nodes = circle.resample(count=31)
    where = {"tool": tool, "placement": placement, "speed": 0.45, "gamma_step": np.radians(5)}
    made = plan(nodes, arm, **where, **options)
    with changed_effort(explored=False):
        before = plan(nodes, arm, **where, **options)
    assert made.cost <= before.cost * (1 + SAME)
    assert not [issue for issue in audit(made) if issue.level == "error"]
    assert "postures" not in options or set(made.posture) == {1}


@pytest.mark.slow
@pytest.mark.parametrize("away", [1.0, 2.0, -1.5])
def test_the_valley_of_the_best_motion_is_found_from_another(circle, arm, tool, placement, away):
    """From the best motion with gamma at least 0.8 rad from where it is best at the start."""
    nodes = circle.resample(count=41)
    where = {"tool": tool, "placement": placement, "speed": 0.1}
    best = plan(nodes, arm, **where)
    middle = best.gamma[0] + away
    start = nodes.s[0]
    window = GammaWindow(start=start, end=start, low=middle - 0.2, high=middle + 0.2)
    poor = plan(nodes, arm, gamma_windows=[window], **where)
    assert poor.cost > best.cost * 1.01
    task = planning_task(nodes, Setup.of(arm, tool, placement), PlanOptions(), speed=0.1).whole()
    starts = Starts(task, CollisionFreeSearch(task))
    starts.start_from(replace(poor, settings=best.settings), poor.cost)
    assert starts.best.cost_after == pytest.approx(poor.cost)
    Exploration(task, starts).run()
    assert starts.explored
    assert starts.best.cost_after <= best.cost * (1 + SAME)
    assert not [issue for issue in audit(starts.best.plan) if issue.level == "error"]


@pytest.mark.parametrize(("share", "most"), [(1.0, AGAIN), (1.01, REFINED + REFINED_AGAIN)])
def test_an_exploration_ends_where_the_best_motion_is_found_again(
    circle, arm, tool, placement, monkeypatch, share, most
):
    """It goes on where refinements end elsewhere: to the first changes at random, not further."""
    nodes = circle.resample(count=21)
    options = PlanOptions(gamma_step=np.radians(10))
    task = planning_task(nodes, Setup.of(arm, tool, placement), options, speed=0.15)
    starts, ends = Starts(task, CollisionFreeSearch(task)), []
    made = plan(nodes, arm, tool=tool, placement=placement, speed=0.15, gamma_step=np.radians(10))
    starts.start_from(made, 0.0)

    def refined(course, score):
        ends.append(score)
        return share * starts.best.cost_after

    monkeypatch.setattr(starts, "refine_course", refined)
    Exploration(task, starts).run()
    assert AGAIN <= len(ends) <= most
    assert (len(ends) == AGAIN) == (share == 1.0)


def test_motions_of_one_posture_do_not_use_up_the_refinements_of_others(
    circle, arm, tool, placement, monkeypatch
):
    """Near the fastest speed all motions of the most promising posture may break the limits."""
    nodes = circle.resample(count=21)
    task = planning_task(nodes, Setup.of(arm, tool, placement), PlanOptions(), speed=0.45).whole()
    starts, tried = Starts(task, CollisionFreeSearch(task)), []
    made = plan(nodes, arm, tool=tool, placement=placement, speed=0.45, certify=None)
    starts.start_from(made, 0.0)

    def screened(courses, *_):
        """One course for each posture, the first one many times."""
        alone = {int(c.posture[0]): c for c in courses if not np.ptp(c.posture)}
        first, *others = alone.values()
        many = [first._replace(gamma=first.gamma + 0.1 * i) for i in range(3 * REFINED)]
        return [(starts.best.cost_after, course) for course in (*many, *others)]

    def refined(course, _):
        tried.append(int(course.posture[0]))
        return np.inf

    monkeypatch.setattr(Courses, "screened", lambda _, *given: screened(*given))
    monkeypatch.setattr(starts, "refine_course", refined)
    Exploration(task, starts).run()
    assert tried.count(tried[0]) == REFINED + REFINED_AGAIN
    # Of two that differ in the pose of the wrist alone one is enough.
    assert {posture // 2 for posture in tried} == {*range(arm.postures // 2)}


@pytest.fixture
def passage(arm, tool):
    """A contour, and joints along it that pass the singularity of the wrist straight."""
    nodes, dt = 32, 0.01
    t = (np.arange(nodes) - (nodes - 1) / 2) * dt
    rate = np.radians([8.0, -5.0, 6.0, 0.0, 80.0, 0.0])
    q = np.array([0.1, 0.2, 0.3, 0.4, 0.0, 0.5]) + t[:, None] * rate
    tip = arm.forward(q) @ tool
    return Contour(tip[:, :3, 3], tip[:, :3, 2], time=np.arange(nodes) * dt), q


@pytest.mark.slow
def test_a_motion_straight_through_a_singularity_is_found_if_joints_move_evenly(passage, arm, tool):
    """No motion in one posture costs less than 1.02 times as much."""
    contour, q = passage
    task = {"tool": tool, "placement": np.eye(4)}
    made = plan(contour, arm, **task)
    s = made.settings
    known = path_cost(np.diff(q, axis=0), s.weights, s.metric, s.objective)
    assert made.cost <= known * (1 + SAME)
    assert set(made.posture) == {0, 1}
    assert not [each for each in audit(made, interpolation="joint") if each.level == "error"]
    straight = plan(contour, arm, interpolation="linear", **task)
    assert not np.ptp(straight.posture)
    assert straight.cost > 1.02 * known
    assert not [each for each in audit(straight) if each.level == "error"]


@pytest.mark.slow
def test_the_fastest_speed_passes_a_singularity_only_if_joints_move_evenly(arm):
    """Along this contour it is 1.18 times as fast then, and 1.21 times with all the effort."""
    rng = np.random.default_rng(0)
    nodes = 32
    t = (np.arange(nodes) - (nodes - 1) / 2 + rng.uniform(-0.5, 0.5)) * 0.01
    rate = [*rng.uniform(-30, 30, 3), 0.0, rng.uniform(20, 90), rng.uniform(-30, 30)]
    middle = [*rng.uniform(-0.4, 0.4, 3), rng.uniform(-2, 2), 0.0, rng.uniform(-2, 2)]
    tool = np.eye(4)
    tool[:3, :3] = Rotation.from_euler("y", rng.uniform(0.2, 1.2)).as_matrix()
    tool[:3, 3] = [0.15, 0.0, 0.3]
    tip = arm.forward(np.array(middle) + t[:, None] * np.radians(rate)) @ tool
    contour = Contour(tip[:, :3, 3], tip[:, :3, 2], time=np.arange(nodes) * 0.01)
    task = {"tool": tool, "placement": np.eye(4), "refine": True}
    even, straight = (
        fastest_speed(contour, arm, interpolation=moves, **task).speed
        for moves in ("joint", "linear")
    )
    assert even > 1.15 * straight


def test_what_is_followed_and_dropped_is_counted(circle, arm, tool, placement, change_effort):
    nodes = circle.resample(count=31)
    where = {"tool": tool, "placement": placement, "speed": 0.45, "certify": None}
    cheapest = plan(nodes, arm, **where).proof.explored
    change_effort(worth_exploring=-1.0)
    told = plan(nodes, arm, **where).proof.explored
    assert told.all_valleys
    assert sum(told.valleys.values()) >= sum(cheapest.valleys.values()) > 0
    assert {*told.valleys} <= {*map(str, range(arm.postures)), "several"}
    assert told.screened > told.refined > 0
    assert min(told.dearer, told.alike, told.left) >= 0
    # What is screened is dropped, refined, or among those that are not refined.
    kept = told.screened - told.dropped
    assert 0 < kept <= told.refined + told.dearer + told.alike + told.left
    assert told.unfollowed == 0
    assert told.words.startswith("all valleys followed (")
    assert f"{told.refined} motions refined" in told.words
    one = plan(nodes, arm, postures=(1,), **where).proof.explored
    assert set(one.valleys) == {"1"}
