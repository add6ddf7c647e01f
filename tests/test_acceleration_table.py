"""Accelerations by configuration: laws of plans, an oracle by scipy, refusals, files."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from tests.naive import difference

from kerfpath import (
    AccelerationTable,
    Certify,
    Contour,
    InputError,
    NoFeasiblePath,
    audit,
    fastest_speed,
    plan,
    robot,
)
from kerfpath.auditor.acceleration import largest_accelerations, most_accelerations, scarcity
from kerfpath.certificate import cell_bounds
from kerfpath.certifier import foldable
from kerfpath.certifier.bound import bound_steps
from kerfpath.certifier.cells import cell_maker
from kerfpath.certifier.elimination import Elimination
from kerfpath.certifier.stages import distinct_groups, solve_stage
from kerfpath.certifier.tube import Duals, motion_through, tube_about
from kerfpath.execution import executed, timing_of
from kerfpath.kernels.change_table import change_factors, most_factors
from kerfpath.limits import Limits, rates_of
from kerfpath.planner.folding import folds
from kerfpath.post import build_program
from kerfpath.retime import retime
from kerfpath.robots import RobotLimits
from kerfpath.search import SearchProblem, change_table, find_least_interval, find_shortest

NAME = "abb_irb6640_180_255"
STEP = np.radians(5)
TOOL = np.eye(4)
TOOL[:3, 3] = [0.1, 0.0, 0.4]
PLACE = np.eye(4)
PLACE[:3, 3] = [1.4, -0.2, 0.6]
ROUNDING = 1e-6
"""Share by which a plan may exceed a limit, as its audit allows."""
AXES = {"joint_2": [-1.0, 0.0, 1.5], "joint_3": [-3.0, 0.0, 1.0]}
"""Nodes of small tables, rad."""


def wave(count=61):
    x = np.linspace(0, 0.3, count)
    points = np.stack([x, 0.01 * np.sin(60 * x), 0 * x], axis=1)
    line = Contour(points, np.tile([0, 0, -1.0], (count, 1)), closed=False)
    return line.resample(count=count)


@pytest.fixture(scope="module")
def arm():
    return robot(NAME)


@pytest.fixture(scope="module")
def tabled():
    return robot(NAME, acceleration_table="library")


def planned(arm, speed=0.4, **options):
    return plan(wave(), arm, tool=TOOL, placement=PLACE, speed=speed, gamma_step=STEP, **options)


def by_scipy(table, q):
    """The limits (B, J) of a table at q (B, n), its least ones outside."""
    at = RegularGridInterpolator(
        (table.joint_2, table.joint_3), table.values, bounds_error=False, fill_value=np.nan
    )
    found = at(q[:, 1:3])
    return np.where(np.isnan(found), table.values.min(axis=(0, 1)), found)


def shares(made, arm):
    """Shares (K-2, n) of the accelerations of a plan, by scipy's interpolation."""
    _, a = rates_of(made.increments, np.diff(made.time))
    table, limit = arm.limits.acceleration_table, np.tile(arm.limits.acceleration, (len(a), 1))
    limit[:, table.joints] = by_scipy(table, made.q[1:-1])
    return np.abs(a) / limit


def constant(limits):
    return AccelerationTable(
        **AXES, limits={i + 1: np.full((3, 3), value) for i, value in enumerate(limits[:3])}
    )


# The limit itself.


def test_three_interpolations_agree_with_scipy(tabled):
    low, high = tabled.joint_limits().lower, tabled.joint_limits().upper
    q = np.random.default_rng(1).uniform(low, high, (4000, 6))
    table = tabled.limits.acceleration_table
    nodes = np.stack(np.meshgrid(table.joint_2, table.joint_3, indexing="ij"), axis=-1)
    q[: nodes[..., 0].size, 1:3] = nodes.reshape(-1, 2)
    outside = (q[:, 2] > table.joint_3[-1]) | (q[:, 1] > table.joint_2[-1])
    assert 20 < outside.sum() < 2000
    want = np.tile(tabled.acceleration, (len(q), 1))
    want[:, :3] = by_scipy(table, q)
    limits = Limits.of(*tabled.speed_limits(), table=table)
    factors = change_factors(change_table(limits), q)
    for found in (
        tabled.acceleration_at(q),
        largest_accelerations(tabled, q),
        limits.acceleration.bound * factors,
    ):
        np.testing.assert_allclose(found, want, rtol=1e-12)
    np.testing.assert_allclose(tabled.acceleration[:3], np.radians([175, 230, 525]))


def test_plans_do_not_use_a_table_that_is_not_asked_for(arm):
    assert arm.limits.acceleration_table is None
    np.testing.assert_allclose(np.degrees(arm.acceleration), [205, 243, 533, 2434, 2111, 2891])


def test_given_accelerations_replace_a_table_and_a_table_those_of_its_joints(tabled):
    plain = tabled.with_limits(acceleration=np.full(6, 4.0))
    assert plain.limits.acceleration_table is None
    both = plain.with_limits(acceleration_table=constant([2.0, 3.0, 5.0]))
    np.testing.assert_array_equal(both.acceleration, [2, 3, 5, 4, 4, 4])
    assert "joints 1, 2, 3" in both.acceleration_source
    railed = both.on_rail([1, 0, 0], lower=-1, upper=1, velocity=1, acceleration=2)
    np.testing.assert_array_equal(railed.acceleration, [2, 3, 5, 4, 4, 4, 2])
    assert railed.alone().limits.acceleration_table is both.limits.acceleration_table


def test_the_largest_limit_over_a_box_is_that_at_a_corner_of_box_or_table(tabled):
    rng, table = np.random.default_rng(9), tabled.limits.acceleration_table
    middle = rng.uniform([-1.5, -3.6], [1.9, 1.5], (200, 2))
    half = rng.choice([0.0, 1e-3, 0.1, 0.6, 9.0], (200, 1)) * rng.uniform(0, 1, (200, 2))
    low, high = np.tile([-9.0] * 6, (200, 1)), np.tile([9.0] * 6, (200, 1))
    low[:, 1:3], high[:, 1:3] = middle - half, middle + half
    want = np.tile(tabled.acceleration, (200, 1))
    for k in range(200):
        lines = [
            np.array([a, b, *nodes[(nodes > a) & (nodes < b)]])
            for nodes, a, b in zip(
                (table.joint_2, table.joint_3), low[k, 1:3], high[k, 1:3], strict=True
            )
        ]
        # A box that sticks out of the table has its edges there, too.
        for i, nodes in enumerate((table.joint_2, table.joint_3)):
            lines[i] = np.append(lines[i], np.clip(nodes[[0, -1]], low[k, 1 + i], high[k, 1 + i]))
        q = np.zeros((lines[0].size * lines[1].size, 6))
        q[:, 1:3] = np.stack(np.meshgrid(*lines), axis=-1).reshape(-1, 2)
        want[k, :3] = by_scipy(table, q).max(axis=0)
    limits = Limits.of(*tabled.speed_limits(), table=table)
    found = limits.acceleration.bound * most_factors(change_table(limits), low, high)
    for each in (found, most_accelerations(tabled, low[:, 1:3], high[:, 1:3])):
        np.testing.assert_allclose(each, want, rtol=4e-12)
        assert (each >= want * (1 - 1e-15)).all()
    everywhere = np.full((1, 2), np.inf)
    np.testing.assert_allclose(
        most_accelerations(tabled, -everywhere, everywhere)[0, :3], table.most, rtol=4e-12
    )


# Laws of plans.


@pytest.mark.parametrize(("method", "speed"), [("exact", 0.3), ("paper", 0.1), ("continuous", 0.3)])
def test_a_constant_table_gives_the_plan_of_the_constant_limits(arm, method, speed):
    same = arm.with_limits(acceleration_table=constant(arm.acceleration))
    options = {"method": method} | ({"refine": True} if method == "exact" else {})
    one, other = (planned(each, speed, **options) for each in (arm, same))
    np.testing.assert_array_equal(one.q, other.q)
    assert one.cost == other.cost
    assert one.proof.bound == other.proof.bound


def test_plans_keep_the_table_where_its_least_values_would_not_do(tabled):
    least = robot(NAME).with_limits(acceleration=tabled.acceleration)
    task = {"tool": TOOL, "placement": PLACE, "gamma_step": STEP, "refine": True, "explore": False}
    slow, fast = (fastest_speed(wave(), each, **task).speed for each in (least, tabled))
    assert fast > 1.2 * slow
    for options in ({}, {"method": "exact", "refine": True}):
        made = planned(tabled, 1.1 * slow, **options)
        used = shares(made, tabled)
        assert used.max() <= 1 + ROUNDING
        _, a = rates_of(made.increments, np.diff(made.time))
        assert (np.abs(a) / tabled.acceleration).max() > 1.01
        np.testing.assert_allclose(np.abs(made.acceleration_share), used, rtol=1e-9, atol=1e-12)
        assert not audit(made)
        assert audit(replace(made, robot=least))


def graphs():
    """Small graphs of three joints with limits by a table, each with its layers of joints."""
    rng = np.random.default_rng(4)
    for _ in range(12):
        q = rng.uniform(-1, 1, (5, 4, 3)) * [1.0, 1.4, 2.5]
        table = AccelerationTable(
            joint_2=[-1.0, 0.1, 1.0],
            joint_3=[-2.0, 0.5, 2.0],
            limits={i: rng.uniform(1, 6, (3, 3)) for i in (1, 3)},
        )
        limits = Limits.of(np.full(3, 50.0), np.full(3, 4.0), table=table, eta_a=0.9)
        yield SearchProblem(
            q=q.reshape(-1, 3), start=np.arange(0, 21, 4), dt=1.0, limits=limits,
            weights=np.ones(3),
        ), q  # fmt: skip


def cost_of(problem):
    try:
        return find_shortest(problem).cost
    except NoFeasiblePath:
        return np.inf


def test_the_exact_searches_agree_with_trying_every_path():
    """Shortest path and least interval, by the limit at the middle vertex of each pair."""
    found = 0
    for problem, q in graphs():
        best, quickest = np.inf, np.inf
        table = problem.limits.acceleration.table
        for index in product(range(4), repeat=5):
            path = q[np.arange(5), index]
            dq = difference(path[:-1], path[1:], np.zeros(3, bool))
            limit = np.full((3, 3), 4.0)
            limit[:, table.joints] = by_scipy(table, path[1:-1])
            sharp = (np.abs(np.diff(dq, axis=0)) / (0.9 * limit)).max()
            quickest = min(quickest, max(np.sqrt(sharp), np.abs(dq).max() / 50))
            if sharp <= 1:
                best = min(best, np.abs(dq).sum())
        np.testing.assert_allclose(find_least_interval(problem).dt, quickest, rtol=1e-9)
        for dt in (1.0, 1.0001 * quickest):
            cost = cost_of(replace(problem, dt=dt))
            if dt == 1.0:
                assert cost == pytest.approx(best, rel=1e-12)
                found += np.isfinite(best)
            else:
                assert np.isfinite(cost)
    assert found > 3


def test_a_larger_table_is_never_worse():
    better = 0
    for problem, _ in graphs():
        costs, intervals = [], []
        for times in (1.0, 1.3, 2.0):
            limit = problem.limits.acceleration
            larger = replace(
                limit.table, limits={i: times * v for i, v in limit.table.limits.items()}
            )
            limits = replace(problem.limits, acceleration=replace(limit, table=larger))
            eased = replace(problem, limits=limits)
            costs.append(cost_of(eased))
            intervals.append(find_least_interval(eased).dt)
        assert costs == sorted(costs, reverse=True)
        assert intervals == sorted(intervals, reverse=True)
        better += costs[-1] < costs[0]
    assert better > 3


@pytest.fixture(scope="module")
def sharp(tabled):
    """A plan whose accelerations are at the limit of the table, above what holds everywhere."""
    task = {"tool": TOOL, "placement": PLACE, "gamma_step": STEP, "refine": True}
    speed = fastest_speed(wave(), tabled, **task, explore=False).speed
    made = planned(tabled, 0.995 * speed, refine=True, certify=None)
    _, a = rates_of(made.increments, np.diff(made.time))
    assert shares(made, tabled).max() > 0.98
    assert (np.abs(a) / tabled.acceleration).max() > 1.2
    return made


def cells_about(made, nodes, halvings):
    """Cells near a plan, some of them beside it; None of them leaves the plan out."""
    steps = bound_steps(made)
    maker = cell_maker(made, steps.weight)
    cells = maker.coarsest(nodes)
    for _ in range(halvings):
        at, half = cell_bounds(cells.level, cells.index)
        off = np.abs(np.angle(np.exp(1j * (at - made.gamma[cells.node]))))
        near = (off < 4 * half) & (cells.posture == made.posture[cells.node])
        cells = maker.halves(cells.take(near))
    return steps, maker, cells


@pytest.mark.parametrize("stride", [1, 2, 3])
def test_no_multipliers_prove_more_than_a_motion_at_the_limit_costs(sharp, stride):
    """Pushing against the limits that bind: a limit that is too small would show at once."""
    nodes = np.arange(0, len(sharp.q), stride)
    steps, _, cells = cells_about(sharp, nodes, 5)
    spans, rng = np.diff(nodes), np.random.default_rng(11)
    u = np.diff(sharp.unwrapped[nodes], axis=0) / spans[:, None]
    loose = replace(steps, everywhere=None)
    better = 0
    for _ in range(12):
        nu = np.zeros((len(nodes), 6))
        size = rng.uniform(0, 3, (len(nodes) - 2, 1)) * steps.weight
        nu[1:-1] = np.sign(np.diff(u, axis=0)) * size * rng.integers(0, 2, (len(nodes) - 2, 6))
        most = None if rng.integers(2) else sharp.cost
        bound = solve_stage(cells, steps, nu, most=most).bound
        assert bound <= sharp.cost
        better += bound > solve_stage(cells, loose, nu, most=most).bound
    assert better == 12


def test_no_step_of_a_motion_at_the_limit_is_ruled_out(sharp):
    steps, maker, cells = cells_about(sharp, np.arange(len(sharp.q)), 6)
    one = Elimination(cells, steps)
    assert one.forward() is None
    left = one.cells.take(one.backward())
    at, half = cell_bounds(left.level, left.index)
    off = np.abs(np.angle(np.exp(1j * (at - sharp.gamma[left.node]))))
    assert len(np.unique(left.node[off <= half * (1 + 1e-9)])) == len(sharp.q)
    half = np.full(len(sharp.q), 0.01)
    tube = tube_about(maker, np.arange(len(half)), sharp.gamma, half, sharp.posture)
    tube, _ = tube.with_ties(steps, np.ones(len(half) - 1, int))
    assert tube is not None
    rng = np.random.default_rng(6)
    for _ in range(200):
        nu = np.zeros(sharp.q.shape)
        nu[1:-1] = np.sign(np.diff(sharp.increments, axis=0)) * rng.uniform(
            0, 2, (len(half) - 2, 1)
        )
        y = np.sign(sharp.increments) * steps.weight + nu[:-1] - nu[1:]
        duals = Duals(y * rng.uniform(0.9, 1, y.shape), nu, rng.uniform(0, 1, len(tube.tied[1])))
        assert tube.least(steps, np.ones(len(half) - 1, int), duals) <= sharp.cost


def test_bounds_are_no_higher_than_random_motions_that_keep_the_table(sharp):
    """Gamma of a plan with some room, changed at random: what keeps all limits by scipy's table."""
    slower = planned(sharp.robot, 0.65, refine=True, certify=Certify(gap=0.002))
    assert slower.proof.bound <= slower.cost
    roomy = planned(sharp.robot, 0.65, refine=True, certify=None, eta_a=0.8, eta_v=0.9)
    rng, kept = np.random.default_rng(3), 0
    steps, maker, _ = cells_about(slower, np.arange(2), 0)
    nodes = np.arange(len(slower.q))
    for _ in range(300):
        shift = np.cumsum(np.cumsum(rng.normal(size=len(nodes)))) * 10 ** rng.uniform(-7, -4)
        q, u = motion_through(maker, nodes, roomy.gamma + shift, int(roomy.posture[0]))
        if (np.abs(u) > steps.velocity).any():
            continue
        table, limit = (
            sharp.robot.limits.acceleration_table,
            np.tile(sharp.robot.acceleration, (len(q) - 2, 1)),
        )
        limit[:, table.joints] = by_scipy(table, q[1:-1])
        if (np.abs(np.diff(u, axis=0)) <= limit * slower.dt**2).all():
            kept += 1
            assert slower.proof.bound <= steps.distance(u).sum()
    assert kept > 20


def test_a_kept_certificate_holds_with_the_table(tabled):
    short = Contour(wave().points[:7], wave().axes[:7], closed=False)
    task = {"tool": TOOL, "placement": PLACE, "gamma_step": STEP}
    speed = 0.98 * fastest_speed(short, tabled, **task, refine=True).speed
    made = plan(short, tabled, **task, speed=speed, refine=True, certify=Certify(keep=True))
    assert shares(made, tabled).max() > 0.9
    assert made.proof.certificate.branches
    assert not audit(made)


def test_the_ceiling_by_the_table_is_above_the_speed_found(tabled):
    task = {"tool": TOOL, "placement": PLACE, "gamma_step": STEP, "refine": True, "ceiling": True}
    most = {i + 1: np.full((3, 3), v) for i, v in enumerate(tabled.limits.acceleration_table.most)}
    loose = robot(NAME).with_limits(acceleration_table=AccelerationTable(**AXES, limits=most))
    found, other = (fastest_speed(wave(), each, **task) for each in (tabled, loose))
    assert found.speed < found.ceiling < 0.95 * other.ceiling


def test_groups_on_another_turn_of_a_joint_of_the_table_are_not_the_same(tabled):
    wide = tabled.with_limits(lower=np.full(6, -7.0), upper=np.full(6, 7.0))
    plain = wide.with_limits(acceleration=tabled.acceleration)
    count = {}
    for arm in (wide, plain):
        made = planned(arm, 0.2, certify=None)
        _, maker, cells = cells_about(made, np.array([0, 5]), 3)
        begin, to, kept = np.zeros(len(cells) + 1, int), np.zeros(0, int), np.ones(len(cells), bool)
        count[arm] = len(distinct_groups(cells, begin, to, kept, maker))
        assert foldable(arm, np.full(6, 0.1))[[1, 2]].any() == (arm is plain)
    assert count[wide] > count[plain]


def test_a_reduced_feed_keeps_the_table(tabled):
    made = planned(tabled, 2.0, feed="dip")
    assert shares(made, tabled).max() <= 1 + ROUNDING
    assert made.feed is not None
    assert not audit(made)
    least = robot(NAME).with_limits(acceleration=tabled.acceleration)
    slower = planned(least, 2.0, feed="dip")
    assert made.time[-1] < 0.99 * slower.time[-1]
    limits = made.settings.limits(tabled)
    with pytest.raises(InputError, match="give the joints at the nodes, q="):
        retime(made.increments, np.diff(made.time), limits)


def test_an_audit_refuses_a_motion_beyond_the_table_at_one_node_only(tabled):
    """A dip of the table at one node, of which the others know nothing."""
    made = planned(tabled, 0.3)
    assert not audit(made)
    _, a = rates_of(made.increments, np.diff(made.time))
    x, y, needed = made.q[1:-1, 1], made.q[1:-1, 2], np.abs(a[:, :3])
    refused = 0
    for k in (7, 20, 33, 50):
        apart = np.abs(np.column_stack([x, y]) - [x[k], y[k]]).max(axis=1)
        apart[k] = np.inf
        width = apart.min() / 2
        # High everywhere but within less than half the way to the next node.
        nodes = [c + width * np.array([-0.9, 0.0, 0.9]) for c in (x[k], y[k])]
        ends = [np.concatenate([[-3.0], n, [3.0]]) for n in nodes]
        values = {}
        for joint in (1, 2, 3):
            values[joint] = np.full((5, 5), 100.0)
            values[joint][2, 2] = 0.98 * needed[k, joint - 1]
        dipped = AccelerationTable(joint_2=ends[0], joint_3=ends[1], limits=values)
        (wrong,) = audit(replace(made, robot=tabled.with_limits(acceleration_table=dipped)))
        assert (wrong.code, wrong.node) == ("acceleration", k + 1)
        refused += 1
    assert refused == 4


def test_the_least_limit_over_a_box_is_below_all_in_it(tabled):
    rng = np.random.default_rng(8)
    middle = rng.uniform([-1.3, -3.4], [1.7, 1.4], (300, 2))
    half = rng.choice([1e-3, 0.02, 0.3], (300, 1)) * rng.uniform(0, 1, (300, 2))
    share = scarcity(tabled, middle - half, middle + half)
    q = np.zeros((300, 400, 6))
    q[..., 1:3] = (middle + half * rng.uniform(-1, 1, (400, 300, 2))).swapaxes(0, 1)
    q[:, :4, 1:3] = middle[:, None] + half[:, None] * [[-1, -1], [-1, 1], [1, -1], [1, 1]]
    least = tabled.acceleration_at(q).min(axis=1)
    proved = tabled.acceleration / share
    assert (proved <= least * (1 + 1e-9)).all()
    assert (proved >= tabled.acceleration * (1 - 1e-9)).all()
    assert (proved[half.max(axis=1) < 1e-3] >= 0.95 * least[half.max(axis=1) < 1e-3]).mean() > 0.9
    nothing = np.full((1, 2), np.nan)
    np.testing.assert_array_equal(scarcity(tabled, nothing, nothing), np.ones((1, 6)))


def test_the_motion_between_the_nodes_is_judged_by_the_table(arm, tabled):
    made = planned(tabled, 0.3)
    least = robot(NAME).with_limits(acceleration=tabled.acceleration)
    same = arm.with_limits(acceleration_table=constant(arm.acceleration))
    runs = {}
    for name, each in (("table", tabled), ("least", least), ("arm", arm), ("same", same)):
        (runs[name],) = executed(build_program([replace(made, robot=each)], zone="auto"))
    run = runs["table"]
    shares_of = np.abs(run.acceleration_share)
    want = np.tile(tabled.acceleration, (len(run.q), 1))
    want[:, :3] = by_scipy(tabled.limits.acceleration_table, run.q)
    np.testing.assert_allclose(
        shares_of * want, np.abs(runs["least"].acceleration_share) * least.acceleration, rtol=1e-9
    )
    assert shares_of.max() <= run.acceleration_bound < runs["least"].acceleration_bound
    assert runs["arm"].acceleration_bound == runs["same"].acceleration_bound
    assert timing_of(run).seconds < timing_of(runs["least"]).seconds
    assert timing_of(runs["arm"]).seconds == timing_of(runs["same"]).seconds


def test_joints_of_the_table_are_not_folded(tabled):
    wide = tabled.with_limits(lower=np.full(6, -7.0), upper=np.full(6, 7.0))
    plain = wide.with_limits(acceleration=tabled.acceleration)
    options = planned(tabled, 0.2).settings
    assert folds(plain, options, 0.01).all()
    np.testing.assert_array_equal(folds(wide, options, 0.01), [1, 0, 0, 1, 1, 1])


# Refusals.


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"joint_2": [0.0, 0.0, 1.0]}, "joint_2 must increase"),
        ({"joint_3": [1.0]}, "joint_3 must increase"),
        ({"joint_2": [-60.0, 0.0, 80.0]}, "joint_2: expected the nodes in rad"),
        ({"limits": {1: np.full((3, 2), 5.0)}}, "joint 1: expected shape"),
        ({"limits": {2: np.where(np.eye(3) == 1, np.nan, 5.0)}}, "must be finite"),
        ({"limits": {3: np.eye(3)}}, "must be positive"),
        ({"limits": {0: np.full((3, 3), 5.0)}}, "whole numbers from 1"),
        ({"limits": {}}, "got none"),
    ],
)
def test_tables_that_are_refused(changed, words):
    with pytest.raises(InputError, match=words):
        AccelerationTable(**({**AXES, "limits": {1: np.full((3, 3), 5.0)}} | changed))


def test_tables_that_do_not_fit_a_robot_are_refused(arm):
    with pytest.raises(InputError, match="for joint 7, but the arm has 6"):
        arm.with_limits(
            acceleration_table=replace(constant(np.ones(3)), limits={7: np.ones((3, 3))})
        )
    with pytest.raises(InputError, match="limits of the joints in rad and s"):
        arm.with_limits(acceleration_table=constant([205.0, 243.0, 533.0]))
    with pytest.raises(InputError, match="no table of accelerations"):
        robot("abb_irb4600_60_205", acceleration_table="library")
    with pytest.raises(InputError, match="endless"):
        arm.with_limits(acceleration_table=constant(np.ones(3)), endless=np.arange(6) == 2)
    with pytest.raises(InputError, match="other joints"):
        RobotLimits(acceleration_table=constant(np.ones(3))).cast(6, 6)


ROWS = "joint_2_deg,joint_3_deg,joint_1_deg_s2\n" + "".join(
    f"{x},{y},{200 + x + y}\n" for y in (-90, 0, 45) for x in (-30, 40)
)


def test_a_csv_file_is_read_in_any_order(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text(ROWS)
    table = AccelerationTable.from_csv(path)
    np.testing.assert_allclose(np.degrees(table.joint_2), [-30, 40])
    np.testing.assert_allclose(np.degrees(table.limits[1]), [[80, 170, 215], [150, 240, 285]])


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("joint_1_deg_s2", "joint_1_rad_s2", "got the column 'joint_1_rad_s2'"),
        ("joint_2_deg,", "joint_3_deg,", "each once"),
        ("-30,45,215\n", "", "a hole at joint_2_deg -30, joint_3_deg 45"),
        ("-30,45,215\n", "40,45,215\n", "a hole at joint_2_deg -30"),
        ("-30,45,215\n", "-30,45,\n", "row 6: expected 3 numbers"),
        ("-30,45,215\n", "-30,45,nan\n", "must be finite"),
        ("-30,45,215\n", "-30,45,-215\n", "must be positive"),
    ],
)
def test_csv_files_that_are_refused(tmp_path, before, after, words):
    path = tmp_path / "table.csv"
    assert before in ROWS
    path.write_text(ROWS.replace(before, after, 1))
    with pytest.raises(InputError, match=words) as refused:
        AccelerationTable.from_csv(path)
    assert len(str(refused.value).splitlines()) == 1
