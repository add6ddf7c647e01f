"""Bounds with multipliers of (6): true whatever the multipliers, and close where (6) binds."""

from itertools import pairwise

import numpy as np
import pytest

from from_python import from_python
from kerfpath import plan
from kerfpath.certificate import cell_bounds
from kerfpath.certifier import bound as proving
from kerfpath.certifier import certify
from kerfpath.certifier import stages as stage
from kerfpath.certifier.multipliers import limit_prices
from kerfpath.certifier.stages import Steps, bend_of, cross_bends, solve_stage
from kerfpath.kernels import cell_elimination
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import CHEBYCHEV, EUCLID, MANHATTAN

METRICS = ("manhattan", "euclid", "chebychev")
SPEED = 0.96
"""m/s: 0.8 of the fastest at which the arc has a plan; (6) binds at nearly all of its nodes."""


@pytest.fixture(scope="module")
def planned(arc, arm, tool, placement):
    """Plan the arc; options on top."""

    def of(**asked):
        asked = {"speed": SPEED, "certify": None} | asked
        return plan(arc, arm, tool=tool, placement=placement, **asked)

    return of


@pytest.fixture(scope="module")
def others(planned):
    """Costs of other motions, each found once."""
    return {
        m: [planned(metric=m, gamma_step=np.radians(step)).cost for step in (1.0, 3.0, 7.0)]
        for m in METRICS
    }


def every(stride, first, last):
    """Nodes a number of intervals apart, the last ones closer."""
    return np.append(np.arange(first, last, stride), last)


def course_of(one, gap=0.1):
    most = proving.most_pairs(len(one.q))
    return proving._Certification(
        one, proving.bound_steps(one), gap, np.inf, most, False, lambda *_: None
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "stride", "metric"),
    [
        (0.0, 1, "manhattan"),
        (1.0, 1, "chebychev"),
        (1.0, 2, "euclid"),
        (30.0, 1, "euclid"),
        (5.0, 4, "manhattan"),
    ],
)
def test_any_multipliers_bound_no_motion_too_high(
    metric, size, stride, planned, others, monkeypatch
):
    """Drawn at random, of either sign: the bound stays below every motion that is known."""
    best = planned(metric=metric)
    rng = np.random.default_rng(int(size))

    def drawn(self, nodes, gamma, posture, reach, most):
        prices = np.zeros((len(nodes), best.q.shape[1]))
        prices[1:-1] = size * rng.normal(size=prices[1:-1].shape) * best.settings.weights
        return prices

    monkeypatch.setattr(proving._Certification, "_prices", drawn)
    monkeypatch.setattr(Steps, "layers", lambda self, first, last: every(stride, first, last))
    monkeypatch.setattr(proving._Certification, "_priced", True)
    bound = certify(best, checkable=False).plan.proof.bound
    assert 0 <= bound <= min(best.cost, *others[metric])


@pytest.mark.slow
@pytest.mark.parametrize("metric", ["manhattan", "euclid"])
def test_the_multipliers_of_a_plan_bound_it_closer(metric, planned, others, monkeypatch):
    best = planned(metric=metric)
    with_them = certify(best, checkable=False).plan.proof
    monkeypatch.setattr(proving._Certification, "_priced", False)
    without = certify(best, checkable=False).plan.proof
    assert with_them.bound <= min(best.cost, *others[metric])
    assert with_them.gap < without.gap


@pytest.mark.slow
def test_the_cheapest_cells_are_joined_by_steps(planned):
    """They stand for a motion: prices about it show where it breaks (6)."""
    one = course_of(planned())
    result = solve_stage(one.maker.coarsest(np.arange(one.last + 1)), one.steps)
    motion = result.cheapest()
    assert result.cells.node[motion].tolist() == list(range(one.last + 1))
    for a, b in pairwise(motion):
        assert b in result.to[result.begin[a] : result.begin[a + 1]]
    # Rounding apart, each is on a motion that costs the least.
    assert result.through[motion] == pytest.approx(result.bound, rel=1e-9)


def test_a_certificate_is_there_for_those_who_check_it_only(planned):
    best = planned(speed=0.3)
    assert certify(best, gap=0.3).plan.proof.certificate is not None
    assert certify(best, gap=0.3, checkable=False).plan.proof.certificate is None


def test_multipliers_ask_for_cells_at_every_node(planned):
    one = course_of(planned(speed=0.3))
    cells = one.maker.coarsest(one.nodes)
    with pytest.raises(ValueError, match="at each of their nodes"):
        solve_stage(cells, one.steps, np.zeros((one.last + 1, 6)))


def steps(metric=MANHATTAN, acceleration=1.0):
    return Steps(
        weight=np.array([2.0, 1.0]),
        velocity=np.full(2, 10.0),
        acceleration=np.full(2, acceleration),
        metric=metric,
        endless=np.zeros(2, np.bool_),
    )


EACH = np.ones(2, int)
"""Layers at neighbouring nodes."""


@pytest.mark.parametrize("metric", [MANHATTAN, EUCLID, CHEBYCHEV])
@pytest.mark.parametrize(("most", "price"), [(5.0, 1.0), (0.5, 0.5)])
def test_the_price_of_a_limit_that_binds(most, price, metric):
    """Worked by hand: the second increment d of joint 2 costs d, and (6) asks for |d - 1| <= 0.8.

    A limit wider by e saves e: the price is the weight 1 of the joint, or the most that is allowed,
    and its sign that of the change d - 1.
    """
    u = np.array([[0.0, 1.0], [0.0, 0.0]])
    slope = np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
    prices = limit_prices(u, slope, steps(metric, 0.8), EACH, reach=0.5, most=most)
    assert not prices[[0, -1]].any()
    # The solver's own tolerance.
    np.testing.assert_allclose(prices[1], [0.0, -price], atol=1e-5)


@pytest.mark.parametrize(("before", "after"), [(1, 1), (2, 2), (3, 1), (2, 5)])
def test_the_price_of_a_limit_between_long_steps(before, after):
    """As above with means of the increments: d / after, and (6) at 0.8 between the two means.

    A limit wider by e saves e times the intervals of the second step.
    """
    u = np.array([[0.0, float(before)], [0.0, 0.0]])
    slope = np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
    apart = (before + after) / 2
    spans = np.array([before, after])
    given = steps(MANHATTAN, 0.8 / apart)
    prices = limit_prices(u, slope, given, spans, reach=0.5 * after, most=50.0)
    np.testing.assert_allclose(prices[1], [0.0, -after], atol=1e-4)
    # The motion with d = 0.2 after keeps (6) and costs its length: the prices add nothing.
    keeps = np.array([0.0, before, before + 0.2 * after])
    u = np.diff(keeps)
    tilted = [given.tilted(prices, spans, k).tilt[1] * u[k] for k in range(2)]
    assert sum(tilted) - given.price(prices, spans) == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize(("before", "after"), [(1, 1), (2, 2), (1, 3), (4, 3)])
def test_means_of_increments_differ_by_no_more_than_the_limit_of_long_steps(before, after):
    """Of increments drawn at random, and with the largest acceleration throughout, where it is met.

    The rest is the tolerance of the limit.
    """
    rng = np.random.default_rng(5)
    bend = bend_of(before, after)
    bound = 0.7 * bend.apart + 2 * LIMIT_TOLERANCE
    change = np.vstack([np.full(before + after - 1, 0.7), -np.full(before + after - 1, 0.7),
                        rng.uniform(-0.7, 0.7, (500, before + after - 1))])  # fmt: skip
    u = np.cumsum(np.pad(change, ((0, 0), (1, 0))), axis=1)
    first, second = u[:, :before].sum(axis=1), u[:, before:].sum(axis=1)
    differ = np.abs(bend.two * second - bend.one * first)
    assert (differ <= bound).all()
    assert differ[:2] == pytest.approx(bound, abs=3 * LIMIT_TOLERANCE)


def test_prices_of_the_metrics_differ_where_joints_share_a_step():
    """Worked by hand: (6) asks for a second increment d >= 0.2 of joint 2, beside one of joint 1.

    Joint 1 (of weight 2) moves by 0.3: d costs 1 with "manhattan", d / sqrt(0.36 + d^2) with
    "euclid", and nothing with "chebychev", as long as it is below 0.6.
    """
    u = np.array([[0.3, 1.0], [0.3, 0.0]])
    slope = np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
    found = [
        -limit_prices(u, slope, steps(metric, 0.8), EACH, reach=0.5, most=5.0)[1, 1]
        for metric in (MANHATTAN, EUCLID, CHEBYCHEV)
    ]
    assert found == pytest.approx([1.0, 0.2 / np.hypot(0.6, 0.2), 0.0], abs=1e-4)


def test_no_prices_where_nothing_near_breaks_the_limit():
    u = np.array([[0.0, 1.0], [0.0, 0.5], [0.0, 0.2]])
    slope = np.tile([0.0, 1.0], (4, 1))
    spans = np.ones(3, int)
    assert limit_prices(u, slope, steps(acceleration=100.0), spans, reach=0.5, most=5.0) is None


@pytest.mark.slow
@pytest.mark.parametrize("metric", METRICS)
def test_a_plan_at_the_limit_has_prices(metric, planned):
    one = course_of(planned(metric=metric), 0.005)
    posture = int(one.plan.posture[0])
    assert one._priced
    nodes = np.arange(one.last + 1)
    for most in proving.DEAREST:
        prices = one._prices(nodes, one.plan.gamma, posture, proving.NARROW, most)
        assert one.steps.price(prices, np.diff(nodes)) > 0
        assert (np.abs(prices) <= most * one.steps.weight * (1 + 1e-6)).all()


def through_pairs(packed, steps, spans, result, most):
    """Slow and obvious: every pair of steps is tested, and every state kept."""
    step, layer = steps.over(1), np.repeat(np.arange(len(packed.start) - 1), np.diff(packed.start))
    lead = np.argmax(np.abs(packed.slope) / steps.acceleration, axis=1)
    begin, to, cost, behind = result
    onward = [list(range(begin[a], begin[a + 1])) for a in range(len(packed.half))]
    ending = [np.flatnonzero(to == a) for a in range(len(packed.half))]
    origin = np.repeat(np.arange(len(packed.half)), np.diff(begin))
    first, last = packed.start[1], packed.start[-2]
    D, bent_by = np.empty((2, 6)), from_python(cell_elimination.bent_by)

    def follows(e, f):
        b = to[e]
        bend = bend_of(int(spans[layer[b] - 1]), int(spans[layer[b]]))
        return bent_by(packed, step, bend, lead, origin[e], b, to[f], D) < 0

    until = {e: behind[origin[e]] + cost[e] for a in range(first) for e in onward[a]}
    for a in range(first, last):
        for f in onward[a]:
            here = [until[e] for e in ending[a] if follows(e, f)]
            until[f] = min(here, default=np.inf) + cost[f]
    rest = {e: 0.0 for e in until if to[e] >= last}
    for a in range(last - 1, -1, -1):
        for e in onward[a]:
            if e not in rest:
                here = [cost[f] + rest[f] for f in onward[to[e]] if follows(e, f)]
                rest[e] = min(here, default=np.inf)
    found = np.full(len(packed.half), np.inf)
    for e in until:
        whole = until[e] + rest[e]
        for cell in (origin[e], to[e]):
            if whole <= most and (cell == origin[e] or cell >= last):
                found[cell] = min(found[cell], whole)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("nodes", [range(9), range(0, 31, 3), (0, 3, 4, 7, 9, 13, 17, 20)])
def test_steps_that_may_not_follow_each_other_are_left_out(nodes, planned, monkeypatch):
    """As trying all pairs says; and no cell that the plan passes costs more than the plan."""
    best = planned()
    one = course_of(best)
    cells = one.maker.coarsest(np.array(nodes))
    for _ in range(3):
        cells = one.maker.halves(cells)
    near = np.abs(np.angle(np.exp(1j * (cell_bounds(cells.level, cells.index)[0]
                                        - best.gamma[cells.node])))) < 0.25  # fmt: skip
    cells = cells.take(near & (cells.posture == best.posture[0]))
    seen = []

    def kept(packed, steps, spans, begin, to, cost, behind, ahead, most, multipliers):
        assert spans.tolist() == np.diff(nodes).tolist()
        assert multipliers is None
        found = cross_bends(packed, steps, spans, begin, to, cost, behind, ahead, most)
        seen.append((packed, (begin, to, cost, behind.copy()), most, found[0]))
        return found

    monkeypatch.setattr(stage, "cross_bends", kept)
    plain = solve_stage(cells, one.steps)
    result = solve_stage(cells, one.steps, most=best.cost * 1.2)
    (packed, steps_in, most, found) = seen[0]
    slow = through_pairs(packed, one.steps, np.diff(nodes), steps_in, most)
    np.testing.assert_allclose(found, slow, rtol=1e-12)  # the same sums
    assert (result.through >= plain.through * (1 - 1e-12)).all()
    assert (result.through > plain.through * (1 + 1e-3)).any()
    gamma, half = cell_bounds(result.cells.level, result.cells.index)
    away = np.abs(np.angle(np.exp(1j * (gamma - best.gamma[result.cells.node]))))
    assert (result.through[away <= half] <= best.cost).all()
