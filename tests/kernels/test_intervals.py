"""Balls and jets hold what they say: against exact fractions, and functions of forty digits."""

from fractions import Fraction

import mpmath as mp
import numpy as np
import pytest

from from_python import all_of
from kerfpath.kernels import intervals as kernels
from kerfpath.kernels.intervals import Jet

mp.mp.dps = 40
intervals = all_of(kernels)


def random_balls(rng, count):
    """Middles over many powers of ten and of both signs, radii from nothing to their own size."""
    m = rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-8, 8, count)
    r = np.abs(m) * rng.choice([0.0, 1e-16, 1e-9, 0.9], count)
    return list(zip(m.tolist(), r.tolist(), strict=True))


def inside(m, r):
    """Both ends of a ball and its middle, exactly."""
    return Fraction(m) - Fraction(r), Fraction(m), Fraction(m) + Fraction(r)


@pytest.mark.parametrize("name", ["plus", "times", "over"])
def test_a_ball_holds_every_result_of_what_its_operands_hold(name):
    exact = {"plus": lambda a, b: a + b, "times": lambda a, b: a * b, "over": lambda a, b: a / b}
    rng = np.random.default_rng(1)
    for a, b in zip(random_balls(rng, 2000), random_balls(rng, 2000), strict=True):
        low = (abs(b[0]) - b[1]) * intervals.DOWN
        more = (low,) if name == "over" else ()
        m, r = getattr(intervals, name)(*a, *b, *more)
        for x in inside(*a):
            for y in inside(*b):
                assert abs(exact[name](x, y) - Fraction(m)) <= Fraction(r)


def wave(a, p, q):
    """The jet of a + p cos t + q sin t on a cell, and the function."""
    return lambda h: intervals.turning(
        a, 0.0, p, 0.0, q, 0.0, h
    ), lambda t: mp.mpf(a) + mp.mpf(p) * mp.cos(t) + mp.mpf(q) * mp.sin(t)


def shares(w):
    """Functions of two waves as jets and in forty digits, each by its name."""
    (x, fx), (y, fy) = w
    square = lambda f, h: intervals.mul(f, f, h)  # noqa: E731

    def norm(h):
        return intervals.add(square(x(h), h), square(y(h), h))

    def heading(h):
        return intervals.angle(y(h), x(h), 0.0, h)

    def level(h):  # a cosine: x / 4, waves being below 4
        return intervals.scale(x(h), 0.25, 0.0)

    def fold(h):
        c = level(h)
        return intervals.arc_between(c, h)

    def branch(t):  # arctangent near its value in the middle, whatever the branch
        angle, at = mp.atan2(fy(t), fx(t)), mp.atan2(fy(0), fx(0))
        return angle - 2 * mp.pi * mp.nint((angle - at) / (2 * mp.pi))

    return {
        "wave": (x, fx),
        "sum": (lambda h: intervals.add(x(h), y(h)), lambda t: fx(t) + fy(t)),
        "product": (lambda h: intervals.mul(x(h), y(h), h), lambda t: fx(t) * fy(t)),
        "scaled": (lambda h: intervals.scale(x(h), 0.3, 0.0), lambda t: fx(t) * mp.mpf(0.3)),
        "shifted": (lambda h: intervals.shift(x(h), 0.3, 0.0), lambda t: fx(t) + mp.mpf(0.3)),
        "root": (
            lambda h: intervals.root(norm(h), 0.0, h),
            lambda t: mp.sqrt(fx(t) ** 2 + fy(t) ** 2),
        ),
        "angle": (heading, branch),
        "arc": (fold, lambda t: mp.acos(fx(t) / 4)),
        "cosine": (lambda h: intervals.cosine_of(heading(h), h), lambda t: mp.cos(branch(t))),
        "sine": (lambda h: intervals.sine_of(heading(h), h), lambda t: mp.sin(branch(t))),
    }


NAMES = list(shares((wave(1, 0, 0), wave(1, 0, 0))))


def known(f):
    return np.isfinite([f.rv, f.rd, f.rs, f.ed]).all()


@pytest.mark.parametrize("name", NAMES)
def test_a_jet_holds_value_slope_and_curvature_on_its_cell(name):
    rng = np.random.default_rng(2)
    held = 0
    for _ in range(60):
        w = [wave(*rng.uniform(-1.3, 1.3, 3)) for _ in range(2)]
        h = float(10.0 ** rng.uniform(-7, -1))
        make, f = shares(w)[name]
        jet = Jet(*make(h))
        if not known(jet):
            continue
        held += 1
        value, slope, _ = mp.taylor(f, 0, 2)
        assert abs(value - jet.v) <= jet.ev
        assert abs(slope - jet.d) <= jet.ed
        # Rounding at most: a hundred operations of a unit in the last place, slopes up to a
        # thousand where a norm is small.
        assert jet.ev < 1e-12
        for t in (-h, h * float(rng.uniform(-1, 1)), h):
            value, slope, half_curvature = mp.taylor(f, mp.mpf(t), 2)
            assert abs(value - jet.v) <= jet.rv
            assert abs(slope - jet.d) <= jet.rd
            assert abs(2 * half_curvature - jet.s) <= jet.rs
    assert held > 50


@pytest.mark.parametrize("name", NAMES)
def test_the_spread_of_a_jet_shrinks_with_its_cell(name):
    make, _ = shares((wave(0.4, 1.1, 0.2), wave(-0.3, 0.5, 0.9)))[name]
    wide, narrow = Jet(*make(1e-3)), Jet(*make(1e-4))
    # First order in h, for value, slope and curvature; a little is of second order.
    for spread in ("rv", "rd", "rs"):
        assert getattr(narrow, spread) < 0.11 * getattr(wide, spread) + 1e-14


def test_what_touches_an_end_of_its_domain_is_boxed():
    h = 1e-3
    zero = intervals.turning(0.0, 0.0, 0.0, 0.0, 1.0, 0.0, h)  # sin t
    one = intervals.turning(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, h)  # cos t
    root = Jet(*intervals.root(zero, 0.0, h))
    assert root.v - root.rv <= 0.0
    assert root.v + root.rv >= np.sqrt(np.sin(h))
    turn = Jet(*intervals.angle(zero, zero, 0.0, h))
    assert turn.rv >= np.pi
    arc = Jet(*intervals.arc_between(one, h))
    assert arc.v - arc.rv <= 0.0
    assert arc.v + arc.rv >= h
    assert not any(known(f) for f in (root, turn, arc))


def test_whatever_is_made_of_the_unknown_is_unknown():
    h = 1e-3
    free = intervals.boxed(-1.0, 1.0)
    nothing = intervals.constant(0.0, 0.0)
    for f in (
        intervals.mul(free, nothing, h),
        intervals.mul(free, free, h),
        intervals.add(free, nothing),
        intervals.scale(free, 0.0, 0.0),
        intervals.cosine_of(free, h),
        intervals.root(intervals.shift(free, 2.0, 0.0), 0.0, h),
        intervals.angle(free, intervals.constant(2.0, 0.0), 0.0, h),
        intervals.arc_between(intervals.scale(free, 0.5, 0.0), h),
    ):
        assert not known(Jet(*f))
        assert np.isfinite(Jet(*f).rv)
