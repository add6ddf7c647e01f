"""Bounds where the tool axis may tilt or axes are external: no motion beats them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from kerfpath import PlanOptions, audit, plan
from kerfpath.certificate import BASE, cell_bounds
from kerfpath.certifier import certify
from kerfpath.certifier.bound import bound_steps
from kerfpath.certifier.cells import cell_maker
from kerfpath.certifier.motion_slopes import motion_slopes
from kerfpath.certifier.stages import solve_stage
from kerfpath.contour import Contour
from kerfpath.effort import changed_effort
from kerfpath.kernels.metric import rho
from kerfpath.plans import Feed, path_cost
from kerfpath.robots.external_axes import base_in_part
from kerfpath.tilt import Tilt

pytestmark = pytest.mark.usefixtures("certifier_at_work", "little_work")
CONE = 0.05


@pytest.fixture
def little_work():
    """Limit the work of bounds."""
    with changed_effort(certificate_pairs=400_000, certificate_pairs_per_node=0):
        yield


def joints_at(one, node, posture, gamma, more, about):
    """Return the joints (C, n) of postures at nodes with gamma (C,) and other parameters (C, M)."""
    arm, tilted = one.robot.arm, one.settings.tilt is not None
    T, tilt = one.nominal_frames[node].copy(), np.zeros((len(node), 3))
    if tilted:
        tilt[:, :2] = more[:, :2]
    turn = Rotation.from_rotvec(gamma[:, None] * [0.0, 0.0, 1.0])
    T[:, :3, :3] = T[:, :3, :3] @ (Rotation.from_rotvec(tilt) * turn).as_matrix()
    x = more[:, 2 * tilted :]
    if one.robot.externals:
        T = np.linalg.inv(base_in_part(one.robot.externals, x)) @ T
    solved, reach = arm.inverse_all(T @ np.linalg.inv(one.T_flange_tip))
    each = np.arange(len(node)), posture
    q = np.where(reach[each][:, None], solved[each], np.nan)
    q += 2 * np.pi * np.round((about[:, : arm.joints] - q) / (2 * np.pi))
    return np.concatenate([q, x], axis=1)


def random_motions(one, count, seed):
    """Return the costs of smooth motions near a plan that keep all its limits."""
    rng, K = np.random.default_rng(seed), len(one.q)
    limits, dt = one.settings.limits(one.robot), one.dt
    ranges, costs = one.robot.joint_limits(), []
    knots = np.linspace(0, K - 1, 4)
    at = np.zeros((K, 0))
    if one.settings.tilt is not None:
        H, along = one.contour.frames(one.settings.frames)[:, :3, :3], one.contour.along
        turn = one.tilt[:, 1:] * along + one.tilt[:, :1] * np.cross(H[:, :, 2], along)
        at = np.einsum("kij,ki->kj", H, turn)[:, :2]
    at = np.concatenate([at, one.q[:, one.robot.arm.joints :]], axis=1)
    for _ in range(count):
        size = 10 ** rng.uniform(-4, -1)
        smooth = CubicSpline(knots, rng.normal(0, size, (4, 1 + at.shape[1])))(np.arange(K))
        gamma, more = one.gamma + smooth[:, 0], at + smooth[:, 1:]
        if one.settings.tilt is not None:
            length = np.hypot(*more[:, :2].T)
            more[:, :2] *= np.minimum(1, CONE / np.maximum(length, 1e-12))[:, None]
        q = joints_at(one, np.arange(K), one.posture, gamma, more, one.q)
        u = np.diff(q, axis=0)
        kept = np.isfinite(q).all() and (q >= ranges.lower).all() and (q <= ranges.upper).all()
        kept = kept and (np.abs(u) <= limits.velocity.per_interval(dt)).all()
        if kept and (np.abs(np.diff(u, axis=0)) <= limits.acceleration.per_interval(dt)).all():
            costs.append(path_cost(u, one.settings.weights, one.settings.metric, "sum"))
    return np.array(costs)


@pytest.fixture(scope="module")
def short():
    """A short wavy line, 9 nodes."""
    y = np.linspace(-0.2, 0.2, 129)
    points = np.c_[0.06 * np.sin(9 * y), y, 0 * y]
    axes = np.c_[0.3 * np.sin(6 * y), 0 * y, -np.ones(len(y))]
    return Contour(points, axes, name="wave").resample(count=9)


@pytest.fixture(scope="module")
def made(plans, short, arm, tool, placement):
    """Give a plan with more than gamma free; each is made once."""
    kept = {}

    def of(case):
        if case in kept:
            return kept[case]
        if case in ("manhattan", "euclid", "chebychev"):
            made = plans(metric=case, tilt=Tilt(cone=CONE))
        else:
            each = arm
            if case in ("rail", "both"):
                each = each.on_rail([0, 1, 0], lower=-0.3, upper=0.4, velocity=1, acceleration=2)
            if case in ("table", "both"):
                each = each.with_positioner(
                    [0, 0, 1], placement[:3, 3], lower=-0.4, upper=0.3, velocity=1, acceleration=2
                )
            made = plan(short, each, tool=tool, placement=placement, speed=0.2, certify=None)
        kept[case] = made
        return made

    return of


CASES = ("manhattan", "euclid", "chebychev", "rail", "table", "both")


@pytest.mark.parametrize("case", [pytest.param("manhattan", marks=pytest.mark.slow), "rail"])
def test_the_costliest_step_is_bounded_too(made, case):
    one = made(case)
    asked = replace(one.settings, objective="max")
    cost = path_cost(one.increments, asked.weights, asked.metric, "max")
    with changed_effort(minimax_pairs=200_000):
        found = certify(replace(one, settings=asked, cost=cost))
    assert 0 <= found.plan.proof.bound <= cost


@pytest.mark.parametrize("case", CASES)
def test_no_step_costs_less_than_its_cells_say(made, case):
    """Of steps drawn at random, with the true joints: rho + V' - V is no less than zero."""
    one, rng = made(case), np.random.default_rng(3)
    steps = bound_steps(one)
    maker = cell_maker(one, steps.weight)
    nodes = np.unique(np.linspace(0, len(one.q) - 1, 4).astype(int))
    own = one.gamma[nodes], maker.parameters(one.q[nodes]), one.posture[nodes].astype(int)
    slopes = motion_slopes(maker, nodes, *own, steps)
    assert slopes is not None
    cells = maker.coarsest(nodes)
    cells = maker.halves(cells.take(np.isin(cells.posture, np.unique(one.posture))))
    result = solve_stage(cells, steps, care=one.cost, given=slopes[:, None])
    cells = result.cells
    gamma, half = cell_bounds(cells.level, cells.index)
    assert half == pytest.approx(np.pi / BASE / 2.0**cells.level)
    t = rng.uniform(-1, 1, len(cells)) * half
    s = rng.uniform(-1, 1, cells.reach.shape) * cells.reach
    about = cells.center + (cells.slope + cells.bend * t[:, None] / 2) * t[:, None]
    about = about + np.einsum("cmi,cm->ci", cells.tied, s)
    q = joints_at(one, cells.node, cells.posture.astype(int), gamma + t, cells.at + s, about)
    good = np.isfinite(q).all(axis=1) & np.isfinite(result.level[:, 0])
    assert (np.abs(q - about) <= cells.spread + 1e-9)[good].all()
    value = result.level - np.einsum("cmi,ci->cm", result.dual, q - cells.center)
    value = value.max(axis=1)
    tried = 0
    for k in range(len(nodes) - 1):
        here, there = (np.flatnonzero(good & (cells.node == nodes[k + i])) for i in (0, 1))
        if k == len(nodes) - 2:
            value[there] = 0.0
        u = q[there][None] - q[here][:, None]
        u = np.where(steps.endless, u - 2 * np.pi * np.round(u / (2 * np.pi)), u)
        near = (np.abs(u) <= steps.over(int(nodes[k + 1] - nodes[k])).velocity).all(axis=-1)
        for i, j in zip(*np.nonzero(near), strict=True):
            cost = rho(u[i, j], steps.weight, steps.metric)
            assert cost + value[there[j]] - value[here[i]] >= -1e-9
            tried += 1
    assert tried > 1000


@pytest.mark.parametrize("case", CASES)
def test_every_place_is_in_a_cell(made, case):
    """Joints at random parameters are in a cell of their posture, before and after halving."""
    one, rng = made(case), np.random.default_rng(4)
    steps = bound_steps(one)
    maker = cell_maker(one, steps.weight)
    node, count = len(one.q) // 2, 200
    cells = maker.coarsest(np.array([node]))
    finer = maker.halves(maker.halves(cells))
    gamma = rng.uniform(-np.pi, np.pi, count)
    first = maker.room(np.zeros((1, cells.at.shape[1])), 9.0)
    more = rng.uniform(first[0][0, 1:], first[1][0, 1:], (count, cells.at.shape[1]))
    if one.settings.tilt is not None:
        more[:, :2] *= np.minimum(1, CONE / np.hypot(*more[:, :2].T))[:, None]
    ranges, found = one.robot.joint_limits(), 0
    for posture in range(one.robot.postures):
        each = np.full(count, node), np.full(count, posture)
        q = joints_at(one, *each, gamma, more, np.zeros((count, 6)))
        good = np.isfinite(q).all(axis=1)
        good &= ((q >= ranges.lower) & (q <= ranges.upper)).all(axis=1)
        for g, s, joints in zip(gamma[good], more[good], q[good], strict=True):
            for some in (cells, finer):
                mine = some.take(some.posture == posture)
                middle, half = cell_bounds(mine.level, mine.index)
                t = (g - middle)[:, None]
                off = s - mine.at
                poly = mine.center + mine.slope * t + mine.bend * t**2 / 2
                poly = poly + np.einsum("cmi,cm->ci", mine.tied, off)
                inside = (np.abs(t[:, 0]) <= half) & (np.abs(off) <= mine.reach).all(axis=1)
                apart = joints - poly
                apart -= ranges.endless * (2 * np.pi * np.round(apart / (2 * np.pi)))
                known = (np.abs(apart) <= mine.spread + 1e-9).all(axis=1)
                assert (inside & known).any()
            found += 1
    assert found > 100


@pytest.mark.parametrize("case", CASES)
def test_no_motion_costs_less_than_the_bound(made, case, arc, short, arm, tool, placement):
    one = made(case)
    found = certify(one)
    proof = found.plan.proof
    assert proof.bound is not None
    assert 0 <= proof.bound <= one.cost
    assert proof.gap == pytest.approx((one.cost - proof.bound) / one.cost, abs=1e-15)
    assert proof.certificate is None
    assert "; the bound holds for any " in found.statement
    assert proof.without_bound().statement == one.proof.statement
    assert [issue for issue in audit(found.plan) if issue.severity == "error"] == []
    costs = random_motions(one, 200, seed=6)
    assert len(costs) > 5
    assert costs.min() >= proof.bound
    if case == "manhattan":
        smaller = replace(one.settings.tilt, cone=CONE / 2)
        other = plan(
            arc, arm, tool=tool, placement=placement, speed=0.3, certify=None, tilt=smaller
        )
        assert other.cost >= proof.bound


@pytest.mark.slow
def test_the_bound_is_below_a_dense_search(made, short, tool, placement):
    one = made("table")
    (axis,) = one.robot.externals
    dense = PlanOptions(method="exact", gamma_step=np.radians(10), certify=None)
    gridded = replace(one.robot, externals=(replace(axis, step=0.1),))
    best = plan(short, gridded, tool=tool, placement=placement, speed=0.2, options=dense)
    with changed_effort(certificate_pairs=5_000_000):
        bound = certify(one).plan.proof.bound
    assert 0.3 * one.cost < bound <= best.cost


def test_a_vanishing_tilt_leaves_the_bound_of_none(plans):
    tiny = plans(metric="manhattan", tilt=Tilt(cone=1e-6))
    plain = certify(replace(tiny, settings=replace(tiny.settings, tilt=None)), gap=0.01)
    found = certify(tiny, gap=0.01)
    assert found.plan.proof.gap <= 0.01 + 1e-12
    assert plain.plan.proof.gap <= 0.01 + 1e-12


def test_a_smaller_cone_has_a_closer_bound(made):
    one = made("manhattan")
    gaps = []
    for cone in (CONE, CONE / 4):
        asked = replace(one.settings, tilt=Tilt(cone=cone))
        gaps.append(certify(replace(one, settings=asked)).plan.proof.gap)
    assert gaps[1] < gaps[0] < 0.6


def test_more_work_never_lowers_the_bound(made):
    bounds = []
    for most in (30_000, 300_000, 1_500_000):
        with changed_effort(certificate_pairs=most, certificate_pairs_per_node=0):
            bounds.append(certify(made("rail")).plan.proof.bound)
    assert bounds == sorted(bounds)
    assert bounds[-1] > 0


def test_a_plan_with_a_reduced_feed_has_a_bound(plans):
    """Its intervals count as long as the longest; motions that keep the limits cost no less."""
    even = plans(metric="manhattan")
    slower = np.diff(even.time) * (1 + np.sin(np.linspace(0, np.pi, len(even.q) - 1)))
    dip = Feed(full=0.0, slowest=0.5, node=15, joint=0, limit="velocity")
    timed = replace(even, time=np.append(0.0, np.cumsum(slower)), feed=dip)
    found = certify(timed)
    assert "; the bound holds for motions at the times of this plan" in found.statement
    assert found.plan.proof.certificate is None
    assert 0.5 * timed.cost < found.plan.proof.bound <= timed.cost
    costs = random_motions(even, 100, seed=6)  # at these times, too, as they are slower
    assert costs.min() >= found.plan.proof.bound
