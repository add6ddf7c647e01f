"""The pose of the tool over time, from stop to stop, by programmed speeds and zones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, Bools, Ints, freeze, short_repr
from kerfpath.auditor import MotionPieces
from kerfpath.post import (
    PLAIN,
    CircularMove,
    Controller,
    LinearMove,
    Orientation,
    circle_through,
)

SHORTEST = 1e-9
"""Shortest time (s) of a move or a stretch."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ToolMotion:
    """The pose of the tool over time, at the programmed speeds.

    Between the zones the tip moves straight or along an arc at the programmed speed, and the tool
    turns as `orientation` says. Within `half` s of a target, tip and angles change from one move to
    the next at constant acceleration; between straight moves, that is a parabola tangent to both.
    This is a model: makers of controllers publish the zones, but not the motion in them.

    Parameters
    ----------
    T : (K, 4, 4) m
        Poses of the tip at the targets, in the part; the robot stops at the first and the last.
    duration : (K-1,) s
        Time of each move.
    half : (K,) s
        Time in the zone before, and after, each target.
    centre, normal : (K-1, 3) m, 1
        Circle of each move, in the part; the normal is zero where the move is straight.
    orientation : {"slerp", "two-angle"}
        How the tool turns between two targets, see `Controller`.
    stretch : (K-1,), optional
        Share by which each move takes longer because of the controller's cycle, in `duration`.
    again : float s
        Time over which the joints are averaged once more, see `Controller.rounds_twice`. The poses
        here are those before that.

    Attributes
    ----------
    time : (K,) s
        Times at the targets.
    sweep : (K-1,) rad
        Angle of the arc of each move; 0 if it is straight.
    """

    T: Array
    duration: Array
    half: Array
    centre: Array
    normal: Array
    orientation: Orientation = "slerp"
    stretch: Array | None = None
    again: float = 0.0
    time: Array = field(init=False)
    sweep: Array = field(init=False)
    _along: Array = field(init=False, repr=False)
    _rate: Array = field(init=False, repr=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        R = self.T[:, :3, :3]
        turn = _turns(R[:-1].transpose(0, 2, 1) @ R[1:], self.orientation)
        start, end = self.T[:-1, :3, 3] - self.centre, self.T[1:, :3, 3] - self.centre
        across = np.cross(self.normal, start)
        angle = np.arctan2((end * across).sum(1), (end * start).sum(1)) % (2 * np.pi)
        values = {
            "time": np.append(0.0, np.cumsum(self.duration)),
            "sweep": np.where(self._round, angle, 0.0),
            "_along": np.diff(self.T[:, :3, 3], axis=0) / self.duration[:, None],
            "_rate": turn / self.duration[:, None],  # as seen where moves begin, and end
        }
        for name, value in values.items():
            object.__setattr__(self, name, freeze(value))

    @classmethod
    def of(
        cls, start: Array, moves: Sequence[LinearMove], controller: Controller = PLAIN
    ) -> ToolMotion:
        """Return the motion along moves from a pose, (4, 4) m, to a stop.

        Parameters
        ----------
        start : (4, 4) m
            T_part_tip where the first move begins.
        moves : sequence of LinearMove
        controller : Controller
            With orientation "wrist" the motion gives the tip's place, not the tool's orientation.
        """
        T = np.array([start, *(move.T_part_tip for move in moves)])
        via = [move.T_part_via if isinstance(move, CircularMove) else None for move in moves]
        law = "slerp" if controller.orientation == "wrist" else controller.orientation
        even = cls.through(T, via, law)
        speed = np.array([move.speed for move in moves])
        length, turn = even.lengths, even._rate[0]
        parts = [turn] if law == "slerp" else [turn[:, :2], turn[:, 2:]]
        angle = np.max([np.linalg.norm(part, axis=1) for part in parts], axis=0)
        duration = np.maximum(length / speed, angle / controller.turning_speed)
        duration = np.maximum(duration, SHORTEST)
        stretch = controller.stretch(duration)
        duration = duration * (1 + stretch)
        zone = np.array([controller.zone(move.zone, move.speed) for move in moves[:-1]])
        fastest = length / duration
        half = zone / np.maximum(np.maximum(fastest[:-1], fastest[1:]), 1e-12)
        room = np.minimum(duration[:-1], duration[1:]) / 2
        half = np.append(0.0, np.append(np.minimum(half, room), 0.0))
        twice = controller.rounds_twice and len(moves) > 1
        again = float(2 * np.median(half[1:-1])) if twice else 0.0
        return replace(even, duration=duration, half=half, stretch=stretch, again=again)

    @classmethod
    def through(
        cls, T: Array, via: Sequence[Array | None], orientation: Orientation = "slerp"
    ) -> ToolMotion:
        """Return the motion through poses, (K, 4, 4) m, without zones: each move takes a second.

        A move is an arc where its pose in `via`, of K-1 poses (4, 4) m or None, is not None.
        """
        centre, normal = np.zeros((2, len(via), 3))
        for k, middle in enumerate(via):
            circle = None
            if middle is not None:
                circle = circle_through(T[k, :3, 3], middle[:3, 3], T[k + 1, :3, 3])
            if circle is not None:  # None: the three are on a line
                centre[k], normal[k], _ = circle
        return cls(
            T=T, duration=np.ones(len(via)), half=np.zeros(len(T)), centre=centre, normal=normal,
            orientation=orientation,
        )  # fmt: skip

    @property
    def lengths(self) -> Array:
        """Length of each move, (K-1,) m."""
        chord = np.linalg.norm(np.diff(self.T[:, :3, 3], axis=0), axis=1)
        radius = np.linalg.norm(self.T[:-1, :3, 3] - self.centre, axis=1)
        return np.asarray(np.where(self._round, radius * self.sweep, chord))

    @property
    def borders(self) -> Array:
        """Times, s, of ends and middles of moves and of ends of zones, smooth in between."""
        between = (self.time[1:] + self.time[:-1]) / 2
        ends = [self.time, between, self.time - self.half, self.time + self.half]
        every = np.unique(np.clip(np.concatenate(ends), 0.0, self.time[-1]))
        return np.asarray(every[np.append(True, np.diff(every) > SHORTEST)])

    def poses(self, time: Array) -> Array:
        """Return T_part_tip, (m, 4, 4) m, at times (m,) s from the start."""
        k, near, blend = self._at(time)
        left, right = self._beside(near)
        away = time - self.time[near]
        end_left, end_right = self._velocity(left, ends=True), self._velocity(right, ends=False)
        T = np.tile(np.eye(4), (len(time), 1, 1))
        T[:, :3, 3] = self._points(k, time - self.time[k]) + blend[:, None] * (end_right - end_left)
        before, after = self._rate[1, left], self._rate[0, right]
        rate = np.where((near == k)[:, None], after, before)
        turn = away[:, None] * rate + blend[:, None] * (after - before)
        T[:, :3, :3] = self.T[near, :3, :3] @ _turned(turn, self.orientation)
        return T

    def blended(self, values: Array, time: Array) -> Array:
        """Return values (m, c) at times (m,) that change evenly between those at targets (K, c).

        In zones they are blended as straight moves are.
        """
        k, near, blend = self._at(time)
        left, right = self._beside(near)
        slope = np.diff(values, axis=0) / self.duration[:, None]
        even = values[k] + (time - self.time[k])[:, None] * slope[k]
        return np.asarray(even + blend[:, None] * (slope[right] - slope[left]))

    def pieces(self, external: Array | None = None) -> MotionPieces:
        """Return the motion as closed formulas of the time, one between each two borders.

        External axes follow `blended` between values (K, E) at the targets; default: none.
        """
        values = np.zeros((len(self.T), 0)) if external is None else external
        borders = self.borders
        middle = (borders[1:] + borders[:-1]) / 2
        k, near, blend = self._at(middle)
        left, right = self._beside(near)
        zero, half, after = self.time[near], self.half[near], near == k
        move = np.where(after, right, left)
        velocity = np.stack([self._velocity(left, ends=True), self._velocity(right, ends=False)])
        rates = np.stack([self._rate[1, left], self._rate[0, right]])
        slope = np.diff(values, axis=0) / self.duration[:, None]
        bends = np.where((blend > 0) & (half > 0), 1 / np.maximum(4 * half, 1e-12), 0.0)

        def parts(own: Array, change: Array) -> Array:
            # plus bends (half -+ t)^2 times the change from one move to the next
            b, sign = (bends[:, None] * change, np.where(after, -2.0, 2.0)[:, None])
            wide = half[:, None]
            return np.stack([b * wide**2, own + sign * wide * b, 2 * b], axis=1)

        arc = self._round[move]
        straight = np.where(arc[:, None], 0.0, np.where(after[:, None], velocity[1], velocity[0]))
        point = parts(straight, velocity[1] - velocity[0])
        point[:, 0] += np.where(arc[:, None], self.centre[move], self.T[near, :3, 3])
        x = np.where(arc[:, None], self.T[near, :3, 3] - self.centre[move], 0.0)
        even = parts(slope[move], slope[right] - slope[left])
        even[:, 0] += values[near]
        return MotionPieces(
            begin=borders[:-1] - zero,
            end=borders[1:] - zero,
            R=self.T[near, :3, :3],
            turn=parts(np.where(after[:, None], rates[1], rates[0]), rates[1] - rates[0]),
            point=point,
            x=x,
            y=np.cross(self.normal[move], x),
            rate=np.where(arc, self.sweep[move] / self.duration[move], 0.0),
            external=even,
            two_angles=self.orientation == "two-angle",
        )

    def _at(self, time: Array) -> tuple[Ints, Ints, Array]:
        """Return move, nearest target in time, and share of the blend, s, at times (m,)."""
        k = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.duration) - 1)
        after, before = time - self.time[k], self.time[k + 1] - time
        near = np.where(after < before, k, k + 1)
        away, half = np.minimum(after, before), self.half[near]
        # Added to the corner: of constant acceleration, and zero at the ends of the zone.
        return k, near, np.maximum(half - away, 0.0) ** 2 / np.maximum(4 * half, 1e-12)

    def _beside(self, near: Ints) -> tuple[Ints, Ints]:
        """Return the moves before and after targets."""
        return np.maximum(near - 1, 0), np.minimum(near, len(self.duration) - 1)

    @property
    def _round(self) -> Bools:
        return np.asarray(self.normal.any(axis=1))

    def _points(self, k: Ints, after: Array) -> Array:
        """Return the points (m, 3) of moves k (m,), `after` s from the start of each."""
        start = self.T[k, :3, 3]
        x, at = start - self.centre[k], (self.sweep[k] / self.duration[k] * after)[:, None]
        arc = self.centre[k] + np.cos(at) * x + np.sin(at) * np.cross(self.normal[k], x)
        return np.where(self._round[k, None], arc, start + after[:, None] * self._along[k])

    def _velocity(self, k: Ints, *, ends: bool) -> Array:
        """Return the velocities (m, 3) m/s of moves k (m,) where they begin or end."""
        x = self.T[k + 1 if ends else k, :3, 3] - self.centre[k]
        arc = (self.sweep / self.duration)[k, None] * np.cross(self.normal[k], x)
        return np.where(self._round[k, None], arc, self._along[k])


def _turns(R: Array, orientation: Orientation) -> Array:
    """Return the turns of tools, (2, m, 3) rad, as seen from where they begin and where they end.

    `R` are the rotations (m, 3, 3) in the tool's own axes. For "slerp" they become rotation
    vectors. For "two-angle" x and y are the rotation vector by which the z axis swings, and z is
    the turn about it; R is the swing after the turn.
    """
    if orientation == "slerp":
        turn = Rotation.from_matrix(R).as_rotvec()
        return np.stack([turn, turn])
    x, y, z = R[:, :, 2].T
    across = np.hypot(x, y)
    share = np.divide(np.arctan2(across, z), across, out=np.ones_like(z), where=across > 0)
    swing = np.stack([-y * share, x * share, np.zeros_like(z)], axis=1)
    rest = np.swapaxes(Rotation.from_rotvec(swing).as_matrix(), 1, 2) @ R
    about = np.arctan2(rest[:, 1, 0], rest[:, 0, 0])
    c, s = np.cos(about), np.sin(about)
    seen = np.stack([c * swing[:, 0] + s * swing[:, 1], c * swing[:, 1] - s * swing[:, 0]], axis=1)
    return np.stack([np.c_[swing[:, :2], about], np.c_[seen, about]])


def _turned(turn: Array, orientation: Orientation) -> Array:
    """Return the rotations (m, 3, 3) of turns (m, 3) rad, see `_turns`."""
    if orientation == "slerp":
        return np.asarray(Rotation.from_rotvec(turn).as_matrix())
    swing, about = turn * [1.0, 1.0, 0.0], turn * [0.0, 0.0, 1.0]
    both = Rotation.from_rotvec(swing) * Rotation.from_rotvec(about)
    return np.asarray(both.as_matrix())
