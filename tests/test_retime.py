"""Retiming: laws, an independent check of the limits, a general solver as oracle, edges."""

import itertools

import numpy as np
import pytest
from scipy.optimize import minimize

from kerfpath import InputError
from kerfpath.limits import Limits
from kerfpath.retime import feed, retime

ONE = Limits.of([1.0], [1.0])


def shares(tau, dq, velocity, acceleration, periodic):
    """Largest share of the velocity and of the acceleration limits, as the audit measures them."""
    rate = dq / tau[:, None]
    change = np.diff(rate, axis=0) / ((tau[1:] + tau[:-1]) / 2)[:, None]
    if periodic:
        seam = (rate[0] - rate[-1]) / ((tau[0] + tau[-1]) / 2)
        change = np.vstack([change, seam])
    return (np.abs(rate) / velocity).max(), (np.abs(change) / acceleration).max(initial=0.0)


def instance(rng, intervals=(1, 6)):
    K1, n = int(rng.integers(*intervals)), int(rng.integers(1, 4))
    dt = rng.uniform(0.01, 0.1, K1 if rng.random() < 0.5 else ())
    velocity = rng.uniform(0.5, 3, n)
    acceleration = rng.uniform(0.05, 2, n) * velocity / np.mean(dt) * rng.choice([1, 0.1])
    dq = rng.normal(0, 0.6, (K1, n)) * velocity * np.mean(dt)
    kind = rng.random()
    if kind < 0.3:
        dq = dq[[0]] + 0.2 * dq  # smooth
    elif kind < 0.5:
        dq[rng.integers(K1)] = 0
    elif kind < 0.7:
        dq[K1 // 2 :] = -dq[0]  # there and back
    return dq, dt, velocity, acceleration, bool(rng.random() < 0.3)


def long_path(rng, intervals=300, corners=5):
    """Increments of a smooth path of six joints that turns sharply at some nodes."""
    t = np.linspace(0, 1, intervals + 1)[:, None]
    waves = (
        rng.normal(0, 0.3, 6) / f * np.sin(2 * np.pi * f * t + rng.uniform(0, 6, 6))
        for f in (1, 2, 3, 5)
    )
    dq = np.diff(sum(waves), axis=0)
    for corner in rng.integers(5, intervals - 5, corners):
        dq[corner:] = dq[corner:] @ np.linalg.qr(rng.normal(0, 1, (6, 6)))[0]
    return dq, 12 / intervals, np.full(6, 3.0), np.full(6, 8.0)


def best_of_many(rng, dq, dt, velocity, acceleration, periodic, starts=12):
    """Least total time that a general solver finds from random starts."""
    dt = np.broadcast_to(dt, len(dq))
    least = np.maximum(dt, (np.abs(dq) / velocity).max(axis=1))
    pairs = list(itertools.pairwise(range(len(dq)))) + ([(len(dq) - 1, 0)] if periodic else [])

    def room(y):
        tau = y * least
        rows = [
            sign * (dq[b] / tau[b] - dq[a] / tau[a]) / acceleration - (tau[a] + tau[b]) / 2
            for a, b in pairs
            for sign in (-1, 1)
        ]
        return -np.concatenate(rows) / np.mean(dt) if rows else np.ones(1)

    best = np.inf
    for _ in range(starts):
        found = minimize(
            lambda y: y @ least / dt.mean(),
            np.exp(rng.uniform(0, 3, len(dq))),
            method="SLSQP",
            bounds=[(1, None)] * len(dq),
            constraints={"type": "ineq", "fun": room},
            options={"maxiter": 300},
        )
        if room(found.x).min() > -1e-7:
            best = min(best, float(np.maximum(found.x, 1) @ least))
    return best


def require_lawful(tau, dq, dt, velocity, acceleration, periodic):
    assert (tau >= dt).all()
    fast, sharp = shares(tau, dq, velocity, acceleration, periodic)
    assert fast <= 1 + 1e-12
    assert sharp <= 1 + 1e-9


@pytest.mark.slow
def test_the_limits_hold_and_nothing_is_faster_than_commanded():
    rng = np.random.default_rng(41)
    slowed = 0
    for _ in range(300):
        dq, dt, v, a, periodic = instance(rng, (1, 40))
        tau = retime(dq, dt, Limits.of(v, a), periodic=periodic)
        require_lawful(tau, dq, dt, v, a, periodic)
        at_speed = np.broadcast_to(dt, len(dq))
        feasible = max(shares(at_speed, dq, v, a, periodic)) <= 1
        assert feasible == np.array_equal(tau, at_speed)
        slowed += not feasible
    assert 100 < slowed < 290


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # SLSQP leaves its bounds by rounding
def test_a_general_solver_from_many_starts_finds_nothing_quicker():
    rng = np.random.default_rng(42)
    compared = 0
    for _ in range(120):
        dq, dt, v, a, periodic = instance(rng)
        best = best_of_many(rng, dq, dt, v, a, periodic)
        if best < np.inf:
            # 1e-4 is what the procedure stops at; local optima of two could differ by more.
            assert retime(dq, dt, Limits.of(v, a), periodic=periodic).sum() <= best * (1 + 1e-4)
            compared += 1
    assert compared > 100


@pytest.mark.parametrize("seed", range(6))
def test_a_long_path_is_slow_at_its_corners_only(seed):
    dq, dt, v, a = long_path(np.random.default_rng(seed))
    tau = retime(dq, dt, Limits.of(v, a))
    require_lawful(tau, dq, dt, v, a, False)
    assert (tau == dt).mean() > 0.7
    assert tau.max() > 1.2 * dt
    uniform = dt * np.sqrt(max(1, shares(np.full(len(dq), dt), dq, v, a, False)[1]))
    assert tau.sum() < uniform * len(dq)


def test_times_scale_with_the_unit_of_time_and_of_angle():
    rng = np.random.default_rng(43)
    for _ in range(40):
        dq, dt, v, a, periodic = instance(rng, (2, 30))
        tau = retime(dq, dt, Limits.of(v, a), periodic=periodic).sum()
        slower = retime(dq, 7 * dt, Limits.of(v / 7, a / 49), periodic=periodic).sum()
        wider = retime(3 * dq, dt, Limits.of(3 * v, 3 * a), periodic=periodic).sum()
        reverse = np.flip(np.atleast_1d(dt)) if np.ndim(dt) else dt
        back = retime(-dq[::-1], reverse, Limits.of(v, a), periodic=periodic).sum()
        # Where the procedure stops depends on rounding: 1e-4.
        assert [slower / 7, wider, back] == pytest.approx([tau] * 3, rel=1e-4)


def test_more_room_never_takes_longer():
    rng = np.random.default_rng(44)
    for _ in range(60):
        dq, dt, v, a, periodic = instance(rng, (2, 30))
        tau = retime(dq, dt, Limits.of(v, a), periodic=periodic).sum()
        more = 1 + rng.random(len(v))
        for wider, *limits in ((dt, more * v, a), (dt, v, more * a), (0.8 * dt, v, a)):
            assert retime(dq, wider, Limits.of(*limits), periodic=periodic).sum() <= tau * (
                1 + 1e-4
            )


def test_the_velocity_alone_has_its_closed_form():
    dq = [[0.1], [0.4], [-0.1]]
    np.testing.assert_array_equal(
        retime(dq, 0.2, Limits.of([1.0], [1e9])),
        [0.2, 0.4, 0.2],
    )


def test_a_reversal_has_its_closed_form():
    # By symmetry both intervals take t: 2 dq / t = a t.
    tau = retime([[0.5], [-0.5]], 0.1, Limits.of([100.0], [4.0]))
    np.testing.assert_allclose(tau, np.sqrt(2 * 0.5 / 4.0), rtol=1e-6)


def test_a_seam_counts_only_where_the_path_is_periodic():
    dq = np.concatenate([np.linspace(0.1, 0.5, 20), np.full(10, 0.5)])[:, None]
    limits = ([1.0], [0.03])
    np.testing.assert_array_equal(retime(dq, 1.0, Limits.of(*limits)), 1.0)
    tau = retime(dq, 1.0, Limits.of(*limits), periodic=True)
    require_lawful(tau, dq, 1.0, *map(np.array, limits), True)
    assert tau[-1] > 1.01


def test_one_interval_and_no_motion_take_the_commanded_time():
    np.testing.assert_array_equal(retime([[0.5]], 1.0, ONE), [1.0])
    np.testing.assert_array_equal(retime([[0.5]], 1.0, ONE, periodic=True), [1.0])
    np.testing.assert_array_equal(retime([[3.0]], 1.0, ONE), [3.0])
    still = retime(np.zeros((5, 2)), 0.1, Limits.of([1, 1], [1, 1]))
    np.testing.assert_array_equal(still, np.full(5, 0.1))


def test_a_corner_that_needs_nearly_a_stop():
    dq = np.zeros((400, 2))
    dq[:200, 0] = dq[200:, 1] = 1e-3
    v, a = np.array([2.0, 2.0]), np.array([0.5, 0.5])
    tau = retime(dq, 1e-3, Limits.of(v, a))
    require_lawful(tau, dq, 1e-3, v, a, False)
    assert tau.max() > 30e-3
    # 1 rad/s takes 1 rad to brake, the legs have 0.2: both are ramps to and from a stop, less what
    # the finite difference gives away, a corner speed of sqrt(a dq), which each ramp need not pass.
    ramps = 2 * np.sqrt(2 * 0.2 / 0.5)
    assert ramps - 2 * np.sqrt(1e-3 / 0.5) < tau.sum() < ramps


def test_the_feed_names_the_slowest_interval_and_what_binds_there():
    dq = np.zeros((21, 2))
    dq[:, 0], dq[10:, 1] = 0.1, 0.3
    limits = Limits.of([1.0, 1.0], [9.0, 0.5])
    tau = retime(dq, 0.5, limits)
    length = np.full(21, 0.01)
    found = feed(tau, 0.5, dq, limits, length)
    assert (found.joint, found.limit) == (1, "acceleration")
    assert found.node in (9, 10)
    assert found.slowest == pytest.approx(0.5 / tau.max())
    assert found.full == pytest.approx((tau == 0.5).mean())
    dq[3, 0] = 2.0
    limits = Limits.of([1.0, 1.0], [9.0, 9.0])
    found = feed(retime(dq, 0.5, limits), 0.5, dq, limits, length)
    assert (found.node, found.joint, found.limit) == (3, 0, "velocity")


def test_the_feed_of_a_path_at_full_speed():
    found = feed([1.0, 1.0], 1.0, [[0.1], [0.1]], ONE, [0.01, 0.02])
    assert (found.full, found.slowest, found.node, found.joint, found.limit) == (1, 1, -1, -1, None)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[0.1]], 0.0, [1.0], [1.0]), "dt: must be positive"),
        (([[0.1]], [1.0, 1.0], [1.0], [1.0]), r"dt: expected shape \(1\), got \(2,\)"),
        (([[0.1]], 1.0, [1.0, 1.0], [1.0]), "velocity: expected shape"),
        (([[0.1]], 1.0, [1.0], [-1.0]), "acceleration: must be positive"),
        (([[np.nan]], 1.0, [1.0], [1.0]), "dq: every number must be finite"),
        ((np.zeros((0, 1)), 1.0, [1.0], [1.0]), "dq: expected at least one interval"),
    ],
)
def test_bad_input_is_one_line(arguments, message):
    with pytest.raises(InputError, match=message):
        retime(*arguments[:2], Limits.of(*arguments[2:]))
