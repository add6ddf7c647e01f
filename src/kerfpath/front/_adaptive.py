"""The adaptive search: the next runs go where the front is sparse."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import get_args

import numpy as np

from kerfpath._arrays import Array, freeze
from kerfpath.front._problem import Gap, ParetoProblem, Solution
from kerfpath.front._subproblem import Subproblem
from kerfpath.search import Metric, ObjectiveKind

__all__ = ["AdaptiveRuns"]

RANDOM = 4
"""One run in so many is drawn at random."""
SPREAD = 0.7
"""Standard deviation of the logarithm by which weights are varied: factors of 2 are common."""
FINEST = 5
"""Steps by which what is asked for beyond the best of a range nears it, half by half."""


class AdaptiveRuns:
    """Proposes runs between the neighbours on the front that are farthest apart.

    Neighbours are taken criterion by criterion. What lies between two of them is asked for by the
    epsilon constraint (Haimes, Lasdon, Wismer, IEEE Trans. SMC 1, 1971): the better one's value
    and some of the way to the other's is allowed, by eta, windows or clearance, and the rest
    is as one of the two was asked for, or minimises what one of the first runs did. Where there is
    no such bound, as on displacements, the weights go between. Each attempt at a gap halves
    its claim to the next. Over continuous gamma what only the grid's first runs are exact in may be
    bettered, too.
    """

    def __init__(
        self,
        problem: ParetoProblem,
        first: Sequence[Subproblem],
        rng: np.random.Generator,
        *,
        continuous: bool = False,
    ) -> None:
        self._problem, self._first, self._rng = problem, first, rng
        self._continuous = continuous
        self._attempts: Counter[tuple[int, int, int]] = Counter()
        self._proposed = 0

    def propose(self, front: Sequence[Solution], scale: Array) -> Subproblem:
        """Return the next run, from the front (at least one plan) in criteria of a scale (C,)."""
        self._proposed += 1
        if self._proposed % RANDOM:
            claim, gap = max(self._gaps(front, scale), key=lambda claimed: claimed[0])
            if claim > 0:
                return self._between(gap)
        return self._varied(front[int(self._rng.integers(len(front)))].run)

    def _gaps(self, front: Sequence[Solution], scale: Array) -> Iterator[tuple[float, Gap]]:
        """Yield every gap after its claim to the next run."""
        for c, criterion in enumerate(self._problem.criteria):
            exact = criterion.aimed if self._continuous else criterion.exact_anchor
            ordered = sorted(front, key=lambda solution: (solution.losses[c], solution.number))
            before: list[Solution | None] = [None, *ordered[:-1]]
            for a, b in zip(before, ordered, strict=True):
                if a is not None:
                    width = float(b.losses[c] - a.losses[c]) / scale[c]
                elif exact or not criterion.bounded:
                    width = 0.0
                else:
                    width = abs(float(b.losses[c])) / scale[c]
                gap = Gap(criterion=c, better=a, worse=b)
                yield width / 2.0 ** self._attempts[gap.key], gap

    def _between(self, gap: Gap) -> Subproblem:
        """Return a run whose plan is to lie between two neighbours in a criterion.

        Without a better one: beyond the best, by half of all there is, then a quarter, and so on,
        and from the half again.
        """
        attempt = self._attempts[gap.key]
        self._attempts[gap.key] += 1
        c, a, b, rng = gap.criterion, gap.better, gap.worse, self._rng
        criterion, run, share = self._problem.criteria[c], b.run, 0.5
        if a is None:
            share = 1 - 0.5 ** (1 + attempt % FINEST)
        elif attempt:
            run, share = self._mixed(a.run, b.run), rng.uniform()
        if a is not None and not criterion.bounded:
            weights = a.run.weights ** (1 - share) * b.run.weights**share
            run = replace(run, weights=freeze(weights))
            return self._varied(run) if attempt else run
        if rng.integers(2):
            aim = self._first[int(rng.integers(len(self._first)))]
            run = replace(run, objective=aim.objective, metric=aim.metric, weights=aim.weights)
        low = float(b.losses[c] - abs(b.losses[c]) if a is None else a.losses[c])
        value = abs(low + share * (float(b.losses[c]) - low))
        return criterion.bound(run, value, gap, self._problem, rng)

    def _mixed(self, a: Subproblem, b: Subproblem) -> Subproblem:
        """Return a run that takes what it minimises, its etas and each window from either."""
        aim, v, e, c, *windows = self._rng.integers(2, size=4 + len(a.window)).astype(bool)
        return replace(
            a if aim else b,
            eta_v=(a if v else b).eta_v,
            eta_a=(a if e else b).eta_a,
            clearance=(a if c else b).clearance,
            window=freeze(np.where(np.array(windows)[:, None], a.window, b.window)),
        )

    def _varied(self, run: Subproblem) -> Subproblem:
        """Return a run with other weights, and any objective and metric."""
        rng = self._rng
        return replace(
            run,
            objective=get_args(ObjectiveKind)[rng.integers(2)],
            metric=get_args(Metric)[rng.integers(3)],
            weights=freeze(run.weights * np.exp(rng.normal(0.0, SPREAD, len(run.weights)))),
        )
