"""Costs of reversals: counts and optima by brute force, plans never worse, tilt avoiding some."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from kerfpath import (
    Certify,
    Comfort,
    Contour,
    InputError,
    OptionConflict,
    PlanOptions,
    Reversals,
    Tilt,
    audit,
    plan,
    refine,
    robot,
)
from kerfpath.job.plan_file import plan_entry
from kerfpath.kernels.search import ReversalPrices
from kerfpath.limits import Limits
from kerfpath.plans import STILL, reversals
from kerfpath.search import SearchProblem, find_shortest
from kerfpath.search.slowed import find_slowed


def turned(q, dt, joints=(1, 2, 3)):
    """How often joints turn back, one after the other: signs that differ, pauses left out."""
    count = 0
    for joint in joints:
        ways = [np.sign(v) for v in np.diff(q[:, joint - 1]) / dt if abs(v) > STILL]
        count += sum(a != b for a, b in itertools.pairwise(ways))
    return count


def test_reversals_are_counted_across_pauses():
    rng = np.random.default_rng(3)
    for _ in range(50):
        rate = rng.choice([-1.0, 0.0, STILL / 2, 2.0], (12, 4))
        q = np.vstack([np.zeros(4), np.cumsum(rate, axis=0)])
        found = reversals(rate)
        assert len(found) == turned(q, 1.0)
        for joint, k in found:  # it moves there, and the other way when it moved last
            before = [v for v in rate[:k, joint] if abs(v) > STILL]
            assert rate[k, joint] * before[-1] < 0
        assert len(reversals(rate, [3, 0])) == turned(q, 1.0, (4, 1))


def brute(q, size, limits, price, still):
    """Least cost of all paths under (5) and (6), each path on its own."""
    best = np.inf
    for choice in itertools.product(range(size), repeat=len(q) // size):
        path = q[np.arange(len(choice)) * size + choice]
        dq = np.diff(path, axis=0)
        if (np.abs(dq) > limits[0] + 1e-9).any():
            continue
        if (np.abs(np.diff(dq, axis=0)) > limits[1] + 1e-9).any():
            continue
        back = [price[i] * turned(path[:, [i]], 1.0, (1,)) for i in range(2)]
        best = min(best, np.abs(dq).sum() + sum(back))
    return best


@pytest.mark.parametrize("most", [(9.0, 9.0), (3.0, 3.0), (2.0, 4.0)])
def test_the_exact_search_pays_for_each_reversal(most):
    # Whole numbers, so that joints often stand still and the last direction counts.
    rng, size, paid = np.random.default_rng(7), 4, 0
    for _ in range(12):
        q = rng.integers(-2, 3, (6 * size, 2)).astype(float)
        price = np.array([rng.uniform(0.1, 4.0), rng.choice([0.0, 1.3])])
        want = brute(q, size, most, price, STILL)
        if want == np.inf:
            continue
        problem = SearchProblem(
            q=q, start=np.arange(0, len(q) + 1, size), dt=1.0, weights=np.ones(2),
            limits=Limits.of(np.full(2, most[0]), np.full(2, most[1])),
            reversals=ReversalPrices(price, STILL),
        )  # fmt: skip
        found = find_shortest(problem)
        path = q[problem.start[:-1] + found.index]
        back = [price[i] * turned(path[:, [i]], 1.0, (1,)) for i in range(2)]
        assert found.optimal
        assert found.cost == pytest.approx(want, rel=1e-12)
        assert found.cost == pytest.approx(np.abs(np.diff(path, axis=0)).sum() + sum(back))
        paid += sum(back) > 0
    assert paid  # some best paths do turn back


@pytest.fixture(scope="module")
def cell():
    """An arm over a sheet, the beam 20 degrees from axis 6 and off it."""
    arm = robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")
    arm = arm.with_limits(endless=np.isin(np.arange(1, 7), (4, 6)))
    tool, placement, lean = np.eye(4), np.eye(4), np.radians(20)
    tool[[0, 2], [2, 0]] = np.sin(lean), -np.sin(lean)
    tool[[0, 2], [0, 2]] = np.cos(lean)
    tool[:3, 3], placement[:3, 3] = [0.1, 0, 0.3], [1.4, 0, 0.6]
    where = {"tool": tool, "placement": placement, "gamma_step": np.radians(6)}
    return arm, where | {"certify": None}


def flat(points, **more):
    return Contour(points, np.tile([0, 0, -1.0], (len(points), 1)), **more)


t = np.linspace(0, 1, 501)
SLIT = flat(np.c_[0 * t, 0.3 * t - 0.1, 0 * t], name="slit").resample(count=31)
WAVE = flat(np.c_[0.02 * np.sin(9 * t), 0.2 * t - 0.1, 0 * t], name="wave").resample(count=41)
HOLE = flat(
    0.008 * np.c_[np.cos(2 * np.pi * t), np.sin(2 * np.pi * t), 0 * t], name="hole", closed=True
).resample(count=31)
TILT = Tilt(cone=np.radians(4), steps=1)


def costing(cost, **more):
    return Comfort(reversals=Reversals(cost=cost, **more))


def price_of(made, cost, joints=(1, 2, 3)):
    """The path cost of a plan plus the cost of its reversals, by hand."""
    path = (np.abs(made.increments) * made.settings.weights).sum()
    return path + cost * turned(made.unwrapped, made.dt, joints)


@pytest.mark.parametrize("contour", [SLIT, WAVE], ids=lambda each: each.name)
@pytest.mark.parametrize("how", ["continuous", "exact", "refined"])
def test_a_plan_with_the_cost_is_never_worse_with_it(cell, contour, how):
    arm, where = cell
    method = {"method": "continuous"} if how == "continuous" else {"method": "exact"}
    asked = where | method | {"speed": 0.05, "refine": how == "refined"}
    plain = plan(contour, arm, **asked)
    for cost in (0.05, 0.4, 3.0):
        made = plan(contour, arm, comfort=costing(cost), **asked)
        assert made.cost == pytest.approx(price_of(made, cost), rel=1e-9)
        assert made.cost <= price_of(plain, cost) * (1 + 1e-9)
        assert made.criteria.reversals.sum() == turned(made.unwrapped, made.dt)
        assert audit(made, reference=contour) == []
        assert made.proof.optimal or how != "exact"


def test_the_dearer_the_fewer(cell):
    arm, where = cell
    asked = where | {"method": "exact", "speed": 0.05}
    counts = []
    for cost in (0.0, 0.01, 0.1, 0.4, 1.0, 10.0):
        made = plan(WAVE, arm, comfort=costing(cost), **asked)
        counts.append(turned(made.unwrapped, made.dt))
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] < counts[0]
    assert counts[0] == turned(plan(WAVE, arm, **asked).unwrapped, made.dt)


def test_only_the_joints_asked_for_count(cell):
    arm, where = cell
    asked = where | {"method": "exact", "speed": 0.05}
    plain = plan(WAVE, arm, **asked)
    made = plan(WAVE, arm, comfort=costing(10.0, joints=[5, 2]), **asked)
    assert made.cost == pytest.approx(price_of(made, 10.0, (2, 5)), rel=1e-9)
    assert turned(made.unwrapped, made.dt, (2, 5)) < turned(plain.unwrapped, plain.dt, (2, 5))


@pytest.mark.parametrize(
    ("contour", "method", "speed", "cost", "counts"),
    [(SLIT, "exact", 0.05, 0.25, [2, 2, 0]), (HOLE, "continuous", 0.01, 2.0, [1, 4, 0])],
    ids=["slit", "hole"],
)
def test_a_tilt_avoids_reversals(cell, contour, method, speed, cost, counts):
    # Along the slit joints 2 and 3 reach out and back, which costs less on this grid than turning
    # the head so that they need not; with a tilt the wrist moves on a straight way. Around the hole
    # no motion found with the nominal axis leaves out the last reversal.
    arm, where = cell
    asked = where | {"method": method, "speed": speed, "comfort": costing(cost)}
    rigid, tilted = plan(contour, arm, **asked), plan(contour, arm, tilt=TILT, **asked)
    free = plan(contour, arm, tilt=TILT, **asked | {"comfort": None})
    assert [turned(made.unwrapped, made.dt) for made in (rigid, free, tilted)] == counts
    assert tilted.cost < min(rigid.cost, price_of(free, cost))
    assert tilted.cost == pytest.approx(price_of(tilted, cost), rel=1e-9)
    angle = np.hypot(*tilted.tilt.T)
    assert 0 < angle.max() <= TILT.cone * (1 + 1e-12)
    for made in (rigid, tilted):
        assert audit(made, reference=contour) == []


def test_a_tilt_is_never_worse_than_none(cell):
    # Tilts stay on their samples, so a motion without any may be the better one off the grid.
    arm, where = cell
    asked = where | {"speed": 0.05, "comfort": costing(0.25)}
    rigid, tilted = plan(SLIT, arm, **asked), plan(SLIT, arm, tilt=TILT, **asked)
    assert tilted.cost <= rigid.cost
    assert tilted.settings.tilt == TILT


def test_a_refinement_turns_no_joint_back_unless_it_pays(cell):
    arm, where = cell
    asked = where | {"method": "exact", "speed": 0.05, "comfort": costing(0.4)}
    grid = plan(WAVE, arm, **asked)
    better = refine(grid)
    assert better.done
    assert better.cost_after < grid.cost
    assert better.plan.cost == pytest.approx(price_of(better.plan, 0.4), rel=1e-9)
    dear = replace(grid, settings=replace(grid.settings, comfort=costing(1e3)))
    kept = refine(replace(dear, cost=price_of(grid, 1e3)))
    assert kept.cost_after <= price_of(grid, 1e3)
    assert turned(kept.plan.unwrapped, grid.dt) <= turned(grid.unwrapped, grid.dt)


@pytest.mark.slow
def test_the_bound_leaves_the_cost_out(cell):
    arm, where = cell
    asked = where | {"speed": 0.05, "certify": Certify()}
    plain = plan(SLIT, arm, **asked)
    made = plan(SLIT, arm, comfort=costing(0.05), **asked)
    assert 0 < made.proof.bound <= plain.cost <= made.cost
    assert made.proof.gap == pytest.approx(1 - made.proof.bound / made.cost)


def test_a_plan_file_has_the_cost_and_the_count(cell, tmp_path):
    arm, where = cell
    made = plan(
        SLIT, arm, method="exact", speed=0.05, comfort=costing(0.25, joints=[1, 2]), **where
    )
    assert PlanOptions.from_data(made.settings.to_data()) == made.settings
    entry = json.loads(json.dumps(plan_entry(made, "slit", [])))
    assert entry["criteria"]["reversals"][:3] == [
        turned(made.unwrapped, made.dt, (joint,)) for joint in (1, 2, 3)
    ]
    assert entry["comfort"] == {"reversals": {"cost": 0.25, "joints": [1, 2]}}


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Reversals(cost=-1), "reversals cost: must not be negative"),
        (lambda: Reversals(cost=1, joints=()), r"different numbers from 1, got \(\)"),
        (lambda: Reversals(cost=1, joints=(0, 1)), "different numbers from 1"),
        (lambda: Reversals(cost=1, joints=(2, 2)), "different numbers from 1"),
        (lambda: Reversals(cost=1, joints=(1.5,)), "different numbers from 1"),
        (lambda: Comfort(reversals=2), "reversals: expected a Reversals, got 2"),
        (lambda: Reversals(cost=1, joints=(7,)).per_joint(robot("kuka_kr16_2")), "1 to 6, got 7"),
    ],
)
def test_bad_costs_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize(
    ("other", "option"),
    [
        ({"objective": "max"}, "objective"),
        ({"method": "paper"}, "method"),
        ({"feed": "dip"}, "feed"),
        ({"interruptions": "fewest"}, "interruptions"),
    ],
)
def test_options_that_cannot_count_reversals_are_refused(other, option):
    with pytest.raises(OptionConflict) as refused:
        PlanOptions(comfort=costing(1.0), **other)
    assert refused.value.option == option
    assert PlanOptions(comfort=costing(0.0), **other).comfort is not None  # it costs nothing


def test_searches_that_cannot_count_reversals_refuse_them():
    prices = ReversalPrices(np.ones(1), 0.0)
    asked = {"q": np.zeros((2, 1)), "start": [0, 1, 2], "dt": 1.0, "reversals": prices}
    asked["limits"] = Limits.of(np.ones(1), np.ones(1))
    with pytest.raises(InputError, match='reversals: a cost needs method="exact"'):
        SearchProblem(**asked, objective="max")
    with pytest.raises(InputError, match="slowed path has no costs of reversals"):
        find_slowed(SearchProblem(**asked))
