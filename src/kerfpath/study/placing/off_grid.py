"""Tests of a placement over continuous gamma: an estimate, the value of plans, and a proof.

- Reach: as on the grid. This also holds for plans, which start from the samples of gamma: a node
  without a pose, or without a clear pose, at any of them has no plan.
- Estimate of a speed: the fastest speed that beams find along stretches around limiting nodes,
  from few samples of gamma with interpolated joints. A stretch can be cut at least as fast as the
  full contour, but the path found there is neither the fastest nor exactly a motion.
- Estimate of a displacement: the value function, which is interpolated between samples and
  ignores accelerations, closures and limits of rotation. A motion must also be found along the
  stretches that could not be cut at other placements.
- Proved: around a limiting node no motion is as fast as at another placement, at any gamma,
  posture and turn. This proves only that the placement is not better.
- With external axes all of this applies along their most promising course, which plans may leave.
  Reach is the result of the search for that course, from which plans start. No estimate refuses a
  placement for sure, and nothing is proved.
- Planned: the fastest speed as found by `kerfpath speed`, or the cost as found by `kerfpath
  plan`. For a contour that is at least as fast as the slowest one, no better value is searched.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.cell import CollisionChecker
from kerfpath.certifier import MotionTest
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.job import Job
from kerfpath.kernels.metric import increments
from kerfpath.limits import Limits, rates_of
from kerfpath.losses import Loss, Reason
from kerfpath.planner import best_motion, external_course, longest_step, samples_of
from kerfpath.search import (
    BeamWidth,
    ContinuousPath,
    ContinuousSearch,
    SearchProblem,
    find_shortest,
)
from kerfpath.study.loaded_job import SampledContour
from kerfpath.study.placing.grid import (
    ContourValue,
    InfeasiblePlacement,
    PlacementEvaluator,
    PlacementValue,
    Stage,
    Status,
)

# -----------------------------------------------------------------------------
# Estimate how fast nodes can be cut over continuous gamma, by beams without refinement.

BEAM = BeamWidth(200, (0.5, 0.5))
"""States kept in each layer. On nine placements of two contours of the demo, paths were 0 to 6 %
slower than the fastest motion found, and eight times as many states did not improve that."""
LONGER, CLOSE = 1.3, 1.01
"""Factor between speeds tried until one is too high, and factor by which the answer may be off."""
HELD = 1e-3
"""Share by which a path may be slower than the speed asked for."""
MOST_SEARCHES = 10
"""Number of searches for a path that is clear at the samples next to it."""


@dataclass(kw_only=True, eq=False)
class Beams:
    """A search for the fastest path by beams; in a cell it is clear at the samples next to it.

    Parameters
    ----------
    graph : LayeredGraph
        A graph without empty layers.
    limits : Limits
    endless : (n,) bool
    checker : CollisionChecker or None
        Checks the vertices of the graph.
    """

    graph: LayeredGraph
    limits: Limits
    endless: Bools
    checker: CollisionChecker | None = None
    cost: Array = field(init=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        self.cost = np.zeros(len(self.graph.q))

    def least_interval(self, held: float, enough: float | None = None) -> float:
        """Return an estimate of the least interval between the nodes, s.

        Joints between two samples are interpolated and no other starts are tried, so true motions
        may be faster or slower.

        Parameters
        ----------
        held : float s
            An interval for which there is a path.
        enough : float s, optional
            An interval that is short enough.
        """
        best = held
        if enough is not None and enough < held:
            best = min(best, self._interval(enough))
            if best <= enough * (1 + HELD):
                return best
        missed = enough
        while missed is None or best > CLOSE * missed:
            tried = best / LONGER if missed is None else np.sqrt(best * missed)
            found = self._interval(tried)
            if found > tried * (1 + HELD):
                missed = tried
            best = min(best, found)
        return best

    def _interval(self, asked: float) -> float:
        """Return the interval needed by a path searched for `asked`; infinite without a path."""
        path = self._path(asked)
        if path is None:
            return np.inf
        v, a = rates_of(increments(path.q, self.endless), np.ones(len(path.q) - 1))
        fast = (np.abs(v) / self.limits.velocity.usable).max(initial=0.0)
        sharp = (np.abs(a) / self.limits.acceleration.usable_at(path.q[1:-1])).max(initial=0.0)
        return float(max(fast, np.sqrt(sharp)))

    def _path(self, dt: float) -> ContinuousPath | None:
        problem = SearchProblem(
            q=self.graph.q, start=self.graph.start, dt=dt, limits=self.limits,
            endless=self.endless, weights=1 / self.limits.velocity.bound, metric="manhattan",
        )  # fmt: skip
        samples = samples_of(self.graph)
        for _ in range(MOST_SEARCHES):
            search = ContinuousSearch(replace(problem, vertex_cost=self.cost.copy()), samples)
            path = next(search.paths(BEAM), None)
            if path is None or self.checker is None:
                return path
            ends = np.unique(np.concatenate([path.one, path.other]))
            blocked = ends[~np.isfinite(self.checker.price(ends))]
            if not blocked.size:
                return path
            self.cost[blocked] = np.inf
        return None


# -----------------------------------------------------------------------------
# The tests of a placement.

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
            if graph.has_poses_throughout:
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
