"""How far gamma may change from layer to layer in a tube, and what ties its squares by that.

With p the parabola or cubic of a joint at layer k, and m and m' the intervals before and after it,
the change of the mean increments is, for increments d and d' of gamma and e = d' / m' - d / m,

    p'(t) e + (p''(x') d'^2 / m' + p''(x) d^2 / m) / 2 + what the curves of the layers differ,

which (6) bounds: so e lies in an interval, by every joint that gamma moves. Gamma stays in an
interval at each layer, too; both bound d (`steps_of_gamma`). In the programs of tubes the squares
w of gamma are free between the parabola and its chord, each by itself. Their differences are not:

    w' - w = d (t + t'),    (w' - w) / m' - (w - w") / m = 2 t e + d'^2 / m' + d^2 / m,

and products of bounded factors lie between planes (McCormick, Mathematical Programming 10 (1976)
147). These hold for every motion of the tube, so that any multipliers of them give a valid bound.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from kerfpath.arrays import Array, Ints
from kerfpath.certifier.stages import Steps
from kerfpath.conic import SparseRows

ROUNDS = 3
"""How often the changes of gamma and the changes of these narrow each other."""
ROUNDED, WIDER = 1e-12, 1e-9
"""Relative error allowed for rounding: of quotients, and of sums along the tube in half-widths."""
TOUCHES = 0.0, 0.5, 1.0
"""Where in its interval the square of a change of gamma is held from below."""


class Changes(NamedTuple):
    """Least and largest change d (M - 1,) of gamma, and e (M - 2,) of its mean, in rad."""

    least: Array
    most: Array
    bend_least: Array
    bend_most: Array


def steps_of_gamma(
    power: Array, spread: Array, half: Array, spans: Ints, steps: Steps, change: Array
) -> tuple[Changes | None, int]:
    """Return the changes of gamma that motions of a tube may make; None if there is no motion.

    Then the second is the layer that rules all out.

    Parameters
    ----------
    power : (M, 4, n)
        Coefficients of the joints by powers of gamma from the middle, rad per rad to the power.
    spread : (M, n) rad
        How far the joints may be from the cubics.
    half : (M,) rad
    spans : (M - 1,)
    steps : Steps
    change : (M - 2, n) rad
        Bound (6) at the layers between the first and the last, by their distance.
    """
    before, after = spans[:-1].astype(float), spans[1:].astype(float)
    velocity = np.stack([steps.over(int(m)).velocity for m in spans])
    h, order = half[:, None], np.arange(1, 4)[:, None, None]
    moved = np.diff(power[:, 0], axis=0)
    apart = np.maximum(h[1:], h[:-1])
    # By (5): p'(x) d is the increment but for what both curves differ.
    differs = (np.abs(np.diff(power, axis=0)[:, 1:].swapaxes(0, 1)) * h[:-1] ** order).sum(axis=0)
    differs += spread[1:] + spread[:-1]
    least, most = _quotients(
        -velocity - moved - differs, velocity - moved + differs, *_slopes(power[1:], apart)
    )
    reach = half[1:] + half[:-1]
    least, most = np.maximum(least, -reach), np.minimum(most, reach)
    # By (6).
    one, two = 1 / before[:, None], 1 / after[:, None]
    own = power[1:-1]
    back, ahead = power[:-2] - own, power[2:] - own
    wide = np.maximum(apart[1:], apart[:-1])
    both = (ahead * two[:, None] + back * one[:, None])[:, 1:].swapaxes(0, 1)
    unsure = (np.abs(both) * h[1:-1] ** order).sum(axis=0)
    unsure += spread[2:] * two + spread[:-2] * one + spread[1:-1] * (one + two)
    each = order * wide ** (order - 1)
    drift = [(np.abs(p[:, 1:].swapaxes(0, 1)) * each).sum(axis=0) for p in (back, ahead)]
    level = moved[1:] * two - moved[:-1] * one
    slope = _slopes(own, h[1:-1])
    curved = 2 * own[:, 2]
    lowest, highest = curved - 6 * np.abs(own[:, 3]) * wide, curved + 6 * np.abs(own[:, 3]) * wide
    bend_least, bend_most = np.full(len(own), -np.inf), np.full(len(own), np.inf)
    for _ in range(ROUNDS):
        far = np.maximum(np.abs(least), np.abs(most))
        near = np.maximum(np.maximum(least, -most), 0.0)
        top = (far[1:] ** 2 / after + far[:-1] ** 2 / before)[:, None]
        low = (near[1:] ** 2 / after + near[:-1] ** 2 / before)[:, None]
        down = np.minimum(lowest * low, lowest * top) / 2
        up = np.maximum(highest * low, highest * top) / 2
        loose = unsure + drift[1] * far[1:, None] * two + drift[0] * far[:-1, None] * one
        found = _quotients(-change - level - loose - up, change - level + loose - down, *slope)
        bend_least = np.maximum(bend_least, found[0])
        bend_least = np.maximum(bend_least, least[1:] / after - most[:-1] / before)
        bend_most = np.minimum(bend_most, found[1])
        bend_most = np.minimum(bend_most, most[1:] / after - least[:-1] / before)
        if (bend_least > bend_most).any():
            return None, int(np.argmax(bend_least - bend_most)) + 1
        least, most = _narrowed(least, most, bend_least, bend_most, half, spans)
        if (least > most).any():
            return None, int(np.argmax(least - most))
    return Changes(least, most, bend_least, bend_most), 0


def _slopes(power: Array, half: Array) -> tuple[Array, Array]:
    """Return the least and the largest slope (..., n) of cubics within (..., 1) of the middle."""
    linear = np.abs(2 * power[:, 2]) * half
    cubic = 3 * power[:, 3] * half**2
    low = power[:, 1] - linear + np.minimum(cubic, 0.0)
    return low, power[:, 1] + linear + np.maximum(cubic, 0.0)


def _quotients(low: Array, high: Array, least: Array, most: Array) -> tuple[Array, Array]:
    """Return the interval (N,) of what each joint's slope may take from `low` to `high`, (N, n).

    The slopes lie between `least` and `most`; joints whose slope may be zero say nothing.
    """
    falls = most < 0
    low, high = np.where(falls, -high, low), np.where(falls, -low, high)
    least, most = np.where(falls, -most, least), np.where(falls, -least, most)
    tells = least > 0
    least, most = np.where(tells, least, 1.0), np.where(tells, most, 1.0)
    rounded = ROUNDED * (np.abs(low) + np.abs(high)) / least
    first = low / np.where(low >= 0, most, least) - rounded
    last = high / np.where(high >= 0, least, most) + rounded
    first, last = np.where(tells, first, -np.inf), np.where(tells, last, np.inf)
    return first.max(axis=1), last.min(axis=1)


def _narrowed(
    least: Array, most: Array, bend_least: Array, bend_most: Array, half: Array, spans: Ints
) -> tuple[Array, Array]:
    """Return the changes of gamma that keep it in all intervals, with e as it may be.

    From layer a to b gamma changes by the sum of m d / m; all of these follow from one of them and
    from e.
    """
    count = len(spans)
    place = np.append(0.0, np.cumsum(spans))
    low, high = np.empty(count), np.empty(count)
    for k in range(count):
        ahead = np.append(0.0, np.cumsum(bend_least[k:])), np.append(0.0, np.cumsum(bend_most[k:]))
        up = [np.cumsum(spans[k:] * each) for each in ahead]
        back = [np.append(0.0, np.cumsum(each[:k][::-1])) for each in (bend_least, bend_most)]
        down = [np.cumsum(np.append(0.0, spans[:k][::-1]) * each) for each in back]
        total = place[k + 1 :, None] - place[: k + 1][::-1]
        reach = half[k + 1 :, None] + half[: k + 1][::-1]
        high[k] = ((reach - up[0][:, None] + down[1]) / total).min()
        low[k] = ((-reach - up[1][:, None] + down[0]) / total).max()
    rounded = WIDER * (half[1:] + half[:-1])
    return np.maximum(least, low * spans - rounded), np.minimum(most, high * spans + rounded)


def within(changes: Changes, half: Array) -> tuple[Array, Array]:
    """Return the ends (M,) of the parts of the intervals that steps lead to and from."""
    low, high = -half, half.copy()
    for k, (least, most) in enumerate(zip(changes.least, changes.most, strict=True)):
        low[k + 1] = max(low[k + 1], low[k] + least)
        high[k + 1] = min(high[k + 1], high[k] + most)
    for k in range(len(half) - 2, -1, -1):
        low[k] = max(low[k], low[k + 1] - changes.most[k])
        high[k] = min(high[k], high[k + 1] - changes.least[k])
    rounded = WIDER * half + ROUNDED
    return low - rounded, high + rounded


def ties(changes: Changes, half: Array, spans: Ints) -> tuple[SparseRows, Array]:
    """Return rows (R, 2 M) and their largest values (R,), of gamma and its squares.

    Both are in units of half-widths, as in the programs of tubes.
    """
    M, dia = len(half), sparse.diags_array
    unit = sparse.eye_array(2 * M, format="csr")
    t: SparseRows = dia(half) @ unit[:M]
    w: SparseRows = dia(half**2) @ unit[M:]
    least, most, bend_least, bend_most = changes
    before, after = 1 / spans[:-1], 1 / spans[1:]
    d, both, square = t[1:] - t[:-1], t[1:] + t[:-1], w[1:] - w[:-1]
    reach = half[1:] + half[:-1]
    rows: list[tuple[SparseRows, Array]] = [
        (d, most),
        (-d, -least),
        (dia(least) @ both - dia(reach) @ d - square, -least * reach),
        (dia(most) @ both + dia(reach) @ d - square, most * reach),
        (square - dia(most) @ both + dia(reach) @ d, most * reach),
        (square - dia(least) @ both - dia(reach) @ d, -least * reach),
    ]
    if M > 2:
        e = dia(after) @ d[1:] - dia(before) @ d[:-1]
        bent = dia(after) @ square[1:] - dia(before) @ square[:-1]
        own, h = t[1:-1], half[1:-1]
        chord = dia((least + most)[1:] * after) @ d[1:]
        chord = chord + dia((least + most)[:-1] * before) @ d[:-1]
        level = (least * most)[1:] * after + (least * most)[:-1] * before
        rows += [
            (e, bend_most),
            (-e, -bend_least),
            (bent - chord - 2 * (dia(bend_most) @ own - dia(h) @ e), 2 * bend_most * h - level),
            (bent - chord - 2 * (dia(bend_least) @ own + dia(h) @ e), -2 * bend_least * h - level),
        ]
        for share in TOUCHES:
            at = least + share * (most - least)
            touch = 2 * (dia(at[1:] * after) @ d[1:] + dia(at[:-1] * before) @ d[:-1]) - bent
            level = at[1:] ** 2 * after + at[:-1] ** 2 * before
            rows += [
                (touch + 2 * (dia(bend_least) @ own - dia(h) @ e), level - 2 * bend_least * h),
                (touch + 2 * (dia(bend_most) @ own + dia(h) @ e), level + 2 * bend_most * h),
            ]
    row = sparse.csr_array(sparse.vstack([a for a, _ in rows]))
    bound = np.concatenate([b for _, b in rows])
    size = abs(row).max(axis=1).toarray().ravel()
    size[size == 0] = 1.0
    return dia(1 / size) @ row, bound / size
