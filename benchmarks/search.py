"""The search through a real layered graph, beside a dense recursion and Tesseract's Descartes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from benchmarks import _arm
from benchmarks._dense import Metric, dense_cost
from benchmarks._descartes import NotRun, Task, solve
from benchmarks._figures import Figure, Report, in_turn, peak_megabytes
from kerfpath import LayeredPath, Robot, shortest_path
from kerfpath.arrays import Array
from kerfpath.graph import LayeredGraph
from kerfpath.planner import layered_graph, node_interval

__all__ = ["run"]

SPEED = 10 / 60
"""Cutting speed, m/s."""
FREE = 1e6
"""A limit, rad/s or rad/s^2 times 1e6, that is never active."""

STEPPING = 3.0
"""Multiple of the arm's accelerations at which they are active but still let gamma step."""

HOW_LIMITED = """\
A closed wavy contour on a cylinder, IRB 2400, all postures, axes 4 and 6 endless, 10 m/min,
velocity limits on. First-order: `shortest_path` with acceleration limits that never bind. Dense:
the plain recursion over every edge in `benchmarks/_dense.py`, which yields the cost but no path.
Both search on one core, time their preparation of the arrays with it, and take turns; the graph is
built on all cores. The paper's method and the exact one are given three times the assumed 600 to
3000 deg/s^2: at this spacing of nodes and gamma less would never let gamma step. Memory: by how
much the process peaks above its level before the call."""

HOW_PEER = """\
The same contour as Descartes can pose it: joints in plain ranges of at most one turn, no coupling
of joints 2 and 3, no velocity limit (so more poses are admitted, and gamma is sampled more
coarsely for the same number of vertices). Descartes runs in a process of its own, without
collision checks, from the tip poses to the path (inverse kinematics, graph, search); its graph
stores every edge, and it adds up the squares of the Euclidean joint steps. kerfpath has no such
objective: `layered_graph` and `shortest_path` do the same work from the same poses for the plain
Euclidean steps (metric "euclid", weights 1); the dense recursion does both. Without a velocity
limit kerfpath's windows leave nothing out. Memory: by how much each process peaks above its level
before the call."""

Method = Literal["paper", "exact"]
Searched = Literal["manhattan", "euclid"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Problem:
    """A layered graph and the arguments of its search."""

    robot: Robot
    graph: LayeredGraph
    dt: float
    velocity: Array
    weights: Array

    def search(
        self, metric: Searched, acceleration: Array, method: Method = "exact"
    ) -> LayeredPath:
        return shortest_path(
            self.graph.q,
            self.graph.start,
            dt=self.dt,
            velocity=self.velocity,
            acceleration=acceleration,
            endless=self.robot.endless,
            weights=self.weights,
            metric=metric,
            method=method,
        )

    def dense(self, metric: Metric) -> float:
        return dense_cost(
            self.graph.q,
            self.graph.start,
            dt=self.dt,
            velocity=self.velocity,
            endless=self.robot.endless,
            weights=self.weights,
            metric=metric,
        )


def run(*, quick: bool) -> list[Report]:
    """Measure both problems."""
    nodes, limited, plain = (100, 60, 40) if quick else (1000, 371, 243)
    return [_limited(nodes, limited, quick=quick), _peer(nodes, plain, quick=quick)]


def _build(robot: Robot, nodes: int, samples: int) -> LayeredGraph:
    return layered_graph(
        _arm.wave(nodes),
        robot,
        tool=_arm.tool(),
        placement=_arm.placement(),
        gamma_step=2 * np.pi / samples,
    )


def _limited(nodes: int, samples: int, *, quick: bool) -> Report:
    robot = _arm.arm()
    velocity, acceleration = robot.speed_limits()
    dt = node_interval(_arm.wave(nodes), SPEED)
    graph = _build(robot, nodes, samples)
    problem = _Problem(
        robot=robot, graph=graph, dt=dt, velocity=velocity, weights=1 / (velocity * dt)
    )
    free = acceleration * FREE
    cost: dict[str, float] = {}
    proved: dict[str, bool] = {}

    def path(
        name: str, metric: Searched, limit: Array, method: Method = "exact"
    ) -> Callable[[], None]:
        def call() -> None:
            found = problem.search(metric, limit, method)
            cost[name], proved[name] = found.cost, found.optimal

        return call

    def dense(name: str, metric: Searched) -> Callable[[], None]:
        def call() -> None:
            cost[name] = problem.dense(metric)

        return call

    calls: dict[str, Callable[[], None]] = {
        "graph, all cores": lambda: _drop(_build(robot, nodes, samples))
    }
    metrics: tuple[Searched, ...] = ("manhattan", "euclid")
    for metric in metrics:
        calls[f"kerfpath first-order, {metric}"] = path(
            f"kerfpath first-order, {metric}", metric, free
        )
        calls[f"dense recursion, {metric}"] = dense(f"dense recursion, {metric}", metric)
    methods: tuple[Method, ...] = ("paper", "exact")
    for method in methods:
        name = f"kerfpath {method} method under accelerations, manhattan"
        calls[name] = path(name, "manhattan", STEPPING * acceleration, method)
    seconds = in_turn(calls, 3 if quick else 7)
    peaks = {name: peak_megabytes(call) for name, call in calls.items()}
    figures = [
        Figure(what=name, values=taken, note=_note(name, cost, proved, peaks))
        for name, taken in seconds.items()
    ]
    sizes = np.diff(graph.start)
    findings = [
        f"{len(graph.q)} vertices in {nodes} layers, {sizes.mean():.0f} a layer ({sizes.min()} to "
        f"{sizes.max()}); {int((sizes[1:] * sizes[:-1]).sum())} edges before any limit"
    ]
    for metric in metrics:
        ours, theirs = f"kerfpath first-order, {metric}", f"dense recursion, {metric}"
        findings.append(
            f"{metric}: the dense recursion takes {_ratio(seconds, theirs, ours):.2f} times as "
            f"long; relative difference of the optima {abs(cost[ours] / cost[theirs] - 1):.0e}"
        )
    return Report(
        title=f"Search with velocity limits, {nodes} nodes x {sizes.mean():.0f} vertices",
        how=HOW_LIMITED,
        figures=figures,
        findings=findings,
    )


def _peer(nodes: int, samples: int, *, quick: bool) -> Report:
    robot = _arm.arm_of_one_turn()
    graph = _build(robot, nodes, samples)
    frames = np.ascontiguousarray(_arm.placement() @ _arm.wave(nodes).frames("rotation-minimising"))
    free = np.full(6, FREE)
    problem = _Problem(robot=robot, graph=graph, dt=1.0, velocity=free, weights=np.ones(6))
    found: list[LayeredPath] = []

    def search(on: _Problem) -> None:
        found[:] = [on.search("euclid", free)]

    def whole() -> None:
        built = _build(robot, nodes, samples)
        search(_Problem(robot=robot, graph=built, dt=1.0, velocity=free, weights=np.ones(6)))

    calls: dict[str, Callable[[], None]] = {
        "kerfpath, poses to path": whole,
        "kerfpath, search alone": lambda: search(problem),
        "dense recursion, search alone": lambda: _drop(problem.dense("euclid")),
    }
    seconds = in_turn(calls, 3 if quick else 5)
    figures = [
        Figure(what=name, values=taken, note=f"+{peak_megabytes(calls[name]):.0f} MB")
        for name, taken in seconds.items()
    ]
    sizes = np.diff(graph.start)
    findings = [
        f"{len(graph.q)} vertices, {sizes.mean():.0f} a layer",
        f"optimum of the Euclidean steps: kerfpath {found[0].cost:.9f}, dense recursion "
        f"{problem.dense('euclid'):.9f} rad",
    ]
    name = "Tesseract Descartes, poses to path"
    task = Task(
        robot=robot, tool=_arm.tool(), frames=frames, samples=samples, sizes=sizes.tolist(), runs=3
    )
    try:
        theirs = solve(task)
    except NotRun as why:
        figures.append(Figure(what=name, note=str(why)))
    else:
        note = f"+{theirs.peak_megabytes:.0f} MB, {theirs.cores_busy:.1f} cores busy"
        figures.append(Figure(what=name, values=theirs.seconds, note=note))
        seconds[name] = theirs.seconds
        squares = float((np.diff(theirs.q, axis=0) ** 2).sum())
        at = robot.forward(theirs.q) @ _arm.tool()
        off = np.abs(at[:, :3, 2:] - frames[:, :3, 2:]).max()
        findings += [
            f"optimum of their squares: Descartes {squares:.12f}, dense recursion on kerfpath's "
            f"graph {problem.dense('squared'):.12f} rad^2; the tips and tool axes of Descartes' "
            f"path are within {off:.0e} (m or 1) of the poses, by kerfpath's kinematics",
            f"Descartes takes {_ratio(seconds, name, 'kerfpath, poses to path'):.1f} times as long "
            "as kerfpath, poses to path",
        ]
    return Report(
        title=f"Search as Descartes poses it, {nodes} nodes x {sizes.mean():.0f} vertices",
        how=HOW_PEER,
        figures=figures,
        findings=findings,
    )


def _drop(value: object) -> None:
    """Drop the value that a call returns."""


def _ratio(seconds: dict[str, list[float]], above: str, below: str) -> float:
    return float(np.median(seconds[above]) / np.median(seconds[below]))


def _note(
    name: str, cost: dict[str, float], proved: dict[str, bool], peaks: dict[str, float]
) -> str:
    parts = [f"cost {cost[name]:.4f}"] if name in cost else []
    if name in proved:
        parts.append("proved optimal" if proved[name] else "not proved: the limit binds")
    return ", ".join([*parts, f"+{peaks[name]:.0f} MB"])
