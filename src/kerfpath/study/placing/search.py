"""The search for the best placement: on the grid, bounds guide it and exact searches decide.

Over continuous gamma, estimates guide it and plans decide. Placements whose estimate is nearly as
good as the best value are planned too; the margin is the largest error of the estimates so far.
Finally, a proof is tried for each of the other placements that it is no better.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import repeat

import numpy as np
from scipy.optimize import Bounds, differential_evolution

from kerfpath.arrays import Array, short_repr
from kerfpath.errors import InputError
from kerfpath.progress import Progress
from kerfpath.study.placing.evaluators import (
    BOUND_ROUNDING,
    PlacementValue,
    is_better,
    is_estimated,
)
from kerfpath.sweep import Sweep

PER_VARIABLE = 4
"""Placements in a generation for each variable."""
AT_ONCE = 4
"""Placements that are solved exactly at once, whatever the number of processes."""
PROVED_AT_ONCE = 16
"""Placements in one batch of proofs; the proofs end after a batch without success."""
MOST_EXACT = 0.25
"""Share of the evaluations that may be solved exactly."""
LEAST_EXACT = 16
"""Number of exact searches that is always allowed."""
HALF = 24
"""Number of nodes on each side of a limiting node that form a stretch with it."""
EASE = 0.05
"""Initial error assumed for estimates, as a share; a larger error replaces it when it is seen."""
CLOSE = 1.3
"""Factor on the slowest speed up to which other contours also give stretches."""


@dataclass(slots=True, kw_only=True, eq=False)
class PlacementTrial:
    """A placement that is tried.

    Parameters
    ----------
    offsets : mapping of variable to float
        Offsets in the units of the variables' names.
    result : PlacementValue
        The result so far.
    stretches : int
        Number of stretches behind its bound or estimate; -1 before there is one.
    searched : bool
        Whether its value was computed, exactly on the grid or by plans.
    """

    offsets: Mapping[str, float]
    result: PlacementValue = field(default_factory=lambda: PlacementValue(stage="reach"))
    stretches: int = -1
    searched: bool = False

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlacementMap:
    """Bounds or estimates over the first two variables; the others are as in the best placement.

    Parameters
    ----------
    x, y : (m,)
        Values of the first and the second variable; `y` is empty if there is only one variable.
    trials : tuple of PlacementTrial
        The placements, row by row of y.
    """

    x: Array
    y: Array
    trials: tuple[PlacementTrial, ...]

    __repr__ = short_repr


@dataclass(kw_only=True, eq=False)
class PlacementSearch:
    """The state of the search: the placements tried, and the steps that evaluate more of them."""

    sweep: Sweep
    task: Mapping[str, str]
    off_grid: bool
    ranges: Mapping[str, tuple[float, float]]
    tolerance: Mapping[str, float]
    most: int
    progress: Progress
    found: Callable[[PlacementTrial], None] = lambda trial: None
    stretches: list[list[int]] = field(default_factory=list)
    best: PlacementTrial | None = None
    exact: int = 0
    ease: float = EASE
    known: dict[tuple[float, ...], PlacementTrial] = field(default_factory=dict)

    __repr__ = short_repr

    @property
    def goal(self) -> str:
        return self.task["goal"]

    @property
    def trials(self) -> list[PlacementTrial]:
        return list(self.known.values())

    @property
    def floor(self) -> float | None:
        return None if self.best is None else self.best.result.value

    def first(self) -> PlacementValue:
        """Evaluate the job's own placement with all contours."""
        self.progress("the job's own placement", 0, 1)
        trial = self._trial(np.zeros(len(self.ranges)))
        trial.searched, trial.stretches, trial.result = True, 0, self.whole(trial)
        self.found(trial)
        self.progress("the job's own placement", 1, 1)
        self._take(trial)
        return trial.result

    def whole(self, trial: PlacementTrial) -> PlacementValue:
        """Return the value of a placement with every contour solved to its own optimum."""
        return self._evaluated([trial.offsets], exact=True, whole=True)[0]

    def evolve(self, evaluations: int, seed: int) -> None:
        """Search the ranges by differential evolution on the bounds or estimates."""
        low, high = np.array(list(self.ranges.values())).T
        size = 2 ** int(np.ceil(np.log2(PER_VARIABLE * len(low))))
        size = max(5, min(max(size, 8), evaluations // 2))
        from scipy.stats import qmc  # a quarter of a second to load, and the studio has no layouts

        drawn = qmc.Sobol(len(low), rng=seed).random_base2(int(np.ceil(np.log2(size))))[:size]
        points = low + drawn * (high - low)
        if (low <= 0).all() and (high >= 0).all():
            points[0] = 0.0
        generations = max(0, evaluations // size - 1)
        total, begun = size * (generations + 1), 0

        def energies(points: Array, /) -> Array:
            nonlocal begun
            trials = [self._trial(point) for point in points.T]
            self.find_bounds(
                [trial for trial in trials if trial.stretches < 0],
                lambda done: self.progress("placements", min(begun + done, total), total),
            )
            begun += len(trials)
            self.progress("placements", min(begun, total), total)
            return np.array([self._energy(trial) for trial in trials])

        energies(points.T)
        if self.best is None:
            self.climb(until_found=True)  # bounds need a placement that shows the limiting nodes
            self._refresh(self.trials)
        begun = 0
        differential_evolution(
            energies,  # type: ignore[arg-type]  # the stubs know of vectorized=False alone
            Bounds(low, high),
            init=points,
            maxiter=generations,
            rng=seed,
            vectorized=True,
            updating="deferred",
            polish=False,
            tol=0,
            atol=-1,
        )

    def climb(self, *, until_found: bool = False) -> tuple[bool, float | None]:
        """Solve placements, the best bound or estimate first, until none can beat the best.

        Returns whether that point was reached, and otherwise the best value that the others may
        have. With estimates this is no proof, see `settle`.
        """
        while True:
            open_ = [t for t in self.trials if not t.searched and self._may_win(t)]
            if not open_ or (until_found and self.best is not None):
                return not open_, None
            open_.sort(key=self._energy)
            if self.exact >= self.most:
                return False, open_[0].result.promise
            batch = open_[:AT_ONCE]
            if self._refresh(batch):
                continue
            what = "placements planned" if self.off_grid else "exact searches"
            self.progress(what, self.exact, min(self.exact + len(open_), self.most))
            results = self._evaluated(
                [t.offsets for t in batch],
                stretches=[self._slowest_first(t) for t in batch],
                exact=True,
                floor=self.floor,
            )
            self.exact += sum(result.stage != "proved" for result in results)
            for trial, result in zip(batch, results, strict=True):
                trial.searched = True
                trial.result = replace(result, estimate=trial.result.estimate)
                self.found(trial)
                self._take(trial)
            left = self.exact + len(open_) - len(batch)
            self.progress(what, self.exact, max(self.exact, min(left, self.most)))

    def settle(self) -> tuple[bool, float | None]:
        """Try to prove that none of the placements that were not planned is better.

        The worst estimates come first, until a batch proves nothing. Returns whether all are
        proved, and the best estimate of the others. Only speeds and margins can be proved.
        """
        left = [trial for trial in self.trials if is_estimated(trial.result)]
        some = [trial for trial in left if trial.result.slowest is not None]
        some.sort(key=self._energy, reverse=True)
        if self.floor is not None and self.goal != "motion":
            for done in range(0, len(some), PROVED_AT_ONCE):
                self.progress("proofs", done, len(some))
                if not self._prove(some[done : done + PROVED_AT_ONCE]):
                    break
            left = [trial for trial in left if is_estimated(trial.result)]
        promises = [p for trial in left if (p := trial.result.promise) is not None]
        best = (min if self.goal == "motion" else max)(promises, default=None)
        return not left, best

    def _prove(self, trials: Sequence[PlacementTrial]) -> bool:
        """Try to prove that placements are no better than the best; return whether any is."""
        results = self._evaluated(
            [trial.offsets for trial in trials],
            stretches=[self._slowest_first(trial)[:1] for trial in trials],
            prove=True,
            floor=self.floor,
        )
        for trial, result in zip(trials, results, strict=True):
            if result.bound is not None:
                trial.result = replace(trial.result, stage="proved", bound=result.bound)
                self.found(trial)
        return any(result.bound is not None for result in results)

    def mapped(self, about: PlacementTrial, points: int) -> PlacementMap:
        """Evaluate a grid over the first two variables around a placement."""
        names = list(self.ranges)[:2]
        axes = [np.linspace(*self.ranges[name], points) for name in names]
        grid = np.array(np.meshgrid(*axes)).reshape(len(names), -1).T
        at = np.tile([*about.offsets.values()], (len(grid), 1))
        at[:, : len(names)] = grid
        trials = [self._trial(point) for point in at]
        self.find_bounds(
            [trial for trial in trials if trial.stretches < 0],
            lambda done: self.progress("map", done, len(grid)),
        )
        self._refresh(trials)
        y = axes[1] if len(axes) > 1 else np.zeros(0)
        return PlacementMap(x=axes[0], y=y, trials=tuple(trials))

    def find_bounds(
        self, trials: Sequence[PlacementTrial], progress: Callable[[int], None]
    ) -> None:
        """Compute the bounds or estimates of placements."""
        results = self._evaluated([trial.offsets for trial in trials], progress=progress)
        for trial, result in zip(trials, results, strict=True):
            trial.result, trial.stretches = result, len(self.stretches)
            self.found(trial)

    def _refresh(self, trials: Sequence[PlacementTrial]) -> bool:
        """Update bounds that were found with fewer stretches; return whether there were any."""
        stale = [
            t for t in trials
            if not t.searched and t.result.feasible and t.stretches < len(self.stretches)
        ]  # fmt: skip
        self.find_bounds(stale, lambda done: None)
        return bool(stale)

    def _take(self, trial: PlacementTrial) -> None:
        """Update the best placement, the limiting stretches and the error of estimates."""
        result, why = trial.result, trial.result.infeasibility
        value = result.value if result.feasible else None
        if value is not None and result.estimate is not None:
            over = result.estimate / value if self.goal == "motion" else value / result.estimate
            self.ease = max(self.ease, over - 1)
        if value is not None and is_better(self.goal, value, self.floor):
            self.best = trial
        limit = CLOSE * min((c.value for c in result.contours if c.value is not None), default=0.0)
        for c in result.contours:
            if c.node is not None and c.value is not None and c.value <= limit:
                self._add_stretch(c.index, c.node, c.nodes)
        if why is not None and why.status != "unreachable" and why.index is not None:
            assert why.node is not None
            assert why.nodes is not None
            self._add_stretch(why.index, why.node, why.nodes)

    def _add_stretch(self, contour: int, node: int, nodes: int) -> None:
        """Add the stretch around a node, unless another stretch has it well inside."""
        first, last = max(0, node - HALF), min(nodes - 1, node + HALF)
        for c, begin, end in self.stretches:
            near = max(begin, first) <= node - HALF // 2 or begin == 0
            far = min(end, last) >= node + HALF // 2 or end == nodes - 1
            if c == contour and begin <= node <= end and near and far:
                return
        if last - first > 1:
            self.stretches.append([contour, first, last])

    def _evaluated(
        self,
        offsets: Sequence[Mapping[str, float]],
        *,
        stretches: Sequence[Sequence[Sequence[int]]] | None = None,
        exact: bool = False,
        whole: bool = False,
        prove: bool = False,
        floor: float | None = None,
        progress: Callable[[int], None] = lambda done: None,
    ) -> list[PlacementValue]:
        """Return the values of placements, by all stretches or by the ones given for each."""
        keys = [
            self.sweep.submit(
                **self.task,
                places=self._places(at),
                stretches=about,
                exact=exact,
                whole=whole,
                prove=prove,
                floor=floor,
            )
            for at, about in zip(offsets, stretches or repeat(self.stretches), strict=False)
        ]
        found: list[PlacementValue] = []
        for key in keys:
            result = self.sweep.result(key)
            if result.failure is not None:
                raise InputError(f"a placement could not be evaluated: {result.failure.reason}")
            found.append(PlacementValue.from_data(result.value))
            progress(len(found))
        return found

    def _places(self, offsets: Mapping[str, float]) -> list[dict[str, float]]:
        """Return a placement, and the ones with each variable off by its tolerance."""
        ends = [
            {**offsets, name: offsets[name] + side * size}
            for name, size in self.tolerance.items()
            for side in (-1, 1)
        ]
        return [dict(offsets), *ends]

    def _trial(self, point: Array) -> PlacementTrial:
        """Return the trial at a point, rounded to 0.01 mm and 0.001 deg; the same one each time."""
        offsets = {
            name: round(float(value), 2 if name.endswith("_mm") else 3) + 0.0
            for name, value in zip(self.ranges, point, strict=True)
        }
        return self.known.setdefault(tuple(offsets.values()), PlacementTrial(offsets=offsets))

    def _slowest_first(self, trial: PlacementTrial) -> list[list[int]]:
        """Return the stretches, the slowest one of the estimate first if there is one."""
        first = trial.result.slowest
        if first is None:
            return self.stretches
        others = [each for number, each in enumerate(self.stretches) if number != first]
        return [self.stretches[first], *others]

    def _may_win(self, trial: PlacementTrial) -> bool:
        if not trial.result.feasible:
            return False
        bound, slack = trial.result.bound, BOUND_ROUNDING
        if bound is None:  # estimates are not proved
            bound, slack = trial.result.estimate, self.ease
        if bound is None or self.floor is None:
            return True
        eased = bound * (1 - slack) if self.goal == "motion" else bound * (1 + slack)
        return is_better(self.goal, eased, self.floor)

    def _energy(self, trial: PlacementTrial) -> float:
        """Return the energy that evolution minimises; feasible placements have the lowest ones."""
        why, bound = trial.result.infeasibility, trial.result.promise
        if why is not None:
            return 10.0 - why.progress
        if bound is None:
            return 0.0
        return -1 / bound if self.goal == "motion" else -bound
