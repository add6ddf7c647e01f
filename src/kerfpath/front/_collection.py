"""The designer's collection: which run comes next, what came of the others, and the front of it."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator
from typing import Literal, get_args

import moocore
import numpy as np

from kerfpath._arrays import Array, freeze
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.front._adaptive import Adaptive, Made
from kerfpath.front._attempt import Attempts
from kerfpath.front._criteria import Judge
from kerfpath.front._runs import Run, anchors, grid, whole
from kerfpath.front._set import Front
from kerfpath.planner import node_interval, relaxations

__all__ = ["AHEAD", "Collection", "Reached", "Search"]

Search = Literal["adaptive", "grid"]
Reached = tuple[Array, Array]
"""Losses (C,) of a plan, and the reach (n, 2) of its joints."""

AHEAD = 8
"""Runs that may be under way: a run depends on what came of those so far before it, on no clock."""
LEAST_ROOM = 0.1
"""Share of an ideal value by which the reference is beyond the worst, at least."""
TINY = 1e-9
"""Of whatever unit: where an ideal value is zero."""


class Collection:
    """Asks for one run after the other, and is told what came of them in the same order.

    Parameters
    ----------
    attempts : Attempts
        The task.
    judge : Judge
    runs : int
        How many there are to be.
    search : {"adaptive", "grid"}
    seed : int
    ahead : int
        How many may be under way.

    Raises
    ------
    InputError
        An unknown search, fewer than one run, or none under way.
    """

    def __init__(
        self,
        attempts: Attempts,
        *,
        judge: Judge,
        runs: int,
        search: Search,
        seed: int,
        ahead: int,
    ) -> None:
        if search not in get_args(Search):
            raise InputError(
                f"search: expected one of {', '.join(get_args(Search))}, got {search!r}"
            )
        self.runs, self._ahead = whole_number(runs, "runs"), whole_number(ahead, "ahead")
        self._name, self._criteria = attempts.contour.name, judge.criteria
        self._asked: list[Run] = []
        self._told, self._beginning = 0, 1
        self._made: list[Made] = []
        self._failures: Counter[str] = Counter()
        self._runs = self._proposed(attempts, judge, search, seed)

    def _proposed(
        self, attempts: Attempts, judge: Judge, search: Search, seed: int
    ) -> Iterator[Run]:
        """Yield the runs: the first, those for the best of each criterion, and then the search."""
        contour, robot, graph = attempts.contour, attempts.robot, attempts.graph
        speed = attempts.speed
        dt = node_interval(contour, speed)
        velocity, _ = robot.speed_limits()
        first = whole(freeze(1 / (velocity * dt)), judge.eta_v, judge.eta_a)
        yield first
        least = None
        if any(c.kind in ("acceleration", "speed") for c in judge.criteria):
            least = relaxations(contour, robot, graph, speed, eta_v=judge.eta_v, eta_a=judge.eta_a)
        todo = anchors(first, judge.criteria, least, dt)
        self._beginning = 1 + len(todo)
        yield from todo
        rng = np.random.default_rng(seed)
        plain = grid(first, rng)
        mean = contour.length / (dt * (len(contour) - 1))
        adaptive = Adaptive(judge.criteria, [first, *todo], robot, graph, mean, rng)
        while True:
            if search == "adaptive" and self._made:
                ideal, reference = self._box()
                yield adaptive.next(self._front(), reference - ideal)
            else:
                yield next(plain)

    def gather(self, submit: Callable[[Run], Callable[[], Reached | str]]) -> None:
        """Do all runs, up to `ahead` of them under way.

        `submit` begins a run and returns how to wait for what comes of it: a plan's losses and
        reach, or why there is none. The first is waited for alone, as all else hangs on it.
        """
        flying: deque[Callable[[], Reached | str]] = deque()
        while self._told < self.runs:
            room = self._ahead if self._told else 1
            while len(flying) < room and len(self._asked) < self.runs:
                run = next(self._runs)
                self._asked.append(run)
                flying.append(submit(run))
            self._tell(flying.popleft()())

    def _tell(self, found: Reached | str) -> None:
        number = self._told
        self._told += 1
        if isinstance(found, str):
            self._failures[found] += 1
            return
        losses, reach = found
        self._made.append(Made(number=number, run=self._asked[number], losses=losses, reach=reach))

    def _front(self) -> list[Made]:
        """Return those that none dominates, of equal ones the first."""
        kept = moocore.is_nondominated(np.array([made.losses for made in self._made]))
        return [made for made, keep in zip(self._made, kept, strict=True) if keep]

    def _box(self) -> tuple[Array, Array]:
        """Return the ideal and the reference (C,) that the first runs leave, less being better.

        The reference is beyond their worst by as much as that is from the ideal, and by a share
        of it at least. Later runs do not move them, so that hypervolumes are comparable.
        """
        some = [made for made in self._made if made.number < self._beginning] or self._made[:1]
        values = np.array([made.losses for made in some])
        ideal, worst = values.min(axis=0), values.max(axis=0)
        return ideal, worst + np.maximum(worst - ideal, LEAST_ROOM * np.abs(ideal) + TINY)

    def result(self) -> Front:
        """Return the front; raise NoFeasiblePath where it is empty."""
        failures = dict(self._failures.most_common())
        if not self._made:
            told = ", ".join(f"{why}: {number}" for why, number in failures.items())
            raise NoFeasiblePath(
                f"contour {self._name!r}: none of {self._told} runs has a plan; {told}",
                proved=False,
                node=-1,
                counts=failures,
            )
        front = self._front()
        numbers = {made.number for made in front}
        beaten = [made for made in self._made if made.number not in numbers]
        front.sort(key=lambda made: (*made.losses,))
        sense = np.array([c.sense for c in self._criteria])
        ideal, reference = self._box()
        return Front(
            criteria=tuple(c.name for c in self._criteria),
            units=tuple(c.unit for c in self._criteria),
            sense=freeze(sense),
            numbers=tuple(made.number for made in front),
            runs=tuple(made.run for made in front),
            values=freeze(sense * np.array([made.losses for made in front])),
            beaten=freeze(sense * np.array([m.losses for m in beaten]).reshape(-1, len(sense))),
            ideal=freeze(sense * ideal),
            reference=freeze(sense * reference),
            tried=self._told,
            feasible=len(self._made),
            failures=failures,
        )


def whole_number(value: int, name: str) -> int:
    """Return a number that counts; raise InputError where it is none, or less than one."""
    if not isinstance(value, int) or value < 1:
        raise InputError(f"{name}: expected a whole number, at least 1, got {value!r}")
    return value
