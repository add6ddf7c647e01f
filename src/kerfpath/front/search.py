"""Search for the Pareto front: plan many times, and keep the plans that no other dominates."""

from __future__ import annotations

import os
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from typing import Literal, Unpack, get_args

import moocore
import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Bools, floats, freeze, require_one_of, short_repr
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.front.criteria import criteria_named
from kerfpath.front.problem import (
    Criterion,
    Evaluation,
    Gap,
    ParetoProblem,
    Solution,
    Subproblem,
    graph_of_runs,
    grid,
)
from kerfpath.graph import LayeredGraph
from kerfpath.options import GraphKeywords, PlanMethod, PlanOptions, with_keywords
from kerfpath.plans import Plan
from kerfpath.robots import Robot
from kerfpath.search import Closure, Metric, ObjectiveKind
from kerfpath.setup import Setup

# -----------------------------------------------------------------------------
# The Pareto front, measures of its quality, and its plans.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Front:
    """The Pareto front of one contour: the runs whose plans no other plan dominates.

    A plan dominates another if it is as good in all criteria and better in one.

    Parameters
    ----------
    axes : tuple of Criterion
        The criteria; `criteria` are their names.
    numbers : tuple of int
        Number of each run among all that were tried. Rows are sorted by the first criterion, the
        best first.
    runs : tuple of Subproblem
        The run of each plan.
    values : (P, C)
        Criteria of each plan, in their units; each plan has passed its audit.
    beaten : (B, C)
        Criteria of the plans that others dominate.
    on_grid : (G, C)
        Criteria of the plans on the grid of gamma that no other plan on the grid dominates.
    ideal, reference : (C,)
        Best values of the first runs, and a point beyond their worst values; criteria are scaled
        between the two.
    tried : int
        Number of runs.
    feasible : int
        Number of runs that had a plan.
    failures : mapping of str to int
        Number of runs without a plan, for each reason.
    """

    axes: tuple[Criterion, ...]
    numbers: tuple[int, ...]
    runs: tuple[Subproblem, ...]
    values: Array
    beaten: Array
    on_grid: Array
    ideal: Array
    reference: Array
    tried: int
    feasible: int
    failures: Mapping[str, int]

    __repr__ = short_repr

    @property
    def criteria(self) -> tuple[str, ...]:
        """Names of the criteria, as in `pareto`."""
        return tuple(axis.name for axis in self.axes)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the criteria."""
        return tuple(axis.unit for axis in self.axes)

    @property
    def sense(self) -> Array:
        """1 where less is better, -1 where more is, (C,)."""
        return np.array([axis.sense for axis in self.axes])

    @property
    def scaled(self) -> Array:
        """Criteria of each plan (P, C), scaled: 0 at the ideal, 1 at the reference."""
        return freeze((self.values - self.ideal) / (self.reference - self.ideal))

    @property
    def hypervolume(self) -> float:
        """Volume that the front dominates up to the reference, in scaled criteria.

        It never decreases as runs are added. To compare two fronts, use the function `hypervolume`.
        """
        return hypervolume(self.scaled, np.ones(len(self.criteria)))

    @property
    def gap(self) -> float:
        """Largest distance between neighbours in any one scaled criterion."""
        return float(np.diff(np.sort(self.scaled, axis=0), axis=0).max(initial=0.0))

    @property
    def left_behind(self) -> Bools:
        """Whether each plan of `on_grid` is dominated by a plan over continuous gamma, (G,)."""
        here, there = self.values * self.sense, self.on_grid * self.sense
        as_good = (here[:, None] <= there).all(axis=2)
        return np.asarray((as_good & (here[:, None] < there).any(axis=2)).any(axis=0))

    @property
    def beyond_the_grid(self) -> str:
        """How many plans of the grid are dominated off the grid, in words."""
        return (
            f"{int(self.left_behind.sum())} of the {len(self.on_grid)} plans of the front on the "
            "grid of gamma are beaten off the grid"
        )

    def coverage(self, other: Front) -> float:
        """Return the share of another front's plans that some plan here equals or dominates.

        This is the measure C of Zitzler and Thiele (PPSN V, 1998).

        Raises
        ------
        InputError
            The other front has other criteria.
        """
        if other.criteria != self.criteria:
            raise InputError(f"coverage: expected criteria {self.criteria}, got {other.criteria}")
        here, there = self.values * self.sense, other.values * self.sense
        return float((here[:, None] <= there).all(axis=2).any(axis=0).mean())

    def best_at(self, criterion: str) -> int:
        """Return the row of `values` that is best in a criterion.

        Raises
        ------
        InputError
            The name is not one of `criteria`.
        """
        require_one_of(criterion, "best", self.criteria)
        return int(self.scaled[:, self.criteria.index(criterion)].argmin())

    @property
    def balanced_at(self) -> int:
        """The row of `values` whose worst scaled criterion is the least."""
        return int(self.scaled.max(axis=1).argmin())

    def __str__(self) -> str:
        """Return a summary of the runs and criteria in a few lines."""
        lines = [
            f"{len(self.runs)} plans from {self.feasible} feasible runs out of {self.tried}; "
            f"hypervolume {self.hypervolume:.4f}, largest gap {self.gap:.3f}"
        ]
        if len(self.left_behind) and any(run.continuous for run in self.runs):
            lines[0] += f"; {self.beyond_the_grid}"
        for axis, values in zip(self.axes, self.values.T, strict=True):
            lines.append(f"  {axis.name}: {values.min():.4g} to {values.max():.4g} {axis.unit}")
        lines += [f"  no plan in {number} runs: {why}" for why, number in self.failures.items()]
        return "\n".join(lines)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ParetoSet(Front):
    """A Pareto front with its plans.

    Parameters
    ----------
    plans : tuple of Plan
        One for each run.
    """

    plans: tuple[Plan, ...]

    __repr__ = short_repr

    def best(self, criterion: str) -> Plan:
        """Return the plan that is best in a criterion.

        Raises
        ------
        InputError
            The name is not one of `criteria`.
        """
        return self.plans[self.best_at(criterion)]

    @property
    def balanced(self) -> Plan:
        """The plan whose worst scaled criterion is the least."""
        return self.plans[self.balanced_at]


def hypervolume(values: ArrayLike, reference: ArrayLike) -> float:
    """Return the volume that points (P, C) dominate up to a reference (C,), where less is better.

    It is exact, computed by moocore (Guerreiro, Fonseca, Paquete, ACM Comput. Surv. 54(6), 2021).
    Points that are not better than the reference in every coordinate count for nothing.

    Raises
    ------
    InputError
        The shapes do not fit, or a number is not finite.
    """
    reference = floats(reference, "reference", (None,))
    values = floats(values, "values", (None, len(reference)))
    inside = values[(values < reference).all(axis=1)]
    return float(moocore.hypervolume(inside, ref=reference)) if len(inside) else 0.0


# -----------------------------------------------------------------------------
# The adaptive search: the next runs go to the parts of the front that are sparse.

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
        front = [replace(each, run=self._searched(each)) for each in front]
        if self._proposed % RANDOM:
            claim, gap = max(self._gaps(front, scale), key=lambda claimed: claimed[0])
            if claim > 0:
                return self._between(gap)
        return self._varied(front[int(self._rng.integers(len(front)))].run)

    def _searched(self, solution: Solution) -> Subproblem:
        """Return the run of a solution, or one that searches for what a refinement was held to."""
        run = self._problem.as_good(solution) if solution.run.goals else solution.run
        return replace(run, begin=(), explored=False)

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


# -----------------------------------------------------------------------------
# The search for the front: propose runs, collect their results, and build the front.

SearchKind = Literal["adaptive", "grid"]

AHEAD = 8
"""Number of runs in progress. A run depends on the results this far before it, not on timing."""
REFINING = 1 / 3
"""Share of the runs, the last ones, in which plans of the front are refined again."""
NEAREST = 3
"""Plans of the front, itself included, from which each is refined again."""
ROUNDS, SETTLED = 4, 1e-3
"""Most times that a plan is refined again and again, and relative gain below which it is final."""
SAME = 1e-6
"""Share of the scale of a criterion by which plans of the front differ at least in one."""
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
        Number of runs; refinements that are left of the plans of the front follow them.
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
        self._begun = 0
        self._tried: set[int] = set()
        self._refined: set[int] = set()
        self._parents: dict[int, Solution] = {}
        self._rounds: dict[int, int] = {}
        self._done = 0
        self._found: list[Solution] = []
        self._failures: Counter[str] = Counter()

    def _proposed(self) -> Iterator[Subproblem]:
        """Yield the first run, the runs for the best of each criterion, and those of the search.

        If the first run has no path on the grid, all others are off it; they end if the same run
        has no motion there either. Where gamma is continuous, runs alternate between on the grid
        and off it: the fast runs on the grid show where to search.
        """
        problem, rng = self._problem, np.random.default_rng(self._seed)
        yield problem.unbounded
        has_grid = bool(self._found) or not problem.continuous or self._audited
        if not has_grid:
            yield _explored(problem.unbounded)
            if not self._found:
                return
        first = problem.first_runs()
        beyond = [_explored(run) for run in first] if problem.continuous else []
        begin = [*first[1:], *beyond] if has_grid else beyond[1:]
        self._beginning = self._begun + len(begin)
        yield from begin
        plain, search = grid(first[0], rng), AdaptiveRuns(problem, first, rng)
        other = np.random.default_rng([self._seed, 1])
        off_grid = AdaptiveRuns(problem, beyond, other, continuous=True)
        while True:
            on_grid = [each for each in self._found if not each.run.continuous]
            adaptive = self._search == "adaptive"
            known = _front(on_grid, self._scale) if adaptive and on_grid else []
            run = search.propose(known, self._scale) if known else next(plain)
            if has_grid:
                yield run
            if problem.continuous:
                if adaptive and self._found:
                    run = self._held() or off_grid.propose(self.front, self._scale)
                yield replace(run, continuous=True)
            while self._late and (again := self._refined_again()) is not None:
                yield again

    @property
    def _audited(self) -> bool:
        """Whether a run had a plan that failed its audit: others need not."""
        return any(why.startswith("audit") for why in self._failures)

    def _held(self) -> Subproblem | None:
        """Return a run that tries to beat a plan of the grid on the front, once for each plan."""
        for solution in self.front:
            if not solution.run.continuous and solution.number not in self._tried:
                self._tried.add(solution.number)
                return self._problem.as_good(solution)
        return None

    @property
    def _late(self) -> bool:
        """Whether only the runs are left in which the front is refined."""
        return self._refines and self._begun >= self.runs * (1 - REFINING)

    @property
    def _refines(self) -> bool:
        """Whether plans of the front are refined again."""
        return self._problem.refinable and self._search == "adaptive"

    def _refined_again(self) -> Subproblem | None:
        """Return a run that refines a plan of the front once more; None if all have been.

        It begins with the plan and with those nearest to it, and improves all criteria together.
        Plans that such a run has found come last, and are refined again if it gained much.
        """
        front = sorted(self.front, key=lambda each: self._rounds.get(each.number, 0))
        for solution in front:
            rounds = self._rounds.get(solution.number, 0)
            if solution.number not in self._refined and rounds < ROUNDS:
                self._refined.add(solution.number)
                self._parents[self._begun] = solution
                apart = [np.abs((o.losses - solution.losses) / self._scale).max() for o in front]
                begin = tuple(front[i].course for i in np.argsort(apart, kind="stable")[:NEAREST])
                return self._problem.refining(solution, begin, self._scale)
        return None

    def _take(self, found: Solution) -> None:
        """Add a solution; one that hardly improves the plan that it was refined from is final."""
        self._found.append(found)
        parent = self._parents.get(found.number)
        if parent is not None:
            gained = (parent.losses - found.losses) / np.maximum(np.abs(parent.losses), TINY)
            self._rounds[found.number] = self._rounds.get(parent.number, 0) + 1
            if gained.max() < SETTLED:
                self._refined.add(found.number)

    @property
    def front(self) -> list[Solution]:
        """The solutions so far that no other dominates."""
        return _front(self._found, self._scale)

    def _next(self, proposed: Iterator[Subproblem]) -> Subproblem | None:
        """Return the next run; None if there is none until another is done."""
        if self._begun < self.runs:
            return next(proposed, None)
        return self._refined_again() if self._refines and self._found else None

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
        proposed = self._proposed()
        flying: deque[tuple[int, Subproblem, Callable[[], Evaluation | str]]] = deque()
        while True:
            most = self._ahead if self._found or self._done > 1 else 1
            while len(flying) < most and (run := self._next(proposed)) is not None:
                flying.append((self._begun, run, submit(self._begun, run)))
                self._begun += 1
            if not flying:
                return self._result()
            number, run, wait = flying.popleft()
            found = wait()
            self._done += 1
            if isinstance(found, str):
                self._failures[found] += 1
            else:
                solved = found.losses, found.course
                self._take(Solution(losses=solved[0], course=solved[1], number=number, run=run))

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
                f"contour {self._problem.contour.name!r}: none of {self._done} runs has a plan; "
                f"{why}",
                proved=False,
                node=-1,
                counts=failures,
            )
        front = sorted(self.front, key=lambda each: (*each.losses,))
        numbers = {each.number for each in front}
        beaten = [each.losses for each in self._found if each.number not in numbers]
        on_grid = _front([e for e in self._found if not e.run.continuous], self._scale)
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
            tried=self._done,
            feasible=len(self._found),
            failures=failures,
        )


def _explored(run: Subproblem) -> Subproblem:
    """Return a run over continuous gamma with an exploration of all valleys."""
    return replace(run, continuous=True, explored=True)


def _front(found: list[Solution], scale: Array) -> list[Solution]:
    """Return the solutions that no other dominates, in the order found.

    Of those that are equal to `SAME` of the scale (C,) in all criteria, only the best in the sum.
    """
    if not found:
        return []
    scaled = np.array([each.losses for each in found]) / scale
    order = np.argsort(scaled.sum(axis=1), kind="stable")
    kept = moocore.is_nondominated(np.floor(scaled[order] / SAME))
    return [found[i] for i in np.sort(order[kept])]


def whole_number(value: int, name: str) -> int:
    """Return a whole number; raise InputError where it is not one, or less than 1."""
    if not isinstance(value, int) or value < 1:
        raise InputError(f"{name}: expected a whole number, at least 1, got {value!r}")
    return value


# -----------------------------------------------------------------------------
# pareto(): the front of a contour, with its plans, by threads of this process.


class ParetoKeywords(GraphKeywords, total=False):
    """The options that `pareto` takes as keywords."""

    method: PlanMethod
    eta_v: float
    eta_a: float
    closure: Closure
    rotation: ArrayLike | None


def pareto(
    contour: Contour,
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    speed: float | None = None,
    criteria: Sequence[str] = ("displacement", "velocity", "range"),
    runs: int = 100,
    search: SearchKind = "adaptive",
    seed: int = 0,
    home: ArrayLike | None = None,
    options: PlanOptions | None = None,
    cell: Cell | None = None,
    graph: LayeredGraph | None = None,
    audit: Callable[[Plan], Sequence[object]] | None = None,
    workers: int | None = None,
    ahead: int = AHEAD,
    progress: Callable[[int], None] | None = None,
    **keywords: Unpack[ParetoKeywords],
) -> ParetoSet:
    """Return the Pareto front: plans that no other plan found dominates.

    This is the designer's collection of plans of section 3.2. The layered graph is built once, and
    the planner runs over it with different objectives, metrics, weights and eta, and with windows
    on the joints, which are the epsilon constraint for the range (9). Every second run is over
    continuous gamma: it first tries to improve a plan of the grid in one criterion while the
    criteria that can be bounded stay as good, and then searches between neighbours on the front. A
    plan on the grid is the proved optimum of its run; a plan over continuous gamma is the best
    motion found. External axes follow the courses of the plans that `kerfpath.plan` finds on the
    grid, and may leave them over continuous gamma; with any other method they have a grid too.

    Parameters
    ----------
    contour, robot, tool, placement, speed, cell
        As in `kerfpath.plan`; in a cell the runs go one after another.
    options
        As in `kerfpath.plan`, or as keywords gamma_step, frames, tilt, postures, closure, rotation,
        comfort, method, eta_v and eta_a. eta_v and eta_a are the largest shares of the velocity and
        acceleration limits that a run may use. Objective, metric and weights belong to the runs;
        the speed is constant. Any method except "continuous" keeps all runs on the grid.
    criteria : sequence of str
        Names in `kerfpath.front.CRITERIA`, or in `JOINT_CRITERIA` with a joint from 1, such as
        "range_6"; docs/pareto.md says what each measures. "clearance" needs a cell.
    runs : int
        Number of runs of the planner. Where gamma is continuous, plans of the front that have not
        been refined by then are refined after them.
    search : {"adaptive", "grid"}
        Search where the front is sparse, or over a plain grid of weights and eta.
    seed : int
        Seed of the random numbers; the same seed and `ahead` give the same front, whatever
        `workers` is.
    home : (n,) rad, optional
        Where the arm comes from and goes back to; only "time" needs it.
    graph : LayeredGraph, optional
        The layered graph of the same task, from `kerfpath.planner.layered_graph`.
    audit : callable, optional
        Returns the faults of a plan; only plans without faults are kept. Default:
        `kerfpath.audit`, with the cell.
    workers : int, optional
        Number of threads; default: the number of cores.
    ahead : int
        Number of runs that may be in progress: fewer runs learn more from each other, more keep
        more workers busy.
    progress : callable, optional
        Called with the number of runs done since the last call.

    Raises
    ------
    NoFeasiblePath
        No run has a plan that passes its audit; `counts` has the number of runs for each reason.
    InputError
        The criteria or the search are unknown, there is less than one run, or `kerfpath.plan`
        refuses an argument.
    """
    asked = with_keywords(
        options,
        keywords,
        ParetoKeywords,
        feed="constant",
        refine=False,
        certify=None,
    )
    setup = Setup.of(robot, tool, placement, cell)
    asked = asked.on(robot)
    found = criteria_named(criteria, robot, options=asked, cell=cell, home=home)
    workers = whole_number((os.cpu_count() or 1) if workers is None else workers, "workers")
    if graph is None:
        graph = graph_of_runs(contour, setup, asked, speed=speed)
    problem = ParetoProblem(
        contour=contour,
        setup=setup,
        speed=speed,
        options=asked,
        graph=graph,
        criteria=found,
        home=None if home is None else floats(home, "home", (robot.joints,)),
        audit=audit,
    )
    front_search = FrontSearch(problem, runs=runs, search=search, seed=seed, ahead=ahead)
    plans: dict[int, Plan] = {}

    with ThreadPoolExecutor(1 if cell else workers) as pool:

        def submit(number: int, run: Subproblem) -> Callable[[], Evaluation | str]:
            future = pool.submit(problem.solve, run, first=number == 0)

            def wait() -> Evaluation | str:
                made = future.result()
                if progress is not None:
                    progress(1)
                if isinstance(made, str):
                    return made
                plans[number] = made
                return problem.evaluate(made)

            return wait

        front = front_search.run(submit)
    return ParetoSet(
        **{each.name: getattr(front, each.name) for each in fields(Front)},
        plans=tuple(plans[number] for number in front.numbers),
    )
