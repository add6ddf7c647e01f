"""Tubes: no bound above a motion in them, and none left open where the work allows it."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from kerfpath import Certify, audit, plan
from kerfpath.certificate import LEAST_GAP
from kerfpath.certifier import bound as proving
from kerfpath.certifier import certify
from kerfpath.certifier.cells import cell_maker
from kerfpath.certifier.tube import Duals
from kerfpath.certifier.tubes import Tubes
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.planner import planning

SPEED = 0.96
"""m/s: 0.8 of the fastest at which the arc has a plan; (6) binds at nearly all of its nodes."""
METRICS = ("manhattan", "euclid", "chebychev")


@pytest.fixture(scope="module")
def short(arc, arm, tool, placement):
    """Plan the first nodes of the arc, where (6) binds; options on top."""

    def of(nodes=9, **asked):
        asked = {"speed": SPEED, "certify": None} | asked
        part = Contour(arc.points[:nodes], arc.axes[:nodes], closed=False, name="part")
        return plan(part, arm, tool=tool, placement=placement, **asked)

    return of


def tubes_of(one):
    """Return the tubes of a plan, with the cells of its posture."""
    steps = proving.bound_steps(one)
    maker = cell_maker(one, steps.weight)
    nodes = np.arange(len(one.q))
    made = Tubes(
        maker,
        steps,
        nodes,
        cost=one.cost,
        target=one.cost,
        enough=lambda *_: False,
        cheaper=lambda _: np.inf,
    )
    cells = maker.coarsest(nodes)
    return made, cells.take(cells.posture == one.posture[0]), steps


def tube_about(one, width):
    """Return a tube of about this half-width, rad, that holds a plan."""
    made, cells, steps = tubes_of(one)
    middle = (cells.index + 0.5) * (2 * np.pi / 72) - np.pi
    off = np.abs(np.angle(np.exp(1j * (middle - one.gamma[cells.node]))))
    rng = np.random.default_rng(3)
    shift = rng.uniform(-width, width, (2, len(one.q)))
    low, high = one.gamma - np.abs(shift[0]), one.gamma + np.abs(shift[1])
    tube = made._tube(cells.take(off <= cells.half), low, high)
    tube, _ = tube.with_ties(steps, made._program.spans)
    return made, tube, steps


@pytest.mark.parametrize("metric", METRICS)
def test_no_duals_bound_a_motion_in_the_tube_too_high(metric, short):
    """Whatever the duals: they are drawn at random, and those of the program are changed."""
    one = short(metric=metric)
    made, tube, steps = tube_about(one, 0.02)
    found = made._program.solve(tube)
    assert found.solved
    spans, rng = np.ones(len(one.q) - 1, np.int64), np.random.default_rng(5)
    own = tube.least(steps, spans, found.duals)
    assert 0.8 * one.cost < own <= one.cost  # (6) binds in a tube as narrow
    for size in (0.01, 0.1, 1.0, 10.0):
        for _ in range(20):
            y, nu, ties = found.duals
            y = y + size * rng.normal(size=y.shape) * steps.weight
            nu = nu + size * rng.normal(size=nu.shape) * steps.weight
            nu[[0, -1]] = 0.0
            ties = ties + size * rng.normal(size=ties.shape)
            assert tube.least(steps, spans, Duals(y, nu, ties)) <= one.cost


def test_the_bound_of_a_tube_closes_with_the_square_of_its_width(short):
    one, lack = short(), []
    for width in (0.02, 0.005):
        made, tube, steps = tube_about(one, width)
        found = made._program.solve(tube)
        own = tube.least(steps, made._program.spans, found.duals)
        lack.append(one.cost - own)
    assert lack[1] < lack[0] / 8  # 16 if nothing but the square counted


def test_a_tube_without_a_motion_is_proved_to_have_none(short):
    """Half the nodes are elsewhere: no step leads there, and the duals of the program prove it."""
    one = short()
    made, tube, steps = tube_about(one, 0.005)
    moved = np.where(np.arange(len(one.q)) < 4, 0.0, 3 * steps.velocity.max())
    apart = replace(tube, center=tube.center + moved[:, None])
    found = made._program.solve(apart)
    assert not found.solved
    assert apart.least(made._free, made._program.spans, found.duals) > 0
    assert tube.least(made._free, made._program.spans, found.duals) <= 0


def least_on_grid(one, width, step):
    """Slow and obvious: the cheapest of all motions on a grid of gamma near a plan that keep (6).

    The states are pairs of samples at neighbouring nodes.
    """
    steps = proving.bound_steps(one)
    maker = cell_maker(one, steps.weight)
    nodes = np.arange(len(one.q))
    off = np.arange(-width, width + step / 2, step)
    q = [
        maker.joints(np.full(len(off), k), one.gamma[k] + off, int(one.posture[k]))[0]
        for k in nodes
    ]
    u = [q[k + 1][None] - q[k][:, None] for k in nodes[:-1]]  # from sample to sample
    u = [each - 2 * np.pi * np.rint(each / (2 * np.pi)) for each in u]
    cost = [
        np.where((np.abs(each) <= steps.velocity).all(axis=-1), steps.distance(each), np.inf)
        for each in u
    ]
    upto = cost[0]
    for k in nodes[1:-1]:
        new = np.full_like(cost[k], np.inf)
        for b in range(len(off)):
            bent = np.abs(u[k][b][None] - u[k - 1][:, b][:, None]) <= steps.acceleration
            new[b] = np.where(bent.all(axis=-1), upto[:, b, None], np.inf).min(axis=0) + cost[k][b]
        upto = new
    return float(upto.min())


@pytest.mark.parametrize("metric", METRICS)
def test_a_gap_of_nothing_is_reached_and_no_dense_search_is_below(metric, short):
    """On few nodes the bound meets the plan, which is then the best motion there is."""
    one = short(6, metric=metric)
    found = certify(one, gap=0.0, seconds=60.0, checkable=False)
    assert found.done
    assert 0 < found.plan.proof.gap <= LEAST_GAP * (1 + 1e-9)
    dense = least_on_grid(one, np.radians(1.5), np.radians(0.05))
    assert found.plan.proof.bound <= dense < 1.05 * one.cost  # there are motions on the grid


@pytest.mark.slow
@pytest.mark.parametrize("nodes", [9, 20])
def test_no_motion_of_other_starts_costs_less_than_the_bound(nodes, short):
    best = short(nodes)
    proof = certify(best, gap=0.0, seconds=10.0, checkable=False).plan.proof
    for step in (1.0, 2.0, 5.0, 7.0):
        for posture in range(8):
            try:
                other = short(nodes, gamma_step=np.radians(step), postures=(posture,))
            except NoFeasiblePath:
                continue
            assert other.cost >= proof.bound
    if (
        nodes < 16
    ):  # tubes end before the time; with more nodes the machine decides how far they get
        usual = certify(best, checkable=False).plan.proof
        assert proof.bound >= usual.bound * (1 - 1e-3)


def test_a_gap_of_nothing_can_be_asked_for():
    assert Certify(gap=0).gap == 0.0


@pytest.fixture(scope="module")
def dear(short):
    """Return a plan in the second best posture, which may use all, and the best plan."""
    best, found = short(6), []
    for posture in range(8):
        with suppress(NoFeasiblePath):
            found.append(short(6, postures=(posture,)))
    worse = min((one for one in found if one.cost > 1.001 * best.cost), key=lambda one: one.cost)
    return replace(worse, settings=best.settings), best


def test_a_plan_takes_the_cheaper_motion_and_keeps_the_bound(
    dear, arc, arm, tool, placement, monkeypatch
):
    """More time never gives a worse plan, and the gap is that of the cost and the bound."""
    made, best = dear
    first = planning._planned
    monkeypatch.setattr(planning, "_planned", lambda *args: (made, first(*args)[1]))
    part = Contour(arc.points[:6], arc.axes[:6], closed=False, name="part")
    asked = Certify(gap=0, seconds=60)
    better = plan(part, arm, tool=tool, placement=placement, speed=SPEED, certify=asked)
    proof = better.proof
    assert better.cost == pytest.approx(best.cost, rel=1e-4)
    assert proof.bound <= better.cost
    assert proof.gap == pytest.approx((better.cost - proof.bound) / better.cost, abs=1e-12)
    assert proof.statement.count("no motion within the limits costs less") == 1
    assert audit(better) == []
    assert better.settings.certify == asked
