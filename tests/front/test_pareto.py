"""The Pareto set: its laws, the front of a task small enough to enumerate, bad input."""

import itertools
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from conftest import ROOT
from kerfpath import (
    Contour,
    InputError,
    NoFeasiblePath,
    PlanOptions,
    audit,
    fastest_speed,
    pareto,
    plan,
)
from kerfpath.cell import Mesh, box_between, cell_of
from kerfpath.comfort import MEASURES, Band, Comfort
from kerfpath.front import (
    CRITERIA,
    JOINT_CRITERIA,
    Criterion,
    ParetoProblem,
    Subproblem,
    criteria_named,
    hypervolume,
    plan_run,
)
from kerfpath.front.problem import Solution, grid
from kerfpath.planner import layered_graph
from kerfpath.search import Course
from kerfpath.setup import Setup
from kerfpath.transfer import least_time

STEP = np.radians(8)
NAMES = ("displacement", "velocity", "range_6", "acceleration")


@pytest.fixture(scope="module")
def task(arm, tool, placement):
    """A gentle arc that leaves gamma much to choose, on the two front postures."""
    t = np.linspace(-0.5, 0.5, 2001)
    points = np.c_[0.2 * np.cos(2 * t), 0.3 * t, 0.05 * t]
    axes = np.c_[0.3 * t, -0.4 * t, -np.ones_like(t)]
    arc = Contour(points, axes, name="arc").resample(count=31)
    where = {"tool": tool, "placement": placement, "gamma_step": STEP, "postures": (0, 1)}
    graph = layered_graph(arc, arm, **where)
    task = {"contour": arc, "robot": arm, "speed": 0.05, "graph": graph, **where}
    return task | {"method": "exact"}


@pytest.fixture(scope="module")
def found(task):
    return pareto(**task, criteria=NAMES, runs=80)


def dominated(values):
    """(P, P): plan i is dominated by plan j."""
    return (values <= values[:, None]).all(-1) & (values < values[:, None]).any(-1)


def test_no_plan_of_the_set_dominates_another(found):
    assert len(found.plans) > 3
    assert not dominated(found.values).any()
    assert len(np.unique(found.values, axis=0)) == len(found.plans)


def test_the_values_are_those_of_the_plans(found):
    velocity, _ = found.plans[0].robot.speed_limits()
    for made, values in zip(found.plans, found.values, strict=True):
        dq = made.increments
        at = np.vstack([np.zeros(6), np.cumsum(dq, axis=0)])
        # The same numbers added up in another order.
        np.testing.assert_allclose(
            values,
            [
                (np.abs(dq).sum(0) / velocity).sum(),
                np.abs(made.velocity_share).max(),
                np.ptp(at, axis=0)[5],
                np.abs(made.acceleration_share).max(),
            ],
            rtol=1e-11,  # 12 digits count
        )


def test_every_plan_passes_its_audit_and_every_run_is_accounted_for(found):
    assert all(audit(made) == [] for made in found.plans)
    assert found.tried == 80
    assert found.feasible + sum(found.failures.values()) == 80
    assert "80" in str(found)


def test_plans_keep_what_their_runs_were_asked_for(found):
    kept = 0
    for made, run in zip(found.plans, found.runs, strict=True):
        assert made.settings.objective == run.objective
        assert np.abs(made.velocity_share).max() <= run.eta_v * (1 + 1e-6)
        assert np.abs(made.acceleration_share).max() <= run.eta_a * (1 + 1e-6)
        low = np.where(np.isfinite(run.window[:, 0]), run.window[:, 0], 0.0)
        above = made.q - low
        above = np.where(made.robot.endless, above % (2 * np.pi), above)
        inside = (above >= 0) & (above <= np.diff(run.window)[:, 0])
        finite = np.isfinite(run.window).all(axis=1)
        assert inside[:, finite].all()
        kept += finite.sum()
    assert kept > 0


def test_more_runs_never_lower_the_hypervolume_and_keep_what_is_good(task, found):
    before = 0.0
    for runs in (8, 20, 41):
        fewer = pareto(**task, criteria=NAMES, runs=runs)
        np.testing.assert_array_equal(fewer.reference, found.reference)
        assert fewer.hypervolume >= before
        before = fewer.hypervolume
        assert found.coverage(fewer) == 1.0
    assert found.hypervolume > before


@pytest.mark.parametrize(
    "criterion", ["displacement", "displacement_4", "increment_6", "velocity", "acceleration"]
)
def test_the_plan_of_one_criterion_alone_is_as_good_in_it_as_any_other(task, criterion):
    names = (*(c for c in NAMES if c != criterion), criterion)
    alone = pareto(**task, criteria=[criterion], runs=3)
    many = pareto(**task, criteria=names, runs=30)
    assert len(alone.plans) == 1
    # Other joints weigh a millionth, and decide between equals.
    assert alone.values[0, 0] <= many.values[:, -1].min() * (1 + 1e-4)
    best = many.best(criterion)
    assert many.plans[int(many.values[:, -1].argmin())] is best


def test_the_first_plan_is_that_of_the_planner(task, found):
    usual = plan(**task)
    assert found.values[0, 0] == pytest.approx(usual.cost * usual.dt, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("search", ["adaptive", "grid"])
def test_a_seed_says_it_all_whatever_the_workers(task, search):
    options = task | {"runs": 14, "search": search, "seed": 3}
    one, two = pareto(**options, workers=1), pareto(**options, workers=3)
    assert one.failures == two.failures
    for a, b in zip(one.plans, two.plans, strict=True):
        np.testing.assert_array_equal(a.q, b.q)


def test_where_there_is_one_criterion_more_runs_change_nothing(task):
    several = pareto(**task, criteria=["displacement"], runs=20)
    assert several.feasible == 20
    assert len(several.plans) == 1


def test_reversals_are_those_of_joints_1_to_3_one_by_one(task):
    found = pareto(**task, criteria=["displacement", "reversals"], runs=20)
    values = found.values[:, found.criteria.index("reversals")]
    counts = set()
    for made, value in zip(found.plans, values, strict=True):
        turned = 0
        for joint in range(3):
            ways = [way for way in made.increments[:, joint] / made.dt if abs(way) > 1e-4]
            turned += sum(a * b < 0 for a, b in itertools.pairwise(ways))
        assert value == turned == made.criteria.reversals.sum()
        counts.add(turned)
    assert len(counts) > 1
    usual = plan(**task).criteria.reversals.sum()
    assert min(counts) < usual


def test_one_run_alone_has_its_plan(task):
    only = pareto(**task, criteria=["displacement", "acceleration"], runs=1)
    assert only.numbers == (0,)
    assert only.hypervolume == pytest.approx(1.0)


def test_progress_is_told_run_by_run(task):
    told = []
    pareto(**task, criteria=["displacement"], runs=11, progress=told.append)
    assert sum(told) == 11
    assert len(told) > 2


@pytest.mark.slow
def test_a_closed_contour_may_end_as_it_began(circle, arm, tool, placement):
    where = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": STEP}
    options = where | {"criteria": ("displacement", "range_6"), "runs": 16, "postures": (0,)}
    made = pareto(circle, arm, closure="periodic", **options)
    assert any(run.continuous for run in made.runs)
    assert made.feasible > 4
    for closed in made.plans:
        turned = (closed.q[-1] - closed.q[0]) % (2 * np.pi)
        # Frames of the two ends agree to rounding.
        assert np.minimum(turned, 2 * np.pi - turned).max() < 1e-6


@pytest.fixture(scope="module")
def few(circle, arm, tool, placement):
    """Six nodes of a circle with a few vertices each: all paths can be walked."""
    where = {"tool": tool, "placement": placement}
    contour = circle.resample(count=6)
    graph = layered_graph(contour, arm, gamma_step=np.radians(52), postures=(0,), **where)
    assert 50_000 < np.prod(np.diff(graph.start)) < 500_000
    few = {"contour": contour, "robot": arm, "speed": 0.6, "graph": graph, **where}
    return few | {"method": "exact"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "criteria",
    [("displacement", "range_3"), ("displacement", "range_6"), ("displacement_4", "range_6")],
)
def test_the_front_of_a_small_task_is_that_of_all_paths(few, criteria):
    front = front_of_all_paths(few, criteria)
    # Enough that one of them has its window at every vertex where a path may turn round.
    made = pareto(**few, criteria=criteria, runs=1200, audit=lambda made: [])
    assert len(front) > 3
    # Rounding, and of one joint the faint weight of the others.
    np.testing.assert_allclose(made.values, front, rtol=1e-5)


@pytest.mark.slow
def test_of_the_range_of_all_joints_nearly_all_is_found(few):
    criteria = ("displacement_1", "range")
    front = np.array(front_of_all_paths(few, criteria))
    made = pareto(**few, criteria=criteria, runs=600, audit=lambda made: [])
    scaled = (front - made.ideal) / (made.reference - made.ideal)
    assert len(front) > 3
    # A box of windows is one of many that hold the same sum: six seeds gave 0.969 to 0.998.
    assert 0.96 * hypervolume(scaled, [1, 1]) <= made.hypervolume <= hypervolume(scaled, [1, 1])


def front_of_all_paths(few, criteria):
    """The slow way: every path, its increments, limits (5) and (6), criteria (7) and (9)."""
    graph, arm = few["graph"], few["robot"]
    velocity, acceleration = arm.speed_limits()
    dt = few["contour"].length / 5 / few["speed"]
    layers = [np.arange(a, b) for a, b in itertools.pairwise(graph.start)]
    q = graph.q[np.stack(np.meshgrid(*layers), axis=-1).reshape(-1, 6)]
    dq = np.diff(q, axis=1)
    dq = np.where(arm.endless, dq - 2 * np.pi * np.round(dq / (2 * np.pi)), dq)
    slow = (np.abs(dq) <= velocity * dt).all(axis=(1, 2))
    slow &= (np.abs(np.diff(dq, axis=1)) <= acceleration * dt**2).all(axis=(1, 2))
    at = np.cumsum(np.pad(dq[slow], ((0, 0), (1, 0), (0, 0))), axis=1)
    each = {"displacement": np.abs(dq[slow]).sum(axis=1), "range": np.ptp(at, axis=1)}
    every = []
    for name in criteria:
        kind, _, joint = name.partition("_")
        every.append(each[kind][:, int(joint) - 1] if joint else (each[kind] / velocity).sum(1))
    front, least = [], np.inf
    for x, y in sorted(np.round(np.stack(every, axis=1), 9).tolist()):
        if y < least:
            front, least = [*front, (x, y)], y
    return front


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_the_hypervolume_is_what_random_points_find(dimension):
    rng = np.random.default_rng(dimension)
    points = rng.uniform(0, 1.2, (8, dimension)) ** 0.5
    sample = rng.uniform(size=(200_000, dimension))
    share = (points[:, None] <= sample).all(-1).any(0).mean()
    # Four standard deviations of a share of 200 000 samples.
    assert hypervolume(points, np.ones(dimension)) == pytest.approx(share, abs=4 * 0.5 / 447)


def test_the_hypervolume_of_boxes_is_their_union():
    assert hypervolume([[0.5, 0.5], [0.2, 0.8], [2.0, 0.0]], [1, 1]) == pytest.approx(0.31)
    assert hypervolume([[2.0, 0.0]], [1, 1]) == 0.0


def test_a_window_of_an_endless_joint_goes_round(task):
    graph, endless = task["graph"], task["robot"].endless
    free = Subproblem.unbounded(np.ones(6), 1.0, 1.0)
    window = free.window.copy()
    window[5] = np.pi - 0.2, np.pi + 0.3
    left = replace(free, window=window).graph(graph, endless).q[:, 5] % (2 * np.pi)
    assert len(left)
    assert (np.abs(left - np.pi - 0.05) <= 0.25).all()
    kept = np.abs(graph.q[:, 5] % (2 * np.pi) - np.pi - 0.05) <= 0.25
    assert kept.sum() == len(left)


def test_the_grid_never_ends_and_never_repeats_itself():
    first = Subproblem.unbounded(np.ones(6), 1.0, 1.0)
    runs = list(itertools.islice(grid(first, np.random.default_rng(0)), 1500))
    kinds = {(r.objective, r.metric, r.eta_v, r.eta_a, *r.weights) for r in runs}
    assert isinstance(runs[0], Subproblem)
    assert len(kinds) == len(runs)


def test_where_nothing_is_feasible_it_says_why_after_one_run(task):
    with pytest.raises(NoFeasiblePath, match="no run can have a plan") as broken:
        pareto(**task | {"speed": 50.0}, runs=50)
    assert broken.value.proved
    assert sum(broken.value.counts.values()) > 0


def test_where_no_plan_passes_its_audit_the_runs_are_counted(task):
    strict = {"audit": lambda made: [replace(audit_issue(), code="never")]}
    with pytest.raises(
        NoFeasiblePath, match="none of 9 runs has a plan; audit: never: 9"
    ) as broken:
        pareto(**task, **strict, runs=9)
    assert broken.value.counts == {"audit: never": 9}


def audit_issue():
    from kerfpath.auditor import Issue

    return Issue(level="error", code="", message="", node=0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"criteria": ["elegance"]}, "got 'elegance'"),
        ({"criteria": ["range_7"]}, "joint J from 1 to 6, got 'range_7'"),
        ({"criteria": []}, "at least one"),
        ({"criteria": "range"}, "expected different names"),
        ({"criteria": ["range", "range"]}, "expected different names"),
        ({"runs": 0}, "runs: expected a whole number, at least 1, got 0"),
        ({"workers": 1.5}, "workers: expected a whole number"),
        ({"ahead": 0}, "ahead: expected a whole number"),
        ({"criteria": ["clearance"]}, "'clearance' needs a cell"),
        ({"criteria": ["time"]}, "'time' needs a home position"),
        ({"search": "luck"}, "search: expected one of adaptive, grid"),
    ],
)
def test_what_it_refuses(task, changes, message):
    with pytest.raises(InputError, match=message):
        pareto(**task | changes)


def test_sets_of_other_criteria_are_not_compared(task, found):
    with pytest.raises(InputError, match="coverage: expected criteria"):
        found.coverage(pareto(**task, runs=2))
    with pytest.raises(InputError, match="best: expected one of"):
        found.best("range_3")


def test_a_margin_is_better_the_more_it_is(task):
    made = pareto(**task, criteria=["displacement", "wrist"], runs=25)
    wrist = made.values[:, 1]
    assert (np.diff(wrist) > 0).all()
    assert made.best("wrist") is made.plans[-1]
    assert made.units == ("s", "rad")
    assert (made.scaled[:, 1] <= 1).all()
    assert made.balanced in made.plans


def test_the_fastest_plan_is_as_fast_as_any_path(task):
    made = pareto(**task, criteria=["displacement", "speed"], runs=20, eta_v=0.9, eta_a=0.8)
    where = {key: task[key] for key in ("tool", "placement", "gamma_step", "graph")}
    fastest = fastest_speed(task["contour"], task["robot"], **where, eta_v=0.9, eta_a=0.8)
    assert made.units == ("s", "m/s")
    # The limits of the run for it are wider by a billionth.
    assert made.values[-1, 1] == pytest.approx(fastest.speed, rel=1e-8)
    assert len(made.plans) > 2
    for slower, speed in zip(made.plans, made.values[:, 1], strict=True):
        quick = replace(slower, time=slower.time * (task["speed"] / speed))
        v, a = quick.criteria.peak_velocity.max(), quick.criteria.peak_acceleration.max()
        assert max(v / 0.9, a / 0.8) == pytest.approx(1, rel=1e-9)


def test_the_time_is_that_from_home_and_back(task):
    home, arm = np.radians([0, -20, 10, 0, 60, 0]), task["robot"]
    made = pareto(**task, criteria=["time", "velocity"], runs=12, home=home)
    for plan_, (time, _) in zip(made.plans, made.values, strict=True):
        ways = np.abs([plan_.q[0] - home, plan_.q[-1] - home])
        ways = np.where(arm.endless, np.minimum(ways % (2 * np.pi), -ways % (2 * np.pi)), ways)
        assert time == pytest.approx(plan_.time[-1] + least_time(ways, *arm.speed_limits()).sum())


@pytest.fixture(scope="module")
def off_grid(task):
    return pareto(**task | {"method": "continuous"}, criteria=NAMES, runs=40)


def test_off_the_grid_no_plan_is_dominated_and_every_one_passes_its_audit(off_grid):
    assert len(off_grid.plans) > 3
    assert not dominated(off_grid.values).any()
    assert all(audit(made) == [] for made in off_grid.plans)
    # What is left to refine of the front follows the runs asked for.
    assert off_grid.feasible + sum(off_grid.failures.values()) == off_grid.tried >= 40


def test_the_front_of_the_grid_is_beaten_off_it(task, off_grid):
    # On steps of 8 deg, no path of the grid is near the best motion.
    assert off_grid.left_behind.all()
    assert "beaten off the grid" in str(off_grid)
    on_grid = pareto(**task, criteria=NAMES, runs=22)
    assert off_grid.coverage(on_grid) == 1.0
    assert not on_grid.left_behind.any()
    assert len(on_grid.on_grid) == len(on_grid.plans)
    assert "beaten" not in str(on_grid)


def test_what_is_beaten_is_what_some_plan_dominates(off_grid):
    pairs = zip(off_grid.on_grid, off_grid.left_behind, strict=True)
    for values, beaten in pairs:
        both = np.vstack([values, off_grid.values])
        assert dominated(both)[0].any() == beaten


def test_plans_over_continuous_gamma_keep_what_their_runs_were_asked_for(off_grid):
    held = 0
    rows = zip(off_grid.plans, off_grid.runs, off_grid.values, strict=True)
    for made, run, values in rows:
        assert run.continuous
        assert made.settings.method == "continuous"
        assert np.abs(made.velocity_share).max() <= run.eta_v * (1 + 1e-6)
        assert np.abs(made.acceleration_share).max() <= run.eta_a * (1 + 1e-6)
        for joint in run.windowed(made.robot.endless):
            # At all nodes, by the true kinematics: the windows are as wide as rounding needs.
            turned = np.cumsum(np.pad(made.increments[:, joint], (1, 0)))
            assert np.ptp(turned) <= np.ptp(run.window[joint]) + 1e-9
            held += 1
        if run.goals:  # one for each criterion, all limits being open to runs
            assert (values <= [goal.most * (1 + 1e-9) for goal in run.goals]).all()
            held += 1
    assert held > 0


def setup_of(task):
    return Setup.of(task["robot"], task["tool"], task["placement"])


def test_a_plan_of_the_grid_is_held_to_in_what_can_be_held(task, found):
    problem = ParetoProblem(
        contour=task["contour"], setup=setup_of(task), speed=task["speed"], options=PlanOptions(),
        graph=task["graph"], criteria=criteria_named(
            ("displacement", "velocity", "range_6"), task["robot"], options=PlanOptions(),
            cell=None, home=None,
        ),
    )  # fmt: skip
    made = found.plans[0]
    known = problem.evaluate(made)
    solution = Solution(losses=known.losses, course=known.course, number=0, run=found.runs[0])
    run = problem.as_good(solution)
    assert (run.objective, run.metric) == ("sum", "manhattan")
    assert run.eta_v == pytest.approx(np.abs(made.velocity_share).max())
    assert run.eta_a == 1.0
    assert run.windowed(made.robot.endless) == [5]
    better = problem.solve(replace(run, continuous=True))
    values = problem.evaluate(better).losses
    # Shares and windows are 1e-8 wider, and the refinement keeps about as much free.
    assert (values <= known.losses + 3e-8).all()
    assert values[0] < known.losses[0]


@pytest.mark.slow
def test_a_plan_of_the_front_refined_from_its_neighbours_is_no_better(task, off_grid):
    """By more than 1 %, where the criteria that can be bounded stay as good."""
    problem = ParetoProblem(
        contour=task["contour"], setup=setup_of(task), speed=task["speed"], options=PlanOptions(),
        graph=task["graph"], criteria=off_grid.axes,
    )  # fmt: skip
    known = [problem.evaluate(made) for made in off_grid.plans]
    refined = 0
    for number, (each, run) in enumerate(zip(known, off_grid.runs, strict=True)):
        solution = Solution(losses=each.losses, course=each.course, number=number, run=run)
        for begin in known[max(number - 1, 0) : number + 2]:
            again = replace(problem.as_good(solution), continuous=True, begin=(begin.course,))
            made = problem.solve(again)
            if isinstance(made, str):
                continue
            refined += 1
            losses = problem.evaluate(made).losses
            improved = (each.losses - losses) / np.abs(each.losses)
            assert improved.min() < -1e-7 or improved.max() < 0.01
            assert begin is not each or improved.min() > -1e-7
    assert refined >= len(known)


def test_a_run_that_begins_with_known_motions_comes_back_from_its_data(off_grid):
    begin = (off_grid.plans[0], off_grid.plans[-1])
    courses = tuple(Course(made.gamma, made.unwrapped, made.posture) for made in begin)
    run = replace(off_grid.runs[0], begin=courses)
    again = Subproblem.from_data(json.loads(json.dumps(run.to_data())))
    assert again.to_data() == run.to_data()
    for one, other in zip(again.begin, courses, strict=True):
        for read, written in zip(one, other, strict=True):
            np.testing.assert_array_equal(read, written)
            assert read.dtype == written.dtype


def test_windows_beside_a_limit_on_the_same_rotation_stay_on_the_grid(task, found):
    window = found.runs[0].window.copy()
    window[5] = -0.5, 0.5
    run = replace(found.runs[0], window=window, continuous=True)
    options = PlanOptions(rotation=[np.inf] * 5 + [1.0], gamma_step=STEP)
    where = {key: task[key] for key in ("speed", "graph")}
    with pytest.raises(NoFeasiblePath, match="on the grid only: the rotation"):
        plan_run(run, task["contour"], setup_of(task), options, **where)


def test_the_same_run_comes_back_from_its_data(found, off_grid):
    for run in (*found.runs, *off_grid.runs):
        again = Subproblem.from_data(json.loads(json.dumps(run.to_data())))
        assert again.to_data() == run.to_data()
        assert again.continuous == run.continuous
        np.testing.assert_array_equal(again.window, run.window)


@pytest.mark.slow
def test_the_page_on_pareto_sets_runs(capsys):
    page = (ROOT / "docs" / "pareto.md").read_text()
    for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        exec(compile(code, "pareto.md", "exec"), {})
    assert "hypervolume" in capsys.readouterr().out


def test_the_page_on_pareto_sets_has_a_row_for_every_criterion_and_its_unit():
    page = (ROOT / "docs" / "pareto.md").read_text()
    rows = [line.strip("|").split(" | ") for line in page.splitlines() if line.startswith("| `")]
    units = {name: row[1].strip() for row in rows for name in re.findall(r"`(\w+)`", row[0])}
    every = CRITERIA | {f"{name}_J": each for name, each in JOINT_CRITERIA.items()}
    assert set(units) == set(every)
    assert all(units[name] == CRITERIA[name].unit for name in set(CRITERIA) - set(MEASURES))


def test_the_rotation_is_that_of_the_head_on_all_its_turns(task):
    made = pareto(**task, criteria=["displacement", "rotation"], runs=8)
    assert made.units == ("s", "rad")
    turned = [np.ptp(np.unwrap(plan.gamma)) for plan in made.plans]
    assert made.values[:, 1] == pytest.approx(turned)
    assert (np.diff(made.values[:, 1]) < 0).all()
    closest = made.plans[int(np.argmin(turned))]
    whole = replace(closest, gamma=np.linspace(0, 3 * np.pi, len(closest.gamma)))
    assert CRITERIA["rotation"].value(whole, None) == pytest.approx(3 * np.pi)


def test_a_new_criterion_is_one_object(task, monkeypatch):
    class Turning(Criterion):
        more_is_better = True

        def value(self, plan, problem):
            return float(np.ptp(plan.gamma))

    turning = Turning(name="turning", words="span of gamma", unit="rad")
    monkeypatch.setitem(CRITERIA, "turning", turning)
    made = pareto(**task, criteria=["displacement", "turning"], runs=8)
    assert made.units == ("s", "rad")
    assert made.values[:, 1] == pytest.approx([np.ptp(plan.gamma) for plan in made.plans])
    assert (np.diff(made.values[:, 1]) > 0).all()


@pytest.mark.slow
def test_in_a_cell_every_plan_is_clear(task, tool, placement):
    blind, arm = plan(**task), task["robot"]
    slab = box_between([-0.3, -0.3, -0.09], [0.3, 0.3, -0.06])
    x, y, z = arm.forward(blind.q[15])[:3, 3]  # where the flange of a plan without a cell would be
    room = cell_of(
        arm,
        tool=tool,
        placement=placement,
        part=Mesh(vertices=slab.points, triangles=slab.triangles),
        fixtures={"post": box_between([x - 0.01, y - 0.01, 0.55], [x + 0.01, y + 0.01, z])},
        near_miss=2e-3,
    )
    assert not room.clear(blind.q).all()
    made = pareto(**task, cell=room, criteria=("displacement", "velocity", "range"), runs=12)
    assert len(made.plans) > 1
    for clear in made.plans:
        assert room.clear(clear.q).all()
        assert audit(clear, cell=room) == []


@pytest.mark.slow
def test_more_clearance_is_asked_for_and_found(task, tool, placement):
    post = box_between([1.61, 0.17, 0.55], [1.63, 0.19, 0.92])  # m: beside the head
    room = cell_of(
        task["robot"],
        tool=tool,
        placement=placement,
        part=None,
        fixtures={"post": post},
        near_miss=2e-3,
    )
    made = pareto(**task, cell=room, criteria=("displacement", "clearance"), runs=12)
    assert len(made.plans) > 1
    assert made.runs[-1].clearance > 0
    for run, chosen, (_, clearance) in zip(made.runs, made.plans, made.values, strict=True):
        apart = room.distances(chosen.q).min(axis=0) - room.required
        named = zip(room.pair_names, apart, strict=True)
        near = min(far for names, far in named if "post" in names)
        assert clearance == pytest.approx(near, rel=1e-11)  # 12 digits count
        assert clearance > run.clearance
        assert len(run.cell(room).pairs) == len(room.pairs)


def test_clearance_is_one_thing_or_the_other(task, tool, placement):
    where = {"tool": tool, "placement": placement, "part": None, "near_miss": 2e-3}
    comfort = Comfort(clearance=Band(width=0.02, cost=1.0))
    room = cell_of(task["robot"], fixtures={"post": box_between([2, 2, 0], [2.1, 2.1, 1])}, **where)
    options = task | {"criteria": ["clearance"]}
    with pytest.raises(InputError, match="already a penalty in comfort"):
        pareto(**options, cell=room, comfort=comfort)
    with pytest.raises(InputError, match="needs a part or a fixture in the cell"):
        pareto(**options, cell=cell_of(task["robot"], fixtures={}, **where))
