"""The yardsticks of the benchmarks measure against the right thing."""

import importlib
import time

import numpy as np
import pytest
from benchmarks import (
    _arm,
    _certified,
    _dense,
    _figures,
    _following,
    _narrow,
    _process,
    _random_contours,
    _starts,
    _tally,
    continuum_infeasible,
    continuum_random,
    part,
    torque,
)

import kerfpath


@pytest.mark.parametrize("metric", ["manhattan", "euclid"])
@pytest.mark.parametrize("velocity", [4.0, 1e6])
@pytest.mark.parametrize("seed", range(5))
def test_the_dense_recursion_finds_the_cost_of_the_shortest_path(metric, velocity, seed):
    rng = np.random.default_rng(seed)
    sizes = rng.integers(20, 40, 12)
    start = np.concatenate([[0], np.cumsum(sizes)])
    q = rng.uniform(-0.5, 0.5, (start[-1], 6)) + rng.integers(-1, 2, (start[-1], 1)) * np.pi
    task = {
        "dt": 0.2,
        "velocity": np.full(6, velocity),
        "endless": np.array([0, 1, 0, 1, 0, 1], bool),
        "weights": rng.uniform(0.5, 2, 6),
        "metric": metric,
    }
    path = kerfpath.shortest_path(q, start, acceleration=np.full(6, 1e9), method="paper", **task)
    dense = _dense.dense_cost(q, start, **task)
    assert path.optimal
    # Two orders of summation of a dozen numbers near one.
    assert dense == pytest.approx(path.cost, rel=1e-12)


def test_the_dense_recursion_says_when_there_is_no_path():
    q, start = np.zeros((2, 6)), np.array([0, 1, 2])
    q[1] = 1.0
    dense = _dense.dense_cost
    ones = np.ones(6)
    task = {"endless": np.zeros(6, bool), "weights": ones, "metric": "manhattan"}
    assert dense(q, start, dt=0.5, velocity=ones, **task) == np.inf
    assert dense(q, start, dt=1.0, velocity=ones, **task) == pytest.approx(6.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_the_brute_recursion_finds_the_cost_of_the_exact_path(seed):
    rng = np.random.default_rng(seed)
    sizes = rng.integers(8, 20, 9)
    start = np.concatenate([[0], np.cumsum(sizes)])
    task = {
        "dt": 0.2,
        "velocity": np.full(6, 4.0),
        "acceleration": np.full(6, rng.uniform(8, 20)),
        "endless": np.array([0, 1, 0, 1, 0, 1], bool),
        "weights": rng.uniform(0.5, 2, 6),
    }
    q = rng.uniform(-0.5, 0.5, (start[-1], 6))
    q[:, task["endless"]] += np.pi
    brute = _dense.second_order_cost(q, start, **task)
    try:
        cost = kerfpath.shortest_path(q, start, **task).cost
    except kerfpath.NoFeasiblePath:
        cost = np.inf
    assert brute == pytest.approx(cost, rel=1e-12)


def test_the_serial_chain_given_to_the_peers_is_the_robot():
    robot = _arm.arm()
    axes, origins = _arm.chain(robot)
    q = np.array([0.3, -0.4, 0.5, -0.6, 0.7, -0.8])
    R, p = np.eye(3), np.zeros(3)
    for (x, y, z), origin, angle in zip(axes, origins[:6], q, strict=True):
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        p = p + R @ origin
        R = R @ (np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
    T, zero = robot.forward(q), robot.forward(np.zeros(6))
    # Rounding of a dozen products of numbers near one.
    np.testing.assert_allclose(p + R @ origins[6], T[:3, 3], atol=1e-14)
    np.testing.assert_allclose(R @ zero[:3, :3], T[:3, :3], atol=1e-14)


@pytest.fixture(scope="module")
def cut():
    """A random cut whose grid has a path, and its exact plan."""
    name = "kuka_kr16_r1610_2"
    for index in range(10):
        task = _random_contours.cut(name, index)
        try:
            made = kerfpath.plan(
                task.contour,
                task.robot,
                speed=task.speed,
                graph=task.graph,
                method="exact",
                **task.options,
            )
        except kerfpath.NoFeasiblePath:
            continue
        return task, made
    pytest.fail("none of ten cuts has a path")


@pytest.mark.slow
def test_the_seed_decides_the_random_cuts():
    for name in _random_contours.ROBOTS:
        one, again, other = (_random_contours.cut(name, i) for i in (3, 3, 4))
        assert np.array_equal(one.contour.points, again.contour.points)
        assert one.speed == again.speed
        assert len(one.contour) != len(other.contour) or one.speed != other.speed
        assert 60 <= len(one.contour) <= 80
        size = np.linalg.norm(np.ptp(one.contour.points, axis=0))
        assert size < 0.6
        assert np.diff(one.graph.start).all()


@pytest.mark.slow
def test_following_the_gamma_of_a_plan_gives_its_cost_and_keeps_its_limits(cut):
    task, made = cut
    follower = _following.Follower(task)
    found = follower.follow(made.gamma[None])
    assert found.excess[0] == 0.0
    # The nearest pose at each node is the plan's own, or one that costs less.
    assert found.cost[0] <= made.cost * (1 + 1e-12)
    cost, feasible = follower.weigh(made.q)
    assert feasible
    assert cost == pytest.approx(made.cost, rel=1e-12)


def test_following_says_by_how_much_the_limits_are_exceeded(cut):
    task, made = cut
    follower = _following.Follower(task)
    q = np.array(made.q)
    q[5, 0] += 1.5 * follower.task.bound_v[0] + 2 * abs(q[5, 0] - q[4, 0])
    assert not follower.weigh(q)[1]


def test_edges_add_up_to_the_cost_of_a_plan_of_one_posture(cut):
    task, made = cut
    given = _following.Follower(task).task
    assert np.ptp(made.posture) == 0
    mu, gamma, nodes = int(made.posture[0]), made.gamma, range(len(made.gamma) - 1)
    cost = sum(_following.edge_cost(given, mu, k, gamma[k], k + 1, gamma[k + 1]) for k in nodes)
    assert cost == pytest.approx(made.cost, rel=1e-9)
    assert _following.edge_cost(given, mu, 4, gamma[4], 4, gamma[4]) == np.inf
    assert _following.edge_cost(given, mu, 4, gamma[4], 3, gamma[3]) == np.inf


def test_the_genetic_algorithm_repeats_itself(cut):
    pytest.importorskip("pymoo")
    from benchmarks import _genetic as genetic

    follower = _following.Follower(cut[0])
    gamma, again = (genetic.genetic(follower, seed=1, generations=5) for _ in range(2))
    assert gamma.shape == (len(cut[0].contour),)
    assert np.array_equal(gamma, again)
    basis = genetic.spline_basis(61, 8)
    np.testing.assert_allclose(basis.sum(axis=1), 1, atol=1e-12)


@pytest.mark.slow
def test_sampling_finds_a_course_that_keeps_the_velocity_limits(cut):
    pytest.importorskip("ompl")
    from benchmarks import _sampling as sampling

    follower = _following.Follower(cut[0])
    sampling.start_generators(1)
    gamma = sampling.sampled(follower, seed=1, edges=8000)
    assert gamma is not None
    assert gamma.shape == (len(cut[0].contour),)
    assert follower.follow(gamma[None]).excess[0] < 1000  # no node without a pose


def test_the_tally_counts_what_is_missed_and_what_lies_beyond_the_grid():

    def outcome(index, method, cost):
        return _tally.Outcome(robot="r", index=index, method=method, seconds=2.0, cost=cost)

    outcomes = [
        *(outcome(i, "exact", cost) for i, cost in enumerate((10.0, 10.0, 10.0, None))),
        *(outcome(i, "other", cost) for i, cost in enumerate((11.0, 9.0, None, 5.0))),
    ]
    exact, other = _tally.sheet(outcomes, ("exact", "other")).rows
    assert exact[1:6] == ("exact", "4", "3", "0", "0")
    assert other[1:6] == ("other", "4", "3", "1", "1")
    assert other[6:] == ("0.00", "0.00", "10.00", "1 of 2", "2")


def test_a_sheet_is_written_with_its_own_columns():
    sheet = _figures.Sheet(columns=("what", "number"), rows=[("this", "1")])
    report = _figures.Report(title="A", how="So.", sheets=[sheet])
    text = _figures.markdown([report], {}, "")
    assert "| what | number |\n| --- | ---: |\n| this | 1 |" in text
    assert "median" not in text


def test_a_run_keeps_the_sections_that_it_did_not_make():
    old, new = (_figures.Report(title=title, how="how") for title in ("Old", "New"))
    before = _figures.markdown([old, new], {"note": "at a"}, "2026-01-01")
    again = _figures.markdown([new], {"note": "at b"}, "2026-02-02", before)
    assert again.count("## Old\n\n*Measured 2026-01-01, at a.*") == 1
    assert again.count("## New\n\n*Measured 2026-02-02, at b.*") == 1
    assert again.index("## Old") < again.index("## New")
    assert again.count("## ") == 2


@pytest.mark.parametrize("name", ["demo", "part"])
def test_a_benchmark_clocks_functions_that_are_there(name):
    for module, function in importlib.import_module(f"benchmarks.{name}").CLOCKS.values():
        assert callable(getattr(importlib.import_module(module), function))


def test_a_clock_counts_the_outer_of_two_calls():
    clock = _process.Clock({"outer": ("", ""), "inner": ("", "")})
    inner = clock.around("inner", lambda: time.sleep(0.01))
    clock.around("outer", inner)()
    assert clock.seconds["inner"] == 0
    assert clock.seconds["outer"] >= 0.01
    inner()
    assert clock.seconds["inner"] >= 0.01


def test_the_nearest_order_goes_on_to_the_nearest_that_may_come():
    at = np.array([0.0, 1.0, 2.5, -1.2, 9.0])  # home, and four contours
    between = np.abs(at - at[:, None])
    nearest = part.nearest_first
    assert nearest(between, []) == [0, 1, 2, 3]
    assert nearest(between, [(3, 0), (1, 0)]) == [2, 1, 3, 0]


@pytest.mark.slow
def test_both_methods_are_weighed_on_the_same_task(cut):
    task, made = cut
    asked = _certified.Task(
        contour=task.contour,
        robot=task.robot,
        tool=task.tool,
        placement=np.eye(4),
        speed=task.speed,
        options=kerfpath.PlanOptions(),
    )
    weighed = _certified.weigh("cut", 0, asked, gap=0.05)
    assert weighed.grid_cost <= made.cost  # refined from this very path, among others
    assert weighed.bound <= min(weighed.cost, weighed.grid_cost)
    assert weighed.gap == pytest.approx(1 - weighed.bound / weighed.cost)
    assert asked.on_grid().options.method == "exact"
    assert asked.on_grid(gamma_step=0.1).options.gamma_step == 0.1


def test_a_plan_that_is_shaken_only_becomes_better(cut):
    _, made = cut
    found = list(_starts.shaken(made, np.random.default_rng(3)))
    costs = [made.cost, *(one.cost for one in found)]
    assert found
    assert costs == sorted(costs, reverse=True)


def test_samples_of_gamma_are_moved_with_the_tool(cut):
    task, made = cut
    moved = np.radians(0.3)
    tool = task.tool @ _starts._about_beam(moved)
    T = np.asarray(made.robot.forward(made.q)) @ tool
    points = task.contour.points
    # Turning about the beam leaves tip and axis where they are; a chain of products near one metre.
    np.testing.assert_allclose(T[:, :3, 3], points, atol=1e-9)
    np.testing.assert_allclose(T[:, :3, 2], task.contour.axes, atol=1e-9)


@pytest.mark.slow
def test_a_narrow_task_leaves_the_joints_little_room():
    task = _narrow.narrow_task(np.random.default_rng([17, 1]))
    again = _narrow.narrow_task(np.random.default_rng([17, 1]))
    made = task.made().plan
    assert 10 <= len(task.contour) <= 20
    assert np.array_equal(task.robot.lower, again.robot.lower)
    assert (made.q >= task.robot.lower - 1e-8).all()
    assert (made.q <= task.robot.upper + 1e-8).all()


def test_the_findings_name_what_asks_for_a_look():
    def weighed(index, cost, grid_cost, bound, seconds=1.0):
        gap = None if cost is None else 1 - bound / cost
        return _certified.Weighed(
            name="r",
            index=index,
            nodes=9,
            cost=cost,
            grid_cost=grid_cost,
            bound=bound,
            gap=gap,
            seconds=1.0,
            graph_seconds=1.0,
            grid_seconds=1.0,
            grid_graph_seconds=1.0,
            certificate_seconds=seconds,
        )

    made = [
        weighed(0, 10.0, 9.0, 8.0),
        weighed(1, 10.0, None, 10.0, seconds=99.0),
        weighed(2, None, 10.0, None),
        weighed(3, 10.0, 9.8, 9.9),
    ]
    counts = [text.split(": ")[1].split(";")[0] for text in continuum_random._findings(made)]
    assert counts == ["1", "2", "1", "1", "1"]
    row = continuum_random._row("all", made)
    assert row[1:7] == ("4", "3", "3", "1", "1", "2")


def test_a_plan_above_the_ceiling_is_told_apart_from_one_below():
    def refused(index, verdict, ceiling=None):
        return continuum_infeasible.Refused(
            name="abb_irb2400_155",
            index=index,
            verdict=verdict,
            where="node 3" if verdict == "every gamma" else "",
            speed=1.0,
            ceiling=ceiling,
            seconds=2.0,
            fastest_seconds=1.0,
        )

    made = [
        refused(0, "every gamma"),
        refused(1, "grid"),
        refused(2, "grid", 1.4),
        refused(3, "undecided", 1.6),
        refused(4, "planned", 1.6),
        refused(5, "planned", 1.5),
        refused(6, "planned"),
    ]
    report = continuum_infeasible.report(made)
    counts = [text.split(": ")[1].partition(";")[0] for text in report.findings]
    assert counts == ["1 of 4 (25.0 %) of those without a plan", "3", "3", "1", "1"]
    assert report.sheets[0].rows[-1] == ("all", "7", "1", "2", "1", "3", "2", "1")
    assert report.sheets[0].rows[1] == ("kuka_kr16_r1610_2", *("0",) * 5, "-", "-")


def test_the_yardstick_of_torque_limits_is_the_search_by_another_dynamics():
    report = torque._against_brute(torque._arm_with_masses(), 6)  # asserts that they agree
    assert "agrees on all 6 graphs" in report.findings[0]
    assert "dearer with them" in report.findings[0]
