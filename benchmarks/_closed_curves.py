"""Random closed curves, and the expected offset of each, by GEOS (shapely) in the plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely
from scipy.spatial.transform import Rotation
from shapely import Polygon

from kerfpath import Contour, InputError
from kerfpath.arrays import Array
from kerfpath.operations import offset

__all__ = ["KINDS", "Curve", "Verdict", "curve", "judge"]

KINDS = ("polygon", "regular", "stairs", "rounded", "spline", "slot")
CHORD = 2e-6
"""m: chords of arcs and splines, as `Part.contour` samples them by default."""
EXACT = 0.006
"""Tolerance of an offset, as a share of the distance: arcs of 10 deg keep 0.996 of it."""
NOTHING = 0.02
"""Share of the distance that counts as no loss; a deeper place is not reached."""
DEEP = 0.3
"""Share of the distance above which a place that is not reached, and is no corner, is a fault."""
SURE = 0.03
"""Relative change of the beam width, both ways, that must not change a verdict that is required."""
BLUNT, SHARP = np.radians(20), np.radians(150)
"""A turn at a node above the first is a corner, which no beam reaches; above the second the beam
may not fit, and either answer is accepted."""

Answer = Literal["offset", "refused", "either"]


@dataclass(frozen=True)
class Curve:
    """A closed curve in the plane: points (K, 2) m, the first not repeated; holes are clockwise."""

    kind: str
    points: Array
    is_hole: bool
    distance: float


@dataclass(frozen=True)
class Verdict:
    """Expected and actual answer, their difference as a share of the distance, and the reason."""

    expected: Answer
    came: Literal["offset", "refused"]
    off: float
    why: str

    @property
    def right(self) -> bool:
        """Whether the answer is acceptable."""
        if self.expected != "either" and self.came != self.expected:
            return False
        return not self.off > EXACT


def curve(rng: np.random.Generator) -> Curve:
    """Return one of a random kind, size, sampling and distance."""
    kind = str(rng.choice(KINDS))
    size = 10 ** rng.uniform(-2.7, -1.0)  # 2 to 100 mm
    distance = float(rng.choice([1e-5, 1e-4, 1.5e-4, 3e-4, 5e-4, 1e-3]))
    points = _MAKERS[kind](rng, size, distance)
    if rng.random() < 0.5:  # nodes along the sides, too
        points = _filled(points, size * 10 ** rng.uniform(-2.0, -0.3))
    is_hole = bool(rng.random() < 0.7)
    area = shapely.area(Polygon(points)) and _signed(points)
    if (area > 0) == is_hole:
        points = points[::-1]
    return Curve(kind, np.roll(points, int(rng.integers(len(points))), axis=0), is_hole, distance)


def judge(drawn: Curve, rng: np.random.Generator) -> Verdict:
    """Offset a curve in a random plane in space; return the verdict on the result."""
    expected = _expected(drawn)
    turn = Rotation.random(random_state=rng).as_matrix()
    at = rng.uniform(-1, 1, 3)
    flat = np.column_stack([drawn.points, np.zeros(len(drawn.points))])
    axes = np.tile(-turn[:, 2], (len(flat), 1))
    contour = Contour(flat @ turn.T + at, axes, closed=True)
    try:
        moved = offset(contour, drawn.distance)
    except InputError as refused:
        return Verdict(expected, "refused", 0.0, str(refused))
    back = ((moved.points - at) @ turn)[:-1, :2]
    ours = shapely.LinearRing(back)
    reached = _moved(drawn, drawn.distance)
    if expected == "refused" or not isinstance(reached, Polygon) or reached.is_empty:
        return Verdict(expected, "offset", 0.0, "an offset where there is none")
    off = shapely.hausdorff_distance(ours, reached.exterior) / drawn.distance
    return Verdict(expected, "offset", float(off), "")


def _expected(drawn: Curve) -> Answer:
    """Return the answer that is required, the same for slightly wider and narrower beams."""
    kinds = {_one(drawn, drawn.distance * share) for share in (1 - SURE, 1.0, 1 + SURE)}
    return kinds.pop() if len(kinds) == 1 else "either"


def _one(drawn: Curve, distance: float) -> Answer:
    moved = _moved(drawn, distance)
    if moved.is_empty or not isinstance(moved, Polygon) or len(moved.interiors):
        return "refused"
    inside = Polygon(drawn.points)
    back = moved.buffer(distance if drawn.is_hole else -distance, quad_segs=64)
    lost = inside.difference(back) if drawn.is_hole else back.difference(inside)
    lost = lost.buffer(-NOTHING * distance / 2).buffer(NOTHING * distance / 2)
    if lost.is_empty:
        return "offset"
    turn = _turns(drawn.points)
    if (turn > SHARP).any():
        return "either"
    corners = shapely.points(drawn.points[turn > BLUNT])
    answer: Answer = "offset"
    for piece in getattr(lost, "geoms", [lost]):
        deep = shapely.hausdorff_distance(piece, back) > DEEP * distance
        near = np.count_nonzero(shapely.distance(corners, piece) < distance / 10)
        if near == 1:
            continue
        if near:  # a step lower than the beam width: lost, or a reason to refuse
            answer = "either"
            continue
        if deep:
            return "refused"
        answer = "either"
    return answer


def _moved(drawn: Curve, distance: float) -> shapely.Geometry:
    way = -distance if drawn.is_hole else distance
    return Polygon(drawn.points).buffer(way, quad_segs=64)


def _signed(points: Array) -> float:
    x, y = points.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _turns(points: Array) -> Array:
    before = points - np.roll(points, 1, axis=0)
    after = np.roll(points, -1, axis=0) - points
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.asarray(np.abs(np.arctan2(cross, (before * after).sum(axis=1))))


def _filled(points: Array, step: float) -> Array:
    """Return the points with others inserted, at most a step apart."""
    ends = np.roll(points, -1, axis=0)
    made = []
    for a, b in zip(points, ends, strict=True):
        count = min(100, max(1, int(np.ceil(np.linalg.norm(b - a) / step))))
        made.append(a + (b - a) * (np.arange(count) / count)[:, None])
    return np.vstack(made)


def _ring(rng: np.random.Generator, size: float, count: int, rough: float) -> Array:
    angle = (np.arange(count) + rng.uniform(-0.3, 0.3, count) * min(1.0, 3 * rough)) / count
    radius = size / 2 * (1 + rough * rng.uniform(-1, 1, count))
    return np.stack(
        [radius * np.cos(2 * np.pi * angle), radius * np.sin(2 * np.pi * angle)], axis=1
    )


def _polygon(rng: np.random.Generator, size: float, distance: float) -> Array:
    return _ring(rng, size, int(rng.integers(3, 25)), float(rng.uniform(0, 0.6)))


def _regular(rng: np.random.Generator, size: float, distance: float) -> Array:
    return _ring(rng, size, int(rng.integers(3, 80)), 0.0)


def _stairs(rng: np.random.Generator, size: float, distance: float) -> Array:
    """Return a block with steps on its upper side."""
    count = int(rng.integers(1, 6))
    x = np.sort(rng.uniform(0, size, count - 1))
    x = np.concatenate([[0.0], x, [size]])
    y = rng.uniform(0.3, 1.0, count) * size
    top = [(px, h) for k, h in enumerate(y) for px in (x[k], x[k + 1])]
    return np.array([(0.0, 0.0), *top, (size, 0.0)])[::-1]


def _rounded(rng: np.random.Generator, size: float, distance: float) -> Array:
    """Return a rectangle whose corners have a radius."""
    w, h = size, size * rng.uniform(0.2, 1.0)
    radius = min(w, h) / 2 * rng.uniform(0.02, 1.0)
    step = 2 * np.arccos(max(1 - CHORD / radius, 0.0))
    count = max(3, int(np.ceil(np.pi / 2 / step)))
    arc = np.linspace(0, np.pi / 2, count + 1)
    round_ = np.stack([np.cos(arc), np.sin(arc)], axis=1) * radius
    made = []
    for k, (sx, sy) in enumerate([(1, 1), (-1, 1), (-1, -1), (1, -1)]):
        corner = np.array([sx * (w / 2 - radius), sy * (h / 2 - radius)])
        made.append(
            corner + round_ @ Rotation.from_euler("z", 90 * k, degrees=True).as_matrix()[:2, :2].T
        )
    points = np.vstack(made)
    apart = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1) > 1e-8
    return np.asarray(points[apart])


def _spline(rng: np.random.Generator, size: float, distance: float) -> Array:
    """Return a smooth curve, its radius a sum of waves."""
    waves = int(rng.integers(2, 7))
    gain = rng.normal(size=(2, waves)) * rng.uniform(0, 0.5) / np.arange(1, waves + 1) ** 1.5
    t = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    k = np.arange(1, waves + 1)[:, None]
    radius = size / 2 * np.exp(gain[0] @ np.cos(k * t) + gain[1] @ np.sin(k * t))
    return np.stack([radius * np.cos(t), radius * np.sin(t)], axis=1)


def _slot(rng: np.random.Generator, size: float, distance: float) -> Array:
    """Return a slot with round ends, from narrower than the beam to much wider."""
    half = distance * 10 ** rng.uniform(-0.3, 1.0)
    step = 2 * np.arccos(max(1 - CHORD / half, 0.0))
    count = max(4, int(np.ceil(np.pi / step)))
    arc = np.linspace(-np.pi / 2, np.pi / 2, count + 1)
    end = np.stack([np.cos(arc), np.sin(arc)], axis=1) * half
    middle = np.array([size / 2, 0.0])
    return np.vstack([end + middle, -end - middle])


_MAKERS = {
    "polygon": _polygon,
    "regular": _regular,
    "stairs": _stairs,
    "rounded": _rounded,
    "spline": _spline,
    "slot": _slot,
}
