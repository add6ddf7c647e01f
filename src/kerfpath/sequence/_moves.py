"""Moves through the air between candidates: the least time of each, and those planned so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from kerfpath._arrays import Array, Bools, Ints, freeze
from kerfpath.air import AirMove, air_move, backed_off, least_time
from kerfpath.cell import Cell
from kerfpath.errors import NoFeasiblePath
from kerfpath.plans import Plan

__all__ = ["Moves"]


class Moves:
    """Times of the moves between candidates: least ones, and those that have been planned."""

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
        self._air_speed = air_speed
        self._eta_v, self._eta_a = plans[0].settings.eta_v, plans[0].settings.eta_a
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
        move = air_move(
            self._robot, one, one + self._wrapped(two - one), cell=self._cell,
            eta_v=self._eta_v, eta_a=self._eta_a, seconds=self._seconds,
        )  # fmt: skip
        return replace(move, time=freeze(move.time / self._air_speed))

    def _wrapped(self, dq: Array) -> Array:
        short = dq - 2 * np.pi * np.round(dq / (2 * np.pi))
        return np.where(self._robot.endless, short, dq)

    def _least(self, one: Array, two: Array) -> Array:
        velocity, acceleration = self._robot.speed_limits()
        dq = self._wrapped(two - one)
        least = least_time(dq, self._eta_v * velocity, self._eta_a * acceleration)
        return np.asarray(least / self._air_speed)

    def _shifted(self, candidate: int, shift: Array) -> Plan:
        made, turns = self._plans[candidate], np.round(shift / (2 * np.pi)).astype(np.int64)
        return replace(made, q=made.q + 2 * np.pi * turns, turn=made.turn + turns)
