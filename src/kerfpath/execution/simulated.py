"""A program of targets, simulated as its controller and its arm run it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, as_pose, floats, freeze, require_one_of, scalar, short_repr
from kerfpath.errors import InputError
from kerfpath.execution.executed import clock_of, fastest_rates, run_along
from kerfpath.execution.path_error import STEP, even_joints
from kerfpath.execution.response import IDEAL, Response
from kerfpath.post import CircularMove, Controller, LinearMove, language
from kerfpath.robots import Robot

Kind = Literal["start", "joint", "linear", "circular"]
EVERY = 0.01
"""Time, s, between two samples of a joint move."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Target:
    """One target of a program.

    Parameters
    ----------
    kind : {"start", "joint", "linear", "circular"}
        Where the robot stands at first, or the move that leads to the target.
    pose : (4, 4) m
        Tool tip in the robot base.
    via : (4, 4) m, optional
        Tool tip at a point on the way, of a circular move.
    q : (n,) rad, optional
        Joints at the target of a joint move; else those nearest to the target before.
    speed : float m/s
        Speed of the tip; that of a start is not used.
    zone : float m
        Distance from the target at which its corner begins to be rounded; 0 = stop.

    Raises
    ------
    InputError
        An unknown kind, a pose that is none, a circular move without `via`, a speed that is not
        positive, a negative zone.
    """

    kind: Kind
    pose: Array
    via: Array | None = None
    q: Array | None = None
    speed: float | None = None
    zone: float = 0.0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        require_one_of(self.kind, "kind", ("start", "joint", "linear", "circular"))
        object.__setattr__(self, "pose", as_pose(self.pose, "pose"))
        if self.kind == "circular" and self.via is None:
            raise InputError("via: expected a pose on the way of a circular move, got none")
        if self.via is not None:
            object.__setattr__(self, "via", as_pose(self.via, "via"))
        if self.q is not None:
            object.__setattr__(self, "q", floats(self.q, "q", (None,)))
        if self.kind != "start":
            speed = np.nan if self.speed is None else self.speed
            object.__setattr__(self, "speed", scalar(speed, "speed", unit="m/s", above=0.0))
        if not self.zone >= 0:
            raise InputError(f"zone: expected a length not below 0, in m, got {self.zone!r}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Simulation:
    """A motion as it is executed, from standing to standing.

    Parameters
    ----------
    time : (M,) s
        Every 2 ms.
    q : (M, n) rad
        Executed joints.
    commanded : (M, n) rad
        Those that the controller asks for.
    """

    time: Array
    q: Array
    commanded: Array

    __repr__ = short_repr


def simulate(
    targets: Sequence[Target],
    robot: Robot,
    *,
    tool: ArrayLike,
    language: str,
    start: ArrayLike,
    response: Response = IDEAL,
) -> Simulation:
    """Return the motion of the joints as a controller and the arm execute a program.

    The controller rounds corners and turns the tool as `kerfpath.execution.ToolMotion` says, runs
    at the programmed speeds where the limits of the joints allow them, else as fast as they do, and
    the joints follow as `response` says.

    Parameters
    ----------
    targets : sequence of Target
        The first is the start.
    robot : Robot
        Without external axes.
    tool : (4, 4) m
        T_flange_tip.
    language : str
        Language of the program, for how its controller rounds corners and turns the tool.
    start : (n,) rad
        Joints where the robot stands at first.
    response : Response

    Raises
    ------
    InputError
        No target beside the start, an unknown language, a target that the robot does not reach in
        the posture of the one before it, limits of the robot that are not known, or a response that
        does not fit it.
    """
    if robot.externals:
        raise InputError(
            f"simulate: expected a robot without external axes, got {robot.externals[0].name}"
        )
    if len(targets) < 2 or targets[0].kind != "start":
        raise InputError(
            f"targets: expected a start and the moves after it, got {len(targets)} targets, the "
            f"first {targets[0].kind!r}" if targets else "targets: expected a start, got none"
        )  # fmt: skip
    response.require_for(robot)
    T_flange_tip = as_pose(tool, "tool")
    controller = _controller(language)
    joints = _joints_at(targets, robot, T_flange_tip, floats(start, "start", (robot.joints,)))
    found = []
    for first, last in _between_stops(targets):
        q = _commanded(targets, joints, first, last, robot, T_flange_tip, controller)
        found.append(response.standing_around(q, STEP))
    executed = [response.executed(each, STEP, robot) for each in found]
    q = np.concatenate(executed)
    return Simulation(
        time=freeze(np.linspace(0.0, STEP * (len(q) - 1), len(q))),
        q=freeze(q),
        commanded=freeze(np.concatenate(found)),
    )


def _controller(name: str) -> Controller:
    """Return the controller of a language; moves take the time that is programmed."""
    spoken = language(name)
    settings = spoken.completed(None)
    if "shortest_move_ms" in type(settings).model_fields:
        settings = settings.model_copy(update={"shortest_move_ms": 0.0})
    return spoken.controller(settings)


def _joints_at(targets: Sequence[Target], robot: Robot, T_flange_tip: Array, start: Array) -> Array:
    """Return the joints (K, n) at targets, each near those before it."""
    T_tip_flange = np.linalg.inv(T_flange_tip)
    joints = [start]
    for k, target in enumerate(targets[1:], 1):
        if target.kind == "joint" and target.q is not None:
            q = floats(target.q, f"target {k}: q", (robot.joints,))
        else:
            q = robot.arm.nearest((target.pose @ T_tip_flange)[None], joints[-1][None])[0]
        if np.isnan(q).any():
            x, y, z = target.pose[:3, 3] * 1e3
            raise InputError(
                f"target {k}: expected a pose within reach in the posture of the target before, "
                f"got the tip at ({x:.1f}, {y:.1f}, {z:.1f}) mm"
            )
        joints.append(q)
    return np.array(joints)


def _between_stops(targets: Sequence[Target]) -> list[tuple[int, int]]:
    """Return the first and the last target of each run from stop to stop."""
    inner = [k for k in range(1, len(targets) - 1) if targets[k].zone == 0]
    stops = [0, *inner, len(targets) - 1]
    return list(pairwise(stops))


@dataclass(slots=True, kw_only=True)
class _Piece:
    """Samples of a stretch of moves of one sort: programmed time, joints and their derivatives."""

    time: Array
    q: Array
    first: Array
    second: Array
    last: int
    end: float
    again: float = 0.0


def _commanded(
    targets: Sequence[Target], joints: Array, first: int, last: int, robot: Robot,
    T_flange_tip: Array, controller: Controller,
) -> Array:  # fmt: skip
    """Return the joints (m, n) that are commanded every `STEP` s, from one stop to the next."""
    pieces = []
    k = first
    while k < last:
        end = k + 1
        by_joints = targets[end].kind == "joint"
        while not by_joints and end < last and targets[end + 1].kind != "joint":
            end += 1
        make = _by_joints if by_joints else _along_path
        pieces.append(make(targets, joints, k, end, robot, T_flange_tip, controller))
        k = end
    for before, after in pairwise(pieces):
        _round_corner(before, after, targets[before.last], controller)
    offsets = np.cumsum([0.0, *(piece.end for piece in pieces)])
    time = np.concatenate([piece.time + t for piece, t in zip(pieces, offsets, strict=False)])
    once = np.append(np.diff(time) > 0, True)  # a stretch begins where the one before it ends
    q, v, a = (
        np.concatenate([getattr(piece, name) for piece in pieces])[once]
        for name in ("q", "first", "second")
    )
    time = time[once]
    rate = fastest_rates(time, v, a, (robot.velocity_limits(), robot.acceleration_at(q)))
    again = max(piece.again for piece in pieces)
    return even_joints(clock_of(time, rate), time, rate, q, v, STEP, again=again)


def _along_path(
    targets: Sequence[Target], joints: Array, first: int, last: int, robot: Robot,
    T_flange_tip: Array, controller: Controller,
) -> _Piece:  # fmt: skip
    """Return straight and circular moves, at their programmed speeds, from standstill to it."""
    moves: list[LinearMove] = []
    for k in range(first, last + 1):
        target, q = targets[k], joints[k]
        move = LinearMove(
            T_part_tip=target.pose,
            q=q,
            speed=target.speed or 1.0,
            duration=1.0,
            zone=0.0 if k == last else target.zone,
        )
        if target.via is not None and k > first:
            about = {each.name: getattr(move, each.name) for each in fields(move)}
            move = CircularMove(**about, T_part_via=target.via, q_via=q)
        moves.append(move)
    run = run_along(
        moves, robot, T_base_part=np.eye(4), T_flange_tip=T_flange_tip, controller=controller
    )
    v = run.velocity_share * robot.velocity_limits()
    a = run.acceleration_share * robot.acceleration_at(run.q)
    if np.isnan(a).any():
        k = int(np.flatnonzero(np.isnan(a).any(axis=1))[0])
        at = first + int(np.searchsorted(run.tool_motion.time, run.time[k]))
        raise InputError(
            f"target {at}: expected a way within reach in the posture of the targets, got one that "
            "leaves it on the way there"
        )
    end = float(run.tool_motion.time[-1])
    ends = joints[[first, last]]
    return _Piece(
        time=np.concatenate([[0.0], run.time, [end]]),
        q=np.concatenate([ends[:1], run.q, ends[1:]]),
        first=v[[0, *range(len(v)), -1]],
        second=a[[0, *range(len(a)), -1]],
        last=last,
        end=end,
        again=run.tool_motion.again,
    )


def _by_joints(
    targets: Sequence[Target], joints: Array, first: int, last: int, robot: Robot,
    T_flange_tip: Array, controller: Controller,
) -> _Piece:  # fmt: skip
    """Return a joint move that takes the time of its tip at the programmed speed."""
    velocity, _ = robot.speed_limits()
    change = joints[last] - joints[first]
    there = float(np.linalg.norm(targets[last].pose[:3, 3] - targets[first].pose[:3, 3]))
    end = max(there / (targets[last].speed or 1.0), float((np.abs(change) / velocity).max()), 1e-6)
    time = np.linspace(0.0, end, max(int(np.ceil(end / EVERY)) + 1, 9))
    rate = np.tile(change / end, (len(time), 1))
    return _Piece(
        time=time,
        q=joints[first] + time[:, None] * rate,
        first=rate,
        second=np.zeros_like(rate),
        last=last,
        end=end,
    )


def _round_corner(before: _Piece, after: _Piece, target: Target, controller: Controller) -> None:
    """Round the corner between two stretches in their joints, as zones between moves are."""
    speed = target.speed or 1.0
    half = min(controller.zone(target.zone, speed) / speed, before.end / 2, after.end / 2)
    if half <= 0:
        return
    change = after.first[0] - before.first[-1]
    for piece, away, sign in (
        (before, before.end - before.time, -1.0),
        (after, after.time, 1.0),
    ):
        within = np.maximum(half - away, 0.0)[:, None]
        piece.q = piece.q + within**2 / (4 * half) * change
        piece.first = piece.first - sign * within / (2 * half) * change
        piece.second = piece.second + np.where(within > 0, change / (2 * half), 0.0)
