"""Transfer moves between candidates: least times, and the moves planned so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from kerfpath._arrays import Array, Bools, Ints, freeze
from kerfpath.cell import Cell
from kerfpath.errors import NoFeasiblePath
from kerfpath.kernels.metric import increments_between
from kerfpath.plans import Plan
from kerfpath.progress import may_stop
from kerfpath.robots import posture_name
from kerfpath.transfer import TransferMove, back_off, least_time, transfer_move

__all__ = ["HOME", "PATIENCE", "MoveTimes"]

PATIENCE = 12
"""Number of searches for a way that may fail; each failed search takes its full time limit."""
LOCKED_AFTER = 2
"""Number of failures after which an end is locked, if no move from or to it was ever found."""
HOME = -1
"""Number that means home instead of a candidate."""


class MoveTimes:
    """Times of the transfer moves between candidates: a lower bound until a move is planned.

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
    ) -> None:
        self._robot, self._plans, self._cell, self._seconds = plans[0].robot, plans, cell, seconds
        self._retract, self._air_speed = retract, air_speed
        self._eta_v, self._eta_a = plans[0].settings.eta_v, plans[0].settings.eta_a
        self._starts = np.array([back_off(p, "start", retract) for p in plans])
        self._ends = np.array([back_off(p, "end", retract) for p in plans])
        C = len(plans)
        self.between = np.array([self._least(self._ends[[i] * C], self._starts) for i in range(C)])
        self.between[group[:, None] == group] = np.inf
        self._moves: dict[tuple[int, int], TransferMove] = {}
        self.failed: dict[tuple[int, int], NoFeasiblePath] = {}
        self._home: Array | None = None
        self.first, self.last = np.zeros(C), np.zeros(C)

    @property
    def home(self) -> Array | None:
        """Home position of the robot, (n,) rad; None where there is none."""
        return self._home

    @home.setter
    def home(self, q: Array) -> None:
        self._home = q
        everywhere = np.tile(q, (len(self._plans), 1))
        self.first = self._least(everywhere, self._starts)
        self.last = self._least(self._ends, everywhere)

    def extended(self, plans: Sequence[Plan], group: Ints) -> MoveTimes:
        """Return the moves between more candidates, the first of which are those of this object.

        Planned moves and `failed` are shared with this object.
        """
        more = MoveTimes(plans, group, self._cell, self._retract, self._seconds, self._air_speed)
        C = len(self._plans)
        more.between[:C, :C] = self.between
        more._moves, more.failed = self._moves, self.failed
        if self._home is not None:
            more.home = self._home
            more.first[:C], more.last[:C] = self.first, self.last
        return more

    def forbid(self, pairs: Bools) -> None:
        """Forbid that candidate j follows candidate i where pairs[i, j] of (C, C) is true."""
        self.between[pairs] = np.inf

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
            one = self._home if a == HOME else self._ends[a]
            two = self._home if b == HOME else self._starts[b]
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
        words = []
        for candidate, end, node in ((leg[0], "end", -1), (leg[1], "start", 0)):
            if candidate == HOME:
                words.append("home")
                continue
            made = self._plans[candidate]
            posture = posture_name(int(made.posture[node]))
            words.append(f"the {end} of contour {made.name!r} in posture {posture}")
        return f"from {words[0]} to {words[1]}"

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

    def unrolled(self, candidates: Ints) -> tuple[tuple[Plan, ...], tuple[TransferMove, ...]]:
        """Return the plans and moves of an order, with endless joints not wrapped between them."""
        legs = self._legs(candidates)
        here = self._ends[candidates[0]] if self._home is None else self._home
        plans, moves, shift = [], [], np.zeros_like(here)
        for k, (a, b) in enumerate(legs):
            move = self._moves[a, b]
            moves.append(replace(move, q=freeze(move.q + (here - move.q[0]))))
            shift = moves[-1].q[-1] - (0 if b == HOME else self._starts[b])
            if k == 0 and a != HOME:
                plans.append(self._plans[a])
            if b != HOME:
                plans.append(self._shifted(b, shift))
                here = self._ends[b] + shift
        if not legs:
            plans = [self._plans[int(candidates[0])]]
        return tuple(plans), tuple(moves)

    def _legs(self, candidates: Ints) -> list[tuple[int, int]]:
        around = candidates.tolist() if self._home is None else [HOME, *candidates.tolist(), HOME]
        return list(pairwise(around))

    def _planned(self, one: Array, two: Array) -> TransferMove:
        move = transfer_move(
            self._robot, one, one + increments_between(one, two, self._robot.endless),
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
