"""The adaptive search: the next runs go to the parts of the front that are sparse."""

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
"""Every fourth run is drawn at random."""
SPREAD = 0.7
"""Standard deviation of the logarithm of the factors on weights: factors of 2 are common."""
FINEST = 5
"""Number of values beyond the best one that are asked for; each halves the distance to it."""


class AdaptiveRuns:
    """Proposes runs between the neighbours on the front that are farthest apart.

    Neighbours are found for each criterion. A run between two of them uses the epsilon constraint
    (Haimes, Lasdon, Wismer, IEEE Trans. SMC 1, 1971): eta, windows or clearance bound the criterion
    to a value between those of the two plans. All else is taken from the run of one of the two, or
    the objective from one of the first runs. Criteria without such a bound, such as displacements,
    get weights between those of the two runs. Each attempt at a gap halves its claim to the next
    run. Over continuous gamma, criteria whose best value on the grid is exact can still be improved
    beyond it.
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
        """Return the next run, given the front (at least one plan) and the scale (C,)."""
        self._proposed += 1
        if self._proposed % RANDOM:
            claim, gap = max(self._gaps(front, scale), key=lambda claimed: claimed[0])
            if claim > 0:
                return self._between(gap)
        return self._varied(front[int(self._rng.integers(len(front)))].run)

    def _gaps(self, front: Sequence[Solution], scale: Array) -> Iterator[tuple[float, Gap]]:
        """Yield the claim of every gap to the next run, and the gap."""
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
        """Return a run whose plan should lie between two neighbours in a criterion.

        Without a better neighbour it asks for a value beyond the best one: by half of that value,
        then a quarter, and so on, and then from half again.
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
        """Return a run that takes objective, etas, clearance and each window from either run."""
        aim, v, e, c, *windows = self._rng.integers(2, size=4 + len(a.window)).astype(bool)
        return replace(
            a if aim else b,
            eta_v=(a if v else b).eta_v,
            eta_a=(a if e else b).eta_a,
            clearance=(a if c else b).clearance,
            window=freeze(np.where(np.array(windows)[:, None], a.window, b.window)),
        )

    def _varied(self, run: Subproblem) -> Subproblem:
        """Return a run with random objective and metric, and randomly varied weights."""
        rng = self._rng
        return replace(
            run,
            objective=get_args(ObjectiveKind)[rng.integers(2)],
            metric=get_args(Metric)[rng.integers(3)],
            weights=freeze(run.weights * np.exp(rng.normal(0.0, SPREAD, len(run.weights)))),
        )
