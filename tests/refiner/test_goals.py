"""Goals of a refinement: none gets worse, their priced sum is a local least, and they agree."""

from dataclasses import replace

import numpy as np
import pytest

from kerfpath import audit, plan, refine
from kerfpath.arrays import freeze
from kerfpath.limits import Limits
from kerfpath.refiner import Goal
from kerfpath.refiner.convex_program import LinearModel, solve
from kerfpath.refiner.rates import LinearAcceleration, RateLimits

KINDS = ("way", "step", "span", "turn", "velocity", "acceleration", "interval")


@pytest.fixture(scope="module")
def coarse(circle, arm, tool, placement):
    part = replace(circle.resample(count=41), closed=False)
    return plan(
        part, arm, tool=tool, placement=placement, speed=0.08, gamma_step=np.radians(3),
        postures=(0,), method="exact",
    )  # fmt: skip


def values(made):
    """The criteria of a plan, by numpy alone."""
    q = np.vstack([np.zeros(made.robot.joints), np.cumsum(made.increments, axis=0)])
    w, dq = made.settings.weights, np.diff(q, axis=0)
    fast = np.abs(made.velocity_share).max() / made.settings.eta_v
    sharp = np.abs(made.acceleration_share).max() / made.settings.eta_a
    return {
        "way": (w * np.abs(dq)).sum(),
        "step": (w * np.abs(dq)).max(),
        "span": w @ np.ptp(q, axis=0),
        "turn": np.ptp(np.unwrap(made.gamma)),
        "velocity": fast,
        "acceleration": sharp,
        "interval": max(fast, np.sqrt(sharp)),
    }


def goals_of(made, kinds, most=1 + 1e-8):
    known = values(made)
    return tuple(
        Goal(
            kind=kind, weight=freeze(np.array(made.settings.weights)), price=1 / known[kind],
            most=most * known[kind],
        )
        for kind in kinds
    )  # fmt: skip


@pytest.mark.parametrize("kinds", [("way", "velocity", "span"), ("turn", "acceleration"), KINDS])
def test_no_goal_gets_worse_and_their_sum_falls(coarse, kinds):
    goals = goals_of(coarse, kinds)
    found = refine(coarse, goals=goals)
    assert found.done
    before, after = values(coarse), values(found.plan)
    assert all(after[kind] <= before[kind] * (1 + 2e-8) for kind in kinds)
    assert found.cost_before == pytest.approx(len(kinds))
    assert found.cost_after == pytest.approx(sum(after[kind] / before[kind] for kind in kinds))
    assert found.cost_after < 0.995 * found.cost_before
    assert audit(found.plan) == []


def test_the_goal_of_the_objective_alone_leads_where_the_objective_does(coarse):
    free = replace(goals_of(coarse, ("way",))[0], price=1.0, most=np.inf)
    by_goal, plain = refine(coarse, goals=(free,)), refine(coarse)
    # The program is the same; a descent ends below a relative gain of 1e-4.
    assert by_goal.plan.cost == pytest.approx(plain.plan.cost, rel=1e-4)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_no_change_within_the_limits_is_better_by_the_linear_model(kind, seed):
    rng = np.random.default_rng(seed)
    K, n = 6, 3
    q = rng.normal(0, 0.2, (K, n)).cumsum(0)
    dq = np.diff(q, axis=0)
    goal = Goal(kind=kind, weight=rng.uniform(0.5, 2, n), price=2.0, most=np.inf)
    rates = RateLimits(
        tau=np.ones(K - 1),
        limits=Limits.of(2 * np.abs(dq).max(0), 2 * np.abs(np.diff(dq, axis=0)).max(0)),
        periodic=False,
    )
    slope = rng.normal(0, 1, (K, n, 1))
    model = LinearModel(
        q=q, slope=slope, radius=np.full((K, 1), 0.02), least=np.full((K, 1), -1.0),
        most=np.ones((K, 1)), lower=np.full(n, -np.inf), upper=np.full(n, np.inf),
        rotation=np.full(n, np.inf), rows=np.zeros((0, n)), row_lower=np.zeros(0),
        row_upper=np.zeros(0), weight=np.ones(n), metric="manhattan", cap=np.inf,
        gamma=rng.normal(0, 0.1, K), goals=(goal,),
        acceleration=LinearAcceleration(
            rates.acceleration(q), np.arange(1, K - 1), np.zeros((K - 2, n, 1))
        ),
        held=None,
    )  # fmt: skip

    def value(delta):
        return goal.value(model.gamma + delta[:, 0], q + model.moved(delta), rates)

    found = solve(model, rates, "sum")
    assert found is not None
    assert np.abs(found).max() <= 0.02
    others = np.clip(found + rng.normal(0, 0.005, (2000, K, 1)), -0.02, 0.02)
    kept = [each for each in others if rates.excess(q + model.moved(each)) <= 0]
    assert len(kept) > 100
    best = min(value(each) for each in kept)
    # The square root is modelled by its tangent, which a step of 0.02 leaves by less than this.
    slack = 0.02 if kind == "interval" else 1e-6
    assert value(found) <= best + slack
    assert value(found) <= value(np.zeros((K, 1))) + 1e-6
