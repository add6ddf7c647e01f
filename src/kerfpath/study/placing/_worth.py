"""What a placement is worth, by tests that grow dearer: each but the last is a bound, all proved.

- Reach: the layers of every `EVERY`-th node alone, with all their poses. A node without a pose, or
  in a cell without a clear one, ends it: every path visits every node.
- Stretch: a run of nodes on the whole grid, solved exactly. The part of a path on them keeps what
  the path keeps, so no path is faster than the stretch lets it be, and none is clear where no path
  along the stretch is. The displacement is bounded by paths over every `EVERY`-th node whose steps
  keep that many times the velocity limit: by the triangle inequality of the metric they are no
  longer than the steps between them, on endless axes too, as the short way round is the shortest.
- Exact: the contours on the job's own grid. Where only the worst contour counts, others are left at
  a path on every `THIN`-th gamma that is good enough: what a part of the graph allows, all of it
  does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np

from kerfpath._arrays import Bools, Ints
from kerfpath._told import told
from kerfpath.cad import Part
from kerfpath.cell import Cell, Checker
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.job import Job, cell_of_job
from kerfpath.losses import Loss, Reason
from kerfpath.options import PlanOptions
from kerfpath.planner import fastest_speed, plan
from kerfpath.search import shortest_path
from kerfpath.study._clear import has_clear_pose
from kerfpath.study.placing._subject import Subject

__all__ = ["SLACK", "Answer", "Worth", "beats", "worst_of"]

EVERY = 8
"""Nodes between those of the first test."""
THIN = 4
"""Steps of gamma between the samples of a path that is good enough."""
SLACK = 1e-9
"""Relative: by how much rounding may lift a value over its bound."""
PER_METRE = 1e-3
"""What a metre from the base counts between placements that are out of reach alike."""
TOLERATED = 1e-6
"""Share by which steps over several nodes may exceed the limit: each step has a tolerance."""

Answer = dict[str, Any]
"""What is known of a placement, as plain data; see `look`."""

UNLIMITED = 1e12
"""rad/s^2."""


class Lost(Exception):
    """The placement is infeasible, and why."""

    def __init__(self, status: str, progress: float, **told: Any) -> None:
        self.answer: Answer = {"status": status, "progress": progress, **told}


def beats(goal: str, value: float, other: float | None) -> bool:
    """Return whether a value is better than another, by more than rounding."""
    if other is None:
        return True
    if goal == "motion":
        return value < other * (1 - SLACK)
    return value > other * (1 + SLACK)


def worst_of(goal: str, values: Sequence[float]) -> float:
    """Return the worst of some values."""
    return max(values) if goal == "motion" else min(values)


@dataclass(kw_only=True, eq=False)
class Worth:
    """One placement, and the tests of it."""

    job: Job
    part: Part
    goal: str
    subjects: tuple[Subject, ...]
    seconds: dict[str, float]
    graphs: list[LayeredGraph] = field(default_factory=list)

    __repr__ = told

    def answer(
        self,
        stretches: Sequence[Sequence[int]],
        *,
        exact: bool,
        whole: bool,
        floor: float | None,
        least: float | None,
    ) -> Answer:
        """Return what this placement is worth; `least` is what another has come down to."""
        stage, bound = "reach", None
        try:
            with self._timed("reach"):
                self._reach()
            with self._timed("stretch"):
                stage, bound = "stretch", self._bound(stretches)
            beaten = bound is not None and floor is not None and not beats(self.goal, bound, floor)
            if not exact or (beaten and not whole):
                return {"status": "feasible", "stage": stage, "bound": bound, "value": None}
            with self._timed("exact"):
                stage = "exact"
                order = dict.fromkeys([*(s[0] for s in stretches), *range(len(self.subjects))])
                if self.goal == "motion":
                    found = self._displacement(list(order), floor)
                else:
                    found = self._speeds(list(order), floor, least, whole=whole)
        except Lost as lost:
            return {"stage": stage, "bound": None, "value": None} | lost.answer
        return {"status": "feasible", "stage": stage} | found

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        begun = perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] += perf_counter() - begun

    @cached_property
    def cell(self) -> Cell | None:
        """The cell; a part or fixture that would stand in the robot's base is a collision."""
        try:
            return cell_of_job(self.job, self.part)
        except InputError as overlap:
            raise Lost("collision", 1.0, reason=str(overlap)) from None

    @property
    def _options(self) -> PlanOptions:
        """What every search takes: margins are kept, what comfort and tilt cost plays no part."""
        return self.job.options.without_penalties

    def _graph(self, subject: Subject, nodes: Ints | None = None) -> LayeredGraph:
        return self.job.graph(subject.nodes, self._options, only=nodes)

    def _reach(self) -> None:
        """Require a pose, and in a cell a clear one, of every `EVERY`-th node."""
        self.graphs = [self._graph(s, np.arange(0, len(s.nodes), EVERY)) for s in self.subjects]
        empty = [np.diff(graph.start) == 0 for graph in self.graphs]
        self._require_none("unreachable", empty, 0.0)
        if self.cell is not None:
            closed = [_closed(graph, self.cell) for graph in self.graphs]
            self._require_none("collision", closed, 1.0)

    def _require_none(self, status: str, bad: list[Bools], so_far: float) -> None:
        """Lose the placement where any node is bad, and say which is the first."""
        share = 1.0 - float(np.concatenate(bad).mean())
        middle = np.mean([subject.nodes.points.mean(axis=0) for subject in self.subjects], axis=0)
        placement = self.job.placement
        away = float(np.linalg.norm(placement[:3, :3] @ middle + placement[:3, 3]))
        for subject, graph, here in zip(self.subjects, self.graphs, bad, strict=True):
            if here.any():
                k = int(np.argmax(here))
                most = f"no pose, most often {graph.main_loss(k)}"
                why = "no clear pose" if status == "collision" else most
                where = {"contour": subject.name, "node": EVERY * k, "nodes": len(subject.nodes)}
                raise Lost(status, so_far + share - PER_METRE * away, reason=why, **where)

    def _bound(self, stretches: Sequence[Sequence[int]]) -> float | None:
        """Return what no path of this placement can beat, None where nothing is known."""
        values = []
        for c, first, last in stretches:
            graph = self._graph(self.subjects[c], np.arange(first, last + 1))
            frames, motion = self.job.options.frames, self.goal == "motion"
            run = self.subjects[c].stretch(first, last, frames, timed=motion)
            try:
                values.append(self._value(run, graph)["value"])
            except NoFeasiblePath as broken:
                raise self._lost(self.subjects[c], graph, broken, 2.0, first) from None
        if self.goal == "motion":
            return sum(map(self._least_displacement, self.subjects, self.graphs))
        return worst_of(self.goal, values) if values else None

    def _value(self, subject: Subject, graph: LayeredGraph) -> Answer:
        """Return the value of a contour on a graph, and what binds."""
        if self.goal == "motion":
            return {"value": self._plan_cost(subject, graph)}
        found = fastest_speed(
            subject.nodes, self.job.robot, tool=self.job.tool, placement=self.job.placement,
            options=replace(self._options, refine=False), cell=self.cell, graph=graph,
        )  # fmt: skip
        fastest = found.speed * 60
        return {
            "value": found.speed / subject.speed if self.goal == "margin" else fastest,
            "fastest_m_min": fastest,
            "joint": found.joint + 1,
            "limit": found.limit,
            "node": found.node,
        }

    def _plan_cost(self, subject: Subject, graph: LayeredGraph) -> float:
        options = replace(
            self._options, method="exact", objective="sum", feed="constant", refine=False
        )
        if not subject.nodes.closed:
            options = replace(options, closure="free")  # a stretch of a loop that closes need not
        speed = subject.speed if subject.nodes.time is None else None
        return plan(
            subject.nodes, self.job.robot, tool=self.job.tool, placement=self.job.placement,
            speed=speed, options=options, cell=self.cell, graph=graph,
        ).cost  # fmt: skip

    def _least_displacement(self, subject: Subject, graph: LayeredGraph) -> float:
        """Return a displacement that none along a contour is below, by every `EVERY`-th node."""
        if len(graph.start) < 3:
            return 0.0
        options, robot = self.job.options.of(self.job.robot, subject.interval), self.job.robot
        velocity, _ = robot.speed_limits()
        try:
            return shortest_path(
                graph.q,
                graph.start,
                dt=EVERY * subject.interval,
                velocity=velocity * (1 + TOLERATED),
                acceleration=np.full(len(velocity), UNLIMITED),
                endless=robot.endless,
                weights=options.weights,
                metric=options.metric,
                eta_v=options.eta_v,
            ).cost
        except NoFeasiblePath as broken:
            raise self._lost(subject, graph, broken, 2.0, step=EVERY) from None

    def _speeds(
        self, order: list[int], floor: float | None, least: float | None, *, whole: bool
    ) -> Answer:
        """Solve the contours until none can be slower than the slowest, or all are beaten."""
        entries: dict[int, Answer] = {}
        for c in order:
            subject = self.subjects[c]
            graph = self._graph(subject)
            known = {"name": subject.name, "nodes": len(subject.nodes)}
            enough = None if whole or least is None else self._enough(subject, graph, least)
            if enough is not None:
                entries[c] = known | {"at_least": enough}
                continue
            try:
                entries[c] = known | self._value(subject, graph)
            except NoFeasiblePath as broken:
                raise self._lost(subject, graph, broken, 2 + len(entries) / len(order)) from None
            value = entries[c]["value"]
            least = value if least is None else worst_of(self.goal, [least, value])
            if floor is not None and not whole and not beats(self.goal, least, floor):
                return {"bound": least, "value": None, "contours": _in_order(entries)}
        return {"bound": least, "value": least, "contours": _in_order(entries)}

    def _enough(self, subject: Subject, graph: LayeredGraph, least: float) -> float | None:
        """Return a value that is reached on a part of the graph, if it is `least` or more."""
        thin = graph.without({Reason(Loss.LEFT_OUT): graph.sample % THIN != 0})
        try:
            value = float(self._value(subject, thin)["value"])
        except NoFeasiblePath:
            return None
        return value if value >= least else None

    def _displacement(self, order: list[int], floor: float | None) -> Answer:
        """Solve the contours until their displacement, with what the others need, is beaten."""
        entries: dict[int, Answer] = {}
        left = {c: self._least_displacement(self.subjects[c], self.graphs[c]) for c in order}
        for c in order:
            subject = self.subjects[c]
            graph = self._graph(subject)
            try:
                cost = self._plan_cost(subject, graph)
            except NoFeasiblePath as broken:
                raise self._lost(subject, graph, broken, 2 + len(entries) / len(order)) from None
            left[c] = cost
            entries[c] = {"name": subject.name, "nodes": len(subject.nodes), "value": cost}
            total = sum(left.values())
            if floor is not None and not beats(self.goal, total, floor):
                return {"bound": total, "value": None, "contours": _in_order(entries)}
        total = sum(left.values())
        return {"bound": total, "value": total, "contours": _in_order(entries)}

    def _lost(
        self,
        subject: Subject,
        graph: LayeredGraph,
        broken: NoFeasiblePath,
        progress: float,
        first: int = 0,
        step: int = 1,
    ) -> Lost:
        """Say of a contour without a path why that is, and where it breaks."""
        if not np.diff(graph.start).all():
            status = "unreachable"
        elif self.goal != "motion" or broken.lost_by(Loss.COLLISION):
            status = "collision"
        else:
            status = "speed"
        return Lost(
            status,
            progress,
            reason=str(broken),
            index=self.subjects.index(subject),
            contour=subject.name,
            node=first + step * (broken.node + 1),
            nodes=len(subject.nodes),
        )


def _in_order(entries: Mapping[int, Answer]) -> list[Answer]:
    """Return the entries of contours as the job has them, each with its place in it."""
    return [{"index": c, **entries[c]} for c in sorted(entries)]


def _closed(graph: LayeredGraph, cell: Cell) -> Bools:
    """Return which layers (M,) bool have no pose that is clear of collisions."""
    checker, layers = Checker(cell, graph.q), range(len(graph.start) - 1)
    return np.array([not has_clear_pose(graph, checker, k) for k in layers])
