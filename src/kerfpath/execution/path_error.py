"""How far the tool is from the contour that it cuts, as the joints of the arm execute a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial import cKDTree

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.contour import KINDS, Contour
from kerfpath.execution.executed import Executed, Timing, timing_of
from kerfpath.execution.response import IDEAL, Response
from kerfpath.plans import reversals

STEP = 0.002
"""Time, s, between two samples of an executed motion."""
SAMPLES = 8
"""Number of samples of the path for each of its nodes, or each target."""


LEADS = [KINDS.index(kind) for kind in ("pierce", "lead-in", "lead-out")]
"""Kinds of stretches in the waste."""
GIVE = 0.03
"""To which share of themselves shares of a speed are found."""
SLOWEST = 0.1
"""Smallest share of the speed at which a tolerance is looked for."""


class Reversal(NamedTuple):
    """A joint, counted from 0, that turns back under way, and the time, s, at which it does."""

    joint: int
    time: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PathError:
    """Distance of the tool from the path that it cuts, sample by sample.

    Parameters
    ----------
    response : Response
        How the joints follow what is commanded.
    time : (m,) s
        Samples, from the start of the run.
    s : (m,) m
        Arc length of the point of the path that is nearest to the tip.
    waste : (m,) bool
        Whether that is where the beam leads in or out, in the waste: no error there is judged.
    T : (m, 4, 4) m
        Executed poses of the tip, in the part.
    tip : (m,) m
        Distance of the tip from the path.
    axis : (m,) rad
        Angle between the tool axis and the axis of the path there.
    rounding : (m,) m
        Distance of the tip from the path if the joints did not lag.
    lag, friction : (m,) m
        Distance of the way without friction from that without lag, and of the way from it.
    ends : tuple of float m
        Largest distances at the ends of the range of sigma; empty without one.
    reversals : tuple of Reversal
        Where joints 1 to 3 reverse, in order of time.
    """

    response: Response
    time: Array
    s: Array
    waste: Bools
    T: Array
    tip: Array
    axis: Array
    rounding: Array
    lag: Array
    friction: Array
    ends: tuple[float, ...]
    reversals: tuple[Reversal, ...]

    __repr__ = short_repr

    @property
    def worst(self) -> int:
        """The sample with the largest distance of the tip, leads left out."""
        return int(np.argmax(np.where(self.waste, -1.0, self.tip)))

    @property
    def worst_axis(self) -> int:
        """The sample with the largest angle of the tool axis, leads left out."""
        return int(np.argmax(np.where(self.waste, -1.0, self.axis)))

    @property
    def largest(self) -> float:
        """The largest distance of the tip, m, leads left out."""
        return float(self.tip[self.worst])

    @property
    def usual(self) -> float:
        """The distance of the tip, m, that 95 % of its way keeps, leads left out."""
        way = np.linalg.norm(np.gradient(self.T[:, :3, 3], axis=0), axis=1)
        way[self.waste] = 0.0
        order = np.argsort(self.tip)
        gone = np.cumsum(way[order])
        return float(self.tip[order][np.searchsorted(gone, 0.95 * gone[-1])])

    @property
    def range_words(self) -> str:
        """The largest distances at the ends of the range of sigma, in words; empty without one."""
        if self.response.sigma_range is None:
            return ""
        low, high = (f"{end * 1e3:.2g}" for end in self.ends)
        least, most = self.response.sigma_range * 1e3
        return f"{low} to {high} mm for {least:g} to {most:g} ms"

    @property
    def cause(self) -> str:
        """What the largest distance consists of, in words and mm."""
        k = self.worst
        found = [f"rounding of corners {self.rounding[k] * 1e3:.2g} mm"]
        if self.response.model != "ideal":
            found.append(f"lag of the joints {self.lag[k] * 1e3:.2g} mm")
        before = [each for each in self.reversals if each.time <= self.time[k]]
        if self.response.friction and before:
            found.append(
                f"friction after joint {before[-1].joint + 1} reversed "
                f"{self.friction[k] * 1e3:.2g} mm"
            )
        return ", ".join(found)


def path_error(
    run: Executed, path: Contour, *, timing: Timing | None = None, response: Response = IDEAL
) -> PathError:
    """Return how far the tip is from the path, and the tool axis from that of the nearest point.

    Parameters
    ----------
    run : Executed
    path : Contour
        The contour as drawn, in the part.
    timing : Timing, optional
        When the robot passes the samples of the run; without it, joints do not lag, and the
        distances are those at the samples of the run.
    response : Response
        How the joints follow what is commanded.

    Raises
    ------
    InputError
        The response does not fit the robot.
    """
    drawn = _Drawn.of(path, len(run.tool_motion.T))
    if timing is None:
        s, tip, axis = drawn.nearest(run.T)
        none = np.zeros(len(tip))
        return PathError(
            response=IDEAL, time=run.time, s=s, waste=drawn.waste(s), T=run.T, tip=tip, axis=axis,
            rounding=tip, lag=none, friction=none, ends=(), reversals=(),
        )  # fmt: skip
    q = response.standing_around(commanded(run, timing), STEP)

    def poses(how: Response) -> Array:
        return _tips(run, how.executed(q, STEP, run.robot))

    asked = poses(IDEAL)
    executed = asked if response.model == "ideal" else poses(response)
    free = poses(response.without_friction()) if response.friction else executed
    s, tip, axis = drawn.nearest(executed)
    return PathError(
        response=response,
        time=np.linspace(0.0, STEP * (len(q) - 1), len(q)),
        s=s,
        waste=drawn.waste(s),
        T=executed,
        tip=tip,
        axis=axis,
        rounding=drawn.nearest(asked)[1],
        lag=_apart(free, asked),
        friction=_apart(executed, free),
        ends=tuple(drawn.largest(poses(end)) for end in response.ends()),
        reversals=_reversals(q, STEP),
    )


def _apart(T: Array, other: Array) -> Array:
    """Return the distances (m,) m of poses (m, 4, 4) from the way of others (k, 4, 4)."""
    return Polyline.of(other[:, :3, 3]).nearest(T[:, :3, 3])[2]


class Roundness(NamedTuple):
    """A hole that is drawn as a circle, and as it is cut.

    Its diameters, m, and how far the cut is from its own circle, inwards and outwards together, m.
    """

    drawn: float
    executed: float
    out_of_round: float


WHOLE = np.radians(330.0)
"""rad: arcs of a larger angle are holes."""
ON_CIRCLE = 5e-3
"""Share of the radius by which points of a circle may be off it: chords of 12 deg."""


def roundness(off: PathError, path: Contour) -> Roundness | None:
    """Return size and roundness of the executed cut of a circle; None if none is drawn.

    Both circles are those of least squares. Stretches that lead in and out are left out.
    """
    cut = np.array([kind in ("cut", "loop", "overlap") for kind in path.kinds])
    if cut.sum() < 8:
        return None
    points = path.points[cut]
    centre = points.mean(axis=0)
    plane = np.linalg.svd(points - centre)[2][:2]
    drawn = _circle((points - centre) @ plane.T)
    if drawn is None or drawn.spread > ON_CIRCLE * drawn.radius or drawn.angle < WHOLE:
        return None
    of = np.clip(np.searchsorted(path.s, off.s, side="right") - 1, 0, len(path) - 1)
    found = _circle((off.T[cut[of], :3, 3] - centre) @ plane.T)
    if found is None:
        return None
    return Roundness(2 * drawn.radius, 2 * found.radius, found.spread)


class _Circle(NamedTuple):
    """The circle through points by least squares: its radius, the spread of theirs, the angle."""

    radius: float
    spread: float
    angle: float


def _circle(points: Array) -> _Circle | None:
    """Return the circle through points (m, 2) m, equally weighted by length; None for a line."""
    rows = np.c_[2 * points, np.ones(len(points))]
    way = np.linalg.norm(np.gradient(points, axis=0), axis=1)[:, None] ** 0.5
    (x, y, c), _, rank, _ = np.linalg.lstsq(rows * way, (points**2).sum(1) * way[:, 0], rcond=1e-9)
    if rank < 3:
        return None
    away = points - (x, y)
    radii = np.linalg.norm(away, axis=1)
    angles = np.sort(np.arctan2(away[:, 1], away[:, 0]))
    gaps = np.diff(angles, append=angles[0] + 2 * np.pi)
    radius = float(np.sqrt(c + x * x + y * y))
    return _Circle(radius, float(np.ptp(radii)), float(2 * np.pi - gaps.max()))


def share_within(
    run: Executed, path: Contour, tolerance: float, response: Response
) -> float | None:
    """Return the largest share of its speed at which a run stays within a tolerance, m.

    It is found to 3 %, with the zones of the program and the same way of the joints; None if the
    corners alone are too wide, or if `SLOWEST` of the speed is too fast.
    """
    drawn, alone = _Drawn.of(path, len(run.tool_motion.T)), replace(response, sigma_range=None)

    def largest(share: float, how: Response) -> float:
        q = how.standing_around(commanded(run, timing_of(run, speed_share=share)), STEP)
        return drawn.largest(_tips(run, how.executed(q, STEP, run.robot)))

    full, corners = largest(1.0, alone), largest(1.0, IDEAL)
    if full <= tolerance:
        return 1.0
    if corners >= tolerance:
        return None

    def holds(share: float) -> bool:
        return largest(share, alone) <= tolerance

    # The lag moves the tip about as the square of the speed, so the share is known nearly.
    low = (1 - GIVE / 2) * float(np.sqrt((tolerance - corners) / (full - corners)))
    if low <= SLOWEST:
        return largest_share(holds, low)
    if not holds(low):
        return largest_share(holds, (1 - GIVE) * low, low)
    high = low / (1 - GIVE)
    return largest_share(holds, high) if high < 1 and holds(high) else low


def _tips(run: Executed, q: Array) -> Array:
    """Return the poses (m, 4, 4) of the tip in the part at joints q (m, n) rad."""
    return np.asarray(np.linalg.inv(run.T_base_part) @ run.robot.forward(q) @ run.T_flange_tip)


def largest_share(
    holds: Callable[[float], bool], first: float, too_fast: float = 1.0
) -> float | None:
    """Return the largest share of a speed, to 3 %, at which something holds.

    It is looked for from `first` down, and then up to `too_fast` by halving; None if it does not
    hold at `SLOWEST` of the speed.
    """
    low = first
    while not holds(low := max(low, SLOWEST)):
        if low == SLOWEST:
            return None
        too_fast, low = low, 0.8 * low
    while too_fast - low > GIVE * too_fast * (1 + 1e-9):
        middle = float(np.sqrt(low * too_fast))
        low, too_fast = (middle, too_fast) if holds(middle) else (low, middle)
    return low


def commanded(run: Executed, timing: Timing) -> Array:
    """Return the joints (m, n) rad that are commanded every `STEP` s, from standing to standing."""
    velocity, _ = run.robot.speed_limits()
    return even_joints(
        timing.clock, run.time, timing.share, run.q, run.velocity_share * velocity, STEP,
        again=run.tool_motion.again,
    )  # fmt: skip


def even_joints(
    clock: Array, time: Array, rate: Array, q: Array, first: Array, step: float, *,
    again: float = 0.0,
) -> Array:  # fmt: skip
    """Return joints (k, n) at even times from samples of a motion.

    Between samples, programmed time passes at constant acceleration, and joints follow the cubics
    through values and velocities.

    Parameters
    ----------
    clock, time : (m,) s
        When the samples are passed, and where they are in programmed time.
    rate : (m,)
        Rates at which programmed time passes there.
    q, first : (m, n)
        Joints, and their velocities by programmed time.
    step : float s
        Time between two samples that are returned.
    again : float s
        Programmed time over which the joints are averaged, less than that near both ends.
    """
    even = np.append(np.arange(0.0, clock[-1], step), clock[-1])
    within = np.clip(CubicHermiteSpline(clock, time, rate)(even), time[0], time[-1])
    way = CubicHermiteSpline(time, q, first)
    joints = np.asarray(way(within))
    half = np.minimum(again / 2, np.minimum(within - time[0], time[-1] - within))
    some = half > step  # over less than two steps, nothing changes
    gone, at, half = way.antiderivative(), within[some], half[some]
    joints[some] = (gone(at + half) - gone(at - half)) / (2 * half[:, None])
    return joints


def _reversals(q: Array, step: float) -> tuple[Reversal, ...]:
    """Return where the first three joints of q (m, n) reverse, m samples every `step` s."""
    turned = reversals(np.diff(q, axis=0) / step)
    return tuple(sorted((Reversal(joint, k * step) for joint, k in turned), key=itemgetter(1)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Drawn:
    """A path with samples along it, for the points of it that are nearest to others."""

    path: Contour
    at: Array
    line: Polyline

    @classmethod
    def of(cls, path: Contour, targets: int) -> _Drawn:
        even = np.linspace(path.s[0], path.s[-1], SAMPLES * max(len(path), targets))
        at = np.unique(np.concatenate([path.s, even]))
        return cls(path=path, at=at, line=Polyline.of(path.at(at)[0]))

    def waste(self, s: Array) -> Bools:
        """Return whether the beam leads in or out at arc lengths (m,) m; never if it only does."""
        of = np.clip(np.searchsorted(self.path.s, s, side="right") - 1, 0, len(self.path) - 2)
        found = np.isin(self.path.kind, LEADS)[of]
        return np.zeros_like(found) if found.all() else found

    def largest(self, T: Array) -> float:
        """Return the largest distance of poses (m, 4, 4) from the path, leads left out."""
        s, off, _ = self.nearest(T)
        return float(off[~self.waste(s)].max())

    def nearest(self, T: Array) -> tuple[Array, Array, Array]:
        """Return for poses (m, 4, 4) the nearest arc lengths, distances and angles, (m,) each."""
        tip, axis = T[:, :3, 3], T[:, :3, 2]
        start, along, _ = self.line.nearest(tip)
        s = self.at[start] + along * (self.at[start + 1] - self.at[start])
        points, axes = self.path.at(s)
        off = np.linalg.norm(tip - points, axis=1)
        cross = np.linalg.norm(np.cross(axes, axis), axis=1)
        return s, off, np.arctan2(cross, (axes * axis).sum(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Polyline:
    """Points (k, 3) m joined by chords, for the places of it that are nearest to others."""

    points: Array
    tree: cKDTree

    @classmethod
    def of(cls, points: Array) -> Polyline:
        return cls(points=points, tree=cKDTree(points))

    def nearest(self, tip: Array) -> tuple[Ints, Array, Array]:
        """Return for points (m, 3) the nearest chord, the share of it, and the distance."""
        near: Ints = np.asarray(self.tree.query(tip)[1])
        # On one of the two chords beside the nearest point.
        starts = np.clip(near[:, None] + [-1, 0], 0, len(self.points) - 2)
        along, far = on_chords(tip[:, None], self.points[starts], self.points[starts + 1])
        row, side = np.arange(len(tip)), np.argmin(far, axis=1)
        return starts[row, side], along[row, side], far[row, side]


def on_chords(tip: Array, start: Array, end: Array) -> tuple[Array, Array]:
    """Return the shares of chords (..., 3) m at the places nearest to points, and the distances."""
    chord = end - start
    long = np.maximum((chord**2).sum(-1), 1e-300)
    along = np.clip(((tip - start) * chord).sum(-1) / long, 0.0, 1.0)
    return along, np.linalg.norm(start + along[..., None] * chord - tip, axis=-1)
