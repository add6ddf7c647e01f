"""Tests of a placement on the grid, the fast ones first; all except the last give a proved bound.

- Reach: the layers of every `EVERY`-th node, with all their poses. A node without a pose, or in a
  cell without a clear pose, makes the placement infeasible, because every path visits every node.
- Stretch: some consecutive nodes on the full grid, solved exactly. The part of a path on the
  stretch keeps the same limits as the path, so no path is faster than the stretch allows, and no
  path is clear where none along the stretch is. The displacement is bounded by paths over every
  `EVERY`-th node with steps of up to `EVERY` times the velocity limit. By the triangle inequality
  of the metric these are no longer than the steps between the nodes; this also holds for endless
  axes, because the short way round is the shortest.
- Exact: the contours on the job's own grid. Where only the worst contour counts, the others need
  only a good enough path on every `THIN`-th sample of gamma: a path on part of the graph is also a
  path on the full graph.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
from pydantic import TypeAdapter

from kerfpath.arrays import Bools, short_repr
from kerfpath.cell import Cell
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.job import cell_of_job
from kerfpath.losses import Loss, Reason
from kerfpath.planner import plan
from kerfpath.search import (
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
# The tests of a placement.

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
