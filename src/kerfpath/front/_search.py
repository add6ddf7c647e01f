"""The search for the front: propose runs, collect their results, and build the front."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Literal, get_args

import moocore
import numpy as np

from kerfpath._arrays import Array, freeze, require_one_of
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.front._adaptive import AdaptiveRuns
from kerfpath.front._front import Front
from kerfpath.front._problem import Evaluation, ParetoProblem, Solution
from kerfpath.front._subproblem import Subproblem, grid

__all__ = ["AHEAD", "FrontSearch", "SearchKind", "whole_number"]

SearchKind = Literal["adaptive", "grid"]

AHEAD = 8
"""Number of runs in progress. A run depends on the results this far before it, not on timing."""
LEAST_ROOM = 0.1
"""Least distance of the reference beyond the worst value, as a share of the ideal value."""
TINY = 1e-9
"""Least distance, in the criterion's unit, where the ideal value is zero."""


class FrontSearch:
    """Proposes one run after the other, and collects their results in the same order.

    Parameters
    ----------
    problem : ParetoProblem
    runs : int
        Number of runs.
    search : {"adaptive", "grid"}
        As in `kerfpath.pareto`.
    seed : int
    ahead : int
        Number of runs that may be in progress.

    Raises
    ------
    InputError
        The search is unknown, or `runs` or `ahead` is less than one.
    """

    def __init__(
        self, problem: ParetoProblem, *, runs: int, search: SearchKind, seed: int, ahead: int
    ) -> None:
        require_one_of(search, "search", get_args(SearchKind))
        self.runs, self._ahead = whole_number(runs, "runs"), whole_number(ahead, "ahead")
        self._problem, self._search, self._seed = problem, search, seed
        self._beginning = 1
        self._tried: set[int] = set()
        self._found: list[Solution] = []
        self._failures: Counter[str] = Counter()

    def _proposed(self) -> Iterator[Subproblem]:
        """Yield the first run, the runs for the best of each criterion, and those of the search.

        Where gamma is continuous, runs alternate between on the grid and off it: the fast runs on
        the grid show where to search.
        """
        problem, rng = self._problem, np.random.default_rng(self._seed)
        yield problem.unbounded
        first = problem.first_runs()
        beyond = [replace(run, continuous=True) for run in first] if problem.continuous else []
        self._beginning = len(first) + len(beyond)
        yield from [*first[1:], *beyond]
        plain, search = grid(first[0], rng), AdaptiveRuns(problem, first, rng)
        other = np.random.default_rng([self._seed, 1])
        off_grid = AdaptiveRuns(problem, beyond, other, continuous=True)
        while True:
            on_grid = [each for each in self._found if not each.run.continuous]
            adaptive = self._search == "adaptive"
            run = search.propose(_front(on_grid), self._scale) if adaptive and on_grid else None
            run = run or next(plain)
            yield run
            if problem.continuous:
                if adaptive and self._found:
                    run = self._held() or off_grid.propose(_front(self._found), self._scale)
                yield replace(run, continuous=True)

    def _held(self) -> Subproblem | None:
        """Return a run that tries to beat a plan of the grid on the front, once for each plan."""
        for solution in _front(self._found):
            if not solution.run.continuous and solution.number not in self._tried:
                self._tried.add(solution.number)
                return self._problem.as_good(solution)
        return None

    def run(self, submit: Callable[[int, Subproblem], Callable[[], Evaluation | str]]) -> Front:
        """Do all runs, up to `ahead` of them in progress, and return the front.

        `submit` starts a run with a number and returns a function that waits for its result: the
        evaluation of its plan, or why there is none. The first run is waited for alone, because all
        others depend on it.

        Raises
        ------
        NoFeasiblePath
            No run has a plan.
        """
        proposed, begun = self._proposed(), 0
        flying: deque[tuple[int, Subproblem, Callable[[], Evaluation | str]]] = deque()
        for done in range(self.runs):
            while len(flying) < (self._ahead if done else 1) and begun < self.runs:
                run = next(proposed)
                flying.append((begun, run, submit(begun, run)))
                begun += 1
            number, run, wait = flying.popleft()
            found = wait()
            if isinstance(found, str):
                self._failures[found] += 1
            else:
                self._found.append(
                    Solution(losses=found.losses, spans=found.spans, number=number, run=run)
                )
        return self._result()

    def _box(self) -> tuple[Array, Array]:
        """Return the ideal and the reference (C,) of the first runs, where less is better.

        The reference is as far beyond the worst value as the worst value is from the ideal, and at
        least a share of the ideal. Later runs do not move it, so hypervolumes are comparable.
        """
        some = [each for each in self._found if each.number < self._beginning] or self._found[:1]
        values = np.array([each.losses for each in some])
        ideal, worst = values.min(axis=0), values.max(axis=0)
        return ideal, worst + np.maximum(worst - ideal, LEAST_ROOM * np.abs(ideal) + TINY)

    @property
    def _scale(self) -> Array:
        ideal, reference = self._box()
        return reference - ideal

    def _result(self) -> Front:
        failures = dict(self._failures.most_common())
        if not self._found:
            why = ", ".join(f"{why}: {number}" for why, number in failures.items())
            raise NoFeasiblePath(
                f"contour {self._problem.contour.name!r}: none of {self.runs} runs has a plan; "
                f"{why}",
                proved=False,
                node=-1,
                counts=failures,
            )
        front = sorted(_front(self._found), key=lambda each: (*each.losses,))
        numbers = {each.number for each in front}
        beaten = [each.losses for each in self._found if each.number not in numbers]
        on_grid = _front([each for each in self._found if not each.run.continuous])
        sense = np.array([criterion.sense for criterion in self._problem.criteria])
        ideal, reference = self._box()
        return Front(
            axes=self._problem.criteria,
            numbers=tuple(each.number for each in front),
            runs=tuple(each.run for each in front),
            values=freeze(sense * np.array([each.losses for each in front])),
            beaten=freeze(sense * np.array(beaten).reshape(-1, len(sense))),
            on_grid=freeze(
                sense * np.array([each.losses for each in on_grid]).reshape(-1, len(sense))
            ),
            ideal=freeze(sense * ideal),
            reference=freeze(sense * reference),
            tried=self.runs,
            feasible=len(self._found),
            failures=failures,
        )


def _front(found: list[Solution]) -> list[Solution]:
    """Return the solutions that no other dominates; of equal ones, the first."""
    if not found:
        return []
    kept = moocore.is_nondominated(np.array([each.losses for each in found]))
    return [each for each, keep in zip(found, kept, strict=True) if keep]


def whole_number(value: int, name: str) -> int:
    """Return a whole number; raise InputError where it is not one, or less than 1."""
    if not isinstance(value, int) or value < 1:
        raise InputError(f"{name}: expected a whole number, at least 1, got {value!r}")
    return value
