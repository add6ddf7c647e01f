"""Numbers that enclose every value a function of gamma may take on a cell: balls and jets.

A ball (m, r) is the set of reals from m - r to m + r. A jet encloses a function f of t on the cell
|t| <= h: f(0) in v +- ev, f'(0) in d +- ed, and for every t of the cell f in v +- rv, f' in
d +- rd, f'' in s +- rs. A radius that is infinite or NaN means that nothing is known.

The radii include rounding. A sum or product of floats errs by at most half a unit in the last
place, so that EPS times the size of its terms covers a middle; UP covers up to 31 roundings of a
radius, and TINY covers underflow. The machine's library is assumed to compute sin, cos and atan2
within 4 units in the last place; sqrt is exact to half a unit (IEEE 754). Products and quotients
follow Rump, "Fast and parallel interval arithmetic" (BIT 39, 1999).
"""

from __future__ import annotations

from math import atan2, cos, inf, pi, sin, sqrt
from typing import NamedTuple

from kerfpath.kernels.jit import jit_inline, jit_part, smaller

__all__ = [
    "DOWN",
    "EPS",
    "LIBM",
    "TINY",
    "UP",
    "Jet",
    "add",
    "angle",
    "arc",
    "arc_between",
    "boxed",
    "constant",
    "cosine_of",
    "least_norm",
    "mul",
    "over",
    "plus",
    "root",
    "scale",
    "settled",
    "shift",
    "sine_of",
    "spread",
    "times",
    "turning",
]

EPS = 2.0**-52
UP = 1.0 + 2.0**-48
DOWN = 1.0 - 2.0**-48
TINY = 1e-300
LIBM = 4.0 * EPS
"""Error of a sine or cosine; that of an angle in (-pi, pi] is at most twice as large."""
SMALL = 1e-16
"""Length (m) or sine below which no division is made."""


class Jet(NamedTuple):
    """A function on a cell; see the docstring of this module."""

    v: float
    ev: float
    d: float
    ed: float
    rv: float
    rd: float
    s: float
    rs: float


@jit_inline
def plus(a: float, ra: float, b: float, rb: float) -> tuple[float, float]:
    """Sum of two balls."""
    m = a + b
    return m, (ra + rb + EPS * abs(m)) * UP + TINY


@jit_inline
def times(a: float, ra: float, b: float, rb: float) -> tuple[float, float]:
    """Product of two balls."""
    m = a * b
    return m, (abs(a) * rb + ra * (abs(b) + rb) + EPS * abs(m)) * UP + TINY


@jit_inline
def over(a: float, ra: float, b: float, rb: float, low: float) -> tuple[float, float]:
    """Quotient of two balls, the second further from zero than low > 0, its middle not zero."""
    m = a / b
    return m, ((ra + abs(m) * rb) / low + EPS * abs(m)) * UP + TINY


@jit_inline
def settled(f: Jet, h: float) -> Jet:
    """Narrow the spread of value and slope by the mean value theorem."""
    bend = abs(f.s) + f.rs
    rd = smaller(f.rd, (f.ed + h * bend) * UP)
    drift = smaller(rd, (f.ed + 0.5 * h * bend) * UP)
    rv = smaller(f.rv, (f.ev + h * (abs(f.d) + drift)) * UP)
    return Jet(f.v, f.ev, f.d, f.ed, rv, rd, f.s, f.rs)


@jit_inline
def constant(m: float, r: float) -> Jet:
    """Return the ball (m, r) as a constant jet."""
    return Jet(m, r, 0.0, 0.0, r, 0.0, 0.0, 0.0)


@jit_inline
def boxed(low: float, high: float) -> Jet:
    """Return a jet of which only the least and the greatest value are known."""
    m = 0.5 * (low + high)
    r = (0.5 * (high - low) + EPS * (abs(low) + abs(high))) * UP
    return Jet(m, r, 0.0, inf, r, inf, 0.0, inf)


@jit_inline
def turning(a: float, ra: float, p: float, rp: float, q: float, rq: float, h: float) -> Jet:
    """Return a + p cos t + q sin t of three balls, |t| <= h."""
    v, ev = plus(a, ra, p, rp)
    P, Q = abs(p) + rp, abs(q) + rq
    sway, fall = h * UP, 0.5 * h * h * UP
    return Jet(
        v,
        ev,
        q,
        rq,
        (ev + P * fall + Q * sway) * UP,
        (rq + P * sway + Q * fall) * UP,
        -p,
        (rp + P * fall + Q * sway) * UP,
    )


@jit_inline
def add(a: Jet, b: Jet) -> Jet:
    """Sum of two jets."""
    v, ev = plus(a.v, a.ev, b.v, b.ev)
    d, ed = plus(a.d, a.ed, b.d, b.ed)
    s, rs = plus(a.s, a.rs, b.s, b.rs)
    rv = (a.rv + b.rv + EPS * abs(v)) * UP + TINY
    rd = (a.rd + b.rd + EPS * abs(d)) * UP + TINY
    return Jet(v, ev, d, ed, rv, rd, s, rs)


@jit_inline
def shift(a: Jet, m: float, r: float) -> Jet:
    """Return a jet plus a ball."""
    v, ev = plus(a.v, a.ev, m, r)
    rv = (a.rv + r + EPS * abs(v)) * UP + TINY
    return Jet(v, ev, a.d, a.ed, rv, a.rd, a.s, a.rs)


@jit_inline
def scale(a: Jet, m: float, r: float) -> Jet:
    """Return a jet times a ball."""
    v, ev = times(a.v, a.ev, m, r)
    d, ed = times(a.d, a.ed, m, r)
    s, rs = times(a.s, a.rs, m, r)
    _, rv = times(a.v, a.rv, m, r)
    _, rd = times(a.d, a.rd, m, r)
    return Jet(v, ev, d, ed, rv, rd, s, rs)


@jit_inline
def mul(a: Jet, b: Jet, h: float) -> Jet:
    """Product of two jets on a cell |t| <= h."""
    v, ev = times(a.v, a.ev, b.v, b.ev)
    _, rv = times(a.v, a.rv, b.v, b.rv)
    m1, e1 = times(a.d, a.ed, b.v, b.ev)
    m2, e2 = times(a.v, a.ev, b.d, b.ed)
    d, ed = plus(m1, e1, m2, e2)
    _, r1 = times(a.d, a.rd, b.v, b.rv)
    _, r2 = times(a.v, a.rv, b.d, b.rd)
    _, rd = plus(m1, r1, m2, r2)
    m3, r3 = times(a.s, a.rs, b.v, b.rv)
    m4, r4 = times(a.d, a.rd, b.d, b.rd)
    m5, r5 = times(a.v, a.rv, b.s, b.rs)
    m6, r6 = plus(m3, r3, m5, r5)
    s, rs = plus(m6, r6, 2.0 * m4, 2.0 * r4)
    return settled(Jet(v, ev, d, ed, rv, rd, s, rs), h)


@jit_part
def root(g: Jet, low: float, h: float) -> Jet:
    """Square root of a jet where it is not negative; it is nowhere below low."""
    high = (g.v + g.rv) * UP
    low = max(low, (g.v - g.rv) - EPS * abs(g.v))
    top = sqrt(max(high, 0.0)) * UP
    if low < SMALL * SMALL or g.v < SMALL * SMALL:
        return boxed(sqrt(max(low, 0.0)) * DOWN, top)
    v, bottom = sqrt(g.v), sqrt(low) * DOWN
    # f = sqrt(g): g' = 2 f f', g'' = 2 f'^2 + 2 f f''.
    ev = (g.ev / (v + bottom) + EPS * v) * UP
    rv = (g.rv / (v + bottom) + EPS * v) * UP
    d, ed = over(0.5 * g.d, 0.5 * g.ed, v, ev, bottom)
    _, rd = over(0.5 * g.d, 0.5 * g.rd, v, rv, bottom)
    dd, rdd = times(d, rd, d, rd)
    n, rn = plus(0.5 * g.s, 0.5 * g.rs, -dd, rdd)
    s, rs = over(n, rn, v, rv, bottom)
    return settled(Jet(v, ev, d, ed, rv, rd, s, rs), h)


@jit_inline
def least_norm(x: Jet, y: Jet) -> float:
    """Lower bound of x^2 + y^2 on the cell."""
    nx, ny = max(0.0, abs(x.v) - x.rv), max(0.0, abs(y.v) - y.rv)
    return (nx * nx + ny * ny) * DOWN - TINY


@jit_inline
def spread(distance: float, size: float) -> float:
    """Largest angle between two vectors, one of length `size`, that differ by `distance`."""
    if distance < 0.5 * size:
        return 1.0473 * distance / size  # asin x <= (pi / 3) x up to 1/2
    return 0.5 * pi * UP * distance / size if distance < size else pi * UP


@jit_inline
def _rate(
    x: tuple[float, float],
    y: tuple[float, float],
    dx: tuple[float, float],
    dy: tuple[float, float],
) -> tuple[float, float]:
    """Return x dy - y dx of balls."""
    m1, r1 = times(x[0], x[1], dy[0], dy[1])
    m2, r2 = times(y[0], y[1], dx[0], dx[1])
    return plus(m1, r1, -m2, r2)


@jit_part
def angle(y: Jet, x: Jet, low: float, h: float) -> Jet:
    """Angle atan2(y, x) of two jets, x^2 + y^2 being nowhere below low.

    Its rate is (x y' - y x') / (x^2 + y^2), whatever the branch.
    """
    nx, rx = times(x.v, x.rv, x.v, x.rv)
    ny, ry = times(y.v, y.rv, y.v, y.rv)
    n, rn = plus(nx, rx, ny, ry)
    low = max(low, least_norm(x, y))
    if n < SMALL or low < SMALL * SMALL:
        return boxed(-pi * UP, pi * UP)
    _, ex = times(x.v, x.ev, x.v, x.ev)
    _, ey = times(y.v, y.ev, y.v, y.ev)
    _, en = plus(nx, ex, ny, ey)
    size = sqrt(n) * DOWN
    v = atan2(y.v, x.v)
    ev = (spread(x.ev + y.ev, size) + 2.0 * LIBM) * UP
    rv = (spread(sqrt(x.rv * x.rv + y.rv * y.rv) * UP, size) + 2.0 * LIBM) * UP
    m, em = _rate((x.v, x.ev), (y.v, y.ev), (x.d, x.ed), (y.d, y.ed))
    d, ed = over(m, em, n, en, low)
    _, rm = _rate((x.v, x.rv), (y.v, y.rv), (x.d, x.rd), (y.d, y.rd))
    _, rd = over(m, rm, n, rn, low)
    # n q'' = x y'' - y x'' - n' q'.
    c, rc = _rate((x.v, x.rv), (y.v, y.rv), (x.s, x.rs), (y.s, y.rs))
    g1, rg1 = times(x.v, x.rv, x.d, x.rd)
    g2, rg2 = times(y.v, y.rv, y.d, y.rd)
    g, rg = plus(g1, rg1, g2, rg2)
    t, rt = times(2.0 * g, 2.0 * rg, d, rd)
    c, rc = plus(c, rc, -t, rt)
    s, rs = over(c, rc, n, rn, low)
    return settled(Jet(v, ev, d, ed, rv, rd, s, rs), h)


@jit_part
def arc(c: Jet, sine: float, es: float, rs: float, low: float, h: float) -> Jet:
    """Angle in [0, pi] whose cosine is c and whose sine is `sine` +- es, over the cell +- rs.

    The sine is nowhere below low. The rate is -c' / sine.
    """
    v = atan2(sine, c.v)
    ev = (spread(c.ev + es, 1.0) + 2.0 * LIBM) * UP
    rv = (spread(sqrt(c.rv * c.rv + rs * rs) * UP, 1.0) + 2.0 * LIBM) * UP
    if low < SMALL or sine < SMALL:
        return Jet(v, rv, 0.0, inf, rv, inf, 0.0, inf)
    d, ed = over(-c.d, c.ed, sine, es, low)
    _, rd = over(-c.d, c.rd, sine, rs, low)
    # sine q'' = -c'' - c q'^2.
    qq, rqq = times(d, rd, d, rd)
    t, rt = times(c.v, c.rv, qq, rqq)
    n, rn = plus(-c.s, c.rs, -t, rt)
    s, rq = over(n, rn, sine, rs, low)
    return settled(Jet(v, ev, d, ed, rv, rd, s, rq), h)


@jit_inline
def _arccos(c: float) -> float:
    return atan2(sqrt((1.0 - c) * (1.0 + c)), c)


@jit_part
def arc_between(c: Jet, h: float) -> Jet:
    """Angle in [0, pi] whose cosine is c; c is clipped to [-1, 1]."""
    first = _arccos(max(-1.0, min(1.0, (c.v + c.rv) + EPS))) - 2.0 * LIBM
    last = _arccos(min(1.0, max(-1.0, (c.v - c.rv) - EPS))) + 2.0 * LIBM
    most = (abs(c.v) + c.rv) * UP
    if most >= 1.0:
        return boxed(first, last)
    low = sqrt((1.0 - most) * (1.0 + most)) * DOWN
    mid = min(most, (abs(c.v) + c.ev) * UP)
    sine = sqrt((1.0 - c.v) * (1.0 + c.v))
    es = (c.ev * mid / (sqrt((1.0 - mid) * (1.0 + mid)) * DOWN) + 2.0 * EPS) * UP
    rs = (c.rv * most / low + 2.0 * EPS) * UP
    f = arc(c, sine, es, rs, low, h)
    rv = smaller(f.rv, max(last - f.v, f.v - first) * UP + EPS)
    return Jet(f.v, f.ev, f.d, f.ed, rv, f.rd, f.s, f.rs)


@jit_part
def _circular(k: float, s: float, q: Jet, h: float) -> Jet:
    """Return f with f(0) = k, f' = -s q' and f'' = -s q'' - f q'^2; k, s are cos, sin or alike."""
    if not q.rv < 1.0:
        return Jet(0.0, 1.0, 0.0, inf, 1.0, inf, 0.0, inf)
    e, r = q.ev + LIBM, q.rv + LIBM
    rk = (abs(s) * r + 0.5 * r * r + 2.0 * LIBM) * UP
    rs = (abs(k) * r + 0.5 * r * r + 2.0 * LIBM) * UP
    d, ed = times(-s, e, q.d, q.ed)
    _, rd = times(-s, rs, q.d, q.rd)
    qq, rqq = times(q.d, q.rd, q.d, q.rd)
    m1, r1 = times(-s, rs, q.s, q.rs)
    m2, r2 = times(k, rk, qq, rqq)
    c, rc = plus(m1, r1, -m2, r2)
    return settled(Jet(k, e, d, ed, rk, rd, c, rc), h)


@jit_inline
def cosine_of(q: Jet, h: float) -> Jet:
    """Cosine of an angle."""
    return _circular(cos(q.v), sin(q.v), q, h)


@jit_inline
def sine_of(q: Jet, h: float) -> Jet:
    """Sine of an angle."""
    return _circular(sin(q.v), -cos(q.v), q, h)
