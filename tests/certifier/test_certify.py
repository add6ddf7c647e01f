"""The certifier: bounds that no motion beats, on cells that say nothing untrue."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from jobs import DEMO
from kerfpath import InputError, plan
from kerfpath.auditor import certified_bound
from kerfpath.certificate import BASE
from kerfpath.certifier import bound, certify, stages
from kerfpath.certifier.cells import CERTAIN_LEVEL, MORE_CELLS, CellMaker, foldable
from kerfpath.certifier.division import between, evenly, turning_nodes
from kerfpath.certifier.stages import Steps
from kerfpath.job import read_job
from kerfpath.kernels.metric import rho
from kerfpath.refiner.joint_curves import JointCurves

pytestmark = pytest.mark.usefixtures("certifier_at_work")
METRICS = ("manhattan", "euclid", "chebychev")


@pytest.fixture(scope="module")
def made(plans):
    """Give the plan of the arc in a metric; each is made once."""
    return lambda metric: plans(metric=metric)


def steps_of(one):
    limits, dt = one.settings.limits(one.robot), one.dt
    return Steps(
        weight=one.settings.weights,
        velocity=limits.velocity.per_interval(dt) + 1e-9,
        acceleration=limits.acceleration.per_interval(dt) + 1e-9,
        metric=bound.METRIC_CODES[one.settings.metric],
        endless=one.robot.endless,
    )


def maker_of(one, postures=(0, 1), folded=None):
    return CellMaker(one.robot, one.frames, one.T_flange_tip, postures, folded=folded)


@pytest.mark.slow
@pytest.mark.parametrize("metric", METRICS)
def test_the_bound_is_close_below_the_plan_and_every_other_motion(
    made, metric, arc, arm, tool, placement
):
    best = made(metric)
    found = certify(best, gap=0.01)
    proof = found.plan.proof
    assert proof.bound <= best.cost
    assert proof.gap == pytest.approx((best.cost - proof.bound) / best.cost, abs=1e-15)
    assert found.done == (proof.gap <= 0.01)
    # The Manhattan metric is bounded by linear functions, the others only near by.
    assert proof.gap < (0.01 if metric == "manhattan" else 0.2)
    for asked in (
        {"method": "exact", "gamma_step": np.radians(1.0)},
        {"method": "exact", "refine": True, "gamma_step": np.radians(2.0)},
        {"gamma_step": np.radians(7.0)},
    ):
        other = plan(arc, arm, tool=tool, placement=placement, speed=0.3, metric=metric, **asked)
        assert proof.bound <= other.cost


def planned_hole(name):
    """Return the plan of a hole of the demo's part."""
    job = read_job(DEMO / "b_pillar.toml")
    part = job.read_part()
    task = next(task for task in job.contours if task.name == name)
    nodes = task.sample(part.contour(task.pick))
    space = {"tool": job.tool, "placement": job.placement, "speed": task.speed}
    return plan(nodes, job.robot, options=replace(job.options, certify=None), **space)


@pytest.mark.parametrize("name", ["hole 20", "hole 25"])
def test_a_hole_of_the_demo_is_bounded_as_closely_as_plans_ask_for(name):
    """Slow cuts, where nodes between cells that are still coarse take bounds away."""
    assert certify(planned_hole(name), checkable=False).done


@pytest.mark.parametrize("name", ["hole 10", "hole 30 left"])
def test_the_audit_proves_the_bound_again(name):
    """By enclosures and sums of its own."""
    found = certify(planned_hole(name), gap=0.01)
    assert found.done
    again = certified_bound(found.plan.proof.certificate, found.plan)
    assert found.plan.proof.bound <= again <= found.plan.cost


@pytest.mark.parametrize(
    ("metric", "tilted", "folds", "stride"),
    [
        *product(METRICS, [False], [False], [3]),
        *product(METRICS, [True], [False], [1, 3]),
        ("manhattan", True, True, 1),
    ],
)
def test_no_step_costs_less_than_its_cells_say(made, metric, tilted, folds, stride):
    """Of steps drawn at random, with the true joints: rho + mu u + V' - V is no less."""
    one, rng = made(metric), np.random.default_rng(3)
    steps = steps_of(one)
    maker = maker_of(one, folded=foldable(one.robot, steps.velocity) if folds else None)
    assert folds == (maker.endless != one.robot.endless).any()
    steps = replace(steps, endless=maker.endless)
    nodes = np.arange(0, len(one.q), stride)
    spans = np.diff(nodes)
    cells = maker.halves(maker.coarsest(nodes))
    nu = np.zeros_like(one.q[nodes])
    if tilted:
        nu[1:-1] = rng.normal(size=nu[1:-1].shape) * one.settings.weights
    result = stages.solve_stage(cells, steps, nu if tilted else None, care=one.cost)
    cells = result.cells
    # Which cells a curve passes, node by node: through points of every cell.
    t = rng.uniform(-1, 1, len(cells)) * cells.half
    gamma = -np.pi + 2 * np.pi / (BASE * 2.0**cells.level) * (cells.index + 0.5) + t
    about = cells.center + (cells.slope + cells.bend * t[:, None] / 2) * t[:, None]
    curves = JointCurves(one.robot, one.frames[cells.node], one.T_flange_tip, cells.posture)
    q = curves.at(gamma[:, None], about)
    good = np.isfinite(q).all(axis=1) & np.isfinite(result.level[:, 0])
    # Rounding of the kinematics in floats.
    assert (np.abs(q - about) <= cells.spread + 1e-9)[good].all()
    off = q - cells.center
    value = (result.level - np.einsum("cmi,ci->cm", result.dual, off)).max(axis=1)
    cheapest = np.full(len(nodes), np.inf)
    tried = 0
    for k in range(len(nodes) - 1):
        here, there = (np.flatnonzero(good & (cells.node == nodes[k + i])) for i in (0, 1))
        if k == len(nodes) - 2:
            value[there] = 0.0
        u = q[there][None] - q[here][:, None]
        u = np.where(steps.endless, u - 2 * np.pi * np.round(u / (2 * np.pi)), u)
        step = steps.tilted(nu, spans, k)
        assert step.velocity == pytest.approx(stride * steps.velocity)
        a, b = np.nonzero((np.abs(u) <= step.velocity).all(axis=-1))
        for i, j in zip(a, b, strict=True):
            cost = rho(u[i, j], steps.weight, steps.metric) + step.tilt @ u[i, j]
            reduced = cost + value[there[j]] - value[here[i]]
            cheapest[k] = min(cheapest[k], reduced)
            tried += 1
    assert tried > 1000
    # The cheapest way on from any cell costs nothing beyond its potential, and no step less.
    assert cheapest[:-1].min() >= -1e-9


@pytest.mark.parametrize("metric", METRICS)
def test_a_joint_may_cost_nothing(arc, arm, tool, placement, metric):
    """A weight of zero: the bound is there, below the plan and below the best of a grid."""
    made = plan(
        arc, arm, tool=tool, placement=placement, speed=0.6, metric=metric,
        weights=[25, 25, 25, 15, 15, 0], gamma_step=np.radians(6), certify=None,
    )  # fmt: skip
    proof = certify(made, gap=0.2).plan.proof
    assert 0 < proof.bound <= made.cost
    exact = plan(arc, arm, tool=tool, placement=placement, speed=0.6, options=replace(
        made.settings, method="exact", gamma_step=np.radians(2)
    ))  # fmt: skip
    assert proof.bound <= exact.cost


@pytest.mark.parametrize("metric", METRICS)
def test_the_plan_itself_passes_cells_that_let_it(made, metric):
    one = made(metric)
    steps, cells = steps_of(one), maker_of(one).coarsest(np.arange(len(one.q)))
    for _ in range(3):
        result = stages.solve_stage(cells, steps, care=one.cost)
        cells = result.cells
        for k, (q, gamma) in enumerate(zip(one.q, one.gamma, strict=True)):
            middle = -np.pi + 2 * np.pi / (BASE * 2.0**cells.level) * (cells.index + 0.5)
            away = np.abs((gamma - middle + np.pi) % (2 * np.pi) - np.pi)
            off = q - cells.center
            off = np.where(steps.endless, off - 2 * np.pi * np.round(off / (2 * np.pi)), off)
            on = (cells.node == k) & (cells.posture == one.posture[k]) & (away <= cells.half)
            on &= (np.abs(off) <= cells.box + 1e-9).all(axis=1)
            assert on.any()
            assert result.through[on].min() <= one.cost
        cells = maker_of(one).halves(cells)


@pytest.mark.slow
@pytest.mark.parametrize("dropped", [0.02, 1.0])
@pytest.mark.parametrize("metric", METRICS)
def test_the_certificate_has_what_proves_its_bound(made, metric, dropped, monkeypatch):
    """Of stages that are left out one may be the best: the next may prove less."""
    one, bounds = made(metric), []
    solve = bound.solve_stage

    def noted(*given, **named):
        result = solve(*given, **named)
        # Every third stage proves more than those around it.
        if len(bounds) % 3 == 1:
            result = replace(result, through=result.through + 1e-4 * one.cost)
        bounds.append(result)
        return result

    monkeypatch.setattr(bound, "solve_stage", noted)
    monkeypatch.setattr(bound, "DROPPED", dropped)
    found = certify(one, gap=0.004)
    best = max(bounds, key=lambda result: result.bound)
    stages = found.plan.proof.certificate.stages
    assert any(np.array_equal(best.stage().value, stage.value) for stage in stages)
    # In the order in which they were found.
    values = [result.stage().value for result in bounds]
    order = [next(i for i, v in enumerate(values) if np.array_equal(v, s.value)) for s in stages]
    assert order == sorted(order)


def test_more_work_never_lowers_the_bound(made):
    """Unless what is asked for is reached: the stages to a smaller gap are others."""
    one, before = made("manhattan"), 0.0
    for gap in (0.5, 0.05, 0.005):
        bound = certify(one, gap=gap).plan.proof.bound
        assert bound >= min(before, (1 - gap) * one.cost)
        before = bound


def test_the_same_plan_has_the_same_certificate(made):
    one, two = (certify(made("manhattan"), gap=0.02).plan.proof.certificate for _ in range(2))
    assert one.bound == two.bound
    for a, b in zip(one.stages, two.stages, strict=True):
        np.testing.assert_array_equal(a.value, b.value)
        np.testing.assert_array_equal(a.dual, b.dual)


def test_a_motion_passes_a_cell_at_each_node():
    """The node whose cheapest cell costs most: node 0 has 1, node 1 has 2, node 2 has 4."""
    node = np.array([0, 1, 0, 2, 1], np.int32)
    through = np.array([3.0, 5.0, 1.0, 4.0, 2.0])
    assert stages.least_over_layers(node, through) == 4.0
    assert stages.least_over_layers(node[:0], through[:0]) == np.inf


def test_cells_with_uncertain_joints_are_halved_first(made):
    """No more of them than stated; and no cell is lost that the plan passes."""
    one = made("manhattan")
    maker, weight = maker_of(one), one.settings.weights
    before = maker.coarsest(np.arange(len(one.q)))
    worth = float(np.quantile(before.unsure @ weight, 0.9))
    cells = maker.certain(before, weight, worth)
    assert len(cells) <= MORE_CELLS * len(before)
    left = cells.unsure @ weight > worth
    assert not left.any() or (cells.level[left] == CERTAIN_LEVEL).all()
    assert cells.level[cells.posture == one.posture[0]].min() == 0
    middle = -np.pi + 2 * np.pi / (BASE * 2.0**cells.level) * (cells.index + 0.5)
    for k, (gamma, posture) in enumerate(zip(one.gamma, one.posture, strict=True)):
        away = np.abs((gamma - middle + np.pi) % (2 * np.pi) - np.pi)
        assert ((cells.node == k) & (cells.posture == posture) & (away <= cells.half)).any()
    few = maker.certain(before, weight, 0.0)
    assert len(few) <= MORE_CELLS * len(before)


def test_a_cell_keeps_what_an_earlier_stage_has_proved(made):
    one = made("manhattan")
    cells = maker_of(one).coarsest(np.arange(len(one.q)))
    result = stages.solve_stage(cells, steps_of(one), care=one.cost)
    known = np.where(result.cells.index % 2 == 0, 0.9 * one.cost, -np.inf)
    floored = replace(result, cells=replace(result.cells, floor=known)).floored()
    assert (floored.through == np.maximum(result.through, known)).all()
    assert (floored.cells.floor == floored.through).all()
    assert result.bound <= floored.bound <= one.cost
    half = maker_of(one).halves(floored.cells)
    assert set(half.floor) <= set(floored.through)


def test_nodes_where_a_plan_turns(made):
    one = made("manhattan")
    weight, last = one.settings.weights, len(one.q) - 1
    nodes = turning_nodes(
        one.increments, weight, bound.METRIC_CODES["manhattan"], 1e-3, evenly(last, 8)
    )
    assert nodes[0] == 0
    assert nodes[-1] == len(one.q) - 1
    assert np.diff(nodes).max() <= 8
    q = np.vstack([np.zeros(6), np.cumsum(one.increments, axis=0)])
    straight = sum(rho(u, one.settings.weights, 1) for u in np.diff(q[nodes], axis=0))
    assert straight >= one.cost * (1 - 1e-3) - 1e-12
    more = between(nodes)
    assert set(nodes) <= set(more)
    assert np.diff(more).max() <= 4


def test_what_is_not_proved_says_why(made):
    found = certify(replace(made("manhattan"), cost=0.0))
    assert not found.done
    assert found.plan.proof.bound is None
    assert found.statement == "no bound is proved: its cost is not above 0"


@pytest.mark.parametrize("bad", [{"gap": -1.0}, {"seconds": 0.0}, {"gap": np.nan}])
def test_a_gap_is_not_negative_and_a_time_positive(made, bad):
    (name,) = bad
    with pytest.raises(InputError, match=name):
        certify(made("manhattan"), **bad)
