"""The search for the best placement: on the grid, bounds guide it and exact searches decide.

Over continuous gamma, estimates guide it and plans decide. Placements whose estimate is nearly as
good as the best value are planned too; the margin is the largest error of the estimates so far.
Finally, a proof is tried for each of the other placements that it is no better.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import repeat
from typing import ClassVar

import numpy as np
from scipy.optimize import Bounds, differential_evolution

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.cell import CollisionChecker
from kerfpath.certifier import MotionTest
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.job import Job
from kerfpath.losses import Loss, Reason
from kerfpath.planner import best_motion, external_course, longest_step, samples_of
from kerfpath.progress import Progress
from kerfpath.search import ContinuousSearch, SearchProblem, find_shortest
from kerfpath.study.evaluator import SampledContour
from kerfpath.study.placing.evaluator import (
    BOUND_ROUNDING,
    Beams,
    ContourValue,
    InfeasiblePlacement,
    PlacementEvaluator,
    PlacementValue,
    Stage,
    Status,
    is_better,
    is_estimated,
)
from kerfpath.sweep import Sweep

# -----------------------------------------------------------------------------
# Tests of a placement over continuous gamma: an estimate, the value of plans, and a proof.
#
# - Reach: as on the grid. This also holds for plans, which start from the samples of gamma: a node
#   without a pose, or without a clear pose, at any of them has no plan.
# - Estimate of a speed: the fastest speed that beams find along stretches around limiting nodes,
#   from few samples of gamma with interpolated joints. A stretch can be cut at least as fast as the
#   full contour, but the path found there is neither the fastest nor exactly a motion.
# - Estimate of a displacement: the value function, which is interpolated between samples and
#   ignores accelerations, closures and limits of rotation. A motion must also be found along the
#   stretches that could not be cut at other placements.
# - Proved: around a limiting node no motion is as fast as at another placement, at any gamma,
#   posture and turn. This proves only that the placement is not better.
# - With external axes all of this applies along their most promising course, which plans may leave.
#   Reach is the result of the search for that course, from which plans start. No estimate refuses a
#   placement for sure, and nothing is proved.
# - Planned: the fastest speed as found by `kerfpath speed`, or the cost as found by `kerfpath
#   plan`. For a contour that is at least as fast as the slowest one, no better value is searched.

STEP = np.radians(5.0)
"""rad: least step of gamma between the samples of an estimate."""


def leaves_grid(job: Job) -> bool:
    """Return whether the placements of a job are evaluated over continuous gamma."""
    return job.options.method == "continuous" and job.robot.family.free_rotation


@dataclass(kw_only=True, eq=False)
class OffGridEvaluator(PlacementEvaluator):
    """The tests of one placement over continuous gamma; the job is already moved there."""

    off_grid: ClassVar[bool] = True
    last: ClassVar[Stage] = "planned"

    courses: dict[Contour, Array] = field(default_factory=dict)

    __repr__ = short_repr

    def graph(self, nodes: Contour, only: Ints | None = None) -> LayeredGraph:
        """Return the layered graph of nodes, along the course of the external axes if any."""
        options = self.job.options.without_penalties
        return self.job.graph(nodes, options, only=only, external=self.courses.get(nodes))

    def _require_poses(self) -> None:
        """Require a pose at every `EVERY`-th node, or a course of the external axes."""
        if not self.job.robot.externals:
            super()._require_poses()
            return
        done, total = 0, sum(len(contour.nodes) for contour in self.contours)
        for index, contour in enumerate(self.contours):
            try:
                self.courses[contour.nodes] = self._course(contour)
            except NoFeasiblePath as broken:
                moves = self.goal == "motion" and Reason(Loss.ADMITTED) in broken.counts
                status: Status = "speed" if moves else "unreachable"
                progress, node = (done + broken.node + 1) / total, broken.node + 1
                raise self._why(
                    status, progress, str(broken), index, node, searched=False
                ) from None
            done += len(contour.nodes)

    def _course(self, contour: SampledContour) -> Array:
        """Return the most promising course of the external axes for the goal."""
        job, timed = self.job, self.goal == "motion" and contour.nodes.time is None
        return external_course(
            contour.nodes, job.robot, tool=job.tool, placement=job.placement,
            speed=contour.speed if timed else None, options=job.options.without_penalties,
            cell=self.cell,
        )  # fmt: skip

    def evaluate(
        self,
        stretches: Sequence[Sequence[int]],
        *,
        exact: bool,
        whole: bool,
        floor: float | None,
        least: float | None,
    ) -> PlacementValue:
        """Return the value of this placement: planned if `exact`, otherwise estimated.

        It is not planned if the first stretch proves that it is no better than the floor.
        """
        if exact and not whole and floor is not None:
            known = self.disproved(stretches[:1], floor)
            if known.bound is not None:
                return known
        if exact:
            return super().evaluate(stretches, exact=True, whole=whole, floor=floor, least=least)
        stage: Stage = "reach"
        try:
            self._require_poses()
            stage = "estimate"
            if self.goal == "motion":
                return PlacementValue(stage=stage, estimate=self._displacement(stretches))
            return self._slowest(stretches)
        except InfeasiblePlacement as found:
            return PlacementValue(stage=stage, infeasibility=found.why)

    def disproved(self, stretches: Sequence[Sequence[int]], floor: float) -> PlacementValue:
        """Return the floor as a bound, if a stretch proves that no motion is that fast."""
        if self.goal == "motion":
            return PlacementValue(stage="estimate")
        for c, first, last in stretches:
            if self._is_closed(c, first, last, floor):
                return PlacementValue(stage="proved", bound=floor)
        return PlacementValue(stage="estimate")

    def _bound(self, stretches: Sequence[Sequence[int]]) -> float | None:
        """Return None: there is no proved bound before the placement is planned."""
        return None

    def _least_displacement(self, index: int) -> float:
        """Return 0: no other bound is proved for a contour before it is planned."""
        return 0.0

    def _solved(
        self, index: int, graph: LayeredGraph, least: float | None
    ) -> tuple[float, ContourValue]:
        """Return the value of a contour, or a value found that is `least` or more."""
        whole = None if self.job.robot.externals else graph  # plans choose their own course
        value, known = self._value(index, self.contours[index], whole, least)
        if least is None or value < least:
            return value, known
        return value, ContourValue(index=index, name=known.name, nodes=known.nodes, at_least=value)

    def _slowest(self, stretches: Sequence[Sequence[int]]) -> PlacementValue:
        """Return the estimate from the slowest stretch; others are cut short at its value."""
        least, slowest = None, None
        for number, (c, first, last) in enumerate(stretches):
            value = self._quickest(c, first, last, least)
            if least is None or value < least:
                least, slowest = value, number
        return PlacementValue(stage="estimate", estimate=least, slowest=slowest)

    def _quickest(self, index: int, first: int, last: int, least: float | None) -> float:
        """Return an estimate for nodes first to last; values above `least` need not be exact."""
        contour, job = self.contours[index], self.job
        nodes, unit = np.arange(first, last + 1), self._unit(contour)
        graph = self._thin_graph(contour, nodes)
        run = contour.stretch(first, last, job.options.frames, timed=False)
        try:
            on_grid = self.fastest(run.nodes, graph).speed
        except NoFeasiblePath as broken:
            raise self._infeasible(index, graph, broken, 2.0, first) from None
        enough = None if least is None else least * unit
        if enough is not None and on_grid >= enough:
            return on_grid / unit
        step = longest_step(contour.nodes)
        beams = Beams(
            graph=graph,
            limits=job.options.limits(job.robot),
            endless=job.robot.endless,
            checker=None if self.cell is None else CollisionChecker(self.cell, graph.q),
        )
        interval = beams.least_interval(step / on_grid, None if enough is None else step / enough)
        return step / interval / unit

    def _thin_graph(self, contour: SampledContour, nodes: Ints) -> LayeredGraph:
        """Return the graph of some nodes on few samples, enough for an estimate."""
        options = self.job.options.without_penalties
        if options.gamma_step < STEP:
            coarse = replace(options, gamma_step=STEP)
            course = self.courses.get(contour.nodes)
            graph = self.job.graph(contour.nodes, coarse, only=nodes, external=course)
            if np.diff(graph.start).all():
                return graph
        return self.graph(contour.nodes, nodes)

    def _displacement(self, stretches: Sequence[Sequence[int]]) -> float:
        """Return the sum of the value functions; stretches must have a motion."""
        comfort, axes = self.job.options.without_penalties.comfort, self.job.robot.externals
        # Clearance is known only on the grid, and another course may have a motion.
        if not axes and (comfort is None or comfort.clearance is None):
            for c, first, last in stretches:
                self._require_motion(c, first, last)
        return sum(map(self._value_function, range(len(self.contours))))

    def _require_motion(self, index: int, first: int, last: int) -> None:
        """Refuse the placement if no motion is found along a stretch at the speed asked for."""
        contour, job = self.contours[index], self.job
        graph = self.graph(contour.nodes, np.arange(first, last + 1))
        run = contour.stretch(first, last, job.options.frames, timed=True)
        options = replace(
            job.options.without_penalties,
            objective="sum", closure="free", feed="constant", rotation=None, certify=None,
        )  # fmt: skip
        try:
            best_motion(run.nodes, job.setup_in(self.cell), options, speed=run.speed, graph=graph)
        except NoFeasiblePath as broken:
            raise self._infeasible(index, graph, broken, 2.0, first) from None

    def _value_function(self, index: int) -> float:
        """Return the value function of a contour; if it is infinite, the grid has no path."""
        contour, robot = self.contours[index], self.job.robot
        graph = self.graph(contour.nodes)
        options = self.job.options.resolve(robot, contour.interval)
        empty = np.diff(graph.start) == 0
        if empty.any():
            node = int(np.argmax(empty))
            reason = f"no pose, most often {graph.main_loss(node)}"
            sure = not robot.externals
            raise self._why("unreachable", 2.0, reason, index, node, searched=True, sure=sure)
        problem = SearchProblem(
            q=graph.q,
            start=graph.start,
            dt=contour.interval,
            limits=options.limits(robot),
            endless=robot.endless,
            weights=options.weights,
            metric=options.metric,
        )
        value = ContinuousSearch(problem, samples_of(graph)).value
        if value < np.inf:
            return value
        try:  # the grid search reports where the path breaks
            return find_shortest(
                replace(problem, limits=problem.limits.without_acceleration())
            ).cost
        except NoFeasiblePath as broken:
            raise self._infeasible(index, graph, broken, 2.0) from None

    def _is_closed(self, index: int, first: int, last: int, value: float) -> bool:
        """Return whether it is proved that no motion of this value passes nodes first to last."""
        job, contour = self.job, self.contours[index]
        options = job.options
        if not job.robot.encloses or options.tilt is not None:
            return False
        frames = job.placement @ contour.nodes.frames(options.frames)[first : last + 1]
        test = MotionTest(job.robot, frames, job.tool, options.postures)
        limits, middle = options.limits(job.robot), (last - first) // 2
        interval = longest_step(contour.nodes) / (value * self._unit(contour))
        return test.closed(limits, interval, middle) is not None


# -----------------------------------------------------------------------------
# The search for the best placement: on the grid, bounds guide it and exact searches decide.

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
