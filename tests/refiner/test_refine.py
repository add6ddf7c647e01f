"""refine(): every limit by true kinematics, never dearer, and the convex program by itself."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog, minimize

from kerfpath import InputError, audit, plan, refine
from kerfpath.limits import Limits
from kerfpath.refiner.convex_program import LinearModel, solve
from kerfpath.refiner.rates import LinearAcceleration, RateLimits

METRICS = ["manhattan", "chebychev", "euclid"]
STEP = np.radians(2)


@pytest.fixture(scope="module")
def planned(circle, arm, tool, placement):
    def call(contour=circle, speed=0.1, **options):
        options = {"gamma_step": STEP, "postures": (0, 1), "method": "exact"} | options
        return plan(contour, arm, tool=tool, placement=placement, speed=speed, **options)

    return call


@pytest.mark.parametrize("objective", ["sum", "max"])
@pytest.mark.parametrize("metric", METRICS)
def test_it_is_better_and_keeps_every_limit(planned, metric, objective):
    coarse = planned(metric=metric, objective=objective)
    refined = refine(coarse)
    assert refined.done
    assert refined.plan.cost < coarse.cost
    assert refined.plan.cost == refined.cost_after
    assert refined.plan.proof.grid_cost == coarse.cost
    assert refined.plan.proof.optimal
    weighed = np.abs(refined.plan.increments * coarse.settings.weights)
    rho = {
        "manhattan": weighed.sum(1),
        "chebychev": weighed.max(1),
        "euclid": np.sqrt((weighed**2).sum(1)),
    }[metric]
    total = rho.sum() if objective == "sum" else rho.max()
    assert refined.plan.cost == pytest.approx(total, rel=1e-12)
    # The audit has a kinematics of its own and knows nothing of gamma.
    assert audit(refined.plan) == []
    assert np.abs(refined.plan.velocity_share).max() <= 1
    assert np.abs(refined.plan.acceleration_share).max() <= 1
    np.testing.assert_array_equal(refined.plan.posture, coarse.posture)


@pytest.mark.parametrize("objective", ["sum", "max"])
def test_from_a_coarse_grid_it_is_as_good_as_the_proved_best_of_a_fine_one(
    planned, circle, objective
):
    # The finest grid that searches in seconds; a grid can only be dearer than the continuum.
    short = replace(circle.resample(count=61), closed=False)
    coarse = planned(short, speed=0.08, objective=objective, postures=(0,))
    fine = planned(
        short, speed=0.08, objective=objective, postures=(0,), gamma_step=np.radians(0.1)
    )
    assert fine.cost < coarse.cost
    assert refine(coarse).plan.cost <= fine.cost * (1 + 1e-3)


def test_a_second_refinement_finds_nothing_more(planned):
    once = refine(planned())
    twice = refine(once.plan)
    assert twice.done
    assert once.plan.cost * (1 - 1e-3) <= twice.plan.cost <= once.plan.cost


def test_limits_that_the_grid_cannot_meet_are_met_off_it(planned):
    coarse = planned()
    eta_a = 0.9 * np.abs(refine(coarse).plan.acceleration_share).max()
    assert np.abs(coarse.acceleration_share).max() > eta_a
    refined = refine(coarse, eta_a=eta_a)
    assert refined.done
    assert np.abs(refined.plan.acceleration_share).max() <= eta_a
    assert refined.plan.settings.eta_a == eta_a
    assert not refined.plan.proof.optimal
    assert audit(refined.plan) == []


def test_what_cannot_be_met_is_said_and_the_plan_stands(planned):
    coarse = planned()
    refined = refine(coarse, eta_v=0.01)
    assert not refined.done
    assert refined.plan is coarse
    assert refined.cost_after == coarse.cost
    assert "velocity of joint" in refined.statement
    assert "at node" in refined.statement


def test_a_finer_time_step_holds_the_limits_too(planned, circle, tool):
    coarse = refine(planned(circle.resample(count=61))).plan
    refined = refine(coarse, nodes=circle.resample(count=241))
    assert refined.done
    finer = refined.plan
    assert len(finer.q) == 241
    assert finer.time[-1] == pytest.approx(coarse.time[-1], rel=1e-12)
    assert audit(finer, reference=circle) == []
    assert np.abs(finer.acceleration_share).max() <= 1
    T = finer.robot.forward(finer.q) @ tool
    np.testing.assert_allclose(T[:, :3, 3], finer.points, atol=1e-9)


def test_the_times_of_a_feed_that_dips_are_not_divided(planned, circle):
    coarse = planned(circle.resample(count=61), speed=1.2, feed="dip")
    assert 0 < coarse.feed.full < 1
    refined = refine(coarse, nodes=circle.resample(count=121))
    assert not refined.done
    assert "a reduced feed" in refined.statement


def test_a_closed_contour_stays_closed(planned):
    refined = refine(planned(closure="periodic"))
    assert refined.done
    q, endless = refined.plan.q, refined.plan.robot.endless
    gap = q[-1] - q[0]
    np.testing.assert_allclose(
        np.where(endless, gap - 2 * np.pi * np.round(gap / (2 * np.pi)), gap), 0, atol=1e-9
    )
    dq = refined.plan.increments
    seam = np.abs(dq[0] - dq[-1]) / refined.plan.dt**2
    assert (seam <= refined.plan.robot.speed_limits()[1]).all()


def test_turns_and_postures_belong_to_the_joints(planned):
    made = refine(planned()).plan
    base = made.q - 2 * np.pi * made.turn
    assert ((base > -np.pi - 1e-9) & (base <= np.pi + 1e-9)).all()
    assert ((made.gamma > -np.pi - 1e-9) & (made.gamma <= np.pi + 1e-9)).all()
    found = made.robot.inverse(made.robot.forward(made.q))
    same = np.abs(found.q - made.q[found.pose]).max(axis=1) < 1e-9
    np.testing.assert_array_equal(found.posture[same], made.posture[found.pose[same]])
    assert same.sum() == len(made.q)


def test_nodes_that_do_not_divide_the_intervals_are_refused(planned, circle):
    coarse = planned(circle.resample(count=61))
    with pytest.raises(InputError, match=r"for each of the plan's 60, got 99; .* count=121"):
        refine(coarse, nodes=circle.resample(count=100))
    moved = replace(circle, points=circle.points + 0.001)
    with pytest.raises(InputError, match="not among them"):
        refine(coarse, nodes=moved)
    with pytest.raises(InputError, match="eta_a"):
        refine(coarse, eta_a=0.0)


def _random_model(rng, metric, *, cap=np.inf, free=1, varies=False):
    K, n = 6, 3
    q = rng.normal(0, 0.2, (K, n)).cumsum(0)
    model = LinearModel(
        q=q,
        slope=rng.normal(0, 1, (K, n, free)),
        radius=np.full((K, free), 0.3),
        least=np.full((K, free), -1.0),
        most=np.full((K, free), 1.0),
        lower=q.min(0) - 0.05,
        upper=q.max(0) + 0.05,
        rotation=np.array([np.inf, np.abs(q[:, 1] - q[0, 1]).max() + 0.02, np.inf]),
        rows=np.array([[1.0, 1.0, 0.0]]),
        row_lower=np.array([-9.0]),
        row_upper=np.array([(q[:, 0] + q[:, 1]).max() + 0.02]),
        weight=rng.uniform(0.5, 2, n),
        metric=metric,
        cap=cap,
        gamma=np.zeros(K),
        goals=(),
        acceleration=LinearAcceleration(np.empty((0, n)), np.empty(0, int), np.empty((0, n, free))),
        held=None,
    )
    dq = np.diff(q, axis=0)
    tau = rng.uniform(0.5, 1.5, K - 1)
    velocity = np.abs(dq / tau[:, None]).max(0) * 1.1
    rates = RateLimits(
        tau=tau,
        limits=Limits.of(velocity, np.full(n, 9.0)),
        periodic=bool(rng.random() < 0.5),
    )
    acceleration = np.abs(rates.of(dq)[1]).max(0) * 1.05
    rates = replace(rates, limits=Limits.of(velocity, acceleration))
    linear = rates.linear_acceleration(q, model.slope)
    if varies:  # limits that depend on the configuration
        slope = rng.uniform(-0.5, 0.5, linear.slope.shape) * linear.limit[..., None]
        linear = linear._replace(slope=slope)
    return replace(model, acceleration=linear), rates


def _limited(model, rates):
    """The model with the acceleration limits of `rates`."""
    return replace(model, acceleration=rates.linear_acceleration(model.q, model.slope))


def _moved(model, delta):
    return model.q + np.einsum("kif,kf->ki", model.slope, delta.reshape(model.radius.shape))


def _distances(model, delta):
    dq = np.diff(_moved(model, delta), axis=0) * model.weight
    return {
        "manhattan": np.abs(dq).sum(1),
        "chebychev": np.abs(dq).max(1),
        "euclid": np.sqrt((dq**2).sum(1)),
    }[model.metric]


def _margins(model, rates, delta):
    """All that must not be negative, straight from the definitions."""
    q = _moved(model, delta)
    v = np.diff(q, axis=0) / rates.tau[:, None]
    a = [(v[k + 1] - v[k]) / ((rates.tau[k] + rates.tau[k + 1]) / 2) for k in range(len(v) - 1)]
    if rates.periodic:
        a.append((v[0] - v[-1]) / ((rates.tau[0] + rates.tau[-1]) / 2))
    coupled, free = q @ model.rows[0], delta.reshape(model.radius.shape)
    limit, node, slope = model.acceleration
    most = limit + np.einsum("mif,mf->mi", slope, free[node])
    return np.concatenate([
        (rates.limits.velocity.bound - np.abs(v)).ravel(),
        (most - np.abs(a)).ravel(),
        (q - model.lower).ravel(),
        (model.upper - q).ravel(),
        model.rotation[1] - np.abs(q - q[0])[:, 1],
        coupled - model.row_lower,
        model.row_upper - coupled,
        (model.radius - np.abs(delta.reshape(model.radius.shape))).ravel(),
    ])  # fmt: skip


@pytest.mark.parametrize("aim", ["sum", "max"])
@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize("free", [1, 2])
def test_the_program_is_the_problem_that_it_claims_to_be(free, metric, aim):
    """Against a general solver over the definitions, which share no row with the program."""
    rng = np.random.default_rng(5)
    for i in range(8 if free == 1 else 4):
        model, rates = _random_model(rng, metric, free=free, varies=i % 2 == 1)
        found = solve(model, rates, aim)
        assert found is not None
        assert _margins(model, rates, found).min() > -1e-7
        total = np.sum if aim == "sum" else np.max
        cost = total(_distances(model, found))
        ends = {"type": "eq", "fun": lambda d, f=free: d[:f] - d[-f:]}
        held = [{"type": "ineq", "fun": lambda d, m=model, r=rates: _margins(m, r, d)}]
        for seed in range(4):
            start = np.random.default_rng(seed).uniform(-0.1, 0.1, model.radius.size)
            other = minimize(
                lambda d, m=model, over=total: over(_distances(m, d)),
                start if seed else np.zeros(len(start)),
                constraints=held + ([ends] if rates.periodic else []),
                method="SLSQP",
                options={"maxiter": 200},
            )
            if _margins(model, rates, other.x).min() > -1e-9:
                # A convex problem: no admissible point is better, up to the solver's tolerance.
                assert cost <= other.fun + 1e-6
        assert rates.periodic is False or np.abs(found[0] - found[-1]).max() < 1e-7


def test_the_manhattan_program_is_a_linear_program():
    """The optimum itself, by another solver on the textbook formulation."""
    rng = np.random.default_rng(6)
    for _ in range(10):
        model, rates = _random_model(rng, "manhattan")
        rates = replace(rates, periodic=False)
        model = _limited(model, rates)
        found = solve(model, rates, "sum")
        (K, n), slope = model.q.shape, model.slope[..., 0]
        D = np.zeros(((K - 1) * n, K))
        for k in range(K - 1):
            for i in range(n):
                D[k * n + i, k], D[k * n + i, k + 1] = -slope[k, i], slope[k + 1, i]
        dq = np.diff(model.q, axis=0).ravel()
        V = D / np.repeat(rates.tau, n)[:, None]
        v = dq / np.repeat(rates.tau, n)
        span = np.repeat((rates.tau[1:] + rates.tau[:-1]) / 2, n)
        A, a = (V[n:] - V[:-n]) / span[:, None], (v[n:] - v[:-n]) / span
        Q = np.kron(np.eye(K), np.ones((n, 1))) * slope.ravel()[:, None]
        C = np.diag(slope @ model.rows[0])
        c = model.q @ model.rows[0]
        R = np.diag(slope[:, 1]) - slope[0, 1] * np.eye(K)[[0] * K]
        r = model.q[:, 1] - model.q[0, 1]
        velocity = rates.limits.velocity.bound
        acceleration = rates.limits.acceleration.bound
        sides = [
            (V, v, np.tile(velocity, K - 1), -np.tile(velocity, K - 1)),
            (A, a, np.tile(acceleration, K - 2), -np.tile(acceleration, K - 2)),
            (Q, model.q.ravel(), np.tile(model.upper, K), np.tile(model.lower, K)),
            (C, c, np.full(K, model.row_upper[0]), np.full(K, model.row_lower[0])),
            (R, r, np.full(K, model.rotation[1]), np.full(K, -model.rotation[1])),
        ]
        w = np.diag(np.tile(model.weight, K - 1))
        T = np.eye((K - 1) * n)
        rows = [np.hstack([w @ D, -T]), np.hstack([-w @ D, -T])]
        right = [-w @ dq, w @ dq]
        for M, m, high, low in sides:
            rows += [np.hstack([s * M, np.zeros((len(M), len(T)))]) for s in (1, -1)]
            right += [high - m, m - low]
        best = linprog(
            np.append(np.zeros(K), np.ones(len(T))),
            np.vstack(rows),
            np.concatenate(right),
            bounds=[(-r, r) for r in model.radius.ravel()] + [(None, None)] * len(T),
        )
        assert _distances(model, found).sum() == pytest.approx(best.fun, abs=1e-6)


def test_a_motion_that_costs_hardly_more_than_any_can_is_left_as_it_is(planned):
    grid = planned()
    best = refine(grid).plan
    for least, left in ((best.cost * (1 - 1e-5), True), (best.cost * (1 - 1e-3), False)):
        again = refine(best, least=least)
        assert again.done
        assert (again.programs == 0) == left
        assert again.cost_after <= best.cost
    assert refine(grid, least=best.cost).cost_after == best.cost


def test_a_cap_holds_every_distance():
    rng = np.random.default_rng(7)
    for metric in METRICS:
        model, rates = _random_model(rng, metric)
        least = _distances(model, solve(model, rates, "max")).max()
        capped = replace(model, cap=least * 1.02)
        found = solve(capped, rates, "sum")
        assert _distances(model, found).max() <= least * 1.02 + 1e-7
        assert (
            _distances(model, found).sum()
            >= _distances(model, solve(model, rates, "sum")).sum() - 1e-6
        )


def test_the_largest_share_is_brought_down_where_limits_are_broken():
    rng = np.random.default_rng(8)
    model, rates = _random_model(rng, "manhattan")
    limits = rates.limits
    halved = Limits.of(limits.velocity.bound / 2, limits.acceleration.bound / 2)
    tight = replace(rates, limits=halved)
    found = solve(_limited(model, tight), tight, "excess")
    after = _moved(model, found)
    assert tight.excess(after) < tight.excess(model.q)


def test_a_refinement_that_is_cut_short_keeps_every_limit_and_is_on_the_way(planned):
    coarse = planned(metric="euclid", gamma_step=np.radians(8))
    whole = refine(coarse)
    costs = [refine(coarse, most=most).plan.cost for most in (1, 3, 8)]
    assert coarse.cost >= costs[0] >= costs[1] >= costs[2] >= whole.plan.cost
    assert costs[0] < coarse.cost
    short = refine(coarse, most=3)
    # A step that is begun is finished: it may be laid on three times more.
    assert short.programs <= 3 + 3
    assert audit(short.plan) == []
    assert whole.programs > short.programs
