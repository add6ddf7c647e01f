"""A whole part: a plan for every contour, their order, and the moves through the air between."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from kerfpath._arrays import Array, Bools, Ints, floats, freeze, scalar
from kerfpath.air import AirMove, End, air_move, backed_off, least_time
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.planner import plan
from kerfpath.plans import Plan
from kerfpath.robots import Robot
from kerfpath.sequence._order import Order, best_order

__all__ = ["PartPlan", "plan_part"]

BACK_BY = (0.0, 0.1, 0.4, 0.7, 1.0)
"""Shares of the retract between which the joints are taken to run straight."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PartPlan:
    """The plans of a part's contours in the order of cutting, and the moves between them.

    Parameters
    ----------
    plans : tuple of Plan
        In the order of cutting; endless joints unrolled from contour to contour.
    moves : tuple of AirMove
        One between each plan and the next, from backed off to backed off; with a home one before
        the first and one behind the last, too.
    order : Order
        What has been proved about the order.
    retract, approach_speed : float m, m/s
        How far the tool backs off before and after each contour, and how fast.
    pierce_time : float s
        Of each contour.
    """

    plans: tuple[Plan, ...]
    moves: tuple[AirMove, ...]
    order: Order
    retract: float
    approach_speed: float
    pierce_time: float

    @property
    def cutting_time(self) -> float:
        """Time on the contours, s."""
        return float(sum(p.time[-1] - p.time[0] for p in self.plans))

    @property
    def air_time(self) -> float:
        """Time of the moves through the air, approach and retract included, s."""
        down_and_up = 2 * len(self.plans) * self.retract / self.approach_speed
        return sum(move.duration for move in self.moves) + down_and_up

    @property
    def piercing_time(self) -> float:
        """Time that the beam takes to go through, s."""
        return len(self.plans) * self.pierce_time

    @property
    def cycle_time(self) -> float:
        """All of it, s."""
        return self.cutting_time + self.air_time + self.piercing_time


def plan_part(
    contours: Sequence[Contour | Sequence[Contour]],
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    speed: float | Sequence[float | None] | None = None,
    home: ArrayLike | None = None,
    cell: Cell | None = None,
    before: Sequence[tuple[int, int]] = (),
    heat_spacing: float = 0.0,
    given_order: bool = False,
    retract: float = 0.05,
    approach_speed: float = 0.1,
    pierce_time: float = 0.0,
    seconds: float = 10.0,
    progress: Callable[[int], None] | None = None,
    **options: Any,
) -> PartPlan:
    """Return plans for all contours of a part, cut in the order that takes the least time.

    Every candidate is planned; the order, the candidate of each contour and the moves between are
    chosen together. A move is first taken to be straight, which no way around beats; those that the
    best order uses are then planned in the cell, until it uses none that has not been.

    Parameters
    ----------
    contours : sequence of Contour, or of sequences of Contour
        Candidates of each: other starts, directions, leads.
    robot, tool, placement, cell, **options
        As in `kerfpath.plan`, for every contour.
    speed : float m/s, or one for each contour
    home : (n,) rad, optional
        Where the robot comes from and goes back to.
    before : sequence of (i, j)
        Contour i is cut before contour j; see `inner_first`.
    heat_spacing : float m
        Contours nearer to each other than this are not cut one right after the other.
    given_order : bool
        Keep the order of `contours`.
    retract, approach_speed : float m, m/s
        How far and how fast the tool backs off along its axis.
    pierce_time : float s
    seconds : float s
        How long the solver of the order, and each search for a way around, may take.
    progress : callable, optional
        Called with the number of candidates planned since the last call.

    Raises
    ------
    NoFeasiblePath
        A contour none of whose candidates has a plan; no order; no way between two contours.
    InputError
        As `kerfpath.plan`; lengths or times that are not positive.
    """
    retract = scalar(retract, "retract", unit="m", above=0.0)
    approach_speed = scalar(approach_speed, "approach_speed", unit="m/s", above=0.0)
    pierce_time = scalar(pierce_time, "pierce_time", unit="s", above=-1e-300)
    groups = [[c] if isinstance(c, Contour) else list(c) for c in contours]
    speeds = list(speed) if isinstance(speed, Sequence) else [speed] * len(groups)
    if not groups or not all(groups) or len(speeds) != len(groups):
        raise InputError(
            "plan_part: expected one contour at least, candidates for each, and one speed or one "
            f"for each; got {len(groups)} contours and {len(speeds)} speeds"
        )
    options |= {"tool": tool, "placement": placement, "cell": cell}
    plans, group = _planned(groups, speeds, robot, options, retract, progress)
    if given_order:
        before = [(i, i + 1) for i in range(len(groups) - 1)]
    air = _Air(robot, plans, group, cell, retract, seconds, options)
    air.forbid(_too_warm(groups, heat_spacing)[np.ix_(group, group)])
    if home is not None:
        air.home = floats(home, "home", (robot.joints,))
    own = np.array([p.time[-1] - p.time[0] for p in plans])
    own += pierce_time + 2 * retract / approach_speed
    while True:
        order = best_order(
            group, own, air.between, first=air.first, last=air.last, before=before, seconds=seconds
        )
        if not air.look_at(order.candidates):
            break
    return PartPlan(
        **air.unrolled(order.candidates),
        order=order,
        retract=retract,
        approach_speed=approach_speed,
        pierce_time=pierce_time,
    )


def _planned(
    groups: Sequence[Sequence[Contour]],
    speeds: Sequence[float | None],
    robot: Robot,
    options: dict[str, Any],
    retract: float,
    progress: Callable[[int], None] | None,
) -> tuple[list[Plan], Ints]:
    """Return a plan for every candidate that has one, and the contour of each."""
    plans, group = [], []
    for i, (candidates, speed) in enumerate(zip(groups, speeds, strict=True)):
        broken = None
        for contour in candidates:
            laid_on = None if contour.time is not None else speed
            try:
                made = plan(contour, robot, speed=laid_on, **options)
                _require_clear_ends(made, options["cell"], retract)
                plans.append(made)
                group.append(i)
            except NoFeasiblePath as error:
                broken = broken or error
            if progress is not None:
                progress(1)
        if i not in group:
            assert broken is not None
            raise broken
    return plans, np.array(group)


def _require_clear_ends(made: Plan, cell: Cell | None, retract: float) -> None:
    """Raise NoFeasiblePath where the tool cannot go down to a cut or back from it."""
    if cell is None:
        return
    ends: tuple[tuple[End, int], ...] = (("start", 0), ("end", len(made.q) - 1))
    for end, node in ends:
        way = np.array([backed_off(made, end, part * retract) for part in BACK_BY])
        if not cell.sweep.clear(way[:-1], way[1:], cell.required, cell.scene.distances).all():
            raise NoFeasiblePath(
                f"contour {made.name!r}: the tool is not clear while it backs off node {node} by "
                f"{retract * 1e3:g} mm",
                proved=True,
                node=node,
            )


def _too_warm(groups: Sequence[Sequence[Contour]], spacing: float) -> Bools:
    """Say which contours (G, G) are nearer to each other than `spacing` (m)."""
    clouds = [candidates[0].points for candidates in groups]
    near = np.zeros((len(groups), len(groups)), bool)
    if spacing <= 0:
        return near
    for i, j in combinations(range(len(groups)), 2):
        apart, _ = cKDTree(clouds[i]).query(clouds[j])
        near[i, j] = near[j, i] = np.asarray(apart).min() < spacing
    return near


class _Air:
    """Times of the moves between candidates: least ones, and those that have been planned."""

    def __init__(
        self,
        robot: Robot,
        plans: Sequence[Plan],
        group: Ints,
        cell: Cell | None,
        retract: float,
        seconds: float,
        options: dict[str, Any],
    ) -> None:
        self._robot, self._plans, self._cell, self._seconds = robot, plans, cell, seconds
        self._eta = {key: options[key] for key in ("eta_v", "eta_a") if key in options}
        self._starts = np.array([backed_off(p, "start", retract) for p in plans])
        self._ends = np.array([backed_off(p, "end", retract) for p in plans])
        C = len(plans)
        self.between = np.array([self._least(self._ends[[i] * C], self._starts) for i in range(C)])
        self.between[group[:, None] == group] = np.inf
        self._moves: dict[tuple[int, int], AirMove] = {}
        self._home: Array | None = None
        self.first, self.last = np.zeros(C), np.zeros(C)

    @property
    def home(self) -> Array | None:
        """Where the robot comes from and goes back to, (n,) rad."""
        return self._home

    @home.setter
    def home(self, q: Array) -> None:
        self._home = q
        everywhere = np.tile(q, (len(self._plans), 1))
        self.first = self._least(everywhere, self._starts)
        self.last = self._least(self._ends, everywhere)

    def forbid(self, pairs: Bools) -> None:
        """Let no candidate follow another where pairs (C, C) says so."""
        self.between[pairs] = np.inf

    def look_at(self, candidates: Ints) -> bool:
        """Plan the moves of an order that have not been planned; True where one takes longer."""
        changed = False
        for a, b in self._legs(candidates):
            if (a, b) in self._moves:
                continue
            one = self._home if a < 0 else self._ends[a]
            two = self._home if b < 0 else self._starts[b]
            assert one is not None
            assert two is not None
            try:
                move = self._moves[a, b] = self._planned(one, two)
                took = move.duration
            except NoFeasiblePath as broken:
                if a < 0 or b < 0 or broken.proved:
                    raise
                took = np.inf
            times = self.first if a < 0 else self.last if b < 0 else self.between[a]
            at = a if b < 0 else b
            changed |= bool(took > times[at] + 1e-9)
            times[at] = took
        return changed

    def unrolled(self, candidates: Ints) -> dict[str, tuple[Any, ...]]:
        """Return the plans and moves of an order, endless joints going on from one to the next."""
        legs = self._legs(candidates)
        here = self._starts[candidates[0]] if self._home is None else self._home
        plans, moves, shift = [], [], np.zeros_like(here)
        for k, (a, b) in enumerate(legs):
            move = self._moves[a, b]
            moves.append(replace(move, q=freeze(move.q + (here - move.q[0]))))
            shift = moves[-1].q[-1] - (self._starts[b] if b >= 0 else 0)
            if k == 0 and a >= 0:
                plans.append(self._shifted(a, here - self._ends[a]))
            if b >= 0:
                plans.append(self._shifted(b, shift))
                here = self._ends[b] + shift
        if not legs:
            plans = [self._plans[int(candidates[0])]]
        return {"plans": tuple(plans), "moves": tuple(moves)}

    def _legs(self, candidates: Ints) -> list[tuple[int, int]]:
        around = candidates.tolist() if self._home is None else [-1, *candidates.tolist(), -1]
        return list(pairwise(around))

    def _planned(self, one: Array, two: Array) -> AirMove:
        near = one + self._wrapped(two - one)
        return air_move(self._robot, one, near, cell=self._cell, seconds=self._seconds, **self._eta)

    def _wrapped(self, dq: Array) -> Array:
        short = dq - 2 * np.pi * np.round(dq / (2 * np.pi))
        return np.where(self._robot.endless, short, dq)

    def _least(self, one: Array, two: Array) -> Array:
        velocity, acceleration = self._robot.speed_limits()
        eta_v, eta_a = self._eta.get("eta_v", 1.0), self._eta.get("eta_a", 1.0)
        return least_time(self._wrapped(two - one), eta_v * velocity, eta_a * acceleration)

    def _shifted(self, candidate: int, shift: Array) -> Plan:
        made, turns = self._plans[candidate], np.round(shift / (2 * np.pi)).astype(np.int64)
        return replace(made, q=made.q + 2 * np.pi * turns, turn=made.turn + turns)
