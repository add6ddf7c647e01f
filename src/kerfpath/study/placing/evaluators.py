"""Tests of a placement, on the grid and over continuous gamma, the fast ones first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
from pydantic import TypeAdapter

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.cell import Cell, CollisionChecker
from kerfpath.certifier import MotionTest
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.job import Job, cell_of_job
from kerfpath.kernels.metric import increments
from kerfpath.limits import Limits, rates_of
from kerfpath.losses import Loss, Reason
from kerfpath.planner import best_motion, external_course, longest_step, plan, samples_of
from kerfpath.search import (
    BeamWidth,
    ContinuousPath,
    ContinuousSearch,
    SearchProblem,
    find_shortest,
    shortest_path,
)
from kerfpath.study.loaded_job import EVERY, Evaluator, SampledContour

# -----------------------------------------------------------------------------
# Values of placements, contour by contour, and their comparison.

BOUND_ROUNDING = 1e-9
"""Relative amount by which rounding may lift a value above its bound."""

Stage = Literal["reach", "stretch", "exact", "estimate", "proved", "planned"]
"""Tests on the grid: reach, stretch, exact. Over continuous gamma: reach, estimate, and planned or
proved (to be no better than another placement)."""
Status = Literal["unreachable", "collision", "speed"]
"""Why a placement is infeasible."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContourValue:
    """The value of a placement for one contour, given by its index in the job, name and nodes.

    The value is in the unit of the goal; if only a part of the graph was searched, `at_least` is
    the value found there. A speed comes with the joint (from 1), the limit and the node that limit
    it.
    """

    index: int
    name: str
    nodes: int
    value: float | None = None
    at_least: float | None = None
    fastest_m_min: float | None = None
    joint: int | None = None
    limit: Literal["velocity", "acceleration"] | None = None
    node: int | None = None

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class Infeasibility:
    """Why a placement is infeasible, in which contour and at which node.

    A larger `progress` is nearer to being feasible. The index of the contour in the job, `index`,
    is known where a search found no path. `sure` is false if there may still be a plan.
    """

    status: Status
    progress: float
    reason: str
    contour: str | None = None
    node: int | None = None
    nodes: int | None = None
    index: int | None = None
    sure: bool = True

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacementValue:
    """The result for a placement, or for the worst of several.

    Parameters
    ----------
    stage : Stage
        The test that decided.
    bound, value : float, optional
        Bound on the value, and the value, exact on the grid or of plans over continuous gamma:
        m/min of the slowest contour, least ratio to the speeds asked for, or displacement (14).
        None where it is not known.
    estimate : float, optional
        Estimate of the value over continuous gamma; the value may be better or worse.
    slowest : int, optional
        Number of the stretch that the estimate comes from.
    infeasibility : Infeasibility, optional
    contours : tuple of ContourValue
        Values of the contours at the first placement.
    place : int
        Number of the worst placement.
    """

    stage: Stage
    bound: float | None = None
    value: float | None = None
    estimate: float | None = None
    slowest: int | None = None
    infeasibility: Infeasibility | None = None
    contours: tuple[ContourValue, ...] = ()
    place: int = 0

    __repr__ = short_repr

    @property
    def feasible(self) -> bool:
        """Whether the placement is feasible as far as is known."""
        return self.infeasibility is None

    @property
    def promise(self) -> float | None:
        """The best known figure: the value, or otherwise the bound, or the estimate."""
        known = (self.value, self.bound, self.estimate)
        return next((number for number in known if number is not None), None)

    @property
    def status(self) -> str:
        """The status of the infeasibility, or "feasible"."""
        return "feasible" if self.infeasibility is None else self.infeasibility.status

    @classmethod
    def from_data(cls, data: object) -> PlacementValue:
        """Return the value from the data that `dataclasses.asdict` made of it."""
        return _DATA.validate_python(data)

    def entry(self, *names: str) -> dict[str, object]:
        """Return the named fields that are known, also those of the infeasibility, for JSON."""
        known = {
            name: getattr(self, name) for name in ("status", "stage", "bound", "value", "estimate")
        }
        if self.infeasibility is not None:
            known |= {k: v for k, v in asdict(self.infeasibility).items() if v is not None}
        return {name: known[name] for name in names if name in known}


def is_better(goal: str, value: float, other: float | None) -> bool:
    """Return whether a value is better than another, by more than rounding."""
    if other is None:
        return True
    if goal == "motion":
        return value < other * (1 - BOUND_ROUNDING)
    return value > other * (1 + BOUND_ROUNDING)


def is_estimated(value: PlacementValue) -> bool:
    """Return whether only an estimate says that a placement is not the best.

    This includes displacements where no motion was found along a stretch or by the value function,
    and external axes where no motion was found along one of their courses.
    """
    why = value.infeasibility
    return value.stage == "estimate" and (why is None or not why.sure)


def worst_of(goal: str, values: Sequence[float]) -> float:
    """Return the worst of some values."""
    return max(values) if goal == "motion" else min(values)


_DATA = TypeAdapter(PlacementValue)


# -----------------------------------------------------------------------------
# The tests of a placement on the grid; all except the last give a proved bound.
#
# - Reach: the layers of every `EVERY`-th node, with all their poses. A node without a pose, or in a
#   cell without a clear pose, makes the placement infeasible, because every path visits every node.
# - Stretch: some consecutive nodes on the full grid, solved exactly. The part of a path on the
#   stretch keeps the same limits as the path, so no path is faster than the stretch allows, and no
#   path is clear where none along the stretch is. The displacement is bounded by paths over every
#   `EVERY`-th node with steps of up to `EVERY` times the velocity limit. By the triangle inequality
#   of the metric these are no longer than the steps between the nodes; this also holds for endless
#   axes, because the short way round is the shortest.
# - Exact: the contours on the job's own grid. Where only the worst contour counts, the others need
#   only a good enough path on every `THIN`-th sample of gamma: a path on part of the graph is also
#   a path on the full graph.

THIN = 4
"""Spacing, in steps of gamma, of the samples for a path that is good enough."""
PER_METRE = 1e-3
"""Weight of the distance from the base (1/m) between placements that are equally out of reach."""
TOLERATED = 1e-6
"""Share by which steps over several nodes may exceed the limit, since each step has a tolerance."""
UNLIMITED = 1e12
"""rad/s^2."""


class InfeasiblePlacement(Exception):
    """Raised where a test shows that the placement is infeasible."""

    def __init__(self, why: Infeasibility) -> None:
        super().__init__(why.reason)
        self.why = why


@dataclass(kw_only=True, eq=False)
class PlacementEvaluator(Evaluator):
    """The tests of one placement on the grid; the job is already moved there.

    Parameters
    ----------
    goal : {"speed", "margin", "motion"}
    contours : tuple of SampledContour
    """

    goal: str
    contours: tuple[SampledContour, ...]
    graphs: list[LayeredGraph] = field(default_factory=list)

    off_grid: ClassVar[bool] = False
    """Whether gamma is continuous instead of on its grid."""
    last: ClassVar[Stage] = "exact"
    """The test that finds the value."""

    __repr__ = short_repr

    def evaluate(
        self,
        stretches: Sequence[Sequence[int]],
        *,
        exact: bool,
        whole: bool,
        floor: float | None,
        least: float | None,
    ) -> PlacementValue:
        """Return the value of this placement; `least` is the worst value of the others so far."""
        stage: Stage = "reach"
        try:
            self._require_poses()
            bound = self._bound(stretches)
            stage = "stretch"
            beaten = (
                bound is not None and floor is not None and not is_better(self.goal, bound, floor)
            )
            if not exact or (beaten and not whole):
                return PlacementValue(stage=stage, bound=bound)
            stage = self.last
            order = dict.fromkeys([*(s[0] for s in stretches), *range(len(self.contours))])
            return self._solve(list(order), floor, least, whole=whole)
        except InfeasiblePlacement as found:
            return PlacementValue(stage=stage, infeasibility=found.why)

    @cached_property
    def cell(self) -> Cell | None:
        """The cell; a part or fixture that overlaps the robot base counts as a collision."""
        try:
            return cell_of_job(self.job, self.part)
        except InputError as overlap:
            why = Infeasibility(status="collision", progress=1.0, reason=str(overlap))
            raise InfeasiblePlacement(why) from None

    def _require_poses(self) -> None:
        """Require a pose, or in a cell a clear pose, at every `EVERY`-th node."""
        self.graphs = [
            self.graph(contour.nodes, np.arange(0, len(contour.nodes), EVERY))
            for contour in self.contours
        ]
        empty = [np.diff(graph.start) == 0 for graph in self.graphs]
        self._require_none("unreachable", empty, 0.0)
        if self.cell is not None:
            blocked = [np.zeros(len(graph.start) - 1, dtype=np.bool_) for graph in self.graphs]
            for graph, here in zip(self.graphs, blocked, strict=True):
                here[list(self.blocked(graph))] = True
            self._require_none("collision", blocked, 1.0)

    def _require_none(self, status: Status, bad: list[Bools], so_far: float) -> None:
        """Refuse the placement if any node is bad, and name the first bad node."""
        share = 1.0 - float(np.concatenate(bad).mean())
        middle = np.mean([contour.nodes.points.mean(axis=0) for contour in self.contours], axis=0)
        placement = self.job.placement
        away = float(np.linalg.norm(placement[:3, :3] @ middle + placement[:3, 3]))
        progress = so_far + share - PER_METRE * away
        for c, here in enumerate(bad):
            if here.any():
                k, reason = int(np.argmax(here)), "no clear pose"
                if status == "unreachable":
                    reason = f"no pose, most often {self.graphs[c].main_loss(k)}"
                raise self._why(status, progress, reason, c, EVERY * k, searched=False)

    def _bound(self, stretches: Sequence[Sequence[int]]) -> float | None:
        """Return a bound on the value of every path at this placement; None where there is none."""
        values = []
        for c, first, last in stretches:
            contour, frames = self.contours[c], self.job.options.frames
            graph = self.graph(contour.nodes, np.arange(first, last + 1))
            run = contour.stretch(first, last, frames, timed=self.goal == "motion")
            try:
                values.append(self._value(c, run, graph)[0])
            except NoFeasiblePath as broken:
                raise self._infeasible(c, graph, broken, 2.0, first) from None
        if self.goal == "motion":
            return sum(map(self._least_displacement, range(len(self.contours))))
        return worst_of(self.goal, values) if values else None

    def _value(
        self,
        index: int,
        contour: SampledContour,
        graph: LayeredGraph | None,
        enough: float | None = None,
    ) -> tuple[float, ContourValue]:
        """Return the value of a contour on a graph, and the same with the limit that is reached.

        Without a graph the contour is planned as `kerfpath plan` does. Off the grid, a speed or
        margin of `enough` or more may be returned although more is possible.
        """
        known = ContourValue(index=index, name=contour.name, nodes=len(contour.nodes))
        if self.goal == "motion":
            cost = self._plan_cost(contour, graph)
            return cost, replace(known, value=cost)
        if enough is not None:
            enough *= self._unit(contour)
        found = self.fastest(contour.nodes, graph, off_grid=self.off_grid, enough=enough)
        value = found.speed / contour.speed if self.goal == "margin" else found.speed * 60
        return value, replace(
            known,
            value=value,
            fastest_m_min=found.speed * 60,
            joint=found.joint + 1,
            limit=found.limit,
            node=found.node,
        )

    def _unit(self, contour: SampledContour) -> float:
        """Return the speed (m/s) of a contour for which the value is one."""
        return contour.speed if self.goal == "margin" else 1 / 60

    def _plan_cost(self, contour: SampledContour, graph: LayeredGraph | None) -> float:
        options = replace(
            self.job.options.without_penalties,
            method="continuous" if self.off_grid else "exact",
            objective="sum", feed="constant", refine=False, certify=None, between_nodes="reported",
        )  # fmt: skip
        if not contour.nodes.closed:
            options = replace(options, closure="free")  # a stretch of a closed loop is open
        speed = contour.speed if contour.nodes.time is None else None
        return plan(
            contour.nodes, self.job.robot, tool=self.job.tool, placement=self.job.placement,
            speed=speed, options=options, cell=self.cell, graph=graph,
        ).cost  # fmt: skip

    def _least_displacement(self, index: int) -> float:
        """Return a lower bound on the displacement along a contour, from every `EVERY`-th node."""
        contour, graph, robot = self.contours[index], self.graphs[index], self.job.robot
        if len(graph.start) < 3:
            return 0.0
        options = self.job.options.resolve(robot, contour.interval)
        velocity, _ = robot.speed_limits()
        try:
            return shortest_path(
                graph.q,
                graph.start,
                dt=EVERY * contour.interval,
                velocity=velocity * (1 + TOLERATED),
                acceleration=np.full(len(velocity), UNLIMITED),
                endless=robot.endless,
                weights=options.weights,
                metric=options.metric,
                eta_v=options.eta_v,
            ).cost
        except NoFeasiblePath as broken:
            raise self._infeasible(index, graph, broken, 2.0, step=EVERY) from None

    def _solve(
        self, order: list[int], floor: float | None, least: float | None, *, whole: bool
    ) -> PlacementValue:
        """Solve the contours until the value is known, or can no longer beat the floor.

        The speed is that of the slowest contour. Displacements add up; contours that are not solved
        yet count with their bounds.
        """
        motion, solved = self.goal == "motion", dict[int, ContourValue]()
        left = {c: self._least_displacement(c) for c in order} if motion else {}
        for c in order:
            graph = self.graph(self.contours[c].nodes)
            try:
                value, solved[c] = self._solved(c, graph, None if motion or whole else least)
            except NoFeasiblePath as broken:
                raise self._infeasible(c, graph, broken, 2 + len(solved) / len(order)) from None
            if motion:
                left[c] = value
                least = sum(left.values())
            else:
                least = value if least is None else worst_of(self.goal, [least, value])
            if floor is not None and not whole and not is_better(self.goal, least, floor):
                return self._known(least, None, solved)
        return self._known(least, least, solved)

    def _known(
        self, bound: float | None, value: float | None, solved: Mapping[int, ContourValue]
    ) -> PlacementValue:
        """Return the result of the last test, with the contours in the order of the job."""
        contours = tuple(solved[c] for c in sorted(solved))
        return PlacementValue(stage=self.last, bound=bound, value=value, contours=contours)

    def _solved(
        self, index: int, graph: LayeredGraph, least: float | None
    ) -> tuple[float, ContourValue]:
        """Return the value of a contour, or `least` where the value is at least that."""
        enough = None if least is None else self._enough(index, graph, least)
        if least is not None and enough is not None:
            return least, enough
        return self._value(index, self.contours[index], graph)

    def _enough(self, index: int, graph: LayeredGraph, least: float) -> ContourValue | None:
        """Return a value found on a part of the graph, if it is `least` or more."""
        thin = graph.without({Reason(Loss.LEFT_OUT): graph.sample % THIN != 0})
        try:
            value, known = self._value(index, self.contours[index], thin)
        except NoFeasiblePath:
            return None
        if value < least:
            return None
        return ContourValue(index=index, name=known.name, nodes=known.nodes, at_least=value)

    def _infeasible(
        self,
        index: int,
        graph: LayeredGraph,
        broken: NoFeasiblePath,
        progress: float,
        first: int = 0,
        step: int = 1,
    ) -> InfeasiblePlacement:
        """Return why and where a contour has no path."""
        status: Status = "speed"
        if not graph.has_poses_throughout:
            status = "unreachable"
        elif self.goal != "motion" or broken.lost_by(Loss.COLLISION):
            status = "collision"
        node = first + step * (broken.node + 1)
        sure = status != "speed" and not self.job.robot.externals
        return self._why(status, progress, str(broken), index, node, searched=True, sure=sure)

    def _why(
        self, status: Status, progress: float, reason: str, index: int, node: int, *,
        searched: bool, sure: bool = True,
    ) -> InfeasiblePlacement:  # fmt: skip
        contour = self.contours[index]
        return InfeasiblePlacement(
            Infeasibility(
                status=status,
                progress=progress,
                reason=reason,
                contour=contour.name,
                node=node,
                nodes=len(contour.nodes),
                index=index if searched else None,
                sure=sure,
            )
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
# The tests of a placement over continuous gamma: an estimate, the value of plans, and a proof.
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
