"""Pareto sets of robots with external axes: along courses on the grid, and off them."""

from dataclasses import replace

import numpy as np
import pytest

from conftest import pose
from kerfpath import Contour, NoFeasiblePath, PlanOptions, audit, pareto, plan
from kerfpath.front import ParetoProblem, criteria_named, graph_of_runs, plan_run
from kerfpath.setup import Setup

TRAVEL = {"lower": -0.6, "upper": 0.6, "velocity": 1.0, "acceleration": 2.0}
CENTRE = pose([1.3, 0.0, 0.5])
STEP = np.radians(12)


@pytest.fixture(scope="module")
def line():
    """A straight cut along the rail, which arm and rail can share between them."""
    y = np.linspace(-0.4, 0.4, 13)
    return Contour(np.c_[0 * y, y, 0 * y], np.tile([0, 0, -1.0], (13, 1)), name="line")


@pytest.fixture(scope="module")
def railed(arm):
    return arm.on_rail([0, 1, 0], **TRAVEL)


@pytest.fixture(scope="module")
def options(tool):
    return {"tool": tool, "placement": CENTRE, "speed": 0.2, "postures": (0,), "gamma_step": STEP}


@pytest.fixture(scope="module")
def problem(line, railed, options):
    """The problem as `pareto` poses it."""
    asked = PlanOptions(gamma_step=STEP, postures=(0,))
    setup = Setup.of(railed, options["tool"], CENTRE)
    named = criteria_named(("displacement", "range"), railed, options=asked, cell=None, home=None)
    graph = graph_of_runs(line, setup, asked, speed=0.2)
    return ParetoProblem(
        contour=line, setup=setup, speed=0.2, options=asked, criteria=named, graph=graph
    )


def test_no_plan_of_a_set_is_beaten_and_each_passes_the_audit(line, railed, options):
    found = pareto(line, railed, criteria=("displacement_7", "range_1"), runs=14, **options)
    assert len(found.plans) > 2
    losses = found.values * found.sense
    as_good = (losses[:, None] <= losses).all(axis=2) & (losses[:, None] < losses).any(axis=2)
    assert not as_good.any()
    for made in found.plans:
        assert audit(made, path_tolerance=1e-3) == []
    # The axis does the work where joint 1 has to rest, and rests where its own way counts.
    calm, still = found.best("range_1"), found.best("displacement_7")
    assert np.ptp(calm.external) > 0.1 + np.ptp(still.external)


def test_on_the_grid_runs_follow_the_course_of_the_best_plan(problem, line, railed, options):
    best = plan(line, railed, **options)
    arm = railed.family.joints
    sizes = np.diff(problem.graph.start)
    first = problem.graph.q[problem.graph.variant == 0, arm:]
    assert {tuple(x) for x in best.external} == {tuple(x) for x in first}
    made = problem.solve(problem.unbounded, first=True)
    assert made.proof.optimal
    # Its course may be the best one or another of those found, node by node.
    for k, x in enumerate(made.external):
        layer = slice(problem.graph.start[k], problem.graph.start[k] + sizes[k])
        assert (problem.graph.q[layer, arm:] == x).all(axis=1).any()
    # The refined plan has gamma off the grid as well: the best path on it costs no less, but for
    # the 1e-4 to which a plan is refined.
    assert made.cost >= best.cost * (1 - 1e-4)


def test_a_run_whose_window_leaves_the_courses_looks_for_one_within_it(problem, line, options):
    window = problem.unbounded.window.copy()
    course = problem.graph.q[:, 6]
    low = 0.3 if course.max() < 0.3 else -0.5
    assert not ((course > low) & (course < low + 0.2)).any()
    window[6] = low, low + 0.2
    run = replace(problem.unbounded, window=window, continuous=True)
    asked = line, problem.setup, problem.options
    made = plan_run(run, *asked, speed=0.2, graph=problem.graph)
    assert low <= made.external.min() <= made.external.max() <= low + 0.2
    assert made.robot is problem.robot
    assert audit(made, path_tolerance=1e-3) == []
    on_grid = replace(run, continuous=False)
    with pytest.raises(NoFeasiblePath):
        plan_run(on_grid, *asked, speed=0.2, graph=problem.graph)
    assert problem.solve(on_grid) == "no pose in the window of joint 7"


def test_windows_for_the_range_of_all_joints_leave_the_courses_alone(problem):
    made = problem.solve(problem.unbounded, first=True)
    known = problem.evaluate(made)
    from kerfpath.front.problem import Gap, Solution

    worse = Solution(losses=known.losses, course=known.course, number=0, run=problem.unbounded)
    criterion = problem.criteria[1]
    gap = Gap(criterion=1, better=None, worse=worse)
    value, spans = 0.8 * known.losses[1], np.ptp(known.spans, axis=1)
    run = criterion.bound(problem.unbounded, value, gap, problem, np.random.default_rng(0))
    width = np.ptp(run.window, axis=1)
    velocity = problem.robot.velocity
    # Windows are wider by 1e-8 on both sides.
    assert (width / velocity).sum() == pytest.approx(value, rel=1e-6)
    assert width[6] == pytest.approx(spans[6], abs=3e-8)
    assert (width[:6] <= spans[:6] + 3e-8).all()


def test_an_axis_without_travel_is_none(arm, line, options):
    """The first runs, which draw nothing at random, have the values of the arm alone."""
    still = arm.on_rail([0, 1, 0], **TRAVEL | {"lower": 0.0, "upper": 0.0})
    short = line.part(3, 9, "rotation-minimising")
    names = {"criteria": ("displacement", "velocity"), "runs": 2}
    alone = pareto(short, arm, **names, **options, method="exact")
    with_axis = pareto(short, still, **names, **options)
    assert not any(run.continuous for run in with_axis.runs)
    np.testing.assert_allclose(with_axis.values, alone.values, rtol=1e-12)
