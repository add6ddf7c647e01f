"""Limits as objects: their laws, and what they refuse."""

import numpy as np
import pytest

from kerfpath import InputError
from kerfpath.limits import AccelerationLimit, Limits, VelocityLimit, meetings, rates_of

BOUND = np.array([1.0, 2.5])


@pytest.mark.parametrize(("kind", "order"), [(VelocityLimit, 1), (AccelerationLimit, 2)])
def test_a_limit_bounds_a_difference_of_its_order(kind, order):
    limit, dt = kind(bound=BOUND, share=0.8), 0.1
    np.testing.assert_allclose(limit.usable, 0.8 * BOUND)
    np.testing.assert_allclose(limit.per_interval(dt), 0.8 * BOUND * dt**order)
    # q = bound t^order / order! has the bound as its derivative, and its differences at every step.
    t = dt * np.arange(5)
    q = BOUND * t[:, None] ** order / order
    full = kind(bound=BOUND).per_interval(dt)
    np.testing.assert_allclose(np.diff(q, order, axis=0), np.tile(full, (5 - order, 1)))


def test_half_the_share_or_the_interval_leaves_what_its_order_says():
    limits = Limits.of(BOUND, BOUND, eta_v=0.5, eta_a=0.5)
    whole = Limits.of(BOUND, BOUND)
    for limit, of_all, order in (
        (limits.velocity, whole.velocity, 1),
        (limits.acceleration, whole.acceleration, 2),
    ):
        np.testing.assert_allclose(2 * limit.per_interval(0.2), of_all.per_interval(0.2))
        halves = of_all.per_interval(0.1) * 2**order
        np.testing.assert_allclose(halves, of_all.per_interval(0.2))


def test_without_acceleration_the_velocity_stays():
    limits = Limits.of(BOUND, BOUND, eta_v=0.5).without_acceleration()
    assert np.isinf(limits.acceleration.per_interval(0.1)).all()
    np.testing.assert_array_equal(limits.velocity.usable, 0.5 * BOUND)


def test_limits_are_read_only_and_printed_in_a_line():
    limits = Limits.of(BOUND, BOUND)
    with pytest.raises(ValueError, match="read-only"):
        limits.velocity.bound[0] = 9.0
    assert repr(limits.velocity) == "VelocityLimit(bound=[1, 2.5], share=1)"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"velocity": [1.0, 0.0]}, r"velocity: must be positive, but velocity\[1\] is 0"),
        ({"velocity": [1.0, np.inf]}, "velocity: every number must be finite"),
        ({"acceleration": [[1.0]]}, "acceleration: expected shape"),
        ({"acceleration": ["fast"]}, "acceleration: expected an array of numbers"),
        ({"eta_v": 0.0}, "eta_v: expected a number above 0"),
        ({"eta_a": np.nan}, "eta_a: expected a number above 0"),
    ],
)
def test_what_bounds_nothing_is_refused(change, message):
    with pytest.raises(InputError, match=message):
        Limits.of(**({"velocity": BOUND, "acceleration": BOUND} | change))


def test_a_limit_of_other_joints_is_named():
    with pytest.raises(InputError, match=r"acceleration: expected shape \(2\), got \(1,\)"):
        Limits.of(BOUND, [1.0]).require_joints(2)
    with pytest.raises(InputError, match="velocity: must be positive, got"):
        VelocityLimit(bound=-BOUND)


@pytest.mark.parametrize("periodic", [False, True])
def test_the_rates_of_a_motion_by_its_definition(periodic):
    rng = np.random.default_rng(91)
    dq, tau = rng.normal(size=(5, 2)), rng.uniform(0.5, 2.0, 5)
    v, a = rates_of(dq, tau, periodic=periodic)
    np.testing.assert_allclose(v * tau[:, None], dq)
    assert len(a) == (5 if periodic else 4)
    for k, rate in enumerate(a):
        later = (k + 1) % 5
        span = (tau[k] + tau[later]) / 2
        np.testing.assert_allclose(rate * span, v[later] - v[k])
    assert [len(ends) for ends in meetings(1, periodic=periodic)] == [0, 0]
