"""Intervals and jets against exact rational arithmetic: what they say holds for real numbers."""

from fractions import Fraction

import numpy as np
import pytest

from kerfpath.auditor.jets import HALF_TURN, Interval, angle_from, argument, constant, exact, stack

MANY = 400


def some_intervals(rng, count=MANY):
    """Intervals of every width and size: with zero inside, at an end, of no width, denormal."""
    middle = rng.normal(size=count) * 10.0 ** rng.integers(-8, 8, count)
    width = np.abs(middle) * 10.0 ** rng.uniform(-17, 1, count)
    lo, hi = middle - width, middle + width
    lo[::7], hi[::11] = 0.0, np.abs(hi[::11])
    lo[::13] = hi[::13] = 3e-310
    return Interval(np.minimum(lo, hi), np.maximum(lo, hi))


def points_of(rng, interval):
    """Real numbers of each interval, as fractions: the ends and some between."""
    for lo, hi in zip(interval.lo.tolist(), interval.hi.tolist(), strict=True):
        a, b = Fraction(lo), Fraction(hi)
        yield [a, b, *(a + (b - a) * Fraction(int(k), 997) for k in rng.integers(0, 998, 2))]


def sine_and_cosine(x):
    """Of a fraction, with what is left out of their series: both to better than 1e-30."""
    terms, term = [Fraction(1)], Fraction(1)
    for k in range(1, 70):
        term *= x / k
        terms.append(term)
    sign = (1, -1)
    sine = sum(t * sign[k // 2 % 2] for k, t in enumerate(terms) if k % 2)
    cosine = sum(t * sign[k // 2 % 2] for k, t in enumerate(terms) if not k % 2)
    return sine, cosine, abs(term)


def held(interval, i, value):
    return Fraction(float(interval.lo[i])) <= value <= Fraction(float(interval.hi[i]))


@pytest.mark.parametrize(
    ("name", "operation"),
    [
        ("sum", lambda a, b: a + b),
        ("difference", lambda a, b: a - b),
        ("product", lambda a, b: a * b),
        ("quotient", lambda a, b: a / b),
    ],
)
def test_an_operation_holds_that_of_any_numbers_within(name, operation):
    rng = np.random.default_rng(1)
    a, b = some_intervals(rng), some_intervals(rng)
    with np.errstate(all="ignore"):
        c = operation(a, b)
    for i, (xs, ys) in enumerate(zip(points_of(rng, a), points_of(rng, b), strict=True)):
        if name == "quotient" and b.lo[i] <= 0 <= b.hi[i]:
            assert np.isnan(c.lo[i])
            assert np.isnan(c.hi[i])
        elif c.known()[i]:
            assert all(held(c, i, operation(x, y)) for x in xs for y in ys)
        else:  # what overflows is not known: quotients by denormal numbers alone
            assert name == "quotient"
            assert abs(b.hi[i]) < 1e-300


def test_what_is_taken_of_one_interval_holds_it_for_any_number_within():
    rng = np.random.default_rng(2)
    a = some_intervals(rng)
    root, square, factor, negative = a.sqrt(), a.square(), a.scaled(-0.3), -a
    for i, xs in enumerate(points_of(rng, a)):
        for x in xs:
            assert held(square, i, x * x)
            assert held(factor, i, x * Fraction(-0.3))
            assert held(negative, i, -x)
            lo, hi = Fraction(float(root.lo[i])), Fraction(float(root.hi[i]))
            assert lo >= 0
            if x >= 0:
                assert lo * lo <= x <= hi * hi
            assert abs(x - Fraction(0.7)) <= Fraction(float(a.radius(np.array(0.7))[i]))
            assert abs(x) <= Fraction(float(a.magnitude()[i]))


def test_operations_are_tight():
    # Of intervals without width: a few units in the last place, by those taken for arctangents.
    a, b = exact(np.array([1.1, -2.3])), exact(np.array([0.7, 3.1]))
    for c in (a + b, a - b, a * b, a / b, b.sqrt(), a.square(), a.atan()):
        assert (c.hi - c.lo <= 12 * 2.0**-52 * c.magnitude()).all()


@pytest.mark.slow
def test_sine_cosine_and_arctangent_hold_those_of_any_angle_within():
    rng = np.random.default_rng(3)
    middle = rng.uniform(-7, 7, MANY)
    width = 10.0 ** rng.uniform(-17, 0.7, MANY)
    width[::5] = 0.0
    a = Interval(middle - width, middle + width)
    (c, s), atan = a.cos_sin(), a.atan()
    for i, xs in enumerate(points_of(rng, a)):
        for x in xs:
            sine, cosine, off = sine_and_cosine(x)
            assert held(s, i, sine - off) or held(s, i, sine + off)
            assert held(c, i, cosine - off) or held(c, i, cosine + off)
        for end, x in ((atan.lo[i], xs[0]), (-atan.hi[i], -xs[1])):
            sine, cosine, off = sine_and_cosine(Fraction(float(end)))
            assert sine - off <= x * (cosine + off if x > 0 else cosine - off)


def test_half_a_turn_holds_pi():
    low, high = (sine_and_cosine(Fraction(float(x)))[0] for x in (HALF_TURN.lo, HALF_TURN.hi))
    assert low > 1e-17  # before pi the sine is positive
    assert high < -1e-17


def test_what_is_not_known_stays_so_until_something_is_met():
    unknown = Interval(np.array([np.nan]), np.array([np.nan]))
    one = exact([1.0])
    for c in (unknown + one, unknown * exact([0.0]), one / unknown, unknown.sqrt(), unknown.atan()):
        assert not c.known().any()
    met = (unknown * one).meet(one)
    assert (met.lo[0], met.hi[0]) == (1.0, 1.0)
    assert unknown.cos_sin()[0].lo[0] == -1.0


def test_intervals_of_one_shape_are_stacked():
    both = stack([exact([1.0, 2.0]), exact([3.0, 4.0])])
    np.testing.assert_array_equal(both[1].lo, [3.0, 4.0])


def some_jet(half):
    """A function of t with everything in it, as a jet and in numbers; t = 0 is at 0.4."""
    turn = angle_from(np.full_like(half, 0.4), half)
    c, s = turn.cos_sin()
    root = (c.square() + s.scaled(0.3)).plus(exact(0.5)).sqrt()
    return argument(root * c, s.times(exact(1.0) / exact(3.0)) - root)


def in_numbers(t):
    c, s = np.cos(0.4 + t), np.sin(0.4 + t)
    root = np.sqrt(c * c + 0.3 * s + 0.5)
    return np.arctan2(s / 3 - root, root * c)


def test_a_jet_holds_the_function_and_its_derivatives():
    half = np.array([0.3, 1e-2, 1e-3, 0.0])
    jet = some_jet(half)
    assert jet.bend.known().all()
    for i, h in enumerate(half):
        t = np.linspace(-h, h, 101)
        q, d = in_numbers(t), 1e-4
        # Values to 1e-14 (rounding); differences to d^2 and rounding over d, d^2.
        rate = (in_numbers(t + d) - in_numbers(t - d)) / (2 * d)
        bend = (in_numbers(t + d) - 2 * q + in_numbers(t - d)) / d**2
        for part, values, off in (
            (jet.value, q, 1e-14), (jet.rate, rate, 1e-7), (jet.bend, bend, 1e-6)
        ):  # fmt: skip
            assert (part.lo[i] - off <= values).all()
            assert (values <= part.hi[i] + off).all()
        assert abs(jet.at.middle()[i] - in_numbers(0.0)) < 1e-14
        assert jet.slope.lo[i] - 1e-7 <= rate[50] <= jet.slope.hi[i] + 1e-7


def test_a_jet_narrows_with_its_cell():
    half = np.array([1e-2, 1e-3, 1e-4])
    jet = some_jet(half)
    width = jet.bend.hi - jet.bend.lo
    # Of first order in h: ten times narrower each time, but for higher orders.
    np.testing.assert_allclose(width[:-1] / width[1:], 10.0, rtol=0.1)


def test_nothing_is_known_of_the_derivatives_where_a_root_may_be_zero():
    turn = angle_from(np.array([0.0, 0.5]), np.array([0.1, 0.1]))
    root = turn.sqrt()
    np.testing.assert_array_equal(root.bend.known(), [False, True])
    assert root.value.lo[0] == 0.0
    assert root.value.hi[0] >= np.sqrt(0.1)


def test_an_argument_near_zero_may_be_any_angle_and_elsewhere_is_continuous():
    turn = angle_from(np.array([np.pi, 0.0]), np.array([0.1, 0.1]))
    c, s = turn.cos_sin()
    whole = argument(c, s)
    assert whole.bend.known().all()  # over the cut of arctan2, too
    assert (whole.value.hi - whole.value.lo < 0.2 + 1e-12).all()
    free = argument(s, s - constant(exact(0.0), s))
    assert not free.bend.known().any()
    assert (free.value.hi - free.value.lo >= 2 * np.pi).all()
