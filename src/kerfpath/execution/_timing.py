"""How long a run takes and where it slows down, if its robot keeps every limit.

The path is fixed. The robot follows it at the programmed speed where the joint limits allow, else
as fast as they allow: time-optimal path parametrisation by reachable sets (Pham and Pham 2018).
With x the square of the rate at which programmed time passes, and u its derivative by that time
over two, both limits are linear: q'^2 x <= v^2 and |q' u + q'' x| <= a.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array, Bools
from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.execution._executed import Executed
from kerfpath.robots import Robot

__all__ = ["AT_SPEED", "Timing", "timing_of"]

AT_SPEED = 0.995
"""Share of the programmed speed that counts as holding it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Timing:
    """A run as fast as its programmed speeds and the joint limits allow.

    Parameters
    ----------
    seconds : float s
        Time from rest to rest.
    programmed : float s
        Time at the programmed speeds throughout.
    time : (m,) s
        Samples, in programmed time from the start of the run.
    share : (m,)
        Share of the programmed speed that the tool has there.
    length : (m,) m
        Distance that the tip has moved up to there.
    """

    seconds: float
    programmed: float
    time: Array
    share: Array
    length: Array

    __repr__ = short_repr

    @property
    def under_way(self) -> Bools:
        """Whether samples are between the ramps, where the speed is reached and left, (m,)."""
        held = np.flatnonzero(self.share >= AT_SPEED)
        k = np.arange(len(self.share))
        first, last = (held[0], held[-1]) if len(held) else (0, len(k))
        return np.asarray((k >= first) & (k <= last))

    @property
    def held(self) -> float:
        """Share of the length between the ramps on which the programmed speed is held."""
        steps = np.gradient(self.length)[self.under_way]
        fast = self.share[self.under_way] >= AT_SPEED
        return float(steps[fast].sum() / steps.sum()) if steps.sum() > 0 else float(fast.all())

    @property
    def ramps(self) -> tuple[float, float]:
        """Lengths, m, of the ramps to the speed at the start and from it at the end."""
        inside = self.length[self.under_way]
        return float(inside[0] - self.length[0]), float(self.length[-1] - inside[-1])

    @property
    def slowest(self) -> tuple[float, float]:
        """The smallest share of the programmed speed between the ramps, and its place, m."""
        share = np.where(self.under_way, self.share, np.inf)
        k = int(np.argmin(share))
        return float(min(share[k], 1.0)), float(self.length[k])


def timing_of(run: Executed, robot: Robot, *, eta_v: float = 1.0, eta_a: float = 1.0) -> Timing:
    """Return how long a run takes if every joint keeps its limits.

    Parameters
    ----------
    run : Executed
    robot : Robot
        Robot of the run.
    eta_v, eta_a : float
        Share of the velocity and acceleration limits that may be used.

    Raises
    ------
    InputError
        The posture does not reach some samples of the run (NaN).
    """
    velocity, acceleration = robot.speed_limits()
    first, second = run.velocity_share * velocity, run.acceleration_share * acceleration
    if np.isnan(second).any():
        raise InputError("timing_of: expected a run within reach, got joints that are NaN")
    steps = np.diff(run.time)
    room, lean, most = _rows(first, second, eta_v * velocity, eta_a * acceleration)
    x = _forward(_backward(most, steps, room, lean), steps, room, lean)
    rate = np.sqrt(x)
    pace = np.maximum((rate[1:] + rate[:-1]) / 2, 1e-9)
    gone = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(run.T[:, :3, 3], axis=0), axis=1)))
    whole = float(run.course.time[-1])
    return Timing(
        seconds=float((steps / pace).sum()),
        programmed=whole,
        time=run.time,
        share=rate,
        length=gone,
    )


def _rows(
    first: Array, second: Array, velocity: Array, acceleration: Array
) -> tuple[Array, Array, Array]:
    """Return room and lean (m, n) of |u + lean x| <= room, and the largest x (m,) of each sample.

    A joint that does not move bounds x alone. Two joints have a common u where
    |lean_1 - lean_2| x <= room_1 + room_2.
    """
    moves = np.abs(first) > 1e-12
    with np.errstate(divide="ignore", invalid="ignore"):
        room = np.where(moves, acceleration / np.abs(first), np.inf)
        lean = np.where(moves, second / first, 0.0)
        alone = np.where(moves, np.inf, acceleration / np.abs(second)).min(axis=1)
        most = np.minimum(alone, ((velocity / np.abs(first)) ** 2).min(axis=1))
        both = room[:, :, None] + room[:, None]
        pair = both / np.abs(lean[:, :, None] - lean[:, None])
    return room, lean, np.minimum(np.minimum(most, pair.min(axis=(1, 2))), 1.0)


def _backward(most: Array, steps: Array, room: Array, lean: Array) -> Array:
    """Return the largest x (m,) from which the end is reached at rest.

    A step leads from x to x + 2 step u, which must lie between zero and the x of the next sample.
    """
    reach = most.copy()
    reach[-1] = 0.0
    rate = 1 / (2 * steps[:, None])
    with np.errstate(divide="ignore"):
        rests = np.where(lean[:-1] > rate, room[:-1] / (lean[:-1] - rate), np.inf).min(axis=1)
        slope = np.where(lean[:-1] < rate, 1 / (rate - lean[:-1]), np.inf)
    for i in range(len(steps) - 1, -1, -1):
        left = ((reach[i + 1] * rate[i] + room[i]) * slope[i]).min()
        reach[i] = min(reach[i], rests[i], left)
    return reach


def _forward(reach: Array, steps: Array, room: Array, lean: Array) -> Array:
    """Return the largest x (m,) that is reached from rest."""
    x = reach.copy()
    x[0] = 0.0
    for i, step in enumerate(steps):
        u = (room[i] - lean[i] * x[i]).min()
        x[i + 1] = min(reach[i + 1], max(x[i] + 2 * step * u, 0.0))
    return x
