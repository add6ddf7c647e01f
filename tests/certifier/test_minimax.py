"""The bound of the objective "max": no motion has only cheaper steps."""

from dataclasses import replace

import numpy as np
import pytest

from kerfpath import plan
from kerfpath.certificate import BASE
from kerfpath.certifier import bound, certify, minimax
from kerfpath.certifier.cells import CellMaker
from kerfpath.certifier.stages import arranged
from kerfpath.kernels.metric import rho
from kerfpath.kernels.minimax import LargestStep, lay_largest
from kerfpath.refiner.joint_curves import JointCurves

METRICS = ("manhattan", "euclid", "chebychev")


@pytest.fixture(scope="module")
def made(plans):
    """Give the plan of the arc in a metric, with the least costliest step; each is made once."""
    return lambda metric: plans(metric=metric, objective="max")


def potential_of(one, steps, halvings, folded=None):
    """Return cells of all nodes, and their potential."""
    maker = CellMaker(one.robot, one.frames, one.T_flange_tip, (0, 1), folded=folded)
    steps = replace(steps, endless=maker.endless)
    cells = maker.coarsest(np.arange(len(one.q)))
    for _ in range(halvings):
        cells = maker.halves(cells)
    cells, packed, nodes, _ = arranged(cells, steps)
    lead = np.argmax(np.abs(packed.slope) / steps.velocity, axis=1)
    C = len(cells)
    found = LargestStep(np.zeros((C, 2)), np.zeros((C, 2)), np.zeros(C))
    for k in range(len(nodes) - 2, -1, -1):
        lay_largest(packed, steps.over(1), lead, k, found)
    return cells, steps, found


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize("folds", [False, True])
def test_no_motion_has_only_steps_below_the_potential(made, metric, folds):
    """Of motions through points drawn on the cells, with the true joints."""
    one, rng = made(metric), np.random.default_rng(5)
    steps = minimax._capped(bound.bound_steps(one), 3 * one.cost)
    folded = np.arange(6) == 5 if folds else None
    cells, steps, found = potential_of(one, steps, 1, folded)
    t = rng.uniform(-1, 1, len(cells)) * cells.half
    gamma = -np.pi + 2 * np.pi / (BASE * 2.0**cells.level) * (cells.index + 0.5) + t
    about = cells.center + (cells.slope + cells.bend * t[:, None] / 2) * t[:, None]
    curves = JointCurves(one.robot, one.frames[cells.node], one.T_flange_tip, cells.posture)
    q = curves.at(gamma[:, None], about)
    good = np.isfinite(q).all(axis=1)
    least = np.where(cells.node == len(one.q) - 1, 0.0, np.inf)  # of the points' motions
    tried = 0
    for k in range(len(one.q) - 2, -1, -1):
        here, there = (np.flatnonzero(good & (cells.node == k + i)) for i in (0, 1))
        u = q[there][None] - q[here][:, None]
        u = np.where(steps.endless, u - 2 * np.pi * np.round(u / (2 * np.pi)), u)
        for i, j in zip(*np.nonzero((np.abs(u) <= steps.velocity).all(axis=-1)), strict=True):
            cost = max(rho(u[i, j], steps.weight, steps.metric), least[there[j]])
            least[here[i]] = min(least[here[i]], cost)
            tried += 1
    assert tried > 1000
    passed = good & (least <= steps.most)
    assert passed[cells.node == 0].any()
    value = (found.level + found.along * t[:, None]).max(axis=1)
    # Rounding of the kinematics in floats.
    assert (value[passed] <= least[passed] + 1e-9).all()
    assert (found.least[passed] <= value[passed] + 1e-12).all()
    assert (value[passed] > 0.5 * least[passed]).mean() > 0.5  # and it says something


@pytest.mark.parametrize("metric", METRICS)
def test_the_bound_is_close_below_the_plan_and_every_other_motion(
    made, metric, arc, arm, tool, placement
):
    best = made(metric)
    found = certify(best, gap=0.01)
    proof = found.plan.proof
    assert found.done
    assert 0.99 * best.cost <= proof.bound <= best.cost
    assert proof.gap == pytest.approx((best.cost - proof.bound) / best.cost, abs=1e-15)
    other = plan(
        arc, arm, tool=tool, placement=placement, speed=0.3, metric=metric, objective="max",
        method="exact", gamma_step=np.radians(2.0), certify=None,
    )  # fmt: skip
    assert proof.bound <= other.cost
    assert proof.certificate is None
    assert "no certificate to keep" in found.statement


def test_a_plan_that_costs_too_much_is_not_confirmed(made):
    """Though a bound at its cost is asked for, it stays below the best motion."""
    best = made("manhattan")
    dear = replace(best, cost=1.3 * best.cost)
    assert certify(dear, gap=1e-3).plan.proof.bound <= best.cost


def test_more_work_never_lowers_the_bound(made, monkeypatch):
    one, before = made("euclid"), 0.0
    for rounds in range(1, 5):
        left = iter(range(rounds))
        steps = bound.bound_steps(one)
        spent = lambda left=left: next(left, None) is None  # noqa: E731
        best, tried, _ = minimax.largest_step_bound(one, steps, 1e-3, spent, lambda *_: None)
        assert tried <= rounds
        assert before <= best <= one.cost
        before = best


def test_turns_unfold_when_a_round_gains_little(made, monkeypatch):
    """Joints that count as endless at first get their turns again, and the bound stays one."""
    one = made("manhattan")
    lifted = []
    real = CellMaker.lifted
    monkeypatch.setattr(minimax, "STALLED", 2.0)
    monkeypatch.setattr(minimax, "foldable", lambda *_: np.arange(6) == 5)

    def noted(maker, cells):
        lifted.append(real(maker, cells))
        assert np.isin(cells.node, lifted[-1].node).all()
        return lifted[-1]

    monkeypatch.setattr(CellMaker, "lifted", noted)
    proof = certify(one, gap=0.01).plan.proof
    assert 0.98 * one.cost <= proof.bound <= one.cost
    assert any(np.isfinite(cells.floor).all() for cells in lifted)
