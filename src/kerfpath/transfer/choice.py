"""Which plans the robot can come to and leave: the ends of cuts, and the moves between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Bools, Ints, freeze
from kerfpath.cell import Cell
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.kernels.metric import increments_between
from kerfpath.plans import Plan, TransferMove
from kerfpath.progress import may_stop
from kerfpath.robots import posture_name
from kerfpath.transfer.move import (
    End,
    back_off,
    explain_collision,
    least_time,
    transfer_move,
)

# -----------------------------------------------------------------------------
# Approach cuts and back off from them.

BACK_BY = (0.0, 0.1, 0.4, 0.7, 1.0)
"""Shares of the retract between which the joints are assumed to move linearly."""


def can_back_off(made: Plan, retract: float) -> bool:
    """Return whether the tool can back off from both ends within the joint limits."""
    try:
        require_clear_ends(made, None, retract)
    except NoFeasiblePath:
        return False
    return True


def require_clear_ends(made: Plan, cell: Cell | None, retract: float) -> None:
    """Raise NoFeasiblePath where the tool cannot approach a cut or back off from it."""
    ends: tuple[tuple[End, int], ...] = (("start", 0), ("end", len(made.q) - 1))
    for end, node in ends:
        try:
            way = np.array([back_off(made, end, part * retract) for part in BACK_BY])
        except InputError as broken:
            raise NoFeasiblePath(str(broken), proved=True, node=node) from broken
        if cell is None:
            continue
        if not cell.clear_through(way):
            raise NoFeasiblePath(
                f"contour {made.name!r}: in posture {posture_name(int(made.posture[node]))} the "
                f"tool is not clear while it backs off node {node} by {retract * 1e3:g} mm: "
                f"{explain_collision(cell, way)}",
                proved=True,
                node=node,
            )


# -----------------------------------------------------------------------------
# Transfer moves between candidates: least times, and the moves planned so far.

PATIENCE = 12
"""Number of searches for a way that may fail; each failed search takes its full time limit."""
LOCKED_AFTER = 2
"""Number of failures after which an end is locked, if no move from or to it was ever found."""
HOME = -1
"""Number that means where the robot comes from, or goes to, instead of a candidate."""
AT_HOME = ("home", "home")
"""What where the robot comes from, and goes to, is called in messages."""


def between_which(one: Plan | None, two: Plan | None, called: tuple[str, str] = AT_HOME) -> str:
    """Return the ends of a move from a plan to another one in words.

    None is where the robot comes from, or goes to, which are `called` so.
    """
    words = []
    for made, end, node, name in ((one, "end", -1, called[0]), (two, "start", 0, called[1])):
        if made is None:
            words.append(name)
            continue
        posture = posture_name(int(made.posture[node]))
        words.append(f"the {end} of contour {made.name!r} in posture {posture}")
    return f"from {words[0]} to {words[1]}"


class MoveTimes:
    """Times of the transfer moves between candidates: a lower bound until a move is planned.

    Parameters
    ----------
    plans : sequence of Plan
        The candidates.
    group : (C,) int
        Contour of each.
    cell : Cell, optional
    retract : float m
        How far the tool has backed off at the ends of the moves.
    seconds : float s
        Time limit of each search for a way around.
    air_speed : float
        Share of the full speed; the least times are divided by it.
    called : two of str
        What `come_from` and `go_to` are called in messages.

    Attributes
    ----------
    failed : dict of (int, int) to NoFeasiblePath
        The moves (from candidate, to candidate) for which no way was found, and why.
    """

    def __init__(
        self,
        plans: Sequence[Plan],
        group: Ints,
        cell: Cell | None,
        retract: float,
        seconds: float,
        air_speed: float = 1.0,
        called: tuple[str, str] = AT_HOME,
    ) -> None:
        self._robot, self._plans, self._cell, self._seconds = plans[0].robot, plans, cell, seconds
        self._retract, self._air_speed, self._called = retract, air_speed, called
        self._eta_v, self._eta_a = plans[0].settings.eta_v, plans[0].settings.eta_a
        self._starts = np.array([back_off(p, "start", retract) for p in plans])
        self._ends = np.array([back_off(p, "end", retract) for p in plans])
        C = len(plans)
        self.between = np.array([self._least(self._ends[[i] * C], self._starts) for i in range(C)])
        self.between[group[:, None] == group] = np.inf
        self._moves: dict[tuple[int, int], TransferMove] = {}
        self.failed: dict[tuple[int, int], NoFeasiblePath] = {}
        self._start: Array | None = None
        self._end: Array | None = None
        self.first, self.last = np.zeros(C), np.zeros(C)

    def come_from(self, q: Array) -> None:
        """Set where the robot comes from, joints (n,) rad, unless that has been set."""
        if self._start is None:
            self._start = q
            self.first = self._least(np.tile(q, (len(self._plans), 1)), self._starts)

    def go_to(self, q: Array) -> None:
        """Set where the robot goes to, joints (n,) rad, unless that has been set."""
        if self._end is None:
            self._end = q
            self.last = self._least(self._ends, np.tile(q, (len(self._plans), 1)))

    def extended(self, plans: Sequence[Plan], group: Ints) -> MoveTimes:
        """Return the moves between more candidates, the first of which are those of this object.

        Planned moves and `failed` are shared with this object.
        """
        more = MoveTimes(
            plans, group, self._cell, self._retract, self._seconds, self._air_speed, self._called
        )
        C = len(self._plans)
        more.between[:C, :C] = self.between
        more._moves, more.failed = self._moves, self.failed
        if self._start is not None:
            more.come_from(self._start)
            more.first[:C] = self.first
        if self._end is not None:
            more.go_to(self._end)
            more.last[:C] = self.last
        return more

    def forbid(self, pairs: Bools) -> None:
        """Forbid that candidate j follows candidate i where pairs[i, j] of (C, C) is true."""
        self.between[pairs] = np.inf

    def keep_straight(self, candidates: Ints) -> None:
        """Forbid those candidates whose straight moves from the start and to the end are not clear.

        They are no longer looked for ways around.
        """
        if self._cell is None:
            return
        for c in candidates.tolist():
            for one, two, times in (
                (self._start, self._starts[c], self.first),
                (self._ends[c], self._end, self.last),
            ):
                if one is None or two is None or not np.isfinite(times[c]):
                    continue
                way = one + increments_between(one, two, self._robot.endless)
                if not self._cell.clear_through(np.array([one, way])):
                    times[c] = np.inf

    def look_at(self, candidates: Ints) -> bool:
        """Plan the unplanned moves of an order; return whether one takes longer than assumed.

        A move without a way is forbidden. So are all other moves from or to an end for which
        `LOCKED_AFTER` moves failed and none was found.

        Raises
        ------
        NoFeasiblePath
            An end of a move, such as home, is not clear (proved).
        """
        changed = False
        for leg in self._legs(candidates):
            if leg in self._moves:
                continue
            may_stop()
            a, b = leg
            one = self._start if a == HOME else self._ends[a]
            two = self._end if b == HOME else self._starts[b]
            assert one is not None
            assert two is not None
            try:
                move = self._moves[leg] = self._planned(one, two)
                took = move.duration
            except NoFeasiblePath as broken:
                if broken.proved:
                    raise broken.with_message(f"{self.between_which(leg)}: {broken}") from None
                self.failed[leg], took = broken, np.inf
                self._shut(leg)
            times, at = self._place(leg)
            changed |= bool(took > times[at] + 1e-9)
            times[at] = took
            if not np.isfinite(took):
                return True  # another order avoids this move, so the other moves can wait
        return changed

    def why_no_order(self, none: NoFeasiblePath | None) -> NoFeasiblePath:
        """Return a failure that names the first move without a way, its obstacle, and the others.

        `none` says why no order is left without these moves; None means that the search ended after
        `PATIENCE` failures.
        """
        if not self.failed:
            assert none is not None
            return none
        leg, broken = next(iter(self.failed.items()))
        others = len(self.failed) - 1
        also = f"; no way for {others} more move{'s' * (others > 1)}" if others else ""
        return NoFeasiblePath(
            f"{self.between_which(leg)}: {broken}{also}, and "
            + ("no order is left without them" if none else "the search has ended"),
            proved=False,
            node=-1,
        )

    def between_which(self, leg: tuple[int, int]) -> str:
        """Return the ends of a move in words: the contours, and the postures there."""
        one, two = (None if c == HOME else self._plans[c] for c in leg)
        return between_which(one, two, self._called)

    def _shut(self, leg: tuple[int, int]) -> None:
        """Forbid all moves of an end whose moves have failed often enough and never succeeded."""
        for side, candidate in enumerate(leg):
            often = sum(failed[side] == candidate for failed in self.failed)
            ever = any(made[side] == candidate for made in self._moves)
            if candidate == HOME or ever or often < LOCKED_AFTER:
                continue
            if side == 0:
                self.between[candidate] = self.last[candidate] = np.inf
            else:
                self.between[:, candidate] = self.first[candidate] = np.inf

    def _place(self, leg: tuple[int, int]) -> tuple[Array, int]:
        """Return the array that holds the time of a move, and the index in it."""
        a, b = leg
        return (
            (self.first, b) if a == HOME else (self.last, a) if b == HOME else (self.between[a], b)
        )

    def unrolled(
        self, candidates: Ints, within: tuple[ArrayLike, ArrayLike] | None = None
    ) -> tuple[tuple[Plan, ...], tuple[TransferMove, ...], float]:
        """Return the plans and moves of an order, with endless joints not wrapped between them.

        The last value is the time (s) by which moves take longer since endless joints turn back in
        them by whole turns, to stay within angles (n,) rad.

        Raises
        ------
        NoFeasiblePath
            No way by which a joint turns back was found.
        """
        legs = self._legs(candidates)
        here = self._ends[candidates[0]] if self._start is None else self._start
        plans, moves, longer = [], [], 0.0
        for k, (a, b) in enumerate(legs):
            move = self._moves[a, b]
            move = replace(move, q=freeze(move.q + (here - move.q[0])))
            if within is not None and (back := self._turns_back(b, move.q[-1], within)).any():
                turned = self._turned_back((a, b), here, move.q[-1] + 2 * np.pi * back)
                longer += turned.duration - move.duration
                move = turned
            moves.append(move)
            shift = moves[-1].q[-1] - (0 if b == HOME else self._starts[b])
            if k == 0 and a != HOME:
                plans.append(self._plans[a])
            if b != HOME:
                plans.append(self._shifted(b, shift))
                here = self._ends[b] + shift
        if not legs:
            plans = [self._plans[int(candidates[0])]]
        return tuple(plans), tuple(moves), longer

    def _turns_back(self, b: int, there: Array, within: tuple[ArrayLike, ArrayLike]) -> Ints:
        """Return the fewest whole turns (n,) of joints that keep a candidate within angles.

        `there` (n,) rad is where a move to it ends. Joints that turn too far on it for any turns
        stay as they are.
        """
        lower, upper = (np.asarray(end, dtype=np.float64) for end in within)
        low = high = np.zeros_like(there)
        if b != HOME:
            on_way = np.vstack([self._starts[b], self._plans[b].q, self._ends[b]])
            low, high = (end(axis=0) - self._starts[b] for end in (on_way.min, on_way.max))
        least = np.ceil((lower - there - low) / (2 * np.pi))
        most = np.floor((upper - there - high) / (2 * np.pi))
        fewest = np.where(least > most, 0.0, np.clip(0.0, least, np.maximum(least, most)))
        return np.asarray(np.where(self._robot.endless, fewest, 0.0), dtype=np.int64)

    def _turned_back(self, leg: tuple[int, int], one: Array, two: Array) -> TransferMove:
        """Return the move of a leg between joints (n,) rad, by exactly the turns between them."""
        try:
            return self._along(one, two)
        except NoFeasiblePath as broken:
            joints = np.flatnonzero(np.abs(two - one) > np.pi)
            names = ", ".join(self._robot.joint_names[j] for j in joints.tolist())
            raise broken.with_message(
                f"{self.between_which(leg)}: {names} would have to turn back, as the program "
                f"cannot express more turns: {broken}"
            ) from None

    def _legs(self, candidates: Ints) -> list[tuple[int, int]]:
        before = [] if self._start is None else [HOME]
        after = [] if self._end is None else [HOME]
        return list(pairwise([*before, *candidates.tolist(), *after]))

    def _planned(self, one: Array, two: Array) -> TransferMove:
        return self._along(one, one + increments_between(one, two, self._robot.endless))

    def _along(self, one: Array, two: Array) -> TransferMove:
        move = transfer_move(
            self._robot, one, two,
            cell=self._cell, eta_v=self._eta_v, eta_a=self._eta_a, seconds=self._seconds,
        )  # fmt: skip
        return replace(move, time=freeze(move.time / self._air_speed))

    def _least(self, one: Array, two: Array) -> Array:
        velocity, acceleration = self._robot.speed_limits()
        dq = increments_between(one, two, self._robot.endless)
        least = least_time(dq, self._eta_v * velocity, self._eta_a * acceleration)
        return np.asarray(least / self._air_speed)

    def _shifted(self, candidate: int, shift: Array) -> Plan:
        made, turns = self._plans[candidate], np.round(shift / (2 * np.pi)).astype(np.int64)
        own = np.arange(len(turns)) < self._robot.family.joints  # an external axis has no turns
        return replace(made, q=made.q + 2 * np.pi * turns, turn=made.turn + own * turns)
