"""How LinuxCNC runs a program: a model of its planner of paths, version 2.9, for joints as words.

The planner looks ahead one move. Each move speeds up evenly, keeps its speed and slows down evenly
to rest, at half the acceleration. While it slows down, the next one speeds up: the corner between
them is a parabola in the joints. How long they overlap follows from both moves and from the
tolerance of `G64`. Source: LinuxCNC, src/emc/tp/tp.c, tpComputeBlendVelocity and tpGetScaledAccel.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from kerfpath.arrays import Array, freeze, short_repr
from kerfpath.post.languages import MotionFromStop
from kerfpath.post.linuxcnc.controller import LinuxcncSettings, cruise_time, goes_nowhere, ramp_of
from kerfpath.post.read_program import ReadMove, ReadProgram, ReadWait
from kerfpath.robots import Robot

LEADING = 3
"""Number of joints, X, Y and Z, whose corner keeps the tolerance."""
STRAIGHT = 1e-3
"""Sine of half the turn of these joints below which a corner counts as straight."""
STILL = 1e-12
"""Least share of a limit per time, so that nothing is divided by 0."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stretch:
    """Moves from one stop to the next, all joints together.

    Parameters
    ----------
    moves : tuple of ReadMove
    q : (m+1, n) rad
        Joints at the first stop and at the target of each move.
    begin : (m,) s
        When each move begins, from the first.
    knots : (m, 5) s
        Times, from its beginning, between which each speeds up with the move before, speeds up
        alone, keeps its speed, and slows down.
    speed : (m, 5) 1/s
        Its speed at these times, in shares of its way.
    asked : (m,) s
        Time that the program gives each at constant speed.
    """

    moves: tuple[ReadMove, ...]
    q: Array
    begin: Array
    knots: Array
    speed: Array
    asked: Array

    __repr__ = short_repr

    @property
    def time(self) -> float:
        """Time from stop to stop, s."""
        return float((self.begin + self.knots[:, -1]).max(initial=0.0))

    def at(self, time: Array) -> Array:
        """Return the joints (M, n) rad at increasing times (M,) s from the first beginning."""
        end = self.begin + self.knots[:, -1]
        q = self.q[np.searchsorted(end, time, side="right")]
        for k, way in enumerate(np.diff(self.q, axis=0)):
            now = slice(*np.searchsorted(time, (self.begin[k], end[k]), side="right"))
            gone = time[now] - self.begin[k]
            q[now] += self._share(k, gone)[:, None] * way
        return q

    def _share(self, k: int, gone: Array) -> Array:
        """Return the share of the way of a move that is done after times (M,) s."""
        knots, speed = self.knots[k], self.speed[k]
        step = np.diff(knots)
        done = np.append(0.0, np.cumsum(step * (speed[:-1] + speed[1:]) / 2))
        i = np.clip(np.searchsorted(knots, gone, side="right") - 1, 0, len(step) - 1)
        t = gone - knots[i]
        slope = (speed[i + 1] - speed[i]) / np.maximum(step[i], STILL)
        return np.asarray(done[i] + t * (speed[i] + slope * t / 2))


def stretches_of(
    read: ReadProgram, robot: Robot, settings: LinuxcncSettings
) -> Iterator[Stretch | float]:
    """Yield the moves of a program from stop to stop, and its waits (s), in their order."""
    here: Array | None = None
    found: list[ReadMove] = []
    for step in read.steps:
        if isinstance(step, ReadWait):
            yield step.time
        if not isinstance(step, ReadMove):
            continue
        assert step.q is not None
        found.append(step)
        if step.zone != 0:
            continue
        if here is not None:
            yield stretch_of(found, here, robot, settings)
        found, here = [], step.q


def stretch_of(
    found: Sequence[ReadMove], here: Array, robot: Robot, settings: LinuxcncSettings
) -> Stretch:
    """Return how LinuxCNC runs moves, from joints (n,) rad where the robot stands to a stop."""
    q = np.vstack([here, *(move.q for move in found if move.q is not None)])
    goes = [k for k, way in enumerate(np.diff(q, axis=0)) if not goes_nowhere(way)]
    moves, q = tuple(found[k] for k in goes), q[[0, *(k + 1 for k in goes)]]
    ways = np.diff(q, axis=0)
    asked = np.array([_cruise(move, way, robot) for move, way in zip(moves, ways, strict=True)])
    return stretch(moves, q, asked, robot, settings)


def run_moves(
    robot: Robot, q: Array, planned: Array, settings: LinuxcncSettings, step: float
) -> MotionFromStop:
    """Return how moves run through joints q (m+1, n) rad, from stop to stop, every `step` s.

    A move ends where the next one begins. Those that go nowhere take their planned times (m,) s.
    """
    took, found = planned.copy(), q[[0, -1]]
    goes = np.array([not goes_nowhere(way) for way in np.diff(q, axis=0)])
    if goes.any():
        run = stretch((), q[np.append(True, goes)], planned[goes], robot, settings)
        took[goes] = np.diff(np.append(run.begin, run.time))
        # Up to the last sample before the end, at which joints are still looked up.
        found = np.vstack([run.at(np.arange(0.0, run.time * (1 - 1e-9), step)), q[-1:]])
    return MotionFromStop(took=took, q=found)


def stretch(
    moves: tuple[ReadMove, ...], q: Array, asked: Array, robot: Robot, settings: LinuxcncSettings
) -> Stretch:
    """Return how LinuxCNC runs moves through joints q (m+1, n) rad that ask for times (m,) s."""
    way = np.diff(q, axis=0)
    velocity, acceleration = robot.speed_limits()
    gain = 1 / np.maximum((np.abs(way) / acceleration).max(axis=1), STILL)
    if len(way) > 1:
        gain = gain / 2
    most = 1 / np.maximum((np.abs(way) / velocity).max(axis=1), STILL)
    aim = np.minimum(1 / asked, most)
    lead = np.degrees(way[:, :LEADING])
    begin, knots, speed = _profiles(aim, gain, lead, settings.tolerance_deg)
    return Stretch(moves=moves, q=freeze(q), begin=begin, knots=knots, speed=speed, asked=asked)


def _cruise(move: ReadMove, way: Array, robot: Robot) -> float:
    """Return the time (s) of a move at constant speed."""
    assert move.duration is not None
    if move.kind != "joint":
        return move.duration
    return cruise_time(move.duration, ramp_of(robot, way))


def _profiles(aim: Array, gain: Array, lead: Array, tolerance: float) -> tuple[Array, Array, Array]:
    """Return when moves begin (m,) s, and the knots (m, 5) s and speeds (m, 5) 1/s of each.

    Parameters
    ----------
    aim : (m,) 1/s
        Highest speed of each move, in shares of its way.
    gain : (m,) 1/s^2
        Its acceleration.
    lead : (m, 3) deg
        Way of the leading joints.
    tolerance : float deg
    """
    reached = np.minimum(aim, np.sqrt(gain))
    ends = [*_overlaps(reached, gain, lead, tolerance), (0.0, 0.0)][: len(aim)]
    begin, knots, speed = [], [], []
    clock, rise, start = 0.0, 0.0, 0.0
    for most, a, (slowed, after) in zip(aim.tolist(), gain.tolist(), ends, strict=True):
        gone = start * rise / 2
        peak = max(min(most, np.sqrt(max(a * (1 - gone) + start**2 / 2, 0.0))), start)
        up, down = (peak - start) / a, peak / a
        cruise = (1 - gone - (peak**2 - start**2 / 2) / a) / peak
        begin.append(clock)
        knots.append(np.cumsum([0.0, rise, up, max(cruise, 0.0), down]))
        speed.append([0.0, start, peak, peak, 0.0])
        rise, start = min(slowed, peak) / a, after
        clock += float(knots[-1][-1]) - rise
    return np.array(begin), np.array(knots).reshape(-1, 5), np.array(speed).reshape(-1, 5)


def _overlaps(
    reached: Array, gain: Array, lead: Array, tolerance: float
) -> Iterator[tuple[float, float]]:
    """Yield, for each corner, the speed (1/s) below which the next begins, and that of the next."""
    length = np.linalg.norm(lead, axis=1)
    unit = lead / np.maximum(length, STILL)[:, None]
    for i, j in pairwise(range(len(reached))):
        most = min(1 / reached[i], 1 / reached[j])
        time = min(most, max(reached[i] / gain[i], reached[j] / gain[j]))
        pair = [min(reached[k], time * gain[k]) for k in (i, j)]
        sine = np.sqrt(max(1 - unit[i] @ unit[j], 0.0) / 2)
        if sine > STRAIGHT and length[i] > STILL and length[j] > STILL:
            speed = 2 * np.sqrt(gain[i] * length[i] * tolerance / sine)
            pair = [min(v, speed / length[k]) for v, k in zip(pair, (i, j), strict=True)]
        yield float(pair[0]), float(pair[1])
