"""How long a run takes and where it slows down, if its robot keeps every limit.

The path is fixed, and the robot goes along it at the programmed speed where the limits of its
joints let it, else as fast as they do: time-optimal path parametrisation by reachable sets (Pham
and Pham 2018). With x the square of the rate at which programmed time passes, and u its derivative
by that time over two, both limits are linear: q'^2 x <= v^2 and |q' u + q'' x| <= a.
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
    """A run as fast as its programmed speeds and the limits of the joints let it be.

    Parameters
    ----------
    seconds : float s
        That it takes from rest to rest.
    programmed : float s
        That it would take at the programmed speeds throughout.
    time : (m,) s
        Where it was looked at, in programmed time from the start of the run.
    share : (m,)
        Of the programmed speed that the tool has there.
    length : (m,) m
        That the tip has gone until there.
    """

    seconds: float
    programmed: float
    time: Array
    share: Array
    length: Array

    __repr__ = short_repr

    @property
    def under_way(self) -> Bools:
        """Between the ramps: from where the speed is reached to where it is left, (m,)."""
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
        """Lengths, m, in which the speed is reached at the start and left at the end."""
        inside = self.length[self.under_way]
        return float(inside[0] - self.length[0]), float(self.length[-1] - inside[-1])

    @property
    def slowest(self) -> tuple[float, float]:
        """The least share of the programmed speed between the ramps, and at which length, m."""
        share = np.where(self.under_way, self.share, np.inf)
        k = int(np.argmin(share))
        return float(min(share[k], 1.0)), float(self.length[k])


def timing_of(run: Executed, robot: Robot, *, eta_v: float = 1.0, eta_a: float = 1.0) -> Timing:
    """Return how long a run takes if every joint keeps its limits.

    Parameters
    ----------
    run : Executed
    robot : Robot
        Of the run.
    eta_v, eta_a : float
        Share of the velocity and acceleration limits that may be used.

    Raises
    ------
    InputError
        Joints that are not reached: there is no motion.
    """
    velocity, acceleration = robot.speed_limits()
    first, second = run.velocity_share * velocity, run.acceleration_share * acceleration
    if np.isnan(second).any():
        raise InputError("timing_of: expected a run whose joints are in reach")
    velocity, acceleration = eta_v * velocity, eta_a * acceleration
    steps = np.diff(run.time)
    most = _most(first, second, velocity, acceleration)
    x = _forward(
        _backward(most, steps, first, second, acceleration), steps, first, second, acceleration
    )
    rate = np.sqrt(x)
    pace = np.maximum((rate[1:] + rate[:-1]) / 2, 1e-9)
    points = run.course.poses(run.time)[:, :3, 3]
    gone = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    whole = float(run.course.time[-1])
    return Timing(
        seconds=float((steps / pace).sum()),
        programmed=whole,
        time=run.time,
        share=rate,
        length=gone,
    )


def _most(first: Array, second: Array, velocity: Array, acceleration: Array) -> Array:
    """Return the largest x (m,) at each sample by itself, the programmed pace at most."""
    with np.errstate(divide="ignore"):
        most = np.minimum(1.0, ((velocity / np.abs(first)) ** 2).min(axis=1))
    return np.array(
        [
            min(x, _largest(*_lines(f, s, acceleration)))
            for x, f, s in zip(most, first, second, strict=True)
        ]
    )


def _lines(first: Array, second: Array, acceleration: Array) -> tuple[Array, Array, float]:
    """Return bounds of u by x at a sample: low and high (j, 2) of c0 + c1 x, and the largest x.

    |q' u + q'' x| <= a, of the joints that move; of one that does not, q'' x <= a.
    """
    moves = np.abs(first) > 1e-12
    with np.errstate(divide="ignore"):
        alone = (acceleration / np.abs(second))[~moves].min(initial=np.inf)
    f, s, a = np.abs(first[moves]), (second * np.sign(first))[moves], acceleration[moves]
    return np.c_[-a / f, -s / f], np.c_[a / f, -s / f], float(alone)


def _largest(low: Array, high: Array, alone: float) -> float:
    """Return the largest x for which there is a u; each pair of bounds asks for low <= high."""
    gap = high[None, :, 0] - low[:, None, 0]
    slope = low[:, None, 1] - high[None, :, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(min(np.where(slope > 0, gap / slope, np.inf).min(initial=np.inf), alone))


def _backward(most: Array, steps: Array, first: Array, second: Array, acceleration: Array) -> Array:
    """Return the largest x (m,) from which the end is reached at rest."""
    reach = most.copy()
    reach[-1] = 0.0
    for i in range(len(steps) - 1, -1, -1):
        low, high, alone = _lines(first[i], second[i], acceleration)
        # x + 2 u step stays between rest and what the next sample is left from.
        low = np.vstack([low, [0.0, -0.5 / steps[i]]])
        high = np.vstack([high, [0.5 * reach[i + 1] / steps[i], -0.5 / steps[i]]])
        reach[i] = max(min(reach[i], _largest(low, high, alone)), 0.0)
    return reach


def _forward(reach: Array, steps: Array, first: Array, second: Array, acceleration: Array) -> Array:
    """Return the largest x (m,) that is come to from rest."""
    x = reach.copy()
    x[0] = 0.0
    for i, step in enumerate(steps):
        _, high, _ = _lines(first[i], second[i], acceleration)
        u = (high[:, 0] + high[:, 1] * x[i]).min(initial=np.inf)
        x[i + 1] = min(reach[i + 1], max(x[i] + 2 * step * u, 0.0))
    return x
