"""Exploration of all valleys: the courses it begins with, and motions that only it finds."""

import numpy as np
import pytest

from kerfpath import Certify, Tilt, audit, plan
from kerfpath.contour import Contour
from kerfpath.options import PlanOptions
from kerfpath.planner.exploration import can_explore, ramps, smoothed, varied, waves
from kerfpath.planner.task import planning_task
from kerfpath.plans import path_cost
from kerfpath.search import Course
from kerfpath.setup import Setup


def course(posture):
    K = len(posture)
    return Course(np.linspace(0, 1, K) ** 2, np.zeros((K, 6)), np.array(posture))


def test_a_course_in_one_posture_is_also_smoothed():
    own, smooth = varied(course([1] * 20))
    np.testing.assert_array_equal(own.gamma, course([1] * 20).gamma)
    np.testing.assert_array_equal(smooth.posture, own.posture)
    assert np.abs(np.diff(smooth.gamma, 2)).max() <= np.abs(np.diff(own.gamma, 2)).max() + 1e-12


def test_a_change_of_posture_also_comes_sooner_and_later():
    made = varied(course([0] * 8 + [1] * 8))
    changes = {tuple(np.flatnonzero(np.diff(each.posture))) for each in made}
    assert changes == {(5,), (6,), (7,), (8,), (9,)}
    assert all(each.posture[0] == 0 and each.posture[-1] == 1 for each in made)


def test_changes_at_the_ends_stay_inside():
    made = varied(course([0] + [1] * 9))
    assert all(len(np.flatnonzero(np.diff(each.posture))) == 1 for each in made)


def test_a_course_with_many_changes_of_posture_stays_as_it_is():
    assert len(varied(course([0, 1, 0, 1, 0, 1]))) == 1


@pytest.mark.parametrize("width", [1, 2, 5])
def test_smoothing_leaves_a_straight_course_and_its_ends(width):
    straight = np.linspace(-1, 3, 20)
    np.testing.assert_allclose(smoothed(straight, width), straight, atol=1e-12)
    bent = straight**2
    assert smoothed(bent, width)[[0, -1]] == pytest.approx(bent[[0, -1]], abs=1e-12)


def test_changes_are_as_large_as_they_are_said_to_be():
    rng = np.random.default_rng(2)
    slow = waves(rng, 50, 7, 0.4)
    np.testing.assert_allclose(np.abs(slow).max(axis=1), 0.4)
    steps = ramps(rng, 50, 7, 0.4)
    assert steps.shape == (7, 50)
    assert (np.abs(steps) <= 0.4).all()
    assert (np.abs(np.diff(np.sign(np.diff(steps, axis=1)), axis=1)) == 0).all()  # monotone
    assert len(waves(rng, 50, 0, 0.4)) == 0


def test_tilts_and_free_joints_are_not_explored(circle, arm, tool, placement):
    def task(robot, **options):
        return planning_task(circle, Setup.of(robot, tool, placement), PlanOptions(**options),
                             speed=0.1)  # fmt: skip

    assert can_explore(task(arm))
    assert not can_explore(task(arm, tilt=Tilt(cone=0.1, steps=1)))
    rail = arm.on_rail([1, 0, 0], lower=-0.5, upper=0.5, velocity=1.0, acceleration=2.0)
    assert not can_explore(task(rail))


def known_motion(arm, tool, nodes):
    """A contour, and a motion along it that passes the singularity of the wrist straight."""
    dt = 0.01
    t = (np.arange(nodes) - (nodes - 1) / 2) * dt
    rate = np.radians([8.0, -5.0, 6.0, 0.0, 80.0, 0.0])
    q = np.array([0.1, 0.2, 0.3, 0.4, 0.0, 0.5]) + t[:, None] * rate
    tip = arm.forward(q) @ tool
    return Contour(tip[:, :3, 3], tip[:, :3, 2], time=np.arange(nodes) * dt), q


@pytest.mark.slow
def test_a_motion_straight_through_a_singularity_is_found(arm, tool):
    """Without the exploration the plan costs 2.6 % more than this motion, with either wrist."""
    contour, q = known_motion(arm, tool, 32)
    made = plan(contour, arm, tool=tool, placement=np.eye(4), certify=Certify())
    s = made.settings
    known = path_cost(np.diff(q, axis=0), s.weights, s.metric, s.objective)
    assert made.cost <= known * (1 + 1e-3)
    assert set(made.posture) == {0, 1}
    assert not [issue for issue in audit(made) if issue.level == "error"]
